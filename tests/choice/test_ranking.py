"""The order of candidates, and the limits that a recommendation keeps."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.choice.candidates import Candidate
from d2rpick.choice.ranking import EQUALLY_GOOD, rank
from d2rpick.choice.settings import Settings
from d2rpick.choice.suggest import suggest
from d2rpick.choice.verify import verify
from tests import paper
from tests.energies import codes, rollover

PLAIN = Settings()

candidates = st.builds(
    lambda tr, error, acceptable: Candidate(
        0, tr, "crossing", 1.0, 1.0, 0.0, True, True, error, error, None, 1 - tr, 1 - tr, None, None, None, acceptable,
        False, (),
    ),
    st.floats(0, 0.9),
    st.one_of(st.floats(0, 0.1), st.floats(0, 2)),
    st.booleans(),
)  # fmt: skip


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


@given(st.lists(candidates, max_size=12))
def test_the_order_of_candidates(some: list[Candidate]) -> None:
    ranked = rank(some)
    assert [c.rank for c in ranked] == list(range(1, len(some) + 1))
    assert sorted(c.tr for c in ranked) == sorted(c.tr for c in some)
    assert [c.acceptable for c in ranked] == sorted((c.acceptable for c in some), reverse=True)
    good = [c for c in ranked if c.acceptable]
    if good:
        near = min(c.error for c in good) + EQUALLY_GOOD
        assert good[0].error <= near
        assert good[0].tr == min(c.tr for c in good if c.error <= near)
