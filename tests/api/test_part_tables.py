"""The answers of ``d2.parts`` and ``d2.plan``: the same as the commands, as objects and frames."""

import json
from pathlib import Path
from typing import Any

import pytest

import d2rpick as d2
from d2rpick.choice.cost import Weights
from tests.command import ENERGY, MATSUM, answer, run
from tests.sample_deck import DECK


def test_the_same_as_the_command() -> None:
    found = d2.parts(d2.read(MATSUM), deck=DECK, td=0.37, replay=False)
    assert found.to_dict() == answer(*found.command) | {"command": list(found.command)}
    assert json.loads(found.to_json()) == found.to_dict()
    assert found.recommended is not None
    assert found.to_frame()["verdict"].tolist() == ["switch", "merge", "keep"]
    sets = found.sets_frame()
    assert sets["recommended"].tolist() == [one.recommended for one in found.sets]
    by_set: Any = {
        "parts": found.recommended.parts,
        "cost_share": found.recommended.cost_share,
    }
    assert d2.plan(d2.read(MATSUM), **by_set).windows


def test_weights_may_be_given_as_they_are(tmp_path: Path) -> None:
    weights = Weights({"BT": 1.0, "QBAT": 1.0}, rigid_node=0.0)
    found = d2.parts(
        d2.read(MATSUM), deck=DECK, weights=weights, step_ratio=2.0, replay=False
    )
    assert found.rows[0].cost_share == pytest.approx(94 / 109)
    assert d2.parts(d2.read(MATSUM), deck=DECK, given=2, replay=False).sets[
        -1
    ].parts == (2,)
    page = found.report(tmp_path / "parts.html").read_text("utf-8")
    assert "all eligible parts" in page
    assert "<h1>Parts to switch: rollover box</h1>" in page
    assert "<span>signature</span>" in page


@pytest.mark.slow
def test_weights_in_memory_are_not_left_out_of_the_command_line() -> None:
    """Typed without them it would give another run time; as it stands it is refused."""
    weights = Weights({"BT": 1.0, "QBAT": 1.0}, rigid_node=0.0)
    asked: Any = {
        "parts": "recommended",
        "deck": DECK,
        "weights": weights,
        "replay": False,
    }
    read = d2.read(MATSUM)
    answers: list[Any] = [
        d2.parts(read, deck=DECK, weights=weights, replay=False), d2.plan(read, **asked), d2.suggest(read, **asked),
        d2.verify(read, 0.097, 0.37, **asked), d2.explore(read, td_window=(0.3, 0.37), steps=2, **asked),
    ]  # fmt: skip
    for one in answers:
        assert one.command[one.command.index("--weights") + 1] == "<weights in memory>"
    assert run(*answers[2].command).exit_code == 2


@pytest.mark.slow
def test_explore_takes_a_deck_as_suggest_does() -> None:
    read = d2.read(MATSUM)
    asked: Any = {
        "td_window": (0.3, 0.37),
        "parts": "recommended",
        "deck": DECK,
        "replay": False,
    }
    found = d2.explore(read, td=0.36, steps=5, **asked)
    assert found.to_dict() == answer(*found.command) | {"command": list(found.command)}
    chosen = d2.suggest(read, **asked)
    best = next(one for one in chosen.candidates if one.recommended)
    assert found.recommended is not None
    assert (found.recommended.tr, found.recommended.td) == (best.tr, chosen.td)
    assert found.recommended.saving == pytest.approx(1 - (best.run_time_share or 0.0))
    assert {"weights-by-analogy"} <= {one.code for one in found.warnings} & {
        one.code for one in chosen.warnings
    }
    assert found.answer.endswith("and costs no run time")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ({"parts": "box"}, ("--part", "box")),
        (
            {"parts": "flying", "min_rigid": 0.1},
            ("--part", "flying", "--min-rigid", "0.1"),
        ),
        (
            {"parts": "box", "margin": 0.02, "cost_share": 0.8},
            ("--part", "1", "--margin", "0.02", "--cost-share", "0.8"),
        ),
    ],
)
def test_arguments_mean_what_options_mean(
    arguments: dict[str, Any], options: tuple[str, ...]
) -> None:
    found = d2.plan(d2.read(MATSUM), replay=False, **arguments)
    theirs = answer("plan", "--no-verify", *options, MATSUM)
    assert {**found.to_dict(), "command": None} == {**theirs, "command": None}
    assert {**answer(*found.command), "command": None} == {**theirs, "command": None}
    assert [
        (row["tr"], row["td"])
        for row in theirs["windows"]
        if row["status"] == "supported"
    ] == list(found.windows)
    assert found.rigid_fraction == pytest.approx(
        sum(td - tr for tr, td in found.windows) / 0.42, rel=1e-3
    )


def test_what_is_done_and_where_it_was_planned_is_in_the_command_that_repeats_it() -> (
    None
):
    energy = d2.read(ENERGY)  # without parts: nothing shows that it was not switched
    found = d2.plan(energy, done=[(0.0137, 0.03)], before=energy)
    assert found.command == ("plan", "--done", "-", "--before", ENERGY, ENERGY)
    theirs = json.loads(
        run(*found.command, "-f", "json", stdin=b"0.0137 0.03\n").stdout
    )
    assert {**theirs, "command": None} == {**found.to_dict(), "command": None}
