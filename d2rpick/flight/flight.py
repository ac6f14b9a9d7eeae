"""When the load is over: which evidence counts for the window around td in which the parts fly freely."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from d2rpick.flight.energy_alone import end_of_load

if TYPE_CHECKING:
    from d2rpick.flight.momentum import FreeFlight
    from d2rpick.histories.history import History, Part
    from d2rpick.vibration.span import Span


class Flight(NamedTuple):
    """Window of free flight [time]; ``start`` None when unknown, ``end`` None when no next contact was seen.

    ``source`` tells how the start was found: "given", "momentum", "oscillator", "energy", or None.  ``parts`` are
    those that were seen to fly together, None where the momentum did not tell, or told it of the whole model.
    ``damping`` is alpha of their momentum [1/time], 0 where it did not tell.
    """

    start: float | None
    end: float | None
    source: str | None
    parts: tuple[Part, ...] | None = None
    damping: float = 0.0


def seen_flight(history: History, td: float) -> FreeFlight | None:
    """Find the free flight around ``td`` in the momenta."""
    from d2rpick.flight.momentum import flight_around, to_be_asked

    return next(filter(None, (flight_around(momenta, td) for momenta in to_be_asked(history.momenta))), None)


def find_flight(history: History, td: float, after: float | None, seen: FreeFlight | None, span: Span | None) -> Flight:
    """Choose the best answer to when the load is over: given, by the momentum, by the oscillator, by the energy.

    ``after`` is given as the end of the load [time]; ``seen`` what the momenta show; ``span`` the window that an
    oscillator describes.
    """
    if seen:
        end = seen.end if seen.end_seen else None
        start, source = (seen.start, "momentum") if after is None else (after, "given")
        return Flight(start, end, source, seen.parts, seen.damping)
    end = span.end if span and span.end < history.time[-1] else None
    if after is not None:
        return Flight(after, end, "given")
    if span:
        return Flight(span.start, end, "oscillator")
    fallen = end_of_load(history, td)
    return Flight(fallen, None, None if fallen is None else "energy")
