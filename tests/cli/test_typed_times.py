"""Times as people type them: with the unit after the number, read in the unit of the run, or refused."""

import json
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.histories.digits import convert_to_unit, parse_seconds
from tests.command import ENERGY, read_refusal, run

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0}


def written_in(folder: Path, unit: str) -> str:
    """Write the history of the oscillator with times in a unit that the column names."""
    time, energy = np.loadtxt(
        ENERGY, delimiter=",", skiprows=1, usecols=(0, 5), unpack=True
    )
    numbers = np.column_stack([np.round(time / UNITS[unit], 9), energy])
    name = str(folder / f"energy_{unit}.csv")
    np.savetxt(
        name, numbers, delimiter=",", header=f"time_{unit},internal_energy", comments=""
    )
    return name


def answered(*words: str) -> dict[str, Any]:
    """Return the answer as JSON without the command that was typed."""
    document: dict[str, Any] = json.loads(run(*words, "-f", "json").stdout)
    assert document.pop("command")
    return document


@pytest.mark.parametrize(
    ("unit", "number"), [("s", "0.064"), ("ms", "64"), ("us", "64000")]
)
@pytest.mark.parametrize(
    "typed", ["64ms", "64 ms", "0.064s", "64000us", "64000µs", "6.4e-2 s"]
)
def test_a_time_with_its_unit_is_the_number_in_the_unit_of_the_record(
    tmp_path: Path, unit: str, number: str, typed: str
) -> None:
    name = written_in(tmp_path, unit)
    wanted = run("suggest", "--td", number, "-f", "value", name).stdout
    assert wanted
    assert run("suggest", "--td", typed, "-f", "value", name).stdout == wanted


@pytest.mark.parametrize(
    ("words", "same"),
    [
        ("verify --tr 13.5867ms --td 68.7534ms", "verify --tr 0.0135867 --td 0.0687534"),
        ("suggest --td-window 60ms 70ms", "suggest --td-window 0.06 0.07"),
        ("suggest --td-window 60ms 0.07", "suggest --td-window 0.06 0.07"),
        (
            "verify --tr 0.0135867 --td 0.0687534 --after 2ms --landing 0.14s --margin 500us",
            "verify --tr 0.0135867 --td 0.0687534 --after 0.002 --landing 0.14 --margin 0.0005",
        ),
        ("plan --min-rigid 10ms", "plan --min-rigid 0.01"),
        ("explore --steps 5 --td 64ms", "explore --steps 5 --td 0.064"),
    ],
)  # fmt: skip
def test_every_time_of_a_command_may_have_its_unit(
    tmp_path: Path, words: str, same: str
) -> None:
    name = written_in(tmp_path, "s")
    assert answered(*words.split(), name) == answered(*same.split(), name)


def test_a_card_takes_the_unit_of_its_history(tmp_path: Path) -> None:
    name = written_in(tmp_path, "ms")
    about = ("--part", "1", "--history", name)
    typed = run("card", "--tr", "13586.7us", "--td", "0.0687534s", *about)
    assert (
        typed.stdout == run("card", "--tr", "13.5867", "--td", "68.7534", *about).stdout
    )


def test_a_study_takes_the_unit_that_all_its_runs_have(tmp_path: Path) -> None:
    in_seconds, in_milliseconds = (written_in(tmp_path, unit) for unit in ("s", "ms"))
    typed = answered("study", "--td", "64ms", in_seconds)
    assert typed == answered("study", "--td", "0.064", in_seconds)
    line = read_refusal("study", "--td", "64ms", in_seconds, in_milliseconds)
    assert "give 0.064 if it is s, 64 if it is ms" in line


def test_limits_hold_for_a_time_with_its_unit(tmp_path: Path) -> None:
    name = written_in(tmp_path, "ms")
    line = read_refusal("suggest", "--td", "64ms", "--margin=-1ms", name)
    assert "--margin" in line
    assert "-1.0 was found, but a number of at least 0 was expected" in line


@pytest.mark.parametrize(
    "words",
    [
        f"suggest --td 64ms {ENERGY}",
        "card --tr 1ms --td 64ms --part 1",
        "replay --stiffness 1 --mass 1 --beta 1 --v0 1 --dt 1 --t-end 64ms",
    ],
)
def test_without_a_unit_of_the_record_the_number_to_give_is_named(words: str) -> None:
    line = read_refusal(*words.split())
    assert "the unit of time is not known from" in line
    assert "if it is s, " in line
    assert "if it is ms" in line


@pytest.mark.parametrize(
    "typed", ["64mm", "ms", "64ms2", "6,4ms", "0x4s", "64 m s", "nan s"]
)
def test_what_is_no_time_is_refused(tmp_path: Path, typed: str) -> None:
    assert "is not a number" in read_refusal(
        "suggest", "--td", typed, written_in(tmp_path, "s")
    )


@given(
    st.decimals(0, 10**6, places=6, allow_nan=False),
    st.sampled_from([*UNITS]),
    st.sampled_from([*UNITS]),
)
def test_units_change_a_time_by_their_sizes_alone(
    number: Decimal, typed: str, unit: str
) -> None:
    text = f"{number}{typed}"
    assert convert_to_unit(text, typed) == float(number)
    found = convert_to_unit(text, unit)
    assert found is not None
    assert found == pytest.approx(float(number) * UNITS[typed] / UNITS[unit], rel=1e-12)
    seconds = parse_seconds(text)
    assert seconds is not None
    assert convert_to_unit(f"{seconds}s", unit) == found
