"""Free flight, seen in the contact energy of the model: while nothing touches, it does not change."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final
from weakref import WeakKeyDictionary

import numpy as np

from d2rpick.flight.window import FEWEST, Constant, FreeFlight, Remembered, lasting_window

if TYPE_CHECKING:
    from d2rpick.histories.history import Balance

# A contact energy that never exceeds its printed digits by this factor shows no contact at all.
_VISIBLE = 100
# One for each record: it is asked about many td.
_LAWS: Final[WeakKeyDictionary[Balance, Remembered]] = WeakKeyDictionary()


def shows_contacts(balance: Balance) -> bool:
    """Whether the model has contacts that were ever closed, as far as the contact energy tells."""
    energy = balance.sliding
    return energy is not None and energy.size >= FEWEST and float(np.ptp(energy)) > _VISIBLE * _noise(balance)


def plateau_around(balance: Balance, td: float) -> FreeFlight | None:
    """Find the window around ``td`` [time] in which the contact energy is constant, or None.

    Where it has been constant since the first state no contact has ended, and a load of another kind may act: such a
    window counts only where the external work is written too, which shows that load.
    """
    time, energy = balance.time, balance.sliding
    if energy is None or not time[0] <= td <= time[-1]:
        return None
    if balance not in _LAWS:
        _LAWS[balance] = Remembered(Constant(time, energy[:, np.newaxis]))
    window = lasting_window(_LAWS[balance], td, float(np.ptp(energy)), _noise(balance))
    if window is None or (window[0] == 0 and balance.external_work is None):
        return None
    first, last = window
    return FreeFlight(float(time[first]), float(time[last]), None, last < time.size - 1)


def _noise(balance: Balance) -> float:
    """What the printed digits leave open [energy]."""
    assert balance.sliding is not None
    return balance.precision.quantum(float(np.abs(balance.sliding).max())) / 2
