"""Evidence from the deck of a run, and deck errors that make the run useless; decks of other models are ignored."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.base.errors import Caution, D2RPickError
from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.parts.deck_of_run import warn_about_solver
from d2rpick.choice.question import Settings
from d2rpick.choice.td.flights import find_flights
from d2rpick.deck import read_inventory
from d2rpick.flight.momentum import find_flight_around
from d2rpick.histories.history import EXACT, Given, History, Momenta
from d2rpick.histories.names import Part
from d2rpick.histories.surroundings import Support, Surroundings
from d2rpick.rules import RULES, check_deck
from d2rpick.rules.example import Example
from tests import made_car
from tests.command import (
    ENERGY,
    MATSUM,
    OSCILLATOR,
    list_warning_codes,
    put,
    read_refusal,
    run,
    run_json,
)
from tests.decks import write
from tests.histories.test_listings import listing
from tests.sample_deck import DECK

TD = ("--td", "0.0687534")

ASKED = {
    "suggest": ("--td", "0.37", "--part", "all", "--no-verify"),
    "verify": ("--tr", "0.1", "--td", "0.37", "--part", "all", "--no-verify"),
    "explore": (
        "--td-window",
        "0.3",
        "0.37",
        "--steps",
        "2",
        "--part",
        "all",
        "--no-verify",
    ),
    "plan": ("--part", "all", "--no-verify"),
    "parts": ("--part", "all"),
}
# Decks with the part numbers of the box under other titles, and with its titles under other numbers.
OTHER = {
    "titles": DECK.read_text("utf-8")
    .replace("\nbox\n", "\nfloor\n")
    .replace("\nstep\n", "\nrail\n"),
    "numbers": f"*KEYWORD\n*INCLUDE_TRANSFORM\n{DECK}\n{0:10d}{0:10d}{10:10d}\n*END\n",
}
TIME = np.linspace(0.0, 1.0, 1001)
PARTS = (Part(1, "body"), Part(2, "other"))
PUSH = np.where(TIME < 0.2, 400 * np.sin(np.pi * TIME / 0.2), 0.0).cumsum() / 1000
PLAIN = Settings(replay=False)
HELD = (
    "/GRNOD/NODE/1\nnodes\n         1\n/BCS/7\nheld\n   111 000         0         1\n"
)
MOVED = "/GRNOD/NODE/1\nnodes\n         1\n/IMPVEL/7\nmoved\n         1         X         0         0         1\n"


def place_example(folder: Path, example: Example) -> str:
    return write(folder, example.deck, example.files, example.name)


def list_warnings(*args: str) -> dict[str, str]:
    return {
        warning["code"]: warning["message"] for warning in run_json(*args)["warnings"]
    }


def list_doubts(deck: str, *parts: int) -> dict[str, Caution]:
    return {
        doubt.code: doubt for doubt in warn_about_solver(parts, read_inventory(deck))
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rule", "code"),
    [("D2R406", "body-through-wall"), ("D2R407", "body-without-velocity")],
)
def test_what_ruins_a_run_is_told_in_the_words_of_the_check(
    tmp_path: Path, rule: str, code: str
) -> None:
    deck = place_example(tmp_path, RULES[rule].failing[0])
    (finding,) = [
        finding_row
        for finding_row in check_deck(deck).findings
        if finding_row.rule == rule
    ]
    deck_message = f"{finding.file}:{finding.line}: {finding.message}"
    assert list_doubts(deck)[code].message == deck_message
    for args in (
        ("suggest", *TD),
        ("verify", "--tr", "0.0135867", *TD),
        ("plan",),
        ("parts",),
    ):
        if args[0] != "parts":  # parts requires energies of parts
            assert list_warnings(*args, "--deck", deck, ENERGY)[code] == deck_message
    assert list_doubts(place_example(tmp_path, RULES[rule].passing[0])) == {}


def test_solids_whose_stresses_do_not_turn_are_told_of_the_parts_in_question(
    tmp_path: Path,
) -> None:
    brick = (
        "/BRICK/1\n" + "".join(f"{n:10d}" for n in (9, 1, 2, 3, 4, 5, 6, 7, 8)) + "\n"
    )
    good = RULES["D2R401"].passing[0]
    deck = write(
        tmp_path,
        good.deck.replace("/END", f"/PROP/SOLID/1\nsolid\n\n{brick}/END"),
        good.files,
        good.name,
    )
    assert (
        "part 1: the stresses of these solids do not rotate"
        in list_doubts(deck, 1)["stresses-unturned"].message
    )
    assert list_doubts(deck, 7) == {}
    assert [finding.rule for finding in check_deck(deck).findings] == ["D2R116"]


def test_a_card_keeps_off_what_the_run_of_the_deck_keeps_off(tmp_path: Path) -> None:
    good = RULES["D2R401"].passing[0]
    deck = write(
        tmp_path,
        good.deck,
        {"box_0001.rad": "/RUN/box/1\n0.15\n/RBODY/OFF\n1808 1809\n1810\n"},
        good.name,
    )
    card_options = (
        "-q",
        "--deck",
        deck,
        "--solver",
        "radioss",
        "--node",
        "1808",
        "-f",
        "card",
        ENERGY,
    )
    for args in (("suggest", *TD), ("plan",)):
        printed = run(*args, *card_options)
        # The deck has no bodies with the main nodes 1809 and 1810 (D2R402).
        assert printed.exit_code == 1, printed.stderr
        assert printed.stdout.count("/RBODY/OFF\n1808 1809 1810\n") == 2
        assert printed.stdout.count("/RBODY/ON\n1808\n/RBODY/OFF\n1809 1810\n") == 1


def test_a_deck_is_written_and_what_ruins_it_is_an_objection(tmp_path: Path) -> None:
    for rule, expected in (
        ("D2R406", 1),
        ("D2R408", 0),
    ):  # the deck of the other run has a wheel with main node 1809
        example = RULES[rule].failing[0]
        files = {"box_0001.rad": "/RUN/box/1\n0.15\n/RBODY/OFF\n1808 1809\n"}
        deck = write(tmp_path, example.deck, files, example.name)
        written = tmp_path / rule
        result = run(
            "plan",
            *("-q", "--min-quality", "poor"),
            "--node",
            "1808",
            "--deck",
            deck,
            "--write-deck",
            str(written),
            ENERGY,
        )
        # The length of the path decides where the lines break.
        answer = " ".join(result.stdout.split())
        assert (result.exit_code, "error D2R406" in answer) == (
            expected,
            bool(expected),
        ), result.stderr
        legs = sorted(path.read_text() for path in written.glob("box_000[1-9].rad"))
        assert [leg.count("1809") for leg in legs] == [1] * len(legs)


# Engine versions that report wrong energies.


@pytest.mark.slow
def test_an_engine_with_wrong_energies_is_told_with_every_answer(
    tmp_path: Path,
) -> None:
    history = str(tmp_path / "CART02.csv")
    shutil.copy(ENERGY, history)
    (tmp_path / "CAR_0002.out").write_text(
        listing("1986-2025 Altair Engineering, Inc.")
    )
    pair = ("--tr", "0.0135867", *TD)
    deck = place_example(tmp_path, RULES["D2R401"].passing[0])
    commands = (
        *(
            ("info", history),
            ("suggest", *TD, history),
            ("suggest", history),
            ("verify", *pair, history),
        ),
        *(
            ("plan", history),
            ("verify", *pair, ENERGY, "--switched", history),
            ("check", deck, "--history", history),
        ),
    )
    for args in commands:
        assert (
            "CAR_0002.out: built in 2025" in list_warnings(*args)["engine-wrong-energy"]
        ), args
    codes = [warning["code"] for warning in run_json("plan", history)["warnings"]]
    assert (
        codes.count("engine-wrong-energy") == 1
    )  # one warning for any number of flights
    assert "engine-wrong-energy" not in list_warnings("suggest", *TD, ENERGY)


# Bodies that no engine file switches.


@pytest.mark.parametrize(
    ("part", "found"),
    [(3, ["D2R409 error"]), (2, []), (13, ["D2R408 warning"])],
    ids=["it deforms in the history", "it has no energy there", "it is not there"],
)
def test_a_body_that_no_leg_switches_is_judged_by_the_energy_of_its_parts(
    tmp_path: Path, part: int, found: list[str]
) -> None:
    example = RULES["D2R408"].failing[0]
    text = (
        example.deck.replace("/PART/1\nbox\n", "/PART/1\nframe\n")
        .replace("/PART/2", f"/PART/{part}")
        .replace("/SHELL/2", f"/SHELL/{part}")
    )
    deck = write(tmp_path, text, example.files, example.name)
    history = str(tmp_path / "matsum")
    assert (
        run(
            "replay", *OSCILLATOR, "--t-end", "0.3", "--dt", "1e-4", "-o", history
        ).exit_code
        == 0
    )
    listed = run_json("check", deck, "--history", history, "--select", "D2R408,D2R409")[
        "findings"
    ]
    assert [f"{finding['rule']} {finding['severity']}" for finding in listed] == found


@pytest.fixture(params=OTHER)
def foreign(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return str(put(tmp_path / "main.k", OTHER[request.param]))


def drop_warnings(document: dict[str, Any]) -> dict[str, Any]:
    return {**document, "command": None, "warnings": None}


@pytest.mark.slow
@pytest.mark.parametrize("command", ASKED)
def test_the_answer_is_that_without_a_deck(command: str, foreign: str) -> None:
    args = command, *ASKED[command], "--deck", foreign, MATSUM
    without = command, *ASKED[command], MATSUM
    document, plain = run_json(*args), run_json(*without)
    assert drop_warnings(document) == drop_warnings(plain)
    assert list_warning_codes(document) == list_warning_codes(plain) | {
        "deck-of-another-model"
    }


@pytest.mark.slow
def test_pages_and_cards_are_those_without_a_deck(foreign: str, tmp_path: Path) -> None:
    arguments = ("suggest", *ASKED["suggest"], MATSUM)
    assert (
        run(*arguments, "--deck", foreign, "-f", "card").stdout
        == run(*arguments, "-f", "card").stdout
    )
    page = tmp_path / "page.html"
    run(*arguments, "--deck", foreign, "--report", str(page))
    assert "the deck is not used" in page.read_text("utf-8")
    assert "of the reference's run time" not in page.read_text("utf-8")


def test_what_needs_the_deck_is_refused(foreign: str, tmp_path: Path) -> None:
    for command in (
        ("suggest", "--td", "0.37", "--part", "recommended", "--deck", foreign, MATSUM),
        (
            "plan",
            "--part",
            "all",
            "--deck",
            foreign,
            "--write-deck",
            str(tmp_path / "next"),
            MATSUM,
        ),
    ):
        assert "the deck is not used" in read_refusal(*command)
    assert not (tmp_path / "next").exists()


def test_check_judges_no_time_by_the_history_of_another_model(foreign: str) -> None:
    refusal = read_refusal("check", foreign, "--history", MATSUM)
    by_plan = list_warnings("plan", "--part", "all", "--deck", foreign, MATSUM)
    difference = by_plan["deck-of-another-model"].partition(": the deck is not used")[0]
    assert f"the history is of another model: {difference}; give the history" in refusal
    both = run_json("check", foreign, str(DECK), "--history", MATSUM)
    assert [Path(deck).name for deck in both["decks"]] == [DECK.name]


def test_the_library_leaves_it_out_too(foreign: str) -> None:
    arguments: dict[str, Any] = {"td": 0.37, "parts": "all", "replay": False}
    suggestion, without = (
        d2.suggest(d2.read(MATSUM), **arguments, deck=foreign),
        d2.suggest(d2.read(MATSUM), **arguments),
    )
    assert drop_warnings(suggestion.to_dict()) == drop_warnings(without.to_dict())


def test_one_part_with_another_title_is_a_warning_only() -> None:
    suggestion = run_json(
        "suggest", "--td", "0.37", "--part", "box", "--deck", str(DECK), MATSUM
    )
    assert "deck-of-another-model" not in list_warning_codes(suggestion)
    assert suggestion["candidates"][0]["run_time_share"] < 1


@pytest.mark.parametrize(
    ("group", "foreign"), [("/THPART/GRSHEL/2\nstep\n         7\n", False), ("", True)]
)
def test_a_group_of_elements_that_the_history_lists_is_no_missing_part(
    group: str, foreign: bool, tmp_path: Path
) -> None:
    (tmp_path / "TEST_0000.rad").write_text(
        f"#RADIOSS STARTER\n/BEGIN\nTEST\n/PART/1\nbox\n         1         1\n{group}/END\n"
    )
    arguments = (
        "suggest",
        "--td",
        "0.37",
        "--part",
        "box",
        "--deck",
        str(tmp_path / "TEST_0000.rad"),
    )
    assert (
        "deck-of-another-model"
        in list_warning_codes(run_json(*arguments, MATSUM.replace(".matsum", "T01")))
    ) == foreign


def test_titles_are_compared_without_letters_that_files_encode_in_different_ways(
    tmp_path: Path,
) -> None:
    text = DECK.read_text("utf-8").replace("\nbox\n", "\nbox \u7bb1\n")
    (tmp_path / "main.k").write_bytes(text.encode("gbk"))
    assert "deck-of-another-model" not in list_warning_codes(
        run_json(
            "suggest",
            "--td",
            "0.37",
            "--part",
            "box",
            "--deck",
            str(tmp_path / "main.k"),
            MATSUM,
        )
    )


MOVED += f"{0:20d}{1:20d}{0:20d}{{stop:20g}}\n"


def make_gravity(*values: float) -> Surroundings:
    return Surroundings({1: values, 2: values, None: values})


def make_falling_momenta(acceleration: float, surroundings: Surroundings) -> Momenta:
    """Return the momentum of a part of mass 10 that is pushed, then falls."""
    values = np.zeros((TIME.size, 1, 3))
    values[:, 0, 2] = PUSH - 10.0 * acceleration * TIME
    return Momenta(
        TIME,
        values,
        PARTS[:1],
        EXACT,
        (0,),
        masses=np.array([10.0]),
        surroundings=surroundings,
    )


@pytest.mark.parametrize("acceleration", [9.81, 3.71, 1.62, 24.8])
def test_the_gravity_of_the_deck_is_what_is_believed(acceleration: float) -> None:
    """The acceleration may be another planet's or a load's; without a deck only the earth's is accepted."""
    flight_found = find_flight_around(
        make_falling_momenta(acceleration, make_gravity(acceleration)), 0.6
    )
    assert flight_found
    assert flight_found.gravity == pytest.approx(acceleration, rel=1e-3)
    assert bool(
        find_flight_around(make_falling_momenta(acceleration, Surroundings()), 0.6)
    ) is (acceleration == 9.81)
    assert (
        find_flight_around(make_falling_momenta(acceleration, make_gravity(0.0)), 0.6)
        is None
    )
    assert (
        find_flight_around(make_falling_momenta(acceleration, make_gravity(5.0)), 0.6)
        is None
    )


