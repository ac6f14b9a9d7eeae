"""Watch a run while it is computed: what happens in it, event after event, and what is new since the last look.

Nothing is started, stopped or changed, and each event is told by the states up to the one at which it is seen.  The
time to the next look is a hundred times what one costs: one percent of a core.
"""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import FormatError, HistoryError, RangeError
from d2rpick.flight.window import FEWEST
from d2rpick.histories.listings import WITH_AN_ERROR, ending
from d2rpick.histories.source import expand, later_legs
from d2rpick.running.evidence import Evidence, highest_energy, range_of_energy
from d2rpick.running.inner_motion import InnerMotion, wait_of_deck
from d2rpick.running.looks import Looks
from d2rpick.running.swing import find_swing

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Selection
    from d2rpick.running.witness import Quiet


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


def events_of(
    evidence: Evidence,
    motion: InnerMotion,
    decided: dict[tuple[float, float], tuple[Event, ...]] | None = None,
) -> tuple[Event, ...]:
    """Give all that has happened, in the order in which it was seen; RangeError where a wait is too short.

    The events of a run so far are the first of those of the whole run.  What is ``decided`` of flights, by their start
    and when they were seen, is not looked for again.
    """
    quiet, rigid, history = (
        evidence.flights(motion.needed),
        evidence.rigid_times(),
        evidence.history,
    )
    decided = {} if decided is None else decided
    found = [event for one in quiet for event in _flight(history, motion, one, decided)]
    found = [
        one
        for one in found
        if one.tr is None or not any(start <= one.tr <= end for start, _, end in rigid)
    ]
    if history.time.size and not (quiet and quiet[0].start <= history.time[0]):
        begun = evidence.contact_after(float(history.time[0]), 1)
        found += [] if begun is None else [Event("load", begun, begun, "a force acts")]
    for start, seen, end in rigid:
        if start <= history.time[min(FEWEST, history.time.size) - 1]:
            continue  # from the start on, as other bodies may be for good
        told = "parts have become rigid: no quantity of a part is believed until they deform again"
        found.append(Event("rigid", start, seen, told))
        if end < history.time[-1]:
            found.append(Event("deformable", end, end, "no part is rigid any more"))
    return tuple(sorted(found, key=lambda one: one.seen or 0.0))


def _flight(
    history: History,
    motion: InnerMotion,
    one: Quiet,
    decided: dict[tuple[float, float], tuple[Event, ...]],
) -> Iterator[Event]:
    advice = decided.get(one[:2]) or (
        _begins(motion, one),
        *_advice(history, motion, one),
    )
    if one.end is not None or any(event.tr is not None for event in advice):
        decided[one[:2]] = advice
    yield from advice
    if one.end is not None:
        told = f"a force acts, {one.end - one.start:.4g} after the flight began"
        yield Event("contact", one.end, one.end, told)


def _begins(motion: InnerMotion, one: Quiet) -> Event:
    """Tell that a flight is seen, by what evidence, and why not before."""
    what = (
        "momentum less gravity"
        if one.source == "momentum"
        else "the energy of the contacts"
    )
    wait = motion.wait(one.start, one.seen)
    why = f"the wait is {one.wait:.4g}: {wait.reason}" if wait else ""
    told = f"{what} is constant within {one.left:.1e} of its largest value for {one.seen - one.start:.4g}; {why}"
    told += (
        "; nothing tells when it lands"
        if one.level is None
        else f"; on level ground it lands about {one.level:.4g}"
    )
    return Event("flight", one.start, one.seen, told, one.wait, one.left)


def _advice(history: History, motion: InnerMotion, one: Quiet) -> Iterator[Event]:
    """Advise when to switch in a flight."""
    wait = motion.wait(one.start, one.seen)
    if wait and wait.source == "at-rest":
        told = "switch now: nothing vibrates, so that any tr is right, and the earlier it is the more it saves"
        yield Event("switch", one.seen, one.seen, told, one.wait, tr=one.seen)
    else:
        yield from _switch(history, one)


def _switch(history: History, one: Quiet) -> Iterator[Event]:
    """Advise a switch where the internal energy is high, within one more wait; else where it was highest in it."""
    last = one.seen + one.wait
    for now, energy in zip(
        *(values.tolist() for values in history.between(one.seen, last)), strict=True
    ):
        low, high, enough = range_of_energy(history, now, one.wait)
        where = f"the internal energy is {energy:.4g}, of {low:.4g} to {high:.4g} within one wait"
        if one.end is not None and now >= one.end:
            return
        if energy >= enough:
            yield Event(
                "switch",
                now,
                now,
                f"switch now: {where}{_swings(history, one, now)}",
                one.wait,
                tr=now,
            )
            return
        if now == one.seen:
            yield Event(
                "later",
                last,
                now,
                f"not yet: {where}; its highest value is waited for until {last:.6g}",
                one.wait,
            )
    if history.time[-1] > last and not (one.end is not None and one.end <= last):
        tr, now = (
            highest_energy(history, one.seen, last),
            float(history.between(last, history.time[-1])[0][0]),
        )
        told = f"the internal energy was highest at {tr:.6g}: a restart from before can switch there"
        told += _swings(history, one, tr)
        yield Event("switch", tr, now, told, one.wait, tr=tr)


def _swings(history: History, one: Quiet, tr: float) -> str:
    """Say so where parts swing by more than they may in a flight that has lasted until now."""
    swing = find_swing(history, one.start, tr) if one.parts else None
    return f"; {swing.told}" if swing and swing.flight > tr - one.start else ""


