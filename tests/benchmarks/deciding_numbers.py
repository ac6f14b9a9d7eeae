"""Find the constants that decide an answer: ``python -m tests.benchmarks.deciding_numbers TABLE``.

Each numeric constant of `vibration`, `flight` and `choice` is halved and doubled, and questions of `deciding_questions`
that run a line with this constant are asked again, until a few answers have changed or the time for a trial is over.
One question of each kind is asked before the next one of any kind.  Every trial is a fork of a process that has
imported everything and asked nothing.

The table docs/developing/deciding-numbers.csv shows how many answers changed, and the first change of each. Its rows
of deciding constants are kept; constants that have changed no answer so far, or have another value, are tried again,
with other questions if ``--seed`` is another one. The table is written after each constant, so ``--resume`` continues
a stopped run: it keeps all rows of constants that were tried. A constant that changes no answer is a guard against
round-off, overflow or damaged input, a limit of time or memory, a threshold of cases that the questions do not
contain, or not needed.
"""

from __future__ import annotations

import argparse
import csv
import gc
import multiprocessing
import re
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import takewhile, zip_longest
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from types import CodeType, FrameType
from typing import Any, Final, NamedTuple

from d2rpick.base.errors import D2RPickError
from tests.benchmarks.deciding_constants import (
    Constant,
    Line,
    Source,
    Uses,
    find_constants,
    find_uses,
    read_sources,
    scale_constant,
)
from tests.benchmarks.deciding_questions import Answer, Question, make_questions
from tests.benchmarks.deciding_reasons import REASONS

FACTORS: Final = {"halved": 0.5, "doubled": 2.0}
# After this number of changed answers, a constant is known to decide, and no further questions are asked.
ENOUGH: Final = 3
# A question may take this multiple of its usual duration, plus these seconds; scaled step numbers may take forever.
_PATIENCE, _LEAST_PATIENCE = 20.0, 5.0
# Largest number of characters of a value or a question in the table.
_TEXT = 24
# End of the first sentence of a comment, which says what a constant decides; the others give the source or reason.
_FIRST_SENTENCE: Final = re.compile(r"(?<=\.) (?=[A-Z_])")

_HEAD: Final = (
    "constant",
    "value",
    "changed when halved",
    "changed when doubled",
    "first changes",
    "what it decides",
    "source or reason",
    "why it is kept although no answer changed",
)


class Baseline(NamedTuple):
    """Unchanged answer to a question, its duration [s], and those lines with constants that it executes."""

    answer: Answer
    seconds: float
    lines: frozenset[Line]


class Outcome(NamedTuple):
    """Number of questions asked with a scaled constant, and the changed answers by question."""

    asked: int
    changes: dict[str, str]


class Row(NamedTuple):
    """Result for a constant: its name without the package, its value, and the changed answers as text."""

    name: str
    value: str
    halved: str
    doubled: str
    changes: str

    @property
    def decides(self) -> bool:
        """Return True if an answer changed."""
        return any(not text.startswith("0 of") for text in (self.halved, self.doubled))


class OutOfTimeError(BaseException):
    """Raised if a question takes far longer than usual."""


