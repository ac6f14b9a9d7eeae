"""Verdicts on parts and sets of parts: a synthetic run, a synthetic car with loose wheels, and a computed car."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.base.errors import FormatError
from d2rpick.choice.pair.moving_apart import MovingApart
from d2rpick.choice.parts.cost import CostModel, Weights
from d2rpick.choice.parts.sets_of_parts import (
    Parts,
    compare_sets_of_parts,
    recommend_parts,
)
from d2rpick.choice.parts.switchable_parts import (
    InFlight,
    PartFacts,
    PartRow,
    collect_facts,
    compute_step_growth,
    find_landing_alone,
    judge_parts,
)
from d2rpick.choice.question import Settings
from d2rpick.deck import read_inventory
from d2rpick.histories.formats import radioss_th
from d2rpick.histories.names import Part
from d2rpick.histories.opening import open_run
from d2rpick.report.formats import DisplayOptions
from d2rpick.vibration.measures import run_time_share
from tests import made_car
from tests.command import ENERGY, MATSUM, put, run, run_json
from tests.computed import locate_stored, read_starter
from tests.energies import require
from tests.json_schemas import check_by_schema
from tests.made_t01 import make_t01
from tests.reading import open_contents
from tests.sample_deck import DECK
from tests.text_files import make_matsum_text

opened = cache(lambda history: open_run([history]))

STEP = "step\n         2         2         1"
TIMES = (0.1, 0.37)
PLASTIC = "*MAT_PIECEWISE_LINEAR_PLASTICITY"
CAR = "1-6"
TR, TD = "0.02", "0.14"


def rank_sets(history: str, deck: str | None = None, **options: object) -> Parts:
    model = CostModel(read_inventory(deck)) if deck else None
    return compare_sets_of_parts(
        opened(history),
        Settings(replay=False),
        model,
        **options,  # type: ignore[arg-type]
    )


def test_without_a_deck_no_verdict_is_guessed_and_the_cost_stays_open() -> None:
    part_answer = rank_sets(MATSUM)
    assert [row.verdict for row in part_answer.rows] == ["unknown", "unknown"]
    assert [row.cost_share for row in part_answer.rows] == [None, None]
    assert part_answer.sets == ()
    assert part_answer.recommended is None
    assert [caution.code for caution in part_answer.cautions] == ["no-deck"]
    assert all(
        row.flight and row.flight.flies and row.flight.mean for row in part_answer.rows
    )


def test_parts_of_the_box_are_one_body_and_the_sled_is_rigid_already() -> None:
    part_answer = rank_sets(MATSUM, str(DECK))
    assert [(row.verdict, row.merge_with) for row in part_answer.rows] == [
        ("switch", None),
        ("merge", 1),
        ("keep", None),
    ]
    assert part_answer.rows[2].reasons == ("already rigid",)
    best = require(part_answer.recommended)
    assert (best.parts, best.bodies) == ((1, 2), ((1, 2),))
    assert best.step_growth == float("inf")
    assert best.run_time_share == pytest.approx(
        run_time_share(require(best.rigid_fraction), require(best.cost_share), 1.0)
    )


def write_variant(folder: Path, *changes: tuple[str, str]) -> str:
    text = DECK.read_text("utf-8")
    for old_text, new_text in changes:
        assert old_text in text
        text = text.replace(old_text, new_text)
    (folder / "main.k").write_text(text, "utf-8")
    return str(folder / "main.k")


def rank_sets_of_variant(folder: Path, *changes: tuple[str, str]) -> Parts:
    """Rank the sets with a changed deck in a given window, so that no window is searched for."""
    return rank_sets(MATSUM, write_variant(folder, *changes), times=TIMES)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ([(STEP, "step\n         2         2         3"), ("*END", "*MAT_FABRIC\n         3\n*END")], "airbag fabric"),
        ([(STEP, "step\n         2         2         3"), ("*END", "*MAT_NULL\n         3\n*END")], "void material"),
        ([("*ELEMENT_SHELL", "*ELEMENT_SHELL\n*SECTION_SOLID\n         9         1\n*ELEMENT_SHELL"),
          (STEP, "step\n         2         9         1")], "do not rotate"),
    ],
)  # fmt: skip
def test_a_part_that_must_stay_deformable_is_kept_with_the_reason(
    tmp_path: Path, changes: list[tuple[str, str]], reason: str
) -> None:
    part_answer = rank_sets_of_variant(tmp_path, *changes)
    assert part_answer.rows[1].verdict == "keep"
    assert reason in " ".join(part_answer.rows[1].reasons)
    assert part_answer.rows[0].verdict == "switch"


def test_a_part_whose_material_is_missing_is_not_judged(tmp_path: Path) -> None:
    part_answer = rank_sets_of_variant(
        tmp_path, (STEP, "step\n         2         2         5")
    )
    assert (part_answer.rows[1].verdict, part_answer.rows[1].reasons) == (
        "unknown",
        ("its material is not in the deck",),
    )


def test_elements_in_a_file_that_is_missing_are_not_taken_for_none(
    tmp_path: Path,
) -> None:
    part = "\nmore\n         4         1         1\n*SECTION_SHELL"
    whole = rank_sets_of_variant(tmp_path, ("\n*SECTION_SHELL", part))
    assert (whole.rows[3].verdict, whole.rows[3].reasons) == ("keep", ("no elements",))
    part_answer = rank_sets_of_variant(
        tmp_path, ("\n*SECTION_SHELL", part), ("*END", "*INCLUDE\nmesh.k\n*END")
    )
    assert part_answer.rows[3].verdict == "unknown"
    assert (
        "not in the files of the deck that were read" in part_answer.rows[3].reasons[0]
    )
    assert part_answer.recommended is None


def test_rigid_in_the_deck_but_with_energy_in_the_history_is_not_taken_for_rigid(
    tmp_path: Path,
) -> None:
    part_answer = rank_sets_of_variant(
        tmp_path, (STEP, "step\n         2         2         2")
    )
    assert part_answer.rows[1].verdict == "merge"
    assert (
        "rigid in the deck, but has internal energy in the history"
        in part_answer.rows[1].reasons
    )


def test_a_deck_of_another_run_is_noticed(tmp_path: Path) -> None:
    part_answer = rank_sets_of_variant(
        tmp_path, (STEP, "step\n        22         2         1")
    )
    assert "parts-not-in-deck" in [caution.code for caution in part_answer.cautions]
    assert part_answer.rows[1].verdict == "unknown"
    assert (
        part_answer.recommended is None
    )  # a part without *PART has elements: the cost is unknown
    with pytest.raises(FormatError, match="no set of parts can be recommended"):
        recommend_parts(
            open_run([MATSUM]),
            Settings(),
            CostModel(read_inventory(str(tmp_path / "main.k"))),
        )


def test_none_is_recommended_of_a_table_which_says_what_to_give_instead() -> None:
    with pytest.raises(
        FormatError,
        match=r"^[^:]+: this table has no parts; give the matsum, .* instead",
    ):
        recommend_parts(
            open_run([ENERGY]), Settings(), CostModel(read_inventory(str(DECK)))
        )


def test_parts_of_a_run_in_which_nothing_deforms_are_listed(tmp_path: Path) -> None:
    part_answer = rank_sets(
        str(
            put(
                tmp_path / "matsum",
                make_matsum_text([0.0], [1, 2, 3], np.zeros((1, 3))),
            )
        )
    )
    assert len(part_answer.rows) == 3
    assert {row.verdict for row in part_answer.rows} == {"keep"}
    assert part_answer.facts.reason


def test_the_step_grows_by_what_stays_deformable() -> None:
    first_row, two, three, four = (
        make_row(part, None, None)._replace(smallest_step=step)
        for part, step in enumerate((2e-6, 6e-6, 3e-6, None), 1)
    )
    assert compute_step_growth([first_row, two, three], {1}) == pytest.approx(1.5)
    assert compute_step_growth([first_row, two, three], {2}) == 1.0
    assert compute_step_growth([first_row, two, three], {1, 2, 3}) == float("inf")
    assert (
        compute_step_growth([first_row, two, four], {1}) is None
    )  # the time step of part 4 is unknown
    assert compute_step_growth([first_row, two, four], {1, 4}) == 3.0
    assert compute_step_growth([first_row, four._replace(kind="rigid")], {1}) == float(
        "inf"
    )


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Parts:
    deck = put(tmp_path_factory.mktemp("car") / "CAR_0000.rad", read_starter("CAR"))
    return rank_sets(
        locate_stored("carT01.gz"),
        str(deck),
        given_ids=[12, 13, 14],
        times=(0.0496, 0.1464),
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
    sets_by_name = {part_set.name: part_set for part_set in car.sets}
    run = (0.1464 - 0.0496) / 0.24  # the measured runs ended at 0.24
    predicted = {}
    for name, (per_step, saving) in measured.items():
        share = require(sets_by_name[name].cost_share)
        assert share == pytest.approx(per_step, abs=0.08)
        predicted[name] = 1 - run_time_share(run, share, 1.0)
        assert predicted[name] == pytest.approx(saving, abs=0.05)
    assert sorted(predicted, key=lambda name: predicted[name]) == [
        "given",
        "stopped deforming",
        "all that may",
    ]
    assert car.recommended is sets_by_name["all that may"]


def test_where_the_car_comes_to_rest(car: Parts) -> None:
    sets_by_name = {part_set.name: part_set for part_set in car.sets}
    assert sets_by_name["all that may"].position_error == pytest.approx(
        2.2e-3, abs=0.7e-3
    )  # as computed by the solver, within 30 %
    given_set = sets_by_name["given"]  # six bodies; computed, they are 0.16 mm off
    assert (
        given_set.position_error,
        given_set.position_part,
        given_set.position_limit,
    ) == (
        0.0,
        None,
        None,
    )
    assert {part_set.position_assumes for part_set in car.sets} == {None}
    assert sets_by_name["all that may"].angle_error == pytest.approx(
        0.235, rel=0.3
    )  # degrees, as computed by the solver
    stopped = sets_by_name["stopped deforming"]
    assert stopped.position_error == pytest.approx(0.87e-3, abs=0.3e-3)
    assert stopped.angle_error == pytest.approx(0.145, abs=0.1)
    assert given_set.angle_error is None


def test_masses_that_are_written_come_before_those_of_the_deck(car: Parts) -> None:
    assert {row.mass_source for row in car.rows} == {"history"}
    assert np.isclose(
        sum(row.mass or 0.0 for row in car.rows if row.movable), 845.5, atol=0.2
    )


def test_a_deck_whose_parts_have_other_titles_is_doubted(tmp_path: Path) -> None:
    part_answer = rank_sets_of_variant(tmp_path, (STEP, STEP.replace("step", "skid")))
    (message,) = [
        caution.message
        for caution in part_answer.cautions
        if caution.code == "deck-of-another-model"
    ]
    assert (
        message
        == "part 2 is 'step' in the history and 'skid' in the deck: is this the deck of the run?"
    )
    same = rank_sets_of_variant(
        tmp_path, (STEP, STEP.replace("step", "STEP  of the frame"))
    )
    assert "deck-of-another-model" not in [caution.code for caution in same.cautions]


def make_row(part: int, landing: float | None, cost: float | None) -> PartRow:
    """Return a part with this energy absorption at the beginning of the landing and this fraction of the cost."""
    return PartRow(
        part, "", {"shell": 1}, (), "MAT", "deformable", 1.0, "deck", (), InFlight(True, 1.0, 0.0, 0.5, landing),
        cost, None, None, (),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("rows", "alone"),
    [
        ([make_row(1, 1.0, 0.95), make_row(2, 19.0, 0.05)], 2),
        (
            [make_row(1, 1.0, 0.85), make_row(2, 19.0, 0.15)],
            None,
        ),  # leaving it deformable costs too much
        (
            [make_row(1, 3.0, 0.95), make_row(2, 17.0, 0.05)],
            None,
        ),  # another part takes up the energy
        (
            [make_row(1, -50.0, 0.95), make_row(2, 19.0, 0.05)],
            2,
        ),  # energy that other parts give back is not absorbed energy
        (
            [make_row(1, 0.0, 0.95), make_row(2, 0.0, 0.05)],
            None,
        ),  # no energy is taken up
        (
            [make_row(1, None, 0.95), make_row(2, None, 0.05)],
            None,
        ),  # the record ends in the flight
        (
            [make_row(1, 1.0, None), make_row(2, 19.0, None)],
            None,
        ),  # the cost is unknown
        (
            [make_row(1, 1.0, 0.95), make_row(2, 19.0, 0.05)._replace(kind="spring")],
            None,
        ),
    ],
)
def test_which_part_drives_the_landing_alone(
    rows: list[PartRow], alone: int | None
) -> None:
    assert find_landing_alone(rows) == alone


def test_a_part_that_drives_the_landing_alone_is_kept() -> None:
    model = CostModel(read_inventory(str(DECK)), Weights({"BT": 1.0, "QBAT": 0.1}))
    facts = collect_facts(open_run([MATSUM]), Settings())

    def with_landing(part: PartFacts, landing: float) -> PartFacts:
        return part._replace(
            flights=tuple(
                part_row._replace(landing=landing) for part_row in part.flights
            )
        )

    parts_by_id = {
        1: with_landing(facts.parts[1], 0.01),
        2: with_landing(facts.parts[2], 5.0),
    }
    rows = judge_parts(facts._replace(parts=parts_by_id), model)
    assert [part_row.verdict for part_row in rows] == ["switch", "keep", "keep"]
    assert rows[1].reasons == ("determines the landing alone, and costs little",)


def write_separate_step(folder: Path, extra_text: str = "") -> str:
    """Write the deck with copies of the nodes that the step shares with the box."""
    lines = DECK.read_text("utf-8").splitlines()
    for line_number, line in enumerate(lines):
        cells = line.split()
        if len(cells) == 6 and cells[1] == "2":
            lines[line_number] = "".join(
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
        "\n".join(lines).replace("*END", f"{extra_text}*END") + "\n", "utf-8"
    )
    return str(folder / "main.k")


def test_parts_that_welds_join_are_one_body_and_the_weld_is_named(
    tmp_path: Path,
) -> None:
    part_answer = rank_sets(MATSUM, write_separate_step(tmp_path), times=TIMES)
    assert [(row.verdict, row.shares_nodes) for row in part_answer.rows[:2]] == [
        ("switch", ()),
        ("switch", ()),
    ]
    welded = rank_sets(
        MATSUM,
        write_separate_step(tmp_path, f"*CONSTRAINED_SPOTWELD\n{13:10d}{213:10d}\n"),
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
    messages = {
        caution.code: caution.message
        for caution in rank_sets(
            MATSUM, write_separate_step(tmp_path, tie), times=TIMES
        ).cautions
    }
    assert "*CONTACT_TIED_NODES_TO_SURFACE" in messages["ties-not-followed"]
    whole = rank_sets_of_variant(tmp_path, ("*END", f"{tie}*END"))
    assert "ties-not-followed" not in [caution.code for caution in whole.cautions]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the car with wheels and an engine that oscillates three times before the landing, and its decks."""
    car_folder = tmp_path_factory.mktemp("car")
    made_car.write_t01(car_folder, 3.0)
    made_car.write_starter(car_folder)
    made_car.write_keywords(car_folder)
    return car_folder


