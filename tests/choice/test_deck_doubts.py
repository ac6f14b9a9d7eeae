"""Decks and engines that make the answers of a run worth little: the same words in every command."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest

from d2rpick.choice.deck_of_run import doubts_of_solver
from d2rpick.deck import read_inventory
from d2rpick.rules import RULES, check_deck
from tests.command import ENERGY, OSCILLATOR, answer, run
from tests.decks import write
from tests.histories.test_listings import listing

if TYPE_CHECKING:
    from pathlib import Path

    from d2rpick.choice.warnings import Caution
    from d2rpick.rules import Example

TD = ("--td", "0.0687534")


def placed(folder: Path, example: Example) -> str:
    return write(folder, example.deck, example.files, example.name)


def warned(*args: str) -> dict[str, str]:
    return {one["code"]: one["message"] for one in answer(*args)["warnings"]}


def doubts(deck: str, *parts: int) -> dict[str, Caution]:
    return {one.code: one for one in doubts_of_solver(parts, read_inventory(deck))}


@pytest.mark.parametrize(("rule", "code"), [("D2R406", "body-through-wall"), ("D2R407", "body-without-velocity")])
def test_what_ruins_a_run_is_told_in_the_words_of_the_check(tmp_path: Path, rule: str, code: str) -> None:
    deck = placed(tmp_path, RULES[rule].failing[0])
    (finding,) = [one for one in check_deck(deck).findings if one.rule == rule]
    said = f"{finding.file}:{finding.line}: {finding.message}"
    assert doubts(deck)[code].message == said
    for args in (("suggest", *TD), ("verify", "--tr", "0.0135867", *TD), ("plan",), ("parts",)):
        if args[0] != "parts":  # which asks for parts with energies
            assert warned(*args, "--deck", deck, ENERGY)[code] == said
    assert doubts(placed(tmp_path, RULES[rule].passing[0])) == {}


def test_solids_whose_stresses_do_not_turn_are_told_of_the_parts_in_question(tmp_path: Path) -> None:
    brick = "/BRICK/1\n" + "".join(f"{n:10d}" for n in (9, 1, 2, 3, 4, 5, 6, 7, 8)) + "\n"
    good = RULES["D2R401"].passing[0]
    deck = write(tmp_path, good.deck.replace("/END", f"/PROP/SOLID/1\nsolid\n\n{brick}/END"), good.files, good.name)
    assert "part 1: the stresses of these solids do not turn" in doubts(deck, 1)["stresses-unturned"].message
    assert doubts(deck, 7) == {}
    assert [one.rule for one in check_deck(deck).findings] == ["D2R116"]


def test_a_card_keeps_off_what_the_run_of_the_deck_keeps_off(tmp_path: Path) -> None:
    good = RULES["D2R401"].passing[0]
    deck = write(tmp_path, good.deck, {"box_0001.rad": "/RUN/box/1\n0.15\n/RBODY/OFF\n1808 1809\n1810\n"}, good.name)
    asked = ("-q", "--deck", deck, "--solver", "radioss", "--node", "1808", "-f", "card", ENERGY)
    for args in (("suggest", *TD), ("plan",)):
        printed = run(*args, *asked)
        assert printed.exit_code == 0, printed.stderr
        assert printed.stdout.count("/RBODY/OFF\n1808 1809 1810\n") == 2
        assert printed.stdout.count("/RBODY/ON\n1808\n/RBODY/OFF\n1809 1810\n") == 1


def test_a_deck_is_written_and_what_ruins_it_is_an_objection(tmp_path: Path) -> None:
    for rule, expected in (("D2R406", 1), ("D2R408", 0)):  # the latter's deck has a wheel whose main node is 1809
        example = RULES[rule].failing[0]
        files = {"box_0001.rad": "/RUN/box/1\n0.15\n/RBODY/OFF\n1808 1809\n"}
        deck = write(tmp_path, example.deck, files, example.name)
        written = tmp_path / rule
        result = run("plan", "-q", "--node", "1808", "--deck", deck, "--write-deck", str(written), ENERGY)
        assert (result.exit_code, "error D2R406" in result.stdout) == (expected, bool(expected)), result.stderr
        legs = sorted(path.read_text() for path in written.glob("box_000[1-9].rad"))
        assert [leg.count("1809") for leg in legs] == [1] * len(legs)


# An engine that reports wrong energies.


def test_an_engine_with_wrong_energies_is_told_with_every_answer(tmp_path: Path) -> None:
    history = str(tmp_path / "CART02.csv")
    shutil.copy(ENERGY, history)
    (tmp_path / "CAR_0002.out").write_text(listing("1986-2025 Altair Engineering, Inc."))
    pair = ("--tr", "0.0135867", *TD)
    deck = placed(tmp_path, RULES["D2R401"].passing[0])
    asked = (
        *(("info", history), ("suggest", *TD, history), ("suggest", history), ("verify", *pair, history)),
        *(("plan", history), ("verify", *pair, ENERGY, "--switched", history), ("check", deck, "--history", history)),
    )
    for args in asked:
        assert "CAR_0002.out: built in 2025" in warned(*args)["engine-wrong-energy"], args
    codes = [one["code"] for one in answer("plan", history)["warnings"]]
    assert codes.count("engine-wrong-energy") == 1  # however many flights there are
    assert "engine-wrong-energy" not in warned("suggest", *TD, ENERGY)


# Bodies that no leg switches.


@pytest.mark.parametrize(
    ("part", "found"),
    [(3, ["D2R408 error"]), (2, []), (13, ["D2R408 warning"])],
    ids=["it deforms in the history", "it has no energy there", "it is not there"],
)
def test_a_body_that_no_leg_switches_is_judged_by_the_energy_of_its_parts(
    tmp_path: Path, part: int, found: list[str]
) -> None:
    example = RULES["D2R408"].failing[0]
    text = example.deck.replace("/PART/2", f"/PART/{part}").replace("/SHELL/2", f"/SHELL/{part}")
    deck = write(tmp_path, text, example.files, example.name)
    history = str(tmp_path / "matsum")
    assert run("replay", *OSCILLATOR, "--t-end", "0.3", "--dt", "1e-4", "-o", history).exit_code == 0
    listed = answer("check", deck, "--history", history, "--select", "D2R408")["findings"]
    assert [f"{one['rule']} {one['severity']}" for one in listed] == found
