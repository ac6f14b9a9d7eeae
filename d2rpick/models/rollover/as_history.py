"""Rehearsal: what the tool says of a run of the rollover box, where every other choice can be tried."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.choice.settings import Settings
from d2rpick.choice.suggest import suggest
from d2rpick.histories.history import EXACT, Given, History, Momenta
from d2rpick.histories.names import Part
from d2rpick.models.rollover.record import BOX, PARTS

if TYPE_CHECKING:
    from d2rpick.choice.suggest import Suggestion
    from d2rpick.models.rollover.record import Record


def history_of(record: Record) -> History:
    """Give the energy of the box, with the momenta of both parts."""
    parts = tuple(Part(number, title) for number, title in enumerate(PARTS, start=1))
    momentum = np.stack([record.momentum.real, 0 * record.momentum.real, record.momentum.imag], axis=2)
    return History(
        time=record.time,
        energy=record.internal_energy[:, BOX],
        source=("rollover",),
        format="rollover",
        channel="internal energy of box",
        parts=parts[:1],
        evidence=Given((Momenta(record.time, momentum, parts, EXACT, chosen=(BOX,)),)),
        time_unit="s",
    )


def suggestion_for(record: Record, td: float) -> Suggestion:
    """Let the tool choose tr for ``td`` [s], by nothing but the record."""
    return suggest(history_of(record), td, Settings())
