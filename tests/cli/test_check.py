"""The command ``check`` in a CI job: exit codes, formats, configuration, several decks, histories."""

import json
import os
import re
import tomllib
from collections.abc import Callable
from csv import DictReader
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.rules import RULES
from d2rpick.rules.example import END, HEAD, PARTS, write_automatic_card
from d2rpick.rules.rule import GOOD, THERE
from tests.command import (
    BOX,
    DECK,
    ENERGY,
    GLSTAT,
    MATSUM,
    ROOT,
    read_refusal,
    run,
    run_json,
)
from tests.json_schemas import (
    check_by_schema,
    check_junit,
    check_sarif,
    run_json_checked,
)

FORMATS = ("table", "json", "github", "junit", "sarif")
LATE = HEAD + PARTS + THERE + write_automatic_card(2, "0.5", deformable=["1"]) + END
COARSE = GOOD.replace("    0.0001", "      0.01")


pytestmark = pytest.mark.usefixtures("here")

RUN_EXAMPLE = RULES["D2R401"].passing[0]
TIMES = np.linspace(0.001, 0.149, 12).tolist()


def place(name: str, deck: str) -> str:
    """Write a deck below the working folder."""
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(deck)
    return name


def write_deck(tr: float, td: float, part: int = 1) -> str:
    """Return a deck with one window; the times are printed with all digits."""
    rigid_card = (
        "*KEYWORD LONG=Y\n*DEFORMABLE_TO_RIGID_AUTOMATIC\n"
        f"{2 * part - 1:20d}{0:20d}{tr!r:>20}\n"
    )
    back = "*DEFORMABLE_TO_RIGID_AUTOMATIC\n" + f"{2 * part:20d}{0:20d}{td!r:>20}\n"
    counts = [
        f"{'':80}{d2r:20d}{r2d:20d}\n{part:20d}\n" for d2r, r2d in ((1, 0), (0, 1))
    ]
    return rigid_card + counts[0] + back + counts[1]


def list_rules(check_report: dict[str, Any]) -> list[str]:
    return [finding["rule"] for finding in check_report["findings"]]


def check_output(form: str, text: str) -> None:
    """Validate an output by the schema of its format."""
    if form == "json":
        check_by_schema(json.loads(text))
    elif form == "sarif":
        check_sarif(text)
    elif form == "junit":
        check_junit(text)


# Use in a CI job.


def test_a_deck_that_looks_right_is_caught_by_the_history() -> None:
    assert run("check", DECK).exit_code == 0
    result = run("check", DECK, "--history", GLSTAT)
    assert result.exit_code == 1
    (line,) = (
        line for line in result.stdout.splitlines() if "error" in line and "D2R" in line
    )
    assert line.strip().startswith(f"{DECK}:43:21: error D2R202 part 12: ")
    assert line.endswith("; use td = 0.0687534 with tr = 0.0135867")
    assert "0.0128853" not in result.stdout  # one cure for one part
    (warned,) = (line for line in result.stdout.splitlines() if "D2R203" in line)
    assert warned.endswith("; use td = 0.0687534 with tr = 0.0135867")


def test_json_says_where_and_by_what() -> None:
    check_report = run_json_checked("check", DECK, "--history", ENERGY)
    assert list_rules(check_report) == ["D2R202", "D2R203"]
    assert check_report["history"] == [ENERGY]
    assert check_report["summary"] == {
        "errors": 1,
        "warnings": 1,
        "infos": 0,
        "decks": 1,
    }
    assert [
        (w["part"], w["tr"], w["td"], w["line"]) for w in check_report["windows"]
    ] == [
        (11, 0.0135867, 0.0687534, 25),
        (12, 0.012265914, 0.064, 41),
    ]
    assert run_json("check", DECK)["history"] is None


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize(
    ("deck", "options", "code"),
    [
        *((GOOD, (), 0), (LATE, (), 1), (LATE, ("--exit-zero",), 0)),
        *(
            (COARSE, (), 0),
            (COARSE, ("--fail-on", "warning"), 1),
            (COARSE, ("--ignore", "D2R111"), 0),
        ),
        (
            HEAD + PARTS + THERE + END,
            ("--fail-on", "warning"),
            0,
        ),  # an info is never a problem
    ],
)
def test_the_exit_code_is_the_same_in_every_format(
    deck: str, options: tuple[str, ...], code: int, form: str
) -> None:
    result = run("check", place("main.k", deck), "-f", form, *options)
    assert (result.exit_code, result.stderr) == (code, "")
    check_output(form, result.stdout)


