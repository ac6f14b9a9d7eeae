"""Find the spectral lines of an energy: its decaying exponentials, for which no initial guess is needed.

The internal energy of a linear structure in free flight has one line for each mode, at twice the frequency and twice
the decay rate of the mode, above a mean that falls slowly. The rates follow from the shift invariance of the signal
subspace (ESPRIT: Roy and Kailath, IEEE Trans. ASSP 37, 1989), and the weights from a least-squares fit with these
rates. The number of exponentials is decided by prediction: the first part of the record is fitted, and the number that
predicts the rest best is used.
"""

from __future__ import annotations

from math import ceil, sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import compute_median
from d2rpick.vibration.least_squares import solve_least_squares

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

    Complex = NDArray[np.complex128]

# Numbers of exponentials that are tried; each spectral line needs two, and the mean needs at least one.
_ORDERS: Final = (3, 5, 7, 9, 11, 13, 17, 21, 27, 35, 45, 57, 71)
# _CLEARLY_BETTER: more exponentials are preferred if they reduce the prediction error to this fraction or less [-].
# PERFECT: relative prediction error below which no more exponentials are tried [-].
_CLEARLY_BETTER, PERFECT = 0.8, 2e-4
# _BETTER: replaces _CLEARLY_BETTER if the misfit with fewer exponentials still contains a spectral line [-].
# _OF_A_LINE: a misfit contains a spectral line if its largest power is at least this multiple of the mean power [-].
_BETTER, _OF_A_LINE = 0.97, 16.0
# Fraction of the record that is fitted to predict the rest of the record [-].
FIRST_PART: Final = 0.7
# Longest window of the signal subspace [states]; the computing time grows with the square of the length.
_MOST_LAGS: Final = 340
# _STATES_PER_PERIOD: number of states of the uniform grid per period of the highest-frequency relevant line.
# _FEWEST_STATES: smallest number of states in the uniform grid.
# _MOST_STATES: largest number of states in the uniform grid.
_STATES_PER_PERIOD, _FEWEST_STATES, _MOST_STATES = 4.0, 64, 2000
# The means over at least _FEW_BLOCKS blocks show whether an energy is unpredictable.
# _MANY_BLOCKS: smallest number of blocks that are tested in this way, as a multiple of _FEW_BLOCKS [-].
# _MOST_SWING: smallest fraction of the energy's oscillation that these means must show [-].
_FEW_BLOCKS, _MANY_BLOCKS, _MOST_SWING = 140, 4, 0.5
# Times are treated as evenly spaced if they deviate by at most this fraction of an interval [-].
_EVEN: Final = 1e-3
# A line exceeds white noise if its power is at least this multiple of the median power [-].
_ABOVE_NOISE: Final = 20.0
# _ALL_POWER: the lowest-frequency lines that together have this fraction of the power are treated as relevant [-].
# _STRONG_POWER: the lowest-frequency lines that together have this fraction of the power are treated as strong [-].
_ALL_POWER, _STRONG_POWER = 1 - 2e-5, 0.95
# Fraction of the record, from its start, that is searched for spectral lines that decay early [-].
_EARLY: Final = 0.25
# _LEAST_TURNS: smallest number of cycles that a line must complete within the record.
# _SURE_TURNS: a line with more than this number of cycles cannot be confused with slow changes of the mean.
# _MOST_DAMPED: largest decay rate of a line, as a fraction of its angular frequency [-].
# MOST_DECAY: largest exponent with which a line decays within the record [-].
_LEAST_TURNS, _SURE_TURNS, _MOST_DAMPED, MOST_DECAY = 0.25, 1.0, 0.35, 40.0
# Largest exponent by which noise may make a vibration seem to grow over the record [-].
MOST_GROWTH: Final = 0.2
# _MOST_DECAYS: largest number of decaying exponentials that the mean contains in addition to a constant.
# _SAME_DECAY: two exponentials are distinguished if their decays over the record differ by at least this exponent [-].
_MOST_DECAYS, _SAME_DECAY = 4, 0.05
# Smallest divisor of numbers of order one [-].
_TINY: Final = 1e-12


