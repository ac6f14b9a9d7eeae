"""Watch a run while it is being computed, and find each event once; ``report.follow`` describes the events.

The run is not affected in any way. The pause after each read is 100 times as long as the read, so that watching takes 1
% of a processor core.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import (
    SEVERAL_RUNS,
    FormatError,
    HistoryError,
    RangeError,
)
from d2rpick.choice.switched.frozen import find_frozen_times
from d2rpick.histories.listings import find_ending
from d2rpick.histories.source import expand, find_later_legs
from d2rpick.running.events import find_events
from d2rpick.running.looks import Looks

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.base.errors import D2RPickError
    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Selection
    from d2rpick.running.events import RunEvent
    from d2rpick.running.witness import SeenFlight

    # Inode number of a file, its size, and the time at which it was written [s].
    FileStamp = tuple[int, int, float]

# Largest fraction of a processor core's time that reading may take [-].
_SHARE: Final = 0.01
# _SHORTEST: shortest pause between two reads [s].
# _LONGEST: longest pause between two reads that cover only new states [s].
_SHORTEST, _LONGEST = 0.5, 5.0
# A run is reported as silent after this time without output [s].
_SILENT: Final = 60.0
_NO_EVIDENCE: Final = (
    "neither momenta nor the contact energy are written, so no force can be recognised; write them "
    "(Radioss: /TFILE and /TH/PART with DEF, MASS; LS-DYNA: *DATABASE_GLSTAT and _MATSUM)"
)


class News(NamedTuple):
    """What a read of the files of a run has shown.

    Attributes
    ----------
    start, now : float or None
        Times of the first and last states of the run so far [time]; None if no state is written yet.
    events : tuple of RunEvent
        New events.
    undone_events : tuple of RunEvent
        Earlier events that are no longer valid, because the run was restarted from an earlier time.
    flight : SeenFlight or None
        Latest flight; None if there is none yet.
    knows_wait : bool
        True if the waiting time is known, i.e. the force-free time after which a flight is detected.
    was_switched : bool
        True if the events or the frozen energy show that parts were made rigid during the run.
    later_files : tuple of str
        Files of later restart segments that were read although the user did not name them.
    ending : str or None
        How the run ended according to its listing; None if it may still be running.
    silence : float or None
        Time since the last output of the run [s] if it is long enough to be reported, else None.
    error : D2RPickError or None
        Reason why the files cannot be read yet; None if they can be read.
    """

    start: float | None = None
    now: float | None = None
    events: tuple[RunEvent, ...] = ()
    undone_events: tuple[RunEvent, ...] = ()
    flight: SeenFlight | None = None
    knows_wait: bool = False
    was_switched: bool = False
    later_files: tuple[str, ...] = ()
    ending: str | None = None
    silence: float | None = None
    error: D2RPickError | None = None


class Watch:
    """Watches a run that is being computed.

    ``names`` are the files or the folder of the run, which need not exist yet. ``looks`` reads the files.
    """

    def __init__(
        self,
        names: Sequence[str],
        selection: Selection,
        wait: float | None = None,
        inventory: Inventory | None = None,
    ) -> None:
        self._names = names
        self.looks = Looks(selection, inventory, wait)
        self._files: dict[str, FileStamp] = {}
        self._events: tuple[RunEvent, ...] = ()  # All events that have been found.
        self._news = News()
        self._report_silence_after = _SILENT

    def look(self) -> News:
        """Read the output that was written since the last read, and return the news.

        Raises
        ------
        D2RPickError
            If the files cannot be read although they no longer change, if they contain nothing that shows a force, or
            if the waiting time that the user gave is too short.
        """
        files = find_files(self._names)
        news = self._news._replace(events=(), undone_events=(), silence=None)
        if files != self._files:
            self._files = files
            self._report_silence_after = _SILENT
            try:
                news = self._read([*files], news)._replace(error=None)
            except (FormatError, HistoryError) as error:
                # The error is not raised, because the solver may be writing to the file at this moment.
                news = news._replace(error=error)
        if news.now is not None and files:
            news = news._replace(ending=find_ending([*files][-1]))
        now = time.time()
        silence = now - max((written for _, _, written in files.values()), default=now)
        if news.error and silence > _SILENT:
            raise news.error
        if silence > self._report_silence_after and not news.ending:
            self._report_silence_after = 2 * silence
            news = news._replace(silence=silence)
        self._news = news
        return news

    def _read(self, names: Sequence[str], news: News) -> News:
        """Read the new states, and add to the news what they show."""
        if not names or not self.looks.look(names):
            return news
        evidence = self.looks.evidence
        if not evidence.witnesses:
            raise RangeError(f"{', '.join(names)}: {_NO_EVIDENCE}")
        events_before = self._events
        self._events = find_events(evidence)
        pairs = zip(events_before, self._events, strict=False)
        # Other values of an event may change in their last digits if all states are read again.
        are_kept = [before[:3] == event[:3] for before, event in pairs]
        kept_count = [*are_kept, False].index(False)
        now = evidence.history.end
        flights = evidence.flights()
        wait = evidence.given or evidence.motion.longest(now)
        return news._replace(
            start=evidence.history.start,
            now=now,
            events=self._events[kept_count:],
            undone_events=events_before[kept_count:],
            flight=flights[-1] if flights else None,
            knows_wait=wait is not None,
            was_switched=self._was_switched(evidence.history),
            later_files=tuple(find_later_legs(expand(self._names))),
        )

    def _was_switched(self, history: History) -> bool:
        """Return True if the events or the frozen energy of the history show that parts were made rigid."""
        is_seen = any(event.event == "rigid" for event in self._events)
        return is_seen or bool(find_frozen_times(history))


def follow(
    names: Sequence[str], selection: Selection, wait: float | None = None, inventory: Inventory | None = None,
    *, lasting: float | None = None, rest: Callable[[float], None] = time.sleep,
) -> Iterator[News]:  # fmt: skip
    """Yield the events of a run until it ends or ``lasting`` seconds have passed; see `Watch` for others."""
    watch = Watch(names, selection, wait, inventory)
    end = time.monotonic() + (float("inf") if lasting is None else lasting)
    while True:
        begun = time.process_time()
        news = watch.look()
        yield news
        pause = max(_SHORTEST, (time.process_time() - begun) / _SHARE)
        if watch.looks.resume_points:
            # Only the first read covers all states, so the pauses after later reads are short.
            pause = min(pause, _LONGEST)
        remaining = end - time.monotonic()
        if remaining <= 0 or (news.ending and lasting is None):
            return
        rest(min(pause, remaining))


def find_files(names: Sequence[str]) -> dict[str, FileStamp]:
    """Return the non-empty files of a run with their stamps, including files of later engine runs in the folder."""
    try:
        paths = expand(names)
    except FormatError as error:
        if SEVERAL_RUNS in str(error):
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