def test_paths_are_relative_to_the_working_folder(tmp_path: Path) -> None:
    place("runs/a/main.k", LATE)
    for name in ("runs/a/main.k", str(tmp_path / "runs/a/main.k")):
        check_report = run_json("check", name)
        assert check_report["decks"] == ["runs/a/main.k"]
        assert {finding["file"] for finding in check_report["findings"]} == {
            "runs/a/main.k"
        }
        assert (
            "::error file=runs/a/main.k,line="
            in run("check", "-f", "github", name).stdout
        )


def test_a_deck_without_switching_cards_says_so() -> None:
    assert "no switching cards" in run("check", place("main.k", HEAD + PARTS)).stdout
    assert "no switching cards" not in run("check", place("main.k", GOOD)).stdout


# Several decks.


def test_findings_of_one_deck_do_not_hide_those_of_another() -> None:
    decks = [place("a.k", LATE), place("b.k", GOOD), place("c.k", LATE)]
    check_report = run_json("check", *decks)
    assert [
        (finding["deck"], finding["rule"]) for finding in check_report["findings"]
    ] == [
        ("a.k", "D2R101"),
        ("c.k", "D2R101"),
    ]
    assert check_report["summary"]["decks"] == 3


@pytest.mark.parametrize("form", FORMATS)
def test_a_deck_that_cannot_be_read_does_not_hide_the_others(form: str) -> None:
    place("a.k", COARSE)
    result = run("check", "absent.k", "a.k", "-f", form)
    assert result.exit_code == 1
    assert (
        result.stderr
        == "d2rpick: absent.k: no such file; check the name and the folder\n"
    )
    assert "D2R111" in result.stdout
    assert "absent.k" in result.stdout or form == "table"
    check_output(form, result.stdout)
    assert run("check", "absent.k", "a.k", "-f", form, "--exit-zero").exit_code == 0


def test_an_unreadable_deck_is_an_error_of_its_own_in_reports() -> None:
    place("a.k", GOOD)
    (error,) = ET.fromstring(
        run("check", "absent.k", "a.k", "-f", "junit").stdout
    ).iter("error")
    assert "absent.k" in error.attrib["message"]
    (sarif,) = json.loads(run("check", "absent.k", "a.k", "-f", "sarif").stdout)["runs"]
    assert [
        invocation["executionSuccessful"] for invocation in sarif["invocations"]
    ] == [False]
    assert run("check", "absent.k", "a.k").stdout.endswith(
        "in 1 deck, 1 not checked; times not judged: no --history\n"
    )


@pytest.mark.parametrize("form", FORMATS)
def test_no_readable_deck_is_no_answer(form: str) -> None:
    place("run.rad", "/NODE\n 1\n")
    result = run("check", "absent.k", "run.rad", "-f", form, "--exit-zero")
    assert result.exit_code == 2
    assert ("absent.k" in result.stdout) == (form != "table")
    check_output(form, result.stdout)
    assert [line.split(": ")[1] for line in result.stderr.splitlines()] == [
        "absent.k",
        "run.rad",
    ]


@pytest.mark.parametrize("form", [*FORMATS, "ndjson"])
def test_standard_input_is_a_deck(form: str) -> None:
    card = run("card", "--tr", "0.02", "--td", "0.09", "--part", "11")
    result = run("check", "-", "-f", form, stdin=card.stdout_bytes)
    assert (result.exit_code, result.stderr) == (0, "")
    assert form == "junit" or "D2R306" in result.stdout
    check_output(form, result.stdout)
    assert run("check", "-", stdin=LATE.encode()).exit_code == 1
    assert run("check", "-", stdin=b"").exit_code == 2


def test_includes_of_standard_input_are_looked_for_here() -> None:
    place("inner.k", THERE)
    document = json.loads(
        run(
            "check",
            "-",
            "-f",
            "json",
            stdin=f"{HEAD}{PARTS}*INCLUDE\ninner.k\n".encode(),
        ).stdout
    )
    assert [window["file"] for window in document["windows"]] == ["inner.k"]


def test_a_folder_stands_for_its_main_decks() -> None:
    place("runs/a/main.k", HEAD + PARTS + "*INCLUDE\ninner.k\n" + END)
    place("runs/a/inner.k", "*KEYWORD\n" + THERE)
    place("runs/b/other.key", "$ a title\n" + LATE)
    place("runs/notes.txt", "nothing")
    place("runs/.git/main.k", LATE)
    assert run_json("check", "runs")["decks"] == ["runs/a/main.k", "runs/b/other.key"]
    assert run_json("check", "runs", "runs/a/main.k")["summary"]["decks"] == 2
    Path("empty").mkdir()
    assert "no main deck in this folder" in read_refusal("check", "empty")
    assert run("check", "empty", "runs/b/other.key").exit_code == 1