class Grid(NamedTuple):
    """Means of an energy over blocks of equidistant states; ``time`` [time] and ``energy`` [energy] have shape (m,).

    A block has ``size`` states whose output interval is ``spacing`` [time]. ``strong`` is the number of states per
    period of the highest-frequency strong line [-].
    """

    time: Samples
    energy: Samples
    spacing: float
    size: int
    strong: float

    @property
    def step(self) -> float:
        """Return the time between two successive blocks [time]."""
        return self.spacing * self.size

    @property
    def span(self) -> float:
        """Return the time from the first block to the last block [time]."""
        return float(self.time[-1] - self.time[0])

    @property
    def first_part(self) -> Grid:
        """Return the first part of the grid, which is fitted to predict the rest."""
        return self.some(slice(int(FIRST_PART * self.time.size)))

    def some(self, blocks: slice) -> Grid:
        """Return a grid with some successive blocks."""
        return self._replace(time=self.time[blocks], energy=self.energy[blocks])

    def coarsen(self, factor: int) -> Grid:
        """Return the means over blocks that are ``factor`` times as long; the last blocks may be left out."""
        count = self.time.size // factor
        time, energy = (
            column[: count * factor].reshape(count, factor).mean(axis=1)
            for column in (self.time, self.energy)
        )
        return self._replace(time=time, energy=energy, size=factor * self.size)

    def waves(self, poles: Complex) -> Complex:
        """Return exp(p (t - t_0)) at the m times t of the grid, where t_0 is the first time; shape (m, poles) [-].

        On an even grid, each value is the product of two of about 2 sqrt(m) exponentials, which saves computing time.
        """
        count = self.time.size
        width = ceil(sqrt(count))
        inner = np.arange(width) * self.step
        outer = np.arange(0, count, width) * self.step
        coarse: Complex = np.exp(np.multiply.outer(poles, outer))
        fine: Complex = np.exp(np.multiply.outer(poles, inner))
        # The times of a wave are adjacent in memory, because long inner loops are faster.
        products: Complex = coarse[:, :, np.newaxis] * fine[:, np.newaxis]
        return products.reshape(poles.size, -1)[:, :count].T

    def gain(self, poles: Complex) -> Complex:
        """Return the mean of ``exp(p t)`` over a block relative to its middle value, in the shape of ``poles`` [-]."""
        half = poles * self.spacing / 2
        with np.errstate(invalid="ignore", divide="ignore"):
            gain = np.sinh(half * self.size) / (self.size * np.sinh(half))
        return np.where(np.abs(half) < 1e-12, 1.0, gain)


