"""Structure of the package: the direction of its imports, and the modules that a command loads."""

import ast
import compileall
import importlib
import platform
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from importlib.resources import files
from pathlib import Path

import pytest

from d2rpick.api import models
from d2rpick.report.history_files import OSCILLATOR_WRITERS
from tests.command import DECK, ENERGY, GLSTAT, MATSUM, ROOT, TIME_LIMIT

PACKAGE = ROOT / "d2rpick"

# Each folder imports only from itself and from the lines above its own.
LAYERS = (
    ("base",),
    ("histories", "deck"),
    ("vibration",),
    ("flight",),
    ("choice",),
    ("rules",),
    ("running",),
    ("models",),
    ("report",),
    ("api",),
    ("cli",),
    ("__main__",),
)
# The only folders that may import these libraries.
RESERVED = {"click": ("cli",), "matplotlib": ("report", "api")}  # api: for types

LAYER = {folder: height for height, folders in enumerate(LAYERS) for folder in folders}
PRINTS = re.compile(r"\b(?:print|exit|write)\(")
WRITES = re.compile(
    r"""\.(?:write_text|write_bytes|savefig|copyfile)\(|\bopen\([^)]*["']\w*[wax]\+?b?["']"""
)
SWAP = re.compile(r"\.(?:set|del)(?:attr|item)\b")
# Modules of the standard library and of numpy that slow down the start, and that an answer to a plain table does not
# need.
UNNEEDED = {
    *(
        "pathlib",
        "json",
        "csv",
        "tempfile",
        "hashlib",
        "array",
        "heapq",
        "unicodedata",
        "logging",
        "subprocess",
        "xml",
    ),
    *(
        "concurrent.futures",
        "multiprocessing",
        "shutil",
        "tomllib",
        "difflib",
        "zlib",
        "traceback",
        "unittest",
    ),
    *("importlib.metadata", "importlib.resources"),
    *(
        "numpy.ma",
        "numpy.typing",
        "numpy.polynomial",
        "numpy.random",
        "numpy.testing",
        "numpy.f2py",
    ),
}
SUGGEST = ("suggest", "--exit-zero", "--quiet", "--td")  # -q costs click difflib
BOX_HDF5 = str(ROOT / "sample_data" / "rollover_box.h5")
CARD = ("card", "--tr", "0.02", "--td", "0.09")
# The result of each command with JSON output, and the version of its schema.
SCHEMAS = [
    f"schemas/{name}.json"
    for name in (
        *(
            "suggest-2",
            "explore-2",
            "plan-1",
            "parts-1",
            "calibrate-1",
            "verify-2",
            "info-1",
            "check-1",
            "study-1",
        ),
        *("reproduce-2", "rollover-1", "drive-1"),
    )
]


def name_module(path: Path) -> str:
    """Return the name of a module within the package."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__") or "d2rpick"


MODULES = {name_module(path): path for path in PACKAGE.rglob("*.py")}


def parse_module(module: str) -> ast.Module:
    """Return the syntax tree of a module."""
    return ast.parse(MODULES[module].read_text("utf-8"))


def list_statements(module: str) -> Iterator[ast.AST]:
    """Yield all statements of a module, nested ones included, without their expressions."""
    nodes_to_visit: list[ast.AST] = [parse_module(module)]
    while nodes_to_visit:
        yield (node := nodes_to_visit.pop())
        nodes_to_visit += [
            child
            for child in ast.iter_child_nodes(node)
            if not isinstance(child, ast.expr)
        ]


@cache
def list_imports(module: str) -> frozenset[str]:
    """Return the names of all modules that a module imports, also for type checking; without the package's name."""
    return frozenset(_imports(module))


def _imports(module: str) -> Iterator[str]:
    for node in list_statements(module):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            origin = (node.module or "").removeprefix("d2rpick.")
            inside = [
                f"{origin}.{alias.name}".removeprefix("d2rpick.")
                for alias in node.names
            ]
            yield from (name if name in MODULES else origin for name in inside)