def test_ndjson_is_a_line_for_each_deck() -> None:
    decks = [place("a.k", LATE), place("b.k", GOOD)]
    lines = run("check", *decks, "-f", "ndjson").stdout.splitlines()
    documents = [json.loads(line) for line in lines]
    assert [document["decks"] for document in documents] == [["a.k"], ["b.k"]]
    assert [document["summary"]["errors"] for document in documents] == [1, 0]
    for line in lines:
        check_output("json", line)


def place_run(folder: str = ".") -> list[str]:
    """Write the starter deck and the engine files of a run."""
    files = {RUN_EXAMPLE.name: RUN_EXAMPLE.deck, **RUN_EXAMPLE.files}
    return [place(f"{folder}/{name}", text) for name, text in files.items()]


@pytest.mark.parametrize("chosen", [slice(None), slice(0, 1), slice(2, 3)])
def test_the_files_of_a_radioss_run_are_one_deck(chosen: slice) -> None:
    files = place_run()
    check_report = run_json("check", *files[chosen])
    assert len(check_report["decks"]) == 1
    assert check_report["findings"] == []
    assert [(w["part"], w["tr"], w["td"]) for w in check_report["windows"]] == [
        (1, 0.02, 0.09)
    ]
    check_by_schema(check_report)


def test_a_radioss_run_is_judged_by_a_history_and_found_in_a_folder() -> None:
    place_run("runs")
    check_report = run_json("check", "runs", "--history", ENERGY)
    assert check_report["decks"] == ["runs/box_0000.rad"]
    assert set(list_rules(check_report)) <= {"D2R201", "D2R202", "D2R203"}
    assert {"D2R201", "D2R202"} & set(list_rules(check_report))


@pytest.mark.parametrize(
    ("after", "objection"),
    [(None, ""), ("0.01", ""), ("0.03", "tr = 0.02 lies before the end of the load")],
)
def test_a_radioss_body_that_stays_rigid_is_judged_by_its_tr(
    after: str | None, objection: str
) -> None:
    starter, *_, last = place_run()
    Path(last).unlink()  # the engine file that makes the body deformable again
    options = ("--after", after) if after else ()
    report = run_json("check", starter, "--history", ENERGY, *options)
    messages = [f["message"] for f in report["findings"] if f["rule"] == "D2R204"]
    assert objection in " ".join(messages)
    assert bool(messages) == bool(objection)


def test_a_flight_that_the_deck_contradicts_is_not_passed_in_silence() -> None:
    samples = ROOT / "sample_data"
    deck = str(
        samples / "flying_box" / "BOX_0000.rad"
    )  # without the gravity of the run
    asked = ("check", deck, "--history", str(samples / "rollover_boxT01"))
    expected = {
        (): "a flight, but not under the gravity and supports of this deck",
        ("--after", "0.087"): "tr = 0.02 lies before the end of the load",
    }
    for options, objection in expected.items():
        findings = run_json(*asked, *options)["findings"]
        (message,) = (f["message"] for f in findings if f["rule"] == "D2R204")
        assert objection in message


def test_printed_engine_files_pass() -> None:
    pairs = ("--tr", "0.02", "--td", "0.09", "--tr", "0.2", "--td", "0.3")
    card = run("card", "--solver", "radioss", *pairs, "--node", "1808", "--end", "0.4")
    document = json.loads(
        run("check", "-", "-f", "json", stdin=card.stdout_bytes).stdout
    )
    assert document["findings"] == []
    assert [(w["node"], w["tr"], w["td"]) for w in document["windows"]] == [
        (1808, 0.02, 0.09),
        (1808, 0.2, 0.3),
    ]


# Selection of rules.


def test_options_and_configuration_select_rules() -> None:
    deck = place(
        "runs/main.k",
        HEAD + PARTS + THERE + write_automatic_card(1, "0.5", rigid=["1"]) + END,
    )
    all_rules = {"D2R004", "D2R101", "D2R104"}
    assert set(list_rules(run_json("check", deck))) == all_rules
    assert set(list_rules(run_json("check", deck, "--select", "D2R0,D2R101"))) == {
        "D2R004",
        "D2R101",
    }
    assert set(
        list_rules(run_json("check", deck, "--select", "D2R1", "--ignore", "d2r104"))
    ) == {"D2R101"}
    Path("pyproject.toml").write_text('[tool.d2rpick]\nignore = ["D2R004"]\n')
    assert set(list_rules(run_json("check", deck))) == all_rules - {"D2R004"}
    assert set(
        list_rules(run_json("check", deck, "--ignore", "D2R104"))
    ) == all_rules - {"D2R104"}
    Path("runs/d2rpick.toml").write_text(
        'severity = {D2R104 = "error"}\nselect = ["D2R104"]\n'
    )
    check_report = run_json("check", deck)
    assert [
        (finding["rule"], finding["severity"]) for finding in check_report["findings"]
    ] == [("D2R104", "error")]
    assert run("check", deck).exit_code == 1


