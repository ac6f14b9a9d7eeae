"""Find the events of a run so far: forces, flights, contacts, advised switching times, and parts that become rigid."""

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
    from d2rpick.running.swing import Swing
    from d2rpick.running.witness import SeenFlight

# Smallest height of the internal energy above its recent minimum at a good tr, relative to its recent range [-].
# In computed runs, a tr at an energy minimum locked in 50 % of the energy at td, and a tr at a peak at least 90 %.
_HIGH: Final = 0.75


class EnergyRange(NamedTuple):
    """The internal energy at a state, and its range in the force-free time up to this state."""

    energy: float
    lowest: float
    highest: float


class RunEvent(NamedTuple):
    """An event of a run: a keyword for scripts, its time, and the state at which it was ``seen`` [time].

    ``flight`` is the flight to which the event belongs, as it was detected. ``tr`` is the advised time [time],
    ``energy`` the internal energy on which the advice is based, and ``swing`` the part that oscillates too strongly at
    ``tr``. Each is None if it does not apply to the event.
    """

    event: str
    time: float
    seen: float
    flight: SeenFlight | None = None
    tr: float | None = None
    energy: EnergyRange | None = None
    swing: Swing | None = None


def find_events(evidence: GrowingEvidence) -> tuple[RunEvent, ...]:
    """Return all events in the order of their detection.

    The events so far are always the first events of the complete run. The evidence keeps the events of past flights.

    Raises
    ------
    RangeError
        If the waiting time that the user gave is too short.
    """
    flights = evidence.flights()
    history = evidence.history
    events: list[RunEvent] = []
    for flight in flights:
        if flight.wait.source == "given":
            longest = evidence.motion.longest(flight.seen)
            check_wait(flight.wait.time, longest, ", ".join(history.source))
        events += _list_events_of(flight, evidence)
    for start, seen_at, end in evidence.find_rigid_times():
        # No switch is advised while the parts are rigid.
        events = [
            event
            for event in events
            if event.tr is None or not start <= event.tr <= end
        ]
        if start <= history.time[:FEWEST][-1]:
            continue  # These bodies are always rigid.
        events.append(RunEvent("rigid", start, seen_at))
        if end < history.end:
            events.append(RunEvent("deformable", end, end))
    if not flights or flights[0].start > history.start:
        push = evidence.find_contact(fewest=1)
        if push is not None:
            events.append(RunEvent("load", push, push))
    return tuple(sorted(events, key=lambda event: event.seen))


def _list_events_of(
    flight: SeenFlight, evidence: GrowingEvidence
) -> Iterator[RunEvent]:
    """Yield the events of a flight: its start, the advised switch, and the contact that ends it."""
    key = flight.start, flight.seen
    events = evidence.decided.get(key)
    if events is None:
        start = RunEvent("flight", flight.start, flight.seen)
        events = (start, *_suggest_switch(evidence.history, flight))
        if flight.end is not None or events[-1].tr is not None:
            evidence.decided[key] = events
    if flight.end is not None:
        events = (*events, RunEvent("contact", flight.end, flight.end))
    # An event does not change when the flight ends later.
    flight_so_far = flight._replace(end=None)
    for event in events:
        yield event._replace(flight=flight_so_far)


def _suggest_switch(history: History, flight: SeenFlight) -> Iterator[RunEvent]:
    """Advise when to switch in a flight: at once if nothing vibrates, otherwise while the internal energy is high.

    If the energy stays low for a whole waiting time, the time of its maximum is advised.
    """
    if flight.wait.source == "at-rest":
        yield RunEvent("switch", flight.seen, flight.seen, tr=flight.seen)
        return
    wait = flight.wait.time
    end = flight.end or np.inf
    last = flight.seen + wait
    times, energies = history.between(flight.seen, last)
    for now, energy in zip(times.tolist(), energies.tolist(), strict=True):
        if now >= end:
            return
        _, energies_so_far = history.between(now - wait, now)
        lowest = float(energies_so_far.min())
        highest = float(energies_so_far.max())
        in_range = EnergyRange(energy, lowest, highest)
        if energy >= lowest + _HIGH * (highest - lowest):
            swing = _find_strong_swing(history, flight, now)
            yield RunEvent("switch", now, now, tr=now, energy=in_range, swing=swing)
            return
        if now == flight.seen:
            yield RunEvent("later", last, now, energy=in_range)
    if history.end > last < end:
        tr = highest_energy(history, flight.seen, last)
        now = float(history.between(last, history.end)[0][0])
        swing = _find_strong_swing(history, flight, tr)
        yield RunEvent("switch", tr, now, tr=tr, swing=swing)


def highest_energy(history: History, start: float, end: float) -> float:
    """Return the last time from ``start`` to ``end`` at which the internal energy has its maximum [time]."""
    time, energy = history.between(start, end)
    return float(time[energy.size - 1 - int(np.argmax(energy[::-1]))])


def _find_strong_swing(history: History, flight: SeenFlight, tr: float) -> Swing | None:
    """Return the part that oscillates too strongly in a flight that has lasted up to tr; None if there is none."""
    swing = find_swing(history, flight.start, tr) if flight.parts else None
    return swing if swing and swing.flight > tr - flight.start else None
