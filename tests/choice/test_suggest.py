"""What suggest and verify decide: the published example, a computed rollover, and the rules of acceptance and order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d2rpick.choice import measures
from d2rpick.choice.candidates import Candidate
from d2rpick.choice.ranking import EQUALLY_GOOD, rank
from d2rpick.choice.settings import Settings
from d2rpick.choice.suggest import Suggestion, suggest
from d2rpick.choice.verify import verify
from d2rpick.errors import RangeError
from d2rpick.histories.history import History
from d2rpick.vibration.replay import to_mode
from tests import paper
from tests.shared import shared

PLAIN = Settings()


def codes(answer: Suggestion) -> set[str]:
    return {caution.code for caution in answer.cautions}


def of(energy: np.ndarray, time: np.ndarray) -> History:
    return History(time, energy, source=("test",), format="csv", channel="E")


def rollover() -> History:
    table = np.genfromtxt(shared("openradioss/rollover_ref.csv"), delimiter=",", names=True)
    return of(table["boxIE_J"], table["time_s"])


def vibration(step: float = 0.01, decay: float = 0.0) -> History:
    """Energy of one mode with period 1 of the deformation, undamped unless told otherwise."""
    time = np.arange(0, 4, step)
    return of(np.exp(-decay * time) * np.sin(2 * np.pi * time) ** 2, time)


# ---- the published example


def test_all_crossings_of_the_published_example_and_their_signs() -> None:
    answer = suggest(paper.history(), paper.TD, PLAIN)
    found = sorted((c.tr * 1e3, c.sign_match) for c in answer.candidates if c.kind == "crossing")
    assert [sign for _, sign in found] == [sign for _, sign in paper.CROSSINGS]
    assert [time for time, _ in found] == pytest.approx([time for time, _ in paper.CROSSINGS], rel=1e-9)


def test_the_published_example_is_recommended_warned_of_and_bettered() -> None:
    answer = suggest(paper.history(), paper.TD, PLAIN)
    assert answer.recommended is not None
    assert answer.better_td is not None
    assert answer.recommended.tr == pytest.approx(0.0128852793630525, rel=1e-9)
    assert answer.recommended.residual == pytest.approx(0.957444, abs=1e-6)
    assert (answer.better_td.td, answer.better_td.tr) == pytest.approx((paper.BETTER_TD, paper.BETTER_TR), rel=1e-8)
    assert answer.better_td.residual == pytest.approx(0.0, abs=1e-6)
    assert answer.situation.kinetic_share == pytest.approx(paper.KINETIC_SHARE, rel=1e-8)
    assert codes(answer) == {"poor-td"}


def test_opposite_signs_are_worse_than_locking_in_nothing() -> None:
    answer = suggest(paper.history(), paper.TD, PLAIN)
    opposite = [c for c in answer.candidates if c.sign_match is False]
    share = (4 * paper.ENERGY_TD + paper.KINETIC_TD) / (paper.ENERGY_TD + paper.KINETIC_TD)
    assert [c.residual for c in opposite] == pytest.approx([np.sqrt(share)] * len(opposite), rel=1e-7)
    assert not any(c.acceptable for c in opposite)


def test_residual_is_made_of_lock_in_error_and_kinetic_share() -> None:
    answer = suggest(paper.history(), 0.05, PLAIN)
    for c in answer.candidates:
        assert c.lock_in_error is not None
        assert answer.situation.kinetic_share is not None
        assert c.residual == pytest.approx(measures.residual(c.lock_in_error, answer.situation.kinetic_share), rel=1e-9)


def test_a_given_oscillator_answers_as_the_identified_one() -> None:
    given_one = suggest(paper.history(), paper.TD, Settings(oscillator=to_mode(paper.OSCILLATOR, 6.0)))
    identified = suggest(paper.history(), paper.TD, PLAIN)
    assert [c.tr for c in given_one.candidates] == pytest.approx([c.tr for c in identified.candidates], rel=1e-8)
    assert given_one.recommended is not None


def test_a_given_oscillator_that_does_not_fit_is_not_believed() -> None:
    wrong = to_mode(replace(paper.OSCILLATOR, stiffness=500e3), 6.0)
    answer = suggest(paper.history(), paper.TD, Settings(oscillator=wrong))
    assert answer.situation.basis == "energy"
    assert "energy-only" in codes(answer)


def test_the_first_sample_counts_like_any_other() -> None:
    time = np.linspace(0, 1, 2001)
    answer = suggest(of(4 * np.cos(30 * time) ** 2, time), 6 * np.pi / 30, PLAIN)
    assert answer.recommended is not None
    assert answer.recommended.tr == pytest.approx(0.0, abs=1e-9)


def test_a_level_of_zero_is_met_once_by_each_passage() -> None:
    time = np.linspace(0, 1, 2001)
    answer = suggest(of(4 * np.sin(30 * time) ** 2, time), 6 * np.pi / 30, PLAIN)
    times = [round(c.tr, 6) for c in answer.candidates if c.kind == "crossing"]
    assert len(times) == len(set(times)) == 6


def test_td_on_the_highest_peak_of_an_undamped_record_has_extrema_for_candidates() -> None:
    history = vibration()
    answer = suggest(history, 3.25, PLAIN)
    assert answer.recommended is not None
    assert {c.kind for c in answer.candidates if c.acceptable} == {"extremum"}
    # the peak at 0.75 has the other sign; of 0.25, 1.25, 2.25 the earliest saves most
    assert answer.recommended.tr == pytest.approx(0.25, abs=1e-6)
    assert answer.recommended.residual == pytest.approx(0.0, abs=1e-6)


# ---- the computed rollover


def test_the_rollover_is_switched_after_the_trip() -> None:
    answer = suggest(rollover(), 0.37, PLAIN)
    assert answer.situation.basis == "energy"
    assert answer.recommended is not None
    assert 0.0908 <= answer.recommended.tr <= 0.160
    assert {"energy-only", "flight-from-energy"} <= codes(answer)
    for c in answer.candidates:
        assert (c.sign_match, c.lock_in_error, c.residual, c.timing_tolerance) == (None, None, None, None)
        assert any("no single oscillator" in note for note in c.notes)


def test_crossings_during_the_trip_are_not_acceptable() -> None:
    answer = suggest(rollover(), 0.37, PLAIN)
    start = answer.situation.flight.start
    assert start is not None
    early = [c for c in answer.candidates if c.tr < start]
    assert early
    assert not any(c.acceptable for c in early)
    assert all("before the end of the load" in c.notes[0] for c in early)


def test_without_a_known_flight_the_verdict_is_unknown() -> None:
    history = rollover()
    flying = history.time > 0.1
    answer = suggest(of(history.energy[flying], history.time[flying]), 0.37, PLAIN)
    assert answer.situation.flight.start is None
    assert answer.recommended is None
    assert {"no-flight", "no-candidate"} <= codes(answer)
    judged = verify(of(history.energy[flying], history.time[flying]), 0.12, 0.37, PLAIN)
    assert (judged.tr_ok, judged.verified) == (None, False)


# ---- acceptance, limits, order


def test_margin_and_after_move_the_earliest_tr() -> None:
    plain = suggest(paper.history(), paper.TD, PLAIN)
    later = suggest(paper.history(), paper.TD, Settings(after=0.013))
    margin = suggest(paper.history(), paper.TD, Settings(after=0.013, margin=0.02))
    assert plain.recommended is not None
    assert later.recommended is not None
    assert margin.recommended is not None
    assert plain.recommended.tr == pytest.approx(0.0128853, abs=1e-6)
    assert later.recommended.tr == pytest.approx(0.0247264, abs=1e-6)
    assert margin.recommended.tr == pytest.approx(0.0383104, abs=1e-6)
    assert later.situation.flight.source == "given"


@pytest.mark.parametrize("limit", [{"max_kinetic_share": 0.9}, {"max_residual": 0.95}])
def test_limits_object_to_what_would_only_be_warned_of(limit: dict[str, float]) -> None:
    answer = suggest(paper.history(), paper.TD, Settings(**limit))  # type: ignore[arg-type]
    assert answer.recommended is None
    assert "no-candidate" in codes(answer)
    assert answer.better_td is not None
    judged = verify(paper.history(), 0.0128853, paper.TD, Settings(**limit))  # type: ignore[arg-type]
    assert (judged.tr_ok, judged.verified) == (True, False)
    assert "limit" in judged.reasons[0]


def test_limits_that_cannot_be_judged_are_not_kept() -> None:
    answer = suggest(rollover(), 0.37, Settings(max_residual=10.0))
    assert answer.recommended is None
    judged = verify(rollover(), 0.0886, 0.37, Settings(max_residual=10.0))
    assert "residual unknown" in " ".join(judged.reasons)


def test_td_after_the_next_contact_is_not_acceptable() -> None:
    time = np.arange(0, 3, 0.01)
    energy = np.sin(2 * np.pi * time) ** 2 + np.where(time > 2.5, 40 * (time - 2.5), 0)
    answer = suggest(of(energy, time), 2.8, Settings(fit_window=(0.0, 2.4)))
    assert answer.recommended is None
    before = suggest(of(energy, time), 2.4, PLAIN)
    assert before.recommended is not None
    assert before.situation.flight.end == pytest.approx(2.5, abs=0.03)


def test_the_sign_is_judged_before_the_tolerance() -> None:
    judged = verify(paper.history(), 0.0122658849405802, paper.TD, Settings(tolerance=10.0))
    assert judged.tr_ok is False
    assert judged.reasons == ("opposite sign of the deformation",)


def test_verify_measures_what_suggest_measures() -> None:
    best = suggest(paper.history(), paper.TD, PLAIN).candidates[0]
    judged = verify(paper.history(), best.tr, paper.TD, PLAIN)
    same = (
        "energy",
        "energy_ratio",
        "lock_in_error",
        "residual",
        "sign_match",
        "rigid_time",
        "timing_tolerance",
    )
    for name in same:
        assert getattr(judged.candidate, name) == pytest.approx(getattr(best, name), rel=1e-9, abs=1e-9)
    assert judged.verified
    assert judged.td_ok is False  # a kinetic share of 0.92


@pytest.mark.parametrize(("tr", "td"), [(0.064, 0.064), (0.07, 0.064), (-0.1, 0.064), (0.01, 0.2)])
def test_pairs_that_are_none_are_refused(tr: float, td: float) -> None:
    with pytest.raises(RangeError):
        verify(paper.history(), tr, td, PLAIN)


@pytest.mark.parametrize("energy", [np.zeros(50), np.full(50, 3.0), -np.ones(50)])
def test_energies_that_do_not_vibrate_give_no_candidate(energy: np.ndarray) -> None:
    answer = suggest(of(energy, np.arange(50.0)), 40.0, PLAIN)
    assert answer.candidates == ()
    assert answer.recommended is None
    assert "no-candidate" in codes(answer)


def test_a_negative_level_is_never_acceptable() -> None:
    time = np.arange(0, 4, 0.01)
    answer = suggest(of(np.sin(2 * np.pi * time) - 0.5, time), 3.5, Settings(after=0.0))
    assert "no-energy" in codes(answer)
    assert answer.recommended is None
    assert all(c.level_error is None and c.energy_ratio is None for c in answer.candidates)


def test_two_states_are_too_few_and_td_must_lie_in_the_record() -> None:
    with pytest.raises(RangeError, match="at least 3"):
        suggest(of(np.array([0.0, 1.0]), np.array([0.0, 1.0])), 0.5, PLAIN)
    with pytest.raises(RangeError, match=r"outside the record, 0 to 0\.15"):
        suggest(paper.history(), 0.2, PLAIN)


candidates = st.builds(
    lambda tr, error, acceptable: Candidate(
        0, tr, "crossing", 1.0, 1.0, 0.0, True, True, error, error, None, 1 - tr, 1 - tr, None, None, None, acceptable,
        False, (),
    ),
    st.floats(0, 0.9),
    st.one_of(st.floats(0, 0.1), st.floats(0, 2)),
    st.booleans(),
)  # fmt: skip


@given(st.lists(candidates, max_size=12))
def test_the_order_of_candidates(some: list[Candidate]) -> None:
    ranked = rank(some)
    assert [c.rank for c in ranked] == list(range(1, len(some) + 1))
    assert sorted(c.tr for c in ranked) == sorted(c.tr for c in some)
    assert [c.acceptable for c in ranked] == sorted((c.acceptable for c in some), reverse=True)
    good = [c for c in ranked if c.acceptable]
    if good:
        near = min(c.error for c in good) + EQUALLY_GOOD
        assert good[0].error <= near
        assert good[0].tr == min(c.tr for c in good if c.error <= near)


@settings(max_examples=25, deadline=None)
@given(st.floats(-50, 50), st.sampled_from([1e-3, 1.0, 1e3]), st.sampled_from([1e-6, 1.0, 1e6]))
def test_units_do_not_matter(shift: float, unit: float, joule: float) -> None:
    plain = vibration(decay=0.3)
    there = of(joule * plain.energy, unit * (plain.time + shift))
    expected = suggest(plain, 3.1, PLAIN)
    found = suggest(there, float(unit * (3.1 + shift)), PLAIN)
    assert expected.recommended is not None
    assert found.recommended is not None
    assert found.recommended.tr / unit - shift == pytest.approx(expected.recommended.tr, abs=1e-7)
    assert found.recommended.residual == pytest.approx(expected.recommended.residual, abs=1e-6)