def test_each_deck_goes_by_the_configuration_nearest_to_it() -> None:
    decks = [place("a/main.k", LATE), place("b/main.k", LATE)]
    Path("a/d2rpick.toml").write_text('ignore = ["D2R101"]\n')
    assert [finding["deck"] for finding in run_json("check", *decks)["findings"]] == [
        "b/main.k"
    ]


def test_a_comment_silences_a_rule_of_the_history_too() -> None:
    text = Path(DECK).read_text()
    for rule, number in (("D2R202", 903), ("D2R203", 904)):
        head, card, tail = text.partition(
            f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{text.split(chr(10))[25]}\n       {number}"
        )
        assert card
        text = f"{head}$ d2rpick: ignore {rule}\n{card}{tail}"
    assert (
        list_rules(run_json("check", place("main.k", text), "--history", ENERGY)) == []
    )


def test_a_wrong_configuration_names_its_file() -> None:
    place("main.k", GOOD)
    Path("d2rpick.toml").write_text('select = ["D2R10l"]\n')
    assert f"{Path('d2rpick.toml').absolute()}: no rule 'D2R10l'" in read_refusal(
        "check", "main.k", "--select", "D2R1"
    )


def test_a_broken_configuration_does_not_hide_other_decks() -> None:
    decks = [place("a/main.k", GOOD), place("b/main.k", LATE)]
    Path("a/d2rpick.toml").write_text("select = [\n")
    result = run("check", *decks, "-f", "json")
    assert result.exit_code == 1
    assert list_rules(json.loads(result.stdout)) == ["D2R101"]
    assert "a/d2rpick.toml" in result.stderr


def make_failing_reader(text: str, error: Exception) -> Callable[[str], dict[str, Any]]:
    """Return a TOML reader that raises an unforeseen error."""
    read_settings = tomllib.loads

    def loads(content: str) -> dict[str, Any]:
        if text in content:
            raise error
        return read_settings(content)

    return loads


