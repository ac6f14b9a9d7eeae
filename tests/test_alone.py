"""The suite stands alone: what its modules may name, what they may open, and where its data come from."""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.alone import ROOT, WATCH, is_beside
from tests.command import ENERGY, run
from tests.computed import DATA
from tests.real.files import REAL

FOREIGN = str(REAL / "glstat")
HOME, TEMPORARY = Path("/home/one"), Path(tempfile.gettempdir())
SWALLOWED = """
import pytest
from contextlib import suppress

def test_swallowed():
    with suppress(BaseException):
        open(FOREIGN)

@pytest.mark.real
def test_free():
    with suppress(OSError):
        open(FOREIGN)
"""


def test_no_test_names_what_lies_beside_the_clone() -> None:
    modules = [path.relative_to(ROOT) for path in (ROOT / "tests").rglob("*.py")]
    judged = [one for one in modules if one.parts[1] != "real" and one.stem not in ("alone", "test_alone")]
    assert len(judged) > 100
    for module in judged:
        text = (ROOT / module).read_text("utf-8")
        assert not re.findall(r"""["'/]shared["'/]|D2RPICK_REAL|mark\.real|ROOT\.parent""", text), module
        climbs = re.findall(r"__file__\)(?:\.resolve\(\))?\.parents\[(\d+)\]", text)
        assert all(int(up) < len(module.parts) for up in climbs), module


@pytest.mark.parametrize(
    ("name", "root", "beside"),
    [
        (FOREIGN, ROOT, True),
        (str(REAL), HOME / "d2rpick", True),
        (ROOT / "tests", ROOT, False),
        (HOME / "shared" / "glstat", HOME / "d2rpick", True),
        (HOME / "d2rpick" / ".." / "glstat", HOME / "d2rpick", True),
        (HOME / "d2rpick-2" / "tests", HOME / "d2rpick", True),
        (HOME / ".cache" / "fonts", HOME / "d2rpick", False),
        (HOME, HOME / "d2rpick", False),
        (HOME.with_name("two") / "glstat", HOME / "d2rpick", False),
        (TEMPORARY / "made" / "glstat", TEMPORARY / "d2rpick", False),
        (TEMPORARY / "alone" / "glstat", TEMPORARY / "alone" / "d2rpick", True),
        (Path(sys.prefix, "bin"), Path(sys.prefix).with_name("d2rpick"), False),
        ("/etc/fonts", Path("/d2rpick"), False),
    ],
)
def test_what_lies_beside_the_clone(name: str | Path, root: Path, beside: bool) -> None:
    assert is_beside(str(name), root) is beside


def test_what_lies_beside_the_clone_cannot_be_opened() -> None:
    ways: list[Callable[[Path], object]] = [
        Path.read_bytes, os.listdir, os.scandir, lambda path: subprocess.run(["cat", path], check=False),
    ]  # fmt: skip
    for way in ways:
        with pytest.raises(AssertionError, match="lies beside the clone"):
            way(Path(FOREIGN))
    assert WATCH.opened == [FOREIGN] * len(ways)
    WATCH.opened.clear()


def pytest_of(*args: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run pytest with the plugin in a process of its own."""
    command = [sys.executable, "-m", "pytest", "-p", "tests.alone", *args]
    env = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    return subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False)


def test_a_test_that_swallows_the_error_fails_and_one_of_files_of_others_is_free(tmp_path: Path) -> None:
    suite, others = tmp_path / "suite", tmp_path / "others"
    suite.mkdir()
    others.mkdir()
    foreign = str(others / "glstat")
    (suite / "test_swallowed.py").write_text(SWALLOWED.replace("FOREIGN", repr(foreign)))
    (suite / "test_imported.py").write_text(f"open({foreign!r})")
    (suite / "pytest.ini").write_text("[pytest]\nmarkers = real\n")
    found = pytest_of("--continue-on-collection-errors", str(suite), D2RPICK_REAL=str(others))
    assert found.returncode == 1, found.stdout
    assert "ERROR collecting test_imported.py" in found.stdout
    assert f"opened beside the clone: {foreign}" in found.stdout
    assert "2 passed, 2 errors" in found.stdout


def test_one_line_says_how_many_tests_are_left_out(tmp_path: Path) -> None:
    told = []
    for processes in ("-n0", "-n2"):
        found = pytest_of(processes, "tests/real", "tests/base/test_errors.py", D2RPICK_REAL=str(tmp_path / "absent"))
        assert found.returncode == 0, found.stdout
        told += [line for line in found.stdout.splitlines() if "left out" in line]
    assert len(told) == 2
    assert told[0] == told[1]
    assert int(told[0].split()[0]) > 200


def test_each_file_of_the_data_has_a_line_that_says_what_wrote_it() -> None:
    """And all of them are small."""
    files = {str(path.relative_to(DATA)): path.stat().st_size for path in DATA.rglob("*") if path.is_file()}
    told = re.findall(r"^\| `(.+?)` \| .+ \| .+ \|$", (DATA / "README.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(told) == sorted(files.keys() - {"README.md"})
    assert sum(files.values()) < 2_000_000


def test_a_command_is_asked_again_where_it_wrote_a_file_or_one_has_changed(tmp_path: Path) -> None:
    whole, file, written = Path(ENERGY).read_bytes(), tmp_path / "run.csv", tmp_path / "written.csv"
    file.write_bytes(whole)
    before = run("info", str(file))
    assert run("info", str(file)) is before
    file.write_bytes(whole[:-1000])
    assert run("info", str(file)).stdout != before.stdout
    for _ in range(2):
        assert run("extract", str(file), "-o", str(written)).exit_code == 0
        written.unlink()  # it is there
