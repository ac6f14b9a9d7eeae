"""``explore``: its formats, its schema, and its agreement with ``suggest`` for every td."""

import csv
import io
import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import d2rpick as d2
from d2rpick.api.plans import Exploration
from d2rpick.report.formats import DisplayOptions
from tests.command import ENERGY, MATSUM, ROOT, put, run, run_json
from tests.energies import require
from tests.json_schemas import run_json_checked

WINDOW = ("--td-window", "0.06", "0.07", "--steps", "10")
SCHEMA = json.loads((ROOT / "d2rpick/schemas/explore-2.json").read_text("utf-8"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("explored", "options", "source"),
    [
        (WINDOW, (), ENERGY),
        ((*WINDOW, "--td", "0.064"), ("--cost-share", "0.8"), ENERGY),
        (
            ("--steps", "2"),
            ("--part", "box", "--strict", "--max-residual", "0.1"),
            MATSUM,
        ),
    ],
)
def test_the_json_keeps_its_schema_and_every_offer_is_what_suggest_says(
    explored: tuple[str, ...], options: tuple[str, ...], source: str
) -> None:
    exploration = run_json_checked("explore", *explored, *options, source)
    offers = exploration["offers"]
    assert (
        offers[0].keys() == SCHEMA["properties"]["offers"]["items"]["properties"].keys()
    )
    assert all(low["td"] < high["td"] for low, high in pairwise(offers))
    for offer_row in offers[:: max(1, len(offers) // 3)]:
        alone = run_json("suggest", "--td", repr(offer_row["td"]), *options, source)
        best = next((c for c in alone["candidates"] if c["recommended"]), None)
        assert (offer_row["tr"], offer_row["td"]) == (best and best["tr"], alone["td"])
        assert (offer_row["kinetic_share"], offer_row["energy_td"], offer_row["basis"]) == (
            alone["kinetic_share"], alone["energy_td"], alone["basis"],
        )  # fmt: skip
        assert (offer_row["quality"], offer_row["expected"]) == (
            alone["quality"],
            alone["expected"],
        )
        for name in (
            "residual",
            "level_error",
            "lock_in_error",
            "timing_tolerance",
            "rigid_time",
            "run_time_share",
        ):
            assert offer_row[name] == (best and best[name])


def test_the_recommended_pair_is_that_of_suggest() -> None:
    exploration, chosen = (
        run_json("explore", *WINDOW, ENERGY),
        run_json("suggest", *WINDOW[:3], ENERGY),
    )
    assert exploration["recommended"] == chosen["recommended"]
    (marked,) = (offer for offer in exploration["offers"] if offer["recommended"])
    assert {"tr": marked["tr"], "td": marked["td"]} == exploration["recommended"]


def test_a_much_longer_rigid_time_is_given_as_a_factor() -> None:
    exploration = run_json(
        "explore", "--td", "0.11", str(ROOT / "sample_data" / "rollover_box.matsum")
    )
    assert "makes the rigid time 10.5 times as long" in exploration["answer"]


def test_the_sentence_says_what_a_step_changes() -> None:
    exploration = run_json("explore", "--td", "0.064", *WINDOW, ENERGY)
    assert exploration["answer"] == (
        "td = 0.064: residual 0.957; 0.0048 later (tr = 0.0135867, td = 0.0687534) cuts the error to 0.000 "
        "and makes the rigid time 7.9% longer"
    )
    assert (exploration["start"], exploration["step"]) == (
        0.064,
        exploration["recommended"]["td"],
    )
    near = run_json("explore", "--td", "0.07", *WINDOW, ENERGY)["answer"]
    assert near.startswith(
        "td = 0.07: residual 0.299; 0.0012 earlier (tr = 0.0135867, td = 0.0687534)"
    )
    assert "costs 2.3% of the rigid time" in near
    good = run_json("explore", "--td", "0.0687534", *WINDOW, ENERGY)["answer"]
    assert good == "td = 0.0687534: residual 0.000; no other td in the range is better"


@pytest.mark.parametrize("td", ["0.03", "0.064", "0.101"])
def test_the_step_in_a_long_window_is_the_pair_that_suggest_names(td: str) -> None:
    """The nearest Pareto-optimal td can be several periods away; suggest names the nearest peak."""
    exploration = run_json("explore", "--td", td, "--steps", "40", ENERGY)
    suggestion = run_json("suggest", "--td", td, ENERGY)
    assert exploration["step"] == suggestion["better_td"]["td"]


def test_the_best_pair_of_a_flight_is_not_cured_by_other_times() -> None:
    """The cure for the pair that suggest and explore choose must not lead back to explore."""
    chosen = ("--part", "1,2", "--no-deck", MATSUM)
    suggestion = run_json("suggest", *chosen)
    assert suggestion["verdict"] == "use with care"
    cure = suggestion["cure"]
    assert cure.startswith("nothing clearly better was found for td from 0.086 to ")
    assert "explore" not in cure
    explored = " ".join(run("explore", *chosen, "--steps", "20").stdout.split())
    assert f"to improve {cure} expect" in explored


def test_a_td_that_saves_little_is_no_step_and_the_sentence_says_so(
    tmp_path: Path,
) -> None:
    time = np.linspace(0, 1, 501)
    later = np.maximum(time - 0.2, 0.0)  # static energy, then two independent modes
    energy = 1 + 0.3 * np.sin(41 * later) ** 2 + 0.2 * np.sin(97 * later) ** 2
    file = tmp_path / "run.csv"
    pd.DataFrame({"time": time, "internal_energy": energy}).to_csv(file, index=False)
    exploration = run_json(
        "explore",
        "--td",
        "0.996",
        "--after",
        "0",
        "--no-verify",
        "--steps",
        "20",
        str(file),
    )
    (start,) = (
        offer_row for offer_row in exploration["offers"] if offer_row["td"] == 0.996
    )
    halved = [
        offer_row
        for offer_row in exploration["offers"]
        if offer_row["error"] is not None and offer_row["error"] <= start["error"] / 2
    ]
    assert halved
    assert (
        max(offer_row["rigid_time"] for offer_row in halved) < start["rigid_time"] / 2
    )
    assert exploration["step"] is None
    assert exploration["answer"].endswith(
        "; no other td in the range halves this error without giving up more than half of the rigid time"
    )


@pytest.mark.slow
def test_every_form_has_the_same_offers(tmp_path: Path) -> None:
    exploration = run_json("explore", *WINDOW, ENERGY)["offers"]
    rows = list(
        csv.DictReader(io.StringIO(run("explore", *WINDOW, "-f", "csv", ENERGY).stdout))
    )
    assert [float(row["td"]) for row in rows] == [
        offer_row["td"] for offer_row in exploration
    ]
    assert [float(row["residual"]) for row in rows] == [
        offer_row["residual"] for offer_row in exploration
    ]
    frame = d2.explore(d2.read(ENERGY), td_window=(0.06, 0.07), steps=10).to_frame()
    assert frame["td"].tolist() == [offer_row["td"] for offer_row in exploration]
    assert frame["unbeaten"].tolist() == [
        offer_row["unbeaten"] for offer_row in exploration
    ]
    table = run("explore", *WINDOW, "--limit", "3", ENERGY).stdout
    assert f"... and {len(exploration) - 3} more values of td" in table
    answer, *_, markdown_table = run(
        "explore", *WINDOW, "-f", "markdown", ENERGY
    ).stdout.split("\n\n")
    assert answer == run_json("explore", *WINDOW, ENERGY)["answer"]
    assert markdown_table.startswith("|  | td |")
    picture = tmp_path / "x.svg"
    assert run("explore", *WINDOW, "-q", "--plot", str(picture), ENERGY).exit_code == 0
    assert b"<svg" in picture.read_bytes()


def test_nothing_to_recommend_is_an_objection() -> None:
    result = run(
        "explore",
        "--steps",
        "4",
        "--max-residual",
        "0.001",
        "--td-window",
        "0.06",
        "0.064",
        ENERGY,
    )
    assert result.exit_code == 1
    assert "no td in the range has an admissible tr" in result.stdout
    assert "no-candidate" in result.stderr


@pytest.mark.slow
def test_a_td_where_nothing_flies_is_answered_as_suggest_answers_it(
    tmp_path: Path,
) -> None:
    ramp = put(
        tmp_path / "ramp.csv",
        "time,internal_energy\n" + "".join(f"{i / 100},{i * i}\n" for i in range(101)),
    )
    assert (
        "if you know the end of the load, give it as --after"
        in run("explore", str(ramp)).stderr
    )
    run_result = run("suggest", "--td", "0.5", str(ramp))
    result = run("explore", "--td", "0.5", "--steps", "4", "-f", "json", str(ramp))
    assert (run_result.exit_code, result.exit_code) == (1, 1)
    assert "give --td" not in result.stderr
    assert "no-candidate" in result.stderr
    document = json.loads(result.stdout)
    assert document["td_window"] == [
        0.0,
        1.0,
    ]  # no flight is found, so the whole record is explored
    (offer_at_td,) = (offer for offer in document["offers"] if offer["td"] == 0.5)
    assert offer_at_td["reason"] in " ".join(run_result.stdout.split())
    assert document["recommended"] is None


def test_what_would_be_better_is_the_pair_that_suggest_names() -> None:
    window = ("--td-window", "0.06", "0.066", ENERGY)
    answers = [
        run(command, *window, "-q").stdout.splitlines()
        for command in ("suggest", "explore")
    ]
    cures = [
        [line.removeprefix("to improve").strip() for line in lines if "improve" in line]
        for lines in answers
    ]
    assert cures == [["use tr = 0.0135867, td = 0.0687534: vibration error 0.0%"]] * 2


@pytest.fixture(scope="module")
def explored() -> Exploration:
    return d2.explore(d2.read(MATSUM), parts="1,2")


def test_the_first_line_is_the_pair_that_suggest_chooses(explored: Exploration) -> None:
    suggested = d2.suggest(d2.read(MATSUM), parts="1,2")
    pair = require(suggested.recommended)
    verdict = require(suggested.decision).verdict
    times = f"tr = {pair.tr:.6g}, td = {pair.td:.6g}"
    text = explored.text("table", DisplayOptions())
    assert text.startswith(f"{verdict}  {times}, residual ")
    assert explored.answer.startswith(f"{verdict}: {times}")
    assert "best pair" not in text


def test_a_smaller_error_and_a_longer_rigid_time_are_shown_with_what_they_cost(
    explored: Exploration,
) -> None:
    lines = explored.text("table", DisplayOptions()).splitlines()
    named = {line[:13].strip(): line[15:] for line in lines}
    offers = [
        offer for offer in explored.to_dict()["offers"] if offer["error"] is not None
    ]
    (chosen,) = (offer for offer in offers if offer["recommended"])
    smallest = min(offers, key=lambda offer: round(offer["error"], 3))
    longest = max(offers, key=lambda offer: offer["rigid_time"])
    lost = 1 - smallest["rigid_time"] / chosen["rigid_time"]
    gained = longest["rigid_time"] / chosen["rigid_time"] - 1
    assert named["smaller error"] == (
        f"td = {smallest['td']:.6g} with residual {smallest['error']:.3f} costs {lost:.1%} of the rigid time"
    )
    assert named["longest"] == (
        f"td = {longest['td']:.6g} with residual {longest['error']:.3f} makes the rigid time {gained:.1%} longer"
    )


def test_a_table_names_each_reason_once_below_it() -> None:
    lines = run("explore", "--td", "0.064", "--steps", "40", ENERGY).stdout.splitlines()
    numbered = [line for line in lines if line.startswith("(")]
    assert [line.split()[0] for line in numbered] == [
        f"({number})" for number in range(1, len(numbered) + 1)
    ]
    assert len(numbered) == len(set(numbered))
    table = lines[lines.index("") : lines.index(numbered[0])]
    used = {row.split()[-1] for row in table if row.endswith(")") and "(" in row}
    assert {line.split()[0] for line in numbered} == used & {
        f"({number})" for number in range(9)
    }
    assert all("wrong by" not in row for row in table)


def test_the_exit_code_and_its_message_belong_to_the_verdict_in_the_first_line() -> (
    None
):
    """Before, they belonged to the pair that d2rpick would choose if td were free."""
    poor = run("explore", "--td", "0.0657", *WINDOW, ENERGY)
    assert poor.stdout.startswith("do not use ")
    assert poor.exit_code == 1
    assert "the verdict is 'do not use'" in poor.stderr
    assert "if td is free  use: " in poor.stdout
    good = run("explore", "--td", "0.0687534", *WINDOW, ENERGY)
    assert good.stdout.startswith("use ")
    assert good.exit_code == 0
