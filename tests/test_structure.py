"""What must hold of the package as a whole: the direction of its imports, and what a command loads."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib.resources import files
from typing import TYPE_CHECKING

import pytest

from d2rpick.cli import options, replay
from d2rpick.readers import READERS
from d2rpick.writers import TRAJECTORY_WRITERS
from tests.command import DECK, ENERGY, GLSTAT, ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PACKAGE = ROOT / "d2rpick"

# Each module imports only from those above it.
ORDER = (
    "d2rpick", "errors", "configuration", "cards",
    "deck.source", "deck.expression", "deck.rows", "deck.parameters", "deck.card", "deck.includes", "deck.reader",
    "deck.parts", "deck.elements", "deck.switching", "deck.windows", "deck",
    "rules.base", "rules.example_decks", "rules.reading", "rules.pairs", "rules.times", "rules.switched_parts",
    "rules.energy", "rules.scope", "rules",
    "history",
    "readers.names", "readers.source", "readers.selection", "readers.printed", "readers.layout", "readers.columns",
    "readers.curves", "readers.csv_table", "readers.database", "readers.fortran", "readers.fixed_text",
    "readers.glstat", "readers.matsum", "readers.repeat", "readers.lsda", "readers.binout_states",
    "readers.binout_branch", "readers.binout", "readers.hdf5_columns", "readers.hdf5_file", "readers.radioss_th",
    "readers.companions", "readers.run", "balance", "readers.balance", "readers",
    "momentum", "crossings", "oscillator", "mode", "modes", "fitting", "fitting_several", "identify",
    "flight", "envelope", "signs", "measures", "profile", "replay", "situation",
    "cautions", "uncertainty", "contributions", "candidates", "expectation", "switched", "health", "choice", "window",
    "overview", "rules.judgement", "judged_card", "acceptable", "study", "ledger", "farm",
    "integration", "reproduction", "exhibits",
    "rollover", "rollover.model", "rollover.bars", "rollover.contact", "rollover.rigid", "rollover.motion",
    "rollover.record", "rollover.run", "rollover.scan", "rehearsal",
    "report", "report.findings", "report.rules", "report.tables", "report.situation", "report.suggestion",
    "report.verdict", "report.health", "report.overview", "report.html", "report.page",
    "report.study", "report.study_page", "report.suggestion_page", "report.verdict_page",
    "report.reproduction", "report.rollover",
    "writers", "plots",
    "cli", "cli.options", "cli.output", "cli.progress", "cli.check", "cli.rule", "cli.card",
    "cli.suggest", "cli.verify", "cli.replay", "cli.info", "cli.extract", "cli.study", "cli.reproduce", "cli.rollover",
    "__main__",
)  # fmt: skip
# The only modules that may import these.
RESERVED = {"click": "cli", "matplotlib": "plots"}
HEAVY = {"pandas", "scipy", "matplotlib", "h5py", "PIL", "jsonschema", "unittest", "numpy.testing", "numpy.f2py"}


def name_of(path: Path) -> str:
    """Name of a module within the package."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__") or "d2rpick"


MODULES = {name_of(path): path for path in PACKAGE.rglob("*.py")}


def imports(path: Path) -> Iterator[str]:
    """Names of all modules that a file imports, also for type checking, those of the package without its name."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            origin = (node.module or "").removeprefix("d2rpick.")
            inside = [f"{origin}.{alias.name}".removeprefix("d2rpick.") for alias in node.names]
            yield from (name if name in MODULES else origin for name in inside)


def test_the_order_names_every_module_once() -> None:
    assert sorted(ORDER) == sorted(MODULES)


@pytest.mark.parametrize("module", ORDER)
def test_a_module_imports_only_from_those_above_it(module: str) -> None:
    above = ORDER[: ORDER.index(module)]
    assert not {name for name in imports(MODULES[module]) if name in MODULES} - {*above}


@pytest.mark.parametrize("module", ORDER)
@pytest.mark.parametrize("library", RESERVED)
def test_a_library_stays_behind_its_module(library: str, module: str) -> None:
    imported = {name.partition(".")[0] for name in imports(MODULES[module])}
    assert library not in imported or module.partition(".")[0] == RESERVED[library]


@pytest.mark.parametrize("module", [name for name in ORDER if name.partition(".")[0] != "cli"])
def test_only_the_command_line_prints_and_exits(module: str) -> None:
    tree = ast.walk(ast.parse(MODULES[module].read_text("utf-8")))
    called = {ast.unparse(node.func) for node in tree if isinstance(node, ast.Call)}
    assert not called & {"print", "exit", "sys.exit", "sys.stdout.write", "sys.stderr.write"}


def loaded(*args: str) -> set[str]:
    """Modules that a call of the program has loaded by its end."""
    code = (
        "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr));"
        "from d2rpick.__main__ import main; main()"
    )
    result = subprocess.run([sys.executable, "-c", code, *args], capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout
    return set(result.stderr.split())


@pytest.mark.parametrize("args", [("--help",), ("--version",), ("suggest", "--help"), ("info", "--help")])
def test_help_and_version_load_no_numbers(args: tuple[str, ...]) -> None:
    assert not loaded(*args) & (HEAVY | {"numpy", "d2rpick.history", "d2rpick.choice"})


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
    assert not loaded(*args) & (HEAVY | {"numpy", "d2rpick.history", "d2rpick.choice"})


@pytest.mark.parametrize("source", [ENERGY, GLSTAT])
def test_suggest_loads_numpy_but_nothing_heavier(source: str) -> None:
    modules = loaded("suggest", "-q", "--td", "0.064", source)
    assert "numpy" in modules
    assert not modules & HEAVY


# What a plain table without parts, balance or a window of td does without.
UNNEEDED = {
    f"d2rpick.{name}"
    for name in ("window", "signs", "envelope", "profile", "modes", "fitting_several", "momentum", "health", "balance",
                 "judged_card", "cards", "plots", "report.page", "report.health", "readers.fixed_text", "readers.lsda")
} | {"pathlib", "json", "csv", "tempfile", "hashlib", "numpy.typing", "numpy.polynomial", "numpy.random"}  # fmt: skip


def test_a_plain_table_loads_only_what_its_answer_needs() -> None:
    libraries = [sys.executable, "-c", "import sys, numpy, click; print(*sys.modules)"]
    theirs = set(subprocess.run(libraries, capture_output=True, text=True, check=True).stdout.split())
    assert "d2rpick" not in theirs
    assert not (loaded("suggest", "-q", "--td", "0.064", ENERGY) - theirs) & UNNEEDED


def test_the_command_line_offers_the_formats_there_are() -> None:
    assert tuple(READERS) == options.FORMATS
    assert tuple(TRAJECTORY_WRITERS) == replay.FORMATS


SCHEMAS = [
    f"schemas/{name}-1.json" for name in ("suggest", "verify", "info", "check", "study", "reproduce", "rollover")
]


@pytest.mark.parametrize("name", ["py.typed", *SCHEMAS])
def test_the_package_ships_what_is_not_code(name: str) -> None:
    assert files("d2rpick").joinpath(name).is_file()
