"""``d2.parts``: the same as the command, as objects and frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import d2rpick as d2
from d2rpick.choice.cost import Weights
from tests.command import ROOT, answer
from tests.sample_deck import DECK

if TYPE_CHECKING:
    from pathlib import Path

BOX = str(ROOT / "sample_data" / "rollover_box.matsum")


def test_the_same_as_the_command() -> None:
    found = d2.parts(d2.read(BOX), deck=DECK, td=0.37)
    assert found.to_dict() == answer(*found.command) | {"command": list(found.command)}
    assert found.recommended is not None
    assert found.to_frame()["verdict"].tolist() == ["switch", "merge", "keep"]
    sets = found.sets_frame()
    assert sets["recommended"].tolist() == [one.recommended for one in found.sets]
    planned = d2.plan(d2.read(BOX), parts=found.recommended.parts, cost_share=found.recommended.cost_share)
    assert planned.windows


def test_weights_may_be_given_as_they_are(tmp_path: Path) -> None:
    found = d2.parts(d2.read(BOX), deck=DECK, weights=Weights({"BT": 1.0, "QBAT": 1.0}, rigid_node=0.0), step_ratio=2.0)
    assert found.rows[0].cost_share == pytest.approx(94 / 109)
    assert d2.parts(d2.read(BOX), deck=DECK, given=2).sets[-1].parts == (2,)
    assert "all that may" in found.report(tmp_path / "parts.html").read_text("utf-8")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"weights": "site.toml"}, "weights needs a deck"),
        ({"tr": 0.1}, "tr needs td"),
        ({"tr": 0.3, "td": 0.1}, "empty"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, object], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        d2.parts(d2.read(BOX), **arguments)  # type: ignore[arg-type]


def test_what_is_not_a_run_is_named() -> None:
    with pytest.raises(TypeError, match=r"run is 'box\.matsum', what read"):
        d2.parts("box.matsum")  # type: ignore[arg-type]
