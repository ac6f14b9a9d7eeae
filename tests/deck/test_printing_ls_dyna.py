"""Printed LS-DYNA cards: columns, rounding, several windows, and that the deck check finds nothing in them."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.deck.printed_card import Printing
from d2rpick.deck.printing import cards
from d2rpick.errors import DeckError
from d2rpick.rules import check_deck
from tests.decks import found, read, spans, write

if TYPE_CHECKING:
    from pathlib import Path

TIMES = st.floats(1e-9, 1e9)
PARTS = Printing(part=(11, 12))
MERGED = replace(PARTS, merge=11)
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


def rows(text: str) -> list[str]:
    """Data lines of a card."""
    return [line for line in text.splitlines() if line[0] not in "$*"]


def test_the_card_to_the_letter() -> None:
    text = cards([(0.02, 0.09)], MERGED).text
    assert text[text.index("*") :] == CARD


@given(
    TIMES,
    st.lists(st.floats(1.001, 100), min_size=1, max_size=7),
    st.lists(st.integers(1, 10**9 - 1), min_size=1, max_size=30, unique=True),
)
def test_the_check_finds_in_a_card_what_was_asked_for(
    tmp_path_factory: pytest.TempPathFactory, start: float, factors: list[float], parts: list[int]
) -> None:
    times = [start]
    for factor in factors:
        times.append(times[-1] * factor)
    windows = list(zip(times[::2], times[1::2], strict=False))
    card = cards(windows, Printing(part=tuple(parts), merge=parts[-1]))
    folder = tmp_path_factory.mktemp("card")
    assert check_deck(write(folder, card.text)).findings == ()
    assert spans(read(folder, card.text)) == [(part, tr, td) for part in sorted(parts) for tr, td in card.windows]
    assert all(len(line) <= 100 for line in card.text.split("\n"))
    assert all(a == " " or b == " " for row in rows(card.text) for a, b in zip(row[9::10], row[10::10], strict=False))


def test_rounding_is_reported() -> None:
    card = cards([(0.0128853793630525, 0.064)], PARTS)
    assert card.windows == ((0.01288538, 0.064),)
    assert ".01288538" in card.notes[0]
    assert card.notes[0] in card.text
    assert cards([(0.02, 0.09)], PARTS).notes == ()


def test_warnings_are_those_that_apply() -> None:
    def text(printing: Printing) -> str:
        return cards([(0.02, 0.09)], printing).text

    assert "d2rpick card --merge" in text(PARTS)
    assert "merged" not in text(MERGED)
    assert "merged" not in text(Printing(part=(11,)))
    assert "already" in text(replace(PARTS, merge=5))
    assert "DTMAX is 0" in text(PARTS)
    assert "d2rpick card --step-cap" in text(PARTS)
    assert "DTMAX is 0" not in text(replace(PARTS, step_cap=1e-5))


@pytest.mark.parametrize(
    ("times", "printing"),
    [
        ((0.02, 0.09), Printing()),
        ((0.02, 0.09), Printing(part=(0,))),
        ((0.02, 0.09), Printing(part=(10**10,))),
        ((0.02, 0.09), replace(PARTS, merge=10**9)),
        ((0.02, 0.09), replace(PARTS, swset=(5, 5))),
        ((1.0000000001, 1.0000000002), PARTS),
    ],
)
def test_what_is_not_a_card(times: tuple[float, float], printing: Printing) -> None:
    with pytest.raises(DeckError):
        cards([times], printing)


def test_windows_that_only_printing_makes_touch_are_refused() -> None:
    with pytest.raises(DeckError, match="different times"):
        cards([(1.0, 2.00000000001), (2.00000000002, 3.0)], PARTS)


def test_every_window_has_sets_of_its_own(tmp_path: Path) -> None:
    text = cards([(0.02, 0.09), (0.2, 0.3), (0.4, 0.5)], replace(MERGED, swset=(8, 7))).text
    assert re.findall(r"^ +(\d+) +0 +\S+ +0.0 +0.0 +0 +0 +0$", text, flags=re.MULTILINE) == [
        *("8", "7", "9", "10", "11", "12")
    ]
    assert not found(tmp_path, text)