def make_even_grid(time: Samples, energy: Samples) -> Grid:
    """Resample an energy on an even grid that resolves all relevant lines.

    Parameters
    ----------
    time, energy : array of shape (n,)
        At least 4 states with ascending times [time], [energy].
    """
    even = np.linspace(time[0], time[-1], time.size)
    values = energy
    if np.abs(time - even).max() > _EVEN * (even[1] - even[0]):
        from scipy.interpolate import (
            CubicSpline,
        )  # Imported here to keep start-up fast.

        values = CubicSpline(time, energy)(even)
    fastest, strongest = _count_turns(even, values)
    early = int(_EARLY * time.size)
    if early >= _FEWEST_STATES:
        fastest_early, _ = _count_turns(even[:early], values[:early])
        fastest = max(fastest, fastest_early / _EARLY)
    wanted = np.clip(_STATES_PER_PERIOD * fastest, _FEWEST_STATES, _MOST_STATES)
    size = max(1, int(time.size // wanted))
    count = time.size // size
    states = Grid(
        even,
        values,
        spacing=float(even[1] - even[0]),
        size=1,
        strong=count / max(strongest, 1),
    )
    return states.coarsen(size)


def _count_turns(time: Samples, values: Samples) -> tuple[float, float]:
    """Return how many cycles the highest relevant and the highest strong frequency complete over the record."""
    since_start = time - time[0]
    trend = np.polyval(np.polyfit(since_start, values, 2), since_start)
    tapered = (values - trend) * np.hanning(time.size)
    power = np.abs(np.fft.rfft(tapered)) ** 2
    # White noise has the same power at all frequencies, so the highest frequencies show the noise level.
    noise = _ABOVE_NOISE * float(compute_median(power[power.size // 2 :]))
    running = np.cumsum(np.maximum(power - noise, 0.0))
    limits = np.array([_ALL_POWER, _STRONG_POWER]) * running[-1]
    fastest, strongest = np.searchsorted(running, limits).tolist()
    return fastest, strongest


class Exponentials(NamedTuple):
    r"""A sum of decaying waves.

    .. math:: f(t) = \mathrm{Re} \sum_k w_k e^{p_k (t - t_0)}

    ``poles`` p [1/time] and ``weights`` w [energy] have shape (k,); the imaginary parts of the poles are not negative.
    ``origin`` is t_0 [time].
    """

    poles: Complex
    weights: Complex
    origin: float

    def at(self, t: Samples | float) -> Samples:
        """Return the value at each time, with the shape of ``t`` [energy]."""
        if not self.poles.imag.any():
            # Real exponentials take a tenth of the time of complex ones.
            since_origin = np.asarray(t, dtype=np.float64) - self.origin
            decays = np.exp(np.multiply.outer(since_origin, self.poles.real))
            return np.asarray(decays @ self.weights.real)
        return np.asarray((self.waves(t) @ self.weights).real)

    def waves(self, t: Samples | float) -> Complex:
        """Return each wave without its weight, with the shape of ``t`` and a last axis for waves [-]."""
        return np.exp(
            np.multiply.outer(np.asarray(t, dtype=np.float64) - self.origin, self.poles)
        )

    def differentiate(self, times: Samples) -> Samples:
        """Return the derivatives of the sum at times (n,) with respect to its 4 k parameters, shape (n, 4 k).

        The parameters are the real parts of all weights, their imaginary parts, then the same for the poles.
        """
        since_origin = times - self.origin
        return _differentiate(self.waves(times), self.weights, since_origin)

    def some(self, which: NDArray[np.bool_]) -> Exponentials:
        """Return the waves selected by a mask."""
        return Exponentials(self.poles[which], self.weights[which], self.origin)


def _differentiate(waves: Complex, weights: Complex, since_origin: Samples) -> Samples:
    """Return the derivatives of a sum of ``waves`` (n, k), as `Exponentials.differentiate` does, shape (n, 4 k)."""
    moved = waves * weights * since_origin[:, np.newaxis]
    return np.hstack([waves.real, -waves.imag, moved.real, -moved.imag])


class Spectrum(NamedTuple):
    """An energy modelled by ``lines`` and a ``mean``; ``rest`` (m,) is the misfit on the grid [energy]."""

    lines: Exponentials
    mean: Exponentials
    rest: Samples

    @property
    def error(self) -> float:
        """Return the rms misfit of the spectrum [energy]."""
        return float(np.sqrt(np.mean(self.rest**2)))

    def turned(self) -> Spectrum:
        """Convert lines of the kinetic energy to the corresponding lines of the internal energy.

        With the damping ratio z and s = sqrt(1 - z^2), the weight of a line of T is -(s + i z)^2 times that of V.
        """
        damping = -self.lines.poles.real / np.abs(self.lines.poles)
        turn = (np.sqrt(1 - damping**2) + 1j * damping) ** 2
        return Spectrum(
            self.lines._replace(weights=-self.lines.weights / turn),
            self.mean,
            -self.rest,
        )

    def count_slow_as_mean(self, span: float) -> Spectrum:
        """Return the spectrum after moving all lines that do not complete a cycle in ``span`` [time] to the mean."""
        is_slow = self.lines.poles.imag * span < 2 * np.pi * _SURE_TURNS
        slow = self.lines.some(is_slow)
        mean = self.mean._replace(
            poles=np.concatenate([self.mean.poles, slow.poles]),
            weights=np.concatenate([self.mean.weights, slow.weights]),
        )
        return self._replace(lines=self.lines.some(~is_slow), mean=mean)

    def average_blocks(self, grid: Grid) -> Spectrum:
        """Return the spectrum whose values are the means over the blocks of a grid, with the same misfit."""
        lines, mean = (
            waves._replace(weights=waves.weights * grid.gain(waves.poles))
            for waves in (self.lines, self.mean)
        )
        return self._replace(lines=lines, mean=mean)

    def differentiate_means(self, grid: Grid) -> Samples:
        """Return the derivatives of the means over the m blocks of a grid that begins at the origin, (m, 4 k + mean).

        The parameters are those of `Exponentials.differentiate` for the k lines, then the weights of the mean.
        """
        averaged = self.average_blocks(grid)
        lines = averaged.lines
        since_origin = grid.time - grid.time[0]
        of_lines = _differentiate(grid.waves(lines.poles), lines.weights, since_origin)
        return np.hstack([of_lines, grid.waves(self.mean.poles).real])

    def at(self, t: Samples | float) -> Samples:
        """Return the energy at each time, with the shape of ``t`` [energy]."""
        return self.lines.at(t) + self.mean.at(t)


class Prediction(NamedTuple):
    """The ``spectrum`` of a grid, the spectrum of the grid's first part, and its error in predicting the rest.

    ``missed`` is the rms deviation of the whole grid from the spectrum of the first part, relative to ``swing`` [-].
    ``swing`` is the standard deviation of the energy about its trend [energy].
    """

    spectrum: Spectrum
    of_first_part: Spectrum
    missed: float
    swing: float

    def turned(self) -> Prediction:
        """Convert a prediction of the kinetic energy to the corresponding prediction of the internal energy."""
        spectra = (self.spectrum.turned(), self.of_first_part.turned())
        return Prediction(*spectra, self.missed, self.swing)

    def count_slow_as_mean(self, span: float) -> Prediction:
        """Return the prediction after moving all lines that do not complete a cycle in ``span`` [time] to the mean."""
        return self._replace(
            spectrum=self.spectrum.count_slow_as_mean(span),
            of_first_part=self.of_first_part.count_slow_as_mean(span),
        )


class _Trial(NamedTuple):
    """A number of exponentials (``order``) with the error of its prediction, and its spectrum of the first part."""

    missed: float
    order: int
    every_decay: bool
    of_first: Spectrum


def predict(grid: Grid) -> Prediction | None:
    """Find the spectral lines that best predict the energy; None if the record is too short or does not oscillate."""
    swing = _measure_swing(grid)
    best = _find_best_order(grid, swing)
    if best is None:
        return None
    poles = _SignalSpace.of(grid).poles(best.order)
    whole = fit_spectrum(grid, poles, grid.span, every_decay=best.every_decay)
    return Prediction(whole, best.of_first, best.missed, swing)


def is_unpredictable(grid: Grid, most_missed: float) -> bool:
    """Return True if means over few long blocks already show that lines predict the energy badly.

    A mean of a sum of lines is again a sum of lines with the same decay rates, so what predicts an energy predicts its
    means. This test takes a tenth of the time of a prediction. It is not made if there are not many more blocks, or if
    the means hide most of the energy's oscillation.

    Parameters
    ----------
    grid : Grid
    most_missed : float
        Largest prediction error that is not bad [-].
    """
    if grid.time.size < _MANY_BLOCKS * _FEW_BLOCKS:
        return False
    coarse = grid.coarsen(grid.time.size // _FEW_BLOCKS)
    swing = _measure_swing(coarse)
    if swing < _MOST_SWING * _measure_swing(grid):
        return False
    best = _find_best_order(coarse, swing)
    return best is not None and best.missed > most_missed


def _measure_swing(grid: Grid) -> float:
    """Return the standard deviation of the energy about its trend [energy]."""
    reach = grid.time - grid.time[0]
    trend = np.polyval(np.polyfit(reach, grid.energy, 2), reach)
    return float(np.std(grid.energy - trend))


def _find_best_order(grid: Grid, swing: float) -> _Trial | None:
    """Find the number of exponentials with which the first part of a grid predicts the rest best; None as `predict`."""
    if grid.time.size < _FEWEST_STATES // 2 or not swing > 0:
        return None
    first = grid.first_part
    rest = grid.some(slice(first.time.size, None))
    space = _SignalSpace.of(first)
    tried: list[_Trial] = []
    for order in _ORDERS:
        if order > first.time.size // 3 or order + 2 > space.size:
            break
        poles = space.poles(order)
        for every_decay in (False, True):
            spectrum = fit_spectrum(first, poles, grid.span, every_decay=every_decay)
            predicted = _average_blocks(spectrum, rest)
            error = float(np.sqrt(np.mean((predicted - rest.energy) ** 2)))
            missed = float(np.hypot(error, spectrum.error)) / swing
            if not tried or missed < _get_needed(tried[-1].of_first) * tried[-1].missed:
                tried.append(_Trial(missed, order, every_decay, spectrum))
        if tried[-1].missed < PERFECT:
            break
    return tried[-1] if tried else None


def _get_needed(spectrum: Spectrum) -> float:
    """Return the factor by which additional exponentials must reduce the prediction error of a spectrum [-]."""
    powers = np.abs(np.fft.rfft(spectrum.rest)) ** 2
    typical = float(np.mean(powers))
    return _BETTER if powers.max() > _OF_A_LINE * typical else _CLEARLY_BETTER


class _SignalSpace:
    """The signal subspace spanned by the windows of a record; its directions are in descending order of size.

    Two products of the directions suffice to find poles: of all values but the last with all values but the first, and
    of the ``last_values`` with themselves, because the directions are orthonormal.
    """

    def __init__(self, vectors: Samples, step: float) -> None:
        self.size, self.step = int(vectors.shape[1]), step
        leading = vectors[:, : max(_ORDERS)]
        self._shifted = leading[:-1].T @ leading[1:]
        self._last_values = leading[-1]

    @classmethod
    def of(cls, grid: Grid) -> _SignalSpace:
        """Compute the signal subspace of a grid."""
        lags = min(grid.time.size // 2, _MOST_LAGS)
        windows = np.lib.stride_tricks.sliding_window_view(grid.energy, lags)
        return cls(np.linalg.eigh(windows.T @ windows)[1][:, ::-1], grid.step)

    def poles(self, order: int) -> Complex:
        """Return the poles of ``order`` exponentials [1/time], from the shift invariance of the subspace (ESPRIT)."""
        shifted = self._shifted[:order, :order]
        last = self._last_values[:order]
        # The least-squares solution for orthonormal directions without their last values (Sherman and Morrison).
        without_last = max(1 - float(last @ last), _TINY)
        shift = shifted + np.outer(last, last @ shifted) / without_last
        factors = np.linalg.eigvals(shift)
        is_usable = np.isfinite(factors) & (np.abs(factors) > 1e-6)
        usable_factors = factors[is_usable].astype(np.complex128)
        return np.asarray(np.log(usable_factors) / self.step)


def fit_spectrum(
    grid: Grid, poles: Complex, span: float, *, every_decay: bool = False
) -> Spectrum:
    """Fit lines and a mean with the given poles to a grid.

    Decays that cannot be distinguished within ``span`` [time] are merged.

    If ``every_decay`` is True, the mean also contains the decay of each line; with noise, this works only for few
    lines.
    """
    return fit_weights(grid, *_split(poles, span, every_decay=every_decay))


def fit_weights(grid: Grid, lines: Complex, mean: Complex) -> Spectrum:
    """Fit the weights of lines and of a mean, whose poles are given, to a grid."""
    all_poles = np.concatenate([lines, mean])
    waves = grid.waves(all_poles) * grid.gain(all_poles)
    swinging = all_poles.imag > 0
    design = np.hstack([waves.real, -waves.imag[:, swinging]])
    solution = solve_least_squares(design, grid.energy)
    weights = solution[: all_poles.size].astype(np.complex128)
    weights[swinging] += 1j * solution[all_poles.size :]
    origin = float(grid.time[0])
    count = lines.size
    remainder = grid.energy - design @ solution
    return Spectrum(
        Exponentials(lines, weights[:count], origin),
        Exponentials(mean, weights[count:], origin),
        remainder,
    )


def _average_blocks(spectrum: Spectrum, grid: Grid) -> Samples:
    """Return the means of a spectrum over the blocks of a grid, shape (m,) [energy]."""
    parts = (spectrum.lines, spectrum.mean)
    poles = np.concatenate([part.poles for part in parts])
    weights_at_start = np.concatenate(
        [part.weights * part.waves(grid.time[0]) for part in parts]
    )
    means = grid.waves(poles) @ (weights_at_start * grid.gain(poles))
    return np.asarray(means.real)


def _split(
    poles: Complex, span: float, *, every_decay: bool
) -> tuple[Complex, Complex]:
    """Separate the poles of lines from those of the mean: a constant, decays, and very slow oscillations."""
    decay = np.maximum(-poles.real, -MOST_GROWTH / span)
    rate = poles.imag
    is_line = are_lines(poles, span)
    is_short_of_line = rate * span < 2 * np.pi * _LEAST_TURNS
    is_slow = (rate >= 0) & is_short_of_line & (decay * span < MOST_DECAY)
    decays = np.concatenate([decay[is_line], decay[is_slow]])
    if not every_decay:
        decays = _few_of(decays, span)
    slow = rate[is_slow & (rate * span > 0.5)]
    mean = np.concatenate([[0.0], -decays, 1j * slow])
    return -decay[is_line] + 1j * rate[is_line], mean.astype(np.complex128)


def are_lines(poles: Complex, span: float) -> NDArray[np.bool_]:
    """Return a mask of the poles that can be lines of modes in a record of the length ``span`` [time]."""
    decay = -poles.real
    has_turned = poles.imag * span > 2 * np.pi * _LEAST_TURNS
    is_weakly_damped = decay < _MOST_DAMPED * poles.imag
    return np.asarray(has_turned & is_weakly_damped & (decay * span < MOST_DECAY))


def _few_of(decays: Samples, span: float) -> Samples:
    """Replace many decays with a few that can be distinguished in the record."""
    rounded = sorted(set(np.round(decays * span, 1).tolist()))
    few = np.array([decay for decay in rounded if abs(decay) > _SAME_DECAY])
    if few.size > _MOST_DECAYS:
        spread = np.linspace(0, few.size - 1, _MOST_DECAYS)
        few = few[spread.round().astype(int)]
    return few / span