def list_messages(document: dict[str, Any], code: str) -> list[str]:
    return [
        warning["message"]
        for warning in document["warnings"]
        if warning["code"] == code
    ]


@pytest.mark.slow
def test_the_car_without_its_wheels_is_recommended_in_its_own_flight(
    folder: Path,
) -> None:
    """All parts fly until the wheels land, and the car flies on, so its set saves more than the set of all parts."""
    run, deck = d2.read(folder / "MADET01"), folder / "MADE_0000.rad"
    part_table = d2.parts(run, replay=False, deck=deck)
    check_by_schema(part_table.to_dict())
    best = require(part_table.recommended)
    assert best.parts == made_car.BODY
    assert best.bodies == (made_car.BODY,)
    assert made_car.WHEELS_LAND < require(best.window)[1] < made_car.LANDS
    assert {
        require(part_set.window)[1]
        for part_set in d2.parts(run, replay=False, deck=deck, td=0.05).sets
    } == {0.05}


@pytest.mark.slow
@pytest.mark.parametrize(("deck", "bodies"), [("MADE_0000.rad", 2), ("made.k", 3)])
def test_a_set_without_what_moves_is_offered_where_wheels_hang_loose(
    folder: Path, tmp_path: Path, deck: str, bodies: int
) -> None:
    run = d2.read(made_car.write_t01(tmp_path, 3.0, made_car.LANDS))
    arguments: dict[str, Any] = {"deck": folder / deck, "replay": False}
    sets = {part_set.name: part_set for part_set in d2.parts(run, **arguments).sets}
    assert len(sets["all that may"].bodies) == bodies
    assert sets["all but what moves"].parts == made_car.BODY
    assert [
        part_set.name for part_set in d2.parts(run, **arguments, given=CAR).sets
    ] == [*sets]  # no set is listed twice


