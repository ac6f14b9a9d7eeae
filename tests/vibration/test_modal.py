"""Residual of any pair from the energy alone, compared with the motion of the modes, and when it must be refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.choice.answers import suggest_in_history, verify_in_history
from d2rpick.choice.question import Settings
from d2rpick.histories.history import Samples
from d2rpick.vibration.measures import Profile, kinetic_share, lock_in_error, residual
from d2rpick.vibration.modal import (
    ModalVibration,
    confirm_by_kinetic_energy,
    identify_modal,
)
from tests.energies import make_energy_history, require
from tests.vibration.linear_structure import LinearStructure

TIME = np.linspace(0.0, 9.0, 1801)
EVEN = np.linspace(0.0, 9.0, 40)
PAIRS = np.array([(tr, td) for tr in EVEN for td in EVEN if tr < td]).T

STRUCTURE = LinearStructure.draw(21, 5)
LOADED = make_energy_history(
    np.where(TIME < 1.0, 60.0 * (1.0 - TIME), 0.0) + STRUCTURE.elastic_energy(TIME),
    TIME,
)


def compute_residuals(vibration: ModalVibration, tr: Samples, td: Samples) -> Samples:
    """Return the residuals that follow from the frozen-deformation error and the kinetic fraction."""
    return residual(lock_in_error(vibration, tr, td), kinetic_share(vibration, td))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6), st.sampled_from([0.0, 3.0]))
def test_the_residual_of_any_pair_is_that_of_the_motion(
    seed: int, count: int, static: float
) -> None:
    structure = LinearStructure.draw(seed, count)
    modal = require(identify_modal(TIME, structure.elastic_energy(TIME) + static))
    assert modal.signed, modal.doubts
    true = structure.residual(*PAIRS)
    assert np.sqrt(np.mean((compute_residuals(modal, *PAIRS) - true) ** 2)) < 0.02
    _, low, high = modal.residual_band(compute_residuals(modal, *PAIRS), *PAIRS)
    assert np.mean((true > low - 1e-3) & (true < high + 1e-3)) > 0.9


@settings(max_examples=8, deadline=None)
@given(
    st.integers(0, 10**6),
    st.floats(0.03, 0.9),
    st.floats(0.5, np.pi),
    st.sampled_from([0.0, 3.0]),
)
def test_modes_whose_lines_cancel_are_known_by_their_decay(
    seed: int, share: float, turned: float, static: float
) -> None:
    """Two modes of one rate, as of a square box, have one line: what its height lacks falls as the vibration does."""
    first = LinearStructure.draw(seed, 1)
    pair = LinearStructure(
        np.array([1.0, np.sqrt(share)]),
        np.full(2, 0.1),
        np.repeat(first.rate, 2),
        first.phase[0] + np.array([0.0, turned / 2]),
    )
    modal = require(identify_modal(TIME, pair.elastic_energy(TIME) + static))
    true = pair.residual(*PAIRS)
    assert np.abs(compute_residuals(modal, *PAIRS) - true).max() < 0.03


def test_a_static_energy_that_stays_hides_no_modes() -> None:
    structure = LinearStructure.draw(4, 3)
    modal = require(identify_modal(TIME, structure.elastic_energy(TIME) + 7.0))
    assert modal.reading.hidden_pairs < 1e-3


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.5, 0.95), st.sampled_from([0.0, 3.0]))
def test_a_mode_slower_than_the_record_is_no_static_energy(
    seed: int, turns: float, static: float
) -> None:
    """A mode whose energy does not return within the flight still vibrates, but is known less accurately."""
    fast = LinearStructure.draw(seed, 3)
    slow_rate = np.pi * turns / TIME[-1]
    structure = fast._replace(
        rate=np.append(slow_rate, fast.rate[1:]),
        damping=np.full(3, 0.05),
    )
    modal = require(identify_modal(TIME, structure.elastic_energy(TIME) + static))
    true = structure.residual(*PAIRS)
    stated = compute_residuals(modal, *PAIRS)
    assert np.sqrt(np.mean((stated - true) ** 2)) < 0.03
    _, low, high = modal.residual_band(stated, *PAIRS)
    assert np.mean((true > low - 1e-3) & (true < high + 1e-3)) > 0.9


@pytest.mark.parametrize("drift", [0.1, 0.5, 3.0])
def test_an_energy_that_drifts_is_no_slow_mode(drift: float) -> None:
    structure = LinearStructure.draw(4, 3)
    energy = structure.elastic_energy(TIME)
    drifting = drift * np.ptp(energy) * TIME / TIME[-1]
    modal = require(identify_modal(TIME, energy + drifting))
    assert modal.signed, modal.doubts
    true = structure.residual(*PAIRS)
    assert np.sqrt(np.mean((compute_residuals(modal, *PAIRS) - true) ** 2)) < 0.02


@pytest.mark.parametrize("noise", [0.01, 0.02])
def test_noise_widens_the_band_and_the_truth_stays_in_it(noise: float) -> None:
    shares = []
    drawn = [*((seed, 2 + seed % 3) for seed in range(1, 10)), (1117, 4)]
    for seed, count in drawn:
        structure = LinearStructure.draw(seed, count)
        energy = structure.elastic_energy(TIME)
        normal = np.random.default_rng(seed).standard_normal(TIME.size)
        clean = require(identify_modal(TIME, energy))
        noisy = require(identify_modal(TIME, energy + noise * np.ptp(energy) * normal))
        true = structure.residual(*PAIRS)
        _, low, high = noisy.residual_band(compute_residuals(noisy, *PAIRS), *PAIRS)
        shares.append(np.mean((true > low - 1e-3) & (true < high + 1e-3)))
        assert np.median(noisy.half_width(*PAIRS)) > np.median(clean.half_width(*PAIRS))
    assert min(shares) > 0.95


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 5))
def test_the_kinetic_energy_says_the_same(seed: int, count: int) -> None:
    structure = LinearStructure.draw(seed, count)
    internal = require(identify_modal(TIME, structure.elastic_energy(TIME)))
    kinetic = require(
        identify_modal(
            TIME,
            structure.kinetic_energy(TIME) + 40.0 * np.ones(TIME.size),
            kinetic=True,
        )
    )
    assert (
        np.sqrt(
            np.mean(
                (compute_residuals(kinetic, *PAIRS) - structure.residual(*PAIRS)) ** 2
            )
        )
        < 0.02
    )
    confirmed = require(confirm_by_kinetic_energy(internal, kinetic))
    assert confirmed.second is kinetic
    assert np.all(confirmed.half_width(*PAIRS) >= internal.half_width(*PAIRS))


def test_the_kinetic_energy_decides_where_the_internal_one_is_refused() -> None:
    structure = LinearStructure.draw(4, 3)
    kinetic = require(
        identify_modal(TIME, structure.kinetic_energy(TIME), kinetic=True)
    )
    flowing = (
        40.0 + 0.5 * np.cumsum(np.random.default_rng(1).standard_normal(TIME.size)) / 5
    )
    drifting = require(identify_modal(TIME, structure.elastic_energy(TIME) + flowing))
    assert not drifting.signed
    assert confirm_by_kinetic_energy(drifting, None) is drifting
    calm = replace(drifting, doubts=drifting.doubts._replace(beyond=0.0))
    assert confirm_by_kinetic_energy(calm, kinetic) is kinetic
    assert (
        confirm_by_kinetic_energy(
            replace(calm, doubts=calm.doubts._replace(beyond=0.5)), kinetic
        )
        is not kinetic
    )
    lacking = require(identify_modal(TIME, 0.2 * structure.elastic_energy(TIME)))
    lacking = replace(lacking, doubts=calm.doubts)
    assert (
        confirm_by_kinetic_energy(lacking, kinetic) is lacking
    )  # it has less energy than what vibrates
    assert "kinetic energy" in kinetic.told


def test_the_kinetic_energy_does_not_decide_where_a_deformation_relaxes() -> None:
    """A deformation that creeps back moves the parts, but hardly any of its energy is kinetic."""
    structure = LinearStructure.draw(4, 3)
    kinetic = require(
        identify_modal(TIME, structure.kinetic_energy(TIME), kinetic=True)
    )
    relaxing = 40.0 * np.exp(-TIME / 2.0)
    falling = require(identify_modal(TIME, structure.elastic_energy(TIME) + relaxing))
    assert not falling.signed
    assert confirm_by_kinetic_energy(falling, kinetic) is falling
    rising = require(
        identify_modal(TIME, structure.elastic_energy(TIME) - relaxing + 40.0)
    )
    assert rising.signed, (
        rising.doubts
    )  # Heat rises like this, and the lines stay as they are.


@pytest.mark.parametrize("stretch", [0.3, 1.0])
def test_a_stretch_by_spin_is_no_mode(stretch: float) -> None:
    structure = LinearStructure.draw(11, 3)
    about = structure.deformations(TIME)
    about[0] += stretch * structure.amplitude[0]
    modal = require(identify_modal(TIME, np.sum(about**2, axis=0)))
    assert not modal.reading.is_mode.all()
    assert (
        np.sqrt(
            np.mean(
                (compute_residuals(modal, *PAIRS) - structure.residual(*PAIRS)) ** 2
            )
        )
        < 0.03
    )


def compute_rubbed_energy() -> Samples:
    """Return the energy of a mass on a spring with dry friction: its amplitude drops by the same amount each cycle."""
    position, speed, step = 1.0, 0.0, 2e-3
    positions = []
    for _ in range(4500):
        speed -= step * (40.0 * position + 0.3 * np.sign(speed))
        position += step * speed
        positions.append(position)
    return np.square(positions)


@pytest.mark.parametrize(("third", "is_harmonic"), [(0.2, True), (30.0, False)])
def test_a_locked_line_is_a_harmonic_only_below_what_it_belongs_to(
    third: float, is_harmonic: bool
) -> None:
    """Modes at twice and three times the frequency of a weak one may begin in phase with it."""
    energy = (
        np.cos(8 * TIME) ** 2
        + 0.3 * np.cos(16 * TIME) ** 2
        + third * np.cos(24 * TIME) ** 2
    )
    modal = require(identify_modal(TIME, energy))
    assert (modal.doubts.refusal is not None) == is_harmonic


@pytest.mark.parametrize(
    ("energy", "reason"),
    [
        (compute_rubbed_energy()[::3], "predict|lines"),
        (
            np.cumsum(np.random.default_rng(2).standard_normal(1500)),
            "predict|lines|mean",
        ),
        (np.cos(np.arange(400) * 1.42) ** 2, "states per period"),
    ],
    ids=["friction", "random walk", "coarse"],
)
def test_what_is_no_linear_structure_is_refused(energy: Samples, reason: str) -> None:
    modal = require(identify_modal(np.linspace(0.0, 9.0, energy.size), energy))
    refusal = require(modal.doubts.refusal)
    assert any(word in refusal for word in reason.split("|")), refusal


@pytest.mark.parametrize(
    "energy",
    [np.full(500, 3.0), 2.0 - np.linspace(0, 1, 500)],
    ids=["still", "no swing"],
)
def test_without_lines_there_are_no_modes(energy: Samples) -> None:
    modal = identify_modal(np.linspace(0.0, 1.0, energy.size), energy)
    assert modal is None or not modal.signed
    assert identify_modal(np.linspace(0.0, 1.0, 20), np.arange(20.0)) is None


def test_nothing_above_single_precision_is_no_vibration() -> None:
    random = np.random.default_rng(1)
    assert identify_modal(TIME, 1e3 + 1e-5 * random.standard_normal(TIME.size)) is None


def compute_true_residual(tr: float, td: float) -> float:
    """Return R of one pair from the motion."""
    return float(STRUCTURE.residual(np.array([tr]), np.array([td]))[0])


@pytest.mark.parametrize("td", [5.0, 6.3, 7.7, 8.6])
def test_the_pair_that_is_recommended_is_the_best_there_is(td: float) -> None:
    answer = suggest_in_history(LOADED, td, Settings(after=1.0))
    best = require(answer.chosen)
    assert answer.situation.basis == "modal"
    assert best.residual == pytest.approx(compute_true_residual(best.tr, td), abs=0.02)
    early = np.linspace(1.0, td - 0.25 * (td - 1.0), 2000)
    oracle = float(STRUCTURE.residual(early, np.full(early.size, td)).min())
    assert compute_true_residual(best.tr, td) < oracle + 0.03
    verdict = verify_in_history(LOADED, best.tr, td, Settings(after=1.0))
    assert verdict.candidate.residual == pytest.approx(best.residual, abs=1e-9)
    assert require(verdict.quality).grade == require(answer.quality).grade


def test_no_pair_worse_than_no_vibration_is_accepted_while_a_better_one_is_there() -> (
    None
):
    answer = suggest_in_history(LOADED, 7.7, Settings(after=1.0))
    assert min(require(candidate.residual) for candidate in answer.candidates) < 1
    assert all(
        require(candidate.residual) <= 1.01
        for candidate in answer.candidates
        if candidate.acceptable
    )
    worst = max(
        np.linspace(1.1, 6.0, 500).tolist(),
        key=lambda tr: compute_true_residual(tr, 7.7),
    )
    verdict = verify_in_history(LOADED, worst, 7.7, Settings(after=1.0))
    assert not verdict.verified
    assert any(
        "the residual of a release without any vibration" in reason
        for reason in verdict.reasons
    )


def test_if_nothing_keeps_the_vibration_the_least_deformed_time_is_offered() -> None:
    """If nearly all energy is kinetic at td, no tr is better than a release without any vibration."""
    tds = np.linspace(4.0, 8.5, 600)
    share = STRUCTURE.kinetic_energy(tds) / (
        STRUCTURE.kinetic_energy(tds) + STRUCTURE.elastic_energy(tds)
    )
    td = float(tds[np.argmax(share)])
    situation = suggest_in_history(LOADED, td, Settings(after=1.0)).situation
    vibration = situation.vibration
    raised = replace(
        vibration, compared=require(vibration.compared)._replace(first=float(td - 0.4))
    )
    for record in (vibration, raised):
        if record.keeps_nothing:
            moments = record.moments(0.2)
            energies = STRUCTURE.elastic_energy(moments.tr)
            assert energies.min() < 0.2 * STRUCTURE.elastic_energy(TIME).max()
    assert situation.kinetic_share is not None


def test_td_is_chosen_where_the_residual_is_least() -> None:
    from tests.energies import suggest_in_window

    answer = suggest_in_window(LOADED, (4.0, 8.8), Settings(after=1.0))
    best = require(answer.recommended)
    assert best.rigid_time > 0.4 * (8.8 - 1.0)
    assert compute_true_residual(best.tr, best.td) == pytest.approx(
        require(best.residual), abs=0.02
    )
    for td in (5.0, 6.3, 7.7, 8.6):
        suggestion = suggest_in_history(LOADED, td, Settings(after=1.0)).recommended
        assert (
            require(best.residual) <= require(require(suggestion).residual) + 0.02
            or require(suggestion).rigid_time < 3.9
        )


def test_a_weak_mode_of_few_states_is_told_of() -> None:
    """Its line is too weak for strong modes, and shows that faster modes may be invisible in the record."""
    for rate, is_coarse in ((3.3, False), (30.3, True)):
        time = np.linspace(0.0, 6.0, 1200)
        strong = np.cos(2 * np.pi * time) ** 2 + 0.7 * np.cos(14.3 * time) ** 2
        weak = 0.08 * np.cos(2 * np.pi * rate * time + 0.4) ** 2
        modal = require(identify_modal(time, strong + weak))
        assert modal.doubts.coarse > 4.0
        assert (modal.states_per_period < 4.0) == is_coarse


def test_a_profile_without_two_times_has_no_interval() -> None:
    empty = Profile(np.empty(0), np.empty(0))
    assert np.all(np.isinf(empty.cell(np.array([0.3, 0.7]))))
