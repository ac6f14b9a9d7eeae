"""Cards judged as printed: the solver, the switched parts, and the comments."""

from dataclasses import replace
from functools import partial

import pytest

from d2rpick.choice.answers import verify_in_history
from d2rpick.choice.judged_card import complete_printing, print_judged_card
from d2rpick.choice.question import Settings
from d2rpick.deck.printed_card import Printing
from tests.command import ENERGY, GLSTAT
from tests.energies import require
from tests.reading import read_history

PAIR = (0.0135867, 0.0687534)
HISTORY = read_history([ENERGY])
JUDGE = partial(verify_in_history, HISTORY, settings=Settings())


@pytest.mark.parametrize(
    ("written", "solver", "expected"),
    [
        ("csv", None, "ls-dyna"),
        ("radioss-th", None, "radioss"),
        ("radioss-th", "ls-dyna", "ls-dyna"),
    ],
)
def test_the_solver_is_that_of_the_history_unless_asked_for(
    written: str, solver: str | None, expected: str
) -> None:
    printing = Printing(solver=solver, part=(1,))
    history = replace(HISTORY, format=written)
    assert complete_printing(printing, history).solver == expected


def test_the_run_ends_with_the_history_unless_told() -> None:
    assert complete_printing(Printing(), HISTORY).end == HISTORY.time[-1]
    assert complete_printing(Printing(end=7.0), HISTORY).end == 7.0


def test_without_anybody_to_switch_there_is_no_card() -> None:
    assert print_judged_card([PAIR], HISTORY, JUDGE, Printing()) is None
    assert (
        print_judged_card([PAIR], HISTORY, JUDGE, Printing(solver="radioss", part=(1,)))
        is None
    )


def test_each_window_has_its_verdict_in_the_comments() -> None:
    windows = [PAIR, (0.0939, 0.119)]
    history = read_history([GLSTAT])
    judge = partial(verify_in_history, history, settings=Settings())
    printed_card = require(
        print_judged_card(windows, history, judge, Printing(part=(1,)))
    )
    card, verdicts = printed_card
    assert card.windows == tuple(windows)
    assert [verdict.verified for verdict in verdicts] == [True, False]
    lines = " ".join(line.removeprefix("$ ").strip() for line in card.text.splitlines())
    assert "0.0135867 to 0.0687534 use. The flight is certain" in lines
    assert "0.0939 to 0.119 DO NOT USE. " in lines
    assert "To improve: use tr = " in lines
