"""The commands ``parts`` and ``calibrate`` in all formats, and ``--deck`` instead of a cost share."""

import csv
import io
import json
from pathlib import Path

import pytest

import d2rpick as d2
from d2rpick.report.formats import DisplayOptions
from d2rpick.report.parts import COLUMNS, SET_COLUMNS
from tests.choice.test_calibration import run_folder
from tests.command import ENERGY, MATSUM, ROOT, put, read_refusal, run, run_json
from tests.json_schemas import run_json_checked
from tests.sample_deck import DECK

pytestmark = pytest.mark.usefixtures("by_level")

WITH_DECK = ("--deck", str(DECK), MATSUM)


@pytest.mark.parametrize(
    "args",
    [WITH_DECK, (MATSUM,), ("--td", "0.37", *WITH_DECK), ("--deck", str(DECK), ENERGY)],
)
def test_the_answer_keeps_its_schema(args: tuple[str, ...]) -> None:
    part_table = run_json_checked("parts", *args)
    assert (part_table["deck"] is None) == ("--deck" not in args)


def test_all_forms_hold_the_same() -> None:
    parts = d2.parts(d2.read(MATSUM), deck=DECK)
    document = parts.to_dict()
    rows = list(csv.DictReader(io.StringIO(parts.text("csv", DisplayOptions()))))
    assert (
        [row["verdict"] for row in rows]
        == [row["verdict"] for row in document["parts"]]
        == ["switch", "merge", "keep"]
    )
    assert rows[0]["elements"] == "94 shell"
    assert run("parts", "-q", "-f", "value", *WITH_DECK).stdout == "1,2\n"
    for form in ("table", "markdown"):
        text = parts.text(form, DisplayOptions())
        assert all(
            words in text
            for words in (
                "yes, with 1",
                "already rigid",
                "all eligible parts",
                "one rigid body",
            )
        )
    assert document["recommended"]["parts"] == [1, 2]


@pytest.mark.parametrize("word", ["flying", "all"])
def test_a_set_to_compare_may_be_named_by_what_its_parts_do(word: str) -> None:
    part_table = run_json("parts", "--part", word, MATSUM)
    assert [
        (part_set["name"], part_set["parts"]) for part_set in part_table["sets"]
    ] == [("given", [1, 2])]


def test_the_tables_fit_a_screen_and_markdown_has_every_column() -> None:
    for args in (WITH_DECK, (MATSUM,)):
        lines = run("parts", "-q", *args).stdout.splitlines()
        # A long path is not broken, whatever the width.
        assert all(len(line) <= 110 or str(ROOT) in line for line in lines)
    markdown = run("parts", "-q", "-f", "markdown", *WITH_DECK).stdout
    assert all(f"| {name} |" in markdown for name in (*COLUMNS, *SET_COLUMNS))


def test_without_a_set_to_take_every_form_is_an_objection() -> None:
    without_deck = run("parts", "-q", "-f", "value", MATSUM)
    assert (without_deck.exit_code, without_deck.stdout) == (1, "")
    assert run("parts", "-q", "-f", "json", MATSUM).exit_code == 1
    no_parts = run("parts", ENERGY)
    assert no_parts.exit_code == 1
    assert "give the matsum, binout or T01" in no_parts.stderr


def test_a_set_of_ones_own_is_compared() -> None:
    sets = {
        tuple(part_set["parts"]): part_set
        for part_set in run_json("parts", "--part", "step", *WITH_DECK)["sets"]
    }
    assert sets[(2,)]["saving"] < sets[(1,)]["saving"] < sets[(1, 2)]["saving"]


def test_a_given_window_and_step_ratio_count() -> None:
    part_table = run_json(
        "parts", "--tr", "0.1", "--td", "0.3", "--step-ratio", "2", *WITH_DECK
    )
    best = part_table["sets"][0]
    assert (best["tr"], best["td"], part_table["step_ratio"]) == (0.1, 0.3, 2.0)
    share = best["rigid_fraction"] * (1 - (1 - best["cost_share"]) / 2)
    assert best["saving"] == pytest.approx(share)


def test_the_page_holds_parts_and_sets(tmp_path: Path) -> None:
    page = tmp_path / "parts.html"
    assert run("parts", "-q", "--report", str(page), *WITH_DECK).exit_code == 1
    text = page.read_text("utf-8")
    assert all(
        words in text
        for words in ("all eligible parts", "yes, with 1", "already rigid", "SHA-256")
    )
    assert "http" not in text.replace("http-equiv", "")


def test_parts_without_a_weight_are_recommended_with_an_unknown_saving(
    tmp_path: Path,
) -> None:
    other_deck = put(
        tmp_path / "main.k",
        DECK.read_text("utf-8").replace(
            "         1         2       1.0", "         1        99       1.0"
        ),
    )
    result = run("parts", "--deck", str(other_deck), MATSUM)
    # The verdict on the times does not depend on the weights: only the saving is unknown.
    assert result.exit_code == 1
    assert result.stdout.startswith("do not use  best set --part 1,2")
    saves = next(line for line in result.stdout.splitlines() if line[:5] == "saves")
    assert "unknown: no weight is known for shell (ELFORM 99)" in " ".join(
        saves.split()
    )
    weights = put(
        tmp_path / "site.toml",
        '[per_element]\n"shell (ELFORM 99)" = 1.0\nQBAT = 1.0\nBT = 1.0\n',
    )
    assert (
        run(
            "parts", "--deck", str(other_deck), "--weights", str(weights), MATSUM
        ).exit_code
        == 1
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("suggest", "--td", "0.37"),
        ("plan",),
        ("verify", "--tr", "0.0960392", "--td", "0.37"),
    ],
)
def test_a_deck_takes_the_place_of_a_cost_share(command: tuple[str, ...]) -> None:
    def share(*extra_options: str) -> float:
        text = run(
            *command, "--no-verify", "-q", "-f", "json", *extra_options, MATSUM
        ).stdout
        document = json.loads(text)
        rows = document.get("windows") or document.get("candidates") or [document]
        return float(
            next(row["run_time_share"] for row in rows if row.get("recommended", True))
        )

    cost = run_json("parts", *WITH_DECK)["sets"][0]["cost_share"]
    by_deck = share("--part", "1,2", "--deck", str(DECK))
    assert by_deck == pytest.approx(share("--part", "1,2", "--cost-share", str(cost)))
    assert share("--part", "recommended", "--deck", str(DECK)) == by_deck
    assert share("--part", "1,2", "--deck", str(DECK), "--cost-share", "0.1") == share(
        "--part", "1,2", "--cost-share", "0.1"
    )


