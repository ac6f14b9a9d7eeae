"""What a fit and its samples leave open: the times of crossings, and a further, small mode that hides in the rest.

The true time of a crossing is off by sampling, printed digits and the scatter of a fit.  A second mode is looked for in
what one mode leaves of a record.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.samples import integral
from d2rpick.vibration.fitting import cell_means
from d2rpick.vibration.identify import MIN_SAMPLES_BESIDE, MIN_SAMPLES_PER_PERIOD, identify_beside, samples_per_period
from d2rpick.vibration.modes import Mode, Modes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Precision, Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.waves import Waves


# Between samples E'' may exceed what second differences of the samples show; on random vibrations a quarter
# more covers 99 % of the true crossings from 8 samples per vibration period on.
_BEND_RESERVE = 1.25
# Three standard deviations: 99.7 % of normal errors.
_DEVIATIONS = 3.0
# Rounding errors are many, independent and of either sign: 2.6 standard deviations of their sum hold 99 % of it, and
# they add to the error of the bend as independent errors do.
_ROUNDING_DEVIATIONS = 2.6
# The systematic rest of a fit is mostly a vibration: its peaks are the root of 2 of its rms.
_PEAK_OF_REST = sqrt(2)
# However well a fit follows the samples, it is a model of what happens between them: this share of the output
# interval is kept in reserve.
_BETWEEN_SAMPLES = 1e-3


def sampled_reach(history: History, times: Samples, td: float, level: float) -> Samples:
    """Distance to the true crossing where tr comes from the samples themselves, linear between them.

    Parameters
    ----------
    history : History
    times : array of shape (n,)
        Switch times tr found at ``level`` [time].
    td : float
        [time]
    level : float
        Energy taken for that at td: of the samples or, where a fit tells it, off them by the fit's own error [energy].

    Returns
    -------
    array of shape (n,)
        The true crossing lies within tr - x and tr + x [time]; at most two output intervals.
    """
    time, energy = history.time, history.energy
    cell, interval = _cells(time, times)
    at_td, _ = _cells(time, np.atleast_1d(td))
    bend = curvature(time, energy, times)
    # Newton's error of linear interpolation: E''/2 times the distances to both neighbours; zero on a sample.
    off_td = float(curvature(time, energy, td)) * (td - time[at_td]) * (time[at_td + 1] - td) / 2
    curved = _BEND_RESERVE * (bend * interval**2 / 8 + off_td)
    of_tr, of_td = _rounding(history, times), _rounding(history, np.atleast_1d(td))
    most, square = (a + b for a, b in zip(of_tr, of_td, strict=True))
    rounded = np.minimum(most, _ROUNDING_DEVIATIONS * np.sqrt(square))
    slope = np.abs((energy[cell + 1] - energy[cell]) / interval)
    error = np.hypot(curved, rounded) + abs(level - history.energy_at(td))
    return np.minimum(reach(slope, bend, error), 2 * interval)


def fitted_reach(history: History, fit: Identification, mode: Mode | Modes, times: Samples, td: float) -> Samples:
    """Distance to the true crossing where tr and the level come from the fitted oscillator.

    The energy error is that of the fitted curve at tr and at td: its standard deviation from the scatter of the
    record about it, and what of the misfit is no scatter.  Arguments and result as in ``sampled_reach``, without level.
    """
    both = np.append(times, td)
    off = _DEVIATIONS * fit.energy_deviation(both) + _PEAK_OF_REST * _local_rest(fit, mode, both)
    error = off[:-1] + off[-1]
    slope, bend = mode.energy_slopes(times)
    distance = reach(np.abs(slope), np.abs(bend), error)
    # the fit, not the output interval, bounds how far a crossing can be off: it stays within a quarter of a period
    quanta = _half_quanta(history.time_precision, times) + history.time_precision.quantum(td) / 2
    return np.minimum(distance, np.pi / 2 / mode.fastest) + _BETWEEN_SAMPLES * history.step + quanta


def _local_rest(fit: Identification, mode: Mode | Modes, at: Samples) -> Samples:
    """Systematic rest of a fit near each time: its rms, and more where the vibration is above its own rms [energy]."""
    return np.asarray(fit.structure * np.maximum(1.0, mode.vibration_energy(at) / fit.vibration))


def _cells(time: Samples, at: Samples) -> tuple[NDArray[np.intp], Samples]:
    """Index of the sample before each time, and the interval to the next."""
    cell = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
    return cell, time[cell + 1] - time[cell]


def _rounding(history: History, at: Samples) -> tuple[Samples, Samples]:
    """Largest error that the printed digits leave in the interpolated energy, and its mean square [energy].

    Energy and time of both neighbours are off by up to half a quantum each, any value as likely as another.
    """
    cell, interval = _cells(history.time, at)
    off = at - history.time[cell]
    share, slope = off / interval, (history.energy[cell + 1] - history.energy[cell]) / interval
    energies = _half_quanta(history.energy_precision, history.energy[cell] + slope * off)
    times = slope * _half_quanta(history.time_precision, at)
    square = (energies**2 + times**2) / 3 * ((1 - share) ** 2 + share**2)
    return energies + np.abs(times), square


def _half_quanta(precision: Precision, values: Samples) -> Samples:
    return precision.quanta(values) / 2


def curvature(time: Samples, energy: Samples, at: Samples | float) -> Samples:
    """Largest |E''| near ``at``: of the four second divided differences about its cell [energy/time^2].

    Zero where the record has fewer than three samples.
    """
    at = np.asarray(at, dtype=np.float64)
    if time.size < 3:
        return np.zeros(at.shape)
    cell = np.searchsorted(time, at, side="right") - 1
    first = np.clip(cell[..., np.newaxis] + np.arange(-2, 2), 0, time.size - 3)
    t0, t1, t2 = (time[first + i] for i in range(3))
    e0, e1, e2 = (energy[first + i] for i in range(3))
    second = np.abs(2 * ((e2 - e1) / (t2 - t1) - (e1 - e0) / (t1 - t0)) / (t2 - t0))
    return np.asarray(second.max(axis=-1))


def reach(slope: Samples | float, bend: Samples | float, error: Samples | float) -> Samples:
    """How far in time a crossing can lie away when the energy there is wrong by ``error``.

    The smaller root x of slope x - bend x^2/2 = error; where there is none, the curve may turn before it
    reaches the level and sqrt(2 error/bend) is the distance at which its bend alone has used up the error.

    Parameters
    ----------
    slope, bend, error : array_like
        |E'| [energy/time], |E''| [energy/time^2] and the energy error [energy], not negative.

    Examples
    --------
    >>> float(reach(2.0, 0.0, 1.0)), float(reach(0.0, 2.0, 1.0))
    (0.5, 1.0)
    """
    slope, bend, error = np.broadcast_arrays(*(np.asarray(v, dtype=np.float64) for v in (slope, bend, error)))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        steep, curved = slope / error, bend / error  # per error: squares of energies might overflow
        root = steep**2 - 2 * curved
        regular = 2 / (steep + np.sqrt(np.maximum(root, 0)))
        turning = np.sqrt(2 / curved)
    return np.where(error == 0, 0.0, np.where(root > 0, regular, turning))


# Of n lines of white noise the strongest exceeds the mean power by ln n on average, and by this much more with a
# probability of 0.7 %.
_BEYOND_CHANCE: Final = 5.0
# Share of the vibration energy: a smaller mode changes a residual by 0.06 at most, and real solvers leave as much.
SMALLEST: Final = 1e-3
_LEFT_OVER: Final = 0.5  # of a second mode's line, at least: of a nearby rate one mode takes up the other half
_MOST_LINES: Final = 8192  # bounds the work; enough for 800 periods of the energy
_FINER: Final = 4  # points per line of a spectrum, so that its top is met
_STARTS: Final = 3  # strongest lines that a second mode is begun from


class _Spectrum(NamedTuple):
    """Lines of a rest that decay like the vibration: ``rate`` [rad over the record].

    ``amplitude`` is that at the start, over the vibration energy there [-]; ``chance`` is the power of each over the
    mean power of white noise with the same scatter.
    """

    rate: Samples
    amplitude: Samples
    chance: Samples


def resolved(time: Samples, energy: Samples, fit: Identification) -> Identification:
    """Split one mode into two where what it leaves over is not white and a second mode explains it.

    Parameters
    ----------
    time, energy : array of shape (n,)
        The window of the fit [time], [energy].
    fit : Identification
        Accepted; returned as it is but for its ``hidden_share`` where no second mode can be told.
    """
    assert fit.mode is not None
    least, spectrum = fit.hidden_share, _spectrum(time, energy, fit.mode)
    large = _share(spectrum) > SMALLEST * _LEFT_OVER
    if isinstance(fit.mode, Mode) and large and float(np.max(spectrum.chance)) > _certain(time.size):
        two = identify_beside(time, energy, fit.mode, _strongest(spectrum) / 2 / (fit.end - fit.start))
        if two.describes_record and _explains(two, fit, time.size):
            assert two.mode is not None
            fit, spectrum = two, _spectrum(time, energy, two.mode)
    assert fit.mode is not None
    hidden = max(least, _share(spectrum))
    if len(fit.mode.modes) > 1 and samples_per_period(time, fit.mode) < MIN_SAMPLES_PER_PERIOD:
        fastest = fit.mode.modes[-1].vibration_energy(time[0])  # its rate may be an alias
        hidden += float(fastest / fit.mode.vibration_energy(time[0]))
    return fit._replace(hidden_share=min(hidden, 1.0))


def hidden_share(time: Samples, energy: Samples, model: Mode | Modes | Waves) -> float:
    """Share of the vibration energy that a further mode may have in what a model leaves over, at most 1 [-]."""
    return min(_share(_spectrum(time, energy, model)), 1.0)


def _share(spectrum: _Spectrum) -> float:
    """Share of the vibration energy in a mode that makes the strongest line: E swings by half of it about as much."""
    return 2 * float(np.max(spectrum.amplitude))


def _certain(n: int) -> float:
    """Power of a line over the mean of ``n`` that chance does not give."""
    return float(np.log(n)) + _BEYOND_CHANCE


def _explains(two: Identification, one: Identification, n: int) -> bool:
    """Whether a second mode is large enough to matter and explains more than a line of white noise would."""
    assert two.mode is not None
    energies = [float(mode.vibration_energy(two.start)) for mode in two.mode.modes]
    gain = n * (one.rms**2 - two.rms**2)  # a line of power x takes 2 x from the sum of squares
    return min(energies) > SMALLEST * sum(energies) and gain > 2 * _certain(n) * two.rms**2


def _spectrum(time: Samples, energy: Samples, mode: Mode | Modes | Waves) -> _Spectrum:
    """Lines of what ``mode`` leaves over, from one period in the record to the fastest that the samples show."""
    span = float(time[-1] - time[0])
    count = min(time.size - 1, _MOST_LINES)
    s = (time - time[0]) / span
    rest = cell_means(s, integral(s, energy - mode.energy(time)), count)
    decay = np.exp(-mode.alpha * span * (np.arange(count) + 0.5) / count)
    power, whole = float(np.sum(decay**2)), float(mode.vibration_energy(time[0]))
    lines = np.abs(np.fft.rfft(rest * decay, _FINER * count))
    shown = slice(_FINER, max(_FINER + 1, _FINER * count // MIN_SAMPLES_BESIDE))
    mean = float(np.mean(rest**2)) * power or 1.0
    rate = 2 * np.pi / _FINER * np.arange(lines.size, dtype=np.float64)
    return _Spectrum(np.array(rate[shown]), 2 / power / whole * lines[shown], lines[shown] ** 2 / mean)


def _strongest(spectrum: _Spectrum) -> Samples:
    """Rates of the strongest lines, each the top of a hill."""
    height = np.pad(spectrum.amplitude, 1, constant_values=-1.0)
    tops = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:]))
    return np.asarray(spectrum.rate[tops[np.argsort(-spectrum.amplitude[tops])[:_STARTS]]])


def residual_bound(fit: Identification, residual: Samples, tr: Samples, td: Samples | float) -> Samples:
    """Largest residual of each tr of shape (n,) with the energy that a hidden mode may have, at worst [-].

    It then stood at tr at one end of its swing and at td at the other, where it is smaller by the damping in between:
    R^2 grows by its share of the vibration energy times (1 + exp(alpha (td - tr)/2))^2.
    """
    assert fit.mode is not None
    swing = 1 + np.exp(fit.mode.alpha / 2 * (td - tr))
    return np.sqrt(residual**2 + fit.hidden_share * swing**2)
