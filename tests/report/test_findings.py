"""Reports of findings, each validated by its published schema."""

import json
import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given, strategies as st

from d2rpick.api.checking import Findings
from d2rpick.report import formats, rule_texts
from d2rpick.rules import RULES, Checked, check_deck
from d2rpick.rules.base import Finding, Severity
from d2rpick.rules.example import END, HEAD, PARTS, write_automatic_card
from d2rpick.rules.rule import GOOD
from tests.command import ROOT
from tests.deck.test_radioss_run import write_run
from tests.decks import write
from tests.json_schemas import check_by_schema, check_junit, check_sarif
from tests.test_docs import list_anchors

BAD = (
    HEAD
    + PARTS
    + write_automatic_card(1, "0.02", rigid=["1", "2"])
    + write_automatic_card(2, "0.5", deformable=["1"])
    + END
)


@pytest.fixture
def results(tmp_path: Path) -> list[Checked]:
    (tmp_path / "good").mkdir()
    return [
        check_deck(write(tmp_path, BAD)),
        check_deck(write(tmp_path / "good", GOOD)),
    ]


def write_findings(
    form: str, results: list[Checked], root: Path, fail_on: Severity = Severity.ERROR
) -> str:
    return formats.write(
        "findings",
        form,
        Findings(results=results, root=str(root), fail_on=fail_on),
        formats.DisplayOptions(),
    )


def test_table(results: list[Checked], tmp_path: Path) -> None:
    lines = write_findings("table", results, tmp_path).split("\n")
    assert lines[0] == "errors  in 1 of 2 decks"
    assert lines[1].startswith("why     ")
    assert lines[1].endswith(" (D2R101)")
    assert lines[lines.index("") + 1] == "main.k"
    assert "  part 1: rigid from 0.02 to 0.5 (main.k:14)" in lines
    assert "  part 2: rigid from 0.02 to the end (main.k:14)" in lines
    found = [line for line in lines if line.startswith("  main.k:")]
    assert found[0].startswith("  main.k:23:28: error D2R101 TIME1 is 0.5")
    assert ": info D2R104 " in found[1]
    assert (
        lines[-1]
        == "1 error, 0 warnings, 1 info message in 2 decks; times not judged: no `history`"
    )


def test_a_card_without_a_window_is_not_passed_over(tmp_path: Path) -> None:
    deck = write_run(tmp_path, legs=(("0.2", "/RBODY/ON\n0\n"),))  # without a main node
    lines = write_findings("table", [check_deck(deck)], tmp_path).split("\n")
    assert lines[:3] == [
        "passed  no errors or warnings",
        "box_0000.rad",
        "  no part becomes rigid, although the deck has switching cards",
    ]


def test_json(results: list[Checked], tmp_path: Path) -> None:
    content = json.loads(write_findings("json", results, tmp_path))
    check_by_schema(content)
    assert content["decks"] == ["main.k", "good/main.k"]
    assert [window["td"] for window in content["windows"]] == [0.5, None, 0.09]
    assert {finding["rule"] for finding in content["findings"]} == {"D2R101", "D2R104"}
    assert content["summary"] == {"errors": 1, "warnings": 0, "infos": 1, "decks": 2}


def test_github(results: list[Checked], tmp_path: Path) -> None:
    lines = write_findings("github", results, tmp_path).split("\n")
    assert lines[1].startswith(
        "::error file=main.k,line=23,col=28,title=D2R101::TIME1 is 0.5"
    )
    assert lines[0].startswith("::notice file=main.k")


def test_junit(results: list[Checked], tmp_path: Path) -> None:
    text = write_findings("junit", results, tmp_path)
    check_junit(text)
    suites = ET.fromstring(text)
    assert [
        (suite.get("name"), suite.get("tests"), suite.get("failures"))
        for suite in suites
    ] == [
        ("main.k", "2", "1"),
        ("good/main.k", "1", "0"),
    ]
    assert [failure.get("type") for failure in suites.iter("failure")] == ["D2R101"]
    strict = ET.fromstring(
        write_findings("junit", results, tmp_path, fail_on=Severity.INFO)
    )
    assert len(list(strict.iter("failure"))) == 2


