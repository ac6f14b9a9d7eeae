"""Deformations of single parts: their signs, the residual that follows, and when they have no sign."""

from copy import copy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.candidates import judge_times
from d2rpick.choice.pair.situation import Situation, examine_td
from d2rpick.choice.question import Settings
from d2rpick.cli import d2rpick  # noqa: F401  imported first, it sets the threads
from d2rpick.histories.history import History
from d2rpick.histories.opening import Selection, open_run
from d2rpick.vibration.measures import kinetic_share, lock_in_error
from d2rpick.vibration.model import SUNK
from d2rpick.vibration.part_signs import MOST_UNSIGNED, SignedParts, find_own_mode
from d2rpick.vibration.waves import PartMotion, Waves, find_all_zeros, follow_waves
from tests import chain
from tests.benchmarks.promise_parts import Motion, make_history_of_parts
from tests.command import BOX
from tests.energies import require
from tests.reading import read_solved
from tests.records import add_noise, round_as_printed

PLAIN = Settings()
NAMES = ("IE_spring1_J", "IE_spring2_J")

SPAN = np.arange(0, 0.4, 4e-4)
TWO_PARTS = ("A", "B")


def move_two_springs(time: np.ndarray) -> np.ndarray:
    """Return signed deformations of two parts in which two modes mix, shape (n, 2)."""
    slow, fast = (
        np.exp(-0.1 * time) * np.sin(5 * time),
        np.exp(-0.1 * time) * np.cos(8.3 * time),
    )
    return np.stack([slow + 0.7 * fast, 0.8 * slow - 0.9 * fast], axis=1)


def compute_deformations(parts: SignedParts, t: np.ndarray) -> np.ndarray:
    """Return signed deformations of parts described by waves, shape (k, n)."""
    return np.array(
        [
            motion.model.deformation(t)
            for motion in parts.motions
            if isinstance(motion.model, Waves)
        ]
    )


def make_part_history(deformation: np.ndarray, time: np.ndarray) -> History:
    energies = deformation**2
    names = tuple(f"part {i}" for i in range(1, energies.shape[1] + 1))
    return History(
        time, energies.sum(axis=1), source=("test",), format="csv", channel="sum", part_names=names,
        part_energies=energies,
    )  # fmt: skip


@cache
def examine_chain_at(td: float) -> Situation:
    """Return the situation of the chain at a td."""
    return examine_td(chain.read_chain_history(), td, PLAIN)


# ---- signs


@pytest.mark.parametrize("samples_per_period", [20, 150, 1000])
def test_signs_are_followed_through_every_zero(samples_per_period: int) -> None:
    time = np.arange(0, 12, 2 * np.pi / 8.3 / samples_per_period)
    true = move_two_springs(time)
    signed_parts = SignedParts(
        time, round_as_printed(true.ravel() ** 2).reshape(true.shape), NAMES
    )
    assert signed_parts.names == NAMES
    comparable = (time > signed_parts.comparable_since(10.8)) & (time < 10.8)
    for deformation, expected in zip(
        compute_deformations(signed_parts, time[comparable]),
        true.T[:, comparable],
        strict=True,
    ):
        sign_differs = np.sign(deformation) != np.sign(expected) * np.sign(
            deformation @ expected
        )
        # a sample next to a zero may be taken for one on its other side
        assert np.all(np.abs(expected[sign_differs]) < 0.1)
    assert np.mean(comparable) > 0.85


@given(
    st.floats(0.3, 3),
    st.floats(0, 3),
    st.floats(0, 0.3),
    st.sampled_from([20, 60]),
    st.floats(0, 6),
)
def test_one_spring_is_compared_as_its_oscillator_tells(
    rate: float, phase: float, damping: float, per_period: int, tr: float
) -> None:
    time = np.arange(0, 8 * np.pi / rate, 2 * np.pi / rate / per_period)
    td = 0.9 * time[-1]
    tr = tr / 6 * td
    deformation = np.exp(-damping * rate * time) * np.sin(rate * time + phase)
    signed_parts = SignedParts(time, deformation[:, np.newaxis] ** 2, ["one"])
    assert signed_parts.signed
    assume(signed_parts.comparable_since(td) <= tr)
    true = np.interp([tr, td], time, deformation)
    assume(np.all(np.abs(true) > 0.1 * np.exp(-damping * rate * np.array([tr, td]))))
    part_deformation = compute_deformations(signed_parts, np.array([tr, td]))[0]
    assert (part_deformation[0] * part_deformation[1] > 0) == (true[0] * true[1] > 0)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda t: np.sin(5 * t) ** 2 + 0.2, "does not return to zero"),
        (lambda t: (1.5 + np.sin(5 * t)) ** 2, "does not return to zero"),
        (lambda t: (0.8 + np.sin(5 * t)) ** 2, "vibrate about"),
        (np.ones_like, "does not return to zero"),
    ],
    ids=["plastic work", "preload", "half a preload", "constant"],
)
def test_a_part_that_does_not_swing_about_zero_has_no_sign(
    make: object, reason: str
) -> None:
    time = np.arange(0, 12, 0.02)
    signed_parts = SignedParts(
        time,
        np.stack([move_two_springs(time)[:, 0] ** 2, make(time)], axis=1),  # type: ignore[operator]
        ["good", "bad"],
    )
    assert signed_parts.names == ("good",)
    assert [
        (part.name, reason in require(part.reason)) for part in signed_parts.unsigned
    ] == [("bad", True)]
    assert not signed_parts.signed


