"""The first line promises no more than the next command finds, and each next command changes something."""

import re
import shlex
from math import cos, exp, pi, sin
from pathlib import Path

import pytest

import d2rpick as d2
from tests.command import (
    ENERGY,
    GLSTAT,
    MATSUM,
    ROLLOVER,
    ROOT,
    put,
    run,
    run_json,
)
from tests.computed import locate_stored, read_starter
from tests.histories.formats.test_curves import CURVEPLOT

SAMPLES = ROOT / "sample_data"
DECK = str(SAMPLES / "rollover_box.k")
SWITCHED = str(SAMPLES / "oscillator_switched")


def list_first_lines(*arguments: str) -> dict[str, str]:
    """Return the named sentences above the first empty line of an answer, each on one line."""
    head = run(*arguments).stdout.partition("\n\n")[0]
    lines: dict[str, str] = {}
    for line in re.split(r"\n(?! )", head):
        name, _, text = line.partition("  ")
        lines[name] = " ".join(text.split())
    return lines


def read_command(step: str) -> list[str]:
    """Return the words after d2rpick of the command that a step begins with, without its hint."""
    command = step.partition(" (")[0]
    return shlex.split(command)[1:]


def test_info_asks_for_a_column_with_the_command_that_chooses_it() -> None:
    lines = list_first_lines("info", ROLLOVER)
    assert lines["record"].startswith("cannot be judged until the column")
    assert lines["next"].endswith(f"{ROLLOVER} (or another column instead of 2: 3, 4)")
    chosen = list_first_lines(*read_command(lines["next"]))
    assert chosen["record"].startswith("suitable")
    assert "choose with --energy" in run_json("info", ROLLOVER)["verdict_reason"]


def test_info_asks_for_one_of_several_curves(tmp_path: Path) -> None:
    file = put(tmp_path / "curves.txt", CURVEPLOT.replace("Internal", "Some"))
    lines = list_first_lines("info", str(file))
    assert lines["record"].startswith("cannot be judged until the column")
    assert read_command(lines["next"])[:3] == ["info", "--energy", "1"]


def test_info_leaves_the_verdict_on_the_windows_to_plan() -> None:
    for history in (ENERGY, MATSUM):
        record = list_first_lines("info", history)["record"]
        assert record.startswith("suitable for choosing times")
        assert record.endswith("(d2rpick plan judges the windows in them)")


# A run that was switched already.


def test_a_switched_run_without_a_later_window_is_compared_with_its_reference() -> None:
    step = list_first_lines("plan", SWITCHED)["next"]
    command, _, hint = step.partition(" (")
    assert hint == "the reference run instead of REFERENCE)"
    reference = str(SAMPLES / "oscillator")
    words = shlex.split(command.partition(": d2rpick ")[2])
    words[words.index("REFERENCE")] = reference
    compared = run(*words)
    assert compared.exit_code == 0, compared.stderr
    assert "comparison" in compared.stdout


@pytest.mark.parametrize(
    "options", [(), ("--td", "0.064"), ("--td-window", "0.06", "0.07")]
)
def test_explore_refuses_a_switched_run_in_the_words_of_suggest(
    options: tuple[str, ...],
) -> None:
    refusals = [run(command, *options, SWITCHED) for command in ("suggest", "explore")]
    assert [refusal.exit_code for refusal in refusals] == [2, 2]
    assert "this is a switched run" in refusals[0].stderr
    assert refusals[0].stderr == refusals[1].stderr


# A record whose pairs were all compared.


@pytest.mark.parametrize("command", ["suggest", "explore"])
def test_a_pair_that_cannot_be_used_is_not_offered_in_the_first_lines(
    command: str,
) -> None:
    lines = list_first_lines(command, "--part", "step", MATSUM)
    assert next(iter(lines)) == "do not use"
    assert {*lines} <= {"do not use", "why", "to improve", "expect", "next"}


@pytest.mark.parametrize(
    "arguments",
    [
        ("suggest", "--td", "0.3"),
        ("explore", "--td", "0.3"),
        ("verify", "--tr", "0.1", "--td", "0.3"),
        ("plan",),
    ],
)
def test_without_a_flight_every_command_leads_to_the_missing_output(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    rows = [f"{step / 1000},{(step * 37) % 101 + 1}" for step in range(400)]
    file = put(tmp_path / "run.csv", "\n".join(["time,internal_energy", *rows, ""]))
    step = list_first_lines(*arguments, str(file))["next"]
    assert step.startswith("give the end of the load as --after, or see what the run ")
    assert step.endswith(f" has to write with d2rpick info {file}")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["suggest", "explore", "plan", "parts"])
