"""Binouts from other people, compared with independent readings."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.base.errors import FormatError
from d2rpick.choice.parts.sets_of_parts import compare_sets_of_parts
from d2rpick.choice.question import Settings
from d2rpick.histories.opening import Selection, open_run
from tests.histories.formats.test_binout import open_binout
from tests.real.files import content, real, rows_of

R7 = "lasso-python__sph_models-R7_1_2-binout"
R12 = "lasso-python__sph_models-R12_2_1-binout"
ANSYS = "ansys-example-data__result_files-binout-binout_glstat"
PLADE = "dyna_pladebuk__Plade_300_150_4-BB-binout"


# As read by lasso-python 2.0.4, for the whole model if no part is named; states are counted from 0.
NUMBERS = rows_of("numbers_of_lasso")


@pytest.mark.parametrize("file", [R7, R12, ANSYS, PLADE])
def test_real_files_have_the_numbers_of_lasso(file: str) -> None:
    run = open_binout(content(file))
    assert run.complete
    assert not run.notes
    rows = [row for row in NUMBERS if row["file"] == file]
    assert rows
    for row in rows:
        name, part = row["variable"], row["part"]
        time = run.part_time if part else run.time
        values = (
            run.part_channel(name, [int(part)])[:, 0]
            if part
            else time
            if name == "time"
            else run.channel(name)
        )
        assert time.size == int(row["states"])
        assert values[int(row["state"])] == float(row["number"])


@pytest.mark.parametrize("file", [R7, R12, ANSYS])
def test_real_glstat_prints_as_the_solvers_own_converter_printed_it(file: str) -> None:
    text = content(f"{file}.l2a-glstat").decode("latin-1")
    run = open_binout(content(file))
    for label, column in (
        ("time..", run.time),
        ("internal energy..", run.channel("internal_energy")),
    ):
        lines = [line for line in text.splitlines() if line.startswith(f" {label}")]
        np.testing.assert_allclose(
            column, [float(line[32:46]) for line in lines], rtol=6e-6
        )


def test_titles_belong_to_ids_not_to_places() -> None:
    """R7 lists legend_ids 101, 1 beside ids 1, 101; only part 1 has a title (l2a, d3hsp)."""
    run = open_binout(content(R7))
    assert [(part.id, part.title) for part in run.parts] == [
        (1, "null shells for visualization"),
        (101, ""),
    ]


def test_a_branch_that_is_missing_is_named_with_those_there_are() -> None:
    run = open_binout(content(ANSYS))
    with pytest.raises(FormatError, match="no matsum in it, but glstat, rwforc;"):
        _ = run.part_time


def test_half_a_real_file_keeps_the_states_of_that_half() -> None:
    whole = content(R7)
    half = open_binout(whole[: len(whole) // 2])
    assert half.time.tolist() == open_binout(whole).time[:44].tolist()
    assert not half.complete


def test_masses_come_from_the_velocities_of_parts() -> None:
    run = open_run([real(f"histories/{R12}")], Selection()).masses
    assert run is not None
    assert run.shape == (2,)


def test_parts_of_a_run_in_which_nothing_deforms_are_kept() -> None:
    part_answer = compare_sets_of_parts(
        open_run([real(f"histories/{PLADE}")]), Settings(), None
    )
    assert [row.verdict for row in part_answer.rows] == ["keep"] * 3
    assert part_answer.facts.reason