@pytest.mark.parametrize(
    ("form", "error"),
    [
        *((form, ZeroDivisionError("odd")) for form in (*FORMATS, "ndjson")),
        *(
            ("json", error)
            for error in (AssertionError("odd"), BufferError("odd"), EOFError("odd"))
        ),
    ],
)
def test_an_unforeseen_error_is_the_line_of_its_deck(
    form: str, error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    decks = [place("a/main.k", LATE), place("b/main.k", GOOD), place("c/main.k", LATE)]
    Path("b/d2rpick.toml").write_text("# bad")
    monkeypatch.setattr(tomllib, "loads", make_failing_reader("# bad", error))
    result = run("check", *decks, "-f", form, "--exit-zero")
    assert result.exit_code == 2
    message = (
        f"b/main.k: internal error, please report it ({type(error).__name__}: odd)"
    )
    assert result.stderr == f"d2rpick: {message}; --debug shows where\n"
    assert result.stdout.count("is after") == 2 or result.stdout.count("D2R101") >= 2
    assert message in result.stdout or form == "table"
    check_output(form, result.stdout)
    if form == "json":
        assert [
            warning["code"] for warning in json.loads(result.stdout)["warnings"]
        ] == ["internal-error"]
    assert "Traceback" in run("check", *decks, "--debug").stderr


def test_two_spellings_of_a_deck_are_one(tmp_path: Path) -> None:
    place("main.k", LATE)
    Path("link.k").symlink_to("main.k")
    assert run_json("check", "main.k", "./main.k", str(tmp_path / "main.k"), "link.k")[
        "decks"
    ] == ["main.k"]


def test_python_takes_decks_as_the_command_line_does() -> None:
    decks = [
        place("runs/a.k", LATE),
        place("runs/b.k", HEAD + PARTS + "$ d2rpick: ignore D2R1O4\n" + THERE + END),
    ]
    check_report = d2.check(["runs", f"./{decks[0]}"])
    assert check_report.to_dict() == run_json(*check_report.command) | {
        "command": list(check_report.command)
    }
    assert (
        check_report.decks,
        check_report.passed,
        [warning.code for warning in check_report.warnings],
    ) == (
        (*decks,),
        False,
        ["unknown-rule"],
    )
    assert d2.check(place("c.k", GOOD)).passed
    with pytest.raises(d2.DeckError, match=r"absent\.k: no such file"):
        d2.check([decks[0], "absent.k"])


def test_python_is_not_told_how_to_judge_by_nothing() -> None:
    with pytest.raises(ValueError, match="`after` needs an energy history"):
        d2.card([(0.02, 0.09)], parts=11, after=0.02)
    with pytest.raises(ValueError, match="`max_residual` needs an energy history"):
        d2.check(DECK, max_residual=0.1)


@pytest.mark.parametrize("name", ["inner.k", "d2rpick.toml"])
def test_the_result_never_replaces_what_a_deck_leads_to(name: str) -> None:
    place("main.k", HEAD + PARTS + "*INCLUDE\ninner.k\n" + END)
    place("inner.k", THERE)
    place("d2rpick.toml", 'ignore = ["D2R104"]\n')
    content_before = Path(name).read_bytes()
    assert "is an input" in read_refusal(
        "check", "main.k", "-o", name, "--overwrite", "--select", "D2R1"
    )
    assert Path(name).read_bytes() == content_before


def test_the_result_never_replaces_an_input() -> None:
    place("main.k", GOOD)
    Path("energy.csv").write_bytes(Path(ENERGY).read_bytes())
    for name in ("main.k", "energy.csv"):
        assert "is an input" in read_refusal(
            "check", "main.k", "--history", "energy.csv", "-o", name, "--overwrite"
        )
    assert run("check", "main.k", "-o", "report.xml", "-f", "junit").stdout == ""
    check_junit(Path("report.xml").read_text())


# Decks judged by a history.


@pytest.mark.parametrize(
    ("td", "arguments"),
    [
        (0.0687534, {}),
        (0.064, {"after": 0.02}),
        (0.1, {"margin": 0.005, "tolerance": 0.5}),
    ],
)
def test_the_check_objects_where_verify_does(
    td: float, arguments: dict[str, Any]
) -> None:
    times = [time for time in [*TIMES, 0.0135867, 0.0128853, 0.0247264] if time < td]
    windows = [write_deck(tr, td, part) for part, tr in enumerate(times, start=1)]
    run, deck = d2.read(ENERGY), place("main.k", "".join(windows))
    findings = d2.check(deck, history=run, **arguments).to_dict()["findings"]
    for part, tr in enumerate(times, start=1):
        severities_by_rule = {
            finding["rule"]: finding["severity"]
            for finding in findings
            if finding["message"].startswith(f"part {part}: ")
        }
        judged = d2.verify(run, tr, td, **arguments).to_dict()
        assert ("error" in severities_by_rule.values()) != judged["verified"], (
            tr,
            td,
            judged["reasons"],
            severities_by_rule,
        )
        assert (judged["kinetic_share"] > 0.5) == (
            {"D2R203", "D2R209"} & {*severities_by_rule} != set()
        )
        assert ("D2R209" in severities_by_rule) <= (judged["verdict"] == "do not use")
        assert ("D2R202" in severities_by_rule) == any(
            "opposite direction" in reason for reason in judged["reasons"]
        )
        assert ("D2R204" in severities_by_rule) == any(
            "end of the load" in reason for reason in judged["reasons"]
        )


@pytest.mark.slow
@pytest.mark.parametrize("tr", [0.05, 0.0886, 0.15])
def test_parts_that_share_a_window_are_judged_together_as_verify_judges_them(
    tr: float,
) -> None:
    parts = {
        str(part["id"]): part["energy_max"] for part in run_json("info", BOX)["parts"]
    }
    both_cards = write_automatic_card(
        1, str(tr), rigid=[*parts]
    ) + write_automatic_card(2, "0.37", deformable=[*parts])
    check_report = run_json("check", place("main.k", both_cards), "--history", BOX)[
        "findings"
    ]
    objections = [
        finding["message"] for finding in check_report if finding["severity"] == "error"
    ]
    chosen = [text for part in parts for text in ("--part", part)]
    assert (
        bool(objections)
        != run_json("verify", "--tr", str(tr), "--td", "0.37", *chosen, BOX)["verified"]
    )
    assert {message.partition(":")[0] for message in objections} <= {"parts 1-3"}
    assert 0.0 in parts.values()


def test_parts_with_windows_of_their_own_are_judged_apart() -> None:
    cards = write_automatic_card(1, "0.05", rigid=["1"]) + write_automatic_card(
        2, "0.37", deformable=["1"]
    )
    cards += write_automatic_card(3, "0.15", rigid=["2"]) + write_automatic_card(
        4, "0.36", deformable=["2"]
    )
    check_report = run_json("check", place("main.k", cards), "--history", BOX)[
        "findings"
    ]
    for part, tr, td in (("1", "0.05", "0.37"), ("2", "0.15", "0.36")):
        blamed = [
            f
            for f in check_report
            if f["severity"] == "error" and f["message"].startswith(f"part {part}:")
        ]
        assert (
            bool(blamed)
            != run_json("verify", "--tr", tr, "--td", td, "--part", part, BOX)[
                "verified"
            ]
        )


def test_what_verify_warns_of_is_told_for_each_part() -> None:
    box = next(
        part["id"] for part in run_json("info", BOX)["parts"] if part["title"] == "box"
    )
    cut = place("cut.matsum", Path(MATSUM).read_text()[:-40])
    check_report = run_json(
        "check", place("main.k", write_deck(0.15, 0.37, box)), "--history", cut
    )
    (message,) = (
        w["message"] for w in check_report["warnings"] if w["code"] == "truncated-input"
    )
    assert message.startswith(f"part {box}: the input ends within a state")


def test_a_part_that_the_history_does_not_have_is_not_passed() -> None:
    check_report = run_json(
        "check", place("main.k", write_deck(0.1, 0.37, 77)), "--history", BOX
    )
    assert list_rules(check_report) == ["D2R205"]
    assert (
        "part 77: not in the history, which has part"
        in check_report["findings"][0]["message"]
    )


def test_parts_of_one_card_with_the_same_fault_are_one_finding() -> None:
    both_cards = write_automatic_card(
        1, ".0122659", rigid=["1", "2"]
    ) + write_automatic_card(2, "0.064", deformable=["1", "2"])
    check_report = run_json(
        "check", place("main.k", HEAD + PARTS + both_cards + END), "--history", ENERGY
    )
    assert [
        (f["rule"], f["message"].split(":")[0]) for f in check_report["findings"]
    ] == [
        ("D2R202", "parts 1, 2"),
        ("D2R203", "parts 1, 2"),
    ]


@pytest.mark.slow
def test_a_history_that_tells_no_flight_is_an_objection() -> None:
    time = np.linspace(0, 1, 60)
    rising = "\n".join(f"{t:.6f},{1 + t**2:.6f}" for t in time)
    Path("rising.csv").write_text(f"time,internal_energy\n{rising}\n")
    place("main.k", write_deck(0.5, 0.55))
    check_report = run_json("check", "main.k", "--history", "rising.csv")
    (message,) = (
        f["message"] for f in check_report["findings"] if f["rule"] == "D2R204"
    )
    assert (
        "the history does not show when the load ends; give that time with --after"
        in message
    )
    assert "D2R204" not in list_rules(
        run_json("check", "main.k", "--history", "rising.csv", "--after", "0.2")
    )


def test_a_history_without_energy_is_an_objection() -> None:
    rows = "\n".join(f"{t:.3f},0" for t in np.linspace(0, 1, 400))
    Path("flat.csv").write_text(f"time,internal_energy\n{rows}\n")
    check_report = run_json(
        "check",
        place("main.k", write_deck(0.5, 0.55)),
        "--history",
        "flat.csv",
        "--after",
        "0.1",
    )
    assert [f["message"] for f in check_report["findings"] if f["rule"] == "D2R201"]


@pytest.mark.parametrize("history", [ENERGY, GLSTAT])
def test_a_part_that_is_rigid_in_the_whole_run_is_not_judged_by_time(
    history: str,
) -> None:
    deck = place("main.k", HEAD + PARTS + "*DEFORMABLE_TO_RIGID\n         1\n" + END)
    result = run_json("check", deck, "--history", history, "--select", "D2R2,D2R3")
    assert list_rules(result) == ["D2R302"]
    (message,) = (finding["message"] for finding in result["findings"])
    assert message.endswith("not judged by time")
    assert "--history" not in run("check", deck).stdout.split("next")[1].split("\n0")[0]


def test_a_line_of_the_other_list_is_no_second_mistake_of_wrong_counts() -> None:
    """The counts say two D2R lines and one R2D line; the second line has the PTYPE of an R2D line."""
    card = write_automatic_card(1, "0.02", rigid=["1"])
    back = write_automatic_card(2, "0.09", deformable=["1"])
    wrong = back.replace("0.0         0         1", "0.0         2         1")
    deck = place("main.k", HEAD + PARTS + card + wrong + END)
    assert list_rules(run_json("check", deck, "--select", "D2R0,D2R1")) == ["D2R001"]


def test_the_step_after_a_good_check_names_the_judged_parts() -> None:
    cards = write_automatic_card(1, "0.123689", rigid=["1", "2"])
    back = write_automatic_card(2, "0.37", deformable=["1", "2"])
    deck = place("run/main.k", cards + back)
    text = run("check", deck, "--history", MATSUM, "--select", "D2R2").stdout
    assert f"verify --switched run --part 1,2 {MATSUM}" in " ".join(text.split())


def test_a_part_that_is_rigid_from_the_start_is_judged_by_its_td() -> None:
    back = write_automatic_card(2, "0.0687534", deformable=["1"])
    cards = "*DEFORMABLE_TO_RIGID\n         1\n" + back
    deck = place("main.k", HEAD + PARTS + cards + END)
    result = run_json("check", deck, "--history", ENERGY, "--select", "D2R2,D2R3")
    messages = {entry["rule"]: entry["message"] for entry in result["findings"]}
    assert {"D2R201", "D2R202"} & {*messages}
    assert "not judged" not in messages["D2R302"]


def test_td_after_the_next_contact_is_named_at_td() -> None:
    box = next(
        part["id"] for part in run_json("info", BOX)["parts"] if part["title"] == "box"
    )
    deck = place("main.k", write_deck(0.2, 0.37, box))
    for margin, expected in (("0.005", []), ("0.03", [("D2R204", 7)])):
        check_report = run_json("check", deck, "--history", BOX, "--margin", margin)[
            "findings"
        ]
        assert [
            (f["rule"], f["line"])
            for f in check_report
            if "after the last td of the flight" in f["message"]
        ] == expected


def test_a_part_set_that_cannot_be_resolved_is_judged_by_the_whole_model() -> None:
    rigid_card = write_automatic_card(
        1, "0.2", rigid=["         5         0      PSET"]
    )
    back = write_automatic_card(2, "0.37", deformable=["         5      PSET"])
    check_report = run_json(
        "check", place("main.k", rigid_card + back), "--history", BOX
    )
    assert "judged-by-whole" in {
        warning["code"] for warning in check_report["warnings"]
    }


def test_windows_that_are_none_are_left_to_other_rules() -> None:
    swapped = write_automatic_card(1, "0.09", rigid=["1"]) + write_automatic_card(
        2, "0.02", deformable=["1"]
    )
    assert list_rules(
        run_json("check", place("main.k", HEAD + PARTS + swapped), "--history", ENERGY)
    ) == ["D2R102"]
    assert list_rules(
        run_json("check", place("main.k", HEAD + PARTS + THERE), "--history", ENERGY)
    ) == ["D2R104"]


@pytest.mark.parametrize(
    ("tr", "options", "objections"),
    [
        ("0.19", (), {"D2R205"}),
        ("0.02", ("--after", "0.03"), {"D2R204"}),
        ("0.04", ("--after", "0.03"), set()),
    ],
)
def test_tr_is_judged_whatever_becomes_of_td(
    tr: str, options: tuple[str, ...], objections: set[str]
) -> None:
    rigid_card, back = (
        write_automatic_card(1, tr, rigid=["1"]),
        write_automatic_card(2, "0.01", deformable=["1"]),
    )
    for deck, rule_expected in ((rigid_card, "D2R104"), (rigid_card + back, "D2R102")):
        check_report = run_json(
            "check",
            place("main.k", PARTS + deck),
            "--history",
            ENERGY,
            "--select",
            "D2R1,D2R2",
            *options,
        )
        assert set(list_rules(check_report)) - {rule_expected} == objections


def test_what_the_readers_left_out_is_noted() -> None:
    data = Path(GLSTAT).read_bytes()
    Path("glstat").write_bytes(data[: len(data) - 200])
    assert (
        "warning: truncated-input: " in run("check", DECK, "--history", "glstat").stderr
    )
    assert run("check", DECK, "--history", "glstat", "--quiet").stderr == ""


def test_a_name_that_is_no_text_does_not_break_a_report() -> None:
    name = os.fsdecode(b"de\xe9ck.k")
    Path(name).write_text(LATE)
    for form in FORMATS:
        result = run("check", name, "-f", form)
        assert result.exit_code == 1
        check_output(form, result.stdout)


def test_the_history_is_named_relative_to_the_working_folder(tmp_path: Path) -> None:
    Path("energy.csv").write_bytes(Path(ENERGY).read_bytes())
    check_report = run_json("check", DECK, "--history", str(tmp_path / "energy.csv"))
    assert check_report["history"] == ["energy.csv"]


def test_an_energy_of_several_parts_is_not_called_that_of_one(tmp_path: Path) -> None:
    deck = tmp_path / "main.k"
    run("card", "--tr", "0.15", "--td", "0.37", "--part", "1,2", "-o", str(deck))
    lines = run(
        "check", str(deck), "--history", BOX, "--tolerance", "0.001"
    ).stdout.splitlines()
    (finding_line,) = [
        line for line in lines if "D2R201" in line and not line.startswith("next")
    ]
    assert "the energy of the 2 parts that are switched together is" in finding_line


def test_a_check_without_a_history_says_that_it_has_judged_no_times() -> None:
    message = "; times not judged: no --history"
    assert run("check", DECK).stdout.splitlines()[-1].endswith(message)
    assert message not in run("check", DECK, "--history", GLSTAT).stdout
    place("none.k", HEAD + END)
    assert message not in run("check", "none.k").stdout


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            (DECK,),
            "passed  no errors or warnings; the times were not judged, because no history was given",
        ),
        ((DECK, "--history", GLSTAT), "found  1 error and 1 warning"),
        (("none.k",), "passed  no errors or warnings"),
        (("none.k", "absent.k"), "failed  1 of 2 decks could not be checked: absent.k"),
    ],
)
def test_the_first_line_says_what_was_found_in_one_deck(
    arguments: tuple[str, ...], line: str
) -> None:
    place("none.k", HEAD + END)
    assert run("check", *arguments).stdout.splitlines()[0] == line


