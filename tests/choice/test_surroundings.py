"""What a deck tells of flights: gravity that is accepted, supports that refuse them, bodies, and grades."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import d2rpick as d2
from d2rpick.choice.flights import find_flights
from d2rpick.choice.settings import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.suggest import suggest
from d2rpick.errors import D2RPickError
from d2rpick.flight.momentum import flight_around
from d2rpick.histories.history import EXACT, Given, History, Momenta
from d2rpick.histories.names import Part
from d2rpick.histories.surroundings import Support, Surroundings
from d2rpick.rules import RULES
from tests import made_car
from tests.command import ENERGY, answer, run
from tests.decks import write

if TYPE_CHECKING:
    from pathlib import Path

TIME = np.linspace(0.0, 1.0, 1001)
PARTS = (Part(1, "body"), Part(2, "other"))
PUSH = np.where(TIME < 0.2, 400 * np.sin(np.pi * TIME / 0.2), 0.0).cumsum() / 1000
PLAIN = Settings(replay=False)
HELD = "/GRNOD/NODE/1\nnodes\n         1\n/BCS/7\nheld\n   111 000         0         1\n"
MOVED = "/GRNOD/NODE/1\nnodes\n         1\n/IMPVEL/7\nmoved\n         1         X         0         0         1\n"
MOVED += f"{0:20d}{1:20d}{0:20d}{{stop:20g}}\n"


def gravity(*values: float) -> Surroundings:
    return Surroundings({1: values, 2: values, None: values})


def falling(acceleration: float, surroundings: Surroundings) -> Momenta:
    """Momentum of a part of mass 10 that is pushed, and falls."""
    values = np.zeros((TIME.size, 1, 3))
    values[:, 0, 2] = PUSH - 10.0 * acceleration * TIME
    return Momenta(TIME, values, PARTS[:1], EXACT, (0,), masses=np.array([10.0]), surroundings=surroundings)


@pytest.mark.parametrize("acceleration", [9.81, 3.71, 1.62, 24.8])
def test_the_gravity_of_the_deck_is_what_is_believed(acceleration: float) -> None:
    """Of another planet, or another load: without a deck only that of the earth is."""
    known = flight_around(falling(acceleration, gravity(acceleration)), 0.6)
    assert known
    assert known.gravity == pytest.approx(acceleration, rel=1e-3)
    assert bool(flight_around(falling(acceleration, Surroundings()), 0.6)) is (acceleration == 9.81)
    assert flight_around(falling(acceleration, gravity(0.0)), 0.6) is None
    assert flight_around(falling(acceleration, gravity(5.0)), 0.6) is None


def test_what_keeps_its_momentum_under_gravity_is_carried() -> None:
    assert flight_around(falling(0.0, gravity(0.0)), 0.6)
    assert flight_around(falling(0.0, gravity(0.0, 9.81)), 0.6)  # it acts for a time only
    assert flight_around(falling(0.0, gravity(9.81)), 0.6) is None
    constant = replace(falling(0.0, gravity(9.81)), values=np.full((TIME.size, 1, 3), 5.0))
    assert flight_around(constant, 0.6) is None
    assert flight_around(replace(constant, surroundings=gravity(0.0)), 0.6)


def flying_history(surroundings: Surroundings, parts: tuple[Part, ...] | None = PARTS[:1]) -> History:
    """A part that flies from 0.2 on, and rings."""
    evidence = Given((falling(0.0, surroundings),))
    energy = 2 + np.sin(300 * TIME) ** 2
    return History(TIME, energy, ("made",), "made", "E", parts, evidence=evidence, surroundings=surroundings)


def test_a_part_that_is_held_does_not_fly_also_where_the_end_of_the_load_is_given() -> None:
    held = Surroundings(supports={1: (Support("/BCS/7 (deck:12)"),)})
    assert suggest(flying_history(Surroundings()), 0.8, PLAIN).recommended
    for settings in (PLAIN, replace(PLAIN, after=0.3)):
        found = suggest(flying_history(held), 0.8, settings)
        assert found.recommended is None
        (why,) = [one.message for one in found.cautions if one.code == "no-free-flight"]
        assert "part 1 is held or moved by /BCS/7 (deck:12)" in why
    assert find_flights(flying_history(held), PLAIN) == ()


@pytest.mark.parametrize("settings", [PLAIN, replace(PLAIN, after=0.3)])
def test_a_flight_begins_where_an_imposed_motion_ends_and_ends_where_one_begins(settings: Settings) -> None:
    moved = Surroundings(supports={1: (Support("a", 0.0, 0.4), Support("b", 0.9, 2.0))})
    flight = examine(flying_history(moved), 0.7, settings).flight
    assert (flight.start, flight.end) == (0.4, 0.9)
    assert examine(flying_history(moved), 0.35, settings).flight.refusal
    assert [(one.start, one.end) for one in find_flights(flying_history(moved), settings)] == [(0.4, 0.9)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("car")
    made_car.t01(found, 3.0)
    body = made_car.momenta(3.0)[:, : len(made_car.BODY)].sum(axis=1)
    kinetic = (body**2).sum(axis=1) / (2 * made_car.MASSES.sum())
    internal = 50 + 20 * np.cos(2 * np.pi * 90 * made_car.TIME)
    table = np.column_stack([made_car.TIME, internal, kinetic, body])
    header = "time,internal_energy,kinetic_energy,x_momentum,y_momentum,z_momentum"
    for name, columns in (("totals.csv", 3), ("momenta.csv", 6)):
        text = header.split(",")[:columns]
        np.savetxt(found / name, table[:, :columns], delimiter=",", header=",".join(text), comments="")
    return found


@pytest.mark.parametrize("asked", [("MADET01",), ("MADET01", "--part", "1"), ("totals.csv",), ("momenta.csv",)])
def test_a_support_refuses_the_flight_in_any_form_of_input(
    folder: Path, tmp_path: Path, asked: tuple[str, ...]
) -> None:
    wheels = "/GRNOD/NODE/1\nnodes\n        21        31\n/BCS/7\nheld\n   111 000         0         1\n"
    deck = made_car.starter(tmp_path, HELD + wheels.replace("/1\n", "/2\n").replace("0         1\n", "0         2\n"))
    name, *options = asked
    for command in (("suggest", "--td", "0.12"), ("verify", "--tr", "0.02", "--td", "0.12"), ("explore",)):
        found = run(*command, str(folder / name), *options, "--deck", deck)
        assert found.exit_code in (1, 2), found.stderr
        assert "held or moved by /BCS/7 (" in found.stderr
        assert "MADE_0000.rad:" in found.stderr
    assert answer("info", str(folder / name), *options, "--deck", deck)["flights"] == []
    reference = d2.read(str(folder / name))
    with pytest.raises(D2RPickError, match=r"held or moved by /BCS/7"):
        d2.suggest(reference, parts=options[1:] or None, deck=deck)
    d2.suggest(reference, 0.12, parts=options[1:] or None)  # the run that was read is as it was


def test_parts_that_nothing_holds_fly(folder: Path, tmp_path: Path) -> None:
    history, deck = str(folder / "MADET01"), made_car.starter(tmp_path, HELD)
    assert answer("suggest", "--part", "8,9", "--td", "0.05", "--deck", deck, history)["recommended"]
    rows = {row["id"]: row for row in answer("parts", "--deck", deck, history)["parts"]}
    assert "held or moved by /BCS/7" in rows[1]["reasons"][0]
    assert {rows[part]["verdict"] for part in made_car.BODY} == {"keep"}
    assert "/BCS/7" not in str(rows[8]["reasons"])


def test_the_flight_begins_where_the_deck_lets_go(folder: Path, tmp_path: Path) -> None:
    history, deck = str(folder / "MADET01"), made_car.starter(tmp_path, MOVED.format(stop=0.04))
    asked = ("suggest", "--part", "1-6", "--td", "0.12", history)
    assert answer(*asked)["flight"]["start"] == pytest.approx(0.0, abs=1e-3)
    assert answer(*asked, "--deck", deck)["flight"]["start"] == 0.04


def test_flying_is_the_heaviest_of_the_bodies_of_the_deck(folder: Path, tmp_path: Path) -> None:
    asked = ("suggest", "--part", "flying", "--td", "0.05", str(folder / "MADET01"), "--deck")
    for deck in (made_car.starter(tmp_path), made_car.keywords(tmp_path)):
        assert [part["id"] for part in answer(*asked, deck)["history"]["parts"]] == list(made_car.BODY)
    held = made_car.starter(tmp_path, HELD)
    assert {part["id"] for part in answer(*asked, held)["history"]["parts"]} == set(made_car.WHEELS)


@pytest.mark.parametrize("rule", ["D2R406", "D2R407"])
def test_no_pair_is_better_than_poor_where_the_deck_ruins_the_run(tmp_path: Path, rule: str) -> None:
    example = RULES[rule].failing[0]
    deck = write(tmp_path, example.deck, example.files, example.name)
    plain, found = (answer("suggest", "--td", "0.0687534", ENERGY, *more) for more in ((), ("--deck", deck)))
    assert plain["quality"] != "poor"
    assert found["quality"] == "poor"
    assert rule in found["quality_reasons"][0]
    for command in (("verify", "--tr", "0.0135867", "--td", "0.0687534"), ("plan",)):
        told = answer(*command, ENERGY, "--deck", deck)
        assert "'quality': 'poor'" in str(told)
        assert "'quality': 'good'" not in str(told)


def test_parts_that_a_deck_keeps_rigid_although_they_deform_make_a_pair_poor(folder: Path, tmp_path: Path) -> None:
    bodies = "".join(
        f"/GRNOD/PART/{number}\nparts\n{parts}\n/RBODY/{number}\nbody\n{node:10d}{'':50}{number:10d}\n"
        for number, node, parts in ((1, 91, "         1         2"), (2, 92, "         8"))
    )
    deck = made_car.starter(tmp_path, bodies)
    for number, word, nodes in ((1, "OFF", "91"), (2, "ON", "91"), (3, "OFF", "91")):
        leg = f"/RUN/MADE/{number}\n{0.02 + 0.05 * (number - 1)}\n/RBODY/{word}\n{nodes}\n"
        (tmp_path / f"MADE_000{number}.rad").write_text(leg)
    history = str(folder / "MADET01")
    found = answer("suggest", "--part", "1-6", "--td", "0.12", "--deck", deck, history)
    assert found["quality"] == "poor"
    assert "D2R408" in found["quality_reasons"][0]
    (told,) = [one["message"] for one in found["warnings"] if one["code"] == "body-left-rigid"]
    (error,) = [one for one in answer("check", deck, "--history", history)["findings"] if one["rule"] == "D2R408"]
    assert error["severity"] == "error"
    assert error["message"] in told


def test_check_and_suggest_agree_on_what_is_held(folder: Path, tmp_path: Path) -> None:
    cards = "".join(
        f"*DEFORMABLE_TO_RIGID_AUTOMATIC\n{number:10d}{0:10d}{time:10g}\n{'':40}{rigid:10d}{1 - rigid:10d}\n"
        f"{1:10d}{0 if rigid else '':>10}{'PART':>10}\n".replace(f"{1:10d}{'':10}{'PART':>10}", f"{1:10d}{'PART':>10}")
        for number, time, rigid in ((901, 0.02, 1), (902, 0.12, 0))
    )
    for held in (False, True):
        spc = "*BOUNDARY_SPC_NODE\n         1         0         1         1         1\n" * held
        deck = made_car.keywords(tmp_path, cards + spc)
        found = run("check", deck, "--history", str(folder / "MADET01"), "-f", "json")
        assert ("held or moved by *BOUNDARY_SPC_NODE" in found.stdout) is held
