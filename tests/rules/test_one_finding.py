"""One mistake is one finding, in words that do not contradict each other."""

from pathlib import Path

import pytest

from d2rpick.base.errors import ConfigurationError
from d2rpick.rules import RULES, Configuration, check_deck, find_rules
from d2rpick.rules.example import HEAD, PARTS, write_automatic_card
from tests.command import run, run_json
from tests.decks import write

OSCILLATOR = (
    "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.15 --dt 1e-4"
)


def write_timed_deck(folder: Path, tr: str, td: str, end: str = "       0.2") -> str:
    cards = write_automatic_card(1, tr, rigid=["1"]) + write_automatic_card(
        2, td, deformable=["1"]
    )
    return write(folder, HEAD.replace("       0.2", end) + PARTS + cards + "*END\n")


@pytest.mark.parametrize(
    ("times", "rule"),
    [
        (("13.5867", "68.7534"), "D2R115"),
        (("13.5867", "68.7534", "     150.0"), "D2R207"),
        (("13586.7", "68753.4", "  150000.0"), "D2R206"),
    ],
    ids=["ms in a deck in s", "a deck in ms", "a deck in mus"],
)
def test_a_mistake_of_units_is_one_finding(
    tmp_path: Path, times: tuple[str, ...], rule: str
) -> None:
    history = str(tmp_path / "energy.csv")
    assert run("replay", *OSCILLATOR.split(), "-o", history).exit_code == 0
    findings = run_json(
        "check",
        write_timed_deck(tmp_path, *times),
        "--history",
        history,
        "--ignore",
        "D2R111",
    )["findings"]
    assert [finding["rule"] for finding in findings] == [rule]


def test_a_time_after_the_run_is_one_finding(tmp_path: Path) -> None:
    """It is outside the history as well; if its rule is ignored, the finding about the history appears."""
    history = str(tmp_path / "energy.csv")
    assert run("replay", *OSCILLATOR.split(), "-o", history).exit_code == 0
    options = (write_timed_deck(tmp_path, "0.0135867", "68.7534"), "--history", history)
    for ignored, rule in (("D2R111", "D2R101"), ("D2R111,D2R101", "D2R205")):
        findings = run_json("check", *options, "--ignore", ignored)["findings"]
        assert [finding["rule"] for finding in findings] == [rule]


def test_what_follows_is_reported_where_its_cause_is_ignored(tmp_path: Path) -> None:
    path = write_timed_deck(tmp_path, "13.5867", "68.7534")
    assert [
        finding.rule
        for finding in check_deck(path).findings
        if finding.rule != "D2R111"
    ] == ["D2R115"]
    ignored = check_deck(path, Configuration(ignore=("D2R115",))).findings
    assert {finding.rule for finding in ignored} >= {"D2R101"}


def test_a_deck_without_contacts_has_none_to_name(tmp_path: Path) -> None:
    example = RULES["D2R007"].failing[1].deck
    (message,) = [
        finding.message
        for finding in check_deck(write(tmp_path, example)).findings
        if finding.rule == "D2R007"
    ]
    assert (
        message
        == "ENTNO is 7, but the deck has no contact, so the set never switches; add one"
    )


def test_only_what_is_nearly_a_rule_is_suggested() -> None:
    with pytest.raises(ConfigurationError, match="did you mean D2R101"):
        find_rules("D2R1O1")
    for name in ("D2R999", "D2R0000000", "rule"):
        with pytest.raises(ConfigurationError) as refused:
            find_rules(name)
        assert "did you mean" not in str(refused.value)


def test_a_wrong_part_id_is_one_finding_for_both_switches(tmp_path: Path) -> None:
    cards = write_automatic_card(1, "0.01", rigid=["77"]) + write_automatic_card(
        2, "0.06", deformable=["77"]
    )
    lone = write_automatic_card(3, "0.07", deformable=["1"])
    deck = write(tmp_path, HEAD + PARTS + cards + lone + "*END\n")
    findings = run_json("check", "--ignore", "D2R111", deck)["findings"]
    assert {finding["rule"] for finding in findings} == {"D2R106", "D2R103"}
    (back,) = (finding for finding in findings if finding["rule"] == "D2R103")
    assert back["message"].startswith("part 1 ")
