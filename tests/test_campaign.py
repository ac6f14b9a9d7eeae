"""Damaged inputs of all formats are read or refused: a few, a million with ``D2RPICK_THOROUGH=20``."""

from collections import Counter

import pytest

from tests.campaign import FORMATS, case
from tests.faults import inputs


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMATS)
def test_whatever_the_damage_an_input_is_read_or_refused(form: str) -> None:
    found = Counter(case(form, 0, number) for number in range(inputs(1_000_000) // len(FORMATS) + 1))
    print(f"{form}: {found['read']} read, {found['refused']} refused")  # shown by pytest -rP
    assert found.keys() <= {"read", "refused"}
    assert found["read"] > 0
