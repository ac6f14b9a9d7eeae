"""True residuals for comparison: closed forms agree with integration, and records with physics."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from d2rpick.histories.history import Samples
from tests.benchmarks.promise import CLASSES, Pair, Trial, count_group, tabulate
from tests.benchmarks.promise_linear import (
    draw_exchange,
    draw_hinge,
    draw_spin,
    few_modes,
    make_linear,
)
from tests.benchmarks.promise_modes import Load, Modes
from tests.benchmarks.promise_records import INTEGRATED
from tests.benchmarks.promise_structure import IntegratedRun, Joint, Structure
from tests.benchmarks.promise_truth import Truth

MODES = Modes(
    rate=np.array([6.0, 13.0, 14.0]),
    decay=np.array([0.2, 0.05, 1.5]),
    loads=[
        Load(0.3, 0.7, np.array([1.0, -0.4, 0.3])),
        Load(0.8, 0.05, np.array([0.5, 2.0, -3.0])),
        Load(1.1, 0.4, np.array([0.2, 0.3, -0.7]), fades=True),
    ],
)
END = 4.0


def integrate(modes: Modes, time: Samples) -> Samples:
    """Integrate the modes from equilibrium under their preload; return q and q', shape (2 k, n)."""

    def slope(t: float, state: Samples) -> Samples:
        deformation, velocity = np.split(state, 2)
        held = sum(
            load.evaluate(np.array([t]))[0] * load.heights for load in modes.loads
        )
        return np.concatenate(
            [
                velocity,
                modes.undamped**2 * (held - deformation) - 2 * modes.decay * velocity,
            ]
        )

    preload = sum(load.heights for load in modes.loads if load.fades)
    start = np.concatenate(
        [np.broadcast_to(preload, modes.rate.shape), np.zeros(modes.rate.size)]
    )
    answer = solve_ivp(
        slope, (0.0, time[-1]), start, t_eval=time, max_step=0.01, rtol=1e-8, atol=1e-10
    )
    return np.asarray(answer.y)


def test_the_closed_form_is_the_integrated_motion() -> None:
    time = np.linspace(0.0, END, 60)
    deformation, velocity = MODES.compute_states(time)
    assert np.concatenate([deformation.T, velocity.T]) == pytest.approx(
        integrate(MODES, time), abs=1e-5
    )


@pytest.mark.parametrize("load", MODES.loads)
def test_the_impulse_of_a_load_is_its_integral(load: Load) -> None:
    time = np.linspace(0.0, 2.0, 20001)
    course = load.evaluate(time)
    integral = np.append(0.0, np.cumsum((course[1:] + course[:-1]) / 2 * np.diff(time)))
    assert load.integrate(time) == pytest.approx(integral, abs=1e-6)


def test_the_residual_is_given_by_the_energy_halfway() -> None:
    """The midpoint identity holds for any damping and does not depend on the signs of the modes."""
    truth = Truth(MODES, (MODES.loaded_until, END))
    tr, td = 2.1, 3.3
    halfway = (tr + td) / 2
    (state_at_tr, middle, state_at_td), (_, middle_rate, after_rate) = (
        MODES.compute_states(np.array([tr, halfway, td]))
    )
    # The amplitude of each mode at the middle time, from its state there.
    quadrature = (middle_rate + MODES.decay * middle) / MODES.rate
    amplitudes = middle**2 + quadrature**2
    product = np.sum(
        middle**2 - amplitudes / 2 + amplitudes * np.cos(MODES.rate * (td - tr)) / 2
    )
    size = np.sum(state_at_td**2 + (after_rate / MODES.undamped) ** 2)
    expected = np.sqrt(1 + (np.sum(state_at_tr**2) - 2 * product) / size)
    assert truth.compute_residual(tr, td) == pytest.approx(expected, rel=1e-6)


def test_both_ways_to_the_truth_agree() -> None:
    rates, heights = np.array([6.0, 13.0]), np.array([1.0, -0.4])
    modes = Modes(rates, np.zeros(2), [Load(0.3, 0.7, heights)])
    pushes = np.array([[0.3, 1.0, *(heights * rates**2)]])
    structure = Structure(rates, 0.0, np.zeros(2), pushes)
    integrated = IntegratedRun(structure, structure.move(0.0, END, np.zeros(4)))
    first, second = Truth(modes, (1.0, END)), Truth(integrated, (1.0, END))
    for tr, td in ((1.2, 2.0), (1.9, 3.1), (2.5, 3.95)):
        # Over the compared times, the sum is divided unevenly between kinetic and elastic energy of the difference.
        assert second.compute_residual(tr, td) == pytest.approx(
            first.compute_residual(tr, td), rel=0.02
        )
    assert second.find_least_residual(3.1) == pytest.approx(
        first.find_least_residual(3.1), abs=0.02
    )


def test_with_one_mode_the_least_residual_is_the_kinetic_share() -> None:
    rate = 6.0
    modes = Modes(np.array([rate]), np.zeros(1), [Load(0.3, 0.7, np.ones(1))])
    truth = Truth(modes, (1.0, 9.0), unit=1e3)
    deformation, velocity = modes.compute_states(np.array([8.0]))
    kinetic = (velocity[0, 0] / rate) ** 2
    share = kinetic / (kinetic + deformation[0, 0] ** 2)
    assert truth.find_least_residual(8000.0) == pytest.approx(np.sqrt(share), abs=1e-3)
    assert truth.find_least_residual(None, 3000.0) == pytest.approx(0.0, abs=0.01)


