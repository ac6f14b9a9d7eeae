"""Every rule: its examples, its selection and silencing, and the independence of several decks."""

import json
import re
import shlex
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from d2rpick.base.errors import ConfigurationError, DeckError
from d2rpick.rules import (
    RULES,
    Configuration,
    check_deck,
    find_configuration,
    read_configuration,
)
from d2rpick.rules.base import Severity
from d2rpick.rules.example import END, HEAD, PARTS, Example, write_automatic_card
from d2rpick.rules.rule import GOOD, THERE, Rule
from tests.command import run, run_json
from tests.decks import count_findings, write

PASSING = [(rule, example) for rule in RULES.values() for example in rule.passing]
FAILING = [(rule, example) for rule in RULES.values() for example in rule.failing]

SWAPPED = (
    HEAD
    + PARTS
    + write_automatic_card(1, "0.09", rigid=["1"])
    + write_automatic_card(2, "0.02", deformable=["1"])
    + END
)
OWN = 'select = ["D2R1"]\nignore = ["D2R104"]\n[severity]\nD2R101 = "warning"\n'


def name_examples(examples: list[tuple[Rule, Example]]) -> list[str]:
    return [rule.id for rule, _ in examples]


@cache
def write_history(command: str, arguments: str) -> bytes:
    """The energy history that ``d2rpick replay`` writes, or another command."""
    return run(command, *shlex.split(arguments)).stdout_bytes


def find_findings(folder: Path, rule: Rule, example: Example) -> list[dict[str, Any]]:
    """Return the findings of the rule in an example, checked as `d2rpick rule` says."""
    options = shlex.split(example.options)
    if example.history:
        (folder / "energy.csv").write_bytes(
            write_history(example.computed_by, example.history)
        )
        options += ["--history", str(folder / "energy.csv")]
    path = write(folder, example.deck, example.files, example.name)
    if example.stdin:
        report = json.loads(
            run("check", "-", "-f", "json", stdin=example.deck.encode()).stdout
        )["findings"]
    else:
        report = run_json("check", path, *options)["findings"]
    return [finding for finding in report if finding["rule"] == rule.id]


@pytest.mark.parametrize(("rule", "example"), PASSING, ids=name_examples(PASSING))
def test_passing_examples(tmp_path: Path, rule: Rule, example: Example) -> None:
    assert not find_findings(tmp_path, rule, example)


@pytest.mark.parametrize(("rule", "example"), FAILING, ids=name_examples(FAILING))
def test_failing_examples(tmp_path: Path, rule: Rule, example: Example) -> None:
    mine = find_findings(tmp_path, rule, example)
    assert mine
    for finding in mine:
        assert finding["severity"] == rule.severity
        assert "\n" not in finding["message"]
        assert finding["line"] >= 1
        assert finding["column"] >= 1


def test_every_rule_has_examples_and_an_explanation() -> None:
    for name, rule in RULES.items():
        assert re.fullmatch(r"D2R\d{3}", name)
        assert rule.passing
        assert rule.failing
        assert rule.explanation.endswith(".")
        assert rule.fix[:1].isupper()
        assert rule.fix.endswith(".")


@pytest.mark.parametrize(
    "comment",
    [
        "$ d2rpick: ignore D2R102",
        "$D2RPICK:ignore D2R101, D2R102",
        "$ d2rpick: ignore D2R102\n$ why",
    ],
)
def test_a_comment_before_the_card_silences_a_rule_for_it(
    tmp_path: Path, comment: str
) -> None:
    card = "*DEFORMABLE_TO_RIGID_AUTOMATIC"
    first, second = (match.start() for match in re.finditer(re.escape(card), SWAPPED))
    assert count_findings(tmp_path, SWAPPED) == {"D2R102": 1}
    assert not count_findings(
        tmp_path, f"{SWAPPED[:second]}{comment}\n{SWAPPED[second:]}"
    )
    assert count_findings(
        tmp_path, f"{SWAPPED[:first]}{comment}\n{SWAPPED[first:]}"
    ) == {"D2R102": 1}
    assert count_findings(
        tmp_path, f"{SWAPPED[:second]}{comment}\n*NODE\n{SWAPPED[second:]}"
    ) == {"D2R102": 1}


def test_rules_are_selected_ignored_and_weighed(tmp_path: Path) -> None:
    path = write(tmp_path, HEAD + PARTS + THERE + "*INCLUDE\nnowhere.k\n")

    def rules(configuration: Configuration) -> dict[str, Severity]:
        return {
            finding.rule: finding.severity
            for finding in check_deck(path, configuration).findings
        }

    assert rules(Configuration()) == {"D2R003": "error", "D2R104": "info"}
    assert rules(Configuration(select=("D2R1",))) == {"D2R104": "info"}
    assert rules(Configuration(ignore=("D2R104",))) == {"D2R003": "error"}
    assert rules(Configuration(severity={"D2R104": "error"}))["D2R104"] == "error"


