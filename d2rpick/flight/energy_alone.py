"""The flight read off the internal energy alone, for want of better evidence: modest, and never certain.

A mild contact may leave no trace in the energy.  So the window begins late, and ends early where a contact is seen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.window import FEWEST, SHORTEST
from d2rpick.histories.samples import find_crossings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Samples

# Widening of the band of energies before td, against wiggles of a vibration that the band has not seen.
_BAND_RESERVE: Final = 0.25
# The energy falls into its band while the last pushes of the load still come: in 45 computed runs by up to three tenths
# of the time from there to td too early.  A third of that time is waited for; what it costs is known.
_WAIT: Final = 1 / 3
# A contact leaves this share of the lowest and highest energies for a moment, and comes faster than what is left of the
# vibration in the last quarter before td moves; a decaying vibration was less than twice as fast before.
_OUTER, _LATEST, _FASTER = 0.1, 1 / 4, 2.0
# The level is the mean over this share of the quiet time; it changes where it leaves its band, widened by its width.
_LEVEL: Final = 1 / 8
# A landing is seen against this share of the time before it, in which the energy has turned so often.
_KNOWN, _SWINGS = 3 / 4, 4


# Below a millionth of the largest energy of the run, energy is round-off: single precision keeps seven digits.
_ROUND_OFF: Final = 1e-6


class QuietTime(NamedTuple):
    """Window in which the energy shows no load; ``end`` None where no next contact is seen [time].

    ``settled`` is when the energy had settled: the time from there to ``start`` is given up for safety.
    """

    start: float
    end: float | None
    settled: float


def quiet_time(history: History, td: float) -> QuietTime | None:
    """Find the window around ``td`` [time] in which the energy stays in its band on one level, or None."""
    start, least = float(history.time[0]), round_off(history)
    before = np.abs(history.energy[history.time <= td])
    fallen = least > 0 and before.max() <= least and before.size >= FEWEST
    if fallen and td - start >= SHORTEST * (history.time[-1] - start):  # nothing has happened since the start
        return QuietTime(start, _burst(history, start, td), start)
    settled = end_of_load(history, td)
    if settled is None:
        return None
    settled = _last_push(history, _last_excursion(history, settled, td), td)
    changes = [time for time in (_burst(history, settled, td), _change_of_level(history, settled, td)) if time]
    return QuietTime(settled + _WAIT * (td - settled), min(changes, default=None), settled)


def landing_after(history: History, start: float) -> float | None:
    """Give the first time after ``start`` [time] at which the energy bursts out of what it was before, or None.

    It is held against the first three quarters of the time since ``start``, and must exceed their band by its width: no
    vibration goes so far beyond what it has done for so long.
    """
    inside = history.time >= start
    time, energy = history.time[inside], history.energy[inside]
    if time.size < FEWEST:
        return None
    known = np.searchsorted(time, start + _KNOWN * (time - start), side="right") - 1
    top, bottom = np.maximum.accumulate(energy)[known], np.minimum.accumulate(energy)[known]
    turns = np.searchsorted(history.turns, time[known]) - np.searchsorted(history.turns, start)
    long_enough = (turns >= _SWINGS) & (time - start >= SHORTEST * (history.time[-1] - history.time[0]))
    beyond = np.flatnonzero(long_enough & (energy > 2 * top - bottom))
    if not beyond.size:
        return None
    first = int(beyond[0])
    rising = np.flatnonzero(energy[: first + 1] <= top[first] + _BAND_RESERVE * (top[first] - bottom[first]))
    return float(time[rising[-1] + 1])


def end_of_load(history: History, td: float) -> float | None:
    """Take the load to be over when the energy falls into its band before td for the last time [time].

    The band is that of the last quarter of the record before td, widened by a quarter of its width.  Where the
    energy never was above the band, nothing shows that a load has ended, and where its last part leaves the band of
    the rest, something feeds the part again: None.
    """
    length = td - float(history.time[0])
    earlier, latest = (
        np.append(history.energy[(history.time >= td - share * length) & (history.time <= end)], history.energy_at(end))
        for share, end in ((1 / 4, td - length / 16), (1 / 16, td))
    )
    before = history.time <= td
    if latest.max() > earlier.max() + _BAND_RESERVE * np.ptp(earlier):
        return None
    values = np.append(earlier, latest)
    level = float(values.max() + _BAND_RESERVE * np.ptp(values))
    falling = [c.time for c in find_crossings(history.time[before], history.energy[before], level) if not c.rising]
    return falling[-1] if falling else None


def _last_excursion(history: History, start: float, td: float) -> float:
    """Give the last time from ``start`` to td at which the energy is far from where it stays most of the time."""
    inside = _between(history.time, start, td)
    time, energy = history.time[inside], history.energy[inside]
    if time.size < FEWEST:
        return start
    low, high = _widened(np.quantile(energy, (_OUTER, 1 - _OUTER)), 1.0)
    far = np.flatnonzero((energy < low) | (energy > high))
    return float(time[far[-1]]) if far.size else start


def _last_push(history: History, start: float, td: float) -> float:
    """Give the last time from ``start`` to td at which the energy changes much faster than just before td."""
    inside = _between(history.time, start, td)
    time, energy = history.time[inside], history.energy[inside]
    if time.size < FEWEST:
        return start
    rates = np.abs(np.diff(energy)) / np.diff(time)
    usual = rates[time[1:] >= td - _LATEST * (td - start)].max(initial=0.0)
    fast = np.flatnonzero(rates > _FASTER * usual)
    return float(time[fast[-1] + 1]) if fast.size else start


def _burst(history: History, start: float, td: float) -> float | None:
    """Give the first time after ``td`` at which the energy leaves its band from ``start`` to td upwards, or None."""
    top = _widened(history.energy[_between(history.time, start, td)], _BAND_RESERVE)[1]
    above = np.flatnonzero((history.time > td) & (history.energy > top))
    return float(history.time[above[0]]) if above.size else None


def _change_of_level(history: History, start: float, td: float) -> float | None:
    """Give the first time after ``td`` at which the mean energy leaves its band from ``start`` to td, or None."""
    width = round(_LEVEL * np.count_nonzero(_between(history.time, start, td)))
    if width < 1 or history.time.size <= width:
        return None
    sums = np.append(0.0, np.cumsum(history.energy))
    means, time = (sums[width:] - sums[:-width]) / width, history.time
    first, middle, last = time[: time.size - width + 1], time[width // 2 :][: means.size], time[width - 1 :]
    inside = (first >= start) & (last <= td)
    if not inside.any():
        return None
    low, high = _widened(means[inside], 1.0)
    off = np.flatnonzero((first > td) & ((means < low) | (means > high)))
    return float(middle[off[0]]) if off.size else None


def _between(time: Samples, start: float, end: float) -> NDArray[np.bool_]:
    return (time >= start) & (time <= end)


def _widened(values: Samples, share: float) -> tuple[float, float]:
    """Band of some values, widened on both sides by a share of its width."""
    room = share * float(np.ptp(values))
    return float(values.min()) - room, float(values.max()) + room


def round_off(history: History) -> float:
    """Energy below which an internal energy is round-off beside the energies of the run [energy]."""
    balance = history.balance
    terms = (balance.internal, balance.kinetic, balance.external_work, balance.total) if balance else ()
    largest = max(float(np.abs(term).max(initial=0.0)) for term in (history.energy, *terms) if term is not None)
    return _ROUND_OFF * largest
