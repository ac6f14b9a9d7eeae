"""The position error in the output of suggest, verify and plan, for a computed car."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import d2rpick as d2
from d2rpick.api.asked import complete_selection, read_cost_model
from d2rpick.api.request import Request
from d2rpick.choice.question import Settings
from d2rpick.histories.names import Selection
from d2rpick.report.formats import DisplayOptions
from tests.command import join_wrapped_lines, put, run, run_json
from tests.computed import locate_stored, read_starter
from tests.json_schemas import check_by_schema, run_json_checked
from tests.sample_deck import DECK

pytestmark = [pytest.mark.usefixtures("by_level"), pytest.mark.slow]

ONE_BODY = "the parts become one rigid body"


def locate_car() -> str:
    return locate_stored("carT01.gz")


def test_the_deck_tells_which_parts_are_springs_where_energies_do_not(
    tmp_path: Path,
) -> None:
    deck = put(tmp_path / "CAR_0000.rad", read_starter("CAR"))
    model = read_cost_model(Request(deck=str(deck)))
    silent: Any = SimpleNamespace(springs=(), parts=())
    assert model is not None
    assert complete_selection(
        silent, Selection(parts=("1",)), Settings(), model
    ).springs == (
        "15",
        "16",
        "17",
    )
    arguments = (
        "suggest",
        "--td",
        "0.1464",
        "--no-verify",
        "--part",
        "12-17",
        locate_car(),
    )
    alone, document = run_json(*arguments), run_json(*arguments, "--deck", str(deck))
    assert (
        alone["history"]["channel"]
        == document["history"]["channel"]
        == "internal energy of engine, battery, wheels"
    )


def test_suggest_gives_it_for_every_candidate_and_says_it() -> None:
    chosen = d2.suggest(d2.read(locate_car()), 0.1464, parts="1-17", replay=False)
    document = chosen.to_dict()
    check_by_schema(document)
    best = document["candidates"][0]
    assert best["position_error"] == pytest.approx(2.5e-3, abs=1e-3)
    assert {
        candidate_row["position_error_part"]
        for candidate_row in document["candidates"]
        if candidate_row["position_error"]
    } == {"engine"}
    early = [
        candidate_row
        for candidate_row in document["candidates"]
        if candidate_row["tr"] < 0.0384
    ]
    assert early
    assert all(
        candidate_row["position_error"] is None for candidate_row in early
    )  # before the end of the load
    assert "out-of-place" not in {warning["code"] for warning in document["warnings"]}
    table = chosen.text("table", DisplayOptions(limit=1))
    assert "out of place by 0.00" in table
    assert (
        "at td if the parts become one rigid body (`deck` shows which do): engine is frozen at another place"
        in table
    )
    assert {
        candidate_row["position_error_assumes"]
        for candidate_row in document["candidates"]
        if candidate_row["position_error"]
    } == {ONE_BODY}
    assert {candidate_row["position_error_assumes"] for candidate_row in early} == {
        None
    }
    head, first, *_ = chosen.text("csv", DisplayOptions()).splitlines()
    assert (
        "position_error,position_error_part,position_error_body,position_error_assumes"
        in head
    )
    assert "engine,,the parts become one rigid body" in first


def test_verify_warns_where_it_is_large() -> None:
    verdict = run_json_checked(
        "verify", "--tr", "0.0826", "--td", "0.1464", "--part", "1-17", locate_car()
    )
    assert verdict["position_error"] == pytest.approx(7.5e-3, rel=0.3)
    assert verdict["position_error_part"] == "engine"
    (message,) = [
        warning["message"]
        for warning in verdict["warnings"]
        if warning["code"] == "out-of-place"
    ]
    assert message.startswith(
        "engine is frozen at a place where it is not at td = 0.1464"
    )
    assert "1.4% of its path in the flight" in message
    assert message.endswith(
        "this holds if the parts become one rigid body, which the deck of the run shows (--deck)"
    )
    alone = run_json(
        "verify", "--tr", "0.0826", "--td", "0.1464", "--part", "12", locate_car()
    )
    assert (alone["position_error"], alone["position_error_part"]) == (None, None)


def test_plan_gives_it_for_every_window() -> None:
    plan_answer = run_json_checked("plan", "--part", "1-17", locate_car())
    (row,) = [
        window for window in plan_answer["windows"] if window["status"] == "supported"
    ]
    assert row["position_error"] == pytest.approx(2.5e-3, abs=1e-3)
    assert row["position_error_part"] == "engine"
    assert row["position_error_assumes"] == ONE_BODY
    text = join_wrapped_lines(run("plan", "-q", "--part", "1-17", locate_car()).stdout)
    assert (
        "out of place at td if the parts become one rigid body: flight 2 by 0.0029; --deck shows which do"
        in text
    )


@pytest.fixture(scope="module")
def deck(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = put(tmp_path_factory.mktemp("car") / "CAR_0000.rad", read_starter("CAR"))
    return str(file)


def test_of_several_bodies_each_counts_for_itself(deck: str) -> None:
    arguments = (
        "verify",
        "--tr",
        "0.0496",
        "--td",
        "0.1464",
        "--part",
        "12-14",
        locate_car(),
    )
    taken = run_json(*arguments)
    assert taken["position_error"] == pytest.approx(1.8e-3, abs=1e-4)
    assert taken["position_error_assumes"] == ONE_BODY
    document = run_json(*arguments, "--deck", deck, "--cost-share", "0.1")
    keys = (
        "position_error",
        "position_error_part",
        "position_error_body",
        "position_error_assumes",
    )
    assert [document[key] for key in keys] == [
        0.0,
        None,
        None,
        None,
    ]  # computed by the solver: 0.16 mm
    check_by_schema(document)
    table = join_wrapped_lines(
        run(
            "suggest",
            "-q",
            "--td",
            "0.1464",
            "--part",
            "12-14",
            "--deck",
            deck,
            locate_car(),
        ).stdout
    )
    assert (
        "in place at td, as far as the parts show: none moves relative to the others of its rigid body"
        in table
    )


def test_a_body_that_is_not_known_is_named(deck: str) -> None:
    verdict = run_json(
        "verify",
        "--tr",
        "0.0496",
        "--td",
        "0.1464",
        "--part",
        "6,8,12,13",
        "--deck",
        deck,
        locate_car(),
    )
    assert [verdict[key] for key in ("position_error", "position_error_assumes")] == [
        None,
        None,
    ]
    (message,) = [
        warning["message"]
        for warning in verdict["warnings"]
        if warning["code"] == "several-bodies"
    ]
    assert (
        message
        == "3 rigid bodies: the position error at td is unknown for the body of parts 6, 8"
    )


def test_a_deck_makes_one_body_of_the_car_and_the_assumption_goes(deck: str) -> None:
    arguments = (
        "verify",
        "--tr",
        "0.0826",
        "--td",
        "0.1464",
        "--part",
        "1-17",
        locate_car(),
    )
    alone, document = run_json(*arguments), run_json(*arguments, "--deck", deck)
    assert document["position_error"] == pytest.approx(
        7.47e-3, rel=0.05
    )  # as computed at the watched nodes
    assert alone["position_error"] == pytest.approx(7.47e-3, rel=0.2)
    assert (alone["position_error_assumes"], document["position_error_assumes"]) == (
        ONE_BODY,
        None,
    )
    messages = [
        warning["message"]
        for warning in document["warnings"]
        if warning["code"] == "out-of-place"
    ]
    assert "if the parts" not in messages[0]


def test_the_deck_of_another_model_leaves_the_run_time_open() -> None:
    suggestion = run_json(
        "suggest",
        "--td",
        "0.1464",
        "--part",
        "1-11",
        "--no-verify",
        "--deck",
        str(DECK),
        locate_car(),
    )
    assert {candidate["run_time_share"] for candidate in suggestion["candidates"]} == {
        None
    }
    messages = {
        warning["code"]: warning["message"] for warning in suggestion["warnings"]
    }
    assert messages["deck-of-another-model"] == (
        "part 1 is 'floor' in the history and 'box' in the deck, and 2 more: the deck is not used; give the "
        "deck of this run"
    )


def test_a_deck_that_does_not_tell_leaves_the_assumption_without_asking_for_a_deck() -> (
    None
):
    arguments = (
        "--td",
        "0.1464",
        "--no-verify",
        "--part",
        "12-14",
        "--deck",
        str(DECK),
        locate_car(),
    )
    suggestion = run_json("suggest", *arguments)
    best = next(
        candidate for candidate in suggestion["candidates"] if candidate["recommended"]
    )
    assert best["position_error_assumes"] == ONE_BODY
    result = join_wrapped_lines(run("suggest", "-q", *arguments).stdout)
    assert (
        "at td if the parts become one rigid body: engine is frozen at another place"
        in result
    )


def test_a_lead_part_makes_one_body_with_a_deck_and_without(
    deck: str, tmp_path: Path
) -> None:
    """The error is that of the merged body of the card: engine, battery and wheels as one body are 2 mm off."""
    page = ("--report", str(tmp_path / "page.html"), "--overwrite")
    merged = ("--merge", "12", "--no-verify", "--solver", "ls-dyna", *page)
    for with_deck in ((), ("--deck", deck)):
        suggestion = run_json(
            "suggest",
            "--td",
            "0.1464",
            "--part",
            "12-14",
            *merged,
            *with_deck,
            locate_car(),
        )
        best = next(
            candidate
            for candidate in suggestion["candidates"]
            if candidate["recommended"]
        )
        assert best["position_error"] == pytest.approx(2.0e-3, abs=1e-4)
        assert best["position_error_assumes"] is None


@pytest.mark.parametrize(
    ("lead", "is_known"), [("1", False), ("99", False), ("1", True)]
)
def test_a_lead_part_does_not_tell_whether_the_part_hangs_together(
    tmp_path: Path, lead: str, is_known: bool
) -> None:
    """A lead part that is not among the parts does not show how it moves relative to them either."""
    merged = (
        "--merge",
        lead,
        "--report",
        str(tmp_path / "page.html"),
        *(("--deck", str(DECK)) if is_known else ()),
    )
    arguments = ("suggest", "--td", "0.37", "--no-verify", "--part", "1")
    document = run_json(*arguments, *merged, "sample_data/rollover_box.matsum")
    assert {
        candidate["position_error"]
        for candidate in document["candidates"]
        if candidate["tr"] > 0.1
    } == {0.0 if is_known else None}


def test_cards_merge_the_bodies_of_the_deck(deck: str) -> None:
    card = ("--no-verify", "-f", "card", "--solver", "ls-dyna")
    arguments = ("suggest", "-q", "--td", "0.1464", *card, "--deck", deck, locate_car())
    apart = run(*arguments, "--part", "12-14").stdout
    assert (
        "        12         0      PART\n        13         0      PART\n        14         0      PART"
        in apart
    )
    assert "--merge" not in apart
    result = run(*arguments, "--part", "1-10").stdout
    assert "         1         0      PART\n         2         1      PART" in result
    assert (
        result.count("         1      PART") == 10
    )  # merged into lead part 1, with a row of its own to switch back
    run_result = run(*arguments, "--part", "1-14").stdout
    assert (
        "14 parts are one rigid body in the deck, with lead part 1 (LRB)" in run_result
    )
