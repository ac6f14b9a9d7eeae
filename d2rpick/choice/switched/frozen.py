"""Recognise a switched run by its energy alone, which is constant while the parts are rigid.

At td, the parts have no vibration velocity, so all vibration energy is strain energy, and the internal energy can only
fall. This distinguishes a rigid window from a flight in which nothing vibrates, because the contact that ends such a
flight adds energy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import RangeError, list_names
from d2rpick.base.memory import remember
from d2rpick.flight.internal_energy import round_off
from d2rpick.flight.window import LAST_DIGIT
from d2rpick.histories.samples import find_stretches

if TYPE_CHECKING:
    from d2rpick.base.spans import Times
    from d2rpick.histories.history import History, Samples

# Code of the warning about a record of a switched run.
RIGID_TIMES: Final = "rigid-times"
# A part is recognised as rigid after at least this number of states without kinetic energy or of constant energy.
FEWEST: Final = 12
# An energy vibrates if it changes by at least this multiple of the limit for a constant energy [-].
_MUCH: Final = 100.0


@remember
def find_frozen_times(history: History) -> tuple[Times, ...]:
    """Return the windows in which the energy is constant, after a vibration and before it falls [time]."""
    energy = history.energy
    limits = np.maximum(
        LAST_DIGIT * np.abs(energy), history.energy_precision.quanta(energy)
    )
    unchanged = np.abs(np.diff(energy)) <= limits[1:]
    stretches = find_stretches(np.append(False, unchanged), FEWEST)
    time = history.time
    return tuple(
        (float(time[stretch.start - 1]), float(time[stretch.stop - 1]))
        for stretch in stretches
        if _is_frozen(energy, stretch, float(limits[stretch.start]), round_off(history))
    )


def _is_frozen(energy: Samples, stretch: slice, limit: float, rounding: float) -> bool:
    """Return True if the energy vibrates just before an interval of constant energy, and falls just after it."""
    level = float(energy[stretch.start])
    smallest = max(_MUCH * limit, rounding)
    if level <= smallest:
        return False
    before = energy[max(stretch.start - 1 - FEWEST, 0) : stretch.start - 1]
    after = energy[stretch.stop :]
    moving = np.flatnonzero(np.abs(after - level) > smallest)
    vibrates = float(np.abs(before - level).max(initial=0.0)) > smallest
    return vibrates and moving.size > 0 and bool(after[moving[0]] < level)


def compute_energy_range(history: History, start: float, end: float) -> float:
    """Return the range of the energy between two times [energy]."""
    inside = history.between(start, end)[1]
    at_ends = history.energies_at(np.array([start, end]))
    return float(np.ptp(np.append(inside, at_ends)))


def refuse_switched(history: History, start: float | None, td: float) -> None:
    """Raise RangeError if the parts were rigid at some time from the start of the flight to td [time].

    If ``start`` is unknown, the test begins at the start of the record.
    """
    earliest = history.start if start is None else start
    rigid = [
        window
        for window in find_frozen_times(history)
        if window[1] > earliest and window[0] < td
    ]
    if not rigid:
        return
    windows = list_names([f"{begin:.6g} to {end:.6g}" for begin, end in rigid])
    raise RangeError(
        f"{', '.join(history.source)}: this is a switched run: the internal energy is frozen from {windows}; choose "
        "times from the reference run, and compare this one with it (d2rpick verify)"
    )