def test_findings_are_rows_of_csv_and_markdown_too() -> None:
    check_report = run_json("check", DECK, "--history", GLSTAT)["findings"]
    csv, markdown = (
        run("check", DECK, "--history", GLSTAT, "-f", form).stdout
        for form in ("csv", "markdown")
    )
    csv_rows = [*DictReader(csv.splitlines())]
    assert [row["rule"] for row in csv_rows if row["rule"]] == [
        finding_row["rule"] for finding_row in check_report
    ]
    assert all(row["severity"] == "info" for row in csv_rows if not row["rule"])
    rows = [line.split(" | ") for line in markdown.splitlines() if "D2R" in line]
    assert [row[0].strip("| ") for row in rows] == [
        finding_row["rule"] for finding_row in check_report
    ]


@pytest.mark.parametrize(
    "form", ["table", "json", "ndjson", "csv", "markdown", "github", "junit", "sarif"]
)
def test_every_format_has_the_verdict_on_each_pair_with_reason_and_cure(
    form: str,
) -> None:
    """A pair that is good or fair has no finding, but the reader must also see the verdict."""
    judged = [
        run_json("verify", "--tr", repr(window["tr"]), "--td", repr(window["td"]), ENERGY)
        for window in run_json("check", DECK)["windows"]
    ]  # fmt: skip
    assert [answer["verdict"] for answer in judged] == ["use", "do not use"]
    text = run("check", "-f", form, "--history", ENERGY, DECK).stdout
    text = " ".join(text.replace("%25", "%").split())
    for part, answer in zip((11, 12), judged, strict=True):
        assert answer["verdict_reason"] in text
        assert answer["cure"] in text
        if form not in ("json", "ndjson", "sarif"):
            assert f"{answer['verdict']}: part {part}: rigid from " in text
    for document in [run_json("check", "--history", ENERGY, DECK)]:
        assert [
            (window["verdict"], window["verdict_reason"], window["cure"])
            for window in document["windows"]
        ] == [
            (answer["verdict"], answer["verdict_reason"], answer["cure"])
            for answer in judged
        ]


