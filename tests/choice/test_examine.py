"""What is found in a record before any tr is looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from d2rpick.choice.settings import Settings
from d2rpick.choice.suggest import suggest
from d2rpick.errors import RangeError
from d2rpick.vibration.equivalent import to_mode
from tests import paper
from tests.energies import codes, of

PLAIN = Settings()


def test_a_given_oscillator_that_does_not_fit_is_not_believed() -> None:
    wrong = to_mode(replace(paper.OSCILLATOR, stiffness=500e3), 6.0)
    answer = suggest(paper.history(), paper.TD, Settings(oscillator=wrong))
    assert answer.situation.basis == "energy"
    assert "energy-only" in codes(answer)


def test_two_states_are_too_few_and_td_must_lie_in_the_record() -> None:
    with pytest.raises(RangeError, match="at least 3"):
        suggest(of(np.array([0.0, 1.0]), np.array([0.0, 1.0])), 0.5, PLAIN)
    with pytest.raises(RangeError, match=r"outside the record, 0 to 0\.15"):
        suggest(paper.history(), 0.2, PLAIN)
