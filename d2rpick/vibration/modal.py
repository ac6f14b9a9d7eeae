"""Identify a vibration with any number of modes from the spectral lines of the energy, and list all doubts about it.

Lines can be interpreted in more than one way: the interpretations differ in how much of the mean is static, and in
which lines are due to a static deformation rather than a mode. The best interpretation is used; the others, and the
lines of the record's first part, widen the error band of its residuals. If the record is not that of a linear structure
in free flight, the doubts give the reason.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.tuples import NamedTuple
from d2rpick.vibration import measures
from d2rpick.vibration.close_modes import find_close_modes
from d2rpick.vibration.doubts import (
    MOST_BEYOND,
    MOST_MISSED,
    MOST_NEGATIVE,
    StaticEnergy,
    measure_doubts,
)
from d2rpick.vibration.hidden_energy import (
    RESOLVED,
    find_most_hidden,
    measure_hidden_pairs,
)
from d2rpick.vibration.line_scatter import LineScatter
from d2rpick.vibration.lines import FIRST_PART, make_even_grid, predict
from d2rpick.vibration.locked_lines import (
    ABOVE_SCATTER,
    NOTABLE,
    StretchLine,
    find_stretches,
    measure_third_harmonic,
)
from d2rpick.vibration.measures import Profile
from d2rpick.vibration.midpoint import Reading
from d2rpick.vibration.modes import SOLVER_FLOOR
from d2rpick.vibration.refined_lines import refine_prediction

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.doubts import Doubts
    from d2rpick.vibration.lines import (
        Complex,
        Exponentials,
        Grid,
        Prediction,
        Spectrum,
    )
    from d2rpick.vibration.locked_lines import ThirdHarmonic

    Mask = NDArray[np.bool_]

# Smallest number of states in which spectral lines are identified.
FEWEST_STATES: Final = 32
# A static energy up to this fraction of the mean vibration energy may be a fitting error [-].
_NO_STATIC: Final = 0.12
# Smallest divisor of energies, as a fraction of the energy range of the record [-].
_TINY: Final = 1e-12
# No line is ambiguous if mean energy and half of the peak energy differ by at least this fraction of the latter [-].
_AMBIGUOUS: Final = 0.08

# Number of times per period of the highest-frequency relevant line at which deformations are evaluated.
_TIMES_PER_PERIOD: Final = 16

# Number of parts into which each interval between evaluated deformations is divided to interpolate energies.
_FINER: Final = 4

# _LITTLE_LEFT: largest misfit of modes that are evidence of a flight, relative to the energy range [-].
# _LITTLE_MISSED: largest prediction error of modes that are evidence of a flight, relative to the energy range [-].
# _EXACT: modes are treated as exact if their errors are at most this fraction of the limits for a flight [-].
# _SLOW_TOO: lines without a complete cycle are modes only if errors are below this fraction of the flight limits [-].
_LITTLE_LEFT, _LITTLE_MISSED, _EXACT, _SLOW_TOO = 0.05, 0.2, 0.1, 0.2

# _LEAST_HALF: half-width of the error band of the squared residual before known errors widen the band [-].
# _NOT_LINEAR: relative error of a deformation that results from the nonlinearity of real structures [-].
# The residual R of a shell box deviated by 0.015 to 0.018 (rms) from the R computed with all its nodes.
_LEAST_HALF, _NOT_LINEAR = 0.006, 0.015
# Modes are poorly identified if the half-width of the error band of the squared residual exceeds this [-].
_VAGUE_HALF: Final = 0.2
# Number of times at which the error band is evaluated.
_SOME_TIMES: Final = 64
# Effect of unexplained energy on the squared residual, per unexplained fraction of the energy [-].
# Noise at tr (weight 1) and midway to td (weight 2) adds up to sqrt(5); 1.6 standard deviations bound 90 %.
_REST_COUNTS: Final = 1.6 * np.sqrt(5)
# Correlations of neighbouring misfits up to this value are treated as noise [standard errors].
_CHANCE: Final = 2.0
# _DRIFT_COUNTS: effect of a changing mean energy on the squared residual, per relative change in the flight [-].
# _NEGATIVE_COUNTS: effect of a negative or too small static energy on the squared residual, per relative error [-].
_DRIFT_COUNTS, _NEGATIVE_COUNTS = 0.35, 1.4
# _BENT_ALIKE: error of the squared residual of equal deformations, per second harmonic of a stiffening spring [-].
# _BENT_ACROSS: additional error, per second harmonic, if the deformations at tr and td are mutually orthogonal [-].
_BENT_ALIKE, _BENT_ACROSS = 3.0, 5.0
# Largest possible squared residual, which is that of equal and opposite deformations [-].
_MOST_OPPOSED: Final = 4.0
# Assumed squared difference of a slowly oscillating deformation at two times, relative to its mean square [-].
_SWINGING_COUNTS: Final = 4.0


class ModeAtTd(NamedTuple):
    """A mode of the structure: damped angular frequency and damping [1/time], and vibration energy at td [energy]."""

    omega: float
    alpha: float
    vibration_energy_td: float


class _Course(NamedTuple):
    """How far the elastic energy is above its mean [energy], at times [time] close enough for linear interpolation."""

    time: Samples
    fluctuation: Samples


@dataclass(frozen=True, eq=False, repr=False)
class ModalVibration:
    """The vibration of a structure with many modes in a window of free flight.

    Parameters
    ----------
    time : array of shape (n,)
        Times at which the deformation is computed, close enough to resolve the highest-frequency line [time].
    reading : Reading
        Chosen interpretation of the lines.
    others : tuple of Reading
        Other interpretations of the lines that the record allows.
    of_first_part : Reading
        Interpretation of the lines in the first part of the record.
    doubts : Doubts
        Signs that the chosen interpretation may be wrong.
    noise : float
        Standard deviation of the record about its lines [energy].
    systematic : float
        Fraction of the misfit that neighbouring states have in common [-].
    states_per_period : float
        Number of states per period of the highest-frequency line that exceeds the noise [-].
    scatter : LineScatter
        Standard deviation of the squared residual due to the scatter of the record about its lines.
    scatter_of_first_part : LineScatter
        The same for the lines in the first part of the record.
    with_close_modes : Reading or None
        Interpretation in which two close modes replace one line, and no energy is static; None if not possible.
    swinging : float
        Mean energy of slowly oscillating deformations, which are not modes [energy].
    bent : float
        Height of the second harmonic of a line that is or may be due to a stiffening spring, relative to the line [-];
        0 if there is no such line.
    source : str
        Name of the energy that contains the lines.
    second : ModalVibration or None
        Modes identified from the kinetic energy, to confirm those of the internal energy; None if unknown.
    last_resort : bool
        True if no other model is available, so that the limits of the doubts are wider.
    """

    time: Samples
    reading: Reading
    others: tuple[Reading, ...]
    of_first_part: Reading
    doubts: Doubts
    noise: float
    systematic: float
    states_per_period: float
    scatter: LineScatter
    scatter_of_first_part: LineScatter
    with_close_modes: Reading | None = None
    swinging: float = 0.0
    bent: float = 0.0
    source: str = "internal energy"
    second: ModalVibration | None = None
    last_resort: bool = False
    kinetic: ClassVar = ""
    undescribed: ClassVar = "outside the part of the flight whose modes were identified"

    @property
    def signed(self) -> bool:
        """Return True if there is no reason to refuse the record."""
        return (
            self.doubts.refusal_at_all if self.last_resort else self.doubts.refusal
        ) is None

    def as_last_resort(self) -> ModalVibration:
        """Return the vibration with wider limits for refusal, for use when no better model exists."""
        return replace(self, last_resort=True)

    @property
    def convinces(self) -> bool:
        """Return True if the modes predict the record so accurately that no load can act in it."""
        return self._predicts_within(1.0)

    @property
    def is_exact(self) -> bool:
        """Return True if the modes predict the record much more accurately than required."""
        return self._predicts_within(_EXACT)

    @property
    def explains_all(self) -> bool:
        """Return True if what the modes leave of the record is hardly anything, or white noise."""
        return self.is_exact or (self.signed and self._structure_of_rest == 0)

    def _predicts_within(self, share: float) -> bool:
        """Return True if the modes' error, apart from white noise, is below ``share`` of the acceptable error."""
        doubts = self.doubts
        follows = _predicts_within(share, doubts.missed, doubts.misfit, self.systematic)
        return self.signed and follows

    @property
    def told(self) -> str:
        """Describe the modes on which a choice is based, with their frequencies."""
        rates = np.sort(self.reading.modes.poles.imag / 2)
        count = f"{rates.size} mode{'s' * (rates.size != 1)}"
        if rates.size == 1:
            span = f"omega {rates[0]:.4g}"
        else:
            span = f"omega {rates[0]:.4g} to {rates[-1]:.4g}"
        return f"modal, {count} identified from the lines of the {self.source}, {span}"

    def modes_at(self, td: float) -> list[ModeAtTd]:
        """Return the modes with their energies at ``td``, in ascending order of frequency."""
        poles = self.reading.modes.poles
        energies = self.reading.energies_of_modes(td)
        rows = zip(poles.imag / 2, -poles.real, energies, strict=True)
        return sorted(ModeAtTd(*map(float, row)) for row in rows)

    def comparable_since(self, td: float) -> float:
        """Return the earliest time at which the deformation can be compared with that at ``td`` [time]."""
        return min(float(self.time[0]), td)

    def known_at(self, td: float) -> bool:
        """Return True if the modes were identified at td and their energy exceeds the solver error."""
        level = self.reading.level(np.append(self.time[[0, -1]], td))
        return bool(
            self.time[0] <= td <= self.time[-1]
            and level[-1] >= SOLVER_FLOOR * level[:-1].max()
        )

    def elastic_energy(self, t: Samples | float) -> Samples:
        """Return the elastic energy V of the vibration, at least 0, in the shape of ``t`` [energy]."""
        return np.maximum(self.reading.elastic_energy(t), 0.0)

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the vibration energy U = V + T (elastic plus kinetic), in the shape of ``t`` [energy]."""
        return self.reading.vibration_energy(t)

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Return the kinetic energy T of the vibration, at least 0, in the shape of ``t`` [energy]."""
        return np.maximum(self.vibration_energy(t) - self.elastic_energy(t), 0.0)

    def overlap(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return X, the product of the deformations at tr and td, for numbers or arrays of the same shape [energy]."""
        return self.reading.overlap(tr, td)

    def separation(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return the elastic energy of the difference of the deformations at tr and td [energy]."""
        return self.compare(tr, td)[0]

    def compare(
        self, tr: Samples | float, td: Samples | float
    ) -> tuple[Samples, Samples]:
        """Return `separation` and `overlap` from one evaluation [energy]."""
        pairs = self.reading.compare(tr, td)
        at_tr = np.maximum(pairs.elastic_energy_tr, 0.0)
        at_td = np.maximum(pairs.elastic_energy_td, 0.0)
        separation = np.maximum(at_tr - 2 * pairs.overlap + at_td, 0.0)
        return separation, pairs.overlap

    def profile(self, td: float) -> Profile:
        """Return frozen-deformation errors at each ``time`` before ``td`` [-]; values shared by all td are cached."""
        last = int(np.searchsorted(self.time, td))
        elastic, finer, earlier = self._at_all_times
        middle = (self.time[:last] + td) / 2
        at_td = float(self.elastic_energy(td))
        coherence = (earlier[:last] @ self.reading.later(td)).real
        fluctuation = np.interp(middle, finer.time, finer.fluctuation)
        overlap = fluctuation + coherence / 2
        bound = np.sqrt(elastic[:last] * at_td)
        separation = elastic[:last] - 2 * np.clip(overlap, -bound, bound) + at_td
        return Profile(
            self.time[:last],
            np.sqrt(np.maximum(separation, 0.0) / self.vibration_energy(td)),
        )

    @cached_property
    def _at_all_times(self) -> tuple[Samples, _Course, Complex]:
        """Return V at ``time`` and on a finer time grid, and the factor of tr in the coherence C, for `profile`.

        C is the coherence of the lines between tr and td, the product of a factor of tr and a factor of td.
        """
        finer = np.linspace(
            self.time[0], self.time[-1], _FINER * (self.time.size - 1) + 1
        )
        energy = self.reading.elastic_energy(finer)
        return (
            np.maximum(energy[::_FINER], 0.0),
            _Course(finer, energy - self.reading.level(finer) / 2),
            self.reading.earlier(self.time),
        )

    def half_width(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return half of the width of the error band of the squared residual for pairs of times [-]."""
        off, below, above = self._compute_errors(tr, td)
        return np.asarray(off + (below + above) / 2)

    def _compute_errors(
        self, tr: Samples | float, td: Samples | float
    ) -> tuple[Samples, Samples, Samples]:
        """Return the error of the squared residual of pairs, and how far other interpretations lower and raise it [-].

        Other interpretations are those of the lines and the modes of the kinetic energy; each widens the band on one
        side.
        """
        reading, level = self.reading, self.reading.level(td)
        pairs = reading.compare(tr, td)
        squared = reading.square_residual(pairs, td)
        scatter = self.scatter.compute_deviation(tr, td, squared)
        deviation = measures.BAND_DEVIATIONS * scatter
        change = (pairs.coherence - self.of_first_part.coherence(tr, td)) / level
        # The accuracy of the lines follows from the fit and from a second fit to the first part of the record.
        of_lines = np.minimum(
            np.maximum(deviation, self._exceed_noise(np.abs(change), tr, td)),
            np.maximum(squared, _MOST_OPPOSED),
        )
        of_rest = _REST_COUNTS * self.noise / level * np.sqrt(self._structure_of_rest)
        of_structure = _compute_effect_of_deformation(_NOT_LINEAR, squared)
        off = np.asarray(
            _LEAST_HALF
            # The errors of lines, misfit and structure are independent of each other.
            + np.sqrt(of_lines**2 + of_rest**2 + of_structure**2)
            + min(self._wrong, 1.0) * (1 + np.abs(squared - 1))
            + self._phase_share * squared
            + _compute_effect_of_deformation(
                np.sqrt(_SWINGING_COUNTS * self.swinging / level), squared
            )
            + self.bent * (_BENT_ALIKE + _BENT_ACROSS * _compute_sine(squared))
        )
        below, above = self._compute_shift_of_readings(tr, td, squared)
        if self.second is None:
            return off, below, above
        shift = self.second.reading.residual_squared(tr, td) - squared
        room = self.second.half_width(tr, td)
        return (
            off,
            below + np.maximum(-shift - room, 0.0),
            above + np.maximum(shift - room, 0.0),
        )

    def _exceed_noise(
        self, change: Samples, tr: Samples | float, td: Samples | float
    ) -> Samples:
        """Return by how much a ``change`` due to the lines of the first part exceeds what noise explains [-]."""
        if self._structure_of_rest > 0:
            return change
        first = self.of_first_part.residual_squared(tr, td)
        scatter = self.scatter_of_first_part.compute_deviation(tr, td, first)
        return np.maximum(change - measures.BAND_DEVIATIONS * scatter, 0.0)

    @property
    def _structure_of_rest(self) -> float:
        """Return the fraction of the misfit that neighbouring states share, as far as it exceeds chance [-]."""
        chance = _CHANCE / np.sqrt(self.reading.spectrum.rest.size)
        return max(self.systematic - float(chance), 0.0)

    @cached_property
    def is_vague(self) -> bool:
        """Return True if the error bands of most pairs are so wide that they hardly distinguish the pairs."""
        some_times = np.linspace(self.time[0], self.time[-1], _SOME_TIMES)
        widths = [
            self.half_width(some_times, td) for td in some_times[:: _SOME_TIMES // 8]
        ]
        return bool(np.mean(np.array(widths) > _VAGUE_HALF) > 0.5)

    def residual_band(
        self, stated: Samples, tr: Samples, td: Samples | float
    ) -> tuple[Samples, Samples, Samples]:
        """Return the residual of each tr (n,) with its lower and upper bound [-].

        Squares are not negative: if the band reaches below zero, the middle of its remainder replaces ``stated``.  If
        two close modes explain the record as well, the residual is at least that of the close modes, because a single
        line hides how far they are out of phase.
        """
        off, below, above = self._compute_errors(tr, td)
        residual, low, high = measures.band_about(np.square(stated), off, above, below)
        if self.with_close_modes is not None:
            of_close_modes = self.with_close_modes.residual_squared(tr, td)
            residual = np.clip(np.sqrt(of_close_modes), residual, high)
        return residual, low, high

    def unseen(self, tr: Samples | float, td: float) -> Samples:
        """Return the vibration energy fraction that a hidden mode needs at td to explain the error band of each tr [-].

        A hidden mode in opposite phase at tr and td adds four times its energy fraction to the squared residual.
        """
        return self.half_width(tr, td) / 4

    @property
    def fallen(self) -> float:
        """Return the decrease of the static energy in the window, relative to the mean vibration energy [-]."""
        ends = self.time[[0, -1]]
        level = self.reading.level_of_modes(ends)
        static = self.reading.spectrum.mean.at(ends) - level / 2
        decrease = static[0] - static[1]
        mean_vibration = max(np.mean(level) / 2, 1e-300)
        return float(decrease / mean_vibration)

    @cached_property
    def _phase_share(self) -> float:
        """Return the fraction of the squared residual that depends on the phases of all modes at td [-]."""
        modes = self.reading.modes
        poles = modes.poles
        sizes = np.abs(modes.weights)
        shares = measures.phase_share(-poles.real, poles.imag / 2)
        return float(sizes @ shares / max(float(sizes.sum()), 1e-300))

    @cached_property
    def _wrong(self) -> float:
        """Return the part of the error of the squared residual that is common to all pairs [-]."""
        doubts = self.doubts
        if self.reading.no_static:
            # An error of the mean energy is not added, because the band covers the interpretation with static energy.
            return doubts.harmonic
        badly_predicted = min(doubts.missed / _LITTLE_MISSED, 1.0)
        return (
            _DRIFT_COUNTS * doubts.drift * badly_predicted
            + _NEGATIVE_COUNTS * max(doubts.negative, doubts.unstretched)
            + doubts.harmonic
        )

    def _compute_shift_of_readings(
        self, tr: Samples | float, td: Samples | float, squared: Samples
    ) -> tuple[Samples, Samples]:
        """Return by how much other interpretations of the spectral lines lower and raise the squared residual [-].

        Part of the static energy may be due to spectral lines hidden in the misfit.  That part is limited by the energy
        that the misfit can hide, and by the static energy itself.  A mode that does not complete a cycle may be
        confused with slow decays, so its line in the first part of the record is another interpretation. Two close
        modes are a further one, because their beat looks like static energy.
        """
        none = np.zeros(squared.shape)
        shifts = [reading.residual_squared(tr, td) - squared for reading in self.others]
        if not (self.reading.no_static or self.is_ambiguous):
            hidden = find_most_hidden(self.reading.spectrum.rest)
            shifts.append(hidden / self.reading.level(td) * (1.5 - squared))
            nearest = np.argmin(np.abs(shifts), axis=0)
            shifts = [np.take_along_axis(np.array(shifts), nearest[np.newaxis], 0)[0]]
        if self.with_close_modes is not None:
            shifts.append(self.with_close_modes.residual_squared(tr, td) - squared)
        if self.has_slow_mode:
            first = self.of_first_part.residual_squared(tr, td)
            shifts.append(first - squared)
        return (
            np.max([none, *np.negative(shifts)], axis=0),
            np.max([none, *shifts], axis=0),
        )

    @cached_property
    def has_slow_mode(self) -> bool:
        """Return True if the energy of at least one mode does not complete a cycle in the window."""
        window = float(self.time[-1] - self.time[0])
        return bool(np.any(self.reading.modes.poles.imag * window < 2 * np.pi))

    @property
    def is_ambiguous(self) -> bool:
        """Return True if lines at half the frequency of others may be due to a static deformation or to modes."""
        return not self.reading.is_mode.all() and bool(self.others)


def identify_modal(
    time: Samples, energy: Samples, *, kinetic: bool = False
) -> ModalVibration | None:
    """Identify the modes of a structure from its energy in free flight; None if the energy has no spectral lines.

    The kinetic energy has the lines of the internal energy with the opposite sign, because the sum of the elastic and
    the kinetic energy of a mode falls monotonically. Everything else in the kinetic energy changes slowly.

    Parameters
    ----------
    time, energy : array of shape (n,)
        Times [time], and the energy of the whole connected structure [energy].
    kinetic : bool
        True if ``energy`` is the kinetic energy rather than the internal energy.

    Returns
    -------
    ModalVibration or None
        The ``doubts`` of the vibration show whether it is reliable.

    Examples
    --------
    >>> t = np.linspace(0.0, 6.0, 601)
    >>> modes = np.cos(9.0 * t), np.cos(14.0 * t + 1.0), np.cos(25.0 * t)
    >>> found = identify_modal(t, np.dot([1.0, 0.5, 0.3], np.square(modes)))
    >>> [f"{rate:.4f}" for rate in sorted(found.reading.modes.poles.imag / 2)], found.signed
    (['9.0000', '14.0000', '25.0000'], True)
    >>> apart = np.cos(9.0 * 1.0) - np.cos(9.0 * 4.0), np.cos(15.0) - np.cos(57.0), np.cos(25.0) - np.cos(100.0)
    >>> bool(abs(float(found.separation(1.0, 4.0)) - np.dot([1.0, 0.5, 0.3], np.square(apart))) < 1e-6)
    True
    """
    if time.size < FEWEST_STATES:
        return None
    window = float(time[0]), float(time[-1])
    return identify_in_grid(make_even_grid(time, energy), window, kinetic=kinetic)


def identify_in_grid(
    grid: Grid, window: tuple[float, float], *, kinetic: bool = False
) -> ModalVibration | None:
    """Identify the modes from the energy on an even ``grid``, as `identify_modal` does.

    ``window`` contains the times of the first and last states [time]; the grid of block means is shorter.
    """
    prediction = predict(grid)
    highest = float(np.abs(grid.energy).max())
    if prediction is None or prediction.swing <= RESOLVED * highest:
        return None
    # If the prediction error is larger, the record is refused, whatever its lines.
    if prediction.missed <= MOST_MISSED:
        prediction = refine_prediction(grid, prediction)
    misfit = prediction.spectrum.error / prediction.swing
    systematic = _correlate_neighbours(prediction.spectrum.rest)
    if not _predicts_within(_SLOW_TOO, prediction.missed, misfit, systematic):
        # If the energy is not a sum of lines, for example because of friction, its slow changes are not modes.
        prediction = prediction.count_slow_as_mean(grid.span)
    if not prediction.spectrum.lines.poles.size:
        return None
    if kinetic:
        return _read(grid, prediction.turned(), window, kinetic=True)
    return _read(grid, prediction, window)


def confirm_by_kinetic_energy(
    internal: ModalVibration | None, kinetic: ModalVibration | None
) -> ModalVibration | None:
    """Return the result from the internal energy with a wider band, or from the kinetic energy if only it is usable."""
    if kinetic is None or not kinetic.signed:
        return internal
    if internal is None:
        return kinetic
    if internal.signed:
        return replace(internal, second=kinetic)
    return kinetic if _can_decide(internal, kinetic) else internal


def _can_decide(internal: ModalVibration, kinetic: ModalVibration) -> bool:
    """Return True if the kinetic energy may be used because plastic flow or a damper makes the internal energy useless.

    The internal energy then contains at least the elastic half of the vibration, and its value halfway can be used.
    Plastic flow and dampers only add to it. If the static energy falls instead, a static deformation relaxes, which
    moves the parts without vibration.
    """
    if internal.fallen > _NO_STATIC:
        return False
    times = internal.time
    mean_energy = float(np.mean(internal.reading.spectrum.mean.at(times)))
    elastic_half = float(np.mean(kinetic.reading.level_of_modes(times))) / 2
    is_contained = mean_energy > (1 - MOST_NEGATIVE) * elastic_half
    return is_contained and internal.doubts.beyond < MOST_BEYOND


def _predicts_within(
    share: float, missed: float, misfit: float, systematic: float
) -> bool:
    """Return True if the error of the lines, apart from white noise, is below the ``share`` of the acceptable error.

    ``missed`` and ``misfit`` are those of `Doubts`; ``systematic`` is the fraction of the misfit that neighbouring
    states have in common [-].
    """
    white = 1 - systematic
    structure = misfit * np.sqrt(systematic)
    systematically_missed = missed**2 - 2 * white * misfit**2
    most_left, most_missed = share * _LITTLE_LEFT, share * _LITTLE_MISSED
    return bool(structure < most_left and systematically_missed < most_missed**2)


def _correlate_neighbours(remainder: Samples) -> float:
    """Return the correlation between the misfits of neighbouring states, at least 0; it is 0 for white noise [-]."""
    products = np.sum(remainder[1:] * remainder[:-1])
    power = max(float(np.sum(remainder**2)), 1e-300)
    return float(np.clip(products / power, 0.0, 1.0))


def _separate_stretches_from_springs(
    spectrum: Spectrum, grid: Grid, scatter: float
) -> tuple[tuple[StretchLine, ...], list[ThirdHarmonic]]:
    """Return the lines due to static deformations, and the third harmonics that may be due to stiffening springs."""
    locked = find_stretches(spectrum.lines, grid.span, scatter)
    thirds = {
        stretch: measure_third_harmonic(stretch, spectrum, grid.time, scatter)
        for stretch in locked
        if not stretch.swings
    }
    stretches = tuple(
        stretch
        for stretch in locked
        if stretch.swings or not thirds[stretch].is_of_spring
    )
    return stretches, [third for third in thirds.values() if third.may_be_of_spring]


class _Interpretation(NamedTuple):
    """The ``best`` interpretation of the lines, ``others`` that are possible, and the ``static`` part of the energy."""

    best: Reading
    others: tuple[Reading, ...]
    static: StaticEnergy


def _read(
    grid: Grid,
    prediction: Prediction,
    window: tuple[float, float],
    *,
    kinetic: bool = False,
) -> ModalVibration:
    """Return the best interpretation of the lines with its alternatives; the mean of a ``kinetic`` energy is ignored.

    ``window`` contains the times of the first and last states [time]; the grid of block means is shorter.
    """
    spectrum = prediction.spectrum
    scatter = spectrum.error * np.sqrt(2 / grid.time.size)
    systematic = _correlate_neighbours(spectrum.rest)
    stretches, springs = _separate_stretches_from_springs(spectrum, grid, scatter)
    close_modes = None
    if not (kinetic or stretches or springs):
        close_modes = find_close_modes(grid, prediction)
    may_be_spring = any(not third.is_of_spring for third in springs)
    plain = Reading(
        spectrum,
        np.ones(spectrum.lines.poles.size, dtype=bool),
        True,
        grid.time,
        systematic * spectrum.rest,
        _TINY * prediction.swing,
    )
    interpretation = _choose_interpretation(
        plain,
        stretches,
        may_be_spring=may_be_spring,
        kinetic=kinetic,
        systematic=systematic,
    )
    reading = interpretation.best
    doubts = measure_doubts(
        reading, interpretation.static, prediction, grid, stretches, scatter
    )
    # Heat or a drift that the first part predicts is not plastic flow and does not affect the lines.
    follows = _predicts_within(_EXACT, doubts.missed, doubts.misfit, systematic)
    if follows and np.all(np.diff(interpretation.static.energy) > 0):
        doubts = doubts._replace(drift=0.0)
    if kinetic:
        doubts = doubts._replace(negative=0.0, drift=0.0, unstretched=0.0)
    of_first_part = _read_first_part(reading, prediction, grid, stretches, scatter)
    return ModalVibration(
        time=_close_times(reading, window, grid.time.size),
        reading=reading,
        others=interpretation.others,
        of_first_part=of_first_part,
        with_close_modes=None
        if close_modes is None
        else _read_close_modes(reading, close_modes),
        doubts=doubts,
        noise=spectrum.error,
        systematic=systematic,
        states_per_period=min(
            grid.strong, _count_states(spectrum.lines, grid, scatter)
        ),
        scatter=LineScatter(reading, grid, systematic),
        scatter_of_first_part=LineScatter(of_first_part, grid.first_part, systematic),
        swinging=sum(stretch.energy for stretch in stretches if stretch.swings),
        bent=max((third.second for third in springs), default=0.0),
        source="kinetic energy" if kinetic else "internal energy",
    )


def _add_hidden_pairs(reading: Reading, systematic: float) -> Reading:
    """Add to an interpretation the vibration energy that its mean energy contains but its modes do not explain."""
    spectrum = reading.spectrum
    level = reading.level_of_modes(reading.times)
    static = spectrum.mean.at(reading.times) - level / 2
    pairs = measure_hidden_pairs(static, level, spectrum.error, systematic)
    return replace(reading, hidden_pairs=pairs)


def _choose_interpretation(
    plain: Reading,
    stretches: tuple[StretchLine, ...],
    *,
    may_be_spring: bool,
    kinetic: bool,
    systematic: float,
) -> _Interpretation:
    """Decide whether the lines of static deformations are modes, and whether part of the mean energy is static.

    In the ``plain`` interpretation, all lines are modes and all of the mean energy is vibration energy.
    ``may_be_spring`` is True if a second harmonic may be that of a stiffening spring. ``systematic`` is the fraction of
    the misfit that neighbouring states have in common [-].
    """
    spectrum = plain.spectrum
    time = plain.times
    with_static = replace(
        plain, is_mode=_mask_modes(spectrum.lines, stretches), no_static=False
    )
    half = with_static.level_of_modes(time) / 2
    if not kinetic:
        plain = _add_hidden_pairs(plain, systematic)
        with_static = _add_hidden_pairs(with_static, systematic)
    static = spectrum.mean.at(time) - (1 + with_static.hidden_pairs) * half
    mean = max(float(np.mean(half)), 1e-300)
    share = float(np.mean(static)) / mean

    # If lines of static deformations are treated as modes, these may explain the whole mean energy.
    half_of_all = plain.level_of_modes(time) / 2
    excess = abs(float(np.mean(spectrum.mean.at(time) - half_of_all)))
    explains_mean = excess < _AMBIGUOUS * float(np.mean(half_of_all))
    is_ambiguous = bool(stretches) and not kinetic and explains_mean

    hidden = find_most_hidden(spectrum.rest)
    unresolved = share * mean < hidden / 2
    no_static = share < _NO_STATIC and unresolved and not stretches and not kinetic
    if is_ambiguous and not all(stretch.is_exact for stretch in stretches):
        no_static = True

    best, alternative = (plain, with_static) if no_static else (with_static, plain)
    others: tuple[Reading, ...] = ()
    if is_ambiguous or not (stretches or kinetic):
        others = (alternative,)
    elif may_be_spring and stretches:
        others = (replace(with_static, is_mode=plain.is_mode),)
    return _Interpretation(best, others, StaticEnergy(static, mean, share))


def _read_first_part(
    reading: Reading,
    prediction: Prediction,
    grid: Grid,
    stretches: tuple[StretchLine, ...],
    scatter: float,
) -> Reading:
    """Return the interpretation of the lines in the first part of the record, without the misfit."""
    first = prediction.of_first_part
    first_stretches: tuple[StretchLine, ...] = ()
    if stretches:
        first_stretches = find_stretches(first.lines, FIRST_PART * grid.span, scatter)
    return replace(
        reading,
        spectrum=first,
        is_mode=_mask_modes(first.lines, first_stretches),
        rest=np.zeros(grid.time.size),
    )


def _read_close_modes(reading: Reading, spectrum: Spectrum) -> Reading:
    """Return the interpretation of a ``spectrum`` with two close modes, all lines of which are modes."""
    return replace(
        reading,
        spectrum=spectrum,
        is_mode=np.ones(spectrum.lines.poles.size, dtype=bool),
        no_static=False,
        hidden_pairs=0.0,
    )


def _compute_effect_of_deformation(off: Samples | float, squared: Samples) -> Samples:
    """Return the error of the squared residual due to the relative error ``off`` of a deformation difference [-]."""
    return np.asarray(2 * off * np.sqrt(squared) + np.square(off))


def _compute_sine(squared: Samples) -> Samples:
    """Return the sine of the angle between equally large deformations with the squared residual ``squared`` [-]."""
    return np.asarray(np.sqrt(np.maximum(squared * (4 - squared), 0.0)) / 2)


def _count_states(lines: Exponentials, grid: Grid, scatter: float) -> float:
    """Return the number of states per period of the highest-frequency relevant line that exceeds the noise."""
    sizes = np.abs(lines.weights)
    strongest = float(sizes.max(initial=0.0))
    least = max(NOTABLE * strongest, ABOVE_SCATTER * scatter)
    rates = lines.poles.imag[sizes > least]
    highest_rate = float(rates.max(initial=0.0))
    if highest_rate > 0:
        return 2 * np.pi / (highest_rate * grid.spacing)
    return np.inf


def _mask_modes(lines: Exponentials, stretches: tuple[StretchLine, ...]) -> Mask:
    """Return a mask of the lines that are not due to a static deformation."""
    is_kept = np.ones(lines.poles.size, dtype=bool)
    is_kept[[stretch.line for stretch in stretches]] = False
    return is_kept


def _close_times(reading: Reading, window: tuple[float, float], fewest: int) -> Samples:
    """Return times in a window [time], so closely spaced that a parabola through three of them locates a minimum."""
    rates = reading.modes.poles.imag
    sizes = np.abs(reading.modes.weights)
    strongest = sizes.max(initial=0.0)
    notable = rates[sizes > NOTABLE * strongest]
    highest_rate = float(notable.max(initial=0.0))
    start, end = window
    periods = (end - start) * highest_rate / (2 * np.pi)
    intervals = int(max(fewest, _TIMES_PER_PERIOD * periods))
    return np.linspace(start, end, intervals + 1)
