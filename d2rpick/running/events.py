"""What happens in a run, one event after the other, each told by the states up to the one at which it is seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.flight.window import FEWEST
from d2rpick.running.evidence import contact_after, highest_energy, quiet_times, rigid_times
from d2rpick.running.swing import swing_in

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import History
    from d2rpick.running.evidence import Quiet
    from d2rpick.running.wait import InnerMotion

# A switch is advised where the internal energy is this share of the way from the lowest to the highest of one wait:
# in a trough of computed runs the energy after td was half of what it should be, from a peak 0.9 of it and more.
_HIGH: Final = 0.75


class Event(NamedTuple):
    """What happened, by a stable word, when [time], at which state it was ``seen`` [time], and in a sentence.

    ``wait`` is what had to pass without a force [time], and ``left`` what changed in it, as a share of the largest
    value; ``tr`` is the time that is advised [time].  None where an event has none.
    """

    event: str
    time: float | None
    seen: float | None
    message: str
    wait: float | None = None
    left: float | None = None
    tr: float | None = None


def events_of(history: History, motion: InnerMotion) -> tuple[Event, ...]:
    """Give all that has happened, in the order in which it was seen; RangeError where a wait is too short.

    The events of a run so far are the first of those of the whole run.
    """
    quiet, rigid = quiet_times(history, motion), rigid_times(history)
    found = [event for one in quiet for event in _flight(history, motion, one)]
    found = [one for one in found if one.tr is None or not any(start <= one.tr <= end for start, _, end in rigid)]
    if history.time.size and not (quiet and quiet[0].start <= history.time[0]):
        begun = contact_after(history, float(history.time[0]), 1)
        found += [] if begun is None else [Event("load", begun, begun, "a force acts")]
    for start, seen, end in rigid:
        if start <= history.time[min(FEWEST, history.time.size) - 1]:
            continue  # from the start on, as other bodies may be for good
        told = "parts have become rigid: no quantity of a part is believed until they deform again"
        found.append(Event("rigid", start, seen, told))
        if end < history.time[-1]:
            found.append(Event("deformable", end, end, "no part is rigid any more"))
    return tuple(sorted(found, key=lambda one: one.seen or 0.0))


def _flight(history: History, motion: InnerMotion, one: Quiet) -> Iterator[Event]:
    what = "momentum less gravity" if one.source == "momentum" else "the energy of the contacts"
    wait = motion.wait(one.start, one.seen)
    why = f"the wait is {one.wait:.4g}: {wait.reason}" if wait else ""
    told = f"{what} is constant within {one.left:.1e} of its largest value for {one.seen - one.start:.4g}; {why}"
    told += (
        "; nothing tells when it lands" if one.level is None else f"; on level ground it lands about {one.level:.4g}"
    )
    yield Event("flight", one.start, one.seen, told, one.wait, one.left)
    if wait and wait.source == "at-rest":
        told = "switch now: nothing vibrates, so that any tr is right, and the earlier it is the more it saves"
        yield Event("switch", one.seen, one.seen, told, one.wait, tr=one.seen)
    else:
        yield from _switch(history, one)
    if one.end is not None:
        told = f"a force acts, {one.end - one.start:.4g} after the flight began"
        yield Event("contact", one.end, one.end, told)


def _switch(history: History, one: Quiet) -> Iterator[Event]:
    """Advise a switch where the internal energy is high, within one more wait; else where it was highest in it."""
    last = one.seen + one.wait
    for now, energy in zip(*(values.tolist() for values in history.between(one.seen, last)), strict=True):
        before = history.between(now - one.wait, now)[1]
        low, high = float(before.min()), float(before.max())
        where = f"the internal energy is {energy:.4g}, of {low:.4g} to {high:.4g} within one wait"
        if one.end is not None and now >= one.end:
            return
        if energy >= low + _HIGH * (high - low):
            yield Event("switch", now, now, f"switch now: {where}{_swings(history, one, now)}", one.wait, tr=now)
            return
        if now == one.seen:
            yield Event(
                "later", last, now, f"not yet: {where}; its highest value is waited for until {last:.6g}", one.wait
            )
    if history.time[-1] > last and not (one.end is not None and one.end <= last):
        tr, now = highest_energy(history, one.seen, last), float(history.between(last, history.time[-1])[0][0])
        told = f"the internal energy was highest at {tr:.6g}: a restart from before can switch there"
        told += _swings(history, one, tr)
        yield Event("switch", tr, now, told, one.wait, tr=tr)


def _swings(history: History, one: Quiet, tr: float) -> str:
    """Say so where parts swing by more than they may in a flight that has lasted until now."""
    swing = swing_in(history, one.start, tr) if one.parts else None
    return f"; {swing.told}" if swing and swing.flight > tr - one.start else ""
