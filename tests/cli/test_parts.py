"""Parts to be switched and parts that fly with them: --part and --flying, seen from outside."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d2rpick.choice.question import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.warnings import cautions_of
from d2rpick.histories.history import EXACT, Given, History, Momenta
from d2rpick.histories.names import Part
from tests.command import BOX as ROLLOVER_T01, answer, codes, put, replayed, run
from tests.json_schemas import checked
from tests.records import ENERGY, TIME

pytestmark = pytest.mark.usefixtures("by_level")

BOX, STEP, SLED = (
    {"id": i, "title": title}
    for i, title in enumerate(("box", "step", "sled"), start=1)
)


def rolling(*options: str, command: str = "suggest") -> dict[str, Any]:
    """Answer for the computed rollover at td = 0.37, held against its schema."""
    tr = ("--tr", "0.1") if command == "verify" else ()
    return checked(command, "--td", "0.37", *tr, *options, ROLLOVER_T01)


@pytest.mark.parametrize("command", ["suggest", "verify"])
@pytest.mark.parametrize("part", ["box", "1", "BOX"])
def test_a_part_is_chosen_by_number_or_title_and_named_with_what_flies(
    part: str, command: str
) -> None:
    found = rolling("--part", part, command=command)
    assert found["history"]["parts"] == [BOX]
    assert found["history"]["channel"] == "internal energy of box"
    assert (found["flight"]["source"], found["flight"]["parts"]) == (
        "momentum",
        [BOX, STEP],
    )
    assert "flight-from-energy" not in codes(found)
    assert "no-free-flight" not in codes(found)


def test_energies_of_several_parts_are_added() -> None:
    both, box, step = (rolling("--part", part) for part in ("1,2", "1", "2"))
    assert both["history"]["parts"] == [BOX, STEP]
    assert both["energy_td"] == pytest.approx(
        box["energy_td"] + step["energy_td"], rel=1e-12
    )
    assert (
        rolling("--part", "1-2")["candidates"]
        == rolling("--part", "1", "--part", "step")["candidates"]
    )


def test_without_parts_the_whole_model_is_taken_and_parts_are_null() -> None:
    found = rolling()
    assert (found["history"]["parts"], found["history"]["channel"]) == (
        None,
        "internal_energy",
    )


def test_the_parts_that_fly_can_be_named() -> None:
    named = rolling("--part", "box", "--flying", "box,step,sled")["flight"]
    assert (named["source"], named["parts"]) == ("momentum", [BOX, STEP, SLED])
    assert named["end"] == pytest.approx(0.3819, abs=1e-3)


def test_parts_that_do_not_fly_together_are_no_flight_and_that_is_said() -> None:
    found = rolling("--part", "box", "--flying", "box")
    assert (found["flight"]["source"], found["recommended"]) == (None, None)
    assert {"no-free-flight", "no-flight"} <= codes(found)
    (message,) = (
        w["message"] for w in found["warnings"] if w["code"] == "no-free-flight"
    )
    assert message == "the momentum shows no free flight at td = 0.37"


def test_a_given_start_keeps_the_end_that_the_momentum_shows() -> None:
    flight = rolling("--part", "box", "--after", "0.12")["flight"]
    assert (flight["start"], flight["source"], flight["parts"]) == (
        0.12,
        "given",
        [BOX, STEP],
    )
    assert flight["end"] == pytest.approx(0.3819, abs=1e-3)


def test_td_behind_the_contact_that_the_momentum_shows_is_no_free_flight() -> None:
    source = ROLLOVER_T01
    found = answer("suggest", "--td", "0.3822", "--part", "box", source)
    assert found["flight"]["end"] == pytest.approx(0.3819, abs=1e-3)
    assert found["recommended"] is None
    (message,) = (
        w["message"] for w in found["warnings"] if w["code"] == "no-free-flight"
    )
    assert (
        "no free flight at td = 0.3822; the nearest flight lasts from 0.0910" in message
    )


def test_a_part_without_energy_is_named(tmp_path: Path) -> None:
    file = put(tmp_path / "matsum", replayed("matsum"))
    found = answer("suggest", "--td", "0.064", "--part", "1,3", str(file))
    (note,) = found["history"]["notes"]
    assert "frame" in note
    assert "spring" not in note


def test_an_oscillator_does_not_overrule_a_momentum_that_shows_no_flight() -> None:
    shaken = np.zeros((TIME.size, 1, 3))
    shaken[:, 0, 0] = np.sin(300 * TIME)
    momenta = (Momenta(TIME, shaken, (Part(1, "box"),), EXACT, chosen=(0,)),)
    history = History(
        TIME,
        ENERGY,
        source=("run",),
        format="matsum",
        channel="E",
        evidence=Given(momenta),
    )
    found = {
        c.code: c.message for c in cautions_of(examine(history, 0.0687, Settings()))
    }
    assert found["no-free-flight"] == "the momentum shows no free flight at td = 0.0687"
    assert not examine(history, 0.0687, Settings()).in_flight
    plain = History(TIME, ENERGY, source=("run",), format="matsum", channel="E")
    assert "no-free-flight" not in {
        c.code for c in cautions_of(examine(plain, 0.0687, Settings()))
    }
    given = examine(history, 0.0687, Settings(after=0.001))
    assert given.in_flight
    assert "flight-sources-disagree" in {c.code for c in cautions_of(given)}


def test_where_nothing_can_be_chosen_the_table_says_so(tmp_path: Path) -> None:
    file = put(tmp_path / "matsum", replayed("matsum"))
    result = run("suggest", "--td", "0.064", "--part", "frame", str(file))
    assert result.exit_code == 1
    reason = "before td = 0.064 the energy neither passes its level 0 nor peaks near it"
    assert result.stdout.startswith(f"no pair to use  {reason}\n")
    assert "rank" not in result.stdout
