"""Supported windows end before the landing of the switched run; all twenty sets: ``python -m tests.drop_plans``."""

import pytest

from tests.drop_plans import SETS, outcome


@pytest.mark.parametrize("number", [0, 12])
def test_supported_windows_end_before_the_landing_of_the_switched_run(number: int) -> None:
    found = outcome(SETS[number], interval=3e-4)  # at most two steps of the model a state
    assert found.windows
    assert found.kept, found
