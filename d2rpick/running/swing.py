"""How far a body would be out of place because parts of it swing as it becomes rigid, by what a flight shows so far."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.flight.flight import Flight
from d2rpick.flight.position_error import MOST_OF_PATH, drift_in_flight

if TYPE_CHECKING:
    from d2rpick.histories.history import History


class Swing(NamedTuple):
    """A part that swings against the others: its ``name``, and how far the body may be out of place [length].

    In a flight that is shorter than ``flight`` [time] that is more than 1 % of the path, beyond which a body is out of
    place.
    """

    name: str
    error: float
    flight: float

    @property
    def told(self) -> str:
        """What is to be known before the body becomes rigid."""
        return (
            f"{self.name} still swings against the others: at td the body may be off by about {self.error:.3g},"
            f" more than {MOST_OF_PATH:.0%} of its path in a flight shorter than {self.flight:.3g}"
        )


def swing_in(history: History, start: float, tr: float) -> Swing | None:
    """Find how far the body that becomes rigid at ``tr`` may be out of place, in a flight since ``start`` [time].

    td is not known: it is taken for the state so far at which the parts stand farthest from where they are at tr.  None
    where the momenta of the parts do not tell.
    """
    momenta = next((one for one in history.momenta if one.parts is not None), None)
    if momenta is None or momenta.parts is None:
        return None
    flying = tuple(momenta.parts[i] for i in momenta.moving)
    drift = drift_in_flight(history, Flight(start, tr, "momentum", flying))
    if drift is None or not drift.path[-1] > 0:
        return None
    error = float(np.max(drift.errors(drift.time, float(drift.time[-1]))))
    return Swing(drift.part.name, error, error / MOST_OF_PATH * (tr - start) / float(drift.path[-1]))
