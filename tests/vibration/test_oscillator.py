"""Closed forms compared with independent numbers, scipy's integrator, and laws of mechanics."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp

from d2rpick.base.errors import RangeError
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator import (
    Oscillator,
    Replay,
    State,
    compute_trajectory,
    make_from_mode,
    to_mode,
)
from tests import paper
from tests.records import MODES

# zero, or of a size that an integrator's absolute tolerance does not hide
numbers = st.one_of(st.just(0.0), st.floats(1e-3, 2.0), st.floats(-2.0, -1e-3))
states = st.builds(State.of, numbers, numbers, numbers, numbers)
# damping rates from zero through the critical one (alpha/2 = omega_0) to far beyond it
oscillators = st.builds(
    lambda stiffness, mass, beta, ratio: Oscillator(
        stiffness, mass, mass / beta, 2 * ratio * np.sqrt(stiffness * (1 + beta) / mass)
    ),
    st.floats(0.1, 1e3),
    st.floats(0.1, 10),
    st.floats(0.1, 10),
    st.one_of(
        st.just(0.0), st.just(1.0), st.floats(0, 3), st.floats(0.999999, 1.000001)
    ),
)


def scale(oscillator: Oscillator, start: State) -> float:
    """Return the largest displacement and velocity that the motion can reach, as a scale for errors."""
    return (
        float(
            np.sum(np.abs(start)) * max(1, oscillator.omega_0, 1 / oscillator.omega_0)
        )
        + 1e-30
    )


@pytest.mark.parametrize("row", paper.REFERENCE)
def test_free_motion_has_the_digits_of_an_independent_computation(
    row: tuple[float, ...],
) -> None:
    state = paper.OSCILLATOR.free(paper.START, row[0])
    np.testing.assert_allclose(
        [*state, paper.OSCILLATOR.internal_energy(state)], row[1:], rtol=1e-11
    )


def test_free_motion_is_the_published_formula() -> None:
    # (7) with s and e as the paper defines them
    beta, alpha, v0 = 2.0, 50.0, 6.0
    t = np.linspace(0, 0.15, 301)
    s, e = (1 - np.exp(-alpha * t)) / alpha, np.exp(-alpha * t / 2)
    swing = e * np.sin(paper.OMEGA_2 * t) / paper.OMEGA_2
    state = paper.OSCILLATOR.free(paper.START, t)
    np.testing.assert_allclose(
        state.z, v0 / (1 + beta) * (s + beta * swing), atol=1e-15
    )
    np.testing.assert_allclose(state.y, v0 / (1 + beta) * (s - swing), atol=1e-15)


@given(oscillators, states, st.floats(0.1, 3.0))
def test_free_motion_agrees_with_an_integrator(
    oscillator: Oscillator, start: State, periods: float
) -> None:
    m, mass, k, alpha = (
        oscillator.frame_mass,
        oscillator.mass,
        oscillator.stiffness,
        oscillator.alpha,
    )

    def equations_of_motion(_: float, u: np.ndarray) -> list[float]:  # (1)
        z, y, vz, vy = u
        return [vz, vy, k * (y - z) / m - alpha * vz, -k * (y - z) / mass - alpha * vy]

    end = periods * 2 * np.pi / oscillator.omega_0
    solution = solve_ivp(
        equations_of_motion,
        (0, end),
        list(start),
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
    )
    assert solution.success
    room = 1e-9 * scale(oscillator, start)
    np.testing.assert_allclose(
        np.stack(oscillator.free(start, end)), solution.y[:, -1], atol=room, rtol=1e-9
    )


@given(oscillators, states, st.floats(0, 5))
def test_the_centre_of_mass_ignores_the_switch(
    oscillator: Oscillator, start: State, elapsed: float
) -> None:
    def momentum(state: State) -> float:
        return float(oscillator.frame_mass * state.vz + oscillator.mass * state.vy)

    free, rigid = oscillator.free(start, elapsed), oscillator.rigid(start, elapsed)
    assert momentum(rigid) == pytest.approx(
        momentum(free), abs=1e-10 * scale(oscillator, start) * oscillator.mass
    )
    assert momentum(rigid) == pytest.approx(
        momentum(start) * np.exp(-oscillator.alpha * elapsed), abs=1e-9
    )
    assert float(rigid.y - rigid.z) == pytest.approx(
        float(start.y - start.z), abs=1e-12 * scale(oscillator, start)
    )
    assert float(rigid.vy) == float(rigid.vz)


@given(states)
def test_without_damping_energy_is_kept(start: State) -> None:
    oscillator = Oscillator(stiffness=3.0, mass=2.0, frame_mass=0.7)
    later = oscillator.free(start, np.linspace(0, 20, 50))
    total = oscillator.internal_energy(later) + oscillator.kinetic_energy(later)
    np.testing.assert_allclose(
        total,
        oscillator.internal_energy(start) + oscillator.kinetic_energy(start),
        rtol=1e-10,
    )


@given(states, st.floats(0.2, 3))
def test_damping_shrinks_to_none(start: State, elapsed: float) -> None:
    undamped = Oscillator(2.0, 1.0, 0.5).free(start, elapsed)
    nearly = Oscillator(2.0, 1.0, 0.5, alpha=1e-13).free(start, elapsed)
    np.testing.assert_allclose(np.stack(nearly), np.stack(undamped), atol=1e-11)


@given(oscillators, states, st.integers(1, 400))
def test_the_grid_gives_what_single_times_give(
    oscillator: Oscillator, start: State, count: int
) -> None:
    step = 0.01 / oscillator.omega_0
    grid = oscillator.free_on_grid(start, step, count)
    single = oscillator.free(start, step * np.arange(count))
    assert grid.z.shape == (count,)
    np.testing.assert_allclose(
        np.stack(grid), np.stack(single), atol=1e-11 * scale(oscillator, start)
    )


def test_the_loss_at_the_switch_is_the_vibration_part_of_the_kinetic_energy() -> None:
    start_of_rigid = paper.OSCILLATOR.free(paper.START, 0.006)
    rigid_state = paper.OSCILLATOR.rigid(start_of_rigid, 0.0)
    lost = paper.OSCILLATOR.kinetic_energy(
        start_of_rigid
    ) - paper.OSCILLATOR.kinetic_energy(rigid_state)
    vibration = paper.OSCILLATOR.vibration_energy(
        start_of_rigid
    ) - paper.OSCILLATOR.internal_energy(start_of_rigid)
    assert float(lost) == pytest.approx(float(vibration), rel=1e-9)


@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: Oscillator(0.0, 1.0, 1.0), "^stiffness is "),
        (lambda: Oscillator(1.0, -1.0, 1.0), "^mass is "),
        (lambda: Oscillator(1.0, 1.0, float("nan")), "^frame_mass is "),
        (lambda: Oscillator(1.0, 1.0, 1.0, float("inf")), "^alpha is "),
        (
            lambda: Replay(paper.OSCILLATOR, paper.START, 0.0, 0.08, 0.06),
            "must be in this order",
        ),
        (
            lambda: to_mode(Oscillator(1.0, 1.0, 1.0, alpha=10.0), 1.0),
            "overdamps the oscillator",
        ),
    ],
)
def test_what_is_no_motion_is_refused(make: Callable[[], object], error: str) -> None:
    with pytest.raises(RangeError, match=error):
        make()


@pytest.mark.parametrize(
    ("tr", "td", "rows"),
    [(0.006, 0.080, paper.SWITCHED_6_80), (0.013, 0.064, paper.SWITCHED_13_64)],
)
def test_switched_motion_has_the_digits_of_an_independent_computation(
    tr: float, td: float, rows: tuple[tuple[float, ...], ...]
) -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, tr, td)
    table = np.array(rows)
    states = replay.motion(table[:, 0])
    np.testing.assert_allclose(np.stack(states, axis=1), table[:, 1:5], rtol=1e-11)
    np.testing.assert_allclose(
        paper.OSCILLATOR.internal_energy(states), table[:, 5], rtol=1e-10
    )


def test_the_spring_back_is_the_published_formula() -> None:
    # (18) with beta = 2, from the state at td that (9)-(12) give
    tr, td, alpha, beta, omega = 0.006, 0.080, 50.0, 2.0, paper.OMEGA_2
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, tr, td)
    state_at_td = replay.motion(td)
    tau = np.linspace(0, 0.07, 200)
    g = 1 - np.exp(-alpha * tau / 2) * (
        np.cos(omega * tau) + alpha / (2 * omega) * np.sin(omega * tau)
    )
    drift = state_at_td.vz * (1 - np.exp(-alpha * tau)) / alpha
    frozen = state_at_td.y - state_at_td.z
    later = replay.motion(td + tau)
    np.testing.assert_allclose(
        later.z, state_at_td.z + drift + beta * frozen / (1 + beta) * g, atol=1e-15
    )
    np.testing.assert_allclose(
        later.y, state_at_td.y + drift - frozen / (1 + beta) * g, atol=1e-15
    )


@given(MODES, st.floats(0, 3), st.floats(0.01, 2))
def test_the_residual_stays_what_it_is_at_td_while_nothing_damps(
    mode: Mode, tr: float, window: float
) -> None:
    still = Mode(mode.omega, 0.0, mode.cosine, mode.sine, mode.origin)
    oscillator, start = make_from_mode(still, tr)
    replay = Replay(oscillator, start, tr, tr, tr + window)
    later = tr + window + np.linspace(0, 3, 20)
    lack = State(
        *(
            a - b
            for a, b in zip(replay.motion(later), replay.reference(later), strict=True)
        )
    )
    share = oscillator.vibration_energy(lack) / oscillator.vibration_energy(
        replay.reference(later)
    )
    np.testing.assert_allclose(np.sqrt(share), replay.residual(), atol=1e-7)


def test_td_on_an_energy_peak_continues_the_reference_exactly() -> None:
    replay = Replay(
        paper.OSCILLATOR, paper.START, 0.0, paper.BETTER_TR, paper.BETTER_TD
    )
    later = np.linspace(paper.BETTER_TD, 0.15, 100)
    switched, reference = replay.motion(later), replay.reference(later)
    np.testing.assert_allclose(
        switched.y - switched.z, reference.y - reference.z, atol=1e-14
    )
    assert replay.residual() < 1e-10


def test_at_tr_itself_stands_the_state_after_the_switch() -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, 0.006, 0.08)
    motion = compute_trajectory(paper.OSCILLATOR, paper.START, 0.1, 0.001, replay)
    assert motion.time[6] == 0.006
    assert (
        motion.state.vz[6]
        == motion.state.vy[6]
        == pytest.approx(1.481636441363, rel=1e-11)
    )
    assert motion.state.vz[5] != motion.state.vy[5]


def test_the_grid_of_a_trajectory_ends_where_it_should() -> None:
    assert (
        compute_trajectory(paper.OSCILLATOR, paper.START, 0.15, 1e-4).time[-1] == 0.15
    )
    assert compute_trajectory(
        paper.OSCILLATOR, paper.START, 0.01, 0.003
    ).time.tolist() == [
        0.0,
        0.003,
        0.006,
        0.009,
    ]


def test_an_oscillator_given_as_mode_has_its_energy() -> None:
    mode, time = to_mode(paper.OSCILLATOR, 6.0), np.linspace(0, 0.15, 400)
    np.testing.assert_allclose(
        mode.energy(time), paper.compute_energy(time), atol=1e-12
    )
