"""What is found in a record before any tr is looked at."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from d2rpick.choice.settings import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.suggest import suggest, suggest_at
from d2rpick.errors import RangeError
from d2rpick.vibration.oscillator import to_mode
from d2rpick.vibration.span import Fits
from tests import chain, paper
from tests.energies import codes, of

if TYPE_CHECKING:
    from d2rpick.histories.history import History

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


@pytest.mark.parametrize(("history", "td"), [(paper.history(), paper.TD), (chain.history(), chain.TD_LATE)])
def test_what_was_found_with_another_end_of_the_load_changes_nothing(history: History, td: float) -> None:
    """A plan keeps what it finds for all flights, and only one of them has the end of the load that was given."""
    fits, fresh = Fits(), suggest(history, td, PLAIN).candidates[:]
    for share in (0.2, 0.6):
        other = suggest_at(examine(history, td, Settings(after=share * td), fits)).candidates[:]
        assert other != fresh
    assert suggest_at(examine(history, td, PLAIN, fits)).candidates[:] == fresh
