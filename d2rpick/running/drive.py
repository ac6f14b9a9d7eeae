"""Drive a Radioss run that switches itself: compute a leg, look at what it shows, say which comes next."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import Caution, D2RPickError
from d2rpick.base.files import append_whole, record_of, signed, write_whole
from d2rpick.deck.model import DISCRETE
from d2rpick.histories.names import Selection
from d2rpick.running.evidence import Evidence
from d2rpick.running.inner_motion import InnerMotion, Wait
from d2rpick.running.looks import Looks
from d2rpick.running.sequence import (
    LOAD,
    Leg,
    Order,
    Seen,
    next_order,
    together,
    window_of,
)
from d2rpick.running.swing import swing_in

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from d2rpick.deck.model import Inventory
    from d2rpick.deck.writing import DrivenDeck
    from d2rpick.histories.history import History
    from d2rpick.histories.run import Run
    from d2rpick.running.engine import Commands, Solver
    from d2rpick.running.sequence import Limits, Window

JOURNAL: Final = "drive.ndjson"
# Largest step while rigid over the mean one before: a rigid leg costs a few percent of a deformable one then, and the
# state of a run is written often enough to show a contact.
_STEP_RATIO: Final = 5.0
# A flight that did not last for the wait is told where it did for this share of it.
_TOLD: Final = 0.5
# Between two looks whether the solver is still at work, and from when on silence is told [s].
_PAUSE, _SILENT = 0.05, 60.0


@dataclass(frozen=True, kw_only=True)
class Driven:
    """What has come of a run so far.

    ``windows`` are those of all flights, ``legs`` what was computed, ``why`` the reason of the wait.  ``saved``: what
    share of a deformable run is saved, by the cost model and by the processor time of this run; None where unknown.
    """

    run: Run
    deck: DrivenDeck
    windows: tuple[Window, ...]
    legs: tuple[Leg, ...]
    why: str
    saved: tuple[float | None, float | None]
    cautions: tuple[Caution, ...]


@dataclass
class Driver:
    """One run in its folder, as far as its journal says.

    ``told`` gets each thing that happens, in a line; ``at`` is the leg that is computed and when it began [s].
    """

    deck: DrivenDeck
    solver: Solver
    journal: Journal
    commands: Commands
    limits: Limits
    observer: Observer
    told: Callable[[str], None]
    at: Order | None = None
    _again: set[Order] = field(default_factory=set)

    @property
    def legs(self) -> list[Leg]:
        """Legs that are over, those that were thrown away too, but for those behind which the run went back."""
        found: list[Leg] = []
        for one in self.journal.records:
            if one["event"] == "ended":
                short = tuple(map(tuple, one["seen"][6]))
                seen = Seen(*one["seen"])._replace(short=short)
                found.append(Leg(Order(*one["order"]), seen, one["cycles"], one["cpu"]))
            elif one["event"] == "back":
                del found[one["legs"] :]
        return found

    @property
    def out_of_place(self) -> tuple[Caution, ...]:
        """What was said of parts that still swung as they became rigid."""
        said = dict.fromkeys(one["place"] for one in self.journal.all("ended"))
        return tuple(Caution("out-of-place", place) for place in said if place)

    def prepare(self) -> None:
        """Copy the deck into the folder and run the starter, unless that is done."""
        self._wait_for_end()  # of what an earlier driver has left
        if self.journal.all("prepared") and self.solver.whole(0):
            return
        for name, content in self.deck.files.items():
            (self.solver.folder / name).parent.mkdir(parents=True, exist_ok=True)
            write_whole(self.solver.folder / name, content)
        first = self.solver.file(1, ".rad")
        write_whole(
            first, self.deck.leg(1, self.deck.end, None)
        )  # the starter looks for /RBODY/OFF there
        self.solver.start(
            self.commands.words("starter", self.solver.file(0, ".rad").name), 0
        )
        self._wait_for_end()
        if not self.solver.started_well():
            raise D2RPickError(
                f"{self.solver.file(0, '.out')}: the starter failed: {self.solver.last_words(0)}"
            )
        self.journal.add("prepared")

    def progress(self, seconds: float) -> str:
        """Say which leg is computed; until the first one has begun, for how many seconds."""
        at = self.at
        if at is None:
            return f"starting ... {seconds:.0f} s"
        return f"leg {at.number}, {at.kind}: {at.start:.6g} to {at.until:.6g} of {self.limits.end:g}"

    def run(self) -> None:
        """Compute leg after leg to the end of the run.

        Raises
        ------
        D2RPickError
            If the solver fails, or the disk has no room; the run goes on from there when it is driven again.
        """
        if legs := self.legs:
            self.told(
                f"resumed: legs that are over: {len(legs)}, the last at {legs[-1].order.until:.6g}"
            )
        while order := self._next():
            self.at = order
            if not self._under_way(order):
                self._start(order)
            self._wait_for_end()
            self._end(order)
        self.at = None

    def _next(self) -> Order | None:
        """Say which leg comes next, from a restart that is whole: the run goes back until there is one."""
        legs = self.legs
        order, count = next_order(legs, self.limits), len(legs)
        while order is not None and legs and not self.solver.whole(order.number - 1):
            legs.pop()
            order = next_order(legs, self.limits)
        if len(legs) < count:
            self.journal.add("back", legs=len(legs))
            at = 0.0 if order is None else order.start
            self.told(
                f"the restart of the last leg is not whole: the run goes back to {at:.6g}"
            )
        return order

    def _under_way(self, order: Order) -> bool:
        """Whether this leg was begun, by an earlier driver, and came to its end."""
        last = self.journal.records[-1]
        begun = last["event"] == "started" and Order(*last["order"]) == order
        return (
            begun
            and self.solver.ended_well(order.number)
            and self.solver.whole(order.number)
        )

    def _start(self, order: Order) -> None:
        number = order.number
        self.solver.check_room(number, 1 - order.start / self.limits.end)
        self.solver.clear(number)
        frozen = order.rigid and len(together(order, self.legs)) > 1
        text = self.deck.leg(
            number, order.until, self._cap() if order.rigid else None, frozen=frozen
        )
        write_whole(self.solver.file(number, ".rad"), text)
        self.journal.add("started", order=order)
        self.solver.start(
            self.commands.words("engine", self.solver.file(number, ".rad").name), number
        )
        self.told(
            f"leg {number}: {order.kind} from {order.start:.6g} to {order.until:.6g}"
        )

    def _cap(self) -> float:
        """Largest step of a rigid leg, by the smallest mean one of the deformable legs before [time]."""
        known = [
            leg.length / leg.cycles
            for leg in self.legs
            if not leg.order.rigid and leg.cycles
        ]
        return min(
            self.deck.interval,
            _STEP_RATIO * float(f"{min([self.deck.interval, *known]):.3g}"),
        )

    def _wait_for_end(self) -> None:
        """Wait until no solver is at work; tell of silence, and end the solver where the driver is interrupted."""
        said = _SILENT
        try:
            while self.solver.alive:
                time.sleep(_PAUSE)
                silent = self.solver.silent_for()
                if silent > said:
                    said = 2 * silent
                    self.told(
                        f"the solver has written nothing for {silent:.0f} s; Ctrl-C ends it, then --resume"
                    )
        except KeyboardInterrupt:
            self.told(
                "stopping: the leg that is being computed is begun again with --resume"
            )
            self.solver.end()
            raise

    def _end(self, order: Order) -> None:
        """Write down what a leg has shown; one that is not whole is begun again, once.

        D2RPickError where the solver failed.
        """
        number = order.number
        if not self.solver.ended_well(number):
            self._fail(order)
            return
        cycles, cpu = self.solver.took(number)
        step = (order.until - order.start) / (cycles or 1)
        last_state = order.until - max(3 * self.limits.interval, 2 * step)
        if not self.solver.whole(number) or not self.solver.came_to(number, last_state):
            if order in self._again:
                where = self.solver.file(number, ".out")
                raise D2RPickError(
                    f"{where}: the leg left no whole restart; make room on the disk, then --resume"
                )
            self._again.add(order)
            self.told(
                f"leg {number}: it left no whole restart or history, and is begun again at {order.start:.6g}"
            )
            self.journal.add("lost", order=order)
            return
        legs = self.legs
        record = together(order, legs)
        before = [
            leg.seen
            for leg in legs
            if leg.order.until <= record[0].start and not leg.seen.idle
        ]
        known = max((seen.wait or 0.0 for seen in before), default=0.0)
        seen = self.observer.look(
            order, [self.solver.history(one.number) for one in record], known
        )
        place = self._place([*legs, Leg(order, seen, cycles, cpu)], record[0])
        if place:
            self.told(f"warning: out-of-place: {place}")
        self.journal.add(
            "ended", order=order, seen=seen, cycles=cycles, cpu=cpu, place=place
        )
        # a window that is left out is computed from where it begins
        self.solver.keep(
            {
                number,
                number - 1,
                number - 2,
                *([record[0].number - 1] if order.rigid else []),
            }
        )

    def _fail(self, order: Order) -> None:
        """Raise D2RPickError with what the solver said; a leg that failed before begins with a restart that is damaged.

        Then the run goes back by the leg that has written it.
        """
        events = [one["event"] for one in self.journal.records]
        latest = max(
            (place for place, event in enumerate(events) if event in ("ended", "back")),
            default=0,
        )
        self.journal.add("failed", order=order)
        if (
            "failed" not in events[latest:]
            or not self.legs
            or self.solver.came_to(order.number, order.start)
        ):
            words = self.solver.last_words(order.number)
            path = self.solver.file(order.number, ".out")
            raise D2RPickError(f"{path}: the solver failed: {words}; --resume goes on")
        self.journal.add("back", legs=len(self.legs) - 1)
        self.told(
            f"leg {order.number} failed again before its first state: the leg before it is computed again"
        )

    def _place(self, legs: Sequence[Leg], first: Order) -> str:
        """Say so where parts swing too much to be rigid in a window, from its ``first`` leg on, whose end is known."""
        planned = (
            window_of(legs, self.limits) if legs[-1].seen.contact is not None else None
        )
        if planned is None or planned.reason or first.number == 1:
            return ""
        numbers = [one.number for one in together(first._replace(kind=LOAD), legs)[:-1]]
        return self.observer.swing(
            [self.solver.history(number) for number in numbers], planned
        )


class Observer:
    """Looks at the record of some ``parts`` of a deck, with the ``wait`` that was given or that the deck tells."""

    def __init__(
        self,
        parts: Sequence[int],
        inventory: Inventory,
        wait: float | None = None,
        of_deck: Wait | None = None,
    ) -> None:
        springs = sorted(
            part for part, kinds in inventory.counts.items() if {*kinds} <= DISCRETE
        )
        selection = Selection(
            parts=tuple(map(str, parts)), springs=tuple(map(str, springs))
        )
        self._looks, self._whole = (
            Looks(selection, inventory),
            Looks(selection, inventory),
        )
        self._given, self._of_deck = wait, of_deck
        self._evidence, self._motion = Evidence(), InnerMotion(None, of_deck)

    def look(self, order: Order, histories: Sequence[Path], known: float) -> Seen:
        """Say what is seen at the end of a leg, whose history is the last.

        ``known`` is the longest wait that the record before these histories asked for [time].  A wait that was given is
        kept to where the record shows a longer one: ``why`` says so.
        """
        states, follows = self._looks.new_states([str(path) for path in histories])
        if not follows:
            self._evidence, self._motion = (
                Evidence(),
                InnerMotion(None, self._of_deck, known),
            )
        if states is not None and states.time.size:
            self._evidence.take(states)
            self._motion.take(states, self._evidence)
        history = self._evidence.history
        if order.rigid:
            return Seen(contact=self._evidence.contact_after(float(history.time[0])))
        return self._seen(order, history)

    def _seen(self, order: Order, history: History) -> Seen:
        flights, now = self._evidence.flights(self._needed), float(history.time[-1])
        free = self._evidence.free_since(now)
        asked = self._motion.wait(free, now)
        wait, idle = (
            self._needed(free, now),
            asked is not None and asked.source == "at-rest",
        )
        why = asked.reason if asked else ""
        if self._given is not None and not idle:
            why = (
                f"as given, but {why}"
                if asked and asked.time > self._given
                else "as given"
            )
        least = _TOLD * (wait or 0.0)
        pauses = self._evidence.pauses(order.start)
        energies = [
            history.energy_at(max(time, float(history.time[0])))
            for time in (order.start, now)
        ]
        earlier = energies[0] > energies[1] and order.start >= max(free, order.after)
        return Seen(
            free=free,
            wait=wait,
            why=why,
            flies=bool(flights) and flights[-1].end is None,
            tr=order.start if earlier else order.until,
            idle=idle,
            short=tuple(
                one
                for one in pauses
                if wait and least <= one[1] - one[0] and one[0] >= order.after
            ),
            swing=self._motion.longest_swing(now),
        )

    def _needed(self, start: float, now: float) -> float | None:
        asked = self._motion.wait(start, now)
        if self._given is not None and (asked is None or asked.source != "at-rest"):
            return self._given
        return asked and asked.time

    def swing(self, histories: Sequence[Path], planned: Window) -> str:
        """Say so where parts swing too much to be rigid in a window, by the record before it."""
        history = self._whole.whole([str(path) for path in histories])
        found = swing_in(history, planned.free, planned.tr)
        return (
            f"tr = {planned.tr:.6g}: {found.told}"
            if found and found.flight > planned.td - planned.free
            else ""
        )


class Journal:
    """Records that are only appended, each on the disk when `add` returns.

    A line that is cut or damaged is passed over: what it said was not done.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        content = path.read_bytes() if path.exists() else b""
        self.records = [
            record for line in content.split(b"\n") if (record := record_of(line))
        ]
        self._end = b"\n" if content and not content.endswith(b"\n") else b""

    def add(self, event: str, **values: Any) -> dict[str, Any]:
        """Append a record; D2RPickError where there is no room for it."""
        record = {"event": event, **values}
        line = signed(json.dumps(record, allow_nan=False)).encode()
        try:
            append_whole(self.path, self._end + line + b"\n", durable=True)
        except OSError as error:
            raise D2RPickError(
                f"{self.path}: cannot be written ({error.strerror}); make room, then --resume"
            ) from None
        self._end = b""
        self.records.append(record)
        return record

    def all(self, event: str) -> list[dict[str, Any]]:
        """Records of one kind, in the order they were written."""
        return [record for record in self.records if record["event"] == event]