@pytest.mark.slow
def test_ls_dyna_is_not_offered_one_body_of_loose_pieces(folder: Path) -> None:
    part_table = run_json(
        "parts",
        "--no-verify",
        "--deck",
        str(folder / "made.k"),
        str(folder / "MADET01"),
    )
    (hubs,) = [row for row in part_table["parts"] if row["title"] == "hubs"]
    assert hubs["verdict"] == "keep"
    assert hubs["reasons"] == [
        "2 disconnected pieces, which LS-DYNA would make one rigid body"
    ]
    arguments = ("suggest", "--no-verify", "--td", "0.05", "--part", "1-9")
    document = run_json(
        *arguments, "--deck", str(folder / "made.k"), str(folder / "MADET01")
    )
    (message,) = list_messages(document, "loose-pieces")
    assert message.startswith(
        "parts 7-9 lie in 2 pieces that are not connected; LS-DYNA makes one rigid body of them"
    )
    radioss = run_json(
        "parts",
        "--no-verify",
        "--deck",
        str(folder / "MADE_0000.rad"),
        str(folder / "MADET01"),
    )
    assert {row["verdict"] for row in radioss["parts"]} == {"switch", "merge"}
    assert list_messages(radioss, "loose-pieces")[0].endswith(
        "give each piece its own rigid body"
    )


