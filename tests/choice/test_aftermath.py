"""The energy after td: what the modes know between the states, and what the static energy adds in the flight."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.aftermath import bound_mean_energy, compute_static_change
from d2rpick.choice.pair.grades import DO_NOT_USE
from d2rpick.choice.question import Settings
from tests.energies import make_energy_history, require
from tests.vibration.linear_structure import LinearStructure

STRUCTURE = LinearStructure.draw(5, 2)
SETTINGS = Settings(after=0.0)


def test_modes_give_the_energy_between_two_states_of_a_coarse_record() -> None:
    """With 5 states per period of the energy, a straight line between them misses 4 % of the highest energy."""
    period = np.pi / STRUCTURE.rate.max()
    time = np.arange(0.0, 30 * period, period / 5)
    history = make_energy_history(STRUCTURE.elastic_energy(time) + 0.1, time)
    suggestion = suggest_in_history(history, float(time[-3]), SETTINGS)
    assert suggestion.situation.basis == "modal"
    tr = np.array([candidate.tr for candidate in suggestion.candidates])
    stated = np.array([candidate.energy for candidate in suggestion.candidates])
    true = STRUCTURE.elastic_energy(tr) + 0.1
    highest = history.energy.max()
    assert np.abs(stated - true).max() < 0.002 * highest
    assert np.abs(history.energies_at(tr) - true).max() > 0.04 * highest


@pytest.mark.parametrize("heat", [0.0, 5.0, 40.0])
def test_rigid_parts_do_not_gain_the_heat_of_the_flight(heat: float) -> None:
    """The mean energy after td is S(tr) + V(tr)/2, and that of the reference run S(td) + U(td)/2."""
    time = np.linspace(0.0, 8.0, 1601)
    static = 0.5 + heat * time / time[-1]
    history = make_energy_history(STRUCTURE.elastic_energy(time) + static, time)
    td = float(time[-2])
    suggestion = suggest_in_history(history, td, SETTINGS)
    chosen = require(suggestion.chosen)
    situation = suggestion.situation
    times = np.array([chosen.tr, td])
    static_tr, static_td = np.interp(times, time, static)
    elastic = STRUCTURE.elastic_energy(times)
    whole = float(elastic[1] + STRUCTURE.kinetic_energy(times)[1])
    mean = static_td + whole / 2
    bounds = require(bound_mean_energy(situation, chosen))
    true = (static_tr + elastic[0] / 2) / mean
    assert bounds.low - 0.01 < true < bounds.high + 0.01
    change = require(compute_static_change(situation, chosen))
    assert change == pytest.approx((static_td - static_tr) / mean, abs=0.05)
    decision = require(suggestion.decision)
    assert ("rises between tr and td" in decision.reason) == (heat > 0)
    if heat > 0:
        assert decision.verdict == DO_NOT_USE


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_the_work_of_dampers_that_remains_in_the_energy_is_no_static_change(
    share: float,
) -> None:
    structure = LinearStructure(
        np.array([1.0, 0.4]), np.array([0.1, 0.2]), np.array([9.0, 14.0]), np.zeros(2)
    )
    time = np.linspace(0.0, 8.0, 1601)
    elastic = structure.elastic_energy(time)
    whole = elastic + structure.kinetic_energy(time)
    history = make_energy_history(elastic + share * (whole[0] - whole), time)
    suggestion = suggest_in_history(history, float(time[-2]), SETTINGS)
    chosen = require(suggestion.chosen)
    change = require(compute_static_change(suggestion.situation, chosen))
    assert change == pytest.approx(0.0, abs=0.01)
    decision = require(suggestion.decision)
    assert "between tr and td" not in decision.reason


def test_an_energy_below_zero_is_never_used_whatever_describes_it() -> None:
    """Each oscillation is counted, but an internal energy cannot be negative: another column was read."""
    time = np.linspace(0.0, 0.4, 401)
    energy = -5 * np.cos(np.sqrt(1 + 4 * time) * 300)
    history = make_energy_history(energy, time)
    decision = require(suggest_in_history(history, 0.35, Settings(after=0.01)).decision)
    assert decision.verdict == DO_NOT_USE
    assert "becomes negative" in decision.reason


def test_noise_around_zero_is_not_called_a_negative_energy() -> None:
    structure = LinearStructure.draw(1, 1)
    time = np.linspace(0.0, 8.0, 4001)
    elastic = structure.elastic_energy(time)
    noise = np.random.default_rng(3).normal(size=time.size)
    history = make_energy_history(elastic + 0.03 * elastic.max() * noise, time)
    assert history.energy.min() < -0.05 * history.energy.max()
    decision = require(suggest_in_history(history, 7.9, SETTINGS).decision)
    assert "becomes negative" not in decision.reason
