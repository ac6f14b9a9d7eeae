"""Find the constants that decide an answer: ``python -m tests.benchmarks.deciding_numbers TABLE``.

Each numeric constant of `vibration`, `flight` and `choice` is halved and doubled in a separate process.  The questions
of `deciding_questions` that run through code with this constant are asked again, one of each kind first.  The table
docs/developing/deciding-numbers.csv shows how many answers changed; constants that have changed no answer so far, or
have another value, are tried again.  A constant that changes no answer is a guard against round-off, overflow or
damaged input, a limit of time or memory, a threshold of cases that the questions do not contain, or not needed.
"""

from __future__ import annotations

import argparse
import ast
import csv
import importlib
import multiprocessing
import pkgutil
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import zip_longest
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType, FunctionType, ModuleType
from typing import Any, Final, NamedTuple

import d2rpick
from d2rpick.base.errors import D2RPickError
from tests.benchmarks.deciding_questions import Question, make_questions

PACKAGES: Final = ("vibration", "flight", "choice")
FACTORS: Final = (0.5, 2.0)
# This number of changed answers shows that a constant decides; no further questions are asked.
ENOUGH: Final = 3

_HEAD: Final = (
    "constant",
    "value",
    "changed when halved",
    "changed when doubled",
    "what it decides",
)

Number = float | int | tuple[float, ...]
# A function of a file, by the name of the file and the line of its definition.
Place = tuple[str, int]


class Constant(NamedTuple):
    """Numeric constant: its module, its value, and its comment."""

    module: str
    name: str
    value: Number
    comment: str


class Baseline(NamedTuple):
    """Unchanged answer to a question, its duration [s], and the functions it runs through."""

    answer: str
    seconds: float
    places: frozenset[Place]


class Row(NamedTuple):
    """Result for a constant: its name without the package, its value, and the counts of changed answers as text."""

    name: str
    value: str
    halved: str
    doubled: str

    @property
    def decides(self) -> bool:
        """Return True if an answer changed."""
        return any(not text.startswith("0 of") for text in (self.halved, self.doubled))


class Outcome(NamedTuple):
    """Number of questions asked with one scaled constant, and how many answers changed."""

    asked: int
    changed: int


def import_modules() -> list[ModuleType]:
    """Import all modules of the package, so that a child process finds nothing left to import."""
    names = [
        module.name
        for module in pkgutil.walk_packages(d2rpick.__path__, "d2rpick.")
        if not module.name.endswith("__main__")
    ]
    return [importlib.import_module(name) for name in names]


def find_constants(modules: Sequence[ModuleType]) -> list[Constant]:
    """List the numeric constants at module level of `PACKAGES`; zeros and truth values are none."""
    constants = []
    for module in modules:
        if module.__name__.split(".")[1] not in PACKAGES:
            continue
        lines = _read_source(module).split("\n")
        for names, statement in _find_assignments(module):
            comment = _find_comment(lines, statement)
            for name in names:
                value = getattr(module, name)
                if _is_number(value):
                    constants.append(Constant(module.__name__, name, value, comment))
    return constants


def _read_source(module: ModuleType) -> str:
    return Path(str(module.__file__)).read_text(encoding="utf-8")


def _find_assignments(
    module: ModuleType,
) -> Iterator[tuple[list[str], ast.Assign | ast.AnnAssign]]:
    """Yield the names in capitals that the module assigns at its top level, with each statement."""
    for statement in ast.parse(_read_source(module)).body:
        if isinstance(statement, ast.Assign):
            target = statement.targets[0]
        elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
            target = statement.target
        else:
            continue
        elements = target.elts if isinstance(target, ast.Tuple) else [target]
        names = [element.id for element in elements if isinstance(element, ast.Name)]
        if names and all(name.isupper() for name in names):
            yield names, statement


def _is_number(value: object) -> bool:
    if isinstance(value, tuple) and value:
        return all(_is_number(element) for element in value)
    is_numeric = isinstance(value, float | int) and not isinstance(value, bool)
    return is_numeric and value != 0


