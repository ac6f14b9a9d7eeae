"""The deck of another model: no answer of any command holds a number of it."""

from __future__ import annotations

import json
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

import d2rpick as d2
from tests.command import ROOT, answer, codes, run
from tests.sample_deck import DECK

if TYPE_CHECKING:
    from pathlib import Path

BOX = str(ROOT / "sample_data" / "rollover_box.matsum")
ASKED = {
    "suggest": ("--td", "0.37", "--part", "all"),
    "verify": ("--tr", "0.1", "--td", "0.37", "--part", "all"),
    "explore": ("--steps", "5", "--part", "all"),
    "plan": ("--part", "all"),
    "parts": ("--part", "all"),
}
# Parts with the numbers of the box under other titles; and with its titles under other numbers.
OTHER = {
    "titles": DECK.read_text("utf-8").replace("\nbox\n", "\nfloor\n").replace("\nstep\n", "\nrail\n"),
    "numbers": f"*KEYWORD\n*INCLUDE_TRANSFORM\n{DECK}\n{0:10d}{0:10d}{10:10d}\n*END\n",
}


@pytest.fixture(params=OTHER)
def foreign(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    (tmp_path / "main.k").write_text(OTHER[request.param], "utf-8")
    return str(tmp_path / "main.k")


@cache
def plain(command: str, form: str) -> str:
    """What a command says without a deck."""
    return run(command, *ASKED[command], BOX, "-f", form).stdout


def told(found: dict[str, Any]) -> dict[str, Any]:
    return {**found, "command": None, "warnings": None}


@pytest.mark.parametrize("command", ASKED)
def test_the_answer_is_that_without_a_deck(command: str, foreign: str) -> None:
    args = command, *ASKED[command], "--deck", foreign, BOX
    found, without = answer(*args), json.loads(plain(command, "json"))
    assert told(found) == told(without)
    assert codes(found) == codes(without) | {"deck-of-another-model"}
    for form in ("csv", "markdown"):
        assert run(*args, "-f", form).stdout == plain(command, form)


def test_pages_and_cards_are_those_without_a_deck(foreign: str, tmp_path: Path) -> None:
    asked = ("suggest", "--td", "0.37", "--part", "all", BOX)
    assert run(*asked, "--deck", foreign, "-f", "card").stdout == run(*asked, "-f", "card").stdout
    page = tmp_path / "page.html"
    run(*asked, "--deck", foreign, "--report", str(page))
    assert "nothing of the deck is used" in page.read_text("utf-8")
    assert "of the reference's run time" not in page.read_text("utf-8")


def test_what_needs_the_deck_is_refused(foreign: str, tmp_path: Path) -> None:
    for asked in (
        ("suggest", "--td", "0.37", "--part", "recommended", "--deck", foreign, BOX),
        ("plan", "--part", "all", "--deck", foreign, "--write-deck", str(tmp_path / "next"), BOX),
    ):
        result = run(*asked)
        assert (result.exit_code, result.stdout) == (2, "")
        assert "nothing of the deck is used" in result.stderr
    assert not (tmp_path / "next").exists()


def test_the_library_leaves_it_out_too(foreign: str) -> None:
    found, without = (d2.suggest(d2.read(BOX), td=0.37, parts="all", **deck) for deck in ({"deck": foreign}, {}))  # type: ignore[arg-type]
    assert told(found.to_dict()) == told(without.to_dict())


def test_one_part_with_another_title_is_a_warning_only() -> None:
    found = answer("suggest", "--td", "0.37", "--part", "box", "--deck", str(DECK), BOX)
    assert "deck-of-another-model" not in codes(found)
    assert found["candidates"][0]["run_time_share"] < 1


@pytest.mark.parametrize(("group", "foreign"), [("/THPART/GRSHEL/2\nstep\n         7\n", False), ("", True)])
def test_a_group_of_elements_that_the_history_lists_is_no_missing_part(
    group: str, foreign: bool, tmp_path: Path
) -> None:
    (tmp_path / "TEST_0000.rad").write_text(
        f"#RADIOSS STARTER\n/BEGIN\nTEST\n/PART/1\nbox\n         1         1\n{group}/END\n"
    )
    asked = ("suggest", "--td", "0.37", "--part", "box", "--deck", str(tmp_path / "TEST_0000.rad"))
    assert ("deck-of-another-model" in codes(answer(*asked, BOX.replace(".matsum", "T01")))) == foreign


def test_titles_are_compared_without_letters_that_files_encode_in_different_ways(tmp_path: Path) -> None:
    text = DECK.read_text("utf-8").replace("\nbox\n", "\nbox \u7bb1\n")
    (tmp_path / "main.k").write_bytes(text.encode("gbk"))
    assert "deck-of-another-model" not in codes(
        answer("suggest", "--td", "0.37", "--part", "box", "--deck", str(tmp_path / "main.k"), BOX)
    )