def test_a_part_without_sign_and_almost_no_energy_is_left_out_and_named() -> None:
    time = np.arange(0, 12, 0.02)
    small = np.full(time.shape, 0.1 * np.sqrt(MOST_UNSIGNED))
    answer = suggest_in_history(
        make_part_history(np.column_stack([move_two_springs(time), small]), time),
        10.0,
        PLAIN,
    )
    assert answer.situation.basis == "parts"
    assert "part-without-sign" in {caution.code for caution in answer.cautions}
    best = answer.candidates[0]
    assert [(part.name, part.sign_match, part.share) for part in best.parts][-1] == (
        "part 3",
        None,
        None,
    )


def test_where_a_sign_may_turn_or_not_nothing_is_compared_across_it() -> None:
    time = np.arange(0, 12, 0.02)
    deformation = move_two_springs(time)
    noise = np.random.default_rng(3).normal(size=(40, 2))
    deformation[300:340] = 0.02 * noise  # the signal is lost for a while
    situation = examine_td(
        make_part_history(deformation, time), 10.0, replace(PLAIN, after=0.0)
    )
    early, late = judge_times(situation, [2.0, 8.0])
    assert (early.sign_match, early.residual) == (None, None)
    assert any("cannot be followed" in note for note in early.notes)
    assert late.sign_match is not None


# ---- the chain of a real solver


def predict_residual(situation: Situation, tr: float) -> float:
    (candidate,) = judge_times(situation, [tr])
    return require(candidate.residual)


@pytest.mark.slow
@pytest.mark.parametrize("estimated", [False, True], ids=["oscillator", "parts alone"])
def test_the_residual_of_switched_runs_is_predicted(estimated: bool) -> None:
    errors, some_runs = [], chain.scan()[::3]
    for td in (chain.TD_PEAK, chain.TD_LATE):
        situation = examine_chain_at(td)
        assert situation.basis == "parts"
        if estimated:
            situation = replace(
                situation, evidence=situation.evidence._replace(fit=None, span=None)
            )
            assert situation.vibration.estimated
        runs = [
            run for run in some_runs if abs(run["td_s"] - td) < 1e-3
        ]  # a step of the solver late
        errors += [
            abs(predict_residual(situation.at(run["td_s"]), run["tr_s"]) - run["R_sim"])
            for run in runs
        ]
    assert len(errors) == len(some_runs)
    assert max(errors) < 0.025  # what is reached


def test_parts_that_vibrate_no_more_than_a_solver_errs_have_no_residual() -> None:
    situation = examine_chain_at(chain.TD_LATE)
    parts = require(situation.evidence.parts)
    started = Waves(
        np.array([-300 + 900j]),
        np.array([101 * np.sqrt(parts.vibration_energy(chain.TD_LATE))]),
        parts.time[0],
    )
    sunk = copy(parts)
    sunk.motions = (*parts.motions, PartMotion(started, np.zeros(0), 0.0))
    situation = replace(
        situation,
        evidence=situation.evidence._replace(
            fit=None, span=None, models={"parts": sunk}
        ),
    )
    assert (situation.basis, situation.kinetic_share, situation.vibration.doubts) == (
        "energy",
        None,
        (SUNK,),
    )
    (candidate,) = judge_times(situation, [0.18])
    assert (candidate.acceptable, candidate.residual, candidate.sign_match) == (
        False,
        None,
        None,
    )
    assert "the level at td is below the noise of the record" in candidate.notes
    assert "is below the error of a solver" in (situation.vibration.reasons or "")
    assert situation.at(chain.TD_PEAK).basis == "parts"


def test_the_signs_of_both_springs_are_right_in_every_switched_run() -> None:
    parts = require(examine_chain_at(chain.TD_LATE).evidence.parts)
    for run in chain.scan():
        product = np.prod(
            compute_deformations(parts, np.array([run["tr_s"], run["td_s"]])), axis=1
        )
        assert (product > 0).tolist() == [run["sign1"] > 0, run["sign2"] > 0]