def test_a_longer_rigid_time_leaves_the_oracle_less_choice() -> None:
    truth = Truth(MODES, (MODES.loaded_until, END))
    errors = [
        truth.find_least_residual(None, shortest) for shortest in (0.1, 1.0, 2.0, 2.4)
    ]
    assert errors == sorted(errors)
    assert errors[-1] > errors[0] + 0.1


@pytest.mark.parametrize("draw_stretch", [draw_spin, draw_hinge])
def test_of_a_slow_stretch_only_its_change_makes_an_error(draw_stretch: Any) -> None:
    random = partial(np.random.default_rng, 3)
    still, stretched = (
        make_linear(random(), shapes=few_modes, stretch=stretch).truth.vibration
        for stretch in (None, draw_stretch)
    )
    assert isinstance(still, Modes)
    assert isinstance(stretched, Modes)
    stretch = stretched.stretch
    assert stretch is not None
    time = still.loaded_until + np.array([0.5, 1.5]) / still.rate[0]
    assert stretched.follow(time)[1] == pytest.approx(
        still.follow(time)[1]
    )  # the vibration has the same size
    change = np.ptp(stretch.course(time)) * stretch.heights
    between = np.diff(stretched.release(time), axis=0) - np.diff(
        still.release(time), axis=0
    )
    assert np.abs(between[0, : change.size]) == pytest.approx(np.abs(change), abs=1e-9)
    assert (np.abs(change).max() > 1e-6) == (draw_stretch is draw_hinge)
    step = 1e-7 / still.rate[0]
    slope = (stretch.course(time + step) - stretch.course(time - step)) / (2 * step)
    assert stretch.rate(time) == pytest.approx(
        slope, rel=1e-4, abs=1e-6 * float(still.rate[0])
    )


def test_the_parts_of_an_exchange_share_one_energy_that_only_damping_takes() -> None:
    shapes = draw_exchange(np.random.default_rng(4))
    assert shapes.parts is not None
    load = Load(
        0.1, 0.4, shapes.local @ np.append(1.0, np.zeros(shapes.ratios.size - 1))
    )
    modes = Modes(
        shapes.ratios, np.zeros_like(shapes.ratios), [load], parts=shapes.parts
    )
    elastic, kinetic = modes.compute_energies(np.linspace(0.5, 400.0, 3000))
    whole = elastic.sum(axis=1) + kinetic
    assert whole == pytest.approx(np.full_like(whole, whole[0]))
    early, late = (elastic[part] for part in (slice(0, 60), slice(None)))
    assert early[:, 0].max() > 3 * early[:, 1].max()  # only the frame was pushed
    assert late[:, 1].max() > 3 * early[:, 1].max()


def test_a_gap_keeps_the_energy_and_friction_takes_it() -> None:
    rates, row = np.array([6.0, 13.0]), np.array([0.6, 0.8])
    start = np.array([1.0, 0.5, 0.0, 0.0])
    time = np.linspace(0.0, 5.0, 200)
    for joint, least_energy in (
        (Joint(row, stiffness=20.0, gap=0.4), 0.999),
        (Joint(row, friction=0.05, creep=0.05), 0.0),
    ):
        structure = Structure(rates, 0.0, np.zeros(2), np.zeros((0, 4)), joint)
        states = structure.move(0.0, 5.0, start)(time)
        elastic, kinetic = structure.compute_energies(states)
        energy = (elastic + kinetic).sum(axis=0) + joint.compute_energy(
            np.split(states, 2)[0]
        )
        assert np.all(np.diff(energy) < 1e-3 * energy[0])
        assert least_energy * energy[0] <= energy[-1] <= 1.001 * energy[0]
        assert (energy[-1] < 0.8 * energy[0]) == (joint.friction > 0)


@pytest.mark.parametrize("name", CLASSES)
def test_a_class_makes_whole_records(name: str) -> None:
    record = CLASSES[name](np.random.default_rng([3, 7]))
    columns = record.columns
    assert np.all(np.diff(columns["time"]) > 0)
    assert all(np.all(np.isfinite(values)) for values in columns.values())
    start, end = record.truth.flight_of_file
    assert 0 < start < end
    assert columns["time"][-1] == pytest.approx(end, rel=0.1)
    assert start <= record.suggest.get("td", end) <= end
    assert set(record.read.get("energy", ["internal_energy"])) <= set(columns)
    assert (
        name in INTEGRATED
        or 0 <= record.truth.find_least_residual(record.suggest.get("td"), 0.0) < 2
    )


def test_what_became_of_records_is_counted() -> None:
    pair = Pair(0.1, 0.9, 0.15, 0.1, 0.05, 0.2, "good", "modes")
    trials = [
        Trial(pair, td_asked=0.9, oracle=0.1, flight_start=0.2, flight_end=1.0),
        Trial(pair._replace(true=1.2, grade="fair"), oracle=0.1),
        Trial(
            pair._replace(
                true=1.4,
                residual=None,
                low=None,
                high=None,
                grade="fair",
                basis="energy",
            ),
            oracle=0.3,
        ),
        Trial(None, oracle=0.1, error="no flight"),
    ]
    assert count_group(tabulate("modes", trials)) == {
        "records": 4,
        "pairs": 3,
        "tr in load": 1,
        "R>1": "2/3",
        "R>1, said <1": "1/2",
        "free R (oracle)": "1.30 (0.20) n=2",
        "given R (oracle)": "0.15 (0.10) n=1",
        "unstated: free": "1.40 (0.30) n=1",
        "given": "-",
        "R>0.3, said <0.25": "1/2",
        "good of oracle<0.2": "1/3",
        "good, R>0.3": "0/1",
        "in band": "0.500 of 2",
        "+-0.05": "0.500 of 2",
        "worst above": "1.00",
        "by basis": "modes 2, energy 1",
    }
