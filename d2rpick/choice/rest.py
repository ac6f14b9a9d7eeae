"""Free fall and rest: where nothing vibrates in a flight there is nothing to match, and any tr in it is right."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.energy_alone import round_off
from d2rpick.vibration.identify import MIN_SAMPLES_PER_PERIOD

if TYPE_CHECKING:
    from d2rpick.histories.history import History

# Level errors up to here count as equal: no tr is better than another one.
_ONE_LEVEL: Final = 0.02
# Share of a flight before the contact that ends it: the margin that td keeps, in which the contact may have begun.
_BEFORE_CONTACT: Final = 0.03


def nothing_vibrates(
    history: History, flight: tuple[float, float | None], td: float, tolerance: float, *, deformed: bool
) -> bool:
    """Whether the energy is round-off all through ``flight`` [time] or, by the level error, stays on that of ``td``.

    Free flight excites nothing: what vibrates in any part of it has done so from its start.  So all of it is asked,
    where its end is known, and not only the time up to td.  ``tolerance`` is that on the level error [-].  Where a
    vibration is known (``deformed``), a constant level does not mean rest.
    """
    start, end = flight
    last = td if end is None else max(td, end - _BEFORE_CONTACT * (end - start))
    _, inside = history.between(start, last)
    if inside.size < MIN_SAMPLES_PER_PERIOD:  # between so few a vibration is not seen
        return False
    least = round_off(history)  # 0 where no energy is written at all: that tells nothing
    if least > 0 and float(np.abs(inside).max()) <= least:
        return True
    level = history.energy_at(td)
    low, high = float(inside.min()), float(inside.max())
    if deformed or level <= 0 or low < 0:
        return False
    return max(1 - sqrt(low / level), sqrt(high / level) - 1) <= min(_ONE_LEVEL, tolerance)
