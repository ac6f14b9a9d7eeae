"""Damaged inputs of all formats are read or refused, a million with ``D2RPICK_THOROUGH=20``; answers follow changes."""

from collections import Counter

import pytest

from tests.campaign import FORMATS, run_case
from tests.faults import count_inputs
from tests.relations import RELATIONS


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMATS)
def test_whatever_the_damage_an_input_is_read_or_refused(form: str) -> None:
    outcomes = Counter(
        run_case(form, 0, number)
        for number in range(count_inputs(1_000_000) // len(FORMATS) + 1)
    )
    print(
        f"{form}: {outcomes['read']} read, {outcomes['refused']} refused"
    )  # shown by pytest -rP
    assert outcomes.keys() <= {"read", "refused"}
    assert outcomes["read"] > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    "relation", [name for name, relation in RELATIONS.items() if relation.exact]
)
def test_an_answer_does_not_change_with_what_must_not_matter(relation: str) -> None:
    outcomes = Counter(run_case(relation, 0, number) for number in range(3))
    assert outcomes.keys() <= {"read", "refused"}
    assert outcomes["read"] > 0
