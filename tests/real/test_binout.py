"""binouts of others against independent readings."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.choice.sets_of_parts import parts_of
from d2rpick.choice.settings import Settings
from d2rpick.errors import FormatError
from d2rpick.histories.opening import Selection, open_run
from tests.histories.formats.test_binout import opened
from tests.real.files import content, real

R7 = "lasso-python__sph_models-R7_1_2-binout"
R12 = "lasso-python__sph_models-R12_2_1-binout"
ANSYS = "ansys-example-data__result_files-binout-binout_glstat"
PLADE = "dyna_pladebuk__Plade_300_150_4-BB-binout"


# file, states, and (channel, state from 0, number) as read by lasso-python 2.0.4
REAL = [
    (
        R7,
        88,
        [
            ("time", 29, 0.011556635610759258),
            ("time", 87, 0.03478036820888519),
            ("internal_energy", 29, 2.354290008544922),
            ("internal_energy", 87, 2.3515756130218506),
            ("kinetic_energy", 29, 0.05295228958129883),
            ("kinetic_energy", 87, 0.02301497384905815),
            ("total_energy", 29, 3.2359681129455566),
            ("total_energy", 87, 3.2033164501190186),
        ],
    ),
    (
        R12,
        88,
        [
            ("time", 29, 0.011546461842954159),
            ("time", 87, 0.03475764021277428),
            ("internal_energy", 29, 2.22947359085083),
            ("internal_energy", 87, 2.214017152786255),
            ("kinetic_energy", 29, 0.04136256128549576),
            ("kinetic_energy", 87, 0.028207609429955482),
            ("total_energy", 29, 3.2737159729003906),
            ("total_energy", 87, 3.2451043128967285),
        ],
    ),
    (
        ANSYS,
        251,
        [
            ("time", 250, 0.0004991799360141158),
            ("time", 83, 0.00016450893599539995),
            ("internal_energy", 250, 1540881.25),
            ("internal_energy", 83, 39879.37109375),
            ("kinetic_energy", 250, 22700.0),
            ("kinetic_energy", 83, 2176.817626953125),
            ("total_energy", 250, 1561572.125),
            ("total_energy", 83, 41657.37109375),
        ],
    ),
    (
        PLADE,
        1,
        [("time", 0, 0.0), ("internal_energy", 0, 2e-20), ("kinetic_energy", 0, 0.0), ("total_energy", 0, 2e-20)],
    ),
]
REAL_PARTS = [
    (
        R7,
        88,
        [
            ("internal_energy", 1, 44, 0.0),
            ("internal_energy", 101, 87, 2.3515756130218506),
            ("kinetic_energy", 1, 44, 0.0),
            ("kinetic_energy", 101, 87, 0.023007895797491074),
            ("z_momentum", 1, 44, 0.0),
            ("z_momentum", 101, 87, 0.0),
        ],
    ),
    (
        R12,
        88,
        [
            ("internal_energy", 1, 44, 0.0),
            ("internal_energy", 101, 87, 2.214017152786255),
            ("kinetic_energy", 1, 44, 0.0),
            ("kinetic_energy", 101, 87, 0.028207458555698395),
            ("z_momentum", 1, 44, 0.0),
            ("z_momentum", 101, 87, 0.0),
            ("total_kinetic_energy", 1, 44, 0.0),
            ("total_kinetic_energy", 101, 87, 0.028207458555698395),
        ],
    ),
    (
        PLADE,
        1,
        [
            ("internal_energy", 1, 0, 0.0),
            ("internal_energy", 2, 0, 0.0),
            ("internal_energy", 3, 0, 0.0),
            ("kinetic_energy", 1, 0, 0.0),
            ("kinetic_energy", 2, 0, 0.0),
            ("kinetic_energy", 3, 0, 0.0),
            ("z_momentum", 1, 0, 0.0),
            ("z_momentum", 2, 0, 0.0),
            ("z_momentum", 3, 0, 0.0),
            ("total_kinetic_energy", 1, 0, 0.0),
            ("total_kinetic_energy", 2, 0, 0.0),
            ("total_kinetic_energy", 3, 0, 0.0),
        ],
    ),
]


@pytest.mark.parametrize(("file", "states", "numbers"), REAL)
def test_real_glstat_has_the_numbers_of_lasso(file: str, states: int, numbers: list[tuple[str, int, float]]) -> None:
    run = opened(content(file))
    assert run.time.shape == (states,)
    assert run.complete
    assert not run.notes
    for name, state, number in numbers:
        column = run.time if name == "time" else run.channel(name)
        assert column[state] == number


@pytest.mark.parametrize(("file", "states", "numbers"), REAL_PARTS)
def test_real_matsum_has_the_numbers_of_lasso(
    file: str, states: int, numbers: list[tuple[str, int, int, float]]
) -> None:
    run = opened(content(file))
    assert run.part_time.shape == (states,)
    for name, id_, state, number in numbers:
        assert run.part_channel(name, [id_])[state, 0] == number


@pytest.mark.parametrize("file", [R7, R12, ANSYS])
def test_real_glstat_prints_as_the_solvers_own_converter_printed_it(file: str) -> None:
    text = content(f"{file}.l2a-glstat").decode("latin-1")
    run = opened(content(file))
    for label, column in (("time..", run.time), ("internal energy..", run.channel("internal_energy"))):
        lines = [line for line in text.splitlines() if line.startswith(f" {label}")]
        np.testing.assert_allclose(column, [float(line[32:46]) for line in lines], rtol=6e-6)


def test_titles_belong_to_ids_not_to_places() -> None:
    """R7 lists legend_ids 101, 1 beside ids 1, 101; only part 1 has a title (l2a, d3hsp)."""
    run = opened(content(R7))
    assert [(part.id, part.title) for part in run.parts] == [(1, "null shells for visualization"), (101, "")]


def test_a_real_file_without_energies_is_refused_with_what_there_is() -> None:
    with pytest.raises(FormatError, match="no glstat or matsum in it, but swforc;"):
        opened(content("qd-cae-python__test-binout"))


def test_a_branch_that_is_missing_is_named_with_those_there_are() -> None:
    run = opened(content(ANSYS))
    with pytest.raises(FormatError, match="no matsum in it, but glstat, rwforc;"):
        _ = run.part_time


def test_half_a_real_file_keeps_the_states_of_that_half() -> None:
    whole = content(R7)
    half = opened(whole[: len(whole) // 2])
    assert half.time.tolist() == opened(whole).time[:44].tolist()
    assert not half.complete


def test_masses_come_from_the_velocities_of_parts() -> None:
    found = open_run([real(f"histories/{R12}")], Selection()).masses
    assert found is not None
    assert found.shape == (2,)


def test_parts_of_a_run_in_which_nothing_deforms_are_kept() -> None:
    found = parts_of(open_run([real(f"histories/{PLADE}")]), Settings(), None)
    assert [row.verdict for row in found.rows] == ["keep"] * 3
    assert found.facts.reason
