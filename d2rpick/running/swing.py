"""How far a body may be out of place whose parts still swing when it becomes rigid, by the flight so far."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.flight.flight import Flight
from d2rpick.flight.position_error import MOST_OF_PATH, drift_in_flight
from d2rpick.histories.samples import integral, window

if TYPE_CHECKING:
    from d2rpick.histories.history import History, Momenta


class Swing(NamedTuple):
    """A part that swings against the others: its ``name``, and how far the body may be out of place [length].

    In a flight that is shorter than ``flight`` [time] that is more than 1 % of the path, beyond which a body is out of
    place.  ``at_most``: two parts alone may turn instead, which puts nothing out of place.
    """

    name: str
    error: float
    flight: float
    at_most: bool = False

    @property
    def told(self) -> str:
        """What is to be known before the body becomes rigid."""
        what, limit = ("still swings against the others", "about")
        if self.at_most:
            what, limit = "swings against the other, or both turn", "at most"
        return (
            f"{self.name} {what}: at td the body may be off by {limit} {self.error:.3g},"
            f" more than {MOST_OF_PATH:.0%} of its path in a flight shorter than {self.flight:.3g}"
        )


def find_swing(history: History, start: float, tr: float) -> Swing | None:
    """Find how far the body that becomes rigid at ``tr`` may be out of place, in a flight since ``start`` [time].

    td is not known: it is taken for the state so far at which the parts stand farthest from where they are at tr.  None
    where the momenta of the parts do not tell.
    """
    momenta = next((one for one in history.momenta if one.parts is not None), None)
    if momenta is None or momenta.parts is None:
        return None
    flying = tuple(momenta.parts[i] for i in momenta.moving)
    drift = drift_in_flight(history, Flight(start, tr, "momentum", flying))
    if drift is None:
        name, error, path = _of_two(momenta, start, tr)
    else:
        name, error, path = (
            drift.part.name,
            np.max(drift.errors(drift.time, float(drift.time[-1]))),
            drift.path[-1],
        )
    return (
        Swing(
            name,
            float(error),
            float(error / path) / MOST_OF_PATH * (tr - start),
            drift is None,
        )
        if path > 0
        else None
    )


def _of_two(momenta: Momenta, start: float, tr: float) -> tuple[str, float, float]:
    """Name the lighter of two parts, how far off the other is at most, and the path; 0 for others."""
    inside = window(momenta.time, start, tr)
    time, masses = momenta.time[inside], momenta.masses
    pair = (
        []
        if masses is None
        else [i for i in momenta.moving if i in momenta.chosen and masses[i] > 0]
    )
    if momenta.parts is None or masses is None or len(pair) != 2 or time.size < 2:
        return "", 0.0, 0.0
    light, heavy = sorted(pair, key=lambda i: float(masses[i]))
    centre = momenta.values[inside][:, pair].sum(axis=1) / masses[pair].sum()
    away = integral(time, momenta.values[inside][:, heavy] / masses[heavy] - centre)
    off, path = (
        np.linalg.norm(away - away[-1], axis=1).max(),
        integral(time, np.linalg.norm(centre, axis=1))[-1],
    )
    return momenta.parts[light].name, float(off), float(path)