def _find_comment(lines: Sequence[str], statement: ast.stmt) -> str:
    """Return the comment above a statement, or at the end of its last line."""
    above: list[str] = []
    row = statement.lineno - 2
    while row >= 0 and lines[row].startswith("#"):
        above.insert(0, lines[row].lstrip("# "))
        row -= 1
    assert statement.end_lineno is not None
    comment_on_line = lines[statement.end_lineno - 1].partition("  # ")[2]
    return " ".join(above) or comment_on_line


def ask_safely(question: Question) -> str:
    """Return the answer to a question, or the first words of what went wrong."""
    try:
        return question()
    except D2RPickError as refusal:
        return f"refused: {str(refusal)[-80:]}"
    except Exception as failure:  # noqa: BLE001  a scaled constant may break anything
        return f"failed: {type(failure).__name__}"


def measure_baselines(questions: Mapping[str, Question]) -> dict[str, Baseline]:
    """Ask each question twice: once for its time, once for the functions that it runs through."""
    baselines = {}
    for name, question in questions.items():
        start = time.perf_counter()
        answer = ask_safely(question)
        seconds = time.perf_counter() - start
        places_asked: set[Place] = set()

        def note_place(
            frame: FrameType,
            event: str,
            _: object,
            places_asked: set[Place] = places_asked,
        ) -> None:
            if event == "call":
                code = frame.f_code
                places_asked.add((code.co_filename, code.co_firstlineno))

        sys.setprofile(note_place)
        try:
            ask_safely(question)
        finally:
            sys.setprofile(None)
        baselines[name] = Baseline(answer, seconds, frozenset(places_asked))
    return baselines


def find_users(modules: Sequence[ModuleType], constant: Constant) -> set[Place]:
    """Find the functions that name a constant, or one that is computed from it, in all modules that know it."""
    users = set()
    for module, names in _find_bindings(modules, constant).items():
        for code in _list_code(
            compile(_read_source(module), str(module.__file__), "exec")
        ):
            if names & {*code.co_names}:
                users.add((code.co_filename, code.co_firstlineno))
    return users


def _list_code(code: Any) -> Iterator[Any]:
    """Yield the code of a module's functions, inner ones too."""
    for inner in code.co_consts:
        if hasattr(inner, "co_names"):
            yield inner
            yield from _list_code(inner)


def _find_bindings(
    modules: Sequence[ModuleType], constant: Constant
) -> dict[ModuleType, set[str]]:
    """For each module, the names that hold the constant or a constant computed from it."""
    home = sys.modules[constant.module]
    dependent = {constant.name}
    for names, statement in _find_assignments(home):
        assert statement.value is not None
        used = {
            node.id for node in ast.walk(statement.value) if isinstance(node, ast.Name)
        }
        if used & dependent:
            dependent.update(names)
    bindings = {home: dependent}
    for module in modules:
        if module is not home:
            shared = {
                name
                for name in dependent
                if getattr(module, name, None) is getattr(home, name)
            }
            if shared:
                bindings[module] = shared
    return bindings


def scale(value: Number, factor: float) -> Number:
    """Scale a number, or each of several; whole numbers stay whole and at least 1."""
    if isinstance(value, tuple):
        return tuple(scale(element, factor) for element in value)  # type: ignore[misc]
    if isinstance(value, int):
        return max(1, round(value * factor))
    return value * factor


def patch_constant(
    modules: Sequence[ModuleType], constant: Constant, factor: float
) -> None:
    """Scale a constant in this process wherever a module or a default argument holds it."""
    bindings = _find_bindings(modules, constant)
    home = sys.modules[constant.module]
    original_values = {name: getattr(home, name) for name in bindings[home]}
    setattr(home, constant.name, scale(constant.value, factor))
    for computed, statement in _find_assignments(home):
        if constant.name not in computed and {*computed} & bindings[home]:
            # computed from the constant: computed again
            exec(compile(ast.Module([statement], []), "again", "exec"), vars(home))
    patched_values = {name: getattr(home, name) for name in original_values}
    replaced = {
        id(original_values[name]): patched_values[name] for name in original_values
    }
    for module, names in bindings.items():
        for name in names:
            setattr(module, name, patched_values[name])
    for module in modules:
        for function in _list_functions(module):
            defaults = function.__defaults__ or ()
            if any(id(default) in replaced for default in defaults):
                function.__defaults__ = tuple(
                    replaced.get(id(default), default) for default in defaults
                )


