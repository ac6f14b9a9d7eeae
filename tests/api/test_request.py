"""One table of all arguments, which contains no contradictions and is printed as a user types it."""

from typing import Any

import pytest

from d2rpick.api.choosing import Choosing, JudgingOptions
from d2rpick.api.request import CHOOSING_FOR_CARDS, OPTIONS, OSCILLATOR, Request
from d2rpick.base.errors import ArgumentError
from d2rpick.choice.options import ChoiceOptions
from d2rpick.choice.parts.cost import Weights
from d2rpick.choice.question import Settings
from tests.generated_arguments import MODULE, write_module

ONE = {"stiffness": 2.0, "mass": 3.0, "beta": 2.0, "alpha": 0.5, "v0": 1.0}


@pytest.mark.parametrize(
    ("arguments", "typed"),
    [
        (
            {"tolerance": 0.1, "part": ("3", "roof")},
            ["--part", "3", "--part", "roof", "--tolerance", "0.1"],
        ),
        (
            {"fit_window": (0.5, 1.0), "strict": True},
            ["--fit-window", "0.5", "1.0", "--strict"],
        ),
        (
            {"strict": False, "tolerance": 0.2, "given": {"strict", "tolerance"}},
            ["--tolerance", "0.2"],
        ),
        (
            {"deck": "a.k", "weights": Weights({"BT": 1.0})},
            ["--deck", "a.k", "--weights", "<weights in memory>"],
        ),
        ({"history": ("a.csv",)}, []),
    ],
)
def test_what_is_asked_is_typed_again(
    arguments: dict[str, Any], typed: list[str]
) -> None:
    assert [*Request(**arguments).asking()] == typed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (ONE | {"v0": None}, "`stiffness` needs `v0`"),
        (ONE | {"beta": None}, "either `frame_mass` or `beta`"),
        (ONE | {"no_verify": True}, "an oscillator and `replay` exclude each other"),
        ({"fit_window": (1.0, 0.5)}, "`fit_window` 1 0.5 is empty"),
        ({"weights": "site.toml"}, "`weights` needs `deck`"),
        ({"step_ratio": 2.0}, "`step_ratio` needs `cost_share` or `deck`"),
    ],
)
def test_what_contradicts_itself_is_refused(
    arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(ArgumentError, match=message):
        Request(**arguments)


def test_every_keyword_of_python_is_an_option() -> None:
    assert Choosing.__annotations__.keys() - OPTIONS.keys() == {"oscillator", "replay"}
    assert {*OSCILLATOR} <= OPTIONS.keys()


def test_the_arguments_of_python_follow_from_the_table_of_options() -> None:
    assert MODULE.read_text("utf-8") == write_module()
    assert {*ChoiceOptions.__annotations__} <= {*Choosing.__annotations__}
    assert {*CHOOSING_FOR_CARDS} == {*JudgingOptions.__annotations__}


def test_what_the_question_leaves_open_is_decided_by_the_settings() -> None:
    settings = Request(max_residual=0.3).settings
    assert (settings.max_residual, settings.min_quality, settings.step_ratio) == (
        0.3,
        Settings().min_quality,
        Settings().step_ratio,
    )
