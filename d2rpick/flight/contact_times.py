"""Find when a force other than gravity acts on the parts, for each output interval, from their momenta.

In flight the momentum changes between two states by gravity alone.  The longest flight shows this change.  If the
momentum changes by more than that, and by more than numerical errors, a force acts.  A force that starts and ends
within one interval counts as one force.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.momentum import all_flights
from d2rpick.histories.samples import stretches, window

if TYPE_CHECKING:
    from d2rpick.histories.history import Momenta

# A force is seen if it changes the momentum by this many times the largest deviation in the longest flight.
_SEEN: Final = 4.0
# A force below this share of the weight is ignored: momenta of the first state are those of half a step before.
_OF_WEIGHT: Final = 0.1
# States at each end of the longest flight that are left out: the force before or after it may act in them.
_EDGE: Final = 1
_FEWEST: Final = 2  # smallest number of intervals between these ends


class ContactTimes(NamedTuple):
    """Periods in which a force acts: ``spans`` (from, to) [time], each known within ``interval``, the output interval.

    ``speed`` is the speed of the parts at the end of the longest flight [length/time], None without masses.
    """

    spans: tuple[tuple[float, float], ...]
    interval: float
    speed: float | None = None


def find_contact_times(momenta: Momenta) -> ContactTimes | None:
    """Find when a force other than gravity acts on the chosen parts and on the parts that fly with them.

    Returns
    -------
    ContactTimes or None
        None if no flight shows the effect of gravity, or there are too few states.
    """
    flights = all_flights(momenta)
    if not flights:
        return None
    longest = max(flights, key=lambda flight: flight.end - flight.start)
    members = _find_members(momenta, longest.parts)
    time, momentum = momenta.time, momenta.of(members)
    flight = window(time, longest.start, longest.end)
    first, last = flight.start + _EDGE, flight.stop - 1 - _EDGE
    if last - first < _FEWEST:
        return None
    gravity = (momentum[last] - momentum[first]) / (time[last] - time[first])
    pushes = np.diff(momentum, axis=0) - gravity * np.diff(time)[:, np.newaxis]
    sizes = np.linalg.norm(pushes, axis=1)
    least = _SEEN * max(2 * momenta.noise(members), float(sizes[first:last].max()))
    room = np.maximum(
        least, _OF_WEIGHT * float(np.linalg.norm(gravity)) * np.diff(time)
    )
    spans = tuple(
        (float(time[part.start]), float(time[part.stop]))
        for part in stretches(sizes > room)
    )
    mass = momenta.mass(members)
    speed = float(np.linalg.norm(momentum[last])) / mass if mass > 0 else None
    return ContactTimes(spans, float(np.diff(time).max()), speed)


def _find_members(momenta: Momenta, parts: object) -> tuple[int, ...]:
    """Return the columns of the flying parts, or of the chosen parts if the momentum is that of the whole model."""
    flying = {part.id for part in parts} if isinstance(parts, tuple) else set()
    places = tuple(
        place for place, part in enumerate(momenta.parts or ()) if part.id in flying
    )
    return places or momenta.chosen
