"""Compute the margin before the contact that ends a flight, given the rigid bodies that the parts become."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.flight.deformable_again import restore_parts
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

# Number of times in a flight at which a trial makes a body rigid; few suffice, because internal motion is slow.
_TIMES: Final = 100


def find_drift_of_bodies(
    history: History, flight: Flight, settings: Settings
) -> Bodies | None:
    """Return the drift of the rigid bodies of the parts in a flight; None if there are no part data."""
    history, flight = restore_parts(history, flight)
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
    """Compute the drift of the rigid bodies of the parts in a flight."""
    # Imported here to keep start-up fast.
    from d2rpick.flight.position_error import (
        find_bodies_in_flight,
    )

    return find_bodies_in_flight(history, flight, rigid_bodies, placement)


def find_margin(history: History, flight: Flight, settings: Settings) -> Margin:
    """Return the given margin or, by default, the time by which a switch in the flight may advance the contact."""
    if settings.margin is not None or flight.end is None or flight.start is None:
        return compute_margin(history, flight, settings.margin)
    history, flight = restore_parts(history, flight)
    bodies = find_drift_of_bodies(history, flight, settings)
    if bodies is None:
        return compute_margin(history, flight)
    times = np.linspace(*flight.within(history.time), _TIMES)[:-1]
    direction = find_direction_of_approach(history, flight)
    position_error = bodies.find_largest_error(times, direction)
    turning = compute_turning_speed(history, flight, bodies, settings.placement)
    margin = compute_margin(history, flight, place=position_error, turning=turning)
    is_known = direction is None or bodies.compute_speed_at_front(direction) is not None
    if is_known or margin.source == "no-contact" or not flight.shows_contact:
        return margin
    return margin._replace(
        rotation=_judge_rotation(history, flight, margin, position_error)
    )


def _judge_rotation(
    history: History, flight: Flight, margin: Margin, position_error: float | None
) -> str | None:
    """Return the effect of an unknown rotation of the bodies on a ``margin`` (see `Margin`)."""
    from d2rpick.flight.turning_bound import may_turn_back

    if margin.time > compute_margin(history, flight, place=position_error).time:
        return "any"
    return "unseen" if position_error and may_turn_back(history, flight) else None


def compute_turning_speed(
    history: History, flight: Flight, bodies: Bodies, placement: Placement | None
) -> float | None:
    """Return the speed that the bodies' rotation adds at the points of contact [length/time]; None if it is unknown.

    If the deck contains the positions of the parts but the rotation of the bodies is unknown, the result is the lowest
    speed that the kinetic energy allows. It is None if there is no deck, or if the momenta do not show a direction.
    """
    from d2rpick.flight.turning_bound import bound_turning_speed

    history, flight = restore_parts(history, flight)
    direction = find_direction_of_approach(history, flight)
    if direction is None:
        return None
    speed = bodies.compute_speed_at_front(direction)
    if speed is not None or placement is None:
        return speed
    largest = bound_turning_speed(history, flight, placement)
    return None if largest is None else -largest
