"""Watch a run while it is computed: tell what is new, and rest for long enough in between.

Nothing is started, stopped or changed.  A look costs what reading the record costs, so the time to the next one is a
hundred times that: one percent of a core.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, HistoryError, RangeError
from d2rpick.choice.deck_of_run import in_deck
from d2rpick.choice.of_run import Reference
from d2rpick.histories.listings import WITH_AN_ERROR, ending
from d2rpick.histories.opening import open_run
from d2rpick.histories.source import expand, later_legs
from d2rpick.running.events import Event, events_of
from d2rpick.running.wait import InnerMotion, wait_of_deck

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.names import Selection

# Share of a core, shortest time between two looks, and after what time without a new state a run is silent [s].
_SHARE: Final = 0.01
_SHORTEST, _SILENT = 0.5, 60.0
_PACKED: Final = "normally: its history is packed"
_FLYING: Final = ("flight", "contact")
_WRITTEN: Final = (
    "neither a momentum nor the energy of contacts is written: nothing tells when a force acts; let the run write them "
    "(Radioss: /TFILE and /TH/PART with DEF, MASS; LS-DYNA: *DATABASE_GLSTAT and _MATSUM)"
)


class Watch:
    """A run that is being computed, by the names of its files or its folder, which need not be there yet.

    ``ended`` is how its listing says that it has ended.
    """

    def __init__(
        self, names: Sequence[str], selection: Selection, wait: float | None = None, inventory: Inventory | None = None
    ) -> None:
        self._names, self._selection, self._wait, self._inventory = names, selection, wait, inventory
        self._of_deck = wait_of_deck(inventory) if inventory else None
        self._files: list[tuple[str, os.stat_result]] = []
        self._told: tuple[Event, ...] = ()
        self._error: FormatError | HistoryError | None = None
        self._now, self._silent, self._undecided = float("-inf"), _SILENT, False
        self.ended: str | None = None

    def news(self) -> Iterator[Event]:
        """Tell what is new; nothing of a run that has not begun.

        Raises
        ------
        D2RPickError
            If the files cannot be read although nothing is written to them any more, nothing in them tells when a
            force acts, or the wait that was given is too short.
        """
        files, before = list(_files(self._names)), self._files
        if [_stamp(*one) for one in files] != [_stamp(*one) for one in before]:
            self._files, self._silent = files, _SILENT
            try:
                yield from self._read([name for name, _ in files], replaced=_replaced(before, files))
                self._error = None
            except (FormatError, HistoryError) as error:
                self._error = error  # it may be about to be written
        silent = self._age()
        if self._error and silent > _SILENT:
            raise self._error
        if silent > self._silent and not self.ended:
            self._silent = 2 * silent
            yield self._event("silent", f"nothing was written for {silent:.0f} s")

    def state(self) -> Event:
        """Tell how it stands, with the time since which it flies, if it does."""
        if not self._told and self._now == float("-inf"):
            return self._event("state", f"cannot be read yet: {self._error}" if self._error else "has not begun")
        last = next((one for one in reversed(self._told) if one.event in _FLYING), None)
        if last and last.event == "flight":
            return self._event("state", f"flies since {last.time:.6g}")._replace(time=last.time)
        told = f"no flight since {last.time:.6g}" if last else "no flight yet"
        more = "; nothing tells how long no force must act to count as flight: give `wait`" if self._undecided else ""
        return self._event("state", told + more)

    def _read(self, names: Sequence[str], *, replaced: bool) -> Iterator[Event]:
        if not names:
            return
        history = Reference.of(in_deck(open_run(names, self._selection), self._inventory), self._selection).history
        if not history.time.size:
            return
        if not history.momenta and (history.balance is None or history.balance.sliding is None):
            raise RangeError(f"{', '.join(names)}: {_WRITTEN}")
        motion = InnerMotion(history, self._wait, self._of_deck)
        events, told, now = events_of(history, motion), self._told, float(history.time[-1])
        if self._now == float("-inf"):
            yield Event("begun", float(history.time[0]), now, f"the run has come to {now:.6g}")
        elif replaced or now < self._now:
            told = tuple(one for one, other in zip(told, events, strict=False) if one == other)
            yield from self._restarted(told, now)
        self._now, self._told = now, events
        self._undecided = self._wait is None and motion.longest(now) is None
        yield from events[len(told) :]
        self.ended = _PACKED if names[-1].endswith(".gz") else ending(names[-1])
        if self.ended:
            yield self._event("failed" if self.ended == WITH_AN_ERROR else "ended", f"the run has ended {self.ended}")

    def _restarted(self, kept: Sequence[Event], now: float) -> Iterator[Event]:
        """Tell that a run went back to before what was seen of it, and when that had a contact."""
        yield Event("restart", now, now, f"the run was restarted: it was at {self._now:.6g}, and is at {now:.6g}")
        contact = next((one.time for one in self._told[len(kept) :] if one.event == "contact"), None)
        if contact is not None and contact > now:
            yield Event("expected", contact, now, "a contact is expected there: before the restart it came there")

    def _event(self, event: str, message: str) -> Event:
        now = None if self._now == float("-inf") else self._now
        return Event(event, None if event == "state" else now, now, message)

    def _age(self) -> float:
        """How long ago the files were written to last [s]."""
        return max(0.0, time.time() - max((found.st_mtime for _, found in self._files), default=time.time()))


def follow(
    names: Sequence[str], selection: Selection, wait: float | None = None, inventory: Inventory | None = None,
    *, lasting: float | None = None, rest: Callable[[float], None] = time.sleep,
) -> Iterator[Event]:  # fmt: skip
    """Tell what happens in a run as it goes on, until it has ended, or for so long [s]; arguments as of `Watch`."""
    watch = Watch(names, selection, wait, inventory)
    end = time.monotonic() + (float("inf") if lasting is None else lasting)
    while True:
        begun = time.process_time()
        yield from watch.news()
        pause = max(_SHORTEST, (time.process_time() - begun) / _SHARE)
        left = end - time.monotonic()
        if left <= 0 or (watch.ended and lasting is None):
            yield watch.state()
            return
        rest(min(pause, left))


def _files(names: Sequence[str]) -> Iterator[tuple[str, os.stat_result]]:
    """Files of a run that hold something, with the later legs beside them."""
    try:
        found = expand(names)
    except FormatError as error:
        if "several runs" in str(error):
            raise
        return
    for name in (*found, *later_legs(found)):
        with suppress(OSError):  # not there yet, or no more
            state = Path(name).stat()
            if state.st_size:
                yield name, state


def _stamp(name: str, found: os.stat_result) -> tuple[str, int, int, int]:
    return name, found.st_ino, found.st_size, found.st_mtime_ns


def _replaced(before: Sequence[tuple[str, os.stat_result]], now: Sequence[tuple[str, os.stat_result]]) -> bool:
    """Whether a file was written anew, or is gone."""
    there = dict(now)
    return any(name not in there or there[name].st_size < one.st_size for name, one in before)
