"""Find the events of a run so far: pushes, flights, contacts, advised switches, and rigid parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.window import FEWEST
from d2rpick.running.evidence import GrowingEvidence, highest_energy
from d2rpick.running.inner_motion import check_wait
from d2rpick.running.swing import find_swing

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import History
    from d2rpick.running.witness import Quiet

    # Events of past flights, keyed by the start of the flight and the time at which it was detected.
    Decided = dict[tuple[float, float], tuple["Event", ...]]

# Smallest height of the internal energy above its recent minimum at a good tr, as a fraction of its recent range [-].
# In computed runs, a tr at an energy minimum locked in half of the energy at td, and a tr at a peak at least 90 %.
_HIGH: Final = 0.75


class Event(NamedTuple):
    """An event: a stable word, its time, the state at which it was ``seen`` [time], and a sentence.

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


def find_events(
    evidence: GrowingEvidence, decided: Decided | None = None
) -> tuple[Event, ...]:
    """Return all events in the order in which they were detected.

    The events of a run so far are the first ones of the whole run.  Flights in ``decided`` are not examined again, and
    those that are decided now are added to it.

    Raises
    ------
    RangeError
        If a given wait is too short.
    """
    flights = evidence.flights()
    rigid_times = evidence.find_rigid_times()
    history = evidence.history
    if decided is None:
        decided = {}
    events: list[Event] = []
    for flight in flights:
        if flight.wait.source == "given":
            longest = evidence.motion.longest(flight.seen)
            check_wait(flight.wait.time, longest, ", ".join(history.source))
        events += _describe_flight(history, flight, decided)
    for start, _, end in rigid_times:
        # No switch is advised if the parts are already rigid.
        events = [
            event
            for event in events
            if event.tr is None or not start <= event.tr <= end
        ]
    if not flights or flights[0].start > history.time[0]:
        push = evidence.find_contact(fewest=1)
        if push is not None:
            events.append(Event("load", push, push, "a force acts"))
    events += _describe_rigid_times(history, rigid_times)
    return tuple(sorted(events, key=lambda event: event.seen or 0.0))


def _describe_rigid_times(
    history: History, rigid_times: Sequence[tuple[float, float, float]]
) -> Iterator[Event]:
    """Yield the events at which parts become rigid or deformable, except for bodies that are always rigid."""
    for start, seen_at, end in rigid_times:
        if start <= history.time[min(FEWEST, history.time.size) - 1]:
            continue
        message = (
            "parts have become rigid: part data are not used until they deform again"
        )
        yield Event("rigid", start, seen_at, message)
        if end < history.time[-1]:
            yield Event("deformable", end, end, "all parts deform again")


def _describe_flight(
    history: History, flight: Quiet, decided: Decided
) -> Iterator[Event]:
    """Yield the events of a flight: its start, the advised switch, and its contact."""
    key = (flight.start, flight.seen)
    events = decided.get(key)
    if events is None:
        events = (_describe_start(flight), *_suggest_switch(history, flight))
    if flight.end is not None or any(event.tr is not None for event in events):
        decided[key] = events
    yield from events
    if flight.end is not None:
        message = (
            f"a force acts, {flight.end - flight.start:.4g} after the flight began"
        )
        yield Event("contact", flight.end, flight.end, message)


def _describe_start(flight: Quiet) -> Event:
    """Report that a flight was detected, which evidence shows it, and why it was not detected earlier."""
    quantity = "contact energy"
    if flight.source == "momentum":
        quantity = "momentum less gravity"
    landing = "landing time unknown"
    if flight.level is not None:
        landing = f"on level ground it lands at about {flight.level:.4g}"
    message = (
        f"{quantity} is constant within {flight.left:.1e} of its maximum for {flight.seen - flight.start:.4g}; "
        f"required force-free time {flight.wait.time:.4g}: {flight.wait.reason}; {landing}"
    )
    return Event(
        "flight", flight.start, flight.seen, message, flight.wait.time, flight.left
    )


def _suggest_switch(history: History, flight: Quiet) -> Iterator[Event]:
    """Advise when to switch in a flight: at once if nothing vibrates, otherwise while the internal energy is high.

    If it is low for one wait, the time of its maximum is advised.
    """
    if flight.wait.source == "at-rest":
        message = "switch now: nothing vibrates, so any tr is right, and the earliest keeps the parts rigid for longest"
        yield _advise(flight.seen, flight.seen, message, flight)
        return
    last = flight.seen + flight.wait.time
    end = np.inf if flight.end is None else flight.end
    times, energies = history.between(flight.seen, last)
    for now, energy in zip(times.tolist(), energies.tolist(), strict=True):
        if now >= end:
            return
        energies_so_far = history.between(now - flight.wait.time, now)[1]
        low, high = float(energies_so_far.min()), float(energies_so_far.max())
        level = f"the internal energy is {energy:.4g}, between {low:.4g} and {high:.4g} within one force-free time"
        if energy >= low + _HIGH * (high - low):
            message = f"switch now: {level}{_warn_of_swing(history, flight, now)}"
            yield _advise(now, now, message, flight)
            return
        if now == flight.seen:
            message = f"not yet: {level}; waiting until {last:.6g} for its maximum"
            yield Event("later", last, now, message, flight.wait.time)
    later_times = history.between(last, history.time[-1])[0]
    if history.time[-1] > last < end:
        tr = highest_energy(history, flight.seen, last)
        message = (
            f"the internal energy was highest at {tr:.6g}: restart from an earlier state to switch there"
            f"{_warn_of_swing(history, flight, tr)}"
        )
        yield _advise(tr, float(later_times[0]), message, flight)


def _advise(tr: float, seen: float, message: str, flight: Quiet) -> Event:
    return Event("switch", tr, seen, message, flight.wait.time, tr=tr)


def _warn_of_swing(history: History, flight: Quiet, tr: float) -> str:
    """Return a warning if parts oscillate too much in a flight that has lasted up to tr; otherwise empty."""
    swing = find_swing(history, flight.start, tr) if flight.parts else None
    if swing is None or swing.flight <= tr - flight.start:
        return ""
    return f"; {swing.told}"
