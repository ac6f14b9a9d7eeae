"""A small second mode is told where the record shows it; what may hide there widens the residual."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.choice.settings import Settings
from d2rpick.choice.suggest import suggest
from d2rpick.histories.history import History
from d2rpick.vibration.equivalent import replayed_residual
from d2rpick.vibration.identify import identify
from d2rpick.vibration.modes import Modes
from d2rpick.vibration.one_mode import Mode
from d2rpick.vibration.second_mode import residual_bound, resolved
from tests.benchmarks.identification import small_second_modes
from tests.records import ENERGY, TIME, noisy, printed

MAIN = Mode(2 * np.pi, 0.2, 0.3, 0.9, 0.0)
TIMES = np.arange(0, 7, 1 / 40)


def beside(share: float, rate: float = 2.3) -> Modes:
    """The main mode and one with that share of its energy."""
    root = float(np.sqrt(share * MAIN.vibration_energy(0.0)))
    return Modes((MAIN, Mode(rate * 2 * np.pi, 0.2, root * np.cos(1.0), root * np.sin(1.0) * 0.97, 0.0)))


@pytest.mark.parametrize("rate", [0.6, 1.8, 3.1])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("share", [0.003, 0.01])
def test_a_small_second_mode_is_told_from_one(share: float, noise: float, rate: float) -> None:
    truth = beside(share, rate)
    energy = noisy(truth.energy(TIMES), noise, seed=1)
    one = identify(TIMES, energy)
    assert one.describes_record
    assert isinstance(one.mode, Mode)  # its rest is too small to refuse it
    two = resolved(TIMES, energy, one)
    assert two.mode is not None
    tr, td = np.array([0.3, 1.1, 2.6]), 5.3
    assert replayed_residual(two.mode, tr, td) == pytest.approx(replayed_residual(truth, tr, td), abs=0.02 + 2 * noise)
    # with 6 samples per period of its energy the second mode may be the alias of another
    assert (two.hidden_share < share / 2) == (rate < 2)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [1e-4, 0.03])
def test_white_noise_is_no_second_mode(noise: float, seed: int) -> None:
    energy = noisy(MAIN.energy(TIMES), noise, seed)
    one = identify(TIMES, energy)
    found = resolved(TIMES, energy, one)
    assert found.mode is one.mode
    assert 0 < found.hidden_share < 3 * noise


def test_a_clean_or_printed_record_hides_nothing() -> None:
    for energy, most in ((ENERGY, 1e-12), (printed(ENERGY), 1e-5)):
        assert resolved(TIME, energy, identify(TIME, energy)).hidden_share < most


def test_the_bound_holds_for_a_mode_that_drowns_in_noise() -> None:
    tr, td = np.array([0.3, 1.1, 2.6]), 5.3
    for seed in range(20):
        truth = beside(0.005, rate=1.5 + seed / 10)
        energy = noisy(truth.energy(TIMES), 0.03, seed)
        found = resolved(TIMES, energy, identify(TIMES, energy))
        assert found.mode is not None
        true, told = replayed_residual(truth, tr, td), replayed_residual(found.mode, tr, td)
        assert np.all(residual_bound(told, found, tr, td) > true - 0.05)


def test_candidates_state_how_large_their_residual_may_be() -> None:
    energy = noisy(MAIN.energy(TIMES), 0.03, seed=3)
    found = suggest(History(TIMES, energy, source=("test",), format="csv", channel="E"), 5.3, Settings(after=0.0))
    assert found.candidates
    for one in found.candidates:
        assert one.residual is not None
        assert one.residual_high is not None
        assert one.residual_high >= one.residual
        noted = any("if the record hides a further mode" in note for note in one.notes)
        assert noted == (one.residual_high > one.residual + 0.1)


@pytest.mark.parametrize("kind", ["one", "small", "large"])
def test_of_random_records_95_percent_are_within_their_bounds(kind: str) -> None:
    found = small_second_modes(kind, range(10))
    assert len(found) >= 5
    off = [max(one.stated - one.true, one.true - one.highest, 0.0) for one in found]
    assert np.percentile(off, 95) <= 0.05