def test_a_fair_pair_passes_and_its_verdict_comes_before_any_finding() -> None:
    pair = run_json("suggest", "--part", "1,2", "--no-deck", MATSUM)
    assert pair["verdict"] == "use with care"
    tr, td = pair["recommended"]["tr"], pair["recommended"]["td"]
    deck = run(
        "card", "--tr", f"{tr:.7g}", "--td", f"{td:.7g}", "--part", "1,2"
    ).stdout  # fmt: skip
    place("fair.k", f"*KEYWORD\n{deck}*END\n")
    result = run("check", "fair.k", "--history", MATSUM)
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert lines[1].startswith("  use with care: parts 1, 2: rigid from ")
    assert lines[2].startswith("    why         the vibration after td is wrong by ")
    assert any(line.startswith("    to improve  ") for line in lines[3:8])


def test_without_a_history_no_window_has_a_verdict() -> None:
    for window in run_json("check", DECK)["windows"]:
        assert (window["verdict"], window["verdict_reason"], window["cure"]) == (
            None,
        ) * 3
    assert not re.search(r"\buse\b", run("check", DECK).stdout)


def test_the_step_after_a_check_explains_an_error_above_all_warnings() -> None:
    """The finding of the earlier line is a warning, so it is listed after the error."""
    place("late.k", LATE.replace(THERE, "*DATABASE_GLSTAT\n      0.01\n" + THERE))
    result = run("check", "late.k")
    assert result.stdout.index("error D2R101") < result.stdout.index("warning D2R")
    assert "read about the most severe one with d2rpick rule D2R101" in result.stdout
