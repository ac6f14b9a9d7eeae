"""Events of a run so far, for a synthetic body that vibrates, is pushed, flies and lands."""

from functools import cache

import numpy as np
from hypothesis import given, settings, strategies as st

from d2rpick.histories.history import EXACT, Balance, History, Momenta
from d2rpick.running.events import find_events
from tests.energies import require
from tests.records import cut_history, make_table
from tests.running.seen import take_whole_record

# Half-sine pushes [s], and the period of the inner vibration from the first push on [s].
PUSHES = ((0.1, 0.13), (0.17, 0.2), (0.62, 0.66))
PERIOD, STEP, END = 0.12, 1e-3, 0.8


@cache
def make_pushed_history(gravity: float = 9.81) -> History:
    time = np.arange(0.0, END, STEP)
    force = np.zeros(time.size)
    for start, end in PUSHES:
        inside = (time > start) & (time < end)
        force[inside] += 400 * np.sin(np.pi * (time[inside] - start) / (end - start))
    impulse = np.concatenate([[0.0], np.cumsum((force[1:] + force[:-1]) / 2 * STEP)])
    momentum = np.zeros((time.size, 1, 3))
    momentum[:, 0, 2] = -20.0 - 2.0 * gravity * time + impulse
    swing = np.where(
        time > PUSHES[0][0], np.sin(2 * np.pi * (time - PUSHES[0][0]) / PERIOD), 0.0
    )
    energy = 50.0 * swing**2
    kinetic = momentum[:, 0, 2] ** 2 / 4
    whole = Momenta(time, momentum, None, EXACT, (0,), masses=np.array([2.0]))
    balance = Balance(
        time,
        energy,
        kinetic,
        sliding=np.concatenate([[0.0], np.cumsum(force[1:] ** 2) * 1e-6]),
    )
    return make_table(time, energy, whole, balance=balance)


def list_events(
    history: History, wait: float | None = None
) -> list[tuple[str, float | None, float | None]]:
    return [event[:3] for event in find_events(take_whole_record(history, wait))]


def test_a_gap_between_two_pushes_is_no_flight() -> None:
    """The gap lasts 40 ms; half of the vibration period is 60 ms."""
    found_events = find_events(take_whole_record(make_pushed_history()))
    events = [
        event.event for event in found_events if event.event in ("flight", "contact")
    ]
    assert events == ["flight", "contact", "flight", "contact", "flight"]
    first, last, _ = [event for event in found_events if event.event == "flight"]
    assert first.time == 0.0
    assert abs(require(last.time) - PUSHES[1][1]) <= 3 * STEP
    assert 0.05 <= require(last.flight).wait.time <= 0.07
    contacts = [
        event.time
        for event in found_events
        if event.event == "contact" and event.time is not None
    ]
    assert np.allclose(contacts, [PUSHES[0][0], PUSHES[2][0]], atol=3 * STEP)


@settings(max_examples=12)
@given(st.integers(20, int(END / STEP) - 1), st.sampled_from([None, 0.06]))
def test_the_events_of_a_run_so_far_are_the_first_of_all(
    state: int, wait: float | None
) -> None:
    whole, end_of_file = (
        list_events(make_pushed_history(), wait),
        float(make_pushed_history().time[state]),
    )
    assert list_events(cut_history(make_pushed_history(), end_of_file), wait) == [
        event for event in whole if event[2] is not None and event[2] <= end_of_file
    ]


@settings(max_examples=12)
@given(st.integers(0, int(END / STEP) - 1))
def test_a_switch_is_advised_where_the_energy_is_high_and_nothing_acts(
    state: int,
) -> None:
    history = (
        cut_history(make_pushed_history(), float(make_pushed_history().time[state]))
        if state > 20
        else make_pushed_history()
    )
    for event in find_events(take_whole_record(history)):
        if event.event == "switch" and event.tr is not None and event.tr > PUSHES[1][1]:
            assert not any(start <= event.tr <= end for start, end in PUSHES)
            assert history.energy_at(event.tr) >= 0.7 * 50


def test_a_constant_force_that_is_not_gravity_is_no_flight() -> None:
    events = find_events(take_whole_record(make_pushed_history(5.0), 0.06))
    assert "flight" not in {event.event for event in events}


def test_a_momentum_that_never_changes_is_that_of_a_flight_without_gravity() -> None:
    """A fit of gravity and damping would find only what rounding leaves of it."""
    history = cut_history(make_pushed_history(0.0), PUSHES[0][0])
    (flight,) = take_whole_record(history).flights()
    assert (flight.start, flight.gravity, flight.end) == (0.0, 0.0, None)
