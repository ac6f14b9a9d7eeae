"""Damaged inputs of all formats are read or refused, a million with ``D2RPICK_THOROUGH=20``; answers follow changes."""

from collections import Counter
from random import Random

import pytest

from tests.campaign import FORMATS, run_case
from tests.faults import count_inputs
from tests.relations import RELATIONS, make_run


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
@pytest.mark.parametrize("relation", RELATIONS)
def test_an_answer_follows_what_changes_its_history(relation: str) -> None:
    outcomes = Counter(run_case(relation, 0, number) for number in range(3))
    assert outcomes.keys() <= {"read", "refused"}
    assert outcomes["read"] > 0


def test_half_of_the_states_still_show_the_fastest_mode() -> None:
    fewest = RELATIONS["every second state"].fewest_states
    runs = [make_run(Random(seed), fewest) for seed in range(50)]
    assert min(run.states_per_period for run in runs) >= fewest >= 4
    assert any(make_run(Random(seed)).states_per_period < fewest for seed in range(50))
