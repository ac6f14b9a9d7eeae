"""Printed cards: columns, rounding, and that the deck check finds nothing in them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.deck.printing.cards import ls_dyna, radioss, shortest
from d2rpick.errors import DeckError
from d2rpick.rules import check_deck
from tests.decks import found, read, spans, write

if TYPE_CHECKING:
    from pathlib import Path

TIMES = st.floats(1e-9, 1e9)


@given(st.integers(-9999, 99999), st.integers(-4, 4))
def test_few_digits_read_back(digits: int, exponent: int) -> None:
    value = float(f"{digits}e{exponent}")
    assert float(shortest(value)) == value
    assert len(shortest(value)) <= 10


@given(TIMES)
def test_the_nearest_text_is_taken(value: float) -> None:
    text = shortest(value)
    assert len(text) <= 10
    others = [f"{value:.{n}f}" for n in range(12)] + [f"{value:.{n}g}" for n in range(1, 12)]
    others += [other.removeprefix("0") for other in others if "." in other]
    assert abs(float(text) - value) <= min(abs(float(other) - value) for other in others if len(other) <= 10)


def test_a_number_too_wide_is_refused() -> None:
    with pytest.raises(DeckError, match="cannot be written"):
        shortest(1e300, 4)


PARTS = [11, 12]
CARD = """\
*DEFORMABLE_TO_RIGID_AUTOMATIC
$#   swset      code     time1     time2     time3     entno     relsw    paired
       901         0      0.02       0.0       0.0         0         0         0
$#    nrbf      ncsf       rwf     dtmax       d2r       r2d    offset
         0         0         0       0.0         2         0       0.0
$#     pid       lrb     ptype
        11         0      PART
        12        11      PART
*DEFORMABLE_TO_RIGID_AUTOMATIC
$#   swset      code     time1     time2     time3     entno     relsw    paired
       902         0      0.09       0.0       0.0         0         0         0
$#    nrbf      ncsf       rwf     dtmax       d2r       r2d    offset
         0         0         0       0.0         0         2       0.0
$#     pid     ptype
        11      PART
        12      PART
"""


def test_the_card_to_the_letter() -> None:
    text = ls_dyna(0.02, 0.09, PARTS, merge=11).text
    assert text[text.index("*") :] == CARD


@given(TIMES, st.floats(1.001, 100), st.lists(st.integers(1, 10**10 - 1), min_size=1, max_size=30, unique=True))
def test_the_check_finds_nothing_in_a_card(
    tmp_path_factory: pytest.TempPathFactory, tr: float, factor: float, parts: list[int]
) -> None:
    card = ls_dyna(tr, tr * factor, parts, merge=parts[-1])
    folder = tmp_path_factory.mktemp("card")
    assert check_deck(write(folder, card.text)).findings == ()
    assert spans(read(folder, card.text)) == [(part, card.tr, card.td) for part in sorted(parts)]
    assert all(len(line) <= 100 for line in card.text.split("\n"))


def test_rounding_is_reported() -> None:
    card = ls_dyna(0.0128853793630525, 0.064, PARTS)
    assert card.tr == 0.012885379
    assert ".012885379" in card.notes[0]
    assert card.notes[0] in card.text
    assert ls_dyna(0.02, 0.09, PARTS).notes == ()


def test_warnings_are_those_that_apply() -> None:
    assert "merged" in ls_dyna(0.02, 0.09, PARTS).text
    assert "merged" not in ls_dyna(0.02, 0.09, PARTS, merge=11).text
    assert "merged" not in ls_dyna(0.02, 0.09, [11]).text
    assert "already" in ls_dyna(0.02, 0.09, PARTS, merge=5).text
    assert "DTMAX is 0" in ls_dyna(0.02, 0.09, PARTS).text
    assert "d2rpick card --step-cap" in ls_dyna(0.02, 0.09, PARTS).text
    assert "d2rpick card --merge" in ls_dyna(0.02, 0.09, PARTS).text
    assert "DTMAX is 0" not in ls_dyna(0.02, 0.09, PARTS, step_cap=1e-5).text
    assert "$ a remark\n" in ls_dyna(0.02, 0.09, PARTS, remarks=["a\nremark"]).text


@pytest.mark.parametrize(
    ("tr", "td", "parts"),
    [
        *((0.09, 0.02, PARTS), (0.02, 0.02, PARTS), (-1.0, 1.0, PARTS), (0.0, float("inf"), PARTS)),
        *((0.02, float("nan"), PARTS), (0.02, 0.09, []), (0.02, 0.09, [0]), (0.02, 0.09, [10**10])),
        (1.00000000001, 1.00000000002, PARTS),
    ],
)
def test_what_is_no_card(tr: float, td: float, parts: list[int]) -> None:
    with pytest.raises(DeckError):
        ls_dyna(tr, td, parts)


def test_three_engine_files() -> None:
    text = radioss(0.0128853793630525, 0.064, 0.15, range(1, 13), name="run").text
    legs = re.split(r"# ---- run_000\d.rad\n", text)[1:]
    assert [leg.split("\n")[:3] for leg in legs] == [
        ["/RUN/run/1", "  0.0128853793630525", "/RBODY/OFF"],
        ["/RUN/run/2", "               0.064", "/RBODY/ON"],
        ["/RUN/run/3", "                0.15", "/RBODY/OFF"],
    ]
    assert [leg.split("\n")[3:5] for leg in legs] == [["1 2 3 4 5 6 7 8 9 10", "11 12"]] * 3
    assert ["/DTIX\n5.1e-05 5.1e-05" in leg for leg in legs] == [False, True, False]
    assert "/DTIX\n1e-06 1e-06" in radioss(0.01, 0.02, 0.03, [1], step_cap=1e-6).text


def test_the_end_comes_last() -> None:
    with pytest.raises(DeckError, match="the run ends"):
        radioss(0.02, 0.09, 0.05, [1])


def test_two_cards_need_two_pairs_of_sets(tmp_path: Path) -> None:
    one, two = ls_dyna(0.02, 0.09, PARTS, merge=11).text, ls_dyna(0.2, 0.3, PARTS, merge=11).text
    assert found(tmp_path, one + two) == {"D2R004": 2}
    assert not found(tmp_path, one + ls_dyna(0.2, 0.3, PARTS, merge=11, sets=(903, 904)).text)
