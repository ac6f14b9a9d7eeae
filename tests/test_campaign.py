"""Damaged inputs of all formats are read or refused: a few, a million with ``D2RPICK_THOROUGH=20``."""

from collections import Counter
from random import Random

import pytest

from tests.campaign import FORMATS, case, outcome
from tests.faults import inputs


@pytest.mark.parametrize("form", FORMATS)
def test_whatever_the_damage_an_input_is_read_or_refused(form: str) -> None:
    found = Counter(case(form, 0, number) for number in range(inputs(1_000_000) // len(FORMATS) + 1))
    print(f"{form}: {found['read']} read, {found['refused']} refused")  # shown by pytest -rP
    assert found.keys() <= {"read", "refused"}
    assert found["read"] > 0


def test_a_fault_is_no_refusal() -> None:
    found = outcome(lambda random: bool(1 / random.randrange(1)), Random(0), 7)
    assert found == "number 7: ZeroDivisionError: division by zero"
