"""When no force acts, and how long it must not: on computed runs, and on made ones whose law is known."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from d2rpick.base.errors import RangeError
from d2rpick.choice.flights import flights_of
from d2rpick.choice.question import Settings
from d2rpick.histories.history import EXACT, History, Momenta, rows_of
from d2rpick.histories.names import Part
from d2rpick.histories.opening import Selection, open_run
from d2rpick.running.evidence import Quiet, contact_after, highest_energy, quiet_times
from d2rpick.running.inner_motion import InnerMotion, Wait
from tests.command import ROOT
from tests.records import until

# Windows of flights [s]: car with contacts at 2.3-11.8, 28.1-38.5 and 150.4 ms, box that lands at 285.8, 338.4 ms ...
CAR, BOX = "carT01.gz", "drop2T01.gz"


@cache
def record(*names: str) -> History:
    return open_run([str(ROOT / "tests/data" / name) for name in names]).history(Selection())


def spans(found: Sequence[Quiet]) -> NDArray[np.float64]:
    """Starts and ends, NaN where none is seen."""
    return np.array([(one.start, one.end) for one in found], np.float64)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (CAR, [(0.0, 0.0023), (0.0384, 0.1504)]),
        (BOX, [(0.0, 0.2858), (0.3022, 0.3386), (0.3396, 0.4196), (0.4204, 0.48), (0.4806, 0.5014), (0.502, 0.5968)]),
    ],
)
def test_flights_of_computed_runs_are_seen_and_gaps_in_the_load_are_not(
    name: str, expected: list[tuple[float, float]]
) -> None:
    history = record(name)
    found = quiet_times(history, InnerMotion(history).needed)
    assert spans(found)[: len(expected)] == pytest.approx(np.array(expected), abs=5e-4)
    assert all(one.seen - one.start >= one.wait and one.left <= 1e-4 for one in found)
    assert all(one.gravity == pytest.approx(9.81, rel=5e-3) for one in found)


def test_a_swing_with_a_push_in_it_makes_no_wait_longer() -> None:
    """In the box the longest swing was pushed at 302 ms and took 24 ms, half of the period of the springs is 17 ms."""
    for before in (None, Wait(0.018, "record", "as in the flight before")):
        waits = [one.wait for one in quiet_times(record(BOX), InnerMotion(record(BOX), None, before).needed)]
        assert all(0.016 <= one <= 0.021 for one in waits[1:])


@pytest.mark.parametrize("name", [CAR, BOX])
def test_a_wait_below_half_of_a_known_period_is_refused(name: str) -> None:
    history = record(name)
    with pytest.raises(RangeError, match=r"`wait` 0\.002 is below"):
        quiet_times(history, InnerMotion(history, 0.002).needed)


def test_the_wait_that_was_measured_in_the_car_is_not_refused() -> None:
    history = until(record(CAR), 0.14)
    last = quiet_times(history, InnerMotion(history, 0.022).needed)[-1]
    assert last.start == pytest.approx(0.0383, abs=5e-4)
    assert last.wait == 0.022


@pytest.mark.parametrize("name", [CAR, BOX])
def test_what_is_seen_rests_on_no_later_state(name: str) -> None:
    history = record(name)
    found = quiet_times(history, InnerMotion(history).needed)
    for time in history.time[[300, 560, 640, 900]].tolist():
        early = until(history, time)
        seen = quiet_times(early, InnerMotion(early).needed)
        assert [one[:2] for one in seen] == [one[:2] for one in found if one.seen <= time]


def test_a_rigid_leg_shows_its_contact_by_the_model_alone() -> None:
    switched = record(*(f"drop2_w123_T0{leg}.gz" for leg in (1, 2, 3)))
    assert contact_after(switched, 0.0) == pytest.approx(0.2858, abs=4e-4)
    assert contact_after(record("car_all_T02.gz"), 0.05) is None


def test_flights_are_seen_before_between_and_in_rigid_legs() -> None:
    switched = record(*(f"drop2_w123_T0{leg}.gz" for leg in (1, 2, 3, 4)))
    found = quiet_times(switched, InnerMotion(switched).needed)
    assert spans(found)[:2] == pytest.approx(np.array([(0.0, 0.2858), (0.3022, 0.3386)]), abs=1e-3)


def test_the_highest_energy_is_that_of_a_state_in_the_span() -> None:
    history = record(CAR)
    tr = highest_energy(history, 0.0605, 0.0825)
    assert 0.0605 <= tr <= 0.0825
    assert history.energy_at(tr) == np.max(history.between(0.0605, 0.0825)[1])


def test_flights_begin_and_end_where_info_and_plan_find_them() -> None:
    history = record(BOX)
    listed = np.array([one.within(history.time) for one in flights_of(history, Settings())])
    for one in quiet_times(history, InnerMotion(history).needed):
        found = one.start, history.time[-1] if one.end is None else one.end
        if found[1] - one.start < 2 * one.wait:
            continue  # info lists none that is so short beside the others
        assert np.abs(listed - found).max(axis=1).min() <= 3 * history.step


def test_a_flight_that_rises_says_when_it_is_level_again() -> None:
    """The rollover box rises by 1.5 m/s; it lands 6 % before that, turned."""
    rising = open_run([str(ROOT / "sample_data" / "rolloverT01.gz")]).history(Selection(parts=("box",)))
    (one,) = (q for q in quiet_times(rising, InnerMotion(rising).needed) if q.start < 0.2)
    assert one.level is not None
    assert one.level - one.start == pytest.approx(0.31, rel=0.02)
    assert all(q.level is None for q in quiet_times(record(BOX), InnerMotion(record(BOX)).needed) if q.start < 0.6)


def test_a_record_of_as_many_states_as_parts_keeps_the_masses_of_all() -> None:
    """Three states of three parts: cut to two states, each part still has its mass."""
    parts = tuple(Part(number, str(number)) for number in (1, 2, 3))
    momenta = Momenta(np.arange(3.0), np.ones((3, 3, 3)), parts, EXACT, (0, 1, 2), masses=np.array([1.0, 2.0, 3.0]))
    assert rows_of(momenta, slice(0, 2)).mass((0, 1, 2)) == 6.0
