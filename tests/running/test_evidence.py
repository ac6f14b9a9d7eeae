"""When no force acts, and how long it must not: on computed runs, and on made ones whose law is known."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis.strategies import floats, integers, lists, sampled_from
from numpy.typing import NDArray

from d2rpick.base.errors import RangeError
from d2rpick.choice.flights import flights_of
from d2rpick.choice.question import Settings
from d2rpick.histories.history import EXACT, Given, History, Momenta, select_states
from d2rpick.histories.names import Part
from d2rpick.histories.opening import Selection, open_run
from d2rpick.running.evidence import Evidence, highest_energy, quiet_times
from d2rpick.running.inner_motion import InnerMotion, Wait
from d2rpick.running.witness import Quiet
from tests.command import ROOT
from tests.energies import sure
from tests.records import table, until
from tests.running.seen import seen_in

# Windows of flights [s]: car with contacts at 2.3-11.8, 28.1-38.5 and 150.4 ms, box that lands at 285.8, 338.4 ms ...
CAR, BOX = "carT01.gz", "drop2T01.gz"


@cache
def record(*names: str) -> History:
    return open_run([str(ROOT / "tests/data" / name) for name in names]).history(
        Selection()
    )


def spans(found: Sequence[Quiet]) -> NDArray[np.float64]:
    """Starts and ends, NaN where none is seen."""
    return np.array([(one.start, one.end) for one in found], np.float64)


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
    found = quiet_times(history, InnerMotion.of(history).needed)
    assert spans(found)[: len(expected)] == pytest.approx(np.array(expected), abs=5e-4)
    assert all(one.seen - one.start >= one.wait and one.left <= 1e-4 for one in found)
    assert all(one.gravity == pytest.approx(9.81, rel=5e-3) for one in found)


def test_a_swing_with_a_push_in_it_makes_no_wait_longer() -> None:
    """In the box the longest swing was pushed at 302 ms and took 24 ms, half of the period of the springs is 17 ms."""
    for before in (None, Wait(0.018, "record", "as in the flight before")):
        waits = [
            one.wait
            for one in quiet_times(
                record(BOX), InnerMotion.of(record(BOX), None, before).needed
            )
        ]
        assert all(0.016 <= one <= 0.021 for one in waits[1:])


@pytest.mark.parametrize("name", [CAR, BOX])
def test_a_wait_below_half_of_a_known_period_is_refused(name: str) -> None:
    history = record(name)
    with pytest.raises(RangeError, match=r"`wait` 0\.002 is below"):
        quiet_times(history, InnerMotion.of(history, 0.002).needed)


def test_the_wait_that_was_measured_in_the_car_is_not_refused() -> None:
    history = until(record(CAR), 0.14)
    last = quiet_times(history, InnerMotion.of(history, 0.022).needed)[-1]
    assert last.start == pytest.approx(0.0383, abs=5e-4)
    assert last.wait == 0.022


@pytest.mark.parametrize("name", [CAR, BOX])
def test_what_is_seen_rests_on_no_later_state(name: str) -> None:
    history = record(name)
    found = quiet_times(history, InnerMotion.of(history).needed)
    for time in history.time[[300, 640, 900]].tolist():
        early = until(history, time)
        seen = quiet_times(early, InnerMotion.of(early).needed)
        assert [one[:2] for one in seen] == [
            one[:2] for one in found if one.seen <= time
        ]


def test_a_rigid_leg_shows_its_contact_by_the_model_alone() -> None:
    switched = record(*(f"drop2_w123_T0{leg}.gz" for leg in (1, 2, 3)))
    assert seen_in(switched)[0].contact_after(0.0) == pytest.approx(0.2858, abs=4e-4)
    assert seen_in(record("car_all_T02.gz"))[0].contact_after(0.05) is None


def test_flights_are_seen_before_between_and_in_rigid_legs() -> None:
    switched = record(*(f"drop2_w123_T0{leg}.gz" for leg in (1, 2, 3, 4)))
    found = quiet_times(switched, InnerMotion.of(switched).needed)
    assert spans(found)[:2] == pytest.approx(
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
        [one.within(history.time) for one in flights_of(history, Settings())]
    )
    for one in quiet_times(history, InnerMotion.of(history).needed):
        found = one.start, history.time[-1] if one.end is None else one.end
        if found[1] - one.start < 2 * one.wait:
            continue  # info lists none that is so short beside the others
        assert np.abs(listed - found).max(axis=1).min() <= 3 * history.step


def test_a_flight_that_rises_says_when_it_is_level_again() -> None:
    """The rollover box rises by 1.5 m/s; it lands 6 % before that, turned."""
    rising = open_run([str(ROOT / "sample_data" / "rolloverT01.gz")]).history(
        Selection(parts=("box",))
    )
    (one,) = (
        q for q in quiet_times(rising, InnerMotion.of(rising).needed) if q.start < 0.2
    )
    assert one.level is not None
    assert one.level - one.start == pytest.approx(0.31, rel=0.02)
    assert all(
        q.level is None
        for q in quiet_times(record(BOX), InnerMotion.of(record(BOX)).needed)
        if q.start < 0.6
    )


def test_a_record_of_as_many_states_as_parts_keeps_the_masses_of_all() -> None:
    """Three states of three parts: cut to two states, each part still has its mass."""
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
def pushed(tail: float, left: float) -> History:
    """A body of 10 kg that is pushed for 30 ms, and lands after 170 ms; a share ``left`` of the push dies away."""
    time = np.arange(0.0, 0.2, 2e-4)
    push = 30.0 * np.sin(np.pi / 2 * np.minimum(time / 0.03, 1.0)) ** 2
    rest = (
        30.0
        * left
        * np.exp(-np.maximum(time - 0.03, 0.0) / tail)
        * np.minimum(time / 0.03, 1.0)
    )
    landing = 30.0 * np.sin(np.pi / 2 * np.clip((time - 0.17) / 0.02, 0.0, 1.0)) ** 2
    momentum = np.zeros((time.size, 1, 3))
    momentum[:, 0, 2] = push - rest + landing - 98.1 * time
    energy = 50.0 + 20.0 * np.cos(2 * np.pi * time / 0.02)
    return table(
        time,
        energy,
        Momenta(time, momentum, None, EXACT, (0,), masses=np.array([10.0])),
    )


@settings(max_examples=12)
@given(tail=floats(5e-4, 2.5e-3), left=floats(0.0, 3e-3), wait=floats(0.01, 0.03))
def test_no_flight_is_lost_behind_a_push_that_dies_away(
    tail: float, left: float, wait: float
) -> None:
    """Its first states are within what may be left, and later not: the flight begins later, and goes on."""
    history = pushed(round(tail, 4), round(left, 4))
    (flight,) = quiet_times(history, lambda *_: wait)
    assert 0.02 <= flight.start <= 0.05
    assert flight.seen <= 0.05 + wait
    assert flight.end == pytest.approx(0.17, abs=8e-4)


@settings(max_examples=4)
@given(
    name=sampled_from([CAR, BOX]),
    sizes=lists(integers(1, 200), min_size=4, max_size=12),
)
def test_what_is_seen_does_not_depend_on_when_somebody_looked(
    name: str, sizes: list[int]
) -> None:
    history = until(record(name), 0.35)
    whole, motion = seen_in(history)
    evidence, grown, begin = Evidence(), InnerMotion(), 0
    for size in [*sizes, history.time.size]:
        states = np.zeros(history.time.size, np.bool_)
        states[begin : begin + size] = True
        begin += size
        if not states.any():
            break
        part = states_of(history, states)
        evidence.take(part)
        grown.take(part, evidence)
        evidence.flights(grown.needed)
    assert evidence.flights(grown.needed) == whole.flights(motion.needed)
    assert [one.free for one in evidence.witnesses] == [
        one.free for one in whole.witnesses
    ]


def states_of(history: History, states: NDArray[np.bool_]) -> History:
    given_ = Given(
        tuple(select_states(one, states) for one in history.momenta),
        history.balance and select_states(history.balance, states),
        history.masses,
    )
    return replace(select_states(history, states), evidence=given_)


@pytest.mark.parametrize("jump", [True, False])
def test_an_energy_that_jumps_in_the_first_state_makes_no_wait(jump: bool) -> None:
    """It swings with 50 Hz, so that what deforms takes 20 ms for half a period."""
    time = np.arange(0.0, 0.1, 5e-5)
    energy = 50.0 + 20.0 * np.cos(2 * np.pi * time / 0.02)
    energy[0] = 0.0 if jump else energy[0]
    known = sure(InnerMotion.of(table(time, energy)).longest(0.1))
    assert known.time == pytest.approx(0.02, rel=0.1)


def test_a_swing_in_a_push_makes_no_wait_where_the_deck_tells_its_springs() -> None:
    of_deck = Wait(0.012, "deck", "of the deck", 0.01)
    motion = seen_in(record(BOX), None, of_deck)[1]
    assert sure(motion.longest(0.28)) == of_deck  # it falls
    assert (
        0.016 <= sure(motion.longest(0.7)).time <= 0.021
    )  # the swing that was pushed at 302 ms took 24 ms
