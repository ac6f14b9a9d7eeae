"""Data classes of the project behave as those of Python do."""

from __future__ import annotations

import dataclasses
import pickle
from dataclasses import field
from typing import Any

import pytest

from d2rpick.base.data_classes import dataclass


@dataclass(frozen=True)
class Ours:
    """A box."""

    length: float
    width: float = 2.0
    parts: list[int] = field(default_factory=list, compare=False)
    title: str = field(default="box", repr=False)
    seen: int = field(default=0, init=False)


@dataclasses.dataclass(frozen=True)
class Theirs:
    """A box."""

    length: float
    width: float = 2.0
    parts: list[int] = field(default_factory=list, compare=False, hash=False)
    title: str = field(default="box", repr=False)
    seen: int = field(default=0, init=False)


@dataclass(frozen=True, kw_only=True)
class Wide(Ours):
    """A box with a field by keyword, which is checked."""

    height: float

    def __post_init__(self) -> None:
        """Refuse a flat box."""
        if not self.height:
            raise ValueError("the box is flat")


class Further(Ours):
    """A box with an attribute that is no field."""

    def __init__(self, colour: str) -> None:
        super().__init__(1.0)
        self.colour = colour


@dataclass(eq=False, repr=False)
class Open:
    """A class whose objects change."""

    length: float


@pytest.mark.parametrize(
    ("in_order", "by_name"),
    [
        ((1.0,), {}),
        ((1.0, 3.0, [1]), {}),
        ((1.0,), {"title": "lid"}),
        ((), {"width": 3.0, "length": 1.0}),
    ],
)
def test_an_object_has_the_values_and_the_text_of_pythons(
    in_order: tuple[Any, ...], by_name: dict[str, Any]
) -> None:
    ours, theirs = Ours(*in_order, **by_name), Theirs(*in_order, **by_name)
    assert dataclasses.asdict(ours) == dataclasses.asdict(theirs)
    assert repr(ours) == repr(theirs).replace("Theirs", "Ours")


@pytest.mark.parametrize(
    ("in_order", "by_name"),
    [
        ((), {}),
        ((1.0,), {"length": 1.0}),
        ((1.0,), {"depth": 1.0}),
        ((1.0,), {"seen": 1}),
        ((), {"width": 1.0, "depth": 1.0}),
        ((1.0, 2.0, [], "box", 0), {}),
    ],
)
def test_wrong_arguments_are_refused(
    in_order: tuple[Any, ...], by_name: dict[str, Any]
) -> None:
    for box in (Ours, Theirs):
        with pytest.raises(TypeError):
            box(*in_order, **by_name)


def test_equal_objects_have_equal_fields_and_one_hash() -> None:
    assert Ours(1.0, parts=[1]) == Ours(1.0, parts=[2])
    assert Ours(1.0) not in (Ours(2.0), Wide(length=1.0, height=1.0), Theirs(1.0))
    assert len({Ours(1.0), Ours(1.0), Ours(2.0)}) == 2
    assert Open(1.0) != Open(1.0)


def test_each_object_has_its_own_list() -> None:
    assert Ours(1.0).parts is not Ours(1.0).parts


def test_a_frozen_object_does_not_change() -> None:
    box: Any = Ours(1.0)
    for name in ("length", "colour"):
        with pytest.raises(dataclasses.FrozenInstanceError, match=name):
            setattr(box, name, 2.0)
    with pytest.raises(dataclasses.FrozenInstanceError, match="length"):
        del box.length
    changed = Open(1.0)
    changed.length = 2.0
    assert (box.length, changed.length) == (1.0, 2.0)


def test_a_subclass_that_is_no_data_class_may_have_further_attributes() -> None:
    further: Any = Further("red")
    assert further.colour == "red"
    with pytest.raises(dataclasses.FrozenInstanceError, match="length"):
        further.length = 2.0


def test_a_subclass_adds_fields_and_checks_them() -> None:
    assert Wide(1.0, height=3.0).height == 3.0
    with pytest.raises(TypeError, match="height"):
        Wide(1.0)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="flat"):
        Wide(1.0, height=0.0)


def test_copies_are_equal() -> None:
    box = Wide(1.0, height=3.0)
    assert dataclasses.replace(box, width=4.0) == Wide(1.0, 4.0, height=3.0)
    assert pickle.loads(pickle.dumps(box)) == box