def read_t01() -> History:
    return read_solved("chain_referenceT01.gz", "spring1,spring2").history


@pytest.mark.slow
@pytest.mark.parametrize("source", ["csv", "T01"])
def test_the_closest_match_is_recommended_although_the_total_energy_is_off(
    source: str,
) -> None:
    answer = suggest_in_history(
        chain.read_chain_history() if source == "csv" else read_t01(),
        chain.TD_PEAK,
        PLAIN,
    )
    assert require(answer.recommended).tr == pytest.approx(0.08084, abs=1e-4)
    best = answer.candidates[0]
    assert (best.kind, best.sign_match, best.recommended) == ("match", True, True)
    assert best.residual == pytest.approx(0.065, abs=0.005)
    assert best.level_error == pytest.approx(0.055, abs=0.01)
    # near the peak itself the energy is right as well, and nothing would be saved
    assert all(c.same_swing for c in answer.candidates if c.tr > 0.13)


@pytest.mark.slow
@pytest.mark.parametrize("source", ["csv", "T01"])
def test_the_recommended_run_is_among_the_best_of_the_scan(source: str) -> None:
    answer = suggest_in_history(
        chain.read_chain_history() if source == "csv" else read_t01(),
        chain.TD_LATE,
        PLAIN,
    )
    tr = require(answer.recommended).tr
    runs = [run for run in chain.scan() if run["td_s"] > 0.2]
    nearest = min(runs, key=lambda run: abs(run["tr_s"] - tr))
    assert nearest["R_sim"] <= min(run["R_sim"] for run in runs) + 0.05


def test_the_parts_that_contribute_most_are_named() -> None:
    situation = examine_chain_at(chain.TD_PEAK)
    (candidate,) = judge_times(situation, [0.1])
    shares = [part.share for part in candidate.parts]
    assert sum(share or 0 for share in shares) == pytest.approx(1)
    assert shares == sorted(shares, key=lambda share: -(share or 0))
    assert any(
        note.startswith(f"mismatch of {candidate.parts[0].name}")
        for note in candidate.notes
    )
    still = 1 - require(situation.kinetic_share)
    assert candidate.lock_in_error == pytest.approx(
        np.sqrt(still) * require(candidate.part_mismatch)
    )


def test_the_rollover_has_no_signs_and_says_why() -> None:
    selection = Selection(parts=("box,step",))
    run = open_run([BOX], selection)
    answer = suggest_in_history(run.history(selection), 0.37, PLAIN)
    assert answer.situation.basis == "modal"
    best = answer.candidates[0]
    assert (best.sign_match, best.part_mismatch, best.parts) == (True, None, ())
    reason = (
        replace(answer.situation.vibration, compared=None, unknown="").reasons or ""
    )
    assert (
        reason.count("box, step: the energy does not return to zero") == 1
    )  # said once for both


def test_several_energies_are_carried_but_for_those_that_are_always_zero() -> None:
    assert chain.read_chain_history().part_names == NAMES
    assert chain.read_chain_history("IE_total_J").part_energies is None
    selection = Selection(energy=(*NAMES, "x3_m"))
    assert chain.read_chain_history(*selection.energy).part_names == selection.energy
    table = chain.read_chain_history()
    np.testing.assert_array_equal(
        require(table.part_energies).sum(axis=1), table.energy
    )


def test_between_the_states_the_model_tells_the_deformation_and_what_is_kinetic() -> (
    None
):
    time = np.linspace(0, 6, 201)
    signed_parts = SignedParts(time, move_two_springs(time) ** 2, NAMES)
    times = np.array([0.123, 1.0, 1.9876, 4.321])
    assert np.abs(compute_deformations(signed_parts, times)) == pytest.approx(
        np.abs(move_two_springs(times).T), abs=1e-4
    )
    slow, fast = (
        np.exp(-0.2 * times) * np.cos(5 * times) ** 2,
        np.exp(-0.2 * times) * np.sin(8.3 * times) ** 2,
    )
    assert signed_parts.kinetic_energy(times) == pytest.approx(
        1.64 * slow + 1.3 * fast, abs=0.1
    )  # but for the damping


def make_motion_in_planes(share: float) -> Motion:
    """Return a part A that bends in two planes, the second with ``share`` of its energy, and a part B with one mode."""
    forms = np.array([np.diag([1 - share, share, 0.0]), np.diag([0.0, 0.0, 0.5])])
    return Motion(
        7.7,
        2 * np.pi * np.array([29.2, 70.1, 48.76]),
        np.array([2.95, 4.64, -0.82]),
        forms,
    )


