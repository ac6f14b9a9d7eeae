"""Watch a run while it is being computed, and report each event once.

Nothing is started, stopped or changed.  The pause after each read is 100 times as long as the read, so that watching
takes 1 % of a processor core.
"""

from __future__ import annotations

import shlex
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, HistoryError, RangeError, list_names
from d2rpick.histories.listings import WITH_AN_ERROR, find_ending
from d2rpick.histories.source import expand, find_later_legs
from d2rpick.running.events import Event, find_events
from d2rpick.running.looks import Looks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.names import Selection

    # Inode number of a file, its size, and the time at which it was written [s].
    FileStamp = tuple[int, int, float]

# Reading may take at most this fraction of the time of a processor core [-].
_SHARE: Final = 0.01
# _SHORTEST: shortest pause between two reads [s].
# _LONGEST: longest pause between two reads of only the new states [s].
_SHORTEST, _LONGEST = 0.5, 5.0
# A run is reported as silent after this time without output [s].
_SILENT: Final = 60.0
_PACKED: Final = "normally: its history is packed"
# Events that advise when to switch.
_ADVICE: Final = ("switch", "later")
_NO_EVIDENCE: Final = (
    "neither momenta nor the contact energy are written, so no force can be recognised; write them "
    "(Radioss: /TFILE and /TH/PART with DEF, MASS; LS-DYNA: *DATABASE_GLSTAT and _MATSUM)"
)


class Watch:
    """Watches a run that is being computed.

    ``names`` are its files or its folder, which need not exist yet.  ``looks`` read the files.  ``ended`` says how the
    listing reports the end of the run, None before.
    """

    def __init__(
        self,
        names: Sequence[str],
        selection: Selection,
        wait: float | None = None,
        inventory: Inventory | None = None,
    ) -> None:
        self._names, self._parts = names, selection.parts
        self.looks = Looks(selection, inventory, wait)
        self._files: dict[str, FileStamp] = {}
        self._events: tuple[Event, ...] = ()  # Events that have been reported.
        self._error: FormatError | HistoryError | None = None
        self._last_time: float | None = None
        self._report_silence_after = _SILENT
        self._was_over = False  # True if the run seemed to be over at the first read.
        self.ended: str | None = None

    @property
    def _plan(self) -> str:
        """Return the command that chooses the times of a finished run."""
        parts = ("--part", ",".join(self._parts)) if self._parts else ()
        return shlex.join(("d2rpick", "plan", *parts, *self._names))

    def news(self) -> Iterator[Event]:
        """Return the events since the last read; empty for a run that has not yet begun.

        Raises
        ------
        D2RPickError
            If the files cannot be read although nothing is written to them any more, they contain nothing that shows a
            force, or the given wait is too short.
        """
        files = find_files(self._names)
        if files != self._files:
            self._files = files
            self._report_silence_after = _SILENT
            try:
                yield from self._read([*files])
                self._error = None
            except (FormatError, HistoryError) as error:
                # No error is raised, because the solver may be writing to the file at this moment.
                self._error = error
        if self._last_time is not None and files and not self.ended:
            yield from self._check_end([*files][-1])
        now = time.time()
        silence = now - max((written for _, _, written in files.values()), default=now)
        if self._error and silence > _SILENT:
            raise self._error
        if silence > self._report_silence_after and not self.ended:
            self._report_silence_after = 2 * silence
            message = (
                f"nothing was written for {silence:.0f} s. If the run is over, choose times with {self._plan}; "
                "d2rpick follow ends with Ctrl+C, or with --once or --for"
            )
            yield self._make_event("silent", message)

    def state(self) -> Event:
        """Return a sentence that states whether the parts are flying now, and since when."""
        if self._last_time is None:
            message = f"{list_names(self._names)}: no file of a run yet; check the name if the run has begun"
            if self._error:
                message = f"cannot be read yet: {self._error}"
            return self._make_event("state", message)
        time, message = None, "no flight yet"
        for event in self._events:
            if event.event == "flight":
                time, message = event.time, f"flies since {event.time:.6g}"
            elif event.event == "contact":
                time, message = None, f"no flight since {event.time:.6g}"
        if self._was_over:
            message += f"; choose times with {self._plan}"
        now, evidence = self._last_time, self.looks.evidence
        wait = evidence.given or evidence.motion.longest(now)
        if time is None and wait is None:
            message += (
                "; the force-free time that marks a flight is unknown: give `wait`"
            )
        return Event("state", time, now, message)

    def _read(self, names: Sequence[str]) -> Iterator[Event]:
        """Read the new states, and return the events that they show."""
        if not names or not self.looks.look(names):
            return
        evidence = self.looks.evidence
        if not evidence.witnesses:
            raise RangeError(f"{', '.join(names)}: {_NO_EVIDENCE}")
        now, before = evidence.history.end, self._last_time
        events = find_events(evidence)
        pairs = zip(self._events, events, strict=False)
        kept_count = sum(event == event_before for event, event_before in pairs)
        if before is None:
            yield Event(
                "begun", evidence.history.start, now, self._describe_first_look(now)
            )
        elif now < before or kept_count < len(self._events):
            message = (
                f"the run was restarted: it was at {before:.6g} and is now at {now:.6g}"
            )
            yield Event("restart", now, now, message)
            yield from _expect_contact(self._events[kept_count:], now)
        self._last_time, self._events = now, events
        if before is None and self._was_over:
            yield from map(_tell_as_past, events)
        else:
            yield from events[kept_count:]

    def _describe_first_look(self, now: float) -> str:
        """Report how far the run has got at the first read; if it seems to be over, refer to ``plan``."""
        reached = f"the run has reached {now:.6g}"
        ending = _find_ending([*self._files][-1])
        written = max(written for _, _, written in self._files.values())
        silence = time.time() - written
        if not ending and silence <= _SILENT:
            return reached
        self._was_over = True
        reason = (
            f"has ended {ending}"
            if ending
            else f"seems over: nothing was written for {silence:.0f} s"
        )
        return f"{reached} and {reason}; choose times with {self._plan}, because the events below are past"

    def _check_end(self, name: str) -> Iterator[Event]:
        """Report once that the run has ended, if the listing next to its last file shows that."""
        self.ended = _find_ending(name)
        if self.ended:
            event = "failed" if self.ended == WITH_AN_ERROR else "ended"
            yield self._make_event(event, f"the run has ended {self.ended}")

    def _make_event(self, event: str, message: str) -> Event:
        """Return an event at the last state."""
        return Event(event, self._last_time, self._last_time, message)


