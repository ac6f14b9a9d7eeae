"""The command ``follow``: lines, ndjson, exit codes, and a quiet end."""

import gzip
import json
import os
import signal
from pathlib import Path

import pytest

import d2rpick as d2
from tests.command import BOX, ROOT, run, run_json, start_program

CAR = str(ROOT / "tests/data/carT01.gz")


@pytest.mark.slow
def test_once_says_what_there_is_and_whether_it_flies() -> None:
    result = run("follow", "--once", CAR)
    assert result.exit_code == 2  # the run has ended, and nothing flies
    lines = [line.split()[1] for line in result.stdout.splitlines()]
    assert lines == [
        "begun",
        "flight",
        "switch",
        "contact",
        "flight",
        "later",
        "switch",
        "contact",
        "ended",
        "state",
    ]
    assert run("follow", "--once", "--exit-zero", CAR).exit_code == 0
    assert run("follow", CAR).exit_code == 0  # the run has ended


def test_lines_of_json_are_those_of_python() -> None:
    result = run("follow", "-f", "ndjson", "--part", "box", "--for", "0", BOX)
    documents = [json.loads(line) for line in result.stdout.splitlines()]
    assert documents == [
        event_row._asdict() for event_row in d2.follow(BOX, parts="box", lasting=0)
    ]
    assert {tuple(event_row) for event_row in documents} == {
        ("event", "time", "seen", "message", "wait", "left", "tr")
    }


def test_a_run_that_flies_exits_with_0(tmp_path: Path) -> None:
    data = gzip.decompress((ROOT / "tests/data/car_all_T01.gz").read_bytes())
    (tmp_path / "carT01").write_bytes(data)
    assert (
        run("follow", "--once", "--wait", "0.005", str(tmp_path)).exit_code == 2
    )  # half of the period is longer
    rigid = gzip.decompress((ROOT / "tests/data/drop2_w123_T01.gz").read_bytes())
    (tmp_path / "carT01").write_bytes(rigid[: len(rigid) // 2])
    assert run("follow", "--once", str(tmp_path)).exit_code == 0


def test_a_loop_that_waits_for_a_flight_ends_with_the_run(tmp_path: Path) -> None:
    """A run without a listing may continue, so the loop looks again; its listing or a packed history ends it."""
    data = gzip.decompress((ROOT / "tests/data/car_all_T01.gz").read_bytes())
    (tmp_path / "carT01").write_bytes(data)
    assert run("follow", "--once", str(tmp_path)).exit_code == 1
    (tmp_path / "car_0001.out").write_text("NORMAL TERMINATION\n")
    over = run("follow", "--once", str(tmp_path))
    assert over.exit_code == 2
    assert "exit code 2: the run has ended, and the parts do not fly" in over.stderr
    assert run("follow", "--for", "0", str(tmp_path)).exit_code == 2
    assert run("follow", "--once", "--exit-zero", str(tmp_path)).exit_code == 0
    (tmp_path / "car_0001.out").write_text("ERROR TERMINATION\n")
    assert run("follow", "--once", str(tmp_path)).exit_code == 2
    assert run("follow", str(tmp_path)).exit_code == 1
    assert run("follow", "--once", str(tmp_path / "absent*")).exit_code == 2
    assert run("follow", "--once", str(tmp_path / "carT*")).exit_code == 2


def test_an_interrupt_ends_it_with_a_line(tmp_path: Path) -> None:
    data = gzip.decompress((ROOT / "tests/data/drop2_w123_T01.gz").read_bytes())
    (tmp_path / "carT01").write_bytes(data)
    with start_program("follow", "-f", "ndjson", str(tmp_path)) as process:
        assert process.stdout
        json.loads(process.stdout.readline())
        os.kill(process.pid, signal.SIGINT)
        _, errors = process.communicate()
    assert (process.returncode, errors.strip()) == (
        -signal.SIGINT,
        b"d2rpick: interrupted",
    )


def test_the_next_command_and_the_notes_name_every_restart_segment() -> None:
    """Follow reads later restart segments too, so that its command must name them; other commands mention them."""
    first, later = (
        str(ROOT / f"sample_data/oscillator_switched/OSCT0{number}.gz")
        for number in (1, 2)
    )
    last = later.replace("T02", "T03")
    followed = run("follow", "--once", first).stdout
    shown = " ".join(followed.split())
    files = (first, later, last)
    switched = " ".join(f"--switched {file}" for file in files)
    assert f"d2rpick verify {switched} REFERENCE" in shown
    note = f"{later}, {last} in the same folder were not read"
    assert any(note in text for text in run_json("info", first)["notes"])
    both = run_json("info", first, later)["notes"]
    assert any(f"{last} in the same folder was not read" in text for text in both)
    all_legs = run_json("info", first, later, last)["notes"]
    assert not any("same folder" in text for text in all_legs)