@pytest.mark.parametrize(
    "configuration",
    [Configuration(select=("D2R999",)), Configuration(severity={"D2R1": "error"})],
)
def test_an_unknown_rule_is_an_error(
    tmp_path: Path, configuration: Configuration
) -> None:
    with pytest.raises(ConfigurationError, match="no rule"):
        check_deck(write(tmp_path, GOOD), configuration)


def test_decks_are_judged_apart(tmp_path: Path) -> None:
    cards = {"cards.k": write_automatic_card(1, "0.5", rigid=["1"])}
    decks = []
    for name in "ab":
        (tmp_path / name).mkdir()
        decks.append(
            write(tmp_path / name, HEAD + PARTS + "*INCLUDE\ncards.k\n", cards)
        )
    alone = [check_deck(deck).findings for deck in decks]
    assert all("D2R101" in {finding.rule for finding in findings} for findings in alone)
    assert [
        finding.deck
        for findings in alone
        for finding in findings
        if finding.rule == "D2R101"
    ] == decks
    with pytest.raises(DeckError):
        check_deck(str(tmp_path / "absent.k"))


def test_one_wrong_id_does_not_hide_another(tmp_path: Path) -> None:
    deck = (
        HEAD
        + PARTS
        + write_automatic_card(1, "0.02", rigid=["7", "8", "1"])
        + write_automatic_card(1, "0.3", deformable=["1"])
        + END
    )
    assert count_findings(tmp_path, deck) == {
        "D2R106": 1,
        "D2R101": 1,
        "D2R004": 1,
    }


def test_parts_without_end_are_one_finding_per_card(tmp_path: Path) -> None:
    deck = (
        HEAD
        + write_automatic_card(1, "0.02", rigid=[str(part) for part in range(1, 40)])
        + END
    )
    (finding,) = check_deck(write(tmp_path, deck)).findings
    assert "parts 1-39" in finding.message


@pytest.mark.parametrize(
    ("comment", "silenced"),
    [
        ("ignore D2R1", True),
        ("ignore D2R101 D2R102", True),
        ("ignore D2R101 because D2R102 was annoying", False),
        ("ignored D2R102", False),
    ],
)
def test_only_the_list_behind_ignore_counts(
    tmp_path: Path, comment: str, silenced: bool
) -> None:
    checked = check_deck(write(tmp_path, comment_second_card(f"$ d2rpick: {comment}")))
    assert (not checked.findings) is silenced
    assert checked.remarks == ()


@pytest.mark.parametrize(
    ("comment", "told"),
    [("ignore D2R10l", "did you mean D2R1"), ("ignore", "''"), ("ignore D", "'D'")],
)
def test_a_comment_that_names_no_rule_is_told(
    tmp_path: Path, comment: str, told: str
) -> None:
    checked = check_deck(write(tmp_path, comment_second_card(f"$ d2rpick: {comment}")))
    (remark,) = checked.remarks
    assert told in remark
    assert [finding.rule for finding in checked.findings] == ["D2R102"]


def comment_second_card(comment: str) -> str:
    """Return a deck with one fault and a comment before the faulty card."""
    second = SWAPPED.rindex("*DEFORMABLE_TO_RIGID_AUTOMATIC")
    return f"{SWAPPED[:second]}{comment}\n{SWAPPED[second:]}"


def find_message(folder: Path, rule: str, deck: str) -> str:
    """Return the message of the only finding of a rule."""
    (finding,) = (
        finding
        for finding in check_deck(write(folder, deck)).findings
        if finding.rule == rule
    )
    return finding.message


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize(
    ("codes", "weight"), [((4, 2), {"error"}), ((2, 4), set()), ((3, 1), {"error"})]
)
def test_rigid_in_the_impact_and_deformable_in_flight_is_an_error(
    tmp_path: Path, codes: tuple[int, int], weight: set[str], paired: bool
) -> None:
    pairs = ((2, 1), (1, -1)) if paired else ((0, 0), (0, 0))
    rigid_card = write_automatic_card(
        1, "0.0", rigid=["1"], code=codes[0], pair=pairs[0]
    )
    deck = (
        HEAD
        + PARTS
        + rigid_card
        + write_automatic_card(2, "0.0", deformable=["1"], code=codes[1], pair=pairs[1])
        + END
    )
    findings = check_deck(write(tmp_path, deck)).findings
    assert {
        finding.severity for finding in findings if finding.rule == "D2R005"
    } == weight
    weighed = check_deck(
        write(tmp_path, deck), Configuration(severity={"D2R005": "info"})
    ).findings
    assert {finding.severity for finding in weighed if finding.rule == "D2R005"} <= {
        "info"
    }


