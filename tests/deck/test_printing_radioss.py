"""Printed Radioss engine files: legs in the order of time, bodies off and on, and the largest step while rigid."""

from __future__ import annotations

import re
from functools import partial

import pytest

from d2rpick.deck import printing
from d2rpick.deck.printed_card import Printing
from d2rpick.errors import DeckError

cards = partial(printing.cards, solver="radioss")
BOX = Printing(node=tuple(range(1, 13)), end=0.15, name="run")


def test_three_engine_files() -> None:
    card = cards([(0.0128853793630525, 0.064)], BOX)
    parts = [leg.split("\n") for leg in card.files.values()]
    assert list(card.files) == ["run_0001.rad", "run_0002.rad", "run_0003.rad"]
    assert [leg[:3] for leg in parts] == [
        ["/RUN/run/1", "  0.0128853793630525", "/RBODY/OFF"],
        ["/RUN/run/2", "               0.064", "/RBODY/ON"],
        ["/RUN/run/3", "                0.15", "/RBODY/OFF"],
    ]
    assert [leg[3:5] for leg in parts] == [["1 2 3 4 5 6 7 8 9 10", "11 12"]] * 3
    assert ["/DTIX\n5.1e-05 5.1e-05" in leg for leg in card.files.values()] == [False, True, False]
    assert re.findall(r"# ---- (\S+)", card.text) == list(card.files)
    capped = cards([(0.01, 0.02)], Printing(node=(1,), end=0.03, step_cap=1e-6))
    assert "/DTIX\n1e-06 1e-06" in capped.text


def test_every_window_has_a_leg_and_one_from_the_start_none_before_it() -> None:
    card = cards([(0.0, 0.02), (0.05, 0.09)], BOX)
    found = re.findall(r"/RUN/run/(\d)\n +(\S+)\n/RBODY/(\w+)", card.text)
    assert found == [("1", "0.02", "ON"), ("2", "0.05", "OFF"), ("3", "0.09", "ON"), ("4", "0.15", "OFF")]


@pytest.mark.parametrize(
    ("end", "message"), [(0.05, "the run ends at 0.05"), (None, "not given"), (float("inf"), "the run ends")]
)
def test_the_end_comes_last(end: float | None, message: str) -> None:
    with pytest.raises(DeckError, match=message):
        cards([(0.02, 0.09)], Printing(node=(1,), end=end))


@pytest.mark.parametrize("printing", [Printing(end=1.0), Printing(node=(1,), end=1.0, name="a/b")])
def test_what_is_not_a_run(printing: Printing) -> None:
    with pytest.raises(DeckError):
        cards([(0.02, 0.09)], printing)


def test_more_legs_than_the_solver_numbers_are_refused() -> None:
    with pytest.raises(DeckError, match="at most 99"):
        cards([(i, i + 0.5) for i in range(1, 60)], Printing(node=(1,), end=100.0))
