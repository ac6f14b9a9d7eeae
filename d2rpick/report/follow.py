"""Describe the events of a run that is followed, and name the next step once the run is over."""

from __future__ import annotations

import os
from itertools import chain, pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import list_names
from d2rpick.histories.listings import WITH_AN_ERROR
from d2rpick.histories.names import suggest_file
from d2rpick.report.formats import RepeatedQuestion
from d2rpick.report.next_step import name_step_after_switched_run
from d2rpick.report.tables import make_positional, quote_shell_line
from d2rpick.running.watch import News

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.running.events import RunEvent
    from d2rpick.running.inner_motion import Wait
    from d2rpick.running.witness import SeenFlight

# Messages of those events whose message is always the same.
_MESSAGES: Final = {
    "load": "a force acts",
    "rigid": "parts have become rigid: part data are not used until they deform again",
    "deformable": "all parts deform again",
}
# Events that advise when to switch.
_ADVICE: Final = ("switch", "later")


class Event(NamedTuple):
    """An event: a keyword for scripts, its time, the state at which it was ``seen`` [time], and a sentence.

    ``wait`` is the force-free time after which a flight is detected [time].  ``left`` is the change in that time, as a
    share of the largest value.  ``tr`` is the advised time [time].  Each is None if it does not apply to the event.
    """

    event: str
    time: float | None
    seen: float | None
    message: str
    wait: float | None = None
    left: float | None = None
    tr: float | None = None


def describe_news(
    reads: Iterable[News], names: Sequence[str], parts: Sequence[str]
) -> Iterator[Event]:
    """Yield the events that the reads of a run show, and at the end an event that states whether the parts fly.

    ``names`` are the files of the run, ``parts`` the chosen parts.
    """
    selected = ("--part", ",".join(parts)) if parts else ()
    nothing_read = News()
    news, is_over, step = nothing_read, False, ""
    for number, (news_before, news) in enumerate(
        pairwise(chain([nothing_read], reads))
    ):
        step = _name_step_after_end(news, (*names, *news.later_files), selected)
        if news.now != news_before.now:
            is_over = False
        if news.ending or news.silence:
            is_over = True
        # A single read is described by the last event.
        if number == 1 and news.now is None and not news.error:
            yield Event("waiting", None, None, _describe_missing_files(names))
        yield from _describe_states(news_before, news, step)
        for event in news.events:
            yield _describe_event(event, is_past=is_over)
        yield from _describe_end(news_before, news, step)
    yield _describe_last_state(news, names, step if is_over else "")


def _name_step_after_end(
    news: News, files: Sequence[str], selected: tuple[str, ...]
) -> str:
    """Return the step after the run has ended: choose times, or compare a switched run with its reference run.

    ``selected`` is the option with the chosen parts; empty if no parts were chosen.
    """
    if news.was_switched:
        question = RepeatedQuestion(parts=selected, files=tuple(files))
        return name_step_after_switched_run(question)
    words = ("d2rpick", "plan", *selected, *make_positional(files))
    return f"choose times with {quote_shell_line(words)}"


def _describe_states(news_before: News, news: News, step: str) -> Iterator[Event]:
    """Report that the run has begun, or that it was restarted."""
    now, last_time = news.now, news_before.now
    if now is None:
        return
    if last_time is None:
        yield Event("begun", news.start, now, _describe_first_read(news, step))
    elif now < last_time or news.undone_events:
        message = (
            f"the run was restarted: it was at {last_time:.6g} and is now at {now:.6g}"
        )
        yield Event("restart", now, now, message)
        undone = news.undone_events
        contacts = [event.time for event in undone if event.event == "contact"]
        if contacts and contacts[0] > now:
            message = "a contact is expected there, as before the restart"
            yield Event("expected", contacts[0], now, message)


def _describe_first_read(news: News, step: str) -> str:
    """Report how far the run is at the first read; if it seems over, name the next ``step``."""
    reached = f"the run has reached {news.now:.6g}"
    if news.ending:
        message = f"{reached} and has ended {news.ending}"
    elif news.silence:
        message = (
            f"{reached} and seems over: nothing was written for {news.silence:.0f} s"
        )
    else:
        return reached
    if news.was_switched:
        step = "this run was switched"
    return f"{step}: {message}, so the events below are past"