# Share of a core, shortest time between two looks, longest one where they read what is new, and how long a run that
# is silent writes nothing [s].
_SHARE: Final = 0.01
_SHORTEST, _LONGEST, _SILENT = 0.5, 5.0, 60.0
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
        self,
        names: Sequence[str],
        selection: Selection,
        wait: float | None = None,
        inventory: Inventory | None = None,
    ) -> None:
        self._names, self._selection, self._wait, self._inventory = (
            names,
            selection,
            wait,
            inventory,
        )
        self._of_deck = wait_of_deck(inventory) if inventory else None
        self._looks = Looks(selection, inventory)
        self._begin_again()
        self._files: list[tuple[str, os.stat_result]] = []
        self._told: tuple[Event, ...] = ()
        self._error: FormatError | HistoryError | None = None
        self._now, self._silent, self._undecided = float("-inf"), _SILENT, False
        self.ended: str | None = None

    def _begin_again(self) -> None:
        self._evidence, self._motion = (
            Evidence(),
            InnerMotion(self._wait, self._of_deck),
        )
        self._decided: dict[tuple[float, float], tuple[Event, ...]] = {}

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
                yield from self._read(
                    [name for name, _ in files], replaced=_replaced(before, files)
                )
                self._error = None
            except (FormatError, HistoryError) as error:
                self._error = error  # it may be about to be written
                self._looks = Looks(self._selection, self._inventory)
        if files and not self.ended and self._now > float("-inf"):
            yield from self._end(files[-1][0])
        silent = self._age()
        if self._error and silent > _SILENT:
            raise self._error
        if silent > self._silent and not self.ended:
            self._silent = 2 * silent
            yield self._event("silent", f"nothing was written for {silent:.0f} s")

    @property
    def reads_what_is_new(self) -> bool:
        """Whether the next look reads what is new alone."""
        return self._looks.grow

    def state(self) -> Event:
        """Tell how it stands, with the time since which it flies, if it does."""
        if not self._told and self._now == float("-inf"):
            return self._event(
                "state",
                f"cannot be read yet: {self._error}"
                if self._error
                else "has not begun",
            )
        last = next((one for one in reversed(self._told) if one.event in _FLYING), None)
        if last and last.event == "flight":
            return self._event("state", f"flies since {last.time:.6g}")._replace(
                time=last.time
            )
        told = f"no flight since {last.time:.6g}" if last else "no flight yet"
        more = (
            "; nothing tells how long no force must act to count as flight: give `wait`"
            if self._undecided
            else ""
        )
        return self._event("state", told + more)

    def _read(self, names: Sequence[str], *, replaced: bool) -> Iterator[Event]:
        if not names:
            return
        states, follows = self._looks.new_states(names)
        if states is None or not states.time.size:
            return
        if not states.momenta and (
            states.balance is None or states.balance.sliding is None
        ):
            raise RangeError(f"{', '.join(names)}: {_WRITTEN}")
        if not follows:
            self._begin_again()
        self._evidence.take(states)
        self._motion.take(states, self._evidence)
        history, motion = self._evidence.history, self._motion
        events, told, now = (
            events_of(self._evidence, motion, self._decided),
            self._told,
            float(history.time[-1]),
        )
        if self._now == float("-inf"):
            yield Event(
                "begun", float(history.time[0]), now, f"the run has come to {now:.6g}"
            )
        elif replaced or now < self._now:
            told = tuple(
                one for one, other in zip(told, events, strict=False) if one == other
            )
            yield from self._restarted(told, now)
        self._now, self._told = now, events
        self._undecided = self._wait is None and motion.longest(now) is None
        yield from events[len(told) :]

    def _end(self, name: str) -> Iterator[Event]:
        """Tell that the run has ended, once, where the listing beside its last file says so."""
        self.ended = _PACKED if name.endswith(".gz") else ending(name)
        if self.ended:
            yield self._event(
                "failed" if self.ended == WITH_AN_ERROR else "ended",
                f"the run has ended {self.ended}",
            )

    def _restarted(self, kept: Sequence[Event], now: float) -> Iterator[Event]:
        """Tell that a run went back to before what was seen of it, and when that had a contact."""
        yield Event(
            "restart",
            now,
            now,
            f"the run was restarted: it was at {self._now:.6g}, and is at {now:.6g}",
        )
        contact = next(
            (one.time for one in self._told[len(kept) :] if one.event == "contact"),
            None,
        )
        if contact is not None and contact > now:
            yield Event(
                "expected",
                contact,
                now,
                "a contact is expected there: before the restart it came there",
            )

    def _event(self, event: str, message: str) -> Event:
        now = None if self._now == float("-inf") else self._now
        return Event(event, None if event == "state" else now, now, message)

    def _age(self) -> float:
        """How long ago the files were written to last [s]."""
        return max(
            0.0,
            time.time()
            - max((found.st_mtime for _, found in self._files), default=time.time()),
        )


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
        pause = (
            min(pause, _LONGEST) if watch.reads_what_is_new else pause
        )  # the first look costs more than others
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


def _replaced(
    before: Sequence[tuple[str, os.stat_result]],
    now: Sequence[tuple[str, os.stat_result]],
) -> bool:
    """Whether a file was written anew, or is gone."""
    there = dict(now)
    return any(
        name not in there or there[name].st_size < one.st_size for name, one in before
    )
