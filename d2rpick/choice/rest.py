"""Free fall and rest: where nothing vibrates in a flight there is nothing to match, and any tr in it is right."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.energy_alone import round_off

if TYPE_CHECKING:
    from d2rpick.choice.situation import Situation

# Level errors up to here count as equal: no tr is better than another one.
_ONE_LEVEL: Final = 0.02


def at_rest(situation: Situation) -> bool:
    """Whether nothing vibrates from the start of the flight to td.

    The energy is round-off there or, where no vibration is known, stays on one level, that of td.
    """
    start = situation.earliest_tr
    if start is None or not situation.in_flight:
        return False
    history, td = situation.history, situation.td
    inside = history.energy[slice(*np.searchsorted(history.time, [start, np.nextafter(td, np.inf)]))]
    if not inside.size:
        return False
    least = round_off(history)  # 0 where no energy is written at all: that tells nothing
    if least > 0 and float(np.abs(inside).max()) <= least:
        return True
    level = history.energy_at(td)
    if situation.vibration or level <= 0 or inside.min() < 0:
        return False
    return float(np.abs(np.sqrt(inside / level) - 1).max()) <= min(_ONE_LEVEL, situation.settings.tolerance)