def _list_functions(module: ModuleType) -> Iterator[FunctionType]:
    for value in list(vars(module).values()):
        if isinstance(value, FunctionType):
            yield value
        elif isinstance(value, type):
            for member in list(vars(value).values()):
                if isinstance(member, FunctionType):
                    yield member


def order_by_kind(names: Sequence[str], baselines: Mapping[str, Baseline]) -> list[str]:
    """Order questions so that one of each kind comes first, the quickest, then the next of each kind."""
    by_kind: dict[str, list[str]] = defaultdict(list)
    for name in sorted(names, key=lambda name: baselines[name].seconds):
        by_kind[name.split()[0]].append(name)
    rounds = zip_longest(*by_kind.values())
    return [name for round_names in rounds for name in round_names if name]


def try_factor(
    modules: Sequence[ModuleType],
    constant: Constant,
    factor: float,
    questions: Mapping[str, Question],
    baselines: Mapping[str, Baseline],
    seconds: float,
) -> Outcome:
    """Ask the questions that run through the users of a constant, with the constant scaled, until it surely decides."""
    users = find_users(modules, constant)
    touched = [name for name in questions if users & baselines[name].places]
    touched = order_by_kind(touched, baselines)
    patch_constant(modules, constant, factor)
    asked_count = changed = 0
    start = time.process_time()
    for name in touched:
        is_late = time.process_time() - start > seconds
        if asked_count and (is_late or changed >= ENOUGH):
            break
        asked_count += 1
        changed += ask_safely(questions[name]) != baselines[name].answer
    return Outcome(asked_count, changed)


def call_in_child(function: Callable[[], Any]) -> Any:
    """Call a function in a forked process, which leaves nothing behind in this one."""
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


def count_outcomes(constant: Constant, outcomes: Sequence[Outcome]) -> Row:
    """Return the row of a constant that was tried."""
    module = constant.module.removeprefix("d2rpick.")
    counts = [f"{outcome.changed} of {outcome.asked}" for outcome in outcomes]
    return Row(f"{module}.{constant.name}", f"{constant.value}", *counts)


def read_table(path: Path) -> dict[str, Row]:
    """Return the tried rows of an earlier table by the names of their constants; empty without a table."""
    if not path.exists():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        lines = list(csv.reader(file))[1:]
    return {line[0]: Row(*line[:4]) for line in lines if line[2]}


def write_table(
    path: Path, constants: Sequence[Constant], rows: Mapping[str, Row]
) -> None:
    """Write the table of all constants: those that decide an answer, the others, and those that were not tried."""
    lines = []
    for constant in constants:
        name = f"{constant.module.removeprefix('d2rpick.')}.{constant.name}"
        row = rows.get(name, Row(name, f"{constant.value}", "", ""))
        rank = 2 if not row.halved else int(not row.decides)
        lines.append((rank, [*row, constant.comment]))
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
        "--seconds", type=float, default=6.0, help="time for each trial of a constant"
    )
    parser.add_argument("names", nargs="*", help="parts of the names of constants")
    options = parser.parse_args()
    modules = import_modules()
    constants = find_constants(modules)
    rows = read_table(options.table)
    with TemporaryDirectory() as folder:
        questions = make_questions(options.records, options.seed, Path(folder))
        baselines = call_in_child(lambda: measure_baselines(questions))
        for constant in constants:
            full_name = f"{constant.module}.{constant.name}"
            row = rows.get(full_name.removeprefix("d2rpick."))
            is_known = row and row.decides and row.value == f"{constant.value}"
            is_named = not options.names or any(
                part in full_name for part in options.names
            )
            if is_known or not is_named:
                continue
            trials = [
                partial(
                    try_factor,
                    modules,
                    constant,
                    factor,
                    questions,
                    baselines,
                    options.seconds,
                )
                for factor in FACTORS
            ]
            row = count_outcomes(constant, [call_in_child(trial) for trial in trials])
            rows[row.name] = row
            write_table(options.table, constants, rows)


if __name__ == "__main__":
    main()
