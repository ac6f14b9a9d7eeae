"""The plan in Python says what the command line says."""

import json
from typing import Any

import pytest

import d2rpick as d2
from tests.command import ENERGY, answer, run

MATSUM = "sample_data/rollover_box.matsum"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ({"parts": "box"}, ("--part", "box")),
        ({"parts": "flying", "min_rigid": 0.1}, ("--part", "flying", "--min-rigid", "0.1")),
        (
            {"parts": "box", "margin": 0.02, "cost_share": 0.8},
            ("--part", "1", "--margin", "0.02", "--cost-share", "0.8"),
        ),
    ],
)
def test_arguments_mean_what_options_mean(arguments: dict[str, Any], options: tuple[str, ...]) -> None:
    found = d2.plan(d2.read(MATSUM), replay=False, **arguments)
    theirs = answer("plan", "--no-verify", *options, MATSUM)
    assert {**found.to_dict(), "command": None} == {**theirs, "command": None}
    assert {**answer(*found.command), "command": None} == {**theirs, "command": None}
    assert [(row["tr"], row["td"]) for row in theirs["windows"] if row["status"] == "supported"] == list(found.windows)
    assert found.rigid_fraction == pytest.approx(sum(td - tr for tr, td in found.windows) / 0.42, rel=1e-3)


def test_what_is_done_and_where_it_was_planned_is_in_the_command_that_repeats_it() -> None:
    energy = d2.read(ENERGY)  # without parts: nothing shows that it was not switched
    found = d2.plan(energy, done=[(0.0137, 0.03)], before=energy)
    assert found.command == ("plan", "--done", "-", "--before", ENERGY, ENERGY)
    theirs = json.loads(run(*found.command, "-f", "json", stdin=b"0.0137 0.03\n").stdout)
    assert {**theirs, "command": None} == {**found.to_dict(), "command": None}
