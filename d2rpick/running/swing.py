"""Warn, before td is known, of parts that oscillate too strongly for their body to become rigid."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.flight.flight import Flight
from d2rpick.flight.position_error import (
    MOST_OF_PATH,
    find_drift_in_flight,
    integrate_displacements,
)
from d2rpick.histories.samples import find_window

if TYPE_CHECKING:
    from d2rpick.histories.history import History, Momenta


class Swing(NamedTuple):
    """An oscillating part: its ``name``, and the distance by which it can displace its body [length].

    In a flight shorter than ``flight`` [time], the ``error`` exceeds 1 % of the path, which is too large. ``at_most``
    is True if the error is an upper limit, because the motion may be a rotation of both parts, which displaces nothing.
    """

    name: str
    error: float
    flight: float
    at_most: bool = False

    @property
    def warning(self) -> str:
        """The warning that is printed before the body becomes rigid."""
        if self.at_most:
            motion = "moves relative to the other, or both rotate"
            limit = "at most"
        else:
            motion = "still moves relative to the others"
            limit = "about"
        return (
            f"{self.name} {motion}: at td the body may be out of place by {limit} {self.error:.3g}; "
            f"this is less than {MOST_OF_PATH:.0%} of its path only in a flight longer than {self.flight:.3g}"
        )


def find_swing(history: History, start: float, tr: float) -> Swing | None:
    """Find by how much an oscillating part can displace its body if the body becomes rigid at ``tr``.

    Because td is unknown, the parts at td are assumed to be in their position before tr that is farthest from that at
    tr. The result is None if the part momenta do not suffice.
    """
    momenta = history.find_momenta(of_parts=True)
    if momenta is None or momenta.parts is None:
        return None
    moving_parts = tuple(momenta.parts[number] for number in momenta.moving)
    flight = Flight(start, tr, "momentum", moving_parts)
    drift = find_drift_in_flight(history, flight)
    if drift is None:
        swing_of_pair = _measure_pair(momenta, start, tr)
        if swing_of_pair is None:
            return None
        name, error, path = swing_of_pair
    else:
        name = drift.part.name
        error = float(np.max(drift.errors(drift.time, float(drift.time[-1]))))
        path = float(drift.path[-1])
    if path <= 0:
        return None
    # The path grows in proportion to the length of the flight.
    shortest_flight = error / path / MOST_OF_PATH * (tr - start)
    return Swing(name, error, shortest_flight, drift is None)


def _measure_pair(
    momenta: Momenta, start: float, tr: float
) -> tuple[str, float, float] | None:
    """Return the lighter of two parts, an upper bound of the displacement, and the path; None if other parts move.

    The upper bound is that of the displacement of the heavier part; the path is that of both parts [length].
    """
    inside = find_window(momenta.time, start, tr)
    time = momenta.time[inside]
    masses = momenta.masses
    if momenta.parts is None or masses is None or time.size < 2:
        return None
    pair = [
        number
        for number in momenta.moving
        if number in momenta.chosen and masses[number] > 0
    ]
    if len(pair) != 2:
        return None
    masses_of_pair = masses[pair]
    light, heavy = np.argsort(masses_of_pair).tolist()
    velocity = momenta.values[inside][:, pair] / masses_of_pair[:, np.newaxis]
    displacements, path = integrate_displacements(time, velocity, masses_of_pair)
    displacement = displacements[:, heavy]
    distances = np.linalg.norm(displacement - displacement[-1], axis=1)
    name = momenta.parts[pair[light]].name
    return name, float(distances.max()), float(path[-1])
