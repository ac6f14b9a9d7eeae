"""Compute the margin before the contact that ends a flight, from the rigid bodies that the parts become."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.flight.margin import (
    Margin,
    compute_margin,
    find_direction_of_approach,
)

if TYPE_CHECKING:
    from d2rpick.choice.question import Settings
    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.position_error import Bodies, RigidBody
    from d2rpick.histories.history import History

# Freezing a body is tried at this many times in a flight, which suffices because its internal motion is slow.
_TIMES: Final = 100


def find_drift_of_bodies(
    history: History, flight: Flight, settings: Settings
) -> Bodies | None:
    """Return the drift of the rigid bodies of the parts in a flight; None without data of parts."""
    if flight.parts is None:
        return None
    return _compute_drift(history, flight, settings.bodies, settings.placement)


@remember
def _compute_drift(
    history: History,
    flight: Flight,
    rigid_bodies: tuple[RigidBody, ...] | None,
    placement: Placement | None,
) -> Bodies:
    """Return the drift of the rigid bodies of the parts in a flight."""
    # Imported here to keep start-up fast.
    from d2rpick.flight.position_error import (
        find_bodies_in_flight,
    )

    return find_bodies_in_flight(history, flight, rigid_bodies, placement)


def find_margin(history: History, flight: Flight, settings: Settings) -> Margin:
    """Return the given margin, or the time by which a switch in the flight may make the contact earlier."""
    if settings.margin is not None or flight.end is None or flight.start is None:
        return compute_margin(history, flight, settings.margin)
    bodies = find_drift_of_bodies(history, flight, settings)
    if bodies is None:
        return compute_margin(history, flight)
    position_error = _find_largest_position_error(bodies, flight.start, flight.end)
    turning = compute_turning_speed(history, flight, bodies)
    return compute_margin(history, flight, place=position_error, turning=turning)


def compute_turning_speed(history: History, flight: Flight, bodies: Bodies) -> float:
    """Return the speed that the rotation of the bodies adds at the points where they touch a contact [length/time].

    0 if the momenta do not show a direction, or no deck shows how the bodies turn.
    """
    direction = find_direction_of_approach(history, flight)
    return 0.0 if direction is None else bodies.compute_speed_at_front(direction)


def _find_largest_position_error(
    bodies: Bodies, start: float, end: float
) -> float | None:
    """Return the largest position error of a body at the end of a flight [length]; None if it is unknown."""
    errors = bodies.errors(np.linspace(start, end, _TIMES)[:-1], end)
    known_errors = errors[np.isfinite(errors)]
    return float(known_errors.max()) if known_errors.size else None
