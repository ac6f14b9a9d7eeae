"""Force-free times, and how long they must last, for computed runs and for synthetic ones with known motion."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers, lists, sampled_from
from numpy.typing import NDArray

from d2rpick.base.errors import RangeError
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.histories.history import EXACT, Given, History, Momenta, select_states
from d2rpick.histories.names import Part
from d2rpick.histories.opening import Selection, open_run
from d2rpick.histories.surroundings import Surroundings
from d2rpick.running.events import find_events, highest_energy
from d2rpick.running.evidence import GrowingEvidence
from d2rpick.running.inner_motion import Wait
from d2rpick.running.witness import SeenFlight
from tests.command import ROOT
from tests.energies import require
from tests.records import cut_history, make_table
from tests.running.seen import take_whole_record

# Windows of flights [s]: car with contacts at 2.3-11.8, 28.1-38.5 and 150.4 ms, box that lands at 285.8, 338.4 ms ...
CAR, BOX = "carT01.gz", "drop2T01.gz"


@cache
def record(*names: str) -> History:
    return open_run([str(ROOT / "tests/data" / name) for name in names]).history(
        Selection()
    )


def list_spans(seen_flights: Sequence[SeenFlight]) -> NDArray[np.float64]:
    """Return start and end of each span, NaN if unknown."""
    return np.array([(span.start, span.end) for span in seen_flights], np.float64)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (CAR, [(0.0, 0.0023), (0.0384, 0.1504)]),
        (
            BOX,
            [
                (0.0, 0.2858),
                (0.3022, 0.3386),
                (0.3396, 0.4196),
                (0.4204, 0.48),
                (0.4806, 0.5014),
                (0.502, 0.5968),
            ],
        ),
    ],
)
def test_flights_of_computed_runs_are_seen_and_gaps_in_the_load_are_not(
    name: str, expected: list[tuple[float, float]]
) -> None:
    history = record(name)
    seen_flights = take_whole_record(history).flights()
    assert list_spans(seen_flights)[: len(expected)] == pytest.approx(
        np.array(expected), abs=5e-4
    )
    assert all(
        span.seen - span.start >= span.wait.time and span.left <= 1e-4
        for span in seen_flights
    )
    assert all(span.gravity == pytest.approx(9.81, rel=5e-3) for span in seen_flights)


def test_a_swing_with_a_push_in_it_makes_no_wait_longer() -> None:
    """The longest cycle of the box contains a push at 302 ms and lasts 24 ms; half the spring period is 17 ms."""
    for earlier_wait in (None, Wait(0.018, "record", "as in the flight before")):
        waits = [
            span.wait.time
            for span in take_whole_record(record(BOX), None, earlier_wait).flights()
        ]
        assert all(0.016 <= wait <= 0.021 for wait in waits[1:])


@pytest.mark.parametrize("name", [CAR, BOX])
def test_a_wait_below_half_of_a_known_period_is_refused(name: str) -> None:
    with pytest.raises(RangeError, match=r"`wait` 0\.002 is below"):
        find_events(take_whole_record(record(name), 0.002))


def test_the_wait_that_was_measured_in_the_car_is_not_refused() -> None:
    history = cut_history(record(CAR), 0.14)
    evidence = take_whole_record(history, 0.022)
    assert find_events(evidence)
    last = evidence.flights()[-1]
    assert last.start == pytest.approx(0.0383, abs=5e-4)
    assert last.wait.time == 0.022


@pytest.mark.parametrize("name", [CAR, BOX])
def test_what_is_seen_rests_on_no_later_state(name: str) -> None:
    history = record(name)
    seen_flights = take_whole_record(history).flights()
    for time in history.time[[300, 640, 900]].tolist():
        early = cut_history(history, time)
        early_spans = take_whole_record(early).flights()
        assert [span[:2] for span in early_spans] == [
            span[:2] for span in seen_flights if span.seen <= time
        ]


def test_a_rigid_leg_shows_its_contact_by_the_model_alone() -> None:
    switched = record(*(f"drop2_w123_T0{leg}.gz" for leg in (1, 2, 3)))
    assert take_whole_record(switched).find_contact() == pytest.approx(0.2858, abs=4e-4)
    assert take_whole_record(record("car_all_T02.gz")).find_contact() is None


def test_flights_are_seen_before_between_and_in_rigid_legs() -> None:
    switched = record(*(f"drop2_w123_T0{leg}.gz" for leg in (1, 2, 3, 4)))
    seen_flights = take_whole_record(switched).flights()
    assert list_spans(seen_flights)[:2] == pytest.approx(
        np.array([(0.0, 0.2858), (0.3022, 0.3386)]), abs=1e-3
    )


def test_the_highest_energy_is_that_of_a_state_in_the_span() -> None:
    history = record(CAR)
    tr = highest_energy(history, 0.0605, 0.0825)
    assert 0.0605 <= tr <= 0.0825
    assert history.energy_at(tr) == np.max(history.between(0.0605, 0.0825)[1])


def test_flights_begin_and_end_where_info_and_plan_find_them() -> None:
    history = record(BOX)
    listed = np.array(
        [flight.within(history.time) for flight in find_flights(history, Settings())]
    )
    for flight in take_whole_record(history).flights():
        flight_times = (
            flight.start,
            history.time[-1] if flight.end is None else flight.end,
        )
        if flight_times[1] - flight.start < 2 * flight.wait.time:
            continue  # info lists no flight as short as this beside the others
        assert np.abs(listed - flight_times).max(axis=1).min() <= 3 * history.step


def test_a_flight_that_rises_says_when_it_is_level_again() -> None:
    """The rollover box rises at 1.5 m/s; because of its rotation, it lands 6 % before it is level again."""
    rising = open_run([str(ROOT / "sample_data" / "rolloverT01.gz")]).history(
        Selection(parts=("box",))
    )
    (span,) = (q for q in take_whole_record(rising).flights() if q.start < 0.2)
    assert span.level is not None
    assert span.level - span.start == pytest.approx(0.31, rel=0.02)
    assert all(
        q.level is None
        for q in take_whole_record(record(BOX)).flights()
        if q.start < 0.6
    )


def test_a_record_of_as_many_states_as_parts_keeps_the_masses_of_all() -> None:
    """Three states of three parts, cut to two states: each part still has its mass."""
    parts = tuple(Part(number, str(number)) for number in (1, 2, 3))
    momenta = Momenta(
        np.arange(3.0),
        np.ones((3, 3, 3)),
        parts,
        EXACT,
        (0, 1, 2),
        masses=np.array([1.0, 2.0, 3.0]),
    )
    assert select_states(momenta, slice(0, 2)).mass((0, 1, 2)) == 6.0


@cache
def make_pushed_body(tail: float, share: float) -> History:
    """Return a body of 10 kg, pushed for 30 ms, landing after 170 ms; ``share`` of the push decays slowly."""
    time = np.arange(0.0, 0.2, 2e-4)
    push = 30.0 * np.sin(np.pi / 2 * np.minimum(time / 0.03, 1.0)) ** 2
    decaying_push = (
        30.0
        * share
        * np.exp(-np.maximum(time - 0.03, 0.0) / tail)
        * np.minimum(time / 0.03, 1.0)
    )
    landing = 30.0 * np.sin(np.pi / 2 * np.clip((time - 0.17) / 0.02, 0.0, 1.0)) ** 2
    momentum = np.zeros((time.size, 1, 3))
    momentum[:, 0, 2] = push - decaying_push + landing - 98.1 * time
    energy = 50.0 + 20.0 * np.cos(2 * np.pi * time / 0.02)
    return make_table(
        time,
        energy,
        Momenta(time, momentum, None, EXACT, (0,), masses=np.array([10.0])),
    )


@settings(max_examples=12)
@given(tail=floats(5e-4, 2.5e-3), share=floats(0.0, 3e-3), wait=floats(0.01, 0.03))
def test_no_flight_is_lost_behind_a_push_that_dies_away(
    tail: float, share: float, wait: float
) -> None:
    """Its first states are within the remaining force, later ones are not: the flight begins later, and continues."""
    history = make_pushed_body(round(tail, 4), round(share, 4))
    (flight,) = take_whole_record(history, wait).flights()
    assert 0.02 <= flight.start <= 0.05
    assert flight.seen <= 0.05 + wait
    assert flight.end == pytest.approx(0.17, abs=8e-4)


def make_body_without_gravity(tail: float, noise: float) -> History:
    """Return a body of 2 kg that is pushed at 0.1 and 0.5 s for 30 ms; then the force decays with the time ``tail``."""
    time = np.arange(0.0, 1.0, 1e-3)
    momentum = np.zeros((time.size, 1, 3))
    momentum[:, 0] = -20.0, 0.0, 3.0
    for start, impulse in ((0.1, (9.0, 0.0, -8.0)), (0.5, (-2.0, 5.0, 7.0))):
        share = np.sin(np.pi / 2 * np.clip((time - start) / 0.03, 0.0, 1.0)) ** 2
        if tail:
            decay = np.exp(-np.maximum(time - start - 0.03, 0.0) / tail)
            share *= 1 - 0.1 * decay
        momentum[:, 0] += np.outer(share, impulse)
    rounding = np.random.default_rng(1).normal(size=momentum.shape)
    momentum += noise * float(np.abs(momentum).max()) * rounding
    energy = 50.0 + 20.0 * np.cos(2 * np.pi * time / 0.05)
    whole = Momenta(time, momentum, None, EXACT, (0,), masses=np.array([2.0]))
    return make_table(time, energy, whole)


@pytest.mark.parametrize("tail", [0.0, 1e-3, 5e-3, 0.02])
@pytest.mark.parametrize("noise", [0.0, 1e-7, 1e-6])
def test_a_body_without_gravity_flies_again_after_each_push(
    tail: float, noise: float
) -> None:
    """A constant momentum, and the end of a push, must not pass for damping under a force that is not gravity."""
    history = make_body_without_gravity(tail, noise)
    wait = 0.03
    flights = take_whole_record(history, wait).flights()
    # After 8 decay times, 3e-5 of the impulse is left.
    latest = 0.03 + 8 * tail
    for flight, start, end in zip(
        flights, (0.0, 0.1, 0.5), (0.1, 0.5, None), strict=True
    ):
        assert start <= flight.start <= start + latest
        assert flight.start + wait <= flight.seen <= start + latest + 2 * wait
        assert flight.end == (end and pytest.approx(end, abs=5e-3))
        assert flight.gravity == 0.0


def test_a_constant_momentum_is_no_flight_if_the_deck_has_gravity() -> None:
    """Something carries the body, for example a floor without friction."""
    history = make_body_without_gravity(0.0, 0.0)
    (momenta,) = history.momenta
    surroundings = Surroundings(gravity={None: (9.81,)})
    carried = replace(momenta, surroundings=surroundings)
    history = make_table(history.time, history.energy, carried)
    assert take_whole_record(history, 0.03).flights() == ()


@pytest.mark.parametrize("friction", [2.0, 20.0])
def test_a_body_that_friction_has_stopped_does_not_fly(friction: float) -> None:
    time = np.arange(0.0, 1.0, 1e-3)
    momentum = np.zeros((time.size, 1, 3))
    momentum[:, 0, 0] = np.maximum(5.0 - friction * np.maximum(time - 0.2, 0.0), 0.0)
    whole = Momenta(time, momentum, None, EXACT, (0,), masses=np.array([2.0]))
    history = make_table(time, np.full(time.size, 50.0), whole)
    (flight,) = take_whole_record(history, 0.03).flights()
    assert flight.start == 0.0
    assert flight.end == pytest.approx(0.2, abs=5e-3)


@settings(max_examples=4)
@given(
    name=sampled_from([CAR, BOX]),
    sizes=lists(integers(1, 200), min_size=4, max_size=12),
)
def test_what_is_seen_does_not_depend_on_when_somebody_looked(
    name: str, sizes: list[int]
) -> None:
    history = cut_history(record(name), 0.35)
    whole, evidence, begin = take_whole_record(history), GrowingEvidence(), 0
    for size in [*sizes, history.time.size]:
        states = np.zeros(history.time.size, np.bool_)
        states[begin : begin + size] = True
        begin += size
        states_so_far = np.arange(history.time.size) < begin
        if not states.any():
            break
        evidence.take(take_states(history, states), take_states(history, states_so_far))
        evidence.flights()
    assert evidence.flights() == whole.flights()
    assert [witness.free for witness in evidence.witnesses] == [
        witness.free for witness in whole.witnesses
    ]


def take_states(history: History, states: NDArray[np.bool_]) -> History:
    given_ = Given(
        tuple(select_states(momenta, states) for momenta in history.momenta),
        history.balance and select_states(history.balance, states),
        history.masses,
    )
    return replace(select_states(history, states), evidence=given_)


@pytest.mark.parametrize("jump", [True, False])
def test_an_energy_that_jumps_in_the_first_state_makes_no_wait(jump: bool) -> None:
    """It vibrates at 50 Hz, so that half a period of the deformation takes 20 ms."""
    time = np.arange(0.0, 0.1, 5e-5)
    energy = 50.0 + 20.0 * np.cos(2 * np.pi * time / 0.02)
    energy[0] = 0.0 if jump else energy[0]
    longest_period = require(
        take_whole_record(make_table(time, energy)).motion.longest(0.1)
    )
    assert longest_period.time == pytest.approx(0.02, rel=0.1)


def test_a_swing_in_a_push_makes_no_wait_where_the_deck_tells_its_springs() -> None:
    of_deck = Wait(0.012, "deck", "of the deck", 0.01)
    motion = take_whole_record(record(BOX), None, of_deck).motion
    assert require(motion.longest(0.28)) == of_deck  # the body falls
    assert (
        0.016 <= require(motion.longest(0.7)).time <= 0.021
    )  # the cycle with the push at 302 ms takes 24 ms
