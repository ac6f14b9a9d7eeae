"""Drive a Radioss run that switches itself: start a leg, watch it, say which comes next, until the run is over."""

from __future__ import annotations

import json
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base.errors import Caution, D2RPickError, FormatError, HistoryError
from d2rpick.base.files import append_whole, record_of, signed, write_whole
from d2rpick.choice.deck_of_run import in_deck
from d2rpick.deck.model import DISCRETE
from d2rpick.deck.writing import RESTARTS, DrivenDeck
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.running.evidence import contact_after, highest_energy, quiet_times
from d2rpick.running.sequence import LOAD, PROBE, RIGID, SEARCH, Leg, Order, Seen, control, next_order, window_of
from d2rpick.running.swing import swing_in
from d2rpick.running.wait import InnerMotion, Wait

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.run import Run
    from d2rpick.running.engine import Commands, Left, Solver
    from d2rpick.running.sequence import Limits, Window

JOURNAL: Final = "drive.ndjson"
# Largest step while rigid over the mean one before: a rigid leg costs a few percent of a deformable one then, and the
# state of a run is written often enough to show a contact.
_STEP_RATIO: Final = 5.0
# Restarts that a search or a probe keeps, as others go back to one.  So a search goes back by an eighth of the wait at
# most, and a probe, which stops soon after a contact, by this share of what is left of the run.
_KEPT: Final = 9
_IN_PROBE: Final = 0.02
# Looks at a leg: so many seconds apart, so many times as long as a look takes, and by this share of the leg.
_SHORTEST, _LOOKS, _SHARE = 0.1, 2.0, 0.005


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


