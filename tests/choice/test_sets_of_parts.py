"""Verdicts on parts, and sets of them: on a made run, a made car with loose wheels, and one that a solver computed."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.base.errors import FormatError
from d2rpick.choice.cost import CostModel, Weights
from d2rpick.choice.question import Settings
from d2rpick.choice.sets_of_parts import Parts, parts_of, recommended_parts
from d2rpick.choice.switchable_parts import (
    InFlight,
    PartFacts,
    PartRow,
    facts_of,
    landing_alone,
    rows_of,
    step_growth,
)
from d2rpick.deck import read_inventory
from d2rpick.histories.formats import radioss_th
from d2rpick.histories.opening import open_run
from d2rpick.report.formats import Shown
from d2rpick.vibration.measures import run_time_share
from tests import made_car
from tests.command import ENERGY, MATSUM, answer, put, run
from tests.computed import starter, stored
from tests.energies import sure
from tests.json_schemas import check_by_schema
from tests.made_t01 import t01
from tests.reading import run_of
from tests.sample_deck import DECK
from tests.text_files import matsum_text

opened = cache(lambda history: open_run([history]))


def asked(history: str, deck: str | None = None, **more: object) -> Parts:
    model = CostModel(read_inventory(deck)) if deck else None
    return parts_of(opened(history), Settings(replay=False), model, **more)  # type: ignore[arg-type]


def test_without_a_deck_no_verdict_is_guessed_and_the_cost_stays_open() -> None:
    found = asked(MATSUM)
    assert [row.verdict for row in found.rows] == ["unknown", "unknown"]
    assert [row.cost_share for row in found.rows] == [None, None]
    assert found.sets == ()
    assert found.recommended is None
    assert [caution.code for caution in found.cautions] == ["no-deck"]
    assert all(
        row.flight and row.flight.flies and row.flight.mean for row in found.rows
    )


def test_parts_of_the_box_are_one_body_and_the_sled_is_rigid_already() -> None:
    found = asked(MATSUM, str(DECK))
    assert [(row.verdict, row.merge_with) for row in found.rows] == [
        ("switch", None),
        ("merge", 1),
        ("keep", None),
    ]
    assert found.rows[2].reasons == ("already rigid",)
    best = sure(found.recommended)
    assert (best.parts, best.bodies) == ((1, 2), ((1, 2),))
    assert best.step_growth == float("inf")
    assert best.run_time_share == pytest.approx(
        run_time_share(sure(best.rigid_fraction), sure(best.cost_share), 1.0)
    )


def variant(folder: Path, *changes: tuple[str, str]) -> str:
    text = DECK.read_text("utf-8")
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    (folder / "main.k").write_text(text, "utf-8")
    return str(folder / "main.k")


def changed(folder: Path, *changes: tuple[str, str]) -> Parts:
    """What is found with the deck that was changed so, in a window that is given: none is searched."""
    return asked(MATSUM, variant(folder, *changes), times=TIMES)


STEP = "step\n         2         2         1"
TIMES = (0.1, 0.37)
PLASTIC = "*MAT_PIECEWISE_LINEAR_PLASTICITY"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ([(STEP, "step\n         2         2         3"), ("*END", "*MAT_FABRIC\n         3\n*END")], "airbag fabric"),
        ([(STEP, "step\n         2         2         3"), ("*END", "*MAT_NULL\n         3\n*END")], "void material"),
        ([("*ELEMENT_SHELL", "*ELEMENT_SHELL\n*SECTION_SOLID\n         9         1\n*ELEMENT_SHELL"),
          (STEP, "step\n         2         9         1")], "do not turn"),
    ],
)  # fmt: skip
def test_a_part_that_must_stay_deformable_is_kept_with_the_reason(
    tmp_path: Path, changes: list[tuple[str, str]], reason: str
) -> None:
    found = changed(tmp_path, *changes)
    assert found.rows[1].verdict == "keep"
    assert reason in " ".join(found.rows[1].reasons)
    assert found.rows[0].verdict == "switch"


def test_a_part_whose_material_is_missing_is_not_judged(tmp_path: Path) -> None:
    found = changed(tmp_path, (STEP, "step\n         2         2         5"))
    assert (found.rows[1].verdict, found.rows[1].reasons) == (
        "unknown",
        ("its material is not in the deck",),
    )


def test_elements_in_a_file_that_is_missing_are_not_taken_for_none(
    tmp_path: Path,
) -> None:
    part = "\nmore\n         4         1         1\n*SECTION_SHELL"
    whole = changed(tmp_path, ("\n*SECTION_SHELL", part))
    assert (whole.rows[3].verdict, whole.rows[3].reasons) == ("keep", ("no elements",))
    found = changed(
        tmp_path, ("\n*SECTION_SHELL", part), ("*END", "*INCLUDE\nmesh.k\n*END")
    )
    assert found.rows[3].verdict == "unknown"
    assert "not in what was read of the deck" in found.rows[3].reasons[0]
    assert found.recommended is None


def test_rigid_in_the_deck_but_with_energy_in_the_history_is_not_taken_for_rigid(
    tmp_path: Path,
) -> None:
    found = changed(tmp_path, (STEP, "step\n         2         2         2"))
    assert found.rows[1].verdict == "merge"
    assert (
        "rigid in the deck, but it has internal energy in the history"
        in found.rows[1].reasons
    )


def test_a_deck_of_another_run_is_noticed(tmp_path: Path) -> None:
    found = changed(tmp_path, (STEP, "step\n        22         2         1"))
    assert "parts-not-in-deck" in [caution.code for caution in found.cautions]
    assert found.rows[1].verdict == "unknown"
    assert (
        found.recommended is None
    )  # elements of a part that no *PART defines: the cost is not known
    with pytest.raises(FormatError, match="no set of parts can be recommended"):
        recommended_parts(
            open_run([MATSUM]),
            Settings(),
            CostModel(read_inventory(str(tmp_path / "main.k"))),
        )


def test_none_is_recommended_of_a_table_which_says_what_to_give_instead() -> None:
    with pytest.raises(
        FormatError,
        match=r"^[^:]+: this table has no parts; give the matsum, .* instead",
    ):
        recommended_parts(
            open_run([ENERGY]), Settings(), CostModel(read_inventory(str(DECK)))
        )


def test_parts_of_a_run_in_which_nothing_deforms_are_listed(tmp_path: Path) -> None:
    found = asked(
        str(put(tmp_path / "matsum", matsum_text([0.0], [1, 2, 3], np.zeros((1, 3)))))
    )
    assert len(found.rows) == 3
    assert {row.verdict for row in found.rows} == {"keep"}
    assert found.facts.reason


def test_the_step_grows_by_what_stays_deformable() -> None:
    one, two, three, four = (
        row(part, None, None)._replace(smallest_step=step)
        for part, step in enumerate((2e-6, 6e-6, 3e-6, None), 1)
    )
    assert step_growth([one, two, three], {1}) == pytest.approx(1.5)
    assert step_growth([one, two, three], {2}) == 1.0
    assert step_growth([one, two, three], {1, 2, 3}) == float("inf")
    assert step_growth([one, two, four], {1}) is None  # the step of part 4 is not known
    assert step_growth([one, two, four], {1, 4}) == 3.0
    assert step_growth([one, four._replace(kind="rigid")], {1}) == float("inf")


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Parts:
    deck = put(tmp_path_factory.mktemp("car") / "CAR_0000.rad", starter("CAR"))
    return asked(
        stored("carT01.gz"), str(deck), given_ids=[12, 13, 14], times=(0.0496, 0.1464)
    )


@pytest.mark.slow
def test_verdicts_on_the_car(car: Parts) -> None:
    rows = {row.title: row for row in car.rows}
    assert {name for name, row in rows.items() if not row.movable} == {
        "mounts",
        "suspension",
        "latches",
        "ground",
    }
    assert all(
        "dampers" in " ".join(rows[name].reasons)
        for name in ("mounts", "suspension", "latches")
    )
    stopped = {
        name
        for name, row in rows.items()
        if row.flight and row.flight.deforms is False and row.movable
    }
    assert stopped == {"floor", "side_p", "side_m", "bulkheads", "bows"}
    assert {name for name, row in rows.items() if row.merge_with == 1} == {*rows} - {
        *("floor", "engine", "wheels", "mounts", "suspension", "latches", "ground"),
    }  # fmt: skip


def test_savings_of_the_car_are_within_five_points_and_in_order(car: Parts) -> None:
    measured = {
        "all that may": (0.80, 0.31),
        "stopped deforming": (0.33, 0.13),
        "given": (0.20, 0.075),
    }
    found = {one.name: one for one in car.sets}
    run = (0.1464 - 0.0496) / 0.24  # the runs that were measured ended at 0.24
    predicted = {}
    for name, (per_step, saving) in measured.items():
        share = sure(found[name].cost_share)
        assert share == pytest.approx(per_step, abs=0.08)
        predicted[name] = 1 - run_time_share(run, share, 1.0)
        assert predicted[name] == pytest.approx(saving, abs=0.05)
    assert sorted(predicted, key=lambda name: predicted[name]) == [
        "given",
        "stopped deforming",
        "all that may",
    ]
    assert car.recommended is found["all that may"]


def test_where_the_car_comes_to_rest(car: Parts) -> None:
    found = {one.name: one for one in car.sets}
    assert found["all that may"].position_error == pytest.approx(
        2.2e-3, abs=0.7e-3
    )  # as the solver found, 30 %
    given = found["given"]  # six bodies, which the solver found 0.16 mm off
    assert (given.position_error, given.position_part, given.position_limit) == (
        0.0,
        None,
        None,
    )
    assert {one.position_assumes for one in car.sets} == {None}
    assert found["all that may"].angle_error == pytest.approx(
        0.235, rel=0.3
    )  # degrees, as the solver found
    stopped = found["stopped deforming"]
    assert stopped.position_error == pytest.approx(0.87e-3, abs=0.3e-3)
    assert stopped.angle_error == pytest.approx(0.145, abs=0.1)
    assert given.angle_error is None


def test_masses_that_are_written_come_before_those_of_the_deck(car: Parts) -> None:
    assert {row.mass_source for row in car.rows} == {"history"}
    assert np.isclose(
        sum(row.mass or 0.0 for row in car.rows if row.movable), 845.5, atol=0.2
    )


def test_a_deck_whose_parts_have_other_titles_is_doubted(tmp_path: Path) -> None:
    found = changed(tmp_path, (STEP, STEP.replace("step", "skid")))
    (told,) = [
        caution.message
        for caution in found.cautions
        if caution.code == "deck-of-another-model"
    ]
    assert (
        told
        == "part 2 is 'step' in the history and 'skid' in the deck: is this the deck of the run?"
    )
    same = changed(tmp_path, (STEP, STEP.replace("step", "STEP  of the frame")))
    assert "deck-of-another-model" not in [caution.code for caution in same.cautions]


def row(part: int, landing: float | None, cost: float | None) -> PartRow:
    """A part by what it takes up at the beginning of the landing, and its share of the cost."""
    return PartRow(
        part, "", {"shell": 1}, (), "MAT", "deformable", 1.0, "deck", (), InFlight(True, 1.0, 0.0, 0.5, landing),
        cost, None, None, (),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "alone"),
    [
        ([row(1, 1.0, 0.95), row(2, 19.0, 0.05)], 2),
        (
            [row(1, 1.0, 0.85), row(2, 19.0, 0.15)],
            None,
        ),  # to leave it deformable costs too much
        ([row(1, 3.0, 0.95), row(2, 17.0, 0.05)], None),  # another takes its share
        (
            [row(1, -50.0, 0.95), row(2, 19.0, 0.05)],
            2,
        ),  # what others give back is not what they take
        ([row(1, 0.0, 0.95), row(2, 0.0, 0.05)], None),  # nothing is taken up
        (
            [row(1, None, 0.95), row(2, None, 0.05)],
            None,
        ),  # the record ends in the flight
        ([row(1, 1.0, None), row(2, 19.0, None)], None),  # no cost is known
        ([row(1, 1.0, 0.95), row(2, 19.0, 0.05)._replace(kind="spring")], None),
    ],
)
def test_which_part_drives_the_landing_alone(
    rows: list[PartRow], alone: int | None
) -> None:
    assert landing_alone(rows) == alone


def test_a_part_that_drives_the_landing_alone_is_kept() -> None:
    model = CostModel(read_inventory(str(DECK)), Weights({"BT": 1.0, "QBAT": 0.1}))
    facts = facts_of(open_run([MATSUM]), Settings())

    def with_landing(part: PartFacts, landing: float) -> PartFacts:
        return part._replace(
            flights=tuple(one._replace(landing=landing) for one in part.flights)
        )

    known = {
        1: with_landing(facts.parts[1], 0.01),
        2: with_landing(facts.parts[2], 5.0),
    }
    rows = rows_of(facts._replace(parts=known), model)
    assert [one.verdict for one in rows] == ["switch", "keep", "keep"]
    assert rows[1].reasons == ("drives the landing alone, at little cost",)


def apart(folder: Path, more: str = "") -> str:
    """The deck with nodes of its own for the step: copies where it shares those of the box."""
    lines = DECK.read_text("utf-8").splitlines()
    for at, line in enumerate(lines):
        cells = line.split()
        if len(cells) == 6 and cells[1] == "2":
            lines[at] = "".join(
                f"{int(cell) + 200 * (n > 1 and int(cell) < 97):8d}"
                for n, cell in enumerate(cells)
            )
    mesh = lines.index("*ELEMENT_SHELL")
    copies = [
        f"{int(line[:8]) + 200:8d}{line[8:]}"
        for line in lines[lines.index("*NODE") + 1 : mesh]
    ]
    lines[mesh:mesh] = copies
    (folder / "main.k").write_text(
        "\n".join(lines).replace("*END", f"{more}*END") + "\n", "utf-8"
    )
    return str(folder / "main.k")


def test_parts_that_welds_join_are_one_body_and_the_weld_is_named(
    tmp_path: Path,
) -> None:
    found = asked(MATSUM, apart(tmp_path), times=TIMES)
    assert [(row.verdict, row.shares_nodes) for row in found.rows[:2]] == [
        ("switch", ()),
        ("switch", ()),
    ]
    welded = asked(
        MATSUM,
        apart(tmp_path, f"*CONSTRAINED_SPOTWELD\n{13:10d}{213:10d}\n"),
        times=TIMES,
    )
    assert [(row.verdict, row.merge_with) for row in welded.rows[:2]] == [
        ("switch", None),
        ("merge", 1),
    ]
    assert [row.reasons[-1] for row in welded.rows[:2]] == [
        "joined to part 2 (spotweld)", "joined to part 1 (spotweld)"
    ]  # fmt: skip
    assert welded.sets[0].bodies == ((1, 2),)


def test_ties_that_may_join_parts_are_told_where_these_are_several_bodies(
    tmp_path: Path,
) -> None:
    tie = "*CONTACT_TIED_NODES_TO_SURFACE\n         1         2\n"
    told = {
        one.code: one.message
        for one in asked(MATSUM, apart(tmp_path, tie), times=TIMES).cautions
    }
    assert "*CONTACT_TIED_NODES_TO_SURFACE" in told["ties-not-followed"]
    whole = changed(tmp_path, ("*END", f"{tie}*END"))
    assert "ties-not-followed" not in [one.code for one in whole.cautions]


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


@pytest.mark.slow
def test_the_car_without_its_wheels_is_recommended_in_its_own_flight(
    folder: Path,
) -> None:
    """All parts fly until the wheels land, and the car flies on: a set that saves a third of that was recommended."""
    run, deck = d2.read(folder / "MADET01"), folder / "MADE_0000.rad"
    found = d2.parts(run, replay=False, deck=deck)
    check_by_schema(found.to_dict())
    best = sure(found.recommended)
    assert best.parts == made_car.BODY
    assert best.bodies == (made_car.BODY,)
    assert made_car.WHEELS_LAND < sure(best.window)[1] < made_car.LANDS
    assert {
        sure(one.window)[1]
        for one in d2.parts(run, replay=False, deck=deck, td=0.05).sets
    } == {0.05}


@pytest.mark.slow
@pytest.mark.parametrize(("deck", "bodies"), [("MADE_0000.rad", 2), ("made.k", 3)])
def test_a_set_without_what_moves_is_offered_where_wheels_hang_loose(
    folder: Path, tmp_path: Path, deck: str, bodies: int
) -> None:
    run = d2.read(made_car.t01(tmp_path, 3.0, made_car.LANDS))
    asked: dict[str, Any] = {"deck": folder / deck, "replay": False}
    sets = {one.name: one for one in d2.parts(run, **asked).sets}
    assert len(sets["all that may"].bodies) == bodies
    assert sets["all but what moves"].parts == made_car.BODY
    assert [one.name for one in d2.parts(run, **asked, given=CAR).sets] == [
        *sets
    ]  # no set twice


@pytest.mark.slow
def test_ls_dyna_is_not_offered_one_body_of_loose_pieces(folder: Path) -> None:
    found = answer(
        "parts",
        "--no-verify",
        "--deck",
        str(folder / "made.k"),
        str(folder / "MADET01"),
    )
    (hubs,) = [row for row in found["parts"] if row["title"] == "hubs"]
    assert hubs["verdict"] == "keep"
    assert hubs["reasons"] == [
        "2 pieces that nothing joins, of which one rigid body would be made"
    ]
    asked = ("suggest", "--no-verify", "--td", "0.05", "--part", "1-9")
    named = answer(*asked, "--deck", str(folder / "made.k"), str(folder / "MADET01"))
    (told,) = warned(named, "loose-pieces")
    assert told.startswith(
        "parts 7-9 lie in 2 pieces that nothing joins; LS-DYNA makes one rigid body of them"
    )
    radioss = answer(
        "parts",
        "--no-verify",
        "--deck",
        str(folder / "MADE_0000.rad"),
        str(folder / "MADET01"),
    )
    assert {row["verdict"] for row in radioss["parts"]} == {"switch", "merge"}
    assert warned(radioss, "loose-pieces")[0].endswith(
        "each of them needs a rigid body of its own"
    )


@pytest.mark.slow
def test_cards_keep_the_wheels_apart_from_the_car(folder: Path) -> None:
    deck, history = str(folder / "made.k"), str(folder / "MADET01")
    asked = (
        "--td",
        "0.05",
        "--no-verify",
        "--solver",
        "ls-dyna",
        "--deck",
        deck,
        history,
    )
    card = run("suggest", "-q", "--part", "1-9", "-f", "card", *asked).stdout
    rows = [
        line.split()
        for line in card.splitlines()
        if line.endswith("PART") and len(line.split()) == 3
    ]
    assert {int(part): int(lead) for part, lead, _ in rows} == {
        1: 0, 7: 0, **dict.fromkeys((2, 3, 4, 5, 6), 1), 8: 7, 9: 7
    }  # fmt: skip
    merged, whole = (
        run("suggest", "--part", one, "--merge", "1", "-f", "card", *asked)
        for one in ("1-9", CAR)
    )
    told = "--merge 1 makes one rigid body of what nothing joins: parts 1-6; parts 7-9; leave it out to keep them apart"
    assert f"warning: merged-apart: {told}\n" in merged.stderr
    assert "merged-apart" not in whole.stderr


@pytest.mark.slow
def test_without_a_deck_parts_that_fly_away_are_no_body(folder: Path) -> None:
    """Momenta show it: a hub with a tyre each, and the car, change their velocities by nothing against each other."""
    asked = (
        "verify",
        "--tr",
        TR,
        "--td",
        "0.05",
        "--no-verify",
        str(folder / "MADET01"),
    )
    found = answer(*asked, "--part", "1-9")
    assert found["position_error"] is None
    (told,) = warned(found, "moves-apart")
    assert told.startswith(
        "hubs, tyre (8), tyre (9) fly away from the other parts: nothing joins them"
    )
    alone = answer(*asked, "--part", CAR)
    assert alone["position_error"] > 0
    assert warned(alone, "moves-apart") == []
    joined = answer(
        *asked,
        "--part",
        "1-9",
        "--merge",
        "1",
        "--solver",
        "ls-dyna",
        "--report",
        str(folder / "v.html"),
    )
    assert warned(joined, "moves-apart") == [told]


@pytest.mark.slow
def test_a_body_of_the_deck_that_holds_what_flies_away_is_not_recommended(
    folder: Path, tmp_path: Path
) -> None:
    nodes = "".join(
        f"{node:10d}" + "\n" * (n % 10 == 9) for n, node in enumerate(made_car.places())
    )
    body = f"/RBODY/1\nall\n{99:10d}{0:10d}{0:10d}{0:10d}{'0':>20}{5:10d}\n/GRNOD/NODE/5\nall\n{nodes}\n"
    found = answer(
        "parts",
        "--no-verify",
        "--deck",
        made_car.starter(tmp_path, body),
        str(folder / "MADET01"),
    )
    sets = {one["name"]: one for one in found["sets"]}
    assert sets["all that may"]["bodies"] == [list(range(1, 10))]
    assert sets["all that may"]["position_error"] is None
    assert "hubs, tyre (8), tyre (9) fly away" in sets["all that may"]["reasons"][0]
    assert found["recommended"]["parts"] == list(made_car.BODY)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("periods", "bound", "deck"),
    [(0.8, True, False), (0.8, True, True), (2.0, False, True)],
)
def test_a_slow_swing_makes_the_error_a_lower_bound(
    tmp_path: Path, periods: float, bound: bool, deck: bool
) -> None:
    run, known = (
        d2.read(made_car.t01(tmp_path, periods)),
        made_car.starter(tmp_path) if deck else None,
    )
    asked: dict[str, Any] = {"parts": CAR, "deck": known, "replay": False}
    found = d2.verify(run, float(TR), float(TD), **asked).to_dict()
    check_by_schema(found)
    assert found["position_error_part"] == "engine"
    assert found["position_error_is_lower_bound"] is bound
    assert (
        "off by at least" in d2.suggest(run, float(TD), **asked).text("table", Shown())
    ) is bound
    assert all(
        ("off by at least" in told) is bound for told in warned(found, "out-of-place")
    )
    assert (">= 0.0" in d2.plan(run, **asked).text("table", Shown())) is bound
    if deck:
        sets = d2.parts(run, replay=False, deck=known)
        assert sure(sets.recommended).position_is_lower_bound is bound
        (row,) = [
            line
            for line in sets.text("table", Shown()).splitlines()
            if f"  {CAR}  " in line
        ]
        assert row.count(">= ") == (2 if bound else 0)  # position and angle


@pytest.mark.slow
def test_parts_of_one_title_are_told_apart_by_number(folder: Path) -> None:
    asked = (
        "suggest",
        "--no-verify",
        "--td",
        TD,
        "--part",
        CAR,
        str(folder / "MADET01"),
    )
    found = answer(*asked)
    names = ", ".join(f"panel ({part})" for part in range(1, 6))
    assert found["history"]["channel"] == f"internal energy of {names}, engine"
    assert [one["title"] for one in found["flight"]["parts"]] == ["panel"] * 5 + [
        "engine"
    ]
    table = run(*asked, "-q").stdout
    assert f"momentum of {names} and 1 more" in table
    listed = run("info", str(folder / "MADET01")).stdout
    assert "panel (1), panel (2)" in listed


def test_of_a_run_without_states_nothing_is_said_of_its_parts() -> None:
    facts = facts_of(run_of(radioss_th, bytes(t01(0).data)), Settings())
    assert (facts.parts, facts.reason) == (
        {},
        "run: no states; did the run reach its first output?",
    )
