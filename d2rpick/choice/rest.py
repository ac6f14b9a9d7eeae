"""Free fall and rest: where nothing vibrates in a flight there is nothing to match, and any tr in it is right."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.internal_energy import round_off
from d2rpick.vibration.identify import MIN_SAMPLES_PER_PERIOD

if TYPE_CHECKING:
    from d2rpick.histories.history import History

# Of the highest energy a solver errs by so much at any time.
_SOLVER_ERROR: Final = 1e-5
# Of the largest vibration since the load was over: a hundredth of its amplitude.
_FAINT: Final = 1e-4
# An energy that is rounded to and fro between two numbers: their distance, and half of one to either side.
_QUANTA: Final = 2
# Share of a flight before the contact that ends it: the margin that td keeps, in which the contact may have begun.
_BEFORE_CONTACT: Final = 0.03


def nothing_vibrates(history: History, flight: tuple[float, float | None], td: float, *, deformed: bool) -> bool:
    """Whether the energy is round-off all through ``flight`` [time], or swings by no more than can be told from noise.

    Free flight excites nothing: what vibrates in any part of it has done so from its start.  So all of it is asked,
    where its end is known, and not only the time up to td.  Plastic work is no yardstick: however high the level, what
    counts is how far the energy swings about it.  Where a vibration is known (``deformed``), that is all there is.
    """
    start, end = flight
    last = td if end is None else max(td, end - _BEFORE_CONTACT * (end - start))
    _, inside = history.between(start, last)
    if inside.size < MIN_SAMPLES_PER_PERIOD:  # between so few a vibration is not seen
        return False
    least = round_off(history)  # 0 where no energy is written at all: that tells nothing
    if least > 0 and float(np.abs(inside).max()) <= least:
        return True
    if deformed or float(inside.min()) < 0 or history.energy_at(td) <= 0:
        return False
    return float(np.ptp(inside)) <= _faint(history, start)


def _faint(history: History, start: float) -> float:
    """Swing of the energy that is none [energy]: below what solver and digits resolve, and nothing beside others.

    What falls after the ``start`` of the flight [time] was elastic, at least; plastic work stays.
    """
    after = history.between(start, float(history.time[-1]))[1]
    fall = float((np.maximum.accumulate(after) - after).max(initial=0.0))
    highest = float(np.abs(history.energy).max())
    quantum = history.energy_precision.quantum(float(np.abs(after).max(initial=0.0)))
    return max(_SOLVER_ERROR * highest, _QUANTA * quantum, _FAINT * fall)