def test_an_unknown_part_lists_its_neighbours_with_their_titles(tmp_path: Path) -> None:
    text = find_message(
        tmp_path,
        "D2R106",
        HEAD + PARTS + write_automatic_card(1, "0.02", rigid=["7"]) + END,
    )
    assert text.startswith("part 7 not in the deck (nearest to 7: 1 'door', 2 'frame')")


def test_shared_nodes_of_a_part_set_name_the_set(tmp_path: Path) -> None:
    mesh = "*ELEMENT_SHELL\n" + "".join(
        f"{element:8d}{element:8d}{element:8d}{3:8d}{8:8d}{9:8d}\n"
        for element in (1, 2)
    )
    sets = "*SET_PART\n         3\n         1         2\n"
    line = "         3         0      PSET"
    deck = (
        HEAD + PARTS + mesh + sets + write_automatic_card(1, "0.02", rigid=[line]) + END
    )
    assert (
        "part 1 (of part set 3) and part 2 (of part set 3) share node 8"
        in find_message(tmp_path, "D2R108", deck)
    )


def test_a_switched_part_merges_with_the_always_rigid_part_whose_nodes_it_shares(
    tmp_path: Path,
) -> None:
    """A part with *MAT_RIGID is not on the card, so only LRB joins a switched part to it."""
    mesh = "*ELEMENT_SHELL\n" + "".join(
        f"{part:8d}{part:8d}{node:8d}{3:8d}{8:8d}{9:8d}\n"
        for part, node in ((1, 1), (3, 5))
    )
    anvil = "*PART\nanvil\n         3         1         7\n*MAT_RIGID\n         7\n"

    merged = anvil.replace("         3  ", "         4  ")
    merged += "*CONSTRAINED_RIGID_BODIES\n         4         3\n"

    def find_shared(line: str, more: str = "") -> list[str]:
        card = write_automatic_card(1, "0.02", rigid=[line])
        deck = write(tmp_path, HEAD + PARTS + anvil + more + mesh + card + END)
        findings = check_deck(deck).findings
        return [found.message for found in findings if found.rule == "D2R108"]

    (message,) = find_shared("1")
    assert "part 1 becomes rigid and shares node" in message
    assert "with part 3, which has *MAT_RIGID" in message
    assert "LRB 3 on its line" in message
    assert not find_shared("         1         3      PART")
    assert not find_shared("         1         4      PART", merged)
    assert find_shared("         1         4      PART", merged[: merged.index("*CON")])
    assert not find_shared("2")


def test_missing_lines_of_a_card_are_named(tmp_path: Path) -> None:
    lines = THERE.split("\n")
    without = {
        "the first line (SWSET to PAIRED) and the second (NRBF to OFFSET) are missing;": lines[
            :1
        ],
        "the second line (NRBF to OFFSET) is missing": lines[:3],
        "is missing, '1         0      PART' stands": lines[:3] + lines[5:],
        "are missing, '1         0      PART' stands in their place": [
            lines[0],
            lines[5],
            lines[5],
        ],
        "the third line, with the first part, is missing": lines[:5],
    }
    for problem, remaining_lines in without.items():
        deck = HEAD + PARTS + "\n".join(remaining_lines) + "\n" + END
        assert problem in find_message(tmp_path, "D2R001", deck)
        assert not count_findings(tmp_path, deck)["D2R002"]


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        (
            "         1\n",
            "the second line (XC to TM) and the third line (IXX to IZZ) are missing;",
        ),
        ("         1\n       0.0\n", "the third line (IXX to IZZ) is missing;"),
    ],
)
def test_missing_lines_of_an_inertia_are_named(
    rows: str, told: str, tmp_path: Path
) -> None:
    assert told in find_message(
        tmp_path, "D2R001", HEAD + PARTS + "*DEFORMABLE_TO_RIGID_INERTIA\n" + rows + END
    )


def test_contacts_are_listed_where_none_has_the_number(tmp_path: Path) -> None:
    deck = next(iter(RULES["D2R007"].failing)).deck
    assert (
        "the deck has 7 (*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE_ID 'floor')"
        in find_message(tmp_path, "D2R007", deck)
    )


def test_a_file_with_nothing_but_its_end_says_what_is_missing(tmp_path: Path) -> None:
    with pytest.raises(
        DeckError, match=r"only \*END was found.*\*KEYWORD and the cards were expected"
    ):
        check_deck(write(tmp_path, "$ title\n*END\n"))