class Trials:
    """Questions and constants, with methods that ask the questions with scaled constants."""

    def __init__(
        self,
        sources: Mapping[str, Source],
        questions: Mapping[str, Question],
        longest: float,
    ) -> None:
        self.sources = sources
        self.questions = questions
        self.constants = {
            constant.short_name: constant for constant in find_constants(sources)
        }
        self.uses: dict[str, Uses] = {
            name: find_uses(sources, constant)
            for name, constant in self.constants.items()
        }
        all_lines = frozenset(
            line for uses in self.uses.values() for line in uses.lines
        )
        baselines: dict[str, Baseline] = {
            name: call_in_child(partial(measure_baseline, question, all_lines))
            for name, question in questions.items()
        }
        self.baselines = {
            name: baseline
            for name, baseline in baselines.items()
            if baseline.seconds <= longest
        }

    def find_touched(self, name: str) -> list[str]:
        """List the questions that execute a line with a constant, starting with the quickest of each kind."""
        lines = self.uses[name].lines
        touched = [
            question
            for question, baseline in self.baselines.items()
            if not lines.isdisjoint(baseline.lines)
        ]
        by_kind: dict[str, list[str]] = defaultdict(list)
        for question in sorted(touched, key=lambda name: self.baselines[name].seconds):
            by_kind[question.split()[0]].append(question)
        rounds = zip_longest(*by_kind.values())
        return [question for one_round in rounds for question in one_round if question]

    def try_factor(self, name: str, factor: float, seconds: float) -> Outcome:
        """Ask questions with a scaled constant, until `ENOUGH` answers changed or the time is over."""
        touched = self.find_touched(name)
        return call_in_child(partial(self._ask, name, factor, touched, seconds))  # type: ignore[no-any-return]

    def _ask(
        self, name: str, factor: float, touched: Sequence[str], seconds: float
    ) -> Outcome:
        scale_constant(self.sources, self.constants[name], self.uses[name], factor)
        changes: dict[str, str] = {}
        asked_count = 0
        start = time.process_time()
        for question in touched:
            is_late = time.process_time() - start > seconds
            if asked_count and (is_late or len(changes) >= ENOUGH):
                break
            asked_count += 1
            baseline = self.baselines[question]
            answer = ask_safely(self.questions[question], baseline.seconds)
            change = describe_change(baseline.answer, answer)
            if change:
                changes[question] = change
        return Outcome(asked_count, changes)


def ask_safely(question: Question, usual_seconds: float) -> Answer:
    """Return the answer to a question; if it fails, return the first words of the error."""

    def stop(*_: object) -> None:
        raise OutOfTimeError

    signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, _PATIENCE * usual_seconds + _LEAST_PATIENCE)
    try:
        return question()
    except D2RPickError as refusal:
        return f"refused: {str(refusal)[-80:]}"
    except OutOfTimeError:
        return "takes far longer"
    except Exception as failure:  # noqa: BLE001  a scaled constant may break anything
        return f"failed: {type(failure).__name__}"
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)


def measure_baseline(question: Question, lines: frozenset[Line]) -> Baseline:
    """Ask a question once, and record which of these lines it executes."""
    lines_by_file: dict[str, set[int]] = defaultdict(set)
    for line in lines:
        lines_by_file[line.file].add(line.number)
    lines_of_code: dict[CodeType, set[int]] = {}
    lines_run: set[Line] = set()

    def note_line(frame: FrameType, event: str, _: object) -> Any:
        code = frame.f_code
        if event == "line" and frame.f_lineno in lines_of_code[code]:
            lines_run.add(Line(code.co_filename, frame.f_lineno))
        return note_line

    def note_call(frame: FrameType, _: str, __: object) -> Any:
        code = frame.f_code
        if code not in lines_of_code:
            numbers = {number for _, _, number in code.co_lines() if number}
            lines_of_code[code] = numbers & lines_by_file.get(code.co_filename, set())
        return note_line if lines_of_code[code] else None

    start = time.process_time()
    sys.settrace(note_call)
    try:
        answer = ask_safely(question, usual_seconds=60.0)
    finally:
        sys.settrace(None)
    return Baseline(answer, time.process_time() - start, frozenset(lines_run))


