"""The bound on the rigid time, by which a window of td is searched, against the candidates themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.choice.candidates import find_candidates
from d2rpick.choice.ranking import rank
from d2rpick.choice.settings import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.suggest_td import longest_rigid_times
from tests import paper
from tests.energies import of

if TYPE_CHECKING:
    from d2rpick.choice.situation import Situation


def rigid_time(situation: Situation) -> float:
    best = rank(find_candidates(situation)).chosen
    return best.rigid_time if best and not best.same_swing else 0.0


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0.0, 0.05),
    st.floats(0.0, 3.0),
    st.sampled_from([0.0, 1e-4, 0.02, 0.2, 1.0]),
    st.sampled_from([0.0, 0.05, 0.333]),
)
def test_no_recommended_tr_lies_further_back_than_the_bound(
    seed: int, noise: float, decay: float, tolerance: float, after: float
) -> None:
    rng = np.random.default_rng(seed)
    time = np.linspace(0.0, 1.0, 120)
    rates, phases = rng.uniform(5, 60, 4), rng.uniform(0, 3, 4)
    energy = np.exp(-decay * time) * (np.sin(time[:, np.newaxis] * rates + phases) ** 2).sum(axis=1)
    energy += noise * rng.standard_normal(time.size)
    start = examine(of(energy, time), 0.8, Settings(tolerance=tolerance, after=after, replay=False))
    tds = rng.choice(time[1:], 12)
    bounds = longest_rigid_times(start, tds)
    for td, bound in zip(tds.tolist(), bounds.tolist(), strict=True):
        assert rigid_time(start.at(td)) <= bound


def test_the_bound_is_near_where_the_energy_passes_the_level() -> None:
    time = np.linspace(0.0, 10.0, 4001)
    energy = np.exp(-time / 10) * np.sin(3 * time) ** 2
    situation = examine(of(energy, time), 9.0, Settings(after=0.5, replay=False))
    tds = time[(time > 3) & (energy > 0.05)][::50]
    found = np.array([rigid_time(situation.at(td)) for td in tds.tolist()])
    bounds = longest_rigid_times(situation, tds)
    assert found.all()
    assert (bounds - found).max() < 0.1
    assert (bounds < tds - 0.5).mean() > 0.5


def test_where_a_model_decides_the_flight_alone_is_the_bound() -> None:
    history = paper.history()
    situation = examine(history, 0.064, Settings(after=0.01))
    assert longest_rigid_times(situation, np.array([0.05, 0.064])).tolist() == [0.04, 0.054]


def test_without_a_start_of_the_flight_nothing_is_rigid() -> None:
    time = np.linspace(0.0, 1.0, 50)
    situation = examine(of(1 + time, time), 0.5, Settings(replay=False))
    assert situation.earliest_tr is None
    assert longest_rigid_times(situation, time).tolist() == [0.0] * 50