def make_grouped_springs() -> Motion:
    """Return three springs in which three modes mix; the first two springs are one part."""
    rows = np.array([[1.0, 0.7, -0.2], [0.8, -0.9, 0.4], [0.3, 0.2, 1.0]])
    forms = np.einsum("si,sj->sij", rows, rows)
    return Motion(
        3.0,
        2 * np.pi * np.array([20.0, 33.0, 51.0]),
        np.array([0.3, 1.9, -0.7]),
        np.stack([forms[0] + forms[1], forms[2]]),
    )


def make_history_of_motion(motion: Motion, noise: float = 0.0) -> History:
    energies = motion.energies(SPAN)
    return make_history_of_parts(
        SPAN,
        np.maximum(
            np.stack([add_noise(row, noise, seed=2) for row in energies.T], axis=1), 0.0
        ),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "noise", "basis"),
    [
        (0.003, 0.0, "parts"),
        (0.03, 0.0, "modal"),
        (0.03, 2e-3, "modal"),
        (0.45, 2e-3, "modal"),
    ],
)
def test_of_a_part_that_bends_in_two_planes_the_residual_is_in_its_range(
    share: float, noise: float, basis: str
) -> None:
    """A part vibrating in both planes has no sign; the modes of the whole structure have."""
    truth, td = make_motion_in_planes(share), 0.31
    answer = suggest_in_history(
        make_history_of_motion(truth, noise), td, Settings(after=0.0)
    )
    assert answer.situation.basis == basis
    for candidate in answer.candidates[:6]:
        assert (
            require(candidate.residual_low) - 0.05
            <= truth.residual(candidate.tr, td)
            <= require(candidate.residual_high) + 0.05
        )


def test_minima_that_stay_above_zero_prove_no_sign() -> None:
    energy = make_motion_in_planes(0.03).energies(SPAN)[:, 0]
    (zeros,) = find_all_zeros(SPAN, np.sqrt(energy)[np.newaxis])
    tracked = np.where(np.searchsorted(zeros.sure, SPAN) % 2, -1, 1) * np.sqrt(energy)
    assert follow_waves(SPAN, tracked, zeros) is None
    assert find_own_mode(SPAN, energy, None) is None


def test_what_a_second_plane_may_hold_unseen_widens_the_residual() -> None:
    small = SignedParts(SPAN, make_motion_in_planes(5e-4).energies(SPAN), TWO_PARTS)
    assert small.names == TWO_PARTS
    assert all(
        isinstance(motion.model, Waves) for motion in small.motions
    )  # taken for one plane
    tr, td = np.array([0.05, 0.1]), 0.2072
    stated_residual = np.sqrt(
        np.sum((small.amplitudes(tr).T - small.amplitudes(td)) ** 2, axis=1)
        + small.kinetic_energy(td)
    )
    stated_residual /= np.sqrt(small.vibration_energy(td))
    _, _, high = small.residual_band(stated_residual, tr, td)
    truth = [make_motion_in_planes(5e-4).residual(tr_time, td) for tr_time in tr]
    assert np.all(high > stated_residual + 5e-4)
    assert np.all(np.abs(stated_residual - truth) < 0.02)
    assert np.all(truth <= high + 1e-3)


def test_parts_of_several_springs_in_which_modes_mix_have_no_sign() -> None:
    parts = SignedParts(SPAN, make_grouped_springs().energies(SPAN), TWO_PARTS)
    assert parts.names == ("B",)
    assert [part_id.name for part_id in parts.unsigned] == ["A"]
    assert (
        examine_td(
            make_history_of_motion(make_grouped_springs()), 0.3, Settings(after=0.0)
        ).basis
        != "parts"
    )


def test_what_crosses_between_modes_in_the_parts_is_no_part_of_the_error() -> None:
    """It makes the energy of single parts wrong at td, but only for a moment."""
    rows = np.array([[0.9, 0.6], [0.8, -0.3]])
    forms = np.einsum("pi,pj->pij", rows, rows)
    truth = Motion(3.0, 2 * np.pi * np.array([24.0, 37.0]), np.array([0.4, 2.1]), forms)
    parts = SignedParts(SPAN, truth.energies(SPAN), TWO_PARTS)
    assert parts.names == TWO_PARTS
    td = 0.31
    for tr in (0.05, 0.1, 0.2):
        measured = np.hypot(
            lock_in_error(parts, tr, td), np.sqrt(kinetic_share(parts, td))
        )
        assert measured == pytest.approx(truth.residual(tr, td), abs=1e-3)
