"""Wheels that hang loose, an engine that swings slowly, parts of one title: what is answered on a made car."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from tests import made_car
from tests.command import answer, run
from tests.json_schemas import check_by_schema

if TYPE_CHECKING:
    from pathlib import Path

CAR = "1-6"
TR, TD = "0.02", "0.14"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The car with its wheels, whose engine swings three times before it lands, and its decks."""
    made = tmp_path_factory.mktemp("car")
    made_car.t01(made, 3.0)
    made_car.starter(made)
    made_car.keywords(made)
    return made


def warned(found: dict[str, Any], code: str) -> list[str]:
    return [one["message"] for one in found["warnings"] if one["code"] == code]


@pytest.mark.parametrize("deck", ["MADE_0000.rad", "made.k"])
def test_the_car_without_its_wheels_is_recommended_in_its_own_flight(folder: Path, deck: str) -> None:
    """All parts fly until the wheels land, and the car flies on: a set that saves a third of that was recommended."""
    found = answer("parts", "--deck", str(folder / deck), str(folder / "MADET01"))
    check_by_schema(found)
    (best,) = [one for one in found["sets"] if one["recommended"]]
    assert best["parts"] == list(made_car.BODY)
    assert best["bodies"] == [list(made_car.BODY)]
    assert made_car.WHEELS_LAND < best["td"] < made_car.LANDS
    given = answer("parts", "--deck", str(folder / deck), "--td", "0.05", str(folder / "MADET01"))
    assert {one["td"] for one in given["sets"]} == {0.05}


@pytest.mark.parametrize(("deck", "bodies"), [("MADE_0000.rad", 2), ("made.k", 3)])
def test_a_set_without_what_moves_is_offered_where_wheels_hang_loose(
    folder: Path, tmp_path: Path, deck: str, bodies: int
) -> None:
    history = made_car.t01(tmp_path, 3.0, made_car.LANDS)
    asked = ("parts", "--deck", str(folder / deck))
    sets = {one["name"]: one for one in answer(*asked, history)["sets"]}
    assert len(sets["all that may"]["bodies"]) == bodies
    assert sets["all but what moves"]["parts"] == list(made_car.BODY)
    same = answer(*asked, "--part", CAR, history)
    assert [one["name"] for one in same["sets"]] == [*sets]  # no set twice


def test_ls_dyna_is_not_offered_one_body_of_loose_pieces(folder: Path) -> None:
    found = answer("parts", "--deck", str(folder / "made.k"), str(folder / "MADET01"))
    (hubs,) = [row for row in found["parts"] if row["title"] == "hubs"]
    assert hubs["verdict"] == "keep"
    assert hubs["reasons"] == ["2 pieces that nothing joins, of which one rigid body would be made"]
    named = answer(
        "suggest", "--td", "0.05", "--part", "1-9", "--deck", str(folder / "made.k"), str(folder / "MADET01")
    )
    (told,) = warned(named, "loose-pieces")
    assert told.startswith("parts 7-9 lie in 2 pieces that nothing joins; LS-DYNA makes one rigid body of them")
    radioss = answer("parts", "--deck", str(folder / "MADE_0000.rad"), str(folder / "MADET01"))
    assert {row["verdict"] for row in radioss["parts"]} == {"switch", "merge"}
    assert warned(radioss, "loose-pieces")[0].endswith("each of them needs a rigid body of its own")


def test_cards_keep_the_wheels_apart_from_the_car(folder: Path) -> None:
    asked = ("--td", "0.05", "--solver", "ls-dyna", "--deck", str(folder / "made.k"), str(folder / "MADET01"))
    card = run("suggest", "-q", "--part", "1-9", "-f", "card", *asked).stdout
    rows = [line.split() for line in card.splitlines() if line.endswith("PART") and len(line.split()) == 3]
    assert {int(part): int(lead) for part, lead, _ in rows} == {
        1: 0, 7: 0, **dict.fromkeys((2, 3, 4, 5, 6), 1), 8: 7, 9: 7
    }  # fmt: skip
    merged = answer("suggest", "--part", "1-9", "--merge", "1", "--report", str(folder / "page.html"), *asked)
    assert warned(merged, "merged-apart") == [
        "--merge 1 makes one rigid body of what nothing joins: parts 1-6; parts 7-9; leave it out to keep them apart"
    ]
    whole = answer("suggest", "--part", CAR, "--merge", "1", "--report", str(folder / "two.html"), *asked)
    assert warned(whole, "merged-apart") == []


