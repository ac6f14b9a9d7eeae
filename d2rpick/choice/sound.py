"""Whether a run can be judged at all: one that blew up cannot, nor one in which nothing ever deforms."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.choice.warnings import Caution
from d2rpick.errors import RangeError
from d2rpick.vibration.modes import LARGEST_ENERGY

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import History

# A run that blew up gains energy from nothing: within a twentieth of the record its kinetic energy exceeds all that
# was there before by nine orders of magnitude, and the internal energy then by six, which has grown a thousandfold as
# well.  A load on a body at rest deforms it as it moves it, a velocity that is given to all of it does not deform it.
_WITHIN: Final = 1 / 20
_GAIN, _SPEED, _TORN = 1e9, 1e6, 1e3
# So many states with energy have to lie before: the first ones of a body at rest hold round-off, or nothing.
_FEWEST: Final = 12
# No unit makes energies of a structure that small: LS-DYNA's begin at 2e-20 per process.
_NOTHING: Final = 1e-20


def refuse_unsound(history: History, *, choosing: bool = False) -> None:
    """RangeError where no number of the run can be used, and for ``choosing`` where there is nothing to choose by."""
    for one in unsound(history):
        if choosing or one.code != "nothing-to-judge":
            raise RangeError(f"{', '.join(history.source)}: {one.message}")


def unsound(history: History) -> Iterator[Caution]:
    """Say why a run cannot be judged, with stable codes."""
    largest = float(np.abs(history.energy).max(initial=0.0))
    if largest > LARGEST_ENERGY:
        yield Caution("energy-too-large", f"energies up to {largest:g}, at most {LARGEST_ENERGY:g} was expected")
    elif found := _blew_up(history):
        yield Caution("blew-up", found)
    elif _has_nothing(history):
        found = f"nothing to judge: no internal energy exceeds {largest:.3g}, so nothing deforms"
        yield Caution("nothing-to-judge", found)


def _blew_up(history: History) -> str | None:
    """Name the time at which the energy exceeds all sense, and by how much; None in a sound run."""
    balance = history.balance
    if balance is None or balance.kinetic is None or balance.internal is None or balance.time.size <= _FEWEST:
        return None
    time, kinetic, internal = balance.time, np.abs(balance.kinetic), np.abs(balance.internal)
    earlier = np.searchsorted(time, time - _WITHIN * (time[-1] - time[0]))  # states before the twentieth up to each
    counted = np.concatenate([[0], np.cumsum(kinetic + internal > 0)])[earlier] >= _FEWEST
    before, deformed = (
        np.concatenate([[0.0], np.maximum.accumulate(one)])[earlier] for one in (kinetic + internal, internal)
    )
    gained = counted & (deformed > 0) & (kinetic > _GAIN * before)
    gained &= (kinetic / _SPEED > internal) & (internal / _TORN > deformed)  # products might overflow
    if balance.external_work is not None:
        gained &= kinetic > _GAIN * np.abs(balance.external_work)
    at = int(np.argmax(gained))
    if not gained[at]:
        return None
    found = f"the run blew up: from {before[at]:.3g} before, its energy reaches {kinetic[at]:.3g} at {time[at]:.6g}"
    return f"{found}; nothing in it can be trusted"


def _has_nothing(history: History) -> bool:
    """Whether the internal energy of chosen parts and model is always zero, or all energies are nothing."""
    balance = history.balance
    if balance is None:
        return False
    internal, others = (history.energy, balance.internal), (balance.kinetic, balance.external_work, balance.total)
    highest, beside = (
        max((float(np.abs(term).max(initial=0.0)) for term in terms if term is not None), default=0.0)
        for terms in (internal, others)
    )
    return highest == 0 or max(highest, beside) <= _NOTHING