@pytest.mark.slow
def test_cards_keep_the_wheels_apart_from_the_car(folder: Path) -> None:
    deck, history = str(folder / "made.k"), str(folder / "MADET01")
    arguments = (
        "--td",
        "0.05",
        "--no-verify",
        "--solver",
        "ls-dyna",
        "--deck",
        deck,
        history,
    )
    card = run("suggest", "-q", "--part", "1-9", "-f", "card", *arguments).stdout
    rows = [
        line.split()
        for line in card.splitlines()
        if line.endswith("PART") and len(line.split()) == 3
    ]
    assert {int(part): int(lead) for part, lead, _ in rows} == {
        1: 0, 7: 0, **dict.fromkeys((2, 3, 4, 5, 6), 1), 8: 7, 9: 7
    }  # fmt: skip
    merged, whole = (
        run("suggest", "--part", part_names, "--merge", "1", "-f", "card", *arguments)
        for part_names in ("1-9", CAR)
    )
    message = (
        "--merge 1 makes one rigid body of unconnected parts: parts 1-6; parts 7-9; "
        "leave it out to keep them apart"
    )
    assert f"warning: merged-apart: {message}\n" in merged.stderr
    assert "merged-apart" not in whole.stderr


@pytest.mark.slow
def test_without_a_deck_parts_that_fly_away_are_no_body(folder: Path) -> None:
    """Momenta show it: the car and each pair of hub and tyre move at constant velocities relative to each other."""
    arguments = (
        "verify",
        "--tr",
        TR,
        "--td",
        "0.05",
        "--no-verify",
        str(folder / "MADET01"),
    )
    document = run_json(*arguments, "--part", "1-9")
    assert document["position_error"] is None
    (message,) = list_messages(document, "moves-apart")
    assert message.startswith(
        "hubs, tyre (8), tyre (9) fly away from the other parts: nothing connects them"
    )
    alone = run_json(*arguments, "--part", CAR)
    assert alone["position_error"] > 0
    assert list_messages(alone, "moves-apart") == []
    joined = run_json(
        *arguments,
        "--part",
        "1-9",
        "--merge",
        "1",
        "--solver",
        "ls-dyna",
        "--report",
        str(folder / "v.html"),
    )
    assert list_messages(joined, "moves-apart") == [message]