def test_what_keeps_its_momentum_under_gravity_is_carried() -> None:
    assert find_flight_around(make_falling_momenta(0.0, make_gravity(0.0)), 0.6)
    assert find_flight_around(
        make_falling_momenta(0.0, make_gravity(0.0, 9.81)), 0.6
    )  # it acts for a limited time only
    assert (
        find_flight_around(make_falling_momenta(0.0, make_gravity(9.81)), 0.6) is None
    )
    constant = replace(
        make_falling_momenta(0.0, make_gravity(9.81)),
        values=np.full((TIME.size, 1, 3), 5.0),
    )
    assert find_flight_around(constant, 0.6) is None
    assert find_flight_around(replace(constant, surroundings=make_gravity(0.0)), 0.6)


def make_flying_history(
    surroundings: Surroundings, parts: tuple[Part, ...] | None = PARTS[:1]
) -> History:
    """Return a part that flies from 0.2 on and vibrates."""
    evidence = Given((make_falling_momenta(0.0, surroundings),))
    energy = 2 + np.sin(300 * TIME) ** 2
    return History(
        TIME,
        energy,
        ("made",),
        "made",
        "E",
        parts,
        evidence=evidence,
        surroundings=surroundings,
    )


def test_a_part_that_is_held_does_not_fly_also_where_the_end_of_the_load_is_given() -> (
    None
):
    held = Surroundings(supports={1: (Support("/BCS/7 (deck:12)"),)})
    assert suggest_in_history(
        make_flying_history(Surroundings()), 0.8, PLAIN
    ).recommended
    for settings in (PLAIN, replace(PLAIN, after=0.3)):
        suggestion = suggest_in_history(make_flying_history(held), 0.8, settings)
        assert suggestion.recommended is None
        (why,) = [
            caution.message
            for caution in suggestion.cautions
            if caution.code == "no-free-flight"
        ]
        assert "part 1 is held or moved by /BCS/7 (deck:12)" in why
    assert find_flights(make_flying_history(held), PLAIN) == ()


