"""The position error in what suggest, verify and plan write, of a car that a solver computed."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import d2rpick as d2
from d2rpick.api.asked import model_of, selected
from d2rpick.api.request import Request
from d2rpick.choice.question import Settings
from d2rpick.histories.names import Selection
from d2rpick.report.formats import Shown
from tests.command import answer, put, run, unwrapped
from tests.computed import starter, stored
from tests.json_schemas import check_by_schema, checked
from tests.sample_deck import DECK

pytestmark = [pytest.mark.usefixtures("by_level"), pytest.mark.slow]

ONE_BODY = "the parts become one rigid body"


def car() -> str:
    return stored("carT01.gz")


def test_the_deck_tells_which_parts_are_springs_where_energies_do_not(
    tmp_path: Path,
) -> None:
    deck = put(tmp_path / "CAR_0000.rad", starter("CAR"))
    model = model_of(Request(deck=str(deck)))
    silent: Any = SimpleNamespace(springs=(), parts=())
    assert model is not None
    assert selected(silent, Selection(parts=("1",)), Settings(), model).springs == (
        "15",
        "16",
        "17",
    )
    asked = ("suggest", "--td", "0.1464", "--no-verify", "--part", "12-17", car())
    alone, told = answer(*asked), answer(*asked, "--deck", str(deck))
    assert (
        alone["history"]["channel"]
        == told["history"]["channel"]
        == "internal energy of engine, battery, wheels"
    )


def test_suggest_gives_it_for_every_candidate_and_says_it() -> None:
    chosen = d2.suggest(d2.read(car()), 0.1464, parts="1-17", replay=False)
    found = chosen.to_dict()
    check_by_schema(found)
    best = found["candidates"][0]
    assert best["position_error"] == pytest.approx(2.5e-3, abs=1e-3)
    assert {
        one["position_error_part"]
        for one in found["candidates"]
        if one["position_error"]
    } == {"engine"}
    early = [one for one in found["candidates"] if one["tr"] < 0.0384]
    assert early
    assert all(one["position_error"] is None for one in early)  # in the load
    assert "out-of-place" not in {warning["code"] for warning in found["warnings"]}
    table = chosen.text("table", Shown(limit=1))
    assert "off by 0.00" in table
    assert (
        "at td if the parts become one rigid body (`deck` tells which do): engine is frozen elsewhere"
        in table
    )
    assert {
        one["position_error_assumes"]
        for one in found["candidates"]
        if one["position_error"]
    } == {ONE_BODY}
    assert {one["position_error_assumes"] for one in early} == {None}
    head, first, *_ = chosen.text("csv", Shown()).splitlines()
    assert (
        "position_error,position_error_part,position_error_body,position_error_assumes"
        in head
    )
    assert "engine,,the parts become one rigid body" in first


def test_verify_warns_where_it_is_large() -> None:
    found = checked(
        "verify", "--tr", "0.0826", "--td", "0.1464", "--part", "1-17", car()
    )
    assert found["position_error"] == pytest.approx(7.5e-3, rel=0.3)
    assert found["position_error_part"] == "engine"
    (told,) = [
        one["message"] for one in found["warnings"] if one["code"] == "out-of-place"
    ]
    assert told.startswith("engine is frozen elsewhere than it is at td = 0.1464")
    assert "1.4% of its path in the flight" in told
    assert told.endswith(
        "this holds if the parts become one rigid body, which `deck` tells"
    )
    alone = answer("verify", "--tr", "0.0826", "--td", "0.1464", "--part", "12", car())
    assert (alone["position_error"], alone["position_error_part"]) == (None, None)


def test_plan_gives_it_for_every_window() -> None:
    found = checked("plan", "--part", "1-17", car())
    (row,) = [one for one in found["windows"] if one["status"] == "supported"]
    assert row["position_error"] == pytest.approx(2.5e-3, abs=1e-3)
    assert row["position_error_part"] == "engine"
    assert row["position_error_assumes"] == ONE_BODY
    told = unwrapped(run("plan", "-q", "--part", "1-17", car()).stdout)
    assert (
        "out of place at td if the parts become one rigid body: flight 2 by 0.0029; --deck tells which do"
        in told
    )


@pytest.fixture(scope="module")
def deck(tmp_path_factory: pytest.TempPathFactory) -> str:
    file = put(tmp_path_factory.mktemp("car") / "CAR_0000.rad", starter("CAR"))
    return str(file)


def test_of_several_bodies_each_counts_for_itself(deck: str) -> None:
    asked = ("verify", "--tr", "0.0496", "--td", "0.1464", "--part", "12-14", car())
    taken = answer(*asked)
    assert taken["position_error"] == pytest.approx(1.8e-3, abs=1e-4)
    assert taken["position_error_assumes"] == ONE_BODY
    found = answer(*asked, "--deck", deck, "--cost-share", "0.1")
    keys = (
        "position_error",
        "position_error_part",
        "position_error_body",
        "position_error_assumes",
    )
    assert [found[key] for key in keys] == [
        0.0,
        None,
        None,
        None,
    ]  # the solver found 0.16 mm
    check_by_schema(found)
    table = unwrapped(
        run(
            "suggest", "-q", "--td", "0.1464", "--part", "12-14", "--deck", deck, car()
        ).stdout
    )
    assert (
        "in place at td, as far as parts tell: none moves against the others of its rigid body"
        in table
    )


def test_a_body_that_is_not_known_is_named(deck: str) -> None:
    found = answer(
        "verify",
        "--tr",
        "0.0496",
        "--td",
        "0.1464",
        "--part",
        "6,8,12,13",
        "--deck",
        deck,
        car(),
    )
    assert [found[key] for key in ("position_error", "position_error_assumes")] == [
        None,
        None,
    ]
    (told,) = [
        one["message"] for one in found["warnings"] if one["code"] == "several-bodies"
    ]
    assert (
        told
        == "3 rigid bodies: how far that of parts 6, 8 is out of place is not predicted"
    )


def test_a_deck_makes_one_body_of_the_car_and_the_assumption_goes(deck: str) -> None:
    asked = ("verify", "--tr", "0.0826", "--td", "0.1464", "--part", "1-17", car())
    alone, found = answer(*asked), answer(*asked, "--deck", deck)
    assert found["position_error"] == pytest.approx(
        7.47e-3, rel=0.05
    )  # as the solver found at the watched nodes
    assert alone["position_error"] == pytest.approx(7.47e-3, rel=0.2)
    assert (alone["position_error_assumes"], found["position_error_assumes"]) == (
        ONE_BODY,
        None,
    )
    told = [
        one["message"] for one in found["warnings"] if one["code"] == "out-of-place"
    ]
    assert "if the parts" not in told[0]


def test_the_deck_of_another_model_leaves_the_run_time_open() -> None:
    found = answer(
        "suggest",
        "--td",
        "0.1464",
        "--part",
        "1-11",
        "--no-verify",
        "--deck",
        str(DECK),
        car(),
    )
    assert {one["run_time_share"] for one in found["candidates"]} == {None}
    told = {warning["code"]: warning["message"] for warning in found["warnings"]}
    assert told["deck-of-another-model"] == (
        "part 1 is 'floor' in the history and 'box' in the deck, and 2 more: nothing of the deck is used; name that of "
        "the run"
    )


def test_a_deck_that_does_not_tell_leaves_the_assumption_without_asking_for_a_deck() -> (
    None
):
    asked = (
        "--td",
        "0.1464",
        "--no-verify",
        "--part",
        "12-14",
        "--deck",
        str(DECK),
        car(),
    )
    found = answer("suggest", *asked)
    best = next(one for one in found["candidates"] if one["recommended"])
    assert best["position_error_assumes"] == ONE_BODY
    told = run("suggest", "-q", *asked).stdout
    assert (
        "at td if the parts become one rigid body: engine is frozen elsewhere" in told
    )


def test_a_lead_part_makes_one_body_with_a_deck_and_without(
    deck: str, tmp_path: Path
) -> None:
    """What the card merges is the body whose error is given: engine, battery and wheels as one are 2 mm off."""
    page = ("--report", str(tmp_path / "page.html"), "--overwrite")
    merged = ("--merge", "12", "--no-verify", "--solver", "ls-dyna", *page)
    for with_deck in ((), ("--deck", deck)):
        found = answer(
            "suggest", "--td", "0.1464", "--part", "12-14", *merged, *with_deck, car()
        )
        best = next(one for one in found["candidates"] if one["recommended"])
        assert best["position_error"] == pytest.approx(2.0e-3, abs=1e-4)
        assert best["position_error_assumes"] is None


@pytest.mark.parametrize(("lead", "known"), [("1", False), ("99", False), ("1", True)])
def test_a_lead_part_does_not_tell_whether_the_part_hangs_together(
    tmp_path: Path, lead: str, known: bool
) -> None:
    """Nor how a lead that is not among the parts moves against them."""
    merged = (
        "--merge",
        lead,
        "--report",
        str(tmp_path / "page.html"),
        *(("--deck", str(DECK)) if known else ()),
    )
    asked = ("suggest", "--td", "0.37", "--no-verify", "--part", "1")
    found = answer(*asked, *merged, "sample_data/rollover_box.matsum")
    assert {
        one["position_error"] for one in found["candidates"] if one["tr"] > 0.1
    } == {0.0 if known else None}


def test_cards_merge_the_bodies_of_the_deck(deck: str) -> None:
    card = ("--no-verify", "-f", "card", "--solver", "ls-dyna")
    asked = ("suggest", "-q", "--td", "0.1464", *card, "--deck", deck, car())
    apart = run(*asked, "--part", "12-14").stdout
    assert (
        "        12         0      PART\n        13         0      PART\n        14         0      PART"
        in apart
    )
    assert "--merge" not in apart
    few = run(*asked, "--part", "1-10").stdout
    assert "         1         0      PART\n         2         1      PART" in few
    assert (
        few.count("         1      PART") == 10
    )  # led by part 1, and its own row to switch back
    one = run(*asked, "--part", "1-14").stdout
    assert "14 parts are one rigid body by the deck, led by part 1 (LRB)" in one
