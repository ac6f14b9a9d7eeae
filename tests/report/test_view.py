"""The part of the record that a figure shows, and the motion that is drawn."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings
from d2rpick.flight.flight import Flight
from d2rpick.histories.history import History
from d2rpick.report.view import make_view, replay_motion
from tests.command import ENERGY
from tests.energies import require
from tests.reading import read_history

TIME = np.linspace(0, 10, 1001)
# A load until 2, a vibration about 1, a landing at 8.
RECORD = np.where(TIME < 2, 50, np.where(TIME < 8, 1 + 0.1 * np.sin(9 * TIME), 500))


def make_record(
    energy: np.ndarray[tuple[int], np.dtype[np.float64]] = RECORD,
) -> History:
    return History(TIME, energy, ("made",), "made", "energy")


def test_the_flight_is_shown_and_what_stands_above_it_is_named() -> None:
    shown_view = make_view(make_record(), Flight(2.0, 8.0, "given"), [7.0])
    assert (shown_view.start, shown_view.end) == pytest.approx((1.64, 8.36))
    assert (shown_view.low, shown_view.high) == pytest.approx((0.9, 1.1), abs=1e-3)
    assert shown_view.above == (("load", 50), ("landing", 500))


def test_what_does_not_stand_above_the_flight_is_not_named() -> None:
    assert make_view(
        make_record(np.where(TIME < 2, 1, RECORD)), Flight(2.0, 8.0, "given"), [7.0]
    ).above == (("landing", 500),)


def test_times_beyond_the_flight_are_shown_too() -> None:
    shown_view = make_view(make_record(), Flight(2.0, 8.0, "given"), [1.0, 9.0])
    assert shown_view.start < 1
    assert shown_view.end > 9
    assert shown_view.high < 2


def test_without_a_flight_the_whole_record_is_shown_and_nothing_is_cut() -> None:
    assert make_view(make_record(), Flight(None, None, None), [5.0]) == (
        0.0,
        10.0,
        RECORD.min(),
        500,
        (),
    )


def test_a_flight_without_an_end_lasts_as_far_as_it_is_known() -> None:
    assert make_view(
        make_record(), Flight(2.0, None, "oscillator"), [3.0], last_known=6.0
    ).end == pytest.approx(6.24)
    assert make_view(make_record(), Flight(2.0, None, "momentum"), [3.0]).end == 10


@given(
    st.lists(st.floats(0, 1), min_size=3, max_size=9, unique=True),
    st.floats(0, 1),
    st.floats(0, 1),
    st.floats(0, 1),
)
def test_any_flight_of_any_record_can_be_shown(
    times: list[float], first_share: float, second_share: float, td: float
) -> None:
    time = np.sort(times) + np.arange(float(len(times)))
    start, end = sorted((first_share * time[-1], second_share * time[-1]))
    history = History(time, np.cos(time), ("made",), "made", "energy")
    shown_view = make_view(
        history,
        Flight(start, end, "given"),
        [float(time[0] + td * (time[-1] - time[0]))],
    )
    assert time[0] <= shown_view.start < shown_view.end <= time[-1]
    assert shown_view.low <= shown_view.high
    highest = history.between(shown_view.start, shown_view.end)[1].max(
        initial=shown_view.high
    )
    assert (
        max([shown_view.high, *(energy for _, energy in shown_view.above)]) == highest
    )
    assert all(energy > shown_view.high for _, energy in shown_view.above)


def test_the_motion_is_that_of_the_record_until_tr_rigid_then_and_continuous() -> None:
    situation = examine_td(read_history([ENERGY]), 0.064, Settings())
    tr = 0.0128853
    time = np.linspace(0.0, 0.1, 4001)
    motion = require(replay_motion(situation, tr, time))
    states = np.linspace(0.0, 0.1, 1001)  # those of the record
    whole = require(replay_motion(situation, tr, states))
    np.testing.assert_allclose(
        whole.reference**2, situation.history.energies_at(states), rtol=1e-5, atol=1e-6
    )
    before_tr, rigid = time <= tr, (time >= tr) & (time <= 0.064)
    np.testing.assert_array_equal(
        motion.switched[before_tr], motion.reference[before_tr]
    )
    assert np.ptp(motion.switched[rigid]) < 1e-9
    assert np.abs(np.diff(motion.switched)).max() < 0.1
    assert (
        replay_motion(
            examine_td(read_history([ENERGY]), 0.064, Settings(replay=False)), tr
        )
        is None
    )