def test_when_no_pair_of_a_run_can_be_used_only_the_deck_of_a_switched_run_follows(
    command: str, tmp_path: Path
) -> None:
    deck = str(put(tmp_path / "CAR_0000.rad", read_starter("CAR")))
    question = ("--part", "1-14", "--deck", deck, locate_stored("carT01.gz"))
    step = list_first_lines(command, *question)["next"]
    assert step.startswith("no ")
    assert "can be used" in step
    if command == "parts":
        assert "d2rpick" not in step
    else:
        assert step.count("d2rpick ") == 1
        assert "d2rpick plan --min-quality poor --write-deck switched" in step


def test_a_set_of_parts_that_cannot_be_used_is_an_objection() -> None:
    question = ("parts", "--deck", DECK, "--tr", "0.01", "--td", "0.2", MATSUM)
    answer = run(*question)
    assert answer.stdout.startswith("do not use")
    assert answer.exit_code == 1
    step = list_first_lines(*question)["next"]
    assert step.startswith("no set can be used at these times; compare all flights")
    assert shlex.split(step.partition("with d2rpick ")[2])[:3] == [
        "plan",
        "--part",
        "1,2",
    ]


def test_parts_without_a_set_at_the_given_td_choose_it_themselves() -> None:
    question = ("parts", "--deck", DECK, "--td", "0.05", MATSUM)
    step = list_first_lines(*question)["next"]
    assert step.startswith("choose the times with d2rpick parts")
    words = shlex.split(step.partition("with d2rpick ")[2])
    assert run(*words).stdout.startswith("use with care")


# The page that Python writes.


def test_pages_written_by_python_name_the_next_step(tmp_path: Path) -> None:
    table = d2.parts(d2.read(MATSUM), deck=DECK)
    study = d2.study([ENERGY, GLSTAT], td=0.064)
    for answer, command in ((table, "plan"), (study, "study --td 0.0687534")):
        written = answer.report(tmp_path / "page.html").read_text("utf-8")
        assert f"d2rpick {command}" in written.rpartition("To repeat this")[0]


def write_run_with_a_rigid_window(folder: Path) -> str:
    """Write a body that is rigid from 0.02 to 0.08, is pushed from 0.1 to 0.12, and vibrates freely afterwards."""
    rows = ["time,internal_energy,kinetic_energy,x_momentum,y_momentum,z_momentum,mass"]
    for step in range(2401):
        time = step * 2.5e-4
        pushed = min(max(time - 0.1, 0.0) / 0.02, 1.0)
        momentum = 5 * (pushed - sin(2 * pi * pushed) / (2 * pi))
        if time <= 0.1:
            vibrating = time - min(max(time - 0.02, 0.0), 0.06)
            energy = 4 * cos(80 * pi * vibrating) ** 2
        elif time < 0.12:
            energy = 4 + 30 * sin(pi * pushed) ** 2
        else:
            energy = 9 * cos(80 * pi * (time - 0.12)) ** 2 * exp(-1.2 * (time - 0.12))
        columns = (time, energy, momentum**2 / 2, momentum, 0.0, 0.0, 1.0)
        rows.append(",".join(f"{value:.9g}" for value in columns))
    return str(put(folder / "run.csv", "\n".join([*rows, ""])))


def test_a_plan_after_a_switched_run_prints_the_windows_that_are_done(
    tmp_path: Path,
) -> None:
    history = write_run_with_a_rigid_window(tmp_path)
    done = str(put(tmp_path / "done.txt", "0.02 0.08\n"))
    step = list_first_lines("plan", "--done", done, history)["next"]
    assert "the cards, which also contain the windows that are done, add them" in step
    words = shlex.split(step.partition(": d2rpick ")[2].partition(" (")[0])
    card = run(*("1" if word == "IDS" else word for word in words)).stdout
    assert "Rigid from 0.02 to 0.08" in card
    first_plan = list_first_lines("plan", history)["next"]
    assert "windows that are done" not in first_plan
