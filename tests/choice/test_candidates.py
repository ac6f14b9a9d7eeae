"""Candidates for tr: the times offered, their measures, and the objections to them."""

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.candidates import judge_candidates
from d2rpick.choice.pair.quality import rank_candidates, rank_judged
from d2rpick.choice.pair.situation import make_look
from d2rpick.choice.question import Settings
from d2rpick.vibration import measures
from tests import paper
from tests.energies import (
    list_codes,
    make_energy_history,
    make_vibration_energy,
    require,
)

PLAIN = Settings()


def test_all_crossings_of_the_published_example_and_their_signs() -> None:
    answer = suggest_in_history(paper.make_history(), paper.TD, PLAIN)
    crossings = sorted(
        (c.tr * 1e3, c.sign_match) for c in answer.candidates if c.kind == "crossing"
    )
    assert [sign for _, sign in crossings] == [sign for _, sign in paper.CROSSINGS]
    assert [time for time, _ in crossings] == pytest.approx(
        [time for time, _ in paper.CROSSINGS], rel=1e-9
    )


def test_opposite_signs_are_worse_than_locking_in_nothing() -> None:
    answer = suggest_in_history(paper.make_history(), paper.TD, PLAIN)
    opposite = [c for c in answer.candidates if c.sign_match is False]
    share = (4 * paper.ENERGY_TD + paper.KINETIC_TD) / (
        paper.ENERGY_TD + paper.KINETIC_TD
    )
    assert [c.residual for c in opposite] == pytest.approx(
        [np.sqrt(share)] * len(opposite), rel=1e-7
    )
    assert not any(c.acceptable for c in opposite)


def test_residual_is_made_of_lock_in_error_and_kinetic_share() -> None:
    answer = suggest_in_history(paper.make_history(), 0.05, PLAIN)
    for c in answer.candidates:
        expected = measures.residual(
            require(c.lock_in_error), require(answer.situation.kinetic_share)
        )
        assert c.residual == pytest.approx(expected, rel=1e-9)


def test_the_first_sample_counts_like_any_other() -> None:
    time = np.linspace(0, 1, 2001)
    answer = suggest_in_history(
        make_energy_history(4 * np.cos(30 * time) ** 2, time), 6 * np.pi / 30, PLAIN
    )
    assert require(answer.recommended).tr == pytest.approx(0.0, abs=1e-9)


def test_a_level_of_zero_is_met_once_by_each_passage() -> None:
    time = np.linspace(0, 1, 2001)
    answer = suggest_in_history(
        make_energy_history(4 * np.sin(30 * time) ** 2, time), 6 * np.pi / 30, PLAIN
    )
    times = [round(c.tr, 6) for c in answer.candidates if c.kind == "crossing"]
    assert len(times) == len(set(times)) == 6


def test_td_on_the_highest_peak_of_an_undamped_record_has_extrema_for_candidates() -> (
    None
):
    history = make_vibration_energy()
    answer = suggest_in_history(history, 3.25, PLAIN)
    assert {c.kind for c in answer.candidates if c.acceptable} == {"extremum"}
    # The peak at 0.75 has the opposite sign; of 0.25, 1.25 and 2.25, the earliest keeps the parts rigid longest.
    assert require(answer.recommended).tr == pytest.approx(0.25, abs=1e-6)
    assert require(answer.recommended).residual == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("energy", [np.zeros(50), np.full(50, 3.0), -np.ones(50)])
def test_energies_that_do_not_vibrate_give_no_candidate(energy: np.ndarray) -> None:
    answer = suggest_in_history(
        make_energy_history(energy, np.arange(50.0)), 40.0, PLAIN
    )
    assert not answer.candidates
    assert answer.recommended is None
    assert "no-candidate" in list_codes(answer)


def test_candidates_of_many_td_are_those_of_each_also_where_few_fit_together() -> None:
    look = make_look(paper.make_history(), PLAIN)
    situations = [look(td) for td in (0.02, 0.0335, 0.064, 0.0687, 0.11)]
    alone = [next(rank_candidates([ranked_at_td]))[:] for ranked_at_td in situations]
    for together in (
        judge_candidates(situations),
        judge_candidates(situations, most=15),
    ):
        assert [
            ranked_at_td[:]
            for judged in together
            for ranked_at_td in rank_judged(judged)
        ] == alone
    assert list(judge_candidates([])) == []


def test_a_first_td_with_few_candidates_does_not_let_all_others_be_judged_at_once() -> (
    None
):
    energy = np.r_[np.zeros(20), 4 + np.random.default_rng(1).random(4000)]
    look = make_look(
        make_energy_history(energy, np.arange(energy.size, dtype=float)), PLAIN
    )
    situations = [look(td) for td in (10.0, *np.linspace(3900, 4000, 40))]
    assert (
        max(
            judged.situation_of.size
            for judged in judge_candidates(situations, most=4000)
        )
        < 40_000
    )


@pytest.mark.parametrize("noise", [0.0, 0.8])
def test_a_candidate_alone_is_the_one_among_all(noise: float) -> None:
    clean = make_vibration_energy()
    energy = clean.energy + noise * np.random.default_rng(1).random(clean.energy.size)
    ranked_candidates = next(
        rank_candidates(
            [make_look(make_energy_history(energy, clean.time), PLAIN)(3.2)]
        )
    )
    assert len(ranked_candidates) > 3
    assert (
        [ranked_candidates[i] for i in range(len(ranked_candidates))]
        == list(ranked_candidates)
        == list(ranked_candidates[:])
    )
    assert (ranked_candidates[-1], ranked_candidates[1:3]) == (
        ranked_candidates[:][-1],
        ranked_candidates[:][1:3],
    )
