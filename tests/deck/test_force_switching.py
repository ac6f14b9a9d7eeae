"""Pairs of switch sets that act by a force, in runs with known contact times."""

from itertools import pairwise

import pytest
from hypothesis import given, strategies as st

from d2rpick.deck.force_switching import (
    ForceSwitch,
    find_delay_without_chatter,
    follow_pair,
)

TO_RIGID, BACK = ForceSwitch(True, False), ForceSwitch(False, True)
BOUNCES = [(0.0, 0.01), (0.02, 0.021), (0.0215, 0.03), (0.06, 0.07)]


def test_a_pair_switches_with_every_force() -> None:
    assert follow_pair(TO_RIGID, BACK, BOUNCES, 0.1) == [
        (0.01, 0.02),
        (0.021, 0.0215),
        (0.03, 0.06),
        (0.07, None),
    ]


def test_a_delay_after_the_way_back_keeps_chatter_out() -> None:
    waits = BACK._replace(delay=0.002)
    assert follow_pair(TO_RIGID, waits, BOUNCES, 0.1) == [
        (0.01, 0.02),
        (0.03, 0.06),
        (0.07, None),
    ]


def test_a_delay_after_becoming_rigid_misses_a_contact() -> None:
    late = TO_RIGID._replace(
        delay=0.0105
    )  # the second contact has ended when the set may switch back
    assert follow_pair(
        late, BACK, [(0.0, 0.01), (0.02, 0.0203), (0.05, 0.06)], 0.1
    ) == [(0.01, 0.05), (0.06, None)]


def test_sets_act_between_their_times() -> None:
    later = TO_RIGID._replace(earliest=0.04)
    assert follow_pair(later, BACK, BOUNCES, 0.1) == [(0.04, 0.06), (0.07, None)]
    ends = TO_RIGID._replace(latest=0.025)
    assert follow_pair(ends, BACK, BOUNCES, 0.1) == [(0.01, 0.02), (0.021, 0.0215)]
    assert follow_pair(TO_RIGID._replace(earliest=0.2), BACK, BOUNCES, 0.1) == []


def test_sets_without_a_pair_switch_once() -> None:
    alone = TO_RIGID._replace(paired=False), BACK._replace(paired=False)
    assert follow_pair(*alone, BOUNCES, 0.1) == [(0.01, 0.02)]
    assert follow_pair(alone[0], None, BOUNCES, 0.1) == [(0.01, None)]


def test_swapped_codes_are_rigid_in_the_contacts() -> None:
    swapped = TO_RIGID._replace(with_force=True), BACK._replace(with_force=False)
    assert follow_pair(*swapped, BOUNCES, 0.1) == [*BOUNCES]


@given(
    st.lists(st.integers(1, 1000), min_size=2, max_size=12, unique=True).filter(
        lambda cuts: len(cuts) % 2 == 0
    )
)
def test_windows_follow_each_other_and_no_force_acts_in_them(cuts: list[int]) -> None:
    times = sorted(cuts)
    contacts = [
        (float(a), float(b)) for a, b in zip(times[::2], times[1::2], strict=True)
    ]
    windows = follow_pair(TO_RIGID, BACK, contacts, 2000.0)
    assert windows[-1][1] is None
    assert all(
        window[1] is not None and window[1] < next_window[0]
        for window, next_window in pairwise(windows)
    )
    for tr, td in windows:
        assert not any(start < (td or 2000.0) and tr < end for start, end in contacts)


def test_the_delay_that_keeps_chatter_out_does_so() -> None:
    wanted = [(0.01, 0.02), (0.03, 0.06), (0.07, 0.1)]
    wait = find_delay_without_chatter(wanted, BOUNCES)
    assert wait is not None
    delay = follow_pair(TO_RIGID, BACK._replace(delay=wait), BOUNCES, 0.1)
    assert [tr for tr, _ in delay] == pytest.approx([tr for tr, _ in wanted])
    assert [td for _, td in delay] == [0.02, 0.06, None]
    assert find_delay_without_chatter([(0.0, 0.02)], []) is None


def test_sets_whose_conditions_both_hold_are_followed_to_the_next_change_of_force() -> (
    None
):
    """Between 0.019 and 0.02, the second set acts by its offset, and the first one because no force acts yet."""
    ahead = [(start - 0.001, end) for start, end in BOUNCES[1:]]
    windows = follow_pair(TO_RIGID, BACK, BOUNCES[1:], 0.05, ahead)
    lasting = [(tr, td) for tr, td in windows if td is None or td - tr > 1e-4]
    assert lasting == [(0.0, 0.019), (0.03, None)]
    assert len(windows) < 10
    wait = find_delay_without_chatter([(0.0, 0.019)], BOUNCES[1:])
    assert wait == pytest.approx(0.001)
