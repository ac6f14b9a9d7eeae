"""What must hold of the package as a whole: the direction of its imports, and what a command loads."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from importlib.resources import files
from typing import TYPE_CHECKING

import pytest

from d2rpick.cli import options, replay
from d2rpick.histories.opening import READERS
from d2rpick.models import oscillator_files
from tests.command import DECK, ENERGY, GLSTAT, ROOT, TIME_LIMIT

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PACKAGE = ROOT / "d2rpick"

# Each folder imports only from itself and from those on the lines above its own.
LAYERS = (
    ("errors", "file_state", "version"),
    ("histories", "deck"),
    ("vibration",),
    ("flight",),
    ("choice",),
    ("rules", "studies"),
    ("models",),
    ("report",),
    ("cli", "library"),
    ("__main__",),
)
# The only modules that may import these.
RESERVED = {"click": ("cli",), "matplotlib": ("report", "library")}  # library: for types

HEAVY = {"pandas", "scipy", "matplotlib", "h5py", "PIL", "jsonschema", "unittest", "numpy.testing", "numpy.f2py"}


def name_of(path: Path) -> str:
    """Name of a module within the package."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__") or "d2rpick"


MODULES = {name_of(path): path for path in PACKAGE.rglob("*.py")}


@cache
def parsed(module: str) -> ast.Module:
    """The source of a module."""
    return ast.parse(MODULES[module].read_text("utf-8"))


@cache
def imports(module: str) -> frozenset[str]:
    """Names of all modules that a module imports, also for type checking, those of the package without its name."""
    return frozenset(_imports(module))


def _imports(module: str) -> Iterator[str]:
    for node in ast.walk(parsed(module)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            origin = (node.module or "").removeprefix("d2rpick.")
            inside = [f"{origin}.{alias.name}".removeprefix("d2rpick.") for alias in node.names]
            yield from (name if name in MODULES else origin for name in inside)


LAYER = {folder: height for height, folders in enumerate(LAYERS) for folder in folders}
INNER = sorted(name for name in MODULES if name != "d2rpick")  # the public face stands above all


def folder(module: str) -> str:
    """Folder of a module at the root of the package."""
    return module.partition(".")[0]


def test_every_folder_has_its_layer() -> None:
    assert {folder(module) for module in INNER} == {*LAYER}


def test_a_module_imports_only_from_its_folder_and_from_lower_layers() -> None:
    inner = {*INNER}
    found = {
        (module, name)
        for module in INNER
        for name in imports(module) & inner
        if folder(name) != folder(module) and LAYER[folder(name)] >= LAYER[folder(module)]
    }
    assert not found
    assert not [module for module in INNER if "d2rpick" in imports(module)]  # the public face stands above all


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = {module: (imports(module) & {*INNER}) - {module} for module in INNER}
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


@pytest.mark.parametrize("library", RESERVED)
def test_a_library_stays_behind_its_module(library: str) -> None:
    importing = {module for module in MODULES if library in {folder(name) for name in imports(module)}}
    assert importing
    assert {folder(module) for module in importing} <= {*RESERVED[library]}


def test_only_the_command_line_prints_and_exits() -> None:
    called = {
        (module, ast.unparse(node.func))
        for module in MODULES
        if folder(module) != "cli"
        for node in ast.walk(parsed(module))
        if isinstance(node, ast.Call)
    }
    assert not {
        (module, name)
        for module, name in called
        if name in ("print", "exit", "sys.exit", "sys.stdout.write", "sys.stderr.write")
    }


def test_no_file_is_mapped_into_memory() -> None:
    """Where a mapped file is cut by another program, the system ends the process."""
    assert not [module for module in MODULES if "mmap" in imports(module)]


def loaded(*args: str) -> set[str]:
    """Modules that a call of the program has loaded by its end."""
    code = (
        "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr));"
        "from d2rpick.__main__ import main; main()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, *args], capture_output=True, text=True, check=True, cwd=ROOT, timeout=TIME_LIMIT
    )
    assert result.stdout
    return set(result.stderr.split())


@pytest.mark.parametrize(
    "args", [("--help",), ("--version",), ("suggest", "--help"), ("explore", "--help"), ("info", "--help")]
)
def test_help_and_version_load_no_numbers(args: tuple[str, ...]) -> None:
    assert not loaded(*args) & (HEAVY | {"numpy", "d2rpick.histories.history", "d2rpick.choice.suggest"})


@pytest.mark.parametrize(
    "args",
    [
        ("check", "-f", "json", DECK),
        ("rule", "D2R201"),
        ("card", "--tr", "0.02", "--td", "0.09", "--part", "1"),
        ("card", "--solver", "radioss", "--tr", "0.02", "--td", "0.09", "--node", "1", "--end", "1"),
    ],
)
def test_decks_and_cards_need_no_numbers_without_a_history(args: tuple[str, ...]) -> None:
    assert not loaded(*args) & (HEAVY | {"numpy", "d2rpick.histories.history", "d2rpick.choice.suggest"})


@pytest.mark.parametrize("source", [ENERGY, GLSTAT])
def test_suggest_loads_numpy_but_nothing_heavier(source: str) -> None:
    modules = loaded("suggest", "-q", "--td", "0.064", source)
    assert "numpy" in modules
    assert not modules & HEAVY


# What a plain table without parts, momenta or a window of td does without.
UNNEEDED = {
    f"d2rpick.{name}"
    for name in (
        "choice.suggest_td", "choice.acceptable_windows", "choice.expectation", "vibration.of_parts",
        "vibration.part_shares", "vibration.part_signs", "vibration.envelope", "vibration.lock_in_profile",
        "vibration.modes",
        "vibration.fit_several", "flight.momentum", "choice.health", "choice.judged_card",
        "deck.printing.common", "report.figures", "report.page", "report.health", "histories.formats.fixed_text",
        "histories.formats.lsda", "flight.flying_parts", "flight.momentum", "vibration.replay", "vibration.integration",
        "cli.explorer",
    )
} | {
    "pathlib", "json", "csv", "tempfile", "hashlib", "numpy.typing", "numpy.polynomial", "numpy.random",
    "array", "heapq", "unicodedata", "logging", "subprocess", "concurrent.futures", "multiprocessing", "shutil",
    "tomllib", "difflib", "zlib", "importlib.metadata", "importlib.resources", "traceback",
}  # fmt: skip
# Each module costs start-up, too: one more is worth a thought.
MOST_MODULES = 83


def test_a_plain_table_loads_only_what_its_answer_needs() -> None:
    libraries = [sys.executable, "-c", "import sys, numpy, click; print(*sys.modules)"]
    there = subprocess.run(libraries, capture_output=True, text=True, check=True, timeout=TIME_LIMIT)
    theirs = set(there.stdout.split())
    assert "d2rpick" not in theirs
    mine = loaded("suggest", "--quiet", "--td", "0.064", ENERGY) - theirs
    assert not mine & UNNEEDED
    assert len([name for name in mine if name.partition(".")[0] == "d2rpick"]) <= MOST_MODULES


def printed_by(code: str) -> str:
    """What a fresh interpreter prints."""
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT, timeout=TIME_LIMIT
    )
    return result.stdout


