"""Supported windows end before the landing of the switched run; all twenty sets: ``python -m tests.drop_plans``."""

import pytest

from tests.drop_plans import SETS, outcome


@pytest.mark.slow
def test_supported_windows_end_before_the_landing_of_the_switched_run() -> None:
    found = outcome(SETS[12], interval=3e-4)  # at most two steps of the model a state
    assert found.windows
    assert found.kept, found