def test_without_a_deck_parts_that_fly_away_are_no_body(folder: Path) -> None:
    """Momenta show it: a hub with a tyre each, and the car, change their velocities by nothing against each other."""
    asked = ("verify", "--tr", TR, "--td", "0.05", str(folder / "MADET01"))
    found = answer(*asked, "--part", "1-9")
    assert found["position_error"] is None
    (told,) = warned(found, "moves-apart")
    assert told.startswith("hubs, tyre (8), tyre (9) fly away from the other parts: nothing joins them")
    alone = answer(*asked, "--part", CAR)
    assert alone["position_error"] > 0
    assert warned(alone, "moves-apart") == []
    joined = answer(*asked, "--part", "1-9", "--merge", "1", "--solver", "ls-dyna", "--report", str(folder / "v.html"))
    assert warned(joined, "moves-apart") == [told]


def test_a_body_of_the_deck_that_holds_what_flies_away_is_not_recommended(folder: Path, tmp_path: Path) -> None:
    nodes = "".join(f"{node:10d}" + "\n" * (n % 10 == 9) for n, node in enumerate(made_car.places()))
    body = f"/RBODY/1\nall\n{99:10d}{0:10d}{0:10d}{0:10d}{'0':>20}{5:10d}\n/GRNOD/NODE/5\nall\n{nodes}\n"
    found = answer("parts", "--deck", made_car.starter(tmp_path, body), str(folder / "MADET01"))
    sets = {one["name"]: one for one in found["sets"]}
    assert sets["all that may"]["bodies"] == [list(range(1, 10))]
    assert sets["all that may"]["position_error"] is None
    assert "hubs, tyre (8), tyre (9) fly away" in sets["all that may"]["reasons"][0]
    assert found["recommended"]["parts"] == list(made_car.BODY)


@pytest.mark.parametrize(("periods", "bound"), [(0.8, True), (2.0, False)])
@pytest.mark.parametrize("deck", [False, True])
def test_a_slow_swing_makes_the_error_a_lower_bound(tmp_path: Path, periods: float, bound: bool, deck: bool) -> None:
    history = made_car.t01(tmp_path, periods)
    known = ("--deck", made_car.starter(tmp_path)) if deck else ()
    found = answer("verify", "--tr", TR, "--td", TD, "--part", CAR, *known, history)
    check_by_schema(found)
    assert found["position_error_part"] == "engine"
    assert found["position_error_is_lower_bound"] is bound
    asked = ("--td", TD, "--part", CAR, *known, history)
    assert ("off by at least" in run("suggest", "-q", *asked).stdout) is bound
    assert all(("off by at least" in told) is bound for told in warned(found, "out-of-place"))
    plan = run("plan", "-q", "--part", CAR, *known, history).stdout
    assert (">= 0.0" in plan) is bound
    if deck:
        (best,) = [one for one in answer("parts", *known, history)["sets"] if one["recommended"]]
        assert best["position_is_lower_bound"] is bound
        (row,) = [line for line in run("parts", "-q", *known, history).stdout.splitlines() if f"  {CAR}  " in line]
        assert row.count(">= ") == (2 if bound else 0)  # position and angle


def test_parts_of_one_title_are_told_apart_by_number(folder: Path) -> None:
    found = answer("suggest", "--td", TD, "--part", CAR, str(folder / "MADET01"))
    names = ", ".join(f"panel ({part})" for part in range(1, 6))
    assert found["history"]["channel"] == f"internal energy of {names}, engine"
    assert [one["title"] for one in found["flight"]["parts"]] == ["panel"] * 5 + ["engine"]
    table = run("suggest", "-q", "--td", TD, "--part", CAR, str(folder / "MADET01")).stdout
    assert f"momentum of {names} and 1 more" in table
    listed = run("info", str(folder / "MADET01")).stdout
    assert "panel (1), panel (2)" in listed