INNER = sorted(
    name for name in MODULES if name != "d2rpick"
)  # the public names are above all layers


def name_folder(module: str) -> str:
    """Return the top folder of a module in the package."""
    return module.partition(".")[0]


def test_every_folder_has_its_layer() -> None:
    assert {name_folder(module) for module in INNER} == {*LAYER}


def test_a_module_imports_only_from_its_folder_and_from_lower_layers() -> None:
    inner = {*INNER}
    wrong_imports = {
        (module, name)
        for module in INNER
        for name in list_imports(module) & inner
        if name_folder(name) != name_folder(module)
        and LAYER[name_folder(name)] >= LAYER[name_folder(module)]
    }
    assert not wrong_imports
    assert not [
        module for module in INNER if "d2rpick" in list_imports(module)
    ]  # the public names are above all layers


def test_the_command_line_knows_the_library_results_and_base_alone() -> None:
    known_folders = {
        name_folder(name)
        for module in INNER
        if name_folder(module) == "cli"
        for name in list_imports(module) & {*INNER}
    }
    assert known_folders == {"cli", "api", "report", "base"}


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = {module: (list_imports(module) & {*INNER}) - {module} for module in INNER}
    TopologicalSorter(graph).prepare()  # raises CycleError, which names the circle


@pytest.mark.parametrize("library", RESERVED)
def test_a_library_stays_behind_its_module(library: str) -> None:
    importing = {
        module
        for module in MODULES
        if library in {name_folder(name) for name in list_imports(module)}
    }
    assert importing
    assert {name_folder(module) for module in importing} <= {*RESERVED[library]}


def test_data_classes_share_their_methods() -> None:
    """Python's own decorator compiles the methods of each class at every start."""
    compiling = {
        module
        for module, path in MODULES.items()
        if re.search(
            r"from dataclasses import .*\bdataclass\b", path.read_text("utf-8")
        )
    }
    assert compiling == {"base.data_classes"}


def test_what_does_not_ship_is_imported_where_its_absence_is_told() -> None:
    importing = {
        module
        for module in MODULES
        if "validation" in {name_folder(name) for name in list_imports(module)}
    }
    assert importing == {"cli.models"}
    top = [
        ast.unparse(node)
        for node in parse_module("cli.models").body
        if not isinstance(node, ast.FunctionDef)
    ]
    assert not [text for text in top if "import" in text and "validation" in text]


def test_only_the_command_line_prints_and_exits() -> None:
    called = {
        (module, ast.unparse(node.func))
        for module, path in MODULES.items()
        if name_folder(module) != "cli" and PRINTS.search(path.read_text("utf-8"))
        for node in ast.walk(parse_module(module))
        if isinstance(node, ast.Call)
    }
    assert not {
        (module, name)
        for module, name in called
        if name in ("print", "exit", "sys.exit", "sys.stdout.write", "sys.stderr.write")
    }


def test_every_output_file_is_written_as_a_whole() -> None:
    """`write_as_a_whole` keeps the mode of a file that it replaces."""
    writing = {
        module
        for module, path in MODULES.items()
        if WRITES.search(path.read_text("utf-8"))
    }
    into_memory = {"report.figures"}
    appending = {"api.studies", "running.engine"}  # rows of a study, logs of the solver
    assert writing == {"base.files"} | into_memory | appending