def describe_change(before: Answer, after: Answer, place: str = "") -> str:
    """Return the first difference between two answers as ``place: before → after``; empty if they are equal."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in {**before, **after}:
            change = describe_change(
                before.get(key), after.get(key), f"{place}.{key}".strip(".")
            )
            if change:
                return change
        return ""
    if isinstance(before, list | tuple) and isinstance(after, list | tuple):
        if len(before) != len(after):
            return f"{place}: {len(before)} → {len(after)} entries"
        for number, pair in enumerate(zip(before, after, strict=True)):
            change = describe_change(*pair, f"{place}[{number}]")
            if change:
                return change
        return ""
    if before == after:
        return ""
    texts = str(before), str(after)
    equal = takewhile(lambda pair: pair[0] == pair[1], zip(*texts, strict=False))
    first = max(len(list(equal)) - _TEXT // 2, 0)
    short = [text if len(text) <= _TEXT else text[first:][:_TEXT] for text in texts]
    return f"{place}: {short[0]} → {short[1]}"


def call_in_child(function: Callable[[], Any]) -> Any:
    """Call a function in a forked process, so that it changes nothing in this process."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)

    def send(connection: Connection) -> None:
        connection.send(function())

    child = context.Process(target=send, args=(sender,))
    child.start()
    sender.close()
    result = receiver.recv()
    child.join()
    return result


def make_row(constant: Constant, outcomes: Mapping[str, Outcome]) -> Row:
    """Return the row of a constant from its outcomes when halved and when doubled."""
    counts = {
        way: f"{len(outcome.changes)} of {outcome.asked}"
        for way, outcome in outcomes.items()
    }
    changes = [
        f"{way}: {question[: 2 * _TEXT]}: {change}"
        for way, outcome in outcomes.items()
        for question, change in list(outcome.changes.items())[:1]
    ]
    return Row(
        constant.short_name, f"{constant.value}", **counts, changes="; ".join(changes)
    )


def read_table(path: Path) -> dict[str, Row]:
    """Return the rows of an earlier table by the names of their constants; empty if there is no table."""
    if not path.exists():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))[1:]
    return {line[0]: Row(*line[:5]) for line in lines if line[2]}


def write_table(
    path: Path, constants: Mapping[str, Constant], rows: Mapping[str, Row]
) -> None:
    """Write the table of all constants: those that decide an answer, the others, and those that were not tried."""
    lines = []
    for name, constant in constants.items():
        row = rows.get(name, Row(name, f"{constant.value}", "", "", ""))
        rank = 2 if not row.halved else int(not row.decides)
        meaning, *sources = _FIRST_SENTENCE.split(constant.comment, maxsplit=1)
        kept = "" if row.decides else REASONS.get(name, "")
        lines.append((rank, [*row, meaning, *(sources or [""]), kept]))
    lines.sort(key=lambda line: line[0])
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(_HEAD)
        writer.writerows(cells for _, cells in lines)


def main() -> None:
    """Try each constant, and write the table."""
    parser = argparse.ArgumentParser(description="Which constants decide an answer.")
    parser.add_argument("table", type=Path, help="CSV file; deciding rows stay")
    parser.add_argument("--records", type=int, default=2, help="records of each class")
    parser.add_argument("--seed", type=int, default=1, help="seed of the records")
    parser.add_argument(
        "--seconds", type=float, default=1.0, help="time for each trial of a constant"
    )
    parser.add_argument(
        "--longest",
        type=float,
        default=3.0,
        help="questions that take longer are left out [s, with line tracing]",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep the rows of constants that changed nothing, too",
    )
    parser.add_argument("names", nargs="*", help="parts of the names of constants")
    options = parser.parse_intermixed_args()
    sources = read_sources()
    rows = read_table(options.table)
    with TemporaryDirectory() as folder:
        questions = make_questions(options.records, options.seed, Path(folder))
        gc.freeze()
        trials = Trials(sources, questions, options.longest)
        for name, constant in trials.constants.items():
            row = rows.get(name)
            is_done = (
                row is not None
                and row.value == f"{constant.value}"
                and (options.resume or row.decides)
            )
            is_named = not options.names or any(part in name for part in options.names)
            if is_done or not is_named:
                continue
            outcomes = {
                way: trials.try_factor(name, factor, options.seconds)
                for way, factor in FACTORS.items()
            }
            rows[name] = make_row(constant, outcomes)
            write_table(options.table, trials.constants, rows)


if __name__ == "__main__":
    main()
