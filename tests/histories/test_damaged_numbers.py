"""A number that cannot be read is an error in every column that d2rpick uses, and never a missing quantity."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.base.errors import DamageError
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from tests.command import MATSUM, run
from tests.histories.test_contact_forces import ENERGY, rcforc, rwforc
from tests.histories.test_node_listings import list_nodes

if TYPE_CHECKING:
    from collections.abc import Callable

SAMPLE = Path(MATSUM)
# Line numbers of a state in the middle of the sample.
PART, MOMENTUM = 2321, 2322


def replace_line(text: bytes, number: int, change: Callable[[bytes], bytes]) -> bytes:
    """Return the text with one line replaced; lines are counted from 1."""
    lines = text.split(b"\n")
    lines[number - 1] = change(lines[number - 1])
    return b"\n".join(lines)


CHANGES = {
    "a lost line": lambda _: b"garbage",
    "a lost value": lambda line: re.sub(rb"(\d\.\d{4}E\+)\d\d", rb"\g<1>01****", line, count=1),
    "an overflow": lambda line: re.sub(rb"   \d\.\d{4}E\+\d\d", b"*" * 13, line, count=1),
}  # fmt: skip


@pytest.mark.parametrize("with_glstat", [False, True])
@pytest.mark.parametrize("line", [PART, MOMENTUM])
@pytest.mark.parametrize("change", CHANGES)
def test_a_damaged_line_of_a_matsum_is_refused_with_its_number(
    change: str, line: int, with_glstat: bool, tmp_path: Path
) -> None:
    """Before, all momenta were dropped without a message, and another flight was found."""
    damaged = replace_line(SAMPLE.read_bytes(), line, CHANGES[change])
    (tmp_path / "matsum").write_bytes(damaged)
    if with_glstat:
        glstat = SAMPLE.with_suffix(".glstat").read_bytes()
        (tmp_path / "glstat").write_bytes(glstat)
    for command in ("plan", "info"):
        answer = run(command, str(tmp_path))
        # The overview gives a damaged energy as a reason; a damaged momentum is an error everywhere.
        assert answer.exit_code == 2 or (command == "info" and line == PART)
        assert f"matsum:{line}:" in "".join(answer.output.split())


@pytest.mark.parametrize("state", [0, -1])
def test_a_damaged_line_in_the_first_or_last_state_is_refused(
    state: int, tmp_path: Path
) -> None:
    lines = SAMPLE.read_bytes().split(b"\n")
    momenta = [number for number, line in enumerate(lines, 1) if b"x-mom" in line]
    number = momenta[0] if state == 0 else momenta[-1]
    damaged = replace_line(SAMPLE.read_bytes(), number, lambda _: b"garbage")
    (tmp_path / "matsum").write_bytes(damaged)
    answer = run("plan", str(tmp_path))
    assert answer.exit_code == 2
    assert f"matsum:{number}: 'garbage' was found" in answer.stderr


def test_a_matsum_without_momenta_is_read(tmp_path: Path) -> None:
    text = re.sub(rb" [xyz]-(?:mom|rbv)=.*\n", b"", SAMPLE.read_bytes())
    (tmp_path / "matsum").write_bytes(text)
    opened = open_run([str(tmp_path / "matsum")])
    assert opened.momenta(None, None) == ()
    assert run("info", str(tmp_path)).exit_code == 0


@pytest.mark.parametrize(
    ("label", "is_used"), [(b" kinetic energy", True), (b" time step", False)]
)
def test_a_damaged_line_of_a_glstat_is_refused_if_it_is_used(
    label: bytes, is_used: bool, tmp_path: Path
) -> None:
    lines = SAMPLE.with_suffix(".glstat").read_bytes().split(b"\n")
    middle = len(lines) // 2
    number = next(
        number
        for number, line in enumerate(lines, 1)
        if number > middle and line.startswith(label)
    )
    lines[number - 1] = b"garbage"
    path = tmp_path / "glstat"
    path.write_bytes(b"\n".join(lines))
    opened = open_run([str(path)])
    assert opened.history(Selection()).time.size
    with pytest.raises(DamageError, match=f"glstat:{number}: 'garbage' was found"):
        opened.databases[0].channel(label.decode().strip())
    answer = run("suggest", "--td", "0.37", str(path))
    assert answer.exit_code == (2 if is_used else 0)


@pytest.mark.parametrize(
    ("found", "is_damaged"),
    [("4.4669E+01****", True), ("garbage", True), ("n/a", False), ("", False)],
)
def test_a_damaged_momentum_in_a_table_is_refused(
    found: str, is_damaged: bool, tmp_path: Path
) -> None:
    time = np.linspace(0.0, 0.2, 41).tolist()
    rows = [f"{moment:.4f},{moment * 3:.4f},5.0,1.0,2.0,3.0" for moment in time]
    rows[20] = f"{time[20]:.4f},1.5,5.0,{found},2.0,3.0"
    head = "time,internal_energy,kinetic_energy,x_momentum,y_momentum,z_momentum"
    path = tmp_path / "run.csv"
    path.write_text("\n".join([head, *rows, ""]))
    opened = open_run([str(path)])
    if is_damaged:
        expected = f"run.csv:22: 'x_momentum' is '{re.escape(found)}'"
        with pytest.raises(DamageError, match=expected):
            opened.momenta(None, None)
    else:
        opened.momenta(None, None)
        assert any(
            "'x_momentum' was left out: line 22" in note for note in opened.notes
        )


@pytest.mark.parametrize("change", ["a lost line", "a lost value"])
@pytest.mark.parametrize("content", [rcforc(), rwforc()], ids=["rcforc", "rwforc"])
def test_a_damaged_force_is_refused(
    content: bytes, change: str, tmp_path: Path
) -> None:
    """Before, the line was left out without a message."""
    number = content.count(b"\n") // 2
    name = "rwforc" if b"normal-force" in content else "rcforc"
    changes = {
        "a lost line": lambda _: b"garbage",
        "a lost value": lambda line: line.replace(b"E+00", b"E+**"),
    }
    (tmp_path / name).write_bytes(replace_line(content, number, changes[change]))
    (tmp_path / "glstat").write_bytes(ENERGY)
    with pytest.raises(DamageError, match=f"{name}:{number}: "):
        open_run([str(tmp_path)])


@pytest.mark.parametrize("found", [b"garbage", b"        11  1.0E+** 1.0E+00 1.0E+00"])
def test_a_damaged_node_is_refused(found: bytes, tmp_path: Path) -> None:
    content = list_nodes()
    number = content[: content.index(b"\n       11 ")].count(b"\n") + 2
    (tmp_path / "nodout").write_bytes(replace_line(content, number, lambda _: found))
    (tmp_path / "energy.csv").write_text("time,internal_energy\n0,1\n0.1,2\n0.2,1\n")
    opened = open_run([str(tmp_path / name) for name in ("energy.csv", "nodout")])
    with pytest.raises(DamageError, match=f"nodout:{number}: "):
        opened.displacements([7])