@pytest.mark.slow
def test_a_deck_cut_within_a_line_or_its_mesh_is_never_passed_in_silence(
    tmp_path: Path,
) -> None:
    """The exceptions are a cut in a comment and a cut at the end of a line that is not in a mesh."""
    whole = (
        GOOD.removesuffix(END)
        + "*NODE\n       1             0.0\n*ELEMENT_SHELL\n       1       1       1\n"
    )
    mesh = whole.index("*NODE")
    deck = tmp_path / "main.k"
    for end in range(whole.rindex("*DEFORM") + 2, len(whole) + 1):
        text = whole[:end]
        deck.write_text(text)
        messages = [
            finding.message
            for finding in check_deck(str(deck)).findings
            if finding.rule == "D2R011"
        ]
        ends_within_line = not (
            text.endswith("\n") or text.splitlines()[-1].startswith("$")
        )
        assert len(messages) == (ends_within_line or end > mesh + len("*NODE"))
        assert all(
            message.endswith(
                "or end its last line" if ends_within_line else "or add *END"
            )
            for message in messages
        )
    deck.write_text(f"{whole}*END")
    assert not check_deck(str(deck)).findings


# Configuration files.


def read_configuration_in(folder: Path) -> Configuration:
    return find_configuration(str(folder / "deck.k"), Configuration())


def test_the_nearest_file_wins(tmp_path: Path) -> None:
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    (tmp_path / "d2rpick.toml").write_text(OWN)
    (tmp_path / "a" / "pyproject.toml").write_text("[project]\nname = 'other'\n")
    configuration = read_configuration_in(inner)
    assert configuration.select == ("D2R1",)
    assert configuration.ignore == ("D2R104",)
    assert configuration.severity == {"D2R101": "warning"}
    assert configuration.source == str(tmp_path / "d2rpick.toml")
    (tmp_path / "a" / "pyproject.toml").write_text(
        "[tool.d2rpick]\nselect = ['D2R0']\n"
    )
    assert read_configuration_in(inner).select == ("D2R0",)
    (tmp_path / "a" / "d2rpick.toml").write_text("")
    assert read_configuration_in(inner).select == ()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("selct = []", "did you mean 'select'"),
        ("select = 'D2R1'", "a list"),
        ("select = [1]", "a list"),
        ("severity = 3", "a table"),
        ("[tool]\nd2rpick = 1", "a table was expected"),
        ("[severity]\nD2R101 = 'fatal'", "one of error"),
        ("[severity]\nD2R101 = ['error']", "one of error"),
        ("select = ", "valid TOML"),
        ("a = '\xff'", "valid TOML"),
        (f"select = {'9' * 5000}", "valid TOML"),  # Python refuses to read it,
        (f"[severity]\nD2R101 = 0x{'f' * 5000}", "valid TOML"),  # and to write this one
        (f"select = {'[' * 9999}", "valid TOML"),
    ],
)
def test_wrong_settings_say_what_is_wrong(
    tmp_path: Path, text: str, message: str
) -> None:
    name = "pyproject.toml" if "[tool]" in text else "d2rpick.toml"
    (tmp_path / name).write_bytes(text.encode("latin-1"))
    with pytest.raises(ConfigurationError, match=message) as caught:
        read_configuration_in(tmp_path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text", ["tool = 3", "[tool]\nother = 1", "[tool.other]\nx = 1"]
)
def test_a_pyproject_without_a_table_for_us(tmp_path: Path, text: str) -> None:
    (tmp_path / "pyproject.toml").write_text(text)
    assert read_configuration_in(tmp_path).source != str(tmp_path / "pyproject.toml")
    assert read_configuration({}) == Configuration()


def test_a_near_miss_is_named() -> None:
    with pytest.raises(ConfigurationError, match="did you mean D2R101"):
        Configuration(ignore=("D2R10l",)).verify(["D2R101"])


def test_the_cure_of_an_active_nodal_body_is_no_mistake_itself(tmp_path: Path) -> None:
    """A body that also contains a deformable part must not be deleted (D2R120), so D2R112 does not advise this."""
    deleted = RULES["D2R120"].failing[-1].deck
    active = re.sub(
        r"(\$ +nrbf.*\n) {9}[12]", lambda card: card[1] + f"{0:10d}", deleted
    )
    messages = {
        rule: [
            finding.message
            for finding in check_deck(write(tmp_path, deck)).findings
            if finding.rule == rule
        ]
        for rule, deck in (("D2R112", active), ("D2R120", deleted))
    }
    (advice,) = messages["D2R112"]
    assert "it also holds part 2, so do not delete it" in advice
    assert "set the flag" not in advice
    assert len(messages["D2R120"]) == 1
