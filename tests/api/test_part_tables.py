"""The answers of ``d2.parts`` and ``d2.plan`` equal those of the commands, as objects and as frames."""

import json
from pathlib import Path
from typing import Any

import pytest

import d2rpick as d2
from d2rpick.choice.parts.cost import Weights
from tests.command import ENERGY, MATSUM, run, run_json
from tests.sample_deck import DECK


def test_the_same_as_the_command() -> None:
    part_table = d2.parts(d2.read(MATSUM), deck=DECK, td=0.37, replay=False)
    assert part_table.to_dict() == run_json(*part_table.command) | {
        "command": list(part_table.command)
    }
    assert json.loads(part_table.to_json()) == part_table.to_dict()
    assert part_table.recommended is not None
    assert part_table.to_frame()["verdict"].tolist() == ["switch", "merge", "keep"]
    sets = part_table.sets_frame()
    assert sets["recommended"].tolist() == [
        part_set.recommended for part_set in part_table.sets
    ]
    by_set: Any = {
        "parts": part_table.recommended.parts,
        "cost_share": part_table.recommended.cost_share,
    }
    assert d2.plan(d2.read(MATSUM), **by_set).windows


def test_weights_may_be_given_as_they_are(tmp_path: Path) -> None:
    weights = Weights({"BT": 1.0, "QBAT": 1.0}, rigid_node=0.0)
    part_table = d2.parts(
        d2.read(MATSUM), deck=DECK, weights=weights, step_ratio=2.0, replay=False
    )
    assert part_table.rows[0].cost_share == pytest.approx(94 / 109)
    assert d2.parts(d2.read(MATSUM), deck=DECK, given=2, replay=False).sets[
        -1
    ].parts == (2,)
    page = part_table.report(tmp_path / "parts.html").read_text("utf-8")
    assert "all eligible parts" in page
    assert "<h1>Parts to switch: rollover box</h1>" in page
    assert "<span>signature</span>" in page


@pytest.mark.slow
def test_weights_in_memory_are_not_left_out_of_the_command_line() -> None:
    """Without the weights, the printed command would give another run time; the command as printed is refused."""
    weights = Weights({"BT": 1.0, "QBAT": 1.0}, rigid_node=0.0)
    arguments: Any = {
        "parts": "recommended",
        "deck": DECK,
        "weights": weights,
        "replay": False,
    }
    record = d2.read(MATSUM)
    answers: list[Any] = [
        d2.parts(record, deck=DECK, weights=weights, replay=False),
        d2.plan(record, **arguments),
        d2.suggest(record, **arguments),
        d2.verify(record, 0.097, 0.37, **arguments),
        d2.explore(record, td_window=(0.3, 0.37), steps=2, **arguments),
    ]
    for table_answer in answers:
        assert (
            table_answer.command[table_answer.command.index("--weights") + 1]
            == "<weights in memory>"
        )
    assert run(*answers[2].command).exit_code == 2


@pytest.mark.slow
def test_explore_takes_a_deck_as_suggest_does() -> None:
    record = d2.read(MATSUM)
    arguments: Any = {
        "td_window": (0.3, 0.37),
        "parts": "recommended",
        "deck": DECK,
        "replay": False,
    }
    exploration = d2.explore(record, td=0.36, steps=5, **arguments)
    assert exploration.to_dict() == run_json(*exploration.command) | {
        "command": list(exploration.command)
    }
    chosen = d2.suggest(record, **arguments)
    best = next(row for row in chosen.candidates if row.recommended)
    assert exploration.recommended is not None
    assert (exploration.recommended.tr, exploration.recommended.td) == (
        best.tr,
        chosen.td,
    )
    assert exploration.recommended.saving == pytest.approx(
        1 - (best.run_time_share or 0.0)
    )
    assert {"weights-by-analogy"} <= {row.code for row in exploration.warnings} & {
        row.code for row in chosen.warnings
    }
    assert exploration.answer.endswith("and needs the same CPU time")


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
    planned = d2.plan(d2.read(MATSUM), replay=False, **arguments)
    theirs = run_json("plan", "--no-verify", *options, MATSUM)
    assert {**planned.to_dict(), "command": None} == {**theirs, "command": None}
    assert {**run_json(*planned.command), "command": None} == {
        **theirs,
        "command": None,
    }
    assert [
        (row["tr"], row["td"])
        for row in theirs["windows"]
        if row["status"] == "supported"
    ] == list(planned.windows)
    assert planned.rigid_fraction == pytest.approx(
        sum(td - tr for tr, td in planned.windows) / 0.42, rel=1e-3
    )


def test_what_is_done_and_where_it_was_planned_is_in_the_command_that_repeats_it() -> (
    None
):
    energy = d2.read(ENERGY)  # without parts: nothing shows that it was not switched
    planned = d2.plan(energy, done=[(0.0137, 0.03)], before=energy)
    assert planned.command == ("plan", "--done", "-", "--before", ENERGY, ENERGY)
    theirs = json.loads(
        run(*planned.command, "-f", "json", stdin=b"0.0137 0.03\n").stdout
    )
    assert {**theirs, "command": None} == {**planned.to_dict(), "command": None}
