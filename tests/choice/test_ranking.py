"""The order of candidates, and the limits that a recommendation keeps."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.choice.candidates import find_candidates
from d2rpick.choice.of_run import read
from d2rpick.choice.ranking import EQUALLY_GOOD, order, over_limits, rank
from d2rpick.choice.settings import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.suggest import suggest
from d2rpick.choice.verify import verify
from d2rpick.histories.opening import Selection
from d2rpick.vibration.span import Fits
from tests import paper
from tests.computed import stored
from tests.energies import codes, rollover

if TYPE_CHECKING:
    from d2rpick.histories.history import History

rows = st.lists(
    st.tuples(
        st.floats(0, 0.9),
        st.one_of(st.floats(0, 0.1), st.floats(0, 2), st.just(np.inf)),
        st.sampled_from([0, 1, 2]),
        st.booleans(),
    ),
    max_size=12,
)


@pytest.mark.parametrize("limit", [{"max_kinetic_share": 0.9}, {"max_residual": 0.95}])
def test_limits_object_to_what_would_only_be_warned_of(limit: dict[str, float]) -> None:
    answer = suggest(paper.history(), paper.TD, Settings(**limit))  # type: ignore[arg-type]
    assert answer.recommended is None
    assert "no-candidate" in codes(answer)
    assert answer.better_pair is not None
    judged = verify(paper.history(), 0.0128853, paper.TD, Settings(**limit))  # type: ignore[arg-type]
    assert (judged.tr_ok, judged.verified) == (True, False)
    assert "limit" in judged.reasons[0]


def test_limits_that_cannot_be_judged_are_not_kept() -> None:
    answer = suggest(rollover(), 0.37, Settings(max_residual=10.0))
    assert answer.recommended is None
    judged = verify(rollover(), 0.0886, 0.37, Settings(max_residual=10.0))
    assert "residual unknown" in " ".join(judged.reasons)


@given(rows)
def test_the_order_of_candidates(some: list[tuple[float, float, int, bool]]) -> None:
    rigid, error = np.array([row[0] for row in some]), np.array([row[1] for row in some])
    group, off = np.array([row[2] for row in some], dtype=np.intp), np.array([row[3] for row in some], dtype=bool)
    places = order(group, error, rigid, off).tolist()
    assert sorted(places) == list(range(len(some)))
    assert [some[i][2] for i in places] == sorted(group.tolist())
    for number in set(group.tolist()):
        ranked = [some[i] for i in places if some[i][2] == number]
        near = min(row[1] for row in ranked) + EQUALLY_GOOD
        good = [row for row in ranked if row[1] <= near]
        longest = max(row[0] for row in good)
        late = [row for row in good if row[0] < 0.9 * longest]
        early = sorted((row for row in good if row not in late), key=lambda row: (row[3], -row[0]))
        rest = sorted((row for row in ranked if row[1] > near), key=lambda row: (row[1], -row[0]))
        assert ranked == early + sorted(late, key=lambda row: -row[0]) + rest


@cache
def car(parts: str) -> History:
    return read([stored("carT01.gz")], Selection(parts=(parts,))).history


@pytest.mark.parametrize("parts", ["1-17", "1-14"])
def test_tr_does_not_jump_when_td_moves_a_little(parts: str) -> None:
    """From 49.6 to 82.4 ms it did, as td moved by 3 ms, and gained nothing: the mean energy after td hardly differs."""
    known, found = Fits(), []
    for td in np.arange(0.141, 0.1502, 0.0007).tolist():
        situation = examine(car(parts), td, Settings(), known)
        best = rank(find_candidates(situation)).chosen
        assert best is not None
        assert best.level_error is not None
        assert best.level_error < 0.06
        found.append(best.tr)
    assert max(found) - min(found) < 3e-3
    assert min(found) > 0.0384  # the flight begins there


def test_of_times_alike_the_one_that_leaves_the_body_in_place_is_recommended() -> None:
    situation = examine(car("1-17"), 0.12, Settings())
    ranked = rank(find_candidates(situation))
    assert situation.bodies is not None
    off = replace(ranked, situation=situation, position_error=np.where(ranked.tr < 0.0395, 1.0, 0.0))
    first, second = ranked[0], rank(off)[0]
    assert first.tr < 0.0395 < second.tr < first.tr + 0.1 * (0.12 - first.tr)
    nothing_near = replace(ranked, position_error=np.where(ranked.tr < 0.09, 1.0, 0.0))
    assert rank(nothing_near)[0].tr == first.tr


@cache
def fits(_: float) -> Fits:
    """What is found in the record that is asked about this td: limits change nothing of it."""
    return Fits()


@pytest.mark.parametrize("limits", [{}, {"max_kinetic_share": 0.9}, {"max_residual": 0.95}, {"tolerance": 1e-3}])
@pytest.mark.parametrize(("history", "td"), [(paper.history(), paper.TD), (rollover(), 0.37)])
def test_candidates_are_kept_together_as_one_by_one(history: History, td: float, limits: dict[str, float]) -> None:
    situation = examine(history, td, Settings(**limits), fits(td))  # type: ignore[arg-type]
    ranked = rank(find_candidates(situation))
    assert len(ranked) > 3
    kept = ranked.kept[ranked.order].tolist()
    assert kept == [one.acceptable and not over_limits(situation, one) for one in ranked]
    assert ranked.recommended == (kept.index(True) if any(kept) else None)
    assert [one.rank for one in ranked] == list(range(1, len(ranked) + 1))
    assert [one.error for one in ranked] == ranked.error[ranked.order].tolist()
    assert [one.acceptable for one in ranked] == ranked.acceptable[ranked.order].tolist()
    assert ranked[1:3] == (ranked[1], ranked[2])
    assert ranked[-1].tr == ranked.tr[ranked.order[-1]]