def test_sarif(results: list[Checked], tmp_path: Path) -> None:
    text = write_findings("sarif", results, tmp_path)
    check_sarif(text)
    (run,) = json.loads(text)["runs"]
    assert [rule["id"] for rule in run["tool"]["driver"]["rules"]] == list(RULES)
    for result in run["results"]:
        assert (
            run["tool"]["driver"]["rules"][result["ruleIndex"]]["id"]
            == result["ruleId"]
        )
    location = run["results"][1]["locations"][0]["physicalLocation"]
    assert location == {
        "artifactLocation": {"uri": "main.k"},
        "region": {"startLine": 23, "startColumn": 28},
    }


def test_sarif_names_the_page_of_each_rule(tmp_path: Path) -> None:
    (run,) = json.loads(write_findings("sarif", [], tmp_path))["runs"]
    rules = run["tool"]["driver"]["rules"]
    for rule in rules:
        for text in (rule["help"]["text"], rule["help"]["markdown"]):
            page, anchor = re.findall(r"(docs/[a-z/]+\.md)#(d2r\d{3})", text)[0]
            assert anchor == rule["id"].lower()
            assert anchor in list_anchors(ROOT / page)
            assert RULES[rule["id"]].fix in text


def test_paths_outside_are_absolute(results: list[Checked], tmp_path: Path) -> None:
    elsewhere = tmp_path / "else where"
    assert f"::error file={tmp_path}/main.k" in write_findings(
        "github", results, elsewhere
    )
    assert f"file://{tmp_path}/main.k" in write_findings("sarif", results, elsewhere)


@pytest.mark.slow
@given(st.text(), st.text(st.characters(exclude_characters="\0"), min_size=1))
def test_any_text_makes_a_valid_report(message: str, name: str) -> None:
    name = name.encode("utf-8", "replace").decode()
    finding = Finding("D2R001", Severity.ERROR, message, name, name, 1, 1)
    result = [Checked(name, (), (finding,))]
    root = Path("/some folder")
    ET.fromstring(write_findings("junit", result, root).encode("utf-8", "replace"))
    check_sarif(write_findings("sarif", result, root))
    assert write_findings("github", result, root).count("\n") == 0
    json.loads(write_findings("json", result, root))


def test_nothing_found_is_a_report_too(tmp_path: Path) -> None:
    check_sarif(write_findings("sarif", [], tmp_path))
    check_junit(write_findings("junit", [], tmp_path))
    assert write_findings("github", [], tmp_path) == ""


def test_only_a_deck_of_another_name_is_named() -> None:
    deck_names = [
        name
        for rule in RULES.values()
        for name in re.findall(
            r"^\w+, as (\S+):$",
            rule_texts.explain_rule(rule, 100, with_examples=True),
            re.MULTILINE,
        )
    ]
    assert deck_names
    assert "main.k" not in deck_names


def test_many_decks_begin_with_the_decision_and_end_with_those_without_findings(
    tmp_path: Path,
) -> None:
    decks = [tmp_path / f"{letter}.k" for letter in "abc"]
    for deck in decks[:2]:
        deck.write_text("*KEYWORD\n*END\n")
    decks[2].write_text("*KEYWORD\n*INCLUDE\nmissing.k\n*END\n")
    results = [check_deck(str(deck)) for deck in decks]
    lines = write_findings("table", results, tmp_path).split("\n")
    assert lines[0] == "errors  in 1 of 3 decks"
    assert lines[2].startswith("next    correct the findings above")
    assert lines[4] == "c.k"
    assert lines[-3] == "no findings in 2 decks without rigid windows: a.k, b.k"
    passed = write_findings("table", results[:2], tmp_path).split("\n")
    assert passed[0] == "passed  no errors or warnings in 2 decks"
