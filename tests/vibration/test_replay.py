"""Switched motion against independent numbers, and what formulas say against what the motion does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from d2rpick.errors import RangeError
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator import Oscillator, State, from_mode, to_mode
from d2rpick.vibration.replay import Replay, trajectory
from tests import paper
from tests.records import MODES


@pytest.mark.parametrize(
    ("tr", "td", "rows"), [(0.006, 0.080, paper.SWITCHED_6_80), (0.013, 0.064, paper.SWITCHED_13_64)]
)
def test_switched_motion_has_the_digits_of_an_independent_computation(
    tr: float, td: float, rows: tuple[tuple[float, ...], ...]
) -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, tr, td)
    table = np.array(rows)
    states = replay.motion(table[:, 0])
    np.testing.assert_allclose(np.stack(states, axis=1), table[:, 1:5], rtol=1e-11)
    np.testing.assert_allclose(paper.OSCILLATOR.internal_energy(states), table[:, 5], rtol=1e-10)


def test_the_spring_back_is_the_published_formula() -> None:
    # (18) with beta = 2, from the state at td that (9)-(12) give
    tr, td, alpha, beta, omega = 0.006, 0.080, 50.0, 2.0, paper.OMEGA_2
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, tr, td)
    at = replay.motion(td)
    tau = np.linspace(0, 0.07, 200)
    g = 1 - np.exp(-alpha * tau / 2) * (np.cos(omega * tau) + alpha / (2 * omega) * np.sin(omega * tau))
    drift = at.vz * (1 - np.exp(-alpha * tau)) / alpha
    frozen = at.y - at.z
    later = replay.motion(td + tau)
    np.testing.assert_allclose(later.z, at.z + drift + beta * frozen / (1 + beta) * g, atol=1e-15)
    np.testing.assert_allclose(later.y, at.y + drift - frozen / (1 + beta) * g, atol=1e-15)


@settings(max_examples=40, deadline=None)
@given(MODES, st.floats(0, 3), st.floats(0.01, 2))
def test_the_residual_stays_what_it_is_at_td_while_nothing_damps(mode: Mode, tr: float, window: float) -> None:
    still = Mode(mode.omega, 0.0, mode.cosine, mode.sine, mode.origin)
    oscillator, start = from_mode(still, tr)
    replay = Replay(oscillator, start, tr, tr, tr + window)
    later = tr + window + np.linspace(0, 3, 20)
    lack = State(*(a - b for a, b in zip(replay.motion(later), replay.reference(later), strict=True)))
    share = oscillator.vibration_energy(lack) / oscillator.vibration_energy(replay.reference(later))
    np.testing.assert_allclose(np.sqrt(share), replay.residual(), atol=1e-7)


def test_td_on_an_energy_peak_continues_the_reference_exactly() -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, paper.BETTER_TR, paper.BETTER_TD)
    later = np.linspace(paper.BETTER_TD, 0.15, 100)
    switched, reference = replay.motion(later), replay.reference(later)
    np.testing.assert_allclose(switched.y - switched.z, reference.y - reference.z, atol=1e-14)
    assert replay.residual() < 1e-10


def test_a_rigid_phase_of_no_length_loses_the_vibration_velocity_only() -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, 0.01, 0.01)
    at, before = replay.motion(0.01), replay.reference(0.01)
    np.testing.assert_allclose([at.z, at.y], [before.z, before.y], rtol=1e-13)
    assert float(at.vz) == float(at.vy)


def test_at_tr_itself_stands_the_state_after_the_switch() -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, 0.006, 0.08)
    motion = trajectory(paper.OSCILLATOR, paper.START, 0.1, 0.001, replay)
    assert motion.time[6] == 0.006
    assert motion.state.vz[6] == motion.state.vy[6] == pytest.approx(1.481636441363, rel=1e-11)
    assert motion.state.vz[5] != motion.state.vy[5]


def test_the_grid_of_a_trajectory_ends_where_it_should() -> None:
    assert trajectory(paper.OSCILLATOR, paper.START, 0.15, 1e-4).time[-1] == 0.15
    assert trajectory(paper.OSCILLATOR, paper.START, 0.01, 0.003).time.tolist() == [0.0, 0.003, 0.006, 0.009]


def test_an_oscillator_given_as_mode_has_its_energy() -> None:
    mode, time = to_mode(paper.OSCILLATOR, 6.0), np.linspace(0, 0.15, 400)
    np.testing.assert_allclose(mode.energy(time), paper.energy(time), atol=1e-12)


def test_times_must_follow_each_other() -> None:
    with pytest.raises(RangeError, match="must be in this order"):
        Replay(paper.OSCILLATOR, paper.START, 0.0, 0.08, 0.06)


def test_an_overdamped_oscillator_has_no_mode() -> None:
    with pytest.raises(RangeError, match="overdamps the oscillator"):
        to_mode(Oscillator(1.0, 1.0, 1.0, alpha=10.0), 1.0)
