"""Compute the margin before the contact that ends a flight, from the rigid bodies that the parts become."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.margin import Margin, compute_margin

if TYPE_CHECKING:
    from d2rpick.choice.question import Settings
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.position_error import Bodies
    from d2rpick.histories.history import History
    from d2rpick.vibration.span import Fits

# Number of times in a flight at which a body is tried as frozen: its inner motion is slow.
_TIMES: Final = 100


def find_drift_of_bodies(
    history: History, flight: Flight, settings: Settings, fits: Fits | None = None
) -> Bodies | None:
    """Return the drift of the rigid bodies of the parts in a flight, computed once; None without data of parts."""
    if flight.parts is None:
        return None
    # imported here: tables have no parts
    from d2rpick.flight.position_error import (
        find_bodies_in_flight,
    )

    memory = history.known if fits is None else fits
    rigid_bodies = settings.bodies
    placement = settings.placement
    return memory.once(
        ("drift", flight, rigid_bodies),
        lambda: find_bodies_in_flight(history, flight, rigid_bodies, placement),
    )


def find_margin(
    history: History, flight: Flight, settings: Settings, fits: Fits | None = None
) -> Margin:
    """Return the given margin, or the time by which switching in the flight may make the contact come earlier."""
    if settings.margin is not None or flight.end is None or flight.start is None:
        return compute_margin(history, flight, settings.margin)
    bodies = find_drift_of_bodies(history, flight, settings, fits)
    position_error = (
        None
        if bodies is None
        else _find_largest_position_error(bodies, flight.start, flight.end)
    )
    return compute_margin(history, flight, place=position_error)


def _find_largest_position_error(
    bodies: Bodies, start: float, end: float
) -> float | None:
    """Return the largest position error of a body at the end of a flight [length]; None if it is unknown."""
    errors = bodies.errors(np.linspace(start, end, _TIMES)[:-1], end)
    known_errors = errors[np.isfinite(errors)]
    return float(known_errors.max()) if known_errors.size else None
