"""Find the events of a run so far: pushes, flights, contacts, advised switches, and switches to rigid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.window import FEWEST
from d2rpick.running.inner_motion import check_wait
from d2rpick.running.swing import find_swing

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import History
    from d2rpick.running.evidence import GrowingEvidence
    from d2rpick.running.witness import Quiet

# At a good tr, the internal energy exceeds its recent minimum by at least this fraction of its recent range [-].
# In computed runs, a tr at an energy minimum locked in half of the energy at td; a tr at a peak, 90 % or more.
_HIGH: Final = 0.75
_RIGID: Final = (
    "parts have become rigid: part data are not used until they deform again"
)


class Event(NamedTuple):
    """An event: a keyword for scripts, its time, the state at which it was ``seen`` [time], and a sentence.

    ``wait`` is the force-free time that shows a flight [time].  ``left`` is the change in that time, as a share of the
    largest value.  ``tr`` is the advised time [time].  Each is None if it does not apply to the event.
    """

    event: str
    time: float | None
    seen: float | None
    message: str
    wait: float | None = None
    left: float | None = None
    tr: float | None = None


def find_events(evidence: GrowingEvidence) -> tuple[Event, ...]:
    """Return all events in the order of their detection.

    The events of a run so far are the first ones of the whole run.  The evidence keeps those of past flights.

    Raises
    ------
    RangeError
        If a given wait is too short.
    """
    flights = evidence.flights()
    history = evidence.history
    events: list[Event] = []
    for flight in flights:
        if flight.wait.source == "given":
            longest = evidence.motion.longest(flight.seen)
            check_wait(flight.wait.time, longest, ", ".join(history.source))
        events += _describe_flight(flight, evidence)
    for start, seen_at, end in evidence.find_rigid_times():
        # No switch is advised while the parts are rigid.
        events = [
            event
            for event in events
            if event.tr is None or not start <= event.tr <= end
        ]
        if start <= history.time[:FEWEST][-1]:
            continue  # These bodies are rigid throughout the run.
        events.append(Event("rigid", start, seen_at, _RIGID))
        if end < history.end:
            events.append(Event("deformable", end, end, "all parts deform again"))
    if not flights or flights[0].start > history.start:
        push = evidence.find_contact(fewest=1)
        if push is not None:
            events.append(Event("load", push, push, "a force acts"))
    return tuple(sorted(events, key=lambda event: event.seen or 0.0))


def _describe_flight(flight: Quiet, evidence: GrowingEvidence) -> Iterator[Event]:
    """Yield the events of a flight: its start, the advised switch, and the contact that ends it."""
    key = flight.start, flight.seen
    events = evidence.decided.get(key)
    if events is None:
        events = (_describe_start(flight), *_suggest_switch(evidence.history, flight))
        if flight.end is not None or events[-1].tr is not None:
            evidence.decided[key] = events
    yield from events
    if flight.end is not None:
        message = (
            f"a force acts, {flight.end - flight.start:.4g} after the flight began"
        )
        yield Event("contact", flight.end, flight.end, message)


def _describe_start(flight: Quiet) -> Event:
    """Report that a flight was detected, on which evidence, and why it was not detected earlier."""
    landing = "landing time unknown"
    if flight.level is not None:
        landing = f"landing at about {flight.level:.4g} if it lands as high as it took off, later if lower"
    message = (
        f"no force for {flight.seen - flight.start:.4g}, the required force-free time is {flight.wait.time:.4g} "
        f"({flight.wait.reason}); {flight.quantity} is constant within {flight.left:.1e} of its maximum; {landing}"
    )
    return Event(
        "flight", flight.start, flight.seen, message, flight.wait.time, flight.left
    )


def _suggest_switch(history: History, flight: Quiet) -> Iterator[Event]:
    """Advise when to switch in a flight: at once if nothing vibrates, otherwise while the internal energy is high.

    If it is low for one wait, the time of its maximum is advised.
    """
    wait = flight.wait.time
    if flight.wait.source == "at-rest":
        message = "switch now: nothing vibrates, so any tr is right, and the earliest keeps the parts rigid for longest"
        yield Event("switch", flight.seen, flight.seen, message, wait, tr=flight.seen)
        return
    last, end = flight.seen + wait, flight.end or np.inf
    times, energies = history.between(flight.seen, last)
    for now, energy in zip(times.tolist(), energies.tolist(), strict=True):
        if now >= end:
            return
        energies_so_far = history.between(now - wait, now)[1]
        low, high = float(energies_so_far.min()), float(energies_so_far.max())
        span = f"its highest value of the last {wait:.4g} ({low:.4g} to {high:.4g})"
        if energy >= low + _HIGH * (high - low):
            message = (
                f"switch now: the internal energy, {energy:.4g}, is near {span}; it is not compared with the energy "
                f"at td, which is unknown yet{_warn_of_swing(history, flight, now)}"
            )
            yield Event("switch", now, now, message, wait, tr=now)
            return
        if now == flight.seen:
            message = (
                f"not yet: the internal energy, {energy:.4g}, is far below {span}; "
                f"waiting until {last:.6g} for its maximum"
            )
            yield Event("later", last, now, message, wait)
    if history.end > last < end:
        tr = highest_energy(history, flight.seen, last)
        message = (
            f"the internal energy was highest at {tr:.6g}: restart from an earlier state to switch there"
            f"{_warn_of_swing(history, flight, tr)}"
        )
        now = float(history.between(last, history.end)[0][0])
        yield Event("switch", tr, now, message, wait, tr=tr)


def highest_energy(history: History, start: float, end: float) -> float:
    """Return the last time from ``start`` to ``end`` at which the internal energy has its maximum [time]."""
    time, energy = history.between(start, end)
    return float(time[energy.size - 1 - int(np.argmax(energy[::-1]))])


def _warn_of_swing(history: History, flight: Quiet, tr: float) -> str:
    """Return a warning if parts oscillate too strongly in a flight that has lasted until tr; otherwise empty."""
    swing = find_swing(history, flight.start, tr) if flight.parts else None
    if swing is None or swing.flight <= tr - flight.start:
        return ""
    return f"; {swing.told}"
