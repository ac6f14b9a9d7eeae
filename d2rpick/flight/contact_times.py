"""Find in which output intervals a force other than gravity acts on the parts, from their momenta.

In flight, only gravity changes the momentum between two states, and the longest flight shows this change. If the
momentum changes by more, and the difference exceeds numerical errors, another force acts. If the force of a contact is
written, momenta are not needed.

A force begins and ends somewhere within an output interval. The middle of this interval is the best estimate, with an
error of at most half an interval.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.momentum import find_all_flights
from d2rpick.histories.samples import find_stretches, find_window

if TYPE_CHECKING:
    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.history import Momenta, Samples

# Smallest momentum change that indicates a force, relative to the largest deviation in the longest flight [-].
_SEEN: Final = 4.0
# Largest force that is ignored, relative to the weight [-]; it allows for first momenta that are half a step old.
_OF_WEIGHT: Final = 0.1
# Number of states omitted at each end of the longest flight, because a contact force may act in them.
_EDGE: Final = 1
# Smallest number of output intervals in the longest flight after its ends have been omitted.
_FEWEST: Final = 2
# If a force appears in a single interval, it is assumed to act for this fraction of the interval around its middle [-].
_OF_ONE_INTERVAL: Final = 1 / 3


class ContactTimes(NamedTuple):
    """Periods in which a force acts: ``spans`` (from, to) [time], whose ends are accurate to half of ``interval``.

    ``speed`` is the speed of the parts at the end of the longest flight [length/time]; it is None if the masses are
    unknown.
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
    flights = find_all_flights(momenta)
    if not flights:
        return None
    longest = max(flights, key=lambda flight: flight.end - flight.start)
    members = _find_members(momenta, longest.parts)
    time = momenta.time
    momentum = momenta.of(members)
    flight = find_window(time, longest.start, longest.end)
    first = flight.start + _EDGE
    last = flight.stop - 1 - _EDGE
    if last - first < _FEWEST:
        return None
    steps = np.diff(time)
    weight = (momentum[last] - momentum[first]) / (time[last] - time[first])
    impulses = np.diff(momentum, axis=0) - weight * steps[:, np.newaxis]
    sizes = np.linalg.norm(impulses, axis=1)
    largest_in_flight = float(sizes[first:last].max())
    error = _SEEN * max(2 * momenta.noise(members), largest_in_flight)
    notable_force = _OF_WEIGHT * float(np.linalg.norm(weight))
    limit = np.maximum(error, notable_force * steps)
    spans = tuple(
        _place_in_intervals(time, part.start, part.stop)
        for part in find_stretches(sizes > limit)
    )
    mass = momenta.mass(members)
    speed = float(np.linalg.norm(momentum[last])) / mass if mass > 0 else None
    return ContactTimes(spans, float(steps.max()), speed)


def narrow_to_states(
    time: Samples, tr: float, td: float | None
) -> tuple[float, float | None]:
    """Return the first state at or after ``tr`` and the last state at or before ``td`` [time].

    A sensor switches at the first or last contact force, which is somewhere between two states.  The flight is certain
    only between states at which no force acts.  If there is no state between ``tr`` and ``td``, both times are kept.

    Examples
    --------
    >>> narrow_to_states(np.array([0.0, 1.0, 2.0, 3.0]), 0.5, 2.5)
    (1.0, 2.0)
    """
    end = np.inf if td is None else td
    times = time[(time >= tr) & (time <= end)]
    if times.size < _FEWEST:
        return tr, td
    last = None if td is None else float(times[-1])
    return float(times[0]), last


def find_force_times(force: ContactForce, least: float = 0.0) -> ContactTimes | None:
    """Find when the force of a contact or rigid wall acts, from the force that the solver wrote.

    Parameters
    ----------
    force : ContactForce
        As read from a file.
    least : float
        Intervals whose mean force is below this limit are treated as free of force [force]; if it is 0, any force is
        used.

    Returns
    -------
    ContactTimes or None
        None if there are too few states, or if ``least`` is positive although only changes of the force are known.
    """
    time = force.time
    acts = force.acts
    if time.size < _FEWEST:
        return None
    steps = np.diff(time)
    if least > 0:
        if not np.isfinite(force.impulses).all():
            return None
        acts = acts.copy()
        acts[1:] &= np.linalg.norm(force.impulses[1:], axis=1) > least * steps
    spans = tuple(
        _place_in_intervals(time, part.start, part.stop)
        for part in find_stretches(acts[1:])
    )
    return ContactTimes(spans, float(steps.max()))


def _place_in_intervals(time: Samples, first: int, stop: int) -> tuple[float, float]:
    """Return the start and end of a force that acts in the intervals ``first`` to ``stop`` of the record [time].

    A force in the first interval is assumed to act from the start of the record, one in the last interval to its end.
    """
    start = float(time[first])
    end = float(time[stop])
    longest_delay = _OF_ONE_INTERVAL * (end - start)
    half_of_first = float(time[first + 1] - start) / 2
    half_of_last = float(end - time[stop - 1]) / 2
    if first > 0:
        start += min(half_of_first, longest_delay)
    if stop < time.size - 1:
        end -= min(half_of_last, longest_delay)
    return start, end


def _find_members(momenta: Momenta, parts: object) -> tuple[int, ...]:
    """Return the columns of the flying parts, or of the chosen parts if the momentum is that of the whole model."""
    flying = {part.id for part in parts} if isinstance(parts, tuple) else set()
    members = tuple(
        position
        for position, part in enumerate(momenta.parts or ())
        if part.id in flying
    )
    return members or momenta.chosen