@pytest.mark.parametrize("command", ["parts", "plan", "suggest"])
def test_a_deck_is_never_written_over(tmp_path: Path, command: str) -> None:
    own_deck = put(tmp_path / "main.k", DECK.read_bytes())
    arguments = (command, "--part", "1", "--deck", str(own_deck), MATSUM)
    assert "this is an input" in read_refusal(
        *arguments, "-o", str(own_deck), "--overwrite"
    )
    assert own_deck.read_bytes() == DECK.read_bytes()


def test_a_cost_that_is_not_known_is_a_warning(tmp_path: Path) -> None:
    cut = put(
        tmp_path / "main.k",
        DECK.read_text("utf-8").replace("*END", "*INCLUDE\nabsent.k\n*END"),
    )
    plan_answer = run_json_checked("plan", "--part", "1,2", "--deck", str(cut), MATSUM)
    assert plan_answer["run_time_share"] is None
    assert "absent.k was not read" in next(
        warning["message"]
        for warning in plan_answer["warnings"]
        if warning["code"] == "cost-unknown"
    )
    whole = run_json("suggest", "--td", "0.37", *WITH_DECK)
    assert "cost-unknown" in [
        warning["code"] for warning in whole["warnings"]
    ]  # no parts are selected


def test_calibrate_writes_what_weights_reads(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    folder = str(run_folder(tmp_path / "run"))
    document = run_json_checked("calibrate", folder)
    assert document["told"]
    for form in ("table", "markdown", "csv"):
        assert "QEPH" in run("calibrate", "-f", form, folder).stdout
    lines = run("calibrate", folder).stdout.splitlines()
    (covers,) = (line for line in lines if line.startswith("covers"))
    assert covers.split()[1] == "QEPH;"
    site = tmp_path / "site.toml"
    assert run("calibrate", "-f", "toml", "-o", str(site), folder).exit_code == 0
    result = run(
        "parts", "-q", "-f", "json", "--weights", str(site), "--exit-zero", *WITH_DECK
    )
    # The file has no weight for the formulations of the deck, not even for similar ones.
    codes = {warning["code"] for warning in json.loads(result.stdout)["warnings"]}
    assert "weights-by-analogy" not in codes
    assert "built-in-weights" in codes
    assert json.loads(result.stdout)["weights"]["per_element"].keys() == {
        "QEPH",
        "point",
    }
    (tmp_path / "empty").mkdir()
    assert run("calibrate", str(tmp_path / "empty")).exit_code == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("parts",), ("suggest", "--td", "0.37"), ("plan",), ("verify", "--tr", "0.097", "--td", "0.37"),
        ("explore", "--td-window", "0.3", "0.37", "--steps", "2"),
    ],
)  # fmt: skip
def test_what_is_doubtful_in_a_deck_is_said_wherever_it_counts(
    arguments: tuple[str, ...], tmp_path: Path
) -> None:
    def codes(*args: str) -> set[str]:
        part = ("--no-verify", *(() if arguments[0] == "parts" else ("--part", "box")))
        return {
            warning["code"]
            for warning in run_json(*arguments, *part, *args)["warnings"]
        }

    assert codes(*WITH_DECK) >= {"weights-by-analogy"}
    deck = put(
        tmp_path / "main.k",
        DECK.read_text("utf-8").replace("*END", "*ELEMENT_GENERALIZED_SHELL\n*END"),
    )
    doubts = codes("--deck", str(deck), MATSUM)
    assert "deck-not-followed" in doubts
    if arguments[0] != "parts":
        assert "cost-unknown" in doubts
        assert "weights-by-analogy" not in codes("--cost-share", "0.5", *WITH_DECK)


def test_the_deck_that_a_plan_writes_merges_what_parts_merges(tmp_path: Path) -> None:
    """Otherwise, `check` finds nodes that belong to two rigid bodies (D2R108)."""
    output = "*DATABASE_MATSUM\n     0.001\n*DATABASE_GLSTAT\n     0.001\n*END"
    deck = put(tmp_path / "main.k", DECK.read_text("utf-8").replace("*END", output))
    result = run(
        "plan",
        "-q",
        "--part",
        "recommended",
        "--write-deck",
        str(tmp_path / "next"),
        *("--deck", str(deck), MATSUM),
    )
    assert result.exit_code == 0
    assert "0 errors, 0 warnings" in result.stdout
    assert (
        "\n         2         1      PART\n"
        in (tmp_path / "next" / "switches.k").read_text()
    )


def test_a_part_that_stays_in_place_gets_no_remark_on_its_position() -> None:
    options = ("--part", "1", "--min-quality", "poor")
    text = run("plan", "-q", *options, "--deck", str(DECK), MATSUM).stdout
    assert "flight 1" in text
    assert "out of place" not in text