def _find_ending(name: str) -> str | None:
    """Return how the run of a history has ended; None if it may still be computed."""
    return _PACKED if name.endswith(".gz") else find_ending(name)


def _tell_as_past(event: Event) -> Event:
    """Return an event of a finished run; the advice in it can no longer be followed."""
    if event.event not in _ADVICE:
        return event
    message = f"during the run the advice was: {event.message}"
    return event._replace(message=message)


def _expect_contact(lost_events: Sequence[Event], now: float) -> Iterator[Event]:
    """Yield an event that announces the first of the contacts that a restart has undone."""
    times = [event.time for event in lost_events if event.event == "contact"]
    if times and times[0] is not None and times[0] > now:
        message = "a contact is expected there, as before the restart"
        yield Event("expected", times[0], now, message)


def follow(
    names: Sequence[str], selection: Selection, wait: float | None = None, inventory: Inventory | None = None,
    *, lasting: float | None = None, rest: Callable[[float], None] = time.sleep,
) -> Iterator[Event]:  # fmt: skip
    """Yield the events of a run until it has ended or for ``lasting`` [s]; see `Watch` for the other arguments."""
    watch = Watch(names, selection, wait, inventory)
    end = time.monotonic() + (float("inf") if lasting is None else lasting)
    while True:
        begun = time.process_time()
        yield from watch.news()
        pause = max(_SHORTEST, (time.process_time() - begun) / _SHARE)
        if watch.looks.resume_points:
            # Only the first read covers all states, so the pauses after later reads are short.
            pause = min(pause, _LONGEST)
        remaining = end - time.monotonic()
        if remaining <= 0 or (watch.ended and lasting is None):
            yield watch.state()
            return
        rest(min(pause, remaining))


def find_files(names: Sequence[str]) -> dict[str, FileStamp]:
    """Return the non-empty files of a run with their stamps, including files of later engine runs in the folder."""
    try:
        paths = expand(names)
    except FormatError as error:
        if "several runs" in str(error):
            raise
        return {}
    files = {}
    for path in (*paths, *find_later_legs(paths)):
        # The file may not exist yet, or it may have been removed.
        with suppress(OSError):
            status = Path(path).stat()
            if status.st_size:
                files[path] = status.st_ino, status.st_size, status.st_mtime
    return files
