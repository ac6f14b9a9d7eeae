"""The public keys: each is described in the schemas, and a measure means the same in all of them."""

from __future__ import annotations

import pytest

from d2rpick.report import keys
from tests.measures_in_schemas import COPIES, of_candidates, renewed, schema_of


def test_every_key_of_a_candidate_is_described() -> None:
    assert {*of_candidates()} == {*keys.CANDIDATE, "parts"}


def test_every_measure_is_that_of_a_candidate() -> None:
    assert {*keys.MEASURES} <= keys.CANDIDATE.keys()


@pytest.mark.parametrize("name", COPIES)
def test_measures_are_described_as_for_suggest(name: str) -> None:
    assert renewed(name) == schema_of(name), "run python -m tests.measures_in_schemas"