class Driver:
    """One run in its folder, as far as its journal says.

    ``told`` gets each thing that happens, in a line; ``at`` is the leg that is computed and its time.
    """

    def __init__(
        self,
        deck: DrivenDeck,
        solver: Solver,
        journal: Journal,
        commands: Commands,
        limits: Limits,
        look: Looks,
        told: Callable[[str], None],
    ) -> None:
        self.deck, self.solver, self.journal, self.commands = deck, solver, journal, commands
        self.limits, self.look, self.told = limits, look, told
        self.at: tuple[Order, float] | None = None

    @property
    def legs(self) -> list[Leg]:
        """Legs that are over, those that were thrown away too."""
        return [
            Leg(Order(*one["order"]), Seen(*one["seen"]), one["cut"], restarts, one["cycles"], one["cpu"])
            for one in self.journal.all("ended")
            for restarts in [tuple(map(tuple, one["restarts"]))]
        ]

    @property
    def out_of_place(self) -> tuple[Caution, ...]:
        """What was said of parts that still swung as they became rigid."""
        said = {one["order"][1]: one["place"] for one in self.journal.all("started")}
        return tuple(Caution("out-of-place", place) for place in said.values() if place)

    def prepare(self) -> None:
        """Copy the deck into the folder and run the starter, unless that is done."""
        if self.journal.all("prepared"):
            return
        self._wait_for_end()  # of a starter that an earlier driver has left
        for name, content in self.deck.files.items():
            (self.solver.folder / name).parent.mkdir(parents=True, exist_ok=True)
            write_whole(self.solver.folder / name, content)
        first = self.solver.file(1, ".rad")
        write_whole(first, self.deck.leg(1, self.deck.end, "", None))  # the starter looks for /RBODY/OFF there
        self.solver.start(self.commands.words("starter", self.solver.file(0, ".rad").name), 0)
        self._wait_for_end()
        if not self.solver.started_well():
            raise D2RPickError(f"{self.solver.file(0, '.out')}: the starter failed: {self.solver.last_lines(0)}")
        self.journal.add("prepared")

    def _wait_for_end(self) -> None:
        while self.solver.alive:
            time.sleep(_SHORTEST)

    def progress(self, seconds: float) -> str:
        """Say which leg is computed and how far it is; until the first one has begun, for how many seconds."""
        at = self.at
        if at is None:
            return f"starting ... {seconds:.0f} s"
        order, time = at
        return f"leg {order.number}, {order.kind}: {time:.6g} of {self.limits.end:g}"

    def run(self) -> None:
        """Compute leg after leg to the end of the run.

        Raises
        ------
        D2RPickError
            If the solver fails, or the disk has no room; the run goes on from there when it is driven again.
        """
        if legs := self.legs:
            self.told(f"resumed: legs that are over: {len(legs)}, the last at {legs[-1].seen.time:.6g}")
        while order := next_order(self.legs, self.limits):
            self._compute(order)
        self.at = None

    def _compute(self, order: Order) -> None:
        resumed = self._under_way(order)
        if not resumed:
            self._start(order)
        elif self.solver.alive:
            self.told(f"leg {order.number}: the solver is still at work on it")
        alive = self.solver.alive
        with self._stopping(order):
            self._watch(order)
        left = self.solver.left(order.number)
        if not left.normal and (alive or not resumed):
            words = self.solver.last_lines(order.number)
            raise D2RPickError(f"{self.solver.file(order.number, '.out')}: the solver failed: {words}")
        self._end(order, left, again=resumed)

    def _under_way(self, order: Order) -> bool:
        """Whether an earlier driver has begun this leg, and nobody has said how it ended."""
        last = self.journal.records[-1]
        return last["event"] == "started" and Order(*last["order"]) == order

    def _start(self, order: Order) -> None:
        number, legs = order.number, self.journal.all("ended")
        ring = self._ring(order)
        self.solver.check_room(number, 1 - order.start / self.limits.end, ring[0])
        before = next((one for one in reversed(legs) if one["order"][1] == number - 1), {"restart": ""})
        restart = before["restart"] if order.restart is None else order.restart
        cap = self._step_of(order) if order.rigid else None
        if order.restart is not None:  # known by some cycles; what follows is computed again
            self.solver.shorten(number - 1, order.start - self.limits.same)
        self.solver.clear(number)
        frozen = order.kind == RIGID and order.restart is not None
        text = self.deck.leg(number, order.until, restart, cap, ring, frozen=frozen)
        write_whole(self.solver.file(number, ".rad"), text)
        place = self._place(order)
        self.journal.add("started", order=order, place=place)
        if place:
            self.told(f"warning: out-of-place: {place}")
        self.solver.start(self.commands.words("engine", self.solver.file(number, ".rad").name), number)
        self.solver.keep_two(number)
        self.told(f"leg {number}: {order.kind} from {order.start:.6g}")

    def _place(self, order: Order) -> str:
        """Say so where parts swing too much to become rigid in a leg whose end is known."""
        if order.kind != RIGID:
            return ""
        legs = self.legs
        planned = window_of(legs, self.limits)
        before = next(leg.order for leg in reversed(legs) if leg.order.start < planned.tr)
        return self.look.swing(self._histories(before, legs), planned)

    def _step_of(self, order: Order) -> float:
        """Step of a leg: the smallest mean one of those before, or the interval of the history where none is [time]."""
        known = [one.length / one.cycles for one in self.legs if one.kind == LOAD and one.cycles and one.length > 0]
        step = float(f"{min([self.deck.interval, *known]):.3g}")
        return min(self.deck.interval, _STEP_RATIO * step) if order.rigid else step

    def _ring(self, order: Order) -> tuple[int, int]:
        """How many restarts a leg keeps, and cycles between them: close where a later leg goes back to one."""
        share = {SEARCH: 1 / (_KEPT - 1), PROBE: _IN_PROBE}.get(order.kind)
        cycles = (order.until - order.start) / self._step_of(order)
        return (_KEPT, max(1, round(share * cycles))) if share else RESTARTS

    def _written(self, order: Order, left: Left) -> list[tuple[float, str]]:
        """Times and letters of the last restarts that a search or a probe wrote on its way, by their cycles."""
        if order.kind not in {SEARCH, PROBE} or left.timing is None or not left.timing.cycles:
            return []
        many, every = self._ring(order)
        count = (left.timing.cycles - 1) // every
        kept = range(max(0, count - many + 1), count)  # the one at the end may have taken the next letter
        times = self.solver.times(order.number, order.start, [(n + 1) * every for n in kept])
        return [(time, chr(ord("I") + n % many)) for n, time in zip(kept, times, strict=False)]

    def _watch(self, order: Order) -> None:
        """Look at a leg until it is over, and tell the engine when to stop."""
        began, said, size = time.monotonic(), "", -1
        history = self.solver.history(order.number)
        while self.solver.alive:
            looked = time.monotonic()
            grown = history.stat().st_size if history.exists() else -1
            if grown != size and (seen := self._seen(order)):
                size, self.at = grown, (order, seen.time)
                text = control(order, seen, self.limits)
                if text and text != said:
                    self.solver.tell(order.number, text)
                    said = text
            now = time.monotonic()
            time.sleep(max(_SHORTEST, _LOOKS * (now - looked), _SHARE * (now - began)))

    def _seen(self, order: Order) -> Seen | None:
        legs = self.legs
        known = max((leg.seen.wait for leg in legs if not leg.seen.idle), default=0.0)
        return self.look(order, self._histories(order, legs), known)

    def _histories(self, order: Order, legs: Sequence[Leg]) -> list[Path]:
        return [self.solver.history(number) for number in _segment(order, legs)]

    @contextmanager
    def _stopping(self, order: Order) -> Iterator[None]:
        """Let the engine end its leg, with a restart where one is needed, when the driver is interrupted."""
        try:
            yield
        except (KeyboardInterrupt, D2RPickError):
            self.solver.tell(order.number, "/KILL\n" if order.rigid else "/STOP\n")
            self.told("stopping: the solver writes its restart")
            self._wait_for_end()
            left = self.solver.left(order.number)
            if left.normal:
                self._end(order, left, again=True)
            raise

    def _end(self, order: Order, left: Left, *, again: bool) -> None:
        """Write down how a leg has ended; one that left nothing to go on from is begun again.

        ``again``: also one that ended as it should, but before its first state, since an earlier driver stopped it.
        """
        seen = self._seen(order)
        at_once = again and (seen is None or seen.time <= order.start)
        if seen is None or at_once or (left.restart is None and not order.rigid) or (order.rigid and not left.normal):
            if left.normal and not at_once:
                raise D2RPickError(f"{self.solver.file(order.number, '.out')}: the leg left no state, or no restart")
            self.told(f"leg {order.number}: it left nothing to go on from, and is begun again at {order.start:.6g}")
            self.journal.add("lost", order=order)
            return
        took = left.timing
        self.journal.add(
            "ended", order=order, seen=seen, cut=not left.normal, restart=left.restart or "",
            restarts=self._written(order, left), cycles=took.cycles if took else None, cpu=took.total if took else None,
        )  # fmt: skip
        self.solver.file(order.number, ".ctl").unlink(missing_ok=True)


