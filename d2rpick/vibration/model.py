"""Decide which vibration model is reliable at a td, and describe the vibration by this model.

The order is that of `MODELS`: an oscillator that describes the record with a small misfit, then the modes of the
structure, then counted half cycles, then the energy alone. The result is a `Vibration`: the energy around td, and the
deformations that can be compared with those at td, if any are known.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.tuples import NamedTuple
from d2rpick.vibration import MODELS, measures
from d2rpick.vibration.amplitudes import SignedAmplitudes
from d2rpick.vibration.fitting import MAX_MISFIT
from d2rpick.vibration.identify import (
    MIN_SAMPLES_PER_PERIOD,
    Identification,
    count_samples_per_period,
)
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.moments import (
    ModalEnergy,
    Moments,
    OscillatorEnergy,
    SampledEnergy,
    find_moments_of_mode,
)
from d2rpick.vibration.oscillator_band import OscillatorBand
from d2rpick.vibration.span import SMALLEST

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration import SignedModel
    from d2rpick.vibration.measures import Band, Columns, Deformation, Profile
    from d2rpick.vibration.modal import ModalVibration
    from d2rpick.vibration.span import Span

# A time without states is a gap if it is this many times as long as the usual output interval [-].
_GAP: Final = 10.0
# Reason why no tr can be trusted if the vibration at td is below the noise.
SUNK: Final = "the level at td is below the noise of the record"
_LEFT_OVER = "the oscillator leaves more over than what is known otherwise"
# Residual of a run without vibration after td [-]; a pair with a larger residual preserves no vibration.
NOTHING_KEPT: Final = 1.0
# A tr in this last fraction of the time before td saves little time [-].
NEAR_TD: Final = 0.25
# _OF_INTERVAL: assumed upper bound of the distance from the best sample to the true error minimum [sampling intervals].
# _OF_INTERVAL_BY_MODES: limit that replaces _OF_INTERVAL if modes describe the energy between the states.
# In a test, 93 % of 2200 closest matches found with modes lay within 1/8 interval of the true minimum.
_OF_INTERVAL, _OF_INTERVAL_BY_MODES = 0.5, 0.125


class Compared(NamedTuple):
    """Deformations at the times from ``first`` to ``last`` [time], all of which can be compared with that at td.

    ``profile`` returns the frozen-deformation errors before a td; it is None for a single mode, whose errors have a
    closed form. ``band`` returns a residual with its lower and upper bound.
    """

    deformation: Deformation
    first: float
    last: float
    profile: Callable[[float], Profile] | None
    band: Band


@dataclass(frozen=True, eq=False, repr=False)
class Vibration:
    """The vibration as described by the best reliable model for one td.

    Parameters
    ----------
    basis : str
        Name of the model, one of `MODELS`.
    whole : SampledEnergy
        The energy of all parts together.
    compared : Compared or None
        None if no deformation with its sign is known; ``unknown`` is then the reason.
    undescribed : str
        Reason why some tr have no measures although deformations are known.
    told : str
        Description of the model that gives the sign.
    estimated : str or None
        Source of an estimated kinetic share, and the reason for the estimate; None if the share is not estimated.
    doubts : tuple of str
        Reasons why the energy at td is meaningless, so that no tr can be trusted.
    """

    basis: str
    whole: SampledEnergy
    compared: Compared | None = None
    unknown: str | None = None
    undescribed: str = ""
    told: str = ""
    estimated: str | None = None
    doubts: tuple[str, ...] = ()

    @property
    def td(self) -> float:
        """Return the td for which the vibration is described [time]."""
        return self.whole.td

    @property
    def modal(self) -> ModalVibration | None:
        """Return the modes of the structure that are used; None if no modes are used."""
        if self.basis == "modal" and self.compared:
            return cast("ModalVibration", self.compared.deformation)
        return None

    @property
    def kinetic_share(self) -> float | None:
        """Return the kinetic fraction K at td [-]; None if K is unknown."""
        if self.compared is None:
            return None
        return float(measures.kinetic_share(self.compared.deformation, self.td))

    @cached_property
    def profile(self) -> Profile | None:
        """Return the frozen-deformation error before td, which has minima at the closest matches; None if unknown."""
        if self.compared is None or self.compared.profile is None:
            return None
        return self.compared.profile(self.td)

    @cached_property
    def least_residual(self) -> float | None:
        """Return the smallest residual of all tr that save much time [-]; None if there are not many modes."""
        if self.basis != "modal" or self.profile is None or self.compared is None:
            return None
        last = self.td - NEAR_TD * (self.td - self.compared.first)
        errors = self.profile.error[: np.searchsorted(self.profile.time, last)]
        if not errors.size:
            return None
        return float(measures.residual(errors.min(), self.kinetic_share or 0.0))

    @property
    def keeps_nothing(self) -> bool:
        """Return True if no tr that saves much time is better than a release without vibration."""
        return self.least_residual is not None and self.least_residual > NOTHING_KEPT

    @property
    def most_lock_in(self) -> float | None:
        """Return the largest frozen-deformation error of a useful tr if there are many modes [-]; otherwise None."""
        if self.basis != "modal":
            return None
        least_residual = self.least_residual or 0.0
        if least_residual <= NOTHING_KEPT:
            largest_residual = NOTHING_KEPT
        else:
            largest_residual = least_residual + measures.TOLERATED_GROWTH
        return float(
            np.sqrt(max(largest_residual**2 - (self.kinetic_share or 0.0), 0.0))
        )

    def moments(self, tolerance: float, since: float = -np.inf) -> Moments:
        """Return candidate times before td: level crossings, extrema near the level, and closest matches.

        Times before ``since`` [time] may be omitted.
        """
        if self.compared and isinstance(self.whole, OscillatorEnergy):
            turns = self.whole.standstills()
            turns = turns[self.comparable(turns)]
            turns = turns[
                measures.lock_in_error(self.compared.deformation, turns, self.td)
                <= tolerance
            ]
        else:
            turns = self.whole.turns_near(tolerance, since)
        matches = self.profile.minima() if self.profile else ()
        if (
            self.basis == "modal"
        ):  # With many modes, the level of the total energy does not show which tr are suitable.
            return Moments.of("match", [*matches, *self._least_deformed()])
        crossings = self.whole.crossings(since)
        return Moments.of_level(
            *crossings, Moments.of("extremum", turns), Moments.of("match", matches)
        )

    def _least_deformed(self) -> tuple[float, ...]:
        """Return the time of least elastic energy, which keeps only the static part, if no tr keeps the vibration."""
        if not self.keeps_nothing or self.compared is None or self.profile is None:
            return ()
        times = self.profile.time
        times = times[
            : max(
                1,
                np.searchsorted(
                    times, self.td - NEAR_TD * (self.td - self.compared.first)
                ),
            )
        ]
        return (
            float(times[np.argmin(self.compared.deformation.elastic_energy(times))]),
        )

    def measured(self, times: Samples) -> Columns:
        """Measure each time as a candidate for tr, provided that its deformation can be compared with that at td."""
        return measure_all([self], times, [0, times.size])[1]

    def errors(self, times: Samples) -> Samples:
        """Return the errors to which the tolerance applies [-], in the shape of ``times``; infinity if no tr is useful.

        This is the frozen-deformation error if signs are known (for a few modes, only if they match), else the level
        error.
        """
        if self.compared is None:
            errors = measures.level_error(
                self.whole.energies(times), self.whole.energy(self.td)
            )
            return np.where(np.isnan(errors), np.inf, errors)
        deformation = self.compared.deformation
        comparable = self.comparable(times)
        if not isinstance(deformation, SignedAmplitudes):
            errors = measures.lock_in_error(deformation, times, self.td)
            return np.where(comparable, errors, np.inf)
        errors, has_sign = measures.compare(deformation, times, self.td)
        return np.where(comparable & has_sign, errors, np.inf)

    def knots(self) -> Samples:
        """Return the times before td between which the errors are monotone [time]."""
        return np.append(self.whole.edges(), self.profile.time if self.profile else ())

    def reach(self, moments: Moments) -> Samples:
        """Return the uncertainty of each moment [time], which is a fraction of a profile interval for a closest match.

        A closest match is a minimum of the error. The true minimum lies in the same interval if only states are known,
        and much closer if the error between the states is known, because the match is then the vertex of a parabola.
        """
        reach = self.whole.reach(moments.tr)
        if self.profile is None:
            return reach
        share = _OF_INTERVAL_BY_MODES if self.basis == "modal" else _OF_INTERVAL
        return np.where(
            moments.are("match"), self.profile.cell(moments.tr) * share, reach
        )

    def comparable(self, times: Samples) -> NDArray[np.bool_]:
        """Return a mask of the times at which the deformation can be compared with that at td."""
        if self.compared is None:
            return np.zeros(times.shape, dtype=bool)
        return (times >= self.compared.first) & (times <= self.compared.last)

    def compute_residuals(self, tr: Samples) -> Samples:
        """Return the stated residual of each tr (n,); NaN where the deformation cannot be compared with that at td."""
        residuals = np.full(tr.shape, np.nan)
        is_comparable = self.comparable(tr)
        if is_comparable.any():
            assert self.compared
            deformation, times = self.compared.deformation, tr[is_comparable]
            lock_in = measures.lock_in_error(deformation, times, self.td)
            residuals[is_comparable], _, _ = measures.bound_residuals(
                deformation, lock_in, times, self.td, self.compared.band
            )
        return residuals

    def measures_of(self, tr: Samples, td: Samples | float) -> Columns:
        """Return the measures of comparable times (n,) as columns; for a single mode, ``td`` may be an array (n,)."""
        assert self.compared
        deformation = self.compared.deformation
        find_tolerances: Callable[[Samples], Samples]
        if isinstance(deformation, Mode):
            find_tolerances = partial(measures.timing_tolerance, deformation, tr, td)
        else:
            assert self.profile is not None
            find_tolerances = partial(self.profile.tolerances, tr)
        return measures.measured(
            deformation, tr, td, find_tolerances, self.compared.band
        )


def find_moments(
    vibrations: Sequence[Vibration], tolerance: float, since: Sequence[float]
) -> list[Moments]:
    """Return the candidate times of each vibration, as `Vibration.moments` does, mode by mode for greater speed.

    Parameters
    ----------
    vibrations : sequence of length n
        Vibration around each td.
    tolerance : float
        Largest level error of an extremum that is a candidate [-].
    since : sequence of length n
        Earliest candidate time for each td [time].
    """
    moments: dict[int, Moments] = {}
    for positions in _group_alike(vibrations):
        first = vibrations[positions[0]]
        times = [since[i] for i in positions]
        if len(positions) > 1:
            energies = [
                vibration.whole
                for vibration in map(vibrations.__getitem__, positions)
                if isinstance(vibration.whole, OscillatorEnergy)
            ]
            moments |= zip(
                positions, find_moments_of_mode(energies, tolerance, times), strict=True
            )
        else:
            moments[positions[0]] = first.moments(tolerance, *times)
    return [moments[i] for i in range(len(vibrations))]


def measure_all(
    vibrations: Sequence[Vibration], tr: Samples, ends: Sequence[int]
) -> tuple[Samples, Columns]:
    """Return the energy of each tr (n,), and its measures if its deformation can be compared with that at its td.

    The times of the i-th vibration are those from index ``ends[i]`` to ``ends[i + 1]``.
    """
    energy = np.empty(tr.shape)
    columns = []
    for positions in _group_alike(vibrations):
        first = vibrations[positions[0]]
        ranges = [slice(ends[i], ends[i + 1]) for i in positions]
        rows: Any = (
            ranges[0]
            if len(ranges) == 1
            else np.concatenate(
                [np.arange(piece.start, piece.stop) for piece in ranges]
            )
        )
        energy[rows] = first.whole.energies(tr[rows])
        is_comparable = first.comparable(tr[rows])
        if is_comparable.any():
            seen_from = np.repeat(
                [vibrations[i].td for i in positions],
                [piece.stop - piece.start for piece in ranges],
            )
            td = seen_from[is_comparable] if len(ranges) > 1 else first.td
            columns.append(
                (
                    np.arange(tr.size)[rows][is_comparable],
                    first.measures_of(tr[rows][is_comparable], td),
                )
            )
    return energy, measures.spread(tr.size, columns)


def _group_alike(vibrations: Sequence[Vibration]) -> Iterable[list[int]]:
    """Yield groups of indices of vibrations with the same mode and window, and the single indices of all others."""
    groups: dict[object, list[int]] = {}
    for position, vibration in enumerate(vibrations):
        whole = vibration.whole
        single = vibration.compared is not None and isinstance(
            vibration.compared.deformation, Mode
        )
        key: object = position
        if single and isinstance(whole, OscillatorEnergy):
            key = (id(whole.fit), whole.span)
        groups.setdefault(key, []).append(position)
    return groups.values()


class Evidence(NamedTuple):
    """The models found in a record, whether or not they are reliable at a td.

    ``fit`` is None only if no oscillator was fitted; ``span`` is the window that it describes. ``given`` is True if the
    user gave the oscillator, ``prescribed`` if the user gave the oscillator or its window. ``models`` contains the
    other models by name; at most one of them gives the sign.
    """

    fit: Identification | None = None
    span: Span | None = None
    given: bool = False
    prescribed: bool = False
    models: Mapping[str, SignedModel] = {}

    @property
    def signed(self) -> str | None:
        """Return the name of the model that gives the sign of the deformation; None if there is no such model."""
        return next((name for name, model in self.models.items() if model.signed), None)

    @property
    def refusal(self) -> str | None:
        """Return the reason why modes could not be identified; None if modes were identified or are not needed."""
        modal = cast("ModalVibration | None", self.models.get("modal"))
        return modal.doubts.refusal if modal and not modal.signed else None

    @property
    def has_sure_modes(self) -> bool:
        """Return True if reliable modes give the sign of the deformation."""
        modal = cast("ModalVibration | None", self.models.get("modal"))
        return modal is not None and modal.doubts.refusal is None

    @property
    def states_per_period(self) -> float | None:
        """Return the number of states per period of the highest-frequency line [-]; None if no line is known."""
        modal = cast("ModalVibration | None", self.models.get("modal"))
        return modal.states_per_period if modal else None

    @property
    def states_per_strong_period(self) -> float | None:
        """Return the number of states per period of the highest-frequency strong line [-]; None if no line is known."""
        modal = cast("ModalVibration | None", self.models.get("modal"))
        return modal.doubts.coarse if modal else None

    @property
    def has_model(self) -> bool:
        """Return True if a model, rather than only the energy samples, may be used at some td."""
        fit = self.fit
        return bool(self.signed or (fit and fit.mode and self.span and not fit.reason))

    def is_that_of(self, other: Evidence) -> bool:
        """Return True if two objects have the same models of the same record."""
        same = self.fit is other.fit and self.span == other.span
        return same and all(
            self.models.get(name) is other.models.get(name) for name in MODELS
        )


def model_at(whole: Vibration, evidence: Evidence) -> Vibration:
    """Return the best reliable model. ``whole`` is an oscillator or, if no oscillator is known, the energy samples."""
    if not evidence.signed:
        return whole
    basis = evidence.signed
    model = evidence.models[evidence.signed]
    td = whole.td
    modes = whole.whole
    if whole.doubts or not is_doubtful(whole) or not model.known_at(td):
        return whole
    if not isinstance(modes, OscillatorEnergy):
        return _compare_with_signs(whole, basis, model)
    # Correlated neighbouring misfits show a further mode, which the modal model describes better.
    # If the misfits are white noise, they do not show a further mode.
    is_further_mode = basis == "modal" and modes.fit.structure > 0
    if is_further_mode or model.unseen(modes.span.start, td) < modes.fit.hidden_share:
        return _compare_with_signs(
            Vibration("energy", SampledEnergy(modes.history, td), unknown=_LEFT_OVER),
            basis,
            model,
        )
    return whole


def _compare_with_signs(whole: Vibration, basis: str, model: SignedModel) -> Vibration:
    """Return a copy of the vibration with signed deformations; the level at td remains that of the total energy."""
    first = model.comparable_since(whole.td)
    energy = whole.whole
    if basis == "modal":
        window = (first, float(model.time[-1]))
        energy = ModalEnergy(energy.history, whole.td, model.elastic_energy, window)
    return replace(
        whole,
        basis=basis,
        whole=energy,
        compared=Compared(
            model, first, float(model.time[-1]), model.profile, model.residual_band
        ),
        unknown=None,
        undescribed=model.undescribed,
        told=model.told,
        estimated=f"{model.kinetic}: {whole.unknown}"
        if whole.unknown and model.kinetic
        else None,
    )


def is_doubtful(whole: Vibration) -> bool:
    """Return True if no oscillator fits, or only so badly that the sign of the deformation may be wrong."""
    return (
        not isinstance(whole.whole, OscillatorEnergy)
        or whole.whole.fit.hidden_share > SMALLEST
    )


def find_energy_at(history: History, td: float, evidence: Evidence) -> Vibration:
    """Return the reliable model of the total energy at ``td``: an oscillator if possible, otherwise the samples."""
    fit = evidence.fit
    whole = describe_energy_at(history, td, evidence)
    samples = partial(Vibration, "energy", SampledEnergy(history, td))
    if fit is None:
        return samples(unknown="identification was switched off")
    prescribed = (
        "the oscillator that was asked for does not describe the record at td",
    ) * evidence.prescribed
    if fit.reason:
        if evidence.given:
            claim = "the given oscillator does not describe"
        else:
            claim = "no single oscillator describes"
        # Fitting lines needs fewer states than determining a level, and the fit itself refuses too few states.
        aliasing = () if evidence.has_sure_modes else _find_aliasing(history, fit)
        return samples(
            unknown=f"{claim} the record: {fit.reason}",
            doubts=(*prescribed, *aliasing),
        )
    if not isinstance(whole, OscillatorEnergy) or not whole.described(td):
        return samples(
            unknown="the oscillator does not describe the record at td",
            doubts=prescribed,
        )
    if whole.sunk:
        return samples(unknown=whole.sunk, doubts=(SUNK, *prescribed))
    compared = Compared(
        whole.mode,
        *whole.span,
        None,
        OscillatorBand(fit, td).bound_residual,
    )
    return Vibration(
        "oscillator", whole, compared, undescribed="not described by the oscillator"
    )


def describe_energy_at(
    history: History, td: float, evidence: Evidence
) -> SampledEnergy:
    """Return the best description of the energy, even if unreliable at ``td``: an oscillator, otherwise the samples."""
    fit = evidence.fit
    span = evidence.span
    if fit and fit.mode and span:
        return OscillatorEnergy(history, td, fit, span)
    return SampledEnergy(history, td)


def _find_aliasing(history: History, fit: Identification) -> tuple[str, ...]:
    """Return a warning text if the states are too few per period to show the vibration and the energy level."""
    if fit.mode is None or fit.misfit is None or fit.misfit > MAX_MISFIT:
        return ()
    time, _ = history.between(fit.start, fit.end)
    states = count_samples_per_period(time, fit.mode)
    if states >= MIN_SAMPLES_PER_PERIOD:
        return ()
    text = f"the energy has {states:.3g} states per period"
    needed = f"at least {MIN_SAMPLES_PER_PERIOD} are needed to compare energies"
    return (f"{text}{_describe_gap(time)}, {needed}",)


def _describe_gap(time: Samples) -> str:
    """Return a text with the longest interval without states, if this interval is much longer than the others."""
    steps = np.diff(time)
    longest = int(np.argmax(steps))
    if steps[longest] <= _GAP * float(np.median(steps)):
        return ""
    start, end = time[longest : longest + 2]
    return f" (no states from {start:.6g} to {end:.6g})"
