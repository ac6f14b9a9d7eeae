"""The recommendations for twenty-one structures of many modes, compared with a scan over tr."""

from dataclasses import replace
from pathlib import Path

import pytest

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.models.box_run import make_history
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
    # where the printed digits of a matsum leave its start open by a millisecond, another crossing may come first
    released = require(rehearsal.reference.released)
    assert min(pair.tr, require(rehearsal.tr)) >= released - INTERVAL