@pytest.mark.parametrize("selected", [(), ("--part", "1-9")])
def test_parts_that_fly_away_are_not_switched_with_the_others(
    folder: Path, selected: tuple[str, ...]
) -> None:
    """One rigid body of the car and its loose wheels would move like none of them, so the motion is poor."""
    history, instead = str(folder / "MADET01"), "1,2,3,4,5,6"
    arguments = ("suggest", "--td", "0.05", *selected, history)
    document = run_json(*arguments)
    assert document["verdict"] == "do not use"
    assert document["motion"] == "poor"
    (message,) = list_messages(document, "moves-apart")
    assert "fly away from the other parts" in message
    assert document["cure"].startswith("leave these parts out")
    text = " ".join(run(*arguments).stdout.split())
    assert f"judge them with d2rpick plan --part {instead} {history}" in text
    chosen = run_json("suggest", "--td", "0.05", "--part", instead, history)
    assert chosen["motion"] != "poor"


def test_parts_that_all_fly_on_their_own_are_not_to_be_left_out() -> None:
    """Each may be a rigid body of its own, in the flight that was found; nothing else could be switched instead."""
    parts = (Part(1, "bottom"), Part(2, "top"))
    separate = MovingApart(leaving=parts, staying=(), are_joined=False)
    assert separate.are_all_separate
    assert separate.describe().startswith(
        "bottom, top fly away from each other: use a rigid body for each of them"
    )
    assert separate.advice.startswith(
        "make each of these parts a rigid body of its own"
    )
    joined = separate._replace(are_joined=True)
    assert not joined.are_all_separate


