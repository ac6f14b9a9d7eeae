"""Parts to be switched and parts that fly with them: --part and --flying for a user."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.pair.warnings import warn_about_td
from d2rpick.choice.question import Settings
from d2rpick.histories.history import EXACT, Given, History, Momenta
from d2rpick.histories.names import Part
from tests.command import (
    BOX as ROLLOVER_T01,
    list_warning_codes,
    make_replay_file,
    put,
    run,
    run_json,
)
from tests.json_schemas import run_json_checked
from tests.records import ENERGY, TIME

pytestmark = pytest.mark.usefixtures("by_level")

BOX, STEP, SLED = (
    {"id": i, "title": title}
    for i, title in enumerate(("box", "step", "sled"), start=1)
)


def run_rollover(*options: str, command: str = "suggest") -> dict[str, Any]:
    """Run a command on the computed rollover at td = 0.37 and validate its answer."""
    tr = ("--tr", "0.1") if command == "verify" else ()
    return run_json_checked(command, "--td", "0.37", *tr, *options, ROLLOVER_T01)


@pytest.mark.parametrize("command", ["suggest", "verify"])
@pytest.mark.parametrize("part", ["box", "1", "BOX"])
def test_a_part_is_chosen_by_number_or_title_and_named_with_what_flies(
    part: str, command: str
) -> None:
    document = run_rollover("--part", part, command=command)
    assert document["history"]["parts"] == [BOX]
    assert document["history"]["channel"] == "internal energy of box"
    assert (document["flight"]["source"], document["flight"]["parts"]) == (
        "momentum",
        [BOX, STEP],
    )
    assert "flight-from-energy" not in list_warning_codes(document)
    assert "no-free-flight" not in list_warning_codes(document)


def test_energies_of_several_parts_are_added() -> None:
    both_parts, box, step = (run_rollover("--part", part) for part in ("1,2", "1", "2"))
    assert both_parts["history"]["parts"] == [BOX, STEP]
    assert both_parts["energy_td"] == pytest.approx(
        box["energy_td"] + step["energy_td"], rel=1e-12
    )
    assert (
        run_rollover("--part", "1-2")["candidates"]
        == run_rollover("--part", "1", "--part", "step")["candidates"]
    )


def test_without_parts_the_whole_model_is_taken_and_parts_are_null() -> None:
    document = run_rollover()
    assert (document["history"]["parts"], document["history"]["channel"]) == (
        None,
        "internal_energy",
    )


def test_the_parts_that_fly_can_be_named() -> None:
    document = run_rollover("--part", "box", "--flying", "box,step,sled")["flight"]
    assert (document["source"], document["parts"]) == ("momentum", [BOX, STEP, SLED])
    assert document["end"] == pytest.approx(0.3819, abs=1e-3)


def test_parts_that_do_not_fly_together_are_no_flight_and_that_is_said() -> None:
    document = run_rollover("--part", "box", "--flying", "box")
    assert (document["flight"]["source"], document["recommended"]) == (None, None)
    assert {"no-free-flight", "no-flight"} <= list_warning_codes(document)
    (message,) = (
        w["message"] for w in document["warnings"] if w["code"] == "no-free-flight"
    )
    assert message == "the momentum shows no free flight at td = 0.37"


def test_a_given_start_keeps_the_end_that_the_momentum_shows() -> None:
    flight = run_rollover("--part", "box", "--after", "0.12")["flight"]
    assert (flight["start"], flight["source"], flight["parts"]) == (
        0.12,
        "given",
        [BOX, STEP],
    )
    assert flight["end"] == pytest.approx(0.3819, abs=1e-3)


def test_td_behind_the_contact_that_the_momentum_shows_is_no_free_flight() -> None:
    source = ROLLOVER_T01
    suggestion = run_json("suggest", "--td", "0.3822", "--part", "box", source)
    assert suggestion["flight"]["end"] == pytest.approx(0.3819, abs=1e-3)
    assert suggestion["recommended"] is None
    (message,) = (
        w["message"] for w in suggestion["warnings"] if w["code"] == "no-free-flight"
    )
    assert "no free flight at td = 0.3822; the nearest flight is 0.0910" in message


def test_a_part_without_energy_is_named(tmp_path: Path) -> None:
    file = put(tmp_path / "matsum", make_replay_file("matsum"))
    suggestion = run_json("suggest", "--td", "0.064", "--part", "1,3", str(file))
    (note,) = suggestion["history"]["notes"]
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
    messages = {
        c.code: c.message
        for c in warn_about_td(examine_td(history, 0.0687, Settings()))
    }
    assert (
        messages["no-free-flight"] == "the momentum shows no free flight at td = 0.0687"
    )
    assert not examine_td(history, 0.0687, Settings()).in_flight
    plain = History(TIME, ENERGY, source=("run",), format="matsum", channel="E")
    assert "no-free-flight" not in {
        c.code for c in warn_about_td(examine_td(plain, 0.0687, Settings()))
    }
    situation = examine_td(history, 0.0687, Settings(after=0.001))
    assert situation.in_flight
    assert "flight-sources-disagree" in {c.code for c in warn_about_td(situation)}


def test_where_nothing_can_be_chosen_the_table_says_so(tmp_path: Path) -> None:
    file = put(tmp_path / "matsum", make_replay_file("matsum"))
    result = run("suggest", "--td", "0.064", "--part", "frame", str(file))
    assert result.exit_code == 1
    reason = "before td = 0.064 the energy neither reaches its value at td, 0, nor peaks near it"
    assert result.stdout.startswith(f"no pair to use  {reason}\n")
    assert "rank" not in result.stdout