def list_swapped(tree: ast.Module) -> Iterator[str]:
    """Yield the first name of each expression whose attributes or entries a test module replaces by monkeypatch."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and SWAP.search(ast.unparse(node.func)):
            yield re.findall(r"\w+", ast.unparse(node.args[0]))[0]


def test_tests_swap_names_of_the_standard_library_alone() -> None:
    """A test that replaces a name of our modules must be rewritten if the module moves."""
    sources = {path: path.read_text("utf-8") for path in (ROOT / "tests").rglob("*.py")}
    for path, tree in (
        (path, ast.parse(text)) for path, text in sources.items() if SWAP.search(text)
    ):
        froms = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        theirs = {
            name.name
            for node in froms
            if node.module in sys.stdlib_module_names
            for name in node.names
        }
        assert {*list_swapped(tree)} <= theirs | sys.stdlib_module_names, path


def test_no_file_is_mapped_into_memory() -> None:
    """If another program cuts a mapped file, the system kills the process."""
    assert not [module for module in MODULES if "mmap" in list_imports(module)]


@cache
def compile_package() -> None:
    """Write the bytecode of the package.

    Python loads `unicodedata` to compile a module with a named character.
    """
    assert compileall.compile_dir(ROOT / "d2rpick", quiet=1)


@cache
def list_loaded(*args: str) -> frozenset[str]:
    """Return the modules that a call of the program has loaded when it ends."""
    compile_package()
    code = (
        "import os, sys; os._exit = lambda _: print(*sys.modules, file=sys.stderr);"
        "from d2rpick.__main__ import main; main()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code, *args],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        timeout=TIME_LIMIT,
    )
    assert result.stdout
    # Notes and the next step come before the modules.
    return frozenset(result.stderr.splitlines()[-1].split())


@cache
def list_loaded_beside(libraries: str) -> frozenset[str]:
    """Return the modules of a process that imports only these libraries."""
    return frozenset(run_code(f"import sys, {libraries}; print(*sys.modules)").split())


def compute_share(modules: frozenset[str]) -> float:
    """Return the share of the package that these modules are, by source size [bytes]."""
    size = {name: path.stat().st_size for name, path in MODULES.items()}
    loaded = {name.removeprefix("d2rpick.") for name in modules}
    return sum(size[name] for name in loaded) / sum(size.values())


@pytest.mark.parametrize(
    ("args", "libraries", "module_limit"),
    [
        (("--help",), "click", 0.02),
        (("--version",), "click", 0.02),
        *(((command, "--help"), "click", 0.12) for command in ("suggest", "explore")),
        (("info", "--help"), "click", 0.075),
        (("check", DECK), "click", 0.175),
        (("check", "-f", "json", DECK), "click", 0.19),
        (("rule", "D2R201"), "click", 0.18),
        ((*CARD, "--part", "1"), "click", 0.105),
        ((*CARD, "--solver", "radioss", "--node", "1", "--end", "1"), "click", 0.12),
        *(
            ((*SUGGEST, "0.064", file), "click, numpy", 0.37)
            for file in (ENERGY, GLSTAT)
        ),
        (("info", MATSUM), "click, numpy", 0.25),
        (("info", BOX_HDF5), "click, numpy, h5py", 0.25),
    ],
)
def test_a_command_loads_only_what_its_answer_needs(
    args: tuple[str, ...], libraries: str, module_limit: float
) -> None:
    """No other library, and at most this share of the package: a further module must be justified."""
    libraries_beside = list_loaded_beside(libraries)
    assert "d2rpick" not in libraries_beside
    mine = list_loaded(*args) - libraries_beside
    own_modules = frozenset(name for name in mine if name_folder(name) == "d2rpick")
    assert {name_folder(name) for name in mine - own_modules} <= {
        *sys.stdlib_module_names,
        *re.findall(r"\w+", libraries),
    }
    assert compute_share(own_modules) <= module_limit


@pytest.mark.parametrize(
    "args",
    [
        (*SUGGEST, "0.064", ENERGY),
        *(
            (*asked, str(ROOT / "sample_data" / f"rollover_box{kind}"))
            for kind, asked in (
                (".matsum", ("info",)),
                *((kind, (*SUGGEST, "0.37")) for kind in (".matsum", ".binout", "T01")),
            )
        ),
    ],
)
def test_an_answer_needs_little_of_what_python_has(args: tuple[str, ...]) -> None:
    mine = list_loaded(*args) - list_loaded_beside("click, numpy")
    assert not mine & (UNNEEDED if args[-1] == ENERGY else UNNEEDED - {"array"})


@pytest.mark.parametrize(
    "args",
    [
        (*SUGGEST, "0.064", ENERGY),
        ("info", MATSUM),
        ("info", BOX_HDF5),
        ("check", DECK),
    ],
)
def test_a_quick_command_compiles_no_named_tuples(args: tuple[str, ...]) -> None:
    """Those of `typing` are compiled at every start."""
    loaded = {name.removeprefix("d2rpick.") for name in list_loaded(*args)}
    compiling = {
        module
        for module in loaded & {*MODULES}
        if re.search(
            r"from typing import .*\bNamedTuple\b", MODULES[module].read_text("utf-8")
        )
    }
    assert compiling <= {"base.tuples"}


def test_a_small_deck_needs_little_of_what_python_has() -> None:
    assert not (list_loaded("check", DECK) - list_loaded_beside("click")) & UNNEEDED


def run_code(code: str) -> str:
    """Return the output of a fresh interpreter."""
    result = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
        timeout=TIME_LIMIT,
    )
    return result.stdout


def test_reading_hdf5_starts_no_program() -> None:
    """For `platform.uname`, which h5py calls, Python would start ``uname``; what others read there stays the same."""
    pytest.importorskip("h5py")
    code = (
        "import sys; started = []\n"
        "sys.addaudithook(lambda event, args: event == 'subprocess.Popen' and started.append(args[0]))\n"
        f"import d2rpick as d2; d2.read({BOX_HDF5!r}); print(*started)\n"
        "import platform; print(platform.processor())"
    )
    assert run_code(code) == f"\n{platform.processor()}\n"


def test_the_package_alone_imports_nothing() -> None:
    """Otherwise garbage collection scans the objects of typing and the like, unless the command line comes first."""
    code = "import sys; before = {*sys.modules}; import d2rpick; print(*({*sys.modules} - before))"
    assert {*run_code(code).split()} <= {
        "d2rpick",
        "d2rpick.api",
        "d2rpick.base",
        "__future__",
    }


def test_objects_are_not_deleted_at_the_end() -> None:
    """What libraries have registered for the end is done, and the exit code is that of the command."""
    code = (
        "import atexit, sys; import d2rpick.cli as cli\n"
        "class Kept:\n"
        "    def __del__(self): print('deleted')\n"
        "cli.kept = Kept()\n"
        "atexit.register(print, 'skipped')\n"
        "parse = cli._CommandGroup.parse_args\n"
        "cli._CommandGroup.parse_args = lambda *a: (atexit.register(print, 'done'), parse(*a))[1]\n"
        "sys.argv = ['d2rpick', 'nothing']; from d2rpick.__main__ import main; main()"
    )
    result = subprocess.run(
        [sys.executable, "-c", code],
        check=False,
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=TIME_LIMIT,
    )
    assert (result.returncode, result.stdout) == (2, "done\n"), result.stderr


def test_the_command_line_offers_the_formats_of_models_there_are() -> None:
    assert tuple(OSCILLATOR_WRITERS) == models.HISTORIES


def test_every_schema_is_listed() -> None:
    assert {*SCHEMAS} == {
        f"schemas/{path.name}" for path in (PACKAGE / "schemas").iterdir()
    }


@pytest.mark.parametrize("name", ["py.typed", *SCHEMAS])
def test_the_package_ships_what_is_not_code(name: str) -> None:
    assert files("d2rpick").joinpath(name).is_file()


def test_the_programs_inside_benchmarks_import_names_that_exist() -> None:
    """A benchmark starts other processes with a program in a text, which no type checker reads."""
    imports = [
        (benchmark.name, module, name.strip().split(" as ")[0])
        for benchmark in sorted((ROOT / "tests" / "benchmarks").glob("*.py"))
        for module, names in re.findall(
            r"from (d2rpick[\w.]*) import ([\w, ]+)", benchmark.read_text("utf-8")
        )
        for name in names.split(",")
    ]
    assert len(imports) > 20
    missing = [
        (benchmark, module, name)
        for benchmark, module, name in imports
        if not hasattr(importlib.import_module(module), name)
        and f"{module}.{name}".removeprefix("d2rpick.") not in MODULES
    ]
    assert not missing