@pytest.mark.slow
def test_a_body_of_the_deck_that_holds_what_flies_away_is_not_recommended(
    folder: Path, tmp_path: Path
) -> None:
    nodes = "".join(
        f"{node:10d}" + "\n" * (n % 10 == 9)
        for n, node in enumerate(made_car.place_nodes())
    )
    body = f"/RBODY/1\nall\n{99:10d}{0:10d}{0:10d}{0:10d}{'0':>20}{5:10d}\n/GRNOD/NODE/5\nall\n{nodes}\n"
    part_table = run_json(
        "parts",
        "--no-verify",
        "--deck",
        made_car.write_starter(tmp_path, body),
        str(folder / "MADET01"),
    )
    sets = {part_set["name"]: part_set for part_set in part_table["sets"]}
    assert sets["all that may"]["bodies"] == [list(range(1, 10))]
    assert sets["all that may"]["position_error"] is None
    assert "hubs, tyre (8), tyre (9) fly away" in sets["all that may"]["reasons"][0]
    assert part_table["recommended"]["parts"] == list(made_car.BODY)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("periods", "bound", "deck"),
    [(0.8, True, False), (0.8, True, True), (2.0, False, True)],
)
def test_a_slow_swing_makes_the_error_a_lower_bound(
    tmp_path: Path, periods: float, bound: bool, deck: bool
) -> None:
    run, starter_deck = (
        d2.read(made_car.write_t01(tmp_path, periods)),
        made_car.write_starter(tmp_path) if deck else None,
    )
    arguments: dict[str, Any] = {"parts": CAR, "deck": starter_deck, "replay": False}
    verdict = d2.verify(run, float(TR), float(TD), **arguments).to_dict()
    check_by_schema(verdict)
    assert verdict["position_error_part"] == "engine"
    assert verdict["position_error_is_lower_bound"] is bound
    assert (
        "out of place by at least"
        in d2.suggest(run, float(TD), **arguments).text("table", DisplayOptions())
    ) is bound
    assert all(
        ("out of place by at least" in message) is bound
        for message in list_messages(verdict, "out-of-place")
    )
    planned = d2.plan(run, min_quality="poor", **arguments)
    wide = DisplayOptions(width=160)  # narrower tables leave columns out
    assert (">= 0.0" in planned.text("table", wide)) is bound
    if deck:
        sets = d2.parts(run, replay=False, deck=starter_deck)
        assert require(sets.recommended).position_is_lower_bound is bound
        (row,) = [
            line
            for line in sets.text("table", wide).splitlines()
            if f"  {CAR}  " in line
        ]
        assert row.count(">= ") == (2 if bound else 0)  # position and angle


@pytest.mark.slow
def test_parts_of_one_title_are_told_apart_by_number(folder: Path) -> None:
    arguments = (
        "suggest",
        "--no-verify",
        "--td",
        TD,
        "--part",
        CAR,
        str(folder / "MADET01"),
    )
    document = run_json(*arguments)
    names = ", ".join(f"panel ({part})" for part in range(1, 6))
    assert document["history"]["channel"] == f"internal energy of {names}, engine"
    assert [part_row["title"] for part_row in document["flight"]["parts"]] == [
        "panel"
    ] * 5 + ["engine"]
    table = run(*arguments, "-q").stdout
    assert f"momentum of {names} and 1 more" in table
    listed = run("info", str(folder / "MADET01")).stdout
    assert "panel (1), panel (2)" in listed


def test_of_a_run_without_states_nothing_is_said_of_its_parts() -> None:
    facts = collect_facts(
        open_contents(radioss_th, bytes(make_t01(0).data)), Settings()
    )
    assert (facts.parts, facts.reason) == (
        {},
        "run: no states; did the run reach its first output?",
    )
