"""All flights of a record, by the same ladder of evidence that tells the flight around one td."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.examine import examine
from d2rpick.choice.settings import Settings
from d2rpick.flight.flight import Flight, all_seen
from d2rpick.flight.window import moments
from d2rpick.vibration.span import Fits

if TYPE_CHECKING:
    from d2rpick.histories.history import History

_PLAIN = Settings()


def find_flights(history: History, settings: Settings = _PLAIN, fits: Fits | None = None) -> tuple[Flight, ...]:
    """Find every flight of a record, ascending in time.

    Parameters
    ----------
    history : History
        With its evidence, as a run gives it.
    settings : Settings, optional
        How an oscillator is looked for where no better evidence shows a flight.
    fits : Fits, optional
        Those of an earlier look at the record; none of its windows is fitted twice.

    Returns
    -------
    tuple of Flight
        ``end`` is None where the record ends in flight.  A flight shorter than a twentieth of the record is not seen.

    Raises
    ------
    RangeError
        If the record has fewer than 3 states.
    """
    seen = all_seen(history)
    if seen:
        return tuple(
            Flight(one.start, one.end if one.end_seen else None, source, one.parts, one.damping, gravity=one.gravity)
            for source, one in seen
        )
    found: list[Flight] = []
    fits = Fits() if fits is None else fits
    for td in sorted(moments(history.time), reverse=True):  # the last quiet time before td tells most of the flight
        if found and found[-1].start is not None and td > found[-1].start:
            continue
        situation = examine(history, td, settings, fits)
        flight = situation.flight
        if situation.in_flight and not flight.refusal and not (found and _overlap(flight, found[-1])):
            found.append(flight)
    return tuple(reversed(found))


def _overlap(earlier: Flight, later: Flight) -> bool:
    """Say whether a flight lasts into a later one: it misses the load before that one, so its end is not known."""
    return earlier.end is None or later.start is None or earlier.end > later.start
