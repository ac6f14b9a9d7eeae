"""What all printed cards share: numbers in columns, windows that follow each other, files of windows."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.deck.printed_card import LONGEST, Printing, check_windows, read_windows, shortest
from d2rpick.deck.printing import SOLVERS, cards, solver_of
from d2rpick.errors import DeckError
from d2rpick.histories.opening import READERS
from tests.command import run

TIMES = st.floats(1e-9, 1e9)
ALL = Printing(part=(11,), node=(1001,), end=1e6)


@given(st.integers(-9999, 99999), st.integers(-3, 3))
def test_few_digits_read_back(digits: int, exponent: int) -> None:
    value = float(f"{digits}e{exponent}")
    assert float(shortest(value)) == value
    assert len(shortest(value)) <= LONGEST


@given(TIMES)
def test_the_nearest_text_is_taken(value: float) -> None:
    text = shortest(value)
    assert len(text) <= LONGEST
    others = [f"{value:.{n}f}" for n in range(12)] + [f"{value:.{n}g}" for n in range(1, 12)]
    others += [other.removeprefix("0") for other in others if "." in other]
    assert abs(float(text) - value) <= min(abs(float(other) - value) for other in others if len(other) <= LONGEST)


def test_a_number_too_wide_is_refused() -> None:
    with pytest.raises(DeckError, match="cannot be written"):
        shortest(1e300, 4)


@pytest.mark.parametrize(
    ("windows", "message"),
    [
        ([], "no window"),
        ([(0.09, 0.02)], "0 <= tr < td"),
        ([(0.02, 0.02)], "0 <= tr < td"),
        ([(-1.0, 1.0)], "0 <= tr < td"),
        ([(0.0, float("inf"))], "0 <= tr < td"),
        ([(0.02, float("nan"))], "0 <= tr < td"),
        ([(0.02, 0.09), (0.05, 0.2)], "overlaps or touches"),
        ([(0.02, 0.09), (0.09, 0.2)], "overlaps or touches"),
        ([(0.2, 0.3), (0.02, 0.09)], "lies before"),
    ],
)
@pytest.mark.parametrize("solver", SOLVERS)
def test_windows_that_do_not_follow_each_other_are_refused(
    windows: list[tuple[float, float]], message: str, solver: str
) -> None:
    with pytest.raises(DeckError, match=message):
        cards(windows, ALL, solver)


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_prints_what_it_is_given(solver: str) -> None:
    windows = [(0.0, 0.09), (0.2, 0.3), (0.5, 0.75)]
    card = cards(windows, ALL, solver, ["a\nremark"])
    assert card.windows == tuple(windows)
    assert " a\\nremark\n" in card.text
    assert card.notes == ()
    assert all(content in card.text for content in card.files.values())
    assert hasattr(ALL, SOLVERS[solver].switches)
    assert all(hasattr(ALL, name) for name in SOLVERS[solver].takes)


def test_the_solver_is_that_of_the_history() -> None:
    formats = {name: solver_of(name) for name in READERS}
    assert {name for name, solver in formats.items() if solver == "radioss"} == {"radioss-th"}
    assert solver_of("glstat + matsum") == "ls-dyna"
    claimed = [name for solver in SOLVERS.values() for name in solver.histories]
    assert len(claimed) == len(set(claimed))


def test_the_command_line_offers_the_solvers_there_are() -> None:
    assert f"[{'|'.join(SOLVERS)}]" in run("card", "--help").stdout
    refused = run("card", "--solver", "abaqus", "--tr", "1", "--td", "2", "--part", "1")
    assert refused.exit_code == 2
    assert f"'abaqus' was found, one of {', '.join(SOLVERS)} was expected" in refused.stderr


def test_a_file_of_windows() -> None:
    assert read_windows("# tr td\n0.02 0.09\n\n .2  3e-1\n", "w.txt") == ((0.02, 0.09), (0.2, 0.3))
    assert check_windows([(-0.0, 1.0)])[0][0].hex() == "0x0.0p+0"


@pytest.mark.parametrize(
    ("text", "message"), [("0.02\n", "w.txt:1: '0.02'"), ("1 2\na b\n", "w.txt:2"), ("", "w.txt: no")]
)
def test_what_is_not_a_file_of_windows(text: str, message: str) -> None:
    with pytest.raises(DeckError, match=message):
        read_windows(text, "w.txt")
