"""The tests need only the repository: what modules may name, what tests may open, and where the data come from."""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.alone import ROOT, WATCH, is_beside
from tests.computed import DATA
from tests.real.files import REAL

FOREIGN = str(REAL / "glstat")
HOME, TEMPORARY = Path("/home/one"), Path(tempfile.gettempdir())


def test_no_test_names_what_lies_beside_the_clone() -> None:
    modules = [path.relative_to(ROOT) for path in (ROOT / "tests").rglob("*.py")]
    judged = [
        module_name
        for module_name in modules
        if module_name.parts[1] != "real"
        and module_name.stem not in ("alone", "test_alone")
    ]
    assert len(judged) > 100
    for module in judged:
        text = (ROOT / module).read_text("utf-8")
        assert not re.findall(
            r"""["'/]shared["'/]|D2RPICK_REAL|mark\.real|ROOT\.parent""", text
        ), module
        climbs = re.findall(r"__file__\)(?:\.resolve\(\))?\.parents\[(\d+)\]", text)
        assert all(int(up) < len(module.parts) for up in climbs), module


@pytest.mark.parametrize(
    ("name", "root", "outside_path"),
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
def test_what_lies_beside_the_clone(
    name: str | Path, root: Path, outside_path: bool
) -> None:
    assert is_beside(str(name), root) is outside_path


def test_what_lies_beside_the_clone_cannot_be_opened() -> None:
    ways: list[Callable[[Path], object]] = [
        Path.read_bytes, os.listdir, os.scandir, lambda path: subprocess.run(["cat", path], check=False),
    ]  # fmt: skip
    for open_path in ways:
        with pytest.raises(AssertionError, match="lies beside the clone"):
            open_path(Path(FOREIGN))
    assert WATCH.opened == [FOREIGN] * len(ways)
    WATCH.opened.clear()


def test_each_file_of_the_data_has_a_line_that_says_what_wrote_it() -> None:
    """All files must be small too."""
    files = {
        str(path.relative_to(DATA)): path.stat().st_size
        for path in DATA.rglob("*")
        if path.is_file()
    }
    files_in_table = re.findall(
        r"^\| `(.+?)` \| .+ \| .+ \|$",
        (DATA / "README.md").read_text("utf-8"),
        re.MULTILINE,
    )
    assert sorted(files_in_table) == sorted(files.keys() - {"README.md"})
    assert sum(files.values()) < 2_000_000
