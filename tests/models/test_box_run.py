"""The recommendations for 21 structures with many modes, compared with a scan over tr."""

from dataclasses import replace
from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import make_history, simulate
from d2rpick.report.history_files import BOX_WRITERS
from tests.energies import require
from tests.faults import choose_some
from tests.rehearsals import SETS, rehearse

# The suite uses coarse boxes; tests/benchmarks/rollover.py runs the original sets.
MESH, INTERVAL, EVERY = 4, 3e-4, 18


@pytest.mark.slow
@pytest.mark.parametrize("number", choose_some(range(len(SETS)), 14))
def test_the_recommended_tr_rolls_right_and_brings_the_energy_back_that_is_announced(
    number: int, tmp_path: Path
) -> None:
    coarse = replace(SETS[number], mesh=MESH)
    rehearsal = rehearse(coarse, tmp_path, stride=EVERY, interval=INTERVAL)
    assert rehearsal.flight[2] == "momentum"
    assert rehearsal.roll_share < 0.1
    assert abs(rehearsal.energy_off) < 0.25
    pair = require(
        suggest_in_history(
            make_history(rehearsal.reference), rehearsal.td, Settings()
        ).recommended
    )
    # if the printed digits of a matsum leave its start uncertain by 1 ms, another crossing may come first
    released = require(rehearsal.reference.released)
    assert min(pair.tr, require(rehearsal.tr)) >= released - INTERVAL


def test_a_run_and_its_matsum_have_one_answer(tmp_path: Path) -> None:
    """The step vibrates together with the box, which both answers have to take into account."""
    record = simulate(Parameters(mesh=MESH), 0.42, interval=INTERVAL)
    matsum = tmp_path / "matsum"
    matsum.write_bytes(BOX_WRITERS["matsum"](record))
    of_file = d2.suggest(d2.read(str(matsum)), td=0.35, parts="box")
    of_record = suggest_in_history(make_history(record), 0.35, Settings())
    assert of_file.basis == of_record.situation.basis
    assert require(of_record.recommended).tr == pytest.approx(
        require(of_file.recommended).tr, abs=INTERVAL
    )
