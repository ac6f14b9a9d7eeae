"""A record seen from one td: which model of the vibration counts there, and what stays the same from another one."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.choice.of_run import read
from d2rpick.choice.settings import Settings
from d2rpick.choice.situation import examine
from d2rpick.flight.bodies import RigidBody
from d2rpick.histories.opening import Selection
from d2rpick.vibration.span import Fits
from tests import chain, paper
from tests.energies import rollover

PLAIN = Settings()


def test_the_basis_is_the_best_that_can_be_relied_on() -> None:
    assert examine(paper.history(), paper.TD, PLAIN).basis == "oscillator"
    assert examine(paper.history(), paper.TD, Settings(replay=False)).basis == "energy"
    assert examine(chain.history(), chain.TD_LATE, PLAIN).basis == "parts"


def test_every_model_answers_alike() -> None:
    for situation in (
        examine(paper.history(), paper.TD, PLAIN),
        examine(chain.history(), chain.TD_LATE, PLAIN),
        examine(rollover(), 0.37, PLAIN),
    ):
        vibration = situation.vibration
        found = vibration.moments(situation.settings.tolerance)
        times = found.tr
        measured = vibration.measured(times)
        assert len(measured) == len(found) == vibration.reach(found).size > 0
        assert np.all(times < situation.td)
        assert (vibration.kinetic_share is None) == (vibration.unknown is not None) == (not any(measured))
        # what a tolerance is held against is the lock-in error, where the sign is right
        for error, one in zip(vibration.errors(times).tolist(), measured, strict=True):
            if one:
                assert error == (pytest.approx(one.lock_in_error) if one.sign_match else np.inf)
        assert situation.energy_td == pytest.approx(situation.history.energy_at(situation.td), rel=0.05)


def test_from_another_td_the_same_evidence_is_seen() -> None:
    situation = examine(paper.history(), paper.TD, PLAIN)
    there = situation.at(paper.BETTER_TD)
    assert there.evidence is situation.evidence
    assert there.kinetic_share == pytest.approx(0.0, abs=1e-9)
    assert situation.at(paper.TD) is situation


@pytest.mark.parametrize("order", [(0.42, 0.3), (0.3, 0.42)])
def test_how_bodies_drift_is_known_in_the_flight_whatever_td_was_seen_before(order: tuple[float, float]) -> None:
    """Behind the flight, at 0.42, it is the same flight that is nearest, but nothing flies."""
    history = read(["sample_data/rollover_box.matsum"], Selection(parts=("all",))).history
    fits, settings = Fits(), Settings(bodies=(RigidBody((1,)), RigidBody((2,))))
    seen = {td: examine(history, td, settings, fits) for td in order}
    assert len({situation.flight[:2] for situation in seen.values()}) == 1
    open_ = {td: situation.bodies.unknown for td, situation in seen.items() if situation.bodies}
    assert open_ == {0.42: settings.bodies, 0.3: ()}