def test_the_package_alone_imports_nothing() -> None:
    """What typing and its like make is looked through for garbage, unless the command line comes first."""
    code = "import sys; before = {*sys.modules}; import d2rpick; print(*({*sys.modules} - before))"
    assert {*printed_by(code).split()} <= {"d2rpick", "d2rpick.version", "__future__"}


def test_no_garbage_is_looked_for_at_the_end() -> None:
    code = (
        "import atexit, gc, sys; atexit.register(lambda: print(len(gc.get_objects()) < gc.get_freeze_count()));"
        "sys.argv = ['d2rpick', '--help']; from d2rpick.__main__ import main; main()"
    )
    assert printed_by(code).splitlines()[-1] == "True"


def test_the_command_line_offers_the_formats_there_are() -> None:
    assert tuple(READERS) == options.FORMATS
    assert tuple(oscillator_files.WRITERS) == replay.FORMATS


# The result of each command that knows JSON, and the number of its schema.
SCHEMAS = [
    f"schemas/{name}.json"
    for name in (
        *("suggest-1", "explore-1", "plan-1", "parts-1", "calibrate-1", "verify-1", "info-1", "check-1", "study-1"),
        *("reproduce-2", "rollover-1"),
    )
]


def test_every_schema_is_listed() -> None:
    assert {*SCHEMAS} == {f"schemas/{path.name}" for path in (PACKAGE / "schemas").iterdir()}


@pytest.mark.parametrize("name", ["py.typed", *SCHEMAS])
def test_the_package_ships_what_is_not_code(name: str) -> None:
    assert files("d2rpick").joinpath(name).is_file()