@pytest.mark.parametrize("settings", [PLAIN, replace(PLAIN, after=0.3)])
def test_a_flight_begins_where_an_imposed_motion_ends_and_ends_where_one_begins(
    settings: Settings,
) -> None:
    moved = Surroundings(supports={1: (Support("a", 0.0, 0.4), Support("b", 0.9, 2.0))})
    flight = examine_td(make_flying_history(moved), 0.7, settings).flight
    assert (flight.start, flight.end) == (0.4, 0.9)
    assert examine_td(make_flying_history(moved), 0.35, settings).flight.refusal
    assert [
        (flight_row.start, flight_row.end)
        for flight_row in find_flights(make_flying_history(moved), settings)
    ] == [(0.4, 0.9)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    car_folder = tmp_path_factory.mktemp("car")
    made_car.write_t01(car_folder, 3.0)
    body = made_car.compute_momenta(3.0)[:, : len(made_car.BODY)].sum(axis=1)
    kinetic = (body**2).sum(axis=1) / (2 * made_car.MASSES.sum())
    internal = 50 + 20 * np.cos(2 * np.pi * 90 * made_car.TIME)
    table = np.column_stack([made_car.TIME, internal, kinetic, body])
    header = "time,internal_energy,kinetic_energy,x_momentum,y_momentum,z_momentum"
    for name, columns in (("totals.csv", 3), ("momenta.csv", 6)):
        text = header.split(",")[:columns]
        np.savetxt(
            car_folder / name,
            table[:, :columns],
            delimiter=",",
            header=",".join(text),
            comments="",
        )
    return car_folder


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments", [("MADET01", "--part", "1"), ("totals.csv",), ("momenta.csv",)]
)
def test_a_support_refuses_the_flight_in_any_form_of_input(
    folder: Path, tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    wheels = "/GRNOD/NODE/1\nnodes\n        21        31\n/BCS/7\nheld\n   111 000         0         1\n"
    deck = made_car.write_starter(
        tmp_path,
        HELD + wheels.replace("/1\n", "/2\n").replace("0         1\n", "0         2\n"),
    )
    name, *options = arguments
    for command in (("suggest", "--td", "0.12"), ("explore",)):
        result = run(
            *command, "--no-verify", str(folder / name), *options, "--deck", deck
        )
        assert result.exit_code in (1, 2), result.stderr
        assert "held or moved by /BCS/7 (" in result.stderr
        assert "MADE_0000.rad:" in result.stderr
    assert (
        run_json("info", str(folder / name), *options, "--deck", deck)["flights"] == []
    )
    reference = d2.read(str(folder / name))
    with pytest.raises(D2RPickError, match=r"held or moved by /BCS/7"):
        d2.suggest(reference, parts=options[1:] or None, deck=deck, replay=False)
    d2.suggest(
        reference, 0.12, parts=options[1:] or None, replay=False
    )  # the run that was read is unchanged


@pytest.mark.slow
def test_parts_that_nothing_holds_fly(folder: Path, tmp_path: Path) -> None:
    history, deck = str(folder / "MADET01"), made_car.write_starter(tmp_path, HELD)
    assert run_json(
        "suggest",
        "--no-verify",
        "--part",
        "8,9",
        "--td",
        "0.05",
        "--deck",
        deck,
        history,
    )["recommended"]
    rows = {
        row["id"]: row
        for row in run_json("parts", "--no-verify", "--deck", deck, history)["parts"]
    }
    assert "held or moved by /BCS/7" in rows[1]["reasons"][0]
    assert {rows[part]["verdict"] for part in made_car.BODY} == {"keep"}
    assert "/BCS/7" not in str(rows[8]["reasons"])


@pytest.mark.slow
def test_the_flight_begins_where_the_deck_lets_go(folder: Path, tmp_path: Path) -> None:
    history, deck = (
        str(folder / "MADET01"),
        made_car.write_starter(tmp_path, MOVED.format(stop=0.04)),
    )
    arguments = ("suggest", "--no-verify", "--part", "1-6", "--td", "0.12", history)
    assert run_json(*arguments)["flight"]["start"] == pytest.approx(0.0, abs=1e-3)
    assert run_json(*arguments, "--deck", deck)["flight"]["start"] == 0.04


@pytest.mark.slow
def test_flying_is_the_heaviest_of_the_bodies_of_the_deck(
    folder: Path, tmp_path: Path
) -> None:
    arguments = (
        "suggest",
        "--no-verify",
        "--part",
        "flying",
        "--td",
        "0.05",
        str(folder / "MADET01"),
        "--deck",
    )
    for deck in (made_car.write_starter(tmp_path), made_car.write_keywords(tmp_path)):
        assert [
            part["id"] for part in run_json(*arguments, deck)["history"]["parts"]
        ] == list(made_car.BODY)
    held = made_car.write_starter(tmp_path, HELD)
    assert {
        part["id"] for part in run_json(*arguments, held)["history"]["parts"]
    } == set(made_car.WHEELS)


@pytest.mark.parametrize("rule", ["D2R406", "D2R407"])
def test_no_pair_is_better_than_poor_where_the_deck_ruins_the_run(
    tmp_path: Path, rule: str
) -> None:
    example = RULES[rule].failing[0]
    deck = write(tmp_path, example.deck, example.files, example.name)
    plain, with_deck = (
        run_json("suggest", "--td", "0.0687534", ENERGY, *options)
        for options in ((), ("--deck", deck))
    )
    assert plain["quality"] != "poor"
    assert with_deck["quality"] == "poor"
    assert rule in with_deck["quality_reasons"][0]
    plan_text = str(run_json("plan", ENERGY, "--deck", deck))
    assert "'quality': 'poor'" in plan_text
    assert "'quality': 'good'" not in plan_text


@pytest.mark.slow
def test_parts_that_a_deck_keeps_rigid_although_they_deform_make_a_pair_poor(
    folder: Path, tmp_path: Path
) -> None:
    bodies = "".join(
        f"/GRNOD/PART/{number}\nparts\n{parts}\n/RBODY/{number}\nbody\n{node:10d}{'':50}{number:10d}\n"
        for number, node, parts in (
            (1, 91, "         1         2"),
            (2, 92, "         8"),
        )
    )
    deck = made_car.write_starter(tmp_path, bodies)
    for number, word, nodes in ((1, "OFF", "91"), (2, "ON", "91"), (3, "OFF", "91")):
        leg = f"/RUN/MADE/{number}\n{0.02 + 0.05 * (number - 1)}\n/RBODY/{word}\n{nodes}\n"
        (tmp_path / f"MADE_000{number}.rad").write_text(leg)
    history = str(folder / "MADET01")
    suggestion = run_json(
        "suggest", "--part", "1-6", "--td", "0.12", "--deck", deck, history
    )
    assert suggestion["quality"] == "poor"
    assert "D2R409" in suggestion["quality_reasons"][0]
    (message,) = [
        reported["message"]
        for reported in suggestion["warnings"]
        if reported["code"] == "body-left-rigid"
    ]
    (error,) = [
        reported
        for reported in run_json("check", deck, "--history", history)["findings"]
        if reported["rule"] == "D2R409"
    ]
    assert error["severity"] == "error"
    assert error["message"] in message


@pytest.mark.slow
def test_check_and_suggest_agree_on_what_is_held(folder: Path, tmp_path: Path) -> None:
    cards = "".join(
        f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{number:10d}{0:10d}{time:10g}\n{'':40}{rigid:10d}{1 - rigid:10d}\n"
        f"{1:10d}{0 if rigid else '':>10}{'PART':>10}\n".replace(
            f"{1:10d}{'':10}{'PART':>10}", f"{1:10d}{'PART':>10}"
        )
        for number, time, rigid in ((901, 0.02, 1), (902, 0.12, 0))
    )
    for held in (False, True):
        spc = (
            "*BOUNDARY_SPC_NODE\n         1         0         1         1         1\n"
            * held
        )
        deck = made_car.write_keywords(tmp_path, cards + spc)
        result = run("check", deck, "--history", str(folder / "MADET01"), "-f", "json")
        assert ("held or moved by *BOUNDARY_SPC_NODE" in result.stdout) is held