def _segment(order: Order, legs: Sequence[Leg]) -> Sequence[int]:
    """Numbers of the legs whose record counts: this one, and before a deformable one those since the last rigid one.

    In rigid legs no quantity of a part is believed, and over them no inner motion goes on.
    """
    orders = {leg.order.number: leg.order for leg in legs}
    first = order.number
    while not order.rigid and (before := orders.get(first - 1)) and not before.rigid:
        first -= 1
    return range(first, order.number + 1)


# A leg is told to stop at the end of the wait when so much of it is over.
_HALF: Final = 0.5


class Looks:
    """Looks at the record of some ``parts`` of a deck, with the ``wait`` that was given or that the deck tells."""

    def __init__(
        self, parts: Sequence[int], inventory: Inventory, wait: float | None = None, of_deck: Wait | None = None
    ) -> None:
        springs = sorted(part for part, kinds in inventory.counts.items() if {*kinds} <= DISCRETE)
        self._selection = Selection(parts=tuple(map(str, parts)), springs=tuple(map(str, springs)))
        self._inventory, self._wait, self._of_deck = inventory, wait, of_deck
        self.why = ""  # of the wait

    def __call__(self, order: Order, histories: Sequence[Path], known: float) -> Seen | None:
        """Say what is seen of the leg that is ordered, whose history is the last.

        ``known`` is the longest wait that the record before these histories asked for [time].  None where there is no
        state yet.  A wait that was given is kept to where the record shows a longer one: ``why`` says so.
        """
        try:
            history = self._history(histories)
        except (FormatError, HistoryError, FileNotFoundError):
            return None  # the head is being written
        if not history.time.size or history.time[-1] < order.start:
            return None
        now = float(history.time[-1])
        if order.kind != LOAD:
            contact = contact_after(history, order.start)
            return Seen(now, peak=None if order.rigid else highest_energy(history, order.start, now), contact=contact)
        motion = InnerMotion(history, None, self._floor(known))
        quiet = quiet_times(history, lambda *times: _half(self._wait or motion.needed(*times)))
        free = quiet[-1].start if quiet and quiet[-1].end is None else None
        asked = None if free is None else motion.wait(free, now)
        at_rest = asked is not None and asked.source == "at-rest"
        wait = asked if self._wait is None else Wait(self._wait, "given", "as given")
        if free is None or wait is None:
            return Seen(now)
        longer = asked is not None and asked.time > wait.time
        self.why = f"{wait.reason}, but {asked.reason}" if asked and longer else wait.reason
        return Seen(now, free, wait.time, idle=at_rest)

    def swing(self, histories: Sequence[Path], planned: Window) -> str:
        """Say so where parts swing too much to be rigid in a window."""
        found = swing_in(self._history(histories), planned.free, planned.tr)
        return f"tr = {planned.tr:.6g}: {found.told}" if found and found.flight > planned.td - planned.free else ""

    def _history(self, histories: Sequence[Path]) -> History:
        return in_deck(open_run([str(path) for path in histories]), self._inventory).history(self._selection)

    def _floor(self, known: float) -> Wait | None:
        """Give the longest wait that is known from the deck, or from the record of flights before."""
        if known > (self._of_deck.time if self._of_deck else 0.0):
            return Wait(known, "record", "as in the flight before")
        return self._of_deck


def _half(wait: float | None) -> float | None:
    return wait and _HALF * wait


class Journal:
    """Records that are only appended, each on the disk when `add` returns.

    A line that is cut or damaged is passed over: what it said was not done.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        content = path.read_bytes() if path.exists() else b""
        self.records = [record for line in content.split(b"\n") if (record := record_of(line))]
        self._end = b"\n" if content and not content.endswith(b"\n") else b""

    def add(self, event: str, **values: Any) -> dict[str, Any]:
        """Append a record; D2RPickError where there is no room for it."""
        record = {"event": event, **values}
        line = signed(json.dumps(record, allow_nan=False)).encode()
        try:
            append_whole(self.path, self._end + line + b"\n", durable=True)
        except OSError as error:
            raise D2RPickError(f"{self.path}: cannot be written ({error.strerror}); make room, then --resume") from None
        self._end = b""
        self.records.append(record)
        return record

    def all(self, event: str) -> list[dict[str, Any]]:
        """Records of one kind, in the order they were written."""
        return [record for record in self.records if record["event"] == event]
