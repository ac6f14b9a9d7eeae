"""How far back from a td a tr can lie at most, read off the record for many td at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.choice.ranking import LIKE_LEVELS
from d2rpick.flight.internal_energy import round_off

if TYPE_CHECKING:
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# Level error that rounding leaves of a crossing at most, of a level above this share of the highest energy.
_ROUNDING: Final = 1e-3


def longest_rigid_times(situation: Situation, times: Samples) -> Samples:
    """Upper bounds for the rigid time of the tr that is recommended at each of many td, of their shape (n,) [time].

    Where the level is all that decides, that tr does not lie before the energy first comes near the level at td: by
    the tolerance, or by what counts as like levels where it passes the level itself and turns twice before td.  Where
    a model of the vibration decides at some td, or the level is round-off, the start of the flight is the bound.  Zero
    where that start is not known.
    """
    start, history = situation.earliest_tr, situation.history
    if start is None:
        return np.zeros(times.shape)
    start = max(start, float(history.time[0]))
    if situation.evidence.has_model or start >= history.time[-1]:
        return np.maximum(times - start, 0.0)
    later = history.time > start
    time = np.append(start, history.time[later])
    energy = np.append(history.energy_at(start), history.energy[later])
    level, tolerance = history.energies_at(times), situation.settings.tolerance
    passed = time[np.minimum(_reached(energy, level, np.full(times.shape, -_ROUNDING)), time.size - 1)]
    turns = np.searchsorted(history.turns, times) - np.searchsorted(history.turns, passed, side="right")
    passes = (turns >= 2) & (level > _ROUNDING * np.abs(history.energy).max())
    near = np.where(passes, min(tolerance, LIKE_LEVELS), tolerance) + _ROUNDING
    entered = time[np.maximum(_reached(energy, level, near) - 1, 0)]  # or since, but after the state before
    return np.asarray(np.maximum(times - np.where(level <= round_off(history), start, entered), 0.0))


def _reached(energy: Samples, level: Samples, near: Samples) -> Samples:
    """Index of the first state by which the energy has been in the band about each level; their number where none is.

    The band holds the level errors up to ``near``; of a negative one both sides of the level have been met.
    """
    low, high = (np.maximum(level, 0.0) * np.maximum(1 + sign * near, 0.0) ** 2 for sign in (-1, 1))
    lowest, highest = np.minimum.accumulate(energy), np.maximum.accumulate(energy)
    fallen = energy.size - np.searchsorted(lowest[::-1], high, side="right")
    return np.asarray(np.maximum(fallen, np.searchsorted(highest, low, side="left")))
