"""No flight is claimed while forces act: walls that do no work, fading loads, friction, supports, other bodies."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.pair.warnings import warn_about_td
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.flight.flight import Flight
from d2rpick.flight.internal_energy import (
    find_settled_time,
    has_whole_motion,
    rises_as_it_yields,
)
from d2rpick.flight.momentum import find_bodies_apart, find_flight_around
from d2rpick.histories.history import (
    EXACT,
    Balance,
    History,
    Momenta,
    Precision,
    Samples,
)
from d2rpick.histories.names import Part
from d2rpick.histories.samples import integrate_by_trapezia
from tests.benchmarks import falls, flights as campaign
from tests.energies import require
from tests.records import make_table, round_as_printed
from tests.written_runs import FALL_WRITERS

PLAIN = Settings(replay=False)
TIME = np.linspace(0.0, 1.0, 1001)
ZERO = np.zeros(TIME.size)
PARTS = (Part(1, "body"), Part(2, "other"))


def make_momenta(
    *columns: Samples, masses: tuple[float, ...] = (10.0, 4.0), axis: int = 2
) -> Momenta:
    """Return momenta of parts along one axis."""
    values = np.zeros((TIME.size, len(columns), 3))
    values[:, :, axis] = np.stack(columns, axis=1)
    chosen = tuple(range(len(columns)))
    return Momenta(
        TIME,
        values,
        PARTS[: len(columns)],
        EXACT,
        chosen,
        masses=np.array(masses[: len(columns)]),
    )


def make_energy_table(internal: Samples, kinetic: Samples, **terms: Samples) -> History:
    """Return a history made from a table of energies."""
    return make_table(TIME, internal, balance=Balance(TIME, internal, kinetic, **terms))  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize("load", campaign.CLASSES)
def test_under_random_loads_no_flight_is_claimed_in_which_the_momentum_still_changes(
    load: str,
) -> None:
    random = np.random.default_rng(5)
    runs = campaign.compute_runs(
        random, 4, campaign.CLASSES[load](random, 4), falling=load != "friction"
    )
    counts = [
        (form, campaign.count_flights(run, form))
        for run in runs
        for form in campaign.FORMS
    ]
    assert not [form for form, count in counts if count["wrong"]]
    assert (
        load in ("friction", "fading")
        or sum(count["claimed"] for _, count in counts) > 10
    )


@pytest.mark.parametrize("gravity", [0.0, 9.81, 9.81e-3, 386.4])
@pytest.mark.parametrize(
    "fade", [lambda t: np.exp(-t / 0.04), lambda t: (1 + t / 0.05) ** -5.0]
)
def test_the_flight_behind_a_load_that_fades_is_found(
    gravity: float, fade: np.ufunc
) -> None:
    force = 1e4 * (gravity or 1.0) * fade(TIME)
    impulse = np.concatenate(
        [[0.0], np.cumsum((force[1:] + force[:-1]) / 2) * np.diff(TIME)]
    )
    flight = require(
        find_flight_around(make_momenta(impulse - 10.0 * gravity * TIME), 0.9)
    )
    start = int(np.searchsorted(TIME, flight.start))
    assert impulse[-1] - impulse[start] < 0.01 * np.abs(impulse).max()
    assert flight.start < 0.6
    assert flight.end == 1.0


@pytest.mark.parametrize(
    ("acceleration", "direction", "flies"),
    [
        (0.981, (1, 0, 0), False),  # friction coefficient 0.1
        (9.81, (1, 1, 0), False),  # not along an axis
        (9.81, (0, 0, 1), True),  # thrown straight up
        (9810.0, (0, 0, 1), True),
    ],
)
def test_what_only_slows_down_flies_where_its_acceleration_is_that_of_gravity_along_an_axis(
    acceleration: float, direction: tuple[int, int, int], flies: bool
) -> None:
    along = np.array(direction) / np.linalg.norm(direction)
    values = (20.0 * acceleration * (1 - 0.5 * TIME))[:, np.newaxis, np.newaxis] * along
    braked = Momenta(
        TIME, values, PARTS[:1], Precision(7), (0,), masses=np.array([10.0])
    )
    flight = find_flight_around(braked, 0.5)
    assert (flight is not None) is flies
    falling = replace(
        braked, values=braked.values - values[-1] * 1.5
    )  # it stands, then moves back
    assert find_flight_around(falling, 0.5) is not None


def integrate_force(force: Samples) -> Samples:
    """Return the integral of a force over TIME."""
    return np.concatenate([[0.0], np.cumsum((force[1:] + force[:-1]) / 2) * TIME[1]])


def make_momenta_in_plane(along_x: Samples, along_z: Samples) -> Momenta:
    """Return the momentum of one body of mass 10 in a plane, with seven digits."""
    values = np.zeros((TIME.size, 1, 3))
    values[:, 0, 0], values[:, 0, 2] = along_x, along_z
    values = round_as_printed(values.ravel(), 7).reshape(values.shape)
    return Momenta(TIME, values, PARTS[:1], Precision(7), (0,), masses=np.array([10.0]))


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_behind_a_power_law_little_may_still_change_and_gravity_shows_across_it(
    gravity: float,
) -> None:
    impulse = integrate_force(5e3 * (1 + TIME / 0.1) ** -3.1)
    flight = require(
        find_flight_around(
            make_momenta_in_plane(0.8 * impulse, 0.6 * impulse - 10 * gravity * TIME),
            0.95,
        )
    )
    assert flight.gravity == pytest.approx(gravity, rel=1e-3)
    remaining_change = impulse[-1] - impulse[int(np.searchsorted(TIME, flight.start))]
    assert 0.001 * impulse[-1] < remaining_change < 0.01 * impulse[-1]


def test_a_push_that_balances_the_weight_for_a_moment_is_no_flight() -> None:
    push = 3e2 * np.sin(np.pi * np.minimum(TIME / 0.6, 1))
    body = make_momenta_in_plane(
        0.8 * integrate_force(push), 0.6 * integrate_force(push) - 98.1 * TIME
    )
    flight = require(find_flight_around(body, 0.9))
    assert flight.start == pytest.approx(0.6, abs=0.02)
    assert not [
        td for td in np.linspace(0.02, 0.58, 29) if find_flight_around(body, td)
    ]


@pytest.mark.parametrize("end_velocity", [0.005, 0.0])
def test_what_hardly_moves_flies_if_it_goes_on_as_it_does(end_velocity: float) -> None:
    thrown = make_momenta(
        np.where(
            TIME < 0.3,
            500 * (end_velocity + (1 - end_velocity) * np.cos(np.pi * TIME / 0.6)),
            500 * end_velocity,
        )
    )
    assert bool(find_flight_around(thrown, 0.7)) is (end_velocity > 0)


@pytest.mark.parametrize("mass", [1.0, 10.0])
@pytest.mark.parametrize("acceleration", [5.0, 20.0, 0.3])
def test_a_constant_force_is_gravity_only_if_it_is_as_large(
    acceleration: float, mass: float
) -> None:
    push = (
        np.where(TIME < 0.2, 40 * mass * np.sin(np.pi * TIME / 0.2), 0.0).cumsum()
        / 1000
    )
    assert (
        find_flight_around(
            make_momenta(push - mass * acceleration * TIME, masses=(mass,)), 0.6
        )
        is None
    )
    assert find_flight_around(
        make_momenta(push - mass * 9.81 * TIME, masses=(mass,)), 0.6
    )


@pytest.mark.parametrize(
    "acceleration", [0.1, 0.4, 1.0, 1.62, 3.71, 5.0, 8.87, 15.0, 20.0]
)
@pytest.mark.parametrize("falling", [False, True])
def test_a_velocity_of_the_model_shows_no_gravity_but_that_of_earth(
    acceleration: float, falling: bool
) -> None:
    """The kinetic energy follows any constant force (friction, other planets), so only the acceleration decides."""
    assert not find_flights(
        make_accelerated_model(acceleration if falling else -acceleration), PLAIN
    )
    assert find_flights(make_accelerated_model(9.81), PLAIN)


def make_accelerated_model(acceleration: float) -> History:
    """Return velocity and energies of an accelerated model of mass 10, as in a glstat with six digits."""
    velocity = np.zeros((TIME.size, 1, 3))
    velocity[:, 0, 0] = 30 + acceleration * TIME
    velocity = round_as_printed(velocity.ravel()).reshape(velocity.shape)
    ringing = 10 * np.sin(90 * TIME) ** 2
    kinetic = round_as_printed(5 * (30 + acceleration * TIME) ** 2 + 10 - ringing)
    energies = Balance(
        TIME, ringing, kinetic, velocity=velocity[:, 0], precision=Precision(6)
    )
    whole = Momenta(
        TIME,
        velocity,
        None,
        Precision(6),
        (0,),
        masses=np.array([np.nan]),
        velocity=True,
    )
    return make_table(TIME, ringing, whole, balance=energies)


def test_a_constant_force_on_an_unknown_mass_makes_a_pair_poor() -> None:
    """Without mass and energies, nothing shows that the force is gravity."""
    falling = make_momenta(
        200 - 50 * TIME - 100 * np.exp(-TIME / 0.02), masses=(np.nan,)
    )
    whole = Momenta(TIME, falling.values, None, EXACT, (0,), masses=np.array([np.nan]))
    answer = suggest_in_history(
        make_table(TIME, 5 + 5 * np.sin(60 * TIME) ** 2, whole), 0.8, Settings()
    )
    assert require(answer.quality).grade == "poor"
    assert "gravity-assumed" in {caution.code for caution in answer.cautions}


def test_what_is_carried_does_not_fly_and_does_not_hide_what_falls() -> None:
    falling = np.where(TIME < 0.1, -2e3 * TIME, -200 - 40 * 9.81 * (TIME - 0.1))
    carried = 30 + 20 * np.sin(np.minimum(TIME, 0.3) * 40)
    both_bodies = make_momenta(carried, falling, masses=(10.0, 40.0))
    assert find_flight_around(both_bodies.choosing((0,)), 0.6) is None
    flight = require(find_flight_around(both_bodies.choosing((1,)), 0.6))
    assert flight.gravity == pytest.approx(9.81, rel=1e-3)


@pytest.mark.parametrize("states", [1, 2, 3])
def test_a_few_states_show_no_bodies_apart(states: int) -> None:
    whole = make_momenta(50 + 0 * TIME, -10 + 0 * TIME, axis=0)
    few_states = replace(whole, time=whole.time[:states], values=whole.values[:states])
    assert find_bodies_apart(few_states, (0, 1)) == ()
    assert find_flight_around(few_states, float(few_states.time[0])) is None


def test_bodies_that_hit_each_other_fly_each_for_itself() -> None:
    hit = np.clip((TIME - 0.3) / 0.1, 0, 1)
    body = make_momenta(50 - 60 * hit, 60 * hit - 10, axis=0)
    assert find_bodies_apart(body, (0, 1)) == (0, 1)
    flight = require(find_flight_around(body, 0.7))
    assert flight.start == pytest.approx(0.4, abs=0.01)
    assert find_flight_around(body, 0.35) is None


def test_a_motion_that_has_ended_is_no_flight() -> None:
    stopped = np.where(
        TIME < 0.4, 50 * np.cos(np.pi * TIME / 0.8), 0.0
    )  # prescribed motion, then none
    assert find_flight_around(make_momenta(stopped), 0.8) is None


def test_a_wall_that_does_no_work_is_no_flight_however_constant_the_energies_are() -> (
    None
):
    """The body springs back from 0.2 to 0.8: internal energy becomes kinetic energy, and their sum is constant."""
    pushed = 500 * np.clip((TIME - 0.2) / 0.6, 0, 1) ** 2
    ringing = 3 * np.sin(300 * TIME) ** 2
    history = make_energy_table(900 - pushed + ringing, 100 + pushed - ringing)
    for td in (0.4, 0.6):
        assert not examine_td(history, td, PLAIN).in_flight
    flights = find_flights(history, PLAIN)
    assert [flight for flight in flights if flight.start and flight.start > 0.75]
    assert not [flight for flight in flights if flight.certain]


@pytest.mark.parametrize("spring_share", [0.0, 40.0])
def test_a_spring_to_ground_does_not_fly(spring_share: float) -> None:
    """All of its kinetic energy is vibration energy; a flying body keeps some when its deformation reverses."""
    internal = 100 * np.sin(60 * TIME) ** 2
    history = make_energy_table(
        internal, 100 - internal + spring_share - 10 * np.maximum(0.05 - TIME, 0)
    )
    balance = require(history.balance)
    assert has_whole_motion(balance, 0.1, 1.0) is (spring_share > 0)
    assert bool(find_flights(history, PLAIN)) is (spring_share > 0)


def test_a_level_is_kept_by_a_vibration_and_by_one_that_damping_takes_but_not_by_a_drift() -> (
    None
):
    ringing = np.sin(200 * TIME) ** 2
    assert (
        find_settled_time(TIME, 5 + ringing, 50 + 0 * TIME[np.newaxis], 0.0, 1.0) == 0.0
    )
    lost = np.exp(-4 * TIME)
    assert (
        find_settled_time(TIME, 2 * lost * ringing, 50 + 2 * lost[np.newaxis], 0.0, 1.0)
        == 0.0
    )
    assert (
        find_settled_time(TIME, 5 + 3 * TIME, 50 + 0 * TIME[np.newaxis], 0.0, 1.0)
        is None
    )
    assert (
        find_settled_time(TIME, 5 - 3 * TIME, 50 + 0 * TIME[np.newaxis], 0.0, 1.0)
        is None
    )
    late = find_settled_time(
        TIME,
        np.where(TIME < 0.4, 2.5 * TIME, 1.0) + 0.01 * ringing,
        50 + 0 * TIME[np.newaxis],
        0.0,
        1.0,
    )
    assert late == pytest.approx(0.4, abs=0.02)


def test_a_vibration_that_swings_only_a_few_times_keeps_its_level_and_a_crash_does_not() -> (
    None
):
    whole = 50 + 0 * TIME[np.newaxis]
    assert find_settled_time(TIME, 5 + np.sin(9 * TIME) ** 2, whole, 0.0, 1.0) == 0.0
    assert (
        find_settled_time(
            TIME, 5 + 0 * TIME + np.sin(np.pi * TIME) ** 2, whole, 0.0, 1.0
        )
        is None
    )


@pytest.mark.parametrize("phase", [0.0, 0.8, 1.2, 2.0, 2.4, 2.8])
def test_a_few_swings_keep_their_level_in_a_fall_although_gravity_feeds_the_sum(
    phase: float,
) -> None:
    """The sum of energies grows by far more than the vibration has; the work of gravity is not a loss by damping."""
    swings = 5 * np.sin(8 * TIME + phase) ** 2
    falling = 1000 + 400 * TIME**2
    sums = np.stack([falling, falling - 400 * TIME**2])
    assert find_settled_time(TIME, swings, sums, 0.0, 1.0) == 0.0


def test_a_few_swings_show_no_flight_while_a_load_of_unknown_size_works() -> None:
    """A steady push also makes a body swing about one level."""
    swings = 5 * np.sin(8 * TIME + 0.8) ** 2
    pushed = 1000 + 400 * TIME[np.newaxis] ** 2
    assert find_settled_time(TIME, swings, pushed, 0.0, 1.0) == 0.0
    settled = find_settled_time(TIME, swings, pushed, 0.0, 1.0, driven=True)
    assert settled is None or settled > 0.5


@settings(max_examples=25)
@given(
    start=st.floats(0.3, 0.5),
    length=st.floats(0.05, 0.25),
    share=st.floats(0.3, 4.0),
    gravity=st.sampled_from([0.0, 9.81]),
)
def test_a_couple_drives_the_body_for_a_while_and_it_flies_before_and_after(
    start: float, length: float, share: float, gravity: float
) -> None:
    """Opposite forces change no momentum; only the external work shows when they act."""
    mass = 10.0
    velocity = np.stack([3 + ZERO, ZERO, 2 - gravity * TIME], axis=1)
    moving = mass / 2 * np.sum(velocity**2, axis=1)
    acting = np.clip((TIME - start) / length, 0.0, 1.0)
    couple_work = 100 * share * np.sin(np.pi / 2 * acting) ** 2
    vibration = 100 + couple_work
    internal = vibration * np.sin(150 * TIME) ** 2
    energies = Balance(
        TIME,
        internal,
        moving + vibration - internal,
        external_work=moving - moving[0] + couple_work,
        velocity=velocity,
        precision=Precision(6),
    )
    whole = Momenta(TIME, velocity[:, np.newaxis], None, Precision(6), (0,))
    history = make_table(
        TIME, internal, replace(whole, velocity=True), balance=energies
    )
    before, after = find_flights(history, PLAIN)
    assert before.within(TIME)[0] == pytest.approx(0.0, abs=0.02)
    assert start - 0.05 < before.within(TIME)[1] < start + 0.3 * length
    assert start + 0.7 * length < after.within(TIME)[0] < start + length + 0.1
    assert after.end is None
    driven = examine_td(history, start + length / 2, PLAIN).flight
    assert driven.refusal is not None
    assert "a load drives it" in driven.refusal


def test_a_flight_in_which_energies_ring_about_their_law_is_found_and_uncertain() -> (
    None
):
    """Internal damping dissipates energy in steps, which a parabola does not describe."""
    rung = 100 * np.sin(60 * TIME) ** 2
    pushed = np.minimum(TIME / 0.2, 1) ** 2
    lost = 0.5 * (TIME - np.sin(240 * TIME) / 240) * (TIME > 0.2)
    flights = find_flights(
        make_energy_table(
            pushed * (150 + rung),
            pushed * (900 - rung) - lost - 0.4 * np.sin(171 * TIME),
        ),
        PLAIN,
    )
    assert any(
        flight.start == pytest.approx(0.2, abs=0.05) and flight.end is None
        for flight in flights
    )
    assert not [
        flight for flight in flights if flight.certain or (flight.start or 0.0) < 0.15
    ]


@pytest.mark.parametrize(
    ("internal", "kinetic"),
    [
        (1 + 0.001 * np.sin(300 * TIME) ** 2, 50 + 20 * TIME + 30 * TIME**2),
        # More energy is lost than the vibration has.
        # A stiff body slowed down by a constant force rings as one oscillator, with a weak vibration.
        (1e-6 * np.sin(300 * TIME) ** 2, 50 - 10 * TIME + 2 * TIME**2),
    ],
)
def test_a_load_that_energies_cannot_tell_from_gravity_makes_a_pair_poor(
    internal: Samples, kinetic: Samples
) -> None:
    suggestion = suggest_in_history(make_energy_table(internal, kinetic), 0.8, PLAIN)
    assert require(suggestion.quality).grade == "poor"
    assert "gravity or another load changes" in require(suggestion.decision).reason
    assert suggestion.situation.flight.unknown_load


def test_a_momentum_that_stays_while_a_load_works_is_prescribed() -> None:
    """A couple winds the body up, and then it stands still: a support that held its momentum may still hold it."""
    wound = np.minimum(TIME / 0.4, 1.0) ** 2
    values = np.full((TIME.size, 1, 3), 2.5)
    values[0] = 0.0
    energies = Balance(TIME, 8e3 * wound, np.full(TIME.size, 3.75))
    whole = Momenta(TIME, values, None, Precision(7), (0,))
    assert not find_flights(
        make_table(TIME, 8e3 * wound, whole, balance=energies), PLAIN
    )
    stored = np.exp(-(((TIME - 0.2) / 0.05) ** 2))  # stored by a contact for some time
    fallen = replace(energies, kinetic=8e3 * (1.5 - wound - 0.2 * stored))
    (flight,) = find_flights(
        make_table(TIME, 8e3 * wound, whole, balance=fallen), PLAIN
    )
    assert require(flight.start) == pytest.approx(
        0.4, abs=0.02
    )  # two bodies have hit each other


def test_what_damping_takes_of_a_body_and_its_vibration_is_no_load() -> None:
    """Mass-proportional damping dissipates more energy of the motion than the vibration has."""
    alpha = 0.3
    kinetic = (
        60 * np.exp(-2 * alpha * TIME)
        + 20 * np.exp(-alpha * TIME) * np.cos(60 * TIME) ** 2
    )
    whole = 80 - 2 * alpha * integrate_by_trapezia(TIME, kinetic)
    record = make_energy_table(whole - kinetic, kinetic)
    assert suggest_in_history(record, 0.8, PLAIN).situation.flight.unknown_load
    flight = suggest_in_history(
        record, 0.8, Settings()
    ).situation.flight  # the oscillator is damped at the same rate
    assert flight.certain
    assert flight.described


@pytest.mark.parametrize("rate", [1.0, 0.96, 1.05])
def test_a_body_that_loses_energy_at_another_rate_than_its_vibration_is_under_a_load(
    rate: float,
) -> None:
    """Drag takes about as much as damping by mass would: 6 % of the speed, and 4 or 5 % of that less or more."""
    alpha = 0.06
    body, ringing = 60 * np.exp(-2 * rate * alpha * TIME), 20 * np.exp(-alpha * TIME)
    kinetic = body + ringing * np.cos(60 * TIME) ** 2
    lost = 2 * alpha * integrate_by_trapezia(TIME, rate * body + kinetic - body)
    record = make_energy_table(80 - lost - kinetic, kinetic)
    flight = suggest_in_history(record, 0.8, Settings()).situation.flight
    assert flight.certain is (rate == 1.0)
    assert flight.unknown_load is (rate != 1.0)


@pytest.mark.parametrize("lost", [0.0, 0.02, 0.3])
def test_an_oscillator_makes_no_flight_certain_in_which_the_body_loses_energy(
    lost: float,
) -> None:
    """Drag slows the body down while its spring vibrates on as one oscillator."""
    decay = np.exp(-0.2 * TIME)  # internal damping, which the energies also show
    ringing, moving = 20 * decay * np.cos(60 * TIME) ** 2, 60 * (1 - lost * TIME)
    internal = 20 * decay - ringing
    flight = suggest_in_history(
        make_energy_table(internal, moving + ringing), 0.8, Settings()
    ).situation.flight
    assert flight.described
    assert flight.certain is (lost == 0)
    assert flight.unknown_load is (lost > 0)


def test_no_flight_is_certain_in_which_energies_show_a_load() -> None:
    """A stiff body that is pulled can have an energy that one oscillator describes."""
    assert not Flight(
        0.1, 0.9, "energy-balance", gravity=np.inf, described=True
    ).certain
    assert Flight(0.1, 0.9, "energy-balance", described=True).certain
    suggestion = suggest_in_history(
        make_energy_table(1e-9 * (1.5 + np.sin(300 * TIME)), 50 + 20 * TIME), 0.8, PLAIN
    )
    assert suggestion.situation.flight.unknown_load
    assert not any(
        "any tr there is right" in caution.message
        for caution in warn_about_td(suggestion.situation)
    )


def test_the_landing_is_found_where_the_end_of_the_load_is_given() -> None:
    ringing = 2 + np.sin(300 * TIME) ** 2
    history = make_table(TIME, ringing + 500 * np.maximum(TIME - 0.6, 0))
    for td in (0.5, 0.8):
        flight = examine_td(history, td, Settings(after=0.1, replay=False)).flight
        assert flight.end == pytest.approx(0.6, abs=0.01)
    assert (
        suggest_in_history(history, 0.8, Settings(after=0.1, replay=False)).recommended
        is None
    )


def test_an_end_of_the_load_behind_the_flight_gives_no_flight_that_ends_before_it_begins() -> (
    None
):
    hit = np.clip((TIME - 0.5) / 0.02, 0, 5)
    two_bodies = make_momenta(
        np.where(TIME < 0.1, 10 * np.sin(60 * TIME), 10 * np.sin(6)) - hit**1.5
    )
    history = make_table(TIME, 1 + np.sin(300 * TIME) ** 2, two_bodies)
    flight = examine_td(history, 0.3, Settings(after=0.7, replay=False)).flight
    assert flight.start is None
    assert flight.refusal


def make_falling_damped_body(
    *left_out: str, internal: Samples = ZERO, vibration: float = 40.0
) -> History:
    """Return a damped vibration above plastic work of 5, of a body of mass 20 that falls from 0.1 on; seven digits.

    The terms ``left_out`` are not written; ``internal`` is added to the internal energy.
    """
    since = np.maximum(TIME - 0.1, 0.0)
    remaining_pull, swing = vibration * np.exp(-9 * since), np.cos(250 * since) ** 2
    internal, pushed = (
        internal + 5 + remaining_pull * swing,
        20 * 60 * np.minimum(TIME, 0.1) ** 2 / 0.02,
    )
    values = np.zeros((TIME.size, 1, 3))
    values[:, 0, 0], values[:, 0, 2] = np.sqrt(2 * 20 * pushed), -20 * 9.81 * since
    kinetic = (values[:, 0] ** 2).sum(axis=1) / 40 + remaining_pull * (1 - swing)
    momentum = Momenta(
        TIME,
        round_as_printed(values.ravel(), 7).reshape(values.shape),
        None,
        Precision(7),
        (0,),
    )
    written = {
        "internal": internal,
        "kinetic": kinetic,
        "damping": vibration - remaining_pull,
    }
    columns = {
        name: round_as_printed(column, 7)
        for name, column in written.items()
        if name not in left_out
    }
    mass = np.array([np.nan if "kinetic" in left_out else 20.0])
    energies = replace(Balance(TIME, precision=Precision(7)), **columns)  # type: ignore[arg-type]
    return make_table(
        TIME, columns["internal"], replace(momentum, masses=mass), balance=energies
    )


@pytest.mark.parametrize(
    "left_out", [(), ("damping",), ("kinetic",), ("kinetic", "damping")]
)
def test_no_energy_that_is_written_hides_a_fall_whose_vibration_is_damped(
    left_out: tuple[str, ...],
) -> None:
    flight = examine_td(make_falling_damped_body(*left_out), 0.5, PLAIN).flight
    assert flight.source == "momentum"
    assert flight.start == pytest.approx(0.1, abs=2 * TIME[1])
    assert flight.end is None


@pytest.mark.slow
def test_falls_in_all_formats_begin_within_two_states_with_and_without_kinetic_energy(
    tmp_path: Path,
) -> None:
    for number, fall in enumerate(
        falls.integrate_falls(np.random.default_rng(3), 6, 300)
    ):
        td, room = (fall.start + fall.end) / 2, (falls.WITHIN + 0.01) * fall.run.time[1]
        for form, write in FALL_WRITERS.items():
            for kinetic in (True, False):
                start = falls.find_flight_start(
                    write(fall.run, tmp_path, kinetic=kinetic), td
                )
                assert start == pytest.approx(fall.start, abs=room), (
                    number,
                    form,
                    kinetic,
                )


def test_an_internal_energy_that_grows_while_its_body_falls_keeps_no_level() -> None:
    """Its two bodies hit each other; their total momentum is that of free fall."""
    history = make_falling_damped_body(internal=200 * TIME)
    assert not examine_td(history, 0.5, PLAIN).in_flight


def make_body_deformed_in_flight(load_start: float, *left_out: str) -> History:
    """Return `make_falling_damped_body` with 30 of its kinetic energy turned into plastic work within 20 ms."""
    done = 30 * np.sin(np.pi / 2 * np.clip((TIME - load_start) / 0.02, 0.0, 1.0)) ** 2
    history = make_falling_damped_body(*left_out, internal=done, vibration=2.0)
    balance = history.balance
    if balance is None or balance.kinetic is None:
        return history
    kinetic = round_as_printed(balance.kinetic + 30 - done, 7)
    (momentum,) = history.momenta
    balance = replace(balance, kinetic=kinetic)
    return make_table(TIME, history.energy, momentum, balance=balance)


@pytest.mark.parametrize("left_out", [(), ("damping",), ("kinetic", "damping")])
def test_a_body_that_yields_as_the_load_ends_flies_from_there(
    left_out: tuple[str, ...],
) -> None:
    flight = examine_td(make_body_deformed_in_flight(0.1, *left_out), 0.5, PLAIN).flight
    assert flight.source == "momentum"
    assert flight.start == pytest.approx(0.1, abs=2 * TIME[1])


@pytest.mark.parametrize("contact_time", [0.2, 0.25, 0.3])
@pytest.mark.parametrize("left_out", [(), ("kinetic", "damping")])
def test_two_bodies_that_hit_each_other_in_a_fall_do_not_fly_together_before(
    contact_time: float, left_out: tuple[str, ...]
) -> None:
    flight = examine_td(
        make_body_deformed_in_flight(contact_time, *left_out), 0.6, PLAIN
    ).flight
    assert flight.start is None or flight.start > contact_time


@pytest.mark.parametrize(
    ("flat", "rises"), [(0.0, True), (0.01, True), (0.05, False), (0.2, False)]
)
def test_an_energy_that_stays_low_before_it_rises_is_not_that_of_a_body_that_yields(
    flat: float, rises: bool
) -> None:
    energy = 1 + np.sin(np.pi / 2 * np.clip((TIME - flat) / 0.03, 0.0, 1.0)) ** 2
    settled = flat + 0.03
    assert rises_as_it_yields(TIME, energy, None, 0.0, settled, 1.0) is rises
    sums = 0 * TIME + 7, 7 - TIME, 7 + 20 * TIME
    expected = (
        rises,
        rises,
        False,
    )  # motion supplies it, damping dissipates it, a load feeds it
    for whole, gives in zip(sums, expected, strict=True):
        assert rises_as_it_yields(TIME, energy, whole, 0.0, settled, 1.0) is gives
