"""The rollover box: the laws of mechanics, what switching preserves, and the times of the published study."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.base.errors import RangeError
from d2rpick.models.box_model import (
    GRAVITY,
    Bars,
    Parameters,
    Truss,
    build_structure,
    compute_stiffest_rate,
)
from d2rpick.models.box_motion import SLIP, BoxMotion, Contact, RigidPoints
from d2rpick.models.box_run import (
    BOX,
    BoxWindow,
    Record,
    compare_box_runs,
    continue_motion,
    find_comparison_end,
    run_to,
    scan,
    scan_times,
    simulate,
)
from tests.energies import require

COARSE = Parameters(mesh=4, damping=1.0)
INTERVAL = 5e-4
ANGLES = st.floats(-np.pi, np.pi)
TIMES = st.integers(0, 12).map(lambda count: count / 100)

FALLING = Parameters(mesh=4, speed=0.5, drop=0.4, tilt=40.0, ground_stiffness=2e6)


def momenta(motion: BoxMotion) -> tuple[complex, float]:
    """Return momentum and angular momentum about the origin of the whole model."""
    point_momenta = motion.structure.masses * motion.velocities
    return complex(point_momenta.sum()), float(
        np.vdot(motion.places, point_momenta).imag
    )


@cache
def advance_to(time: float) -> BoxMotion:
    """Return a motion advanced to ``time``; it is cached and must not be changed."""
    motion = (
        advance_to(round(time - 0.01, 2)).copy()
        if time > 0
        else BoxMotion(COARSE, INTERVAL)
    )
    run_to(motion, time)
    return motion


def copy_at(time: float) -> BoxMotion:
    """Return a copy of a motion advanced to ``time``, a multiple of 0.01 s."""
    return advance_to(time).copy()


@cache
def simulate_box(parameters: Parameters, *windows: BoxWindow) -> Record:
    """Compute a run through trip or fall, flight and landing."""
    return simulate(
        parameters, 1.2 if parameters.drop else 0.42, *windows, interval=INTERVAL
    )


@pytest.mark.parametrize(
    ("parameters", "windows"),
    [
        (COARSE, ()),
        (COARSE, (BoxWindow(0.1, 0.2), BoxWindow(0.3, 0.35))),
        (COARSE, (BoxWindow(0.1, 0.2, with_step=True), BoxWindow(0.3, 0.35))),
        (
            Parameters(mesh=6, stiffness=2e6, yield_strain=2e-3),
            (BoxWindow(0.03, 0.2),),
        ),
    ],
)
def test_energy_is_balanced_within_one_percent_through_trip_flight_and_landing(
    parameters: Parameters, windows: tuple[BoxWindow, ...]
) -> None:
    run = simulate_box(parameters, *windows)
    assert run.landed is not None
    assert np.abs(run.imbalance).max() < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    "windows",
    [(), (BoxWindow(0.0, 0.28),), (BoxWindow(0.0, 0.28), BoxWindow(0.45, 0.5))],
)
def test_a_box_that_falls_bounces_and_its_energy_is_balanced_however_often_it_is_switched(
    windows: tuple[BoxWindow, ...],
) -> None:
    run = simulate_box(FALLING, *windows)
    assert np.abs(run.imbalance).max() < 0.01
    assert len(run.landings) >= 3
    assert run.landed == pytest.approx(
        np.sqrt(2 * 0.4 / GRAVITY), rel=0.01
    )  # damping slows the fall a little
    assert run.released is None
    start, end = run.landings[0][1], run.landings[1][0]
    flying = (run.time > start + INTERVAL) & (run.time < end - INTERVAL)
    assert np.ptp(run.friction_energy[flying]) == 0.0
    assert np.ptp(run.momentum.sum(axis=1).real[flying]) < 0.01 * np.ptp(
        run.momentum.sum(axis=1).imag
    )


def test_a_free_fall_locks_in_nothing_and_moves_no_landing() -> None:
    whole, switched = (
        simulate(FALLING, 0.62, *windows, interval=INTERVAL)
        for windows in ((), (BoxWindow(0.0, 0.28),))
    )
    assert whole.internal_energy[whole.time < 0.28].max() < 1e-9
    np.testing.assert_allclose(
        np.ravel(switched.landings[:2]), np.ravel(whole.landings[:2]), atol=1e-4
    )


@pytest.mark.parametrize(
    ("parameters", "window"), [(COARSE, (0.03, 0.35)), (FALLING, None)]
)
def test_momentum_and_angular_momentum_change_by_the_impulses_alone(
    window: tuple[float, float] | None, parameters: Parameters
) -> None:
    motion = BoxMotion(parameters, INTERVAL)
    linear, angular = momenta(motion)
    scale = motion.structure.masses.sum() * 7.0
    for count in range(motion.step_at(0.42)):
        if window and count == motion.step_at(window[0]):
            motion.make_rigid()
        if window and count == motion.step_at(window[1]):
            motion.make_deformable()
        motion.advance()
        now, turning = momenta(motion)
        assert abs(now - linear - motion.accounts.impulse) < 1e-9 * scale
        assert abs(turning - angular - motion.accounts.angular_impulse) < 1e-9 * scale
        motion.move()


@given(TIMES)
def test_the_switch_to_rigid_keeps_both_momenta_and_loses_kinetic_energy(
    tr: float,
) -> None:
    motion = copy_at(tr)
    motion.box.forces(motion.places)  # yields where it does at this step
    momenta_before, energy = momenta(motion), motion.box.internal_energy(motion.places)
    kinetic = float(motion.structure.masses @ np.abs(motion.velocities) ** 2) / 2
    motion.make_rigid()
    assert momenta(motion) == pytest.approx(momenta_before, rel=1e-10, abs=1e-8)
    lost = kinetic - float(motion.structure.masses @ np.abs(motion.velocities) ** 2) / 2
    assert lost >= -1e-9 * kinetic
    assert motion.accounts.lost == pytest.approx(lost, abs=1e-9 * kinetic)
    assert motion.box.internal_energy(motion.places) == energy


@settings(max_examples=8, deadline=None)
@given(TIMES, st.floats(0.0, 0.25))
def test_the_switch_back_keeps_both_momenta_and_the_frozen_energy_comes_back(
    tr: float, rigid: float
) -> None:
    motion = copy_at(tr)
    motion.make_rigid()
    frozen, pulls = (
        motion.box.internal_energy(motion.places),
        motion.box.forces(motion.places),
    )
    turned = require(motion.body).arms[0]
    run_to(motion, tr + rigid)
    turned = require(motion.body).arms[0] / turned
    momenta_before = momenta(motion)
    motion.make_deformable()
    assert momenta(motion) == momenta_before
    assert motion.box.internal_energy(motion.places) == pytest.approx(
        frozen, rel=1e-9, abs=1e-12
    )
    np.testing.assert_allclose(
        motion.box.forces(motion.places),
        pulls * turned,
        atol=1e-6 * (1 + np.abs(pulls).max()),
    )


@settings(max_examples=8, deadline=None)
@given(TIMES)
def test_a_rigid_phase_of_no_length_takes_the_vibration_velocity_and_nothing_else(
    tr: float,
) -> None:
    motion, untouched = copy_at(tr), copy_at(tr)
    motion.make_rigid()
    motion.make_deformable()
    np.testing.assert_array_equal(motion.places, untouched.places)
    lost = untouched.velocities - motion.velocities
    masses, of_box = motion.structure.masses, slice(motion.structure.of_box)
    assert not lost[motion.structure.of_box :].any()
    assert abs((masses * lost).sum()) < 1e-9 * masses.sum()
    assert (
        abs(np.vdot(motion.places[of_box], (masses * lost)[of_box]).imag)
        < 1e-9 * masses.sum()
    )
    rigid = RigidPoints(
        masses[of_box], motion.places[of_box], untouched.velocities[of_box]
    )
    np.testing.assert_allclose(motion.velocities[of_box], rigid.velocities)


def test_a_window_of_no_length_is_a_run_that_goes_on() -> None:
    run = simulate(COARSE, 0.2, BoxWindow(0.1, 0.1), interval=INTERVAL)
    assert run.lost_energy[-1] > 0
    assert run.internal_energy[run.time > 0.1, BOX].std() > 0


def test_while_it_is_rigid_the_box_keeps_its_energy_and_computes_no_bars() -> None:
    whole, switched = (
        simulate_box(COARSE),
        simulate_box(COARSE, BoxWindow(0.14, 0.42)),
    )
    rigid = switched.time > 0.14
    assert np.ptp(switched.internal_energy[rigid, BOX]) < 1e-9
    structure = build_structure(COARSE)
    of_box, of_step = structure.box.rest.size, structure.step.rest.size
    steps = whole.bar_updates / (of_box + of_step)
    assert switched.bar_updates == pytest.approx(
        steps * of_step + steps / 3 * of_box, rel=0.01
    )


def test_a_step_that_is_switched_with_the_box_moves_with_it_and_is_released_with_it() -> (
    None
):
    window = BoxWindow(0.14, 0.3, with_step=True)
    whole, switched = simulate_box(COARSE), simulate_box(COARSE, window)
    rigid = (switched.time > window.tr) & (switched.time < window.td)
    after = (switched.time > window.td) & (switched.time < 0.35)
    assert np.ptp(switched.internal_energy[rigid], axis=0).max() < 1e-9
    assert np.ptp(switched.internal_energy[after], axis=0).min() > 0
    # in flight the whole momentum does not depend on what is rigid
    np.testing.assert_allclose(
        switched.momentum[after].sum(axis=1),
        whole.momentum[after].sum(axis=1),
        rtol=1e-4,
    )
    structure = build_structure(COARSE)
    bars = structure.box.rest.size + structure.step.rest.size
    steps = whole.bar_updates / bars
    spared = (window.td - window.tr) / 0.42
    assert switched.bar_updates == pytest.approx(steps * (1 - spared) * bars, rel=0.01)


@given(ANGLES, st.integers(0, 2**32 - 1))
def test_bars_turn_with_their_points_and_push_nothing_as_a_whole(
    angle: float, seed: int
) -> None:
    structure = build_structure(COARSE)
    shaken = structure.places + 1e-4 * np.random.default_rng(seed).normal(
        size=structure.places.size
    )
    bars, turned_bars = (Bars(structure.box, structure.places.size) for _ in range(2))
    turn = np.exp(1j * angle)
    forces, turned = bars.forces(shaken), turned_bars.forces(shaken * turn + 3)
    scale = np.abs(forces).max()
    np.testing.assert_allclose(turned, forces * turn, atol=1e-6 * scale)
    assert abs(forces.sum()) < 1e-9 * scale
    assert abs(np.vdot(shaken, forces).imag) < 1e-9 * scale
    assert turned_bars.internal_energy(shaken * turn + 3) == pytest.approx(
        bars.internal_energy(shaken), rel=1e-6
    )


def test_forces_are_the_slope_of_the_elastic_energy() -> None:
    structure = build_structure(Parameters(mesh=4, yield_strain=1.0))
    bars = Bars(structure.box, structure.places.size)
    points = structure.places + 1e-3 * np.random.default_rng(1).normal(
        size=structure.places.size
    )
    forces = bars.forces(points)
    for point in (0, 7, 20):
        for step in (1e-6, 1e-6j):
            moved, back = points.copy(), points.copy()
            moved[point] += step
            back[point] -= step
            slope = (bars.internal_energy(moved) - bars.internal_energy(back)) / 2e-6
            assert slope == pytest.approx(
                -(forces[point] * np.conj(step)).real / 1e-6, rel=1e-5
            )


def test_a_bar_yields_at_its_strength_and_keeps_the_plastic_work() -> None:
    truss = Truss.between(
        np.array([0j, 1 + 0j]), [(0, 1)], axial=1e6, yield_strain=1e-3
    )
    bars = Bars(truss, 2)
    assert bars.forces(np.array([0j, 1.003 + 0j])).tolist() == pytest.approx(
        [1e3, -1e3]
    )
    assert bars.elastic_energy(np.array([0j, 1.003 + 0j])) == pytest.approx(0.5)
    assert bars.internal_energy(np.array([0j, 1.003 + 0j])) == pytest.approx(0.5 + 2.0)
    assert bars.forces(np.array([0j, 1.002 + 0j])).tolist() == pytest.approx(
        [0, 0], abs=1e-6
    )
    assert bars.internal_energy(np.array([0j, 1.002 + 0j])) == pytest.approx(2.0)


@pytest.mark.parametrize("mesh", [4, 7])
def test_no_mode_is_faster_than_the_stiffest_bar_says(mesh: int) -> None:
    structure = build_structure(Parameters(mesh=mesh))
    count = structure.places.size
    stiffness = np.zeros((2 * count, 2 * count))
    for truss in (structure.box, structure.step):
        for (first, second), rigidity in zip(truss.ends, truss.stiffness, strict=True):
            along = structure.places[second] - structure.places[first]
            row = np.zeros(2 * count)
            row[[2 * second, 2 * second + 1]] = (
                along.real / abs(along),
                along.imag / abs(along),
            )
            row[[2 * first, 2 * first + 1]] = -row[[2 * second, 2 * second + 1]]
            stiffness += rigidity * np.outer(row, row)
    masses = np.repeat(structure.masses, 2)
    fastest = np.sqrt(
        np.linalg.eigvalsh(stiffness / np.sqrt(np.outer(masses, masses)))[-1]
    )
    bound = compute_stiffest_rate(
        structure.masses, structure.box, structure.step, extra=np.zeros(count)
    )
    assert fastest <= bound <= 2 * fastest


def test_a_body_without_forces_moves_and_turns_evenly() -> None:
    masses, points = np.array([1.0, 2.0, 3.0]), np.array([0j, 1 + 0j, 1j])
    body = RigidPoints(
        masses, points, np.asarray(2.0 + 1j * 3.0 * (points - 0.5), dtype=np.complex128)
    )
    spin, velocity, centre = body.spin, body.velocity, body.centre
    for _ in range(100):
        body.push(np.zeros(3, dtype=complex), 0.0, 0.01)
        body.move(0.01)
    assert (body.spin, body.velocity) == (spin, velocity)
    expected = centre + velocity + (points - centre) * np.exp(1j * spin)
    np.testing.assert_allclose(body.places, expected, atol=1e-12)


def test_floor_and_ground_push_up_with_coulomb_friction_against_the_sliding() -> None:
    p = Parameters(tilt=0.0, mesh=4)
    structure = build_structure(p)
    for depth, level in ((0.001, 0.0), (0.002, -p.ground - 5.0)):
        contact = Contact(
            structure, Parameters(tilt=0.0, mesh=4, ground=p.ground + 5.0)
        )
        points = structure.places + 1j * (level - depth)
        push = require(
            contact.push(
                1.0,
                points - 1.0 + p.speed * p.braking / 2,
                np.full(points.size, 2.0 + 0j),
            )
        )
        normal = push.forces.imag
        assert normal.min() >= 0
        np.testing.assert_allclose(
            push.forces.real, -p.friction * normal * 2.0 / np.hypot(2.0, SLIP)
        )
        assert push.sled.normal.any() == (level == 0)


def test_the_cushion_is_crushed_for_good_at_its_force_until_it_is_solid() -> None:
    p = Parameters(tilt=0.0, mesh=4, friction=0.0)
    structure = build_structure(p)
    contact = Contact(structure, p)
    undeformed = structure.places + p.speed * p.braking / 2 + 0.01j

    def against(way: float) -> float:
        push = contact.push(
            1.0, undeformed + way, np.zeros(undeformed.size, dtype=complex)
        )
        return -push.forces[structure.toes[0]].real if push else 0.0

    forces = [against(way) for way in (0.02, 0.06, 0.1, 0.3 * p.cushion_depth)]
    assert forces[:2] == pytest.approx([min(p.cushion, 5e5 * 0.02), p.cushion])
    assert forces[2] >= p.cushion - 1e-6
    assert forces[3] == 0.0


def test_contact_sleeps_in_the_flight_and_misses_nothing() -> None:
    motion, awake = copy_at(0.1), copy_at(0.1)
    for _ in range(motion.step_at(0.32)):
        awake.contact._sleeps_until = 0.0
        for run in (motion, awake):
            run.advance()
            run.move()
    np.testing.assert_array_equal(motion.places, awake.places)


@pytest.mark.slow
def test_the_mean_energy_of_a_scan_and_its_errors_are_those_of_single_runs() -> None:
    reference, times, td = simulate_box(COARSE), [0.02, 0.15], 0.36
    alone = [
        compare_box_runs(reference, simulate_box(COARSE, BoxWindow(tr, td)), tr, td)
        for tr in times
    ]
    assert list(scan(COARSE, reference, times[::-1], td, jobs=1)) == alone
    assert list(scan(COARSE, reference, times, td, jobs=2)) == alone
    assert abs(alone[0].roll_error) > abs(alone[1].roll_error)


def test_a_run_goes_on_from_a_copy_as_it_would_have() -> None:
    motion = copy_at(0.08)
    twin = motion.copy()
    assert (
        continue_motion(twin, 0.12).roll.tolist()
        == continue_motion(motion, 0.12).roll.tolist()
    )


def test_times_of_a_scan_are_before_td_and_dense_in_the_trip() -> None:
    times = scan_times(0.086, 0.37)
    assert times == sorted(times)
    assert 0 < times[0] < times[-1] < 0.37
    assert sum(time < 0.086 for time in times) > 25
    assert scan_times(0.086, 0.0331)[0] == times[0]
    with pytest.raises(RangeError, match=r"earliest possible td is 0\.033"):
        scan_times(0.086, 0.0329)


def test_what_is_no_model_or_no_window_is_refused() -> None:
    for values in (
        {"mesh": 3},
        {"stiffness": 0.0},
        {"speed": float("nan")},
        {"friction": -0.1},
    ):
        with pytest.raises(RangeError, match=next(iter(values))):
            Parameters(**values)
    for refused, why in (
        (lambda: simulate(Parameters(stiffness=1e12), 100), "softer bars"),
        (lambda: BoxWindow(0.2, 0.1), "must be in this order"),
        (
            lambda: simulate(COARSE, 0.3, BoxWindow(0.1, 0.2), BoxWindow(0.15, 0.25)),
            "begins before the one up to",
        ),
        (
            lambda: find_comparison_end(simulate(COARSE, 0.05), 0.06),
            "end of the flight",
        ),
    ):
        with pytest.raises(RangeError, match=why):
            refused()


@pytest.mark.slow
def test_the_strength_of_the_roof_acts_after_the_landing_alone() -> None:
    """The roof yields when it hits the ground; until then the run is the same to the last digit."""
    base, weak = (
        simulate(Parameters(mesh=8, roof_strength=share), 0.42) for share in (1.0, 0.7)
    )
    before_landing = base.time < require(base.landed)
    np.testing.assert_array_equal(
        weak.internal_energy[before_landing], base.internal_energy[before_landing]
    )
    assert np.abs(weak.internal_energy - base.internal_energy).max() > 1.0
    with pytest.raises(RangeError, match="roof_strength is 0"):
        Parameters(roof_strength=0.0)
