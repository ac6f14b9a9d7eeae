"""Choices of suggest and verdicts of verify: a recommended pair passes verify, and each record is examined once."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.choice.answers import (
    suggest_at,
    suggest_in_history,
    suggest_in_run,
    verify_at,
    verify_in_history,
    verify_run,
)
from d2rpick.choice.judged_card import complete_printing, print_judged_card
from d2rpick.choice.pair.candidates import Pair
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Reference, Settings, read_reference
from d2rpick.deck.printed_card import Printing
from d2rpick.histories.history import History
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from d2rpick.rules.judgement import find_faults
from tests import paper
from tests.command import BOX as T01, ENERGY, GLSTAT
from tests.energies import (
    count_fits,
    list_codes,
    make_energy_history,
    make_vibration_energy,
    read_rollover,
    require,
    suggest_in_window,
)
from tests.reading import read_solved

PLAIN = Settings()

LIMITS = st.none() | st.floats(0.0, 1.2)
OPTIONS = st.builds(
    Settings,
    after=st.none() | st.floats(2.0, 5.0),
    margin=st.sampled_from([0.0, 0.1]),
    tolerance=st.floats(0.0, 1.0),
    max_kinetic_share=LIMITS,
    max_residual=LIMITS,
    replay=st.booleans(),
)
BOX = Selection(parts=("box",))


@pytest.mark.slow
def test_the_rollover_is_switched_after_the_trip() -> None:
    """According to the contact energy, the trip ends at 90.8 ms."""
    answer = suggest_in_history(read_rollover(), 0.37, PLAIN)
    flight = answer.situation.flight
    assert (answer.situation.basis, flight.source, flight.certain) == (
        "energy",
        "energy",
        False,
    )
    assert flight.settled == pytest.approx(0.0850, abs=0.002)
    assert 0.0908 < require(flight.start) <= require(answer.recommended).tr <= 0.185
    assert "flight-from-energy" in list_codes(answer)
    assert answer.situation.kinetic_share is None
    for c in answer.candidates:
        assert (c.sign_match, c.lock_in_error, c.residual, c.timing_tolerance) == (
            None,
            None,
            None,
            None,
        )
    early = [c for c in answer.candidates if c.tr < require(flight.start)]
    assert early
    assert all(
        not c.acceptable and "before the end of the load" in c.notes[0] for c in early
    )


@pytest.mark.parametrize("seed", [5, 6])
def test_no_peak_of_noise_that_is_nearer_than_the_better_pair_saves_anything(
    seed: int,
) -> None:
    time = np.linspace(0, 1, 400)
    energy = 20 * np.exp(-8 * time) + np.random.default_rng(seed).standard_normal(
        time.size
    )
    answer = suggest_in_history(
        make_energy_history(energy, time), 0.9, Settings(replay=False)
    )
    situation, better = answer.situation, require(answer.better_pair).td
    nearer = [
        td
        for td in situation.peaks(require(situation.earliest_tr), situation.td)
        if td > better
    ]
    assert nearer
    for td in nearer:
        answer_there = suggest_at(situation.at(td), with_better=False).chosen
        assert answer_there is None or answer_there.same_swing


@pytest.mark.slow
@given(
    st.floats(-50, 50),
    st.sampled_from([1e-3, 1.0, 1e3]),
    st.sampled_from([1e-6, 1.0, 1e6]),
)
def test_units_do_not_matter(shift: float, unit: float, joule: float) -> None:
    plain = make_vibration_energy(decay=0.3)
    scaled_history = make_energy_history(
        joule * plain.energy, unit * (plain.time + shift)
    )
    expected = suggest_in_history(plain, 3.1, PLAIN)
    suggestion = suggest_in_history(scaled_history, float(unit * (3.1 + shift)), PLAIN)
    assert require(suggestion.recommended).tr / unit - shift == pytest.approx(
        require(expected.recommended).tr, abs=1e-7
    )
    assert require(suggestion.recommended).residual == pytest.approx(
        require(expected.recommended).residual, abs=1e-6
    )


def test_a_vibration_that_has_died_down_to_nothing_at_td_has_no_sign_there() -> None:
    time = np.linspace(0.0, 0.01, 400)
    answer = suggest_in_history(
        make_energy_history(np.exp(-8e4 * time) * np.sin(3000.0 * time) ** 2, time),
        0.01,
        Settings(),
    )
    assert answer.situation.basis == "energy"
    assert answer.recommended is None


@pytest.mark.slow
def test_without_a_known_flight_the_verdict_is_unknown() -> None:
    history = read_rollover()
    flying = history.time > 0.1
    answer = suggest_in_history(
        make_energy_history(history.energy[flying], history.time[flying]), 0.37, PLAIN
    )
    assert answer.situation.flight.start is None
    assert answer.recommended is None
    assert {"no-flight", "no-candidate"} <= list_codes(answer)
    judged = verify_in_history(
        make_energy_history(history.energy[flying], history.time[flying]),
        0.12,
        0.37,
        PLAIN,
    )
    assert (judged.tr_ok, judged.verified) == (None, False)


def test_the_sign_is_judged_before_the_tolerance() -> None:
    judged = verify_in_history(
        paper.make_history(),
        0.0122658849405802,
        paper.TD,
        Settings(tolerance=1.0),
    )
    assert judged.tr_ok is False
    assert judged.reasons == ("at tr the deformation has the opposite direction",)


def test_verify_measures_what_suggest_measures() -> None:
    best = suggest_in_history(paper.make_history(), paper.TD, PLAIN).candidates[0]
    judged = verify_in_history(paper.make_history(), best.tr, paper.TD, PLAIN)
    for name in [
        "energy",
        "level_ratio",
        "lock_in_error",
        "residual",
        "sign_match",
        "rigid_time",
        "timing_tolerance",
    ]:
        assert getattr(judged.candidate, name) == pytest.approx(
            getattr(best, name), rel=1e-9, abs=1e-9
        )
    assert judged.tr_ok
    assert judged.admissible
    assert not judged.verified
    assert judged.decision.verdict == "do not use"
    assert judged.td_ok is False  # the kinetic fraction is 0.92


def make_ringing_history() -> History:
    """Return three finely sampled modes with noise, for which a tr may be a closest match that is not at the level."""
    time = np.linspace(0, 0.5, 10_001)
    modes = [(5, 4, 300, 0.3), (2, 6, 777, 1), (1, 9, 1500, 2)]
    energy = sum(
        a * np.exp(-alpha * time) * np.sin(omega * time + phase) ** 2
        for a, alpha, omega, phase in modes
    )
    return make_energy_history(
        energy + 0.01 * np.abs(np.random.default_rng(5).standard_normal(time.size)),
        time,
    )


@pytest.mark.slow
def test_verify_remarks_what_suggest_remarks_on_every_tr() -> None:
    history, settings_asked = make_ringing_history(), Settings(after=0.05)
    suggestion = suggest_in_history(history, 0.4, settings_asked).candidates
    assert suggestion
    situation = examine_td(history, 0.4, settings_asked)
    for remark_row in suggestion:
        judged = verify_at(situation, remark_row.tr).candidate
        assert judged.notes == remark_row.notes
        assert (judged.tr_low, judged.tr_high) == pytest.approx(
            (remark_row.tr_low, remark_row.tr_high), rel=1e-9
        )


@st.composite
def histories(draw: st.DrawFn) -> History:
    """Draw a load that falls, then one or two modes, with or without damping and noise, finely or coarsely sampled."""
    count, rng = (
        draw(st.integers(12, 90)),
        np.random.default_rng(draw(st.integers(0, 2**32 - 1))),
    )
    steps = rng.uniform(0.2, 1.8, count) if draw(st.booleans()) else np.ones(count)
    time = np.cumsum(steps) * 10 / steps.sum()
    omega, alpha, second = (
        draw(st.floats(1.0, 12.0)),
        draw(st.floats(0.0, 0.4)),
        draw(st.sampled_from([0.0, 0.5])),
    )
    decay = np.exp(-alpha * time)
    energy = (
        decay * np.sin(omega * time) ** 2
        + second * decay * np.cos(1.7 * omega * time) ** 2
    )
    energy += draw(st.sampled_from([0.0, 3.0])) * np.exp(-(((time - 1.5) / 0.6) ** 2))
    energy += draw(st.sampled_from([0.0, 0.01, 0.2])) * np.abs(
        rng.standard_normal(count)
    )
    return make_energy_history(energy, time)


def verify_pair(history: History, pair: Pair | None, settings_asked: Settings) -> bool:
    """Return True if a pair passes verify; a missing pair counts as passing."""
    if pair is None:
        return True
    return verify_in_history(history, pair.tr, pair.td, settings_asked).admissible


@settings(max_examples=8)
@given(histories(), st.floats(3.0, 9.9), OPTIONS)
def test_what_is_chosen_for_a_td_is_verified(
    history: History, td: float, settings_asked: Settings
) -> None:
    td = min(td, float(history.time[-1]))
    answer = suggest_in_history(history, td, settings_asked)
    assert verify_pair(history, answer.recommended, settings_asked)
    assert verify_pair(history, answer.better_pair, settings_asked)


@pytest.mark.slow
@settings(max_examples=5)
@given(histories(), st.floats(3.0, 8.0), OPTIONS)
def test_what_is_chosen_in_a_window_is_verified(
    history: History, low: float, settings_asked: Settings
) -> None:
    answer = suggest_in_window(
        history, (low, min(low + 1.5, float(history.time[-1]))), settings_asked
    )
    assert verify_pair(history, answer.recommended, settings_asked)
    assert verify_pair(history, answer.better_pair, settings_asked)


@pytest.mark.parametrize("td", [0.72, 0.8, 0.87])
def test_a_better_td_that_does_not_verify_is_not_named(td: float) -> None:
    history = read_solved("faults/better_td_unverified.csv").history
    assert verify_pair(
        history, suggest_in_history(history, td, Settings()).better_pair, Settings()
    )


@pytest.mark.parametrize("limit", [{"max_kinetic_share": 0.3}, {"max_residual": 0.3}])
def test_a_limit_on_what_is_not_known_leaves_no_td_of_a_window(
    limit: dict[str, Any],
) -> None:
    time = np.linspace(0, 10, 60)
    energy = (
        3 * np.exp(-(((time - 1.5) / 0.6) ** 2))
        + np.sin(3 * time) ** 2
        + 0.6 * np.cos(5.1 * time) ** 2
    )
    history = make_energy_history(energy, time)
    free = suggest_in_window(history, (6.0, 9.0), Settings(replay=False))
    assert free.recommended
    assert (
        suggest_in_window(
            history, (6.0, 9.0), Settings(replay=False, **limit)
        ).recommended
        is None
    )


def make_coarse_history(rate: float) -> History:
    """Return the energy of a damped mode, 44 states in a period at a rate of 1."""
    time = np.linspace(0, 10, 141)
    return make_energy_history(np.exp(-0.05 * time) * np.sin(rate * time) ** 2, time)


@pytest.mark.parametrize("rate", [20.0, 21.5])
def test_too_few_states_per_period_recommend_nothing(rate: float) -> None:
    answer = suggest_in_history(make_coarse_history(rate), 8.0, Settings())
    assert answer.situation.basis == "energy"
    assert answer.recommended is None
    assert any("states per period" in note for note in answer.candidates[0].notes)


def test_fewer_states_per_period_never_tell_more() -> None:
    """A mode with 9 states per period gets the same grade as a mode with half as many."""
    time = np.linspace(0, 10, 211)
    history = make_energy_history(np.exp(-0.05 * time) * np.sin(7.3 * time) ** 2, time)
    thinned = make_energy_history(history.energy[::2], time[::2])
    fine, coarse = (
        suggest_in_history(run, 8.0, Settings()) for run in (history, thinned)
    )
    assert require(fine.quality).grade == require(coarse.quality).grade
    assert abs(require(fine.recommended).tr - require(coarse.recommended).tr) < 0.01


@pytest.mark.parametrize("rate", [7.3, 14.6, 18.0])
def test_lines_need_fewer_states_per_period_than_a_level(rate: float) -> None:
    """6, 3 and 2.4 states per energy period; an oscillator or a level needs 10."""
    td, damping = 8.0, 0.025
    answer = suggest_in_history(make_coarse_history(rate), td, Settings())
    assert answer.situation.basis == "modal"
    tr = require(answer.recommended).tr
    pair = next(candidate for candidate in answer.candidates if candidate.tr == tr)

    def compute_position(time: float) -> float:
        return float(np.exp(-damping * time) * np.sin(rate * time))

    speed = np.exp(-damping * td) * (
        rate * np.cos(rate * td) - damping * np.sin(rate * td)
    )
    kinetic = (speed / np.hypot(rate, damping)) ** 2
    lack = (compute_position(pair.tr) - compute_position(td)) ** 2
    true = np.sqrt((lack + kinetic) / (compute_position(td) ** 2 + kinetic))
    assert require(pair.residual) == pytest.approx(true, abs=5e-3)
    assert require(pair.residual_low) <= true <= require(pair.residual_high)


def test_the_health_of_the_run_comes_with_every_answer() -> None:
    whole = read_reference([T01], BOX)
    answer, in_window = (
        suggest_in_run(whole, 0.37, PLAIN),
        suggest_in_run(whole, (0.3, 0.38), PLAIN),
    )
    verdict = verify_run(whole, require(answer.recommended).tr, 0.37, PLAIN)
    assert require(answer.health) == verdict.health
    assert require(answer.health).window == (require(answer.recommended).tr, 0.37)
    assert in_window.health is not None
    assert (
        suggest_in_run(read_reference([ENERGY]), 0.064, PLAIN).health is None
    )  # a table of two columns contains no momentum


def test_the_momenta_come_with_every_history_and_know_the_chosen_part() -> None:
    opened = open_run([T01])
    whole, box = (
        Reference.of(opened, selection).history for selection in (Selection(), BOX)
    )
    (of_whole, *_), (of_box, *_) = whole.momenta, box.momenta
    assert of_whole.parts == of_box.parts
    assert of_whole.chosen == tuple(range(len(require(of_whole.parts))))
    assert [require(of_whole.parts)[i].title for i in of_box.chosen] == ["box"]
    assert of_whole.values is of_box.values  # the file is read once


def test_a_tr_that_suits_is_the_way_out_of_one_that_does_not() -> None:
    verdict = verify_run(read_reference([GLSTAT]), 0.02, 0.0687, PLAIN)
    assert any(
        "for this td, use tr = " in fault.message for fault in find_faults(verdict)
    )


def test_a_card_is_judged_by_what_the_choice_found_in_the_record() -> None:
    reference = read_reference([T01], BOX)
    box = suggest_in_run(reference, 0.37, PLAIN)
    results_before = count_fits(box.situation.history)
    assert results_before > 0
    judge = partial(verify_run, reference, settings=PLAIN, earlier=box.situation)
    assert print_judged_card(
        [require(box.recommended)[:2]],
        box.situation.history,
        judge,
        complete_printing(Printing(solver="ls-dyna"), box.situation.history),
    )
    assert count_fits(box.situation.history) == results_before
