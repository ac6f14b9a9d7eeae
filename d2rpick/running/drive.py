"""Drive a Radioss run that chooses its own switching times, one engine run (leg) after another."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import D2RPickError
from d2rpick.base.files import (
    add_checksum,
    append_as_a_whole,
    parse_record,
    write_as_a_whole,
)
from d2rpick.running.sequence import (
    PROBE,
    Leg,
    LegFindings,
    Order,
    choose_next_leg,
    collect_joined_legs,
    find_next_window,
    is_same_run,
)
from d2rpick.running.swing import find_swing

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from d2rpick.base.errors import Caution
    from d2rpick.deck.writing import DrivenDeck
    from d2rpick.histories.history import History
    from d2rpick.histories.run import OpenedRun
    from d2rpick.running.engine import Solver
    from d2rpick.running.evidence import GrowingEvidence
    from d2rpick.running.looks import Looks
    from d2rpick.running.sequence import Limits, Window

JOURNAL: Final = "drive.ndjson"
# Largest time step of a rigid engine run, relative to the mean time step of the deformable engine runs [-].
# With this time step, a rigid engine run costs a few percent of a deformable one and still resolves contacts.
_STEP_RATIO: Final = 5.0
# A flight too short to be switched is reported if it lasts for at least this fraction of the required time [-].
_REPORTED: Final = 0.5
# _PAUSE: time between two checks of the solver [s].
# _SILENT: time without solver output after which the driver reports this silence [s].
_PAUSE, _SILENT = 0.05, 60.0


@dataclass(frozen=True, kw_only=True)
class Driven:
    """State of a driven run.

    Attributes
    ----------
    windows : tuple of Window
        All flights, whether or not they were switched.
    legs : tuple of Leg
        All computed engine runs.
    why : str
        Reason for the length of the waiting time.
    saved : (float or None, float or None)
        Saved fraction of the cost of a deformable run according to the cost model, and to the CPU times [-]; None if
        unknown.
    """

    run: OpenedRun
    deck: DrivenDeck
    windows: tuple[Window, ...]
    legs: tuple[Leg, ...]
    why: str
    saved: tuple[float | None, float | None]
    cautions: tuple[Caution, ...]


@dataclass
class Driver:
    """Computes one run in its folder, continuing after the last record of its journal.

    ``report`` is called with a line of text for each event. ``at`` is the engine run that is being computed.
    """

    deck: DrivenDeck
    solver: Solver
    journal: Journal
    limits: Limits
    looks: Looks
    report: Callable[[str], None]
    at: Order | None = None

    def prepare(self) -> None:
        """Copy the deck into the folder and run the starter, unless an earlier driver has done this.

        Raises
        ------
        D2RPickError
            If the starter fails.
        """
        self._wait_for_end()  # An earlier driver may have left a solver running.
        if self.journal.has("prepared") and self.solver.whole(0):
            return
        # The first engine file is needed now, because the starter reads /RBODY/OFF from it.
        engine_file = self.solver.file(1, ".rad").name
        files = {engine_file: self.deck.leg(1, self.deck.end, None), **self.deck.files}
        for name, content in files.items():
            path = self.solver.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write_as_a_whole(path, content)
        self.solver.start("starter", 0)
        self._wait_for_end()
        if not self.solver.started_well():
            raise D2RPickError(
                f"{self.solver.file(0, '.out')}: the starter failed: {self.solver.last_words(0)}"
            )
        self.journal.add("prepared")

    def run(self) -> None:
        """Compute one engine run after another, up to the end of the run.

        Raises
        ------
        D2RPickError
            If the solver fails or the disk is full. The next call of `drive` continues the run from there.
        """
        legs = self.journal.legs
        if legs:
            self.report(
                f"resumed: {len(legs)} engine runs are done, the last until {legs[-1].order.until:.6g}"
            )
            if self.journal.has_failed:
                # A restart file that looks complete may still be damaged.
                self._go_back("the engine run after it has failed")
        while order := self._choose_next():
            self.at = order
            # An earlier driver may have started the engine run, and the solver may have finished it in the meantime.
            begun = self.journal.records[-1].get("order") == [*order]
            if (not begun or self._find_problem(order)) and not self._take_back(order):
                self._start(order)
            self._wait_for_end()
            problem = self._find_problem(order)
            if problem:
                self._recover(order, problem)
            else:
                self._end(order)
        self.at = None
        self.solver.remove_replaced()

    def _choose_next(self) -> Order | None:
        """Choose the next engine run. If its restart file is damaged, go back to an intact restart file."""
        legs = self.journal.legs
        order = choose_next_leg(legs, self.limits)
        if order is None or not legs or self.solver.whole(order.number - 1):
            return order
        self._go_back("its restart file is incomplete")
        return self._choose_next()

    def _go_back(self, reason: str) -> None:
        """Discard the last engine run, so that it is computed again."""
        legs = self.journal.legs
        self.journal.add("back", legs=len(legs) - 1)
        start = legs[-1].order.start
        self.report(f"the last engine run is computed again from {start:.6g}: {reason}")

    def _take_back(self, order: Order) -> bool:
        """Take back the files of an engine run that a probe has replaced; False if it must be computed."""
        if not any(is_same_run(leg.order, order) for leg in self.journal.legs):
            return False
        self.solver.clear(order.number)
        self.solver.restore(order.number)
        if self._find_problem(order):
            return False
        self.journal.add("restored", order=order)
        self.report(
            f"engine run {order.number}: {order.kind} from {order.start:.6g} to {order.until:.6g}, computed before"
        )
        return True

    def _start(self, order: Order) -> None:
        """Write the engine file of an engine run and start the engine."""
        number = order.number
        legs = self.journal.legs
        self.solver.check_room(number)
        replaces_a_leg = bool(legs) and legs[-1].order.number == number
        if order.kind == PROBE and replaces_a_leg and self.journal.has_just_ended:
            # If the window of the probe is not used, the engine run that it replaces is needed again.
            self.solver.set_aside(number)
        self.solver.clear(number)
        already_rigid = order.rigid and len(collect_joined_legs(order, legs)) > 1
        largest_step = _limit_step(order, legs, self.deck.interval)
        text = self.deck.leg(number, order.until, largest_step, frozen=already_rigid)
        write_as_a_whole(self.solver.file(number, ".rad"), text)
        self.journal.add("started", order=order)
        self.solver.start("engine", number)
        self.report(
            f"engine run {number}: {order.kind} from {order.start:.6g} to {order.until:.6g}"
        )

    def _wait_for_end(self) -> None:
        """Wait until no solver is running; report silence, and stop the solver after a KeyboardInterrupt."""
        reported_at = _SILENT
        try:
            while self.solver.alive:
                time.sleep(_PAUSE)
                silence = self.solver.silent_for()
                if silence > reported_at:
                    reported_at = 2 * silence
                    self.report(
                        f"the solver has written nothing for {silence:.0f} s; stop it with Ctrl-C, then --resume"
                    )
        except KeyboardInterrupt:
            self.report("stopping: --resume computes the current engine run again")
            self.solver.end()
            raise

    def _find_problem(self, order: Order) -> str:
        """Return why an engine run failed; empty if it ended normally, with complete restart files and history."""
        number = order.number
        if not self.solver.ended_well(number):
            return f"the solver failed: {self.solver.last_words(number)}; continue with --resume"
        times = self.solver.read_times(number)
        step = np.diff(times).max(initial=self.limits.interval)
        is_long_enough = np.any(times >= order.until - 3 * step)
        if is_long_enough and self.solver.whole(number):
            return ""
        return "the engine run left no complete restart file; make room on the disk, then --resume"

    def _recover(self, order: Order, problem: str) -> None:
        """Record in the journal that an engine run failed. If its files are incomplete, the run is computed once more.

        Raises
        ------
        D2RPickError
            If the solver reported an error, or the engine run has failed before.
        """
        has_failed = self.journal.has_failed
        self.journal.add("failed", leg=order.number)
        if has_failed or not self.solver.ended_well(order.number):
            raise D2RPickError(f"{self.solver.file(order.number, '.out')}: {problem}")
        self.report(
            f"engine run {order.number}: its restart file or history is incomplete; "
            f"computing it again from {order.start:.6g}"
        )

    def _end(self, order: Order) -> None:
        """Record the findings of an engine run in the journal."""
        number = order.number
        legs = self.journal.legs
        joined_legs = collect_joined_legs(order, legs)
        first = joined_legs[0]
        histories = [str(self.solver.history(leg.number)) for leg in joined_legs]
        self.looks.look(histories, _find_longest_wait(legs, first.start))
        findings = find_leg_results(order, self.looks.evidence)
        is_restored = self.journal.records[-1]["event"] == "restored"
        cycles, cpu = (0, 0.0) if is_restored else self.solver.took(number)
        self.journal.add("ended", order=order, seen=findings, cycles=cycles, cpu=cpu)
        if findings.contact is not None:
            window = find_next_window(self.journal.legs, self.limits)
            if window.warning:
                self.report(f"warning: out-of-place: {window.warning}")
        kept_restarts = {number, number - 1, number - 2}
        if order.rigid:
            # The restart file from before the window is needed in case the window is not used after all.
            kept_restarts.add(first.number - 1)
        else:
            self.solver.remove_replaced()
        self.solver.keep(kept_restarts)


def _limit_step(order: Order, legs: Sequence[Leg], interval: float) -> float | None:
    """Return the largest time step of a rigid engine run [time], which depends on the smallest mean deformable step."""
    if not order.rigid:
        return None
    steps = [
        leg.length / leg.cycles for leg in legs if not leg.order.rigid and leg.cycles
    ]
    smallest = float(f"{min([interval, *steps]):.3g}")
    return min(interval, _STEP_RATIO * smallest)


def _find_longest_wait(legs: Sequence[Leg], time: float) -> float:
    """Return the longest waiting time of those earlier engine runs in which parts vibrated [time]."""
    waits = [
        leg.findings.wait or 0.0
        for leg in legs
        if leg.order.until <= time and not leg.findings.idle
    ]
    return max(waits, default=0.0)


def find_leg_results(order: Order, evidence: GrowingEvidence) -> LegFindings:
    """Return the findings at the end of an engine run, from the evidence of all engine runs joined to it."""
    if order.rigid:
        return LegFindings(contact=evidence.find_contact())
    history = evidence.history
    flights = evidence.flights()
    flies = bool(flights) and flights[-1].end is None
    free = evidence.free_since(history.end)
    if flies:
        free = max(free, flights[-1].start)
    tr = _choose_end(order, history, free)
    half_period = evidence.motion.longest_swing(history.end)
    findings = LegFindings(free=free, flies=flies, tr=tr, swing=half_period)
    swing = find_swing(history, free, tr) if flies else None
    if swing:
        findings = findings._replace(
            steady_from=swing.flight, swing_warning=swing.warning
        )
    wait = evidence.find_wait(free, history.end)
    if wait is None:
        return findings
    # These flights were only slightly too short to be switched.
    short_flights = tuple(
        (start, end)
        for start, end in evidence.pauses(order.start)
        if end - start >= _REPORTED * wait.time and start >= order.switch_after
    )
    is_idle = wait.source == "at-rest"
    return findings._replace(
        wait=wait.time, why=wait.reason, idle=is_idle, short=short_flights
    )


def _choose_end(order: Order, history: History, free: float) -> float:
    """Choose tr: the start of an engine run in flight if its internal energy is higher there, otherwise its end."""
    start = max(order.start, history.start)
    falls = history.energy_at(start) > history.energy_at(history.end)
    if falls and order.start >= max(free, order.switch_after):
        return order.start
    return order.until


class Journal:
    """The journal of a driven run. Records are only appended; each record is on the disk when `add` returns.

    A truncated or damaged line is ignored, and the step that it records is repeated.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        content = path.read_bytes() if path.exists() else b""
        records = map(parse_record, content.split(b"\n"))
        self.records = [record for record in records if record]
        self._line_end = b"\n" if content and not content.endswith(b"\n") else b""

    @property
    def legs(self) -> list[Leg]:
        """Computed engine runs, except those that a restart from an earlier time has undone."""
        legs: list[Leg] = []
        for record in self.records:
            if record["event"] == "ended":
                order = Order(*record["order"])
                findings = LegFindings(*record["seen"])
                legs.append(Leg(order, findings, record["cycles"], record["cpu"]))
            elif record["event"] == "back":
                del legs[record["legs"] :]
        return legs

    @property
    def has_failed(self) -> bool:
        """True if the next engine run has failed before."""
        beginnings = ("started", "restored")
        for record in reversed(self.records):
            if record["event"] not in beginnings:
                return bool(record["event"] == "failed")
        return False

    @property
    def has_just_ended(self) -> bool:
        """True if nothing has been done since an engine run ended."""
        return bool(self.records[-1]["event"] == "ended")

    def has(self, event: str) -> bool:
        """Return True if the journal contains a record of the given event."""
        return any(record["event"] == event for record in self.records)

    def add(self, event: str, **values: Any) -> None:
        """Append a record; raise D2RPickError if the disk is full."""
        line = json.dumps({"event": event, **values}, allow_nan=False)
        try:
            content = self._line_end + add_checksum(line).encode() + b"\n"
            append_as_a_whole(self.path, content, durable=True)
        except OSError as error:
            raise D2RPickError(
                f"{self.path}: cannot be written ({error.strerror}); make room, then --resume"
            ) from None
        self._line_end = b""
        self.records.append(json.loads(line))
