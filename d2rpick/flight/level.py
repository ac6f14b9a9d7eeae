"""What the energies do in free flight: the internal one keeps its level, and there is more motion than vibration.

A fixed rigid wall does no work, so that a crash into it keeps kinetic and internal energy together constant, and two
bodies that collide keep their momentum.  But what is pushed is deformed, and what springs back gains speed: the
internal energy drifts, and the energy of the whole does not follow as it does where damping takes both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import window

if TYPE_CHECKING:
    from d2rpick.histories.history import Balance, Samples

# The band of the last quarter of a flight, widened on both sides by this share of its width, holds all before it.
_RESERVE: Final = 0.5
# The means of its last two quarters differ by at most this share of that width: of a steady drift by all of it, of a
# vibration that shows three quarters of a period in each by 0.3.
_DRIFT: Final = 0.35
# A slow vibration is told from a crash, which ends where the energy has swung once to and fro: so many swings by half
# of the range, and ranges and means of both halves that are this much alike.
_SWINGS: Final = 4
_ALIKE: Final = 0.75
# Below this share of the largest energy a width is round-off: tables and single precision have seven digits.
_ROUND_OFF: Final = 1e-6
# An energy that falls so low beside its peaks is that of one vibration, which is at rest where it peaks.  Of what has
# been deformed for good, a thousandth is next to nothing.
_TO_ZERO, _HARDLY = 0.05, 1e-3


def settled_from(time: Samples, energy: Samples, whole: Samples | None, start: float, end: float) -> float | None:
    """Give the time in a window from which an internal energy keeps its level; None where it drifts to the end.

    Parameters
    ----------
    time, energy : array of shape (n,)
    whole : array of shape (n,), or None
        Kinetic and internal energy together: what damping takes of them, the level may lose.  None where unknown: then
        it may fall by any amount.
    start, end : float
        [time]
    """
    inside = window(time, start, end)
    least = _ROUND_OFF * float(np.abs(energy).max(initial=0.0))
    first, last = inside.start, inside.stop
    while last - first >= FEWEST:
        states = energy[first:last], None if whole is None else whole[first:last], least
        kept = 0 if _swings(*states) else _kept_from(*states)
        if kept is not None:
            return start if first + kept == inside.start else float(time[first + kept])
        first += max(1, (last - first) // 4)
    return None


def _kept_from(energy: Samples, whole: Samples | None, least: float) -> int | None:
    """First state from which an energy keeps the level of its last quarter; None where that drifts."""
    half, last = energy.size // 2, 3 * energy.size // 4
    low, high = float(energy[last:].min()), float(energy[last:].max())
    width = max(high - low, least)
    lost = np.full(energy.size, np.inf) if whole is None else np.maximum(whole - whole[last:].mean(), 0.0)
    drift = float(energy[last:].mean() - energy[half:last].mean())
    if abs(drift) > _DRIFT * width + (float(lost[half:last].mean()) if drift < 0 else 0.0):
        return None
    below = low - _RESERVE * width - (0.0 if whole is None else lost[:last])
    outside = np.flatnonzero((energy[:last] < below) | (energy[:last] > high + _RESERVE * width + lost[:last]))
    return int(outside[-1]) + 1 if outside.size else 0


def _swings(energy: Samples, whole: Samples | None, least: float) -> bool:
    """Whether an energy swings slowly about one level: to and fro by half of its range, alike in both halves."""
    width = float(np.ptp(energy))
    if width <= least:
        return True
    one, two = np.array_split(energy, 2)
    lost = 0.0 if whole is None else max(0.0, float(whole[0] - whole[-1]))
    drift = float(two.mean() - one.mean())
    if abs(drift) > _DRIFT * _ALIKE * width + (lost if drift < 0 else 0.0):
        return False
    if min(np.ptp(one), np.ptp(two)) < _ALIKE * width - lost:
        return False
    return _large_swings(energy, width / 2) >= _SWINGS


def _large_swings(energy: Samples, least: float) -> int:
    """How often an energy turns after it has changed by ``least``."""
    extrema = np.flatnonzero(np.diff(np.sign(np.diff(energy)))) + 1
    turns, low, high, rising = 0, energy[0], energy[0], None
    for value in [*energy[extrema].tolist(), float(energy[-1])]:
        low, high = min(low, value), max(high, value)
        if rising is not True and value - low >= least:
            turns, rising, high = turns + 1, True, value
        elif rising is not False and high - value >= least:
            turns, rising, low = turns + 1, False, value
    return turns


def moves_as_a_whole(balance: Balance, start: float, end: float) -> bool:
    """Whether more moves in a window than the vibration that the internal energy shows."""
    inside = window(balance.time, start, end)
    if balance.kinetic is None or balance.internal is None or not balance.time[inside].size:
        return True
    kinetic, internal = balance.kinetic[inside], balance.internal[inside]
    top, bottom = float(internal.max()), float(internal.min())
    least = _TO_ZERO * top if bottom <= _TO_ZERO * top else max(top - bottom, _HARDLY * top)
    return float(kinetic[int(np.argmax(internal))]) > least
