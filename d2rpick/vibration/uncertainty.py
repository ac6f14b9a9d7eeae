"""How far the true time of a crossing may lie from the one found: sampling, printed digits, scatter of a fit."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Precision, Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.modes import Modes
    from d2rpick.vibration.one_mode import Mode

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
    most, square = (
        a + b for a, b in zip(_rounding(history, times), _rounding(history, np.atleast_1d(td)), strict=True)
    )
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
    return (
        np.minimum(distance, np.pi / 2 / mode.fastest)
        + _BETWEEN_SAMPLES * history.step
        + _time_quanta(history, times, td)
    )


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


def _time_quanta(history: History, times: Samples, td: float) -> Samples:
    return _half_quanta(history.time_precision, times) + history.time_precision.quantum(td) / 2


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
