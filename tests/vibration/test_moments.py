"""Moments as columns."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.vibration.moments import Moment, Moments

KINDS = st.sampled_from(["crossing", "extremum", "match", "start", "given"])
ANY = st.lists(st.builds(Moment, st.floats(-1e9, 1e9), KINDS, st.sampled_from([None, False, True])))


@given(ANY, st.data())
def test_columns_are_the_moments_they_were_made_of(found: list[Moment], data: st.DataObject) -> None:
    columns = Moments.of(found)
    assert list(columns) == found
    assert Moments.of(columns) is columns
    assert columns.are("match").tolist() == [one.kind == "match" for one in found]
    places = data.draw(st.permutations(range(len(found))))
    assert list(columns.at(np.array(places, dtype=np.intp))) == [found[i] for i in places]
    assert list(columns[1:3]) == found[1:3]


def test_crossings_of_a_level_come_before_the_extrema_near_it() -> None:
    found = Moments.of_level(np.array([1.0, 3.0]), np.array([True, False]), np.array([2.0]))
    assert list(found) == [Moment(1.0, "crossing", True), Moment(3.0, "crossing", False), Moment(2.0, "extremum", None)]