def _describe_event(event: RunEvent, *, is_past: bool) -> Event:
    """Describe an event of the states; an advice that ``is_past``, because the run is over, comes too late."""
    if event.event in _MESSAGES:
        return Event(event.event, event.time, event.seen, _MESSAGES[event.event])
    flight = event.flight
    assert flight is not None
    if event.event == "contact":
        message = (
            f"a force acts, {event.time - flight.start:.4g} after the flight began"
        )
        return Event(event.event, event.time, event.seen, message)
    left = None
    if event.event == "flight":
        message, left = _describe_flight(flight), flight.left
    else:
        message = _describe_advice(event, flight.wait)
        if is_past:
            message = f"advice during the run, now out of date: {message}"
    wait = flight.wait.time
    return Event(event.event, event.time, event.seen, message, wait, left, event.tr)


def _describe_flight(flight: SeenFlight) -> str:
    """Report that a flight was detected, which evidence shows it, and why it was not detected earlier."""
    landing = "landing time unknown"
    if flight.level is not None:
        landing = f"landing at about {flight.level:.4g} if the ground is level, later if it slopes down"
    return (
        f"no force for {flight.seen - flight.start:.4g}, the required force-free time is {flight.wait.time:.4g} "
        f"({flight.wait.reason}); {flight.quantity} is constant within {flight.left:.1e} of its maximum; {landing}"
    )


def _describe_advice(event: RunEvent, wait: Wait) -> str:
    """Advise when to switch, and give the reason."""
    if wait.source == "at-rest":
        return "switch now: nothing vibrates, so any tr is right, and the earliest keeps the parts rigid for longest"
    warning = f"; {event.swing.warning}" if event.swing else ""
    if event.energy is None:
        return (
            f"the internal energy was highest at {event.time:.6g}: restart from an earlier state to switch there"
            f"{warning}"
        )
    energy, lowest, highest = event.energy
    span = (
        f"its highest value of the last {wait.time:.4g} ({lowest:.4g} to {highest:.4g})"
    )
    if event.event == "later":
        return (
            f"not yet: the internal energy, {energy:.4g}, is far below {span}; "
            f"waiting until {event.time:.6g} for its maximum"
        )
    return (
        f"switch now: the internal energy, {energy:.4g}, is near {span}; it was not compared with the energy at td, "
        f"which is not known yet{warning}"
    )


def _describe_end(news_before: News, news: News, step: str) -> Iterator[Event]:
    """Report once that the run has ended, and from time to time that it writes nothing."""
    if news.ending and not news_before.ending:
        keyword = "failed" if news.ending == WITH_AN_ERROR else "ended"
        message = f"the run has ended {news.ending}"
        yield Event(keyword, news.now, news.now, message)
    if news.silence:
        message = (
            f"nothing was written for {news.silence:.0f} s. If the run is over, {step}; "
            "d2rpick follow ends with Ctrl+C, or with --once or --for"
        )
        yield Event("silent", news.now, news.now, message)


def _describe_missing_files(names: Sequence[str]) -> str:
    """State that no file of the run exists yet, with a similar name if none of the names exists."""
    similar = "" if any(map(os.path.exists, names)) else suggest_file(names[0])
    return f"{list_names(names)}: no file of a run yet{similar}; check the name if the run has begun"


def _describe_last_state(news: News, names: Sequence[str], step: str) -> Event:
    """State whether the parts are flying now, and since when; ``step`` is the next step once the run is over, or ""."""
    if news.now is None:
        message = _describe_missing_files(names)
        if news.error:
            message = f"cannot be read yet: {news.error}"
        return Event("state", None, None, message)
    since, message = None, "no flight yet"
    if news.flight is not None and news.flight.end is None:
        since, message = news.flight.start, f"flies since {news.flight.start:.6g}"
    elif news.flight is not None:
        message = f"no flight since {news.flight.end:.6g}"
    elif step:
        message = "no flight was seen during the run"
    if step and since is None and not news.was_switched:
        message += "; d2rpick plan judges the whole record, which may show a flight"
    if step and news.was_switched:
        message += f"; this run was switched: {step}"
    elif step:
        message += f"; {step}"
    if since is None and not news.knows_wait:
        message += "; the force-free time that marks a flight is unknown: give `wait`"
    return Event("state", since, news.now, message)
