"""Answers that were wrong or contradicted each other in the eyes of a stranger."""

from pathlib import Path

import pytest

from tests.command import BOX, ROOT, put, run

PLATE = ROOT / "sample_data" / "falling_plate" / "plate_0000.rad"
SOLVER = ("--starter", "ls {deck}", "--engine", "ls {deck}")


def test_a_later_restart_segment_alone_is_not_used() -> None:
    """Before, plan recommended times in the last segment of a switched run, and info called the second one switched."""
    folder = ROOT / "sample_data" / "oscillator_switched"
    for number, earlier in ((2, "OSCT01.gz; name it too"), (3, "OSCT02.gz; name them")):
        leg = str(folder / f"OSCT0{number}.gz")
        for command in (
            ("suggest",),
            ("plan",),
            ("explore",),
            ("verify", "--tr", "0.06", "--td", "0.1"),
        ):
            refusal = run(*command, leg)
            assert refusal.exit_code == 2
            assert "and the start of the run is in " in refusal.stderr
            assert earlier in refusal.stderr
        screen = " ".join(run("info", leg).stdout.split())
        assert screen.startswith("record do not use it to choose times")
        assert "next read the other restart segments too with d2rpick info " in screen


def test_a_segment_in_which_all_parts_are_rigid_is_not_used(tmp_path: Path) -> None:
    """Without the segments before it, nothing but its part output shows that it is that of a switched run."""
    packed = (ROOT / "sample_data" / "oscillator_switched" / "OSCT02.gz").read_bytes()
    leg = str(put(tmp_path / "OSCT02.gz", packed))
    refusal = run("suggest", leg)
    assert refusal.exit_code == 2
    assert "this is a switched run, whose parts are rigid throughout" in refusal.stderr
    plan = " ".join(run("plan", leg).stdout.split())
    assert plan.startswith("do not use any window of this run: it was switched")


def test_a_dry_run_refuses_the_folder_that_the_run_refuses(tmp_path: Path) -> None:
    for file in PLATE.parent.glob("*.rad"):
        put(tmp_path / file.name, file.read_bytes())
    arguments = (str(tmp_path / PLATE.name), "-o", str(tmp_path), "--part", "1")
    refusal = run("drive", *arguments, "--dry-run", *SOLVER)
    assert refusal.exit_code == 2
    assert "the folder is not empty; choose another one" in refusal.stderr
    assert "next" not in refusal.stdout


@pytest.mark.parametrize(
    "command",
    [
        ("rollover",),
        ("replay", "--stiffness", "1", "--mass", "1", "--beta", "1", "--v0", "1"),
    ],
)
def test_an_output_interval_beyond_the_run_is_refused(command: tuple[str, ...]) -> None:
    """Before, a file with a single row was written without a word."""
    refusal = run(*command, "--t-end", "0.001", "--dt", "0.01")
    assert refusal.exit_code == 2
    assert "--dt 0.01 is longer than the run, --t-end 0.001" in refusal.stderr


def test_a_release_after_the_end_of_a_replayed_run_is_refused() -> None:
    refusal = run(
        *("replay", "--stiffness", "1", "--mass", "1", "--beta", "1", "--v0", "1"),
        *("--tr", "0.006", "--td", "0.08", "--t-end", "0.01", "--dt", "0.001"),
    )
    assert refusal.exit_code == 2
    assert "--td 0.08 lies after the end of the run, --t-end 0.01" in refusal.stderr


def test_a_finished_run_is_left_to_plan_which_sees_flights_that_follow_does_not() -> (
    None
):
    """Plan shows a flight from 0.383 to the end; a running run is judged without the states that follow."""
    text = " ".join(run("follow", "--once", "--part", "box", BOX).stdout.split())
    assert "no flight since 0.382004; d2rpick plan judges the whole record" in text


def test_a_starter_deck_that_was_not_read_is_reported(tmp_path: Path) -> None:
    """Before, check of an engine file alone said that no part becomes rigid, without a finding."""
    deck = str(put(tmp_path / "plate_0001.rad", b"/RUN/plate/1\n0.4\n/RBODY/OFF\n5\n"))
    (line,) = [line for line in run("check", deck).stdout.splitlines() if "D2R" in line]
    assert "plate_0001.rad:3:1: info D2R307 the bodies that /RBODY/OFF switches" in line
    assert (
        "because the starter deck was not read; put it into the folder of this file"
        in line
    )
    put(tmp_path / "plate_0000.rad.gz", b"packed")
    assert "was not read; unpack " in run("check", deck).stdout
