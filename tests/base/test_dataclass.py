"""Our dataclasses are those of the standard library."""

import dataclasses
import inspect
import pickle
from collections.abc import Callable
from dataclasses import field
from typing import Any, ClassVar

import pytest

from d2rpick.base.dataclass import dataclass

KINDS: tuple[dict[str, bool], ...] = (
    {},
    {"eq": False},
    {"frozen": True},
    {"frozen": True, "eq": False, "repr": False},
    {"kw_only": True},
)


def of(made_by: Callable[..., Any], **options: bool) -> Any:
    """A class with all kinds of fields, and one derived from it."""

    @made_by(**options)
    class Base:
        """Documented."""

        shared: ClassVar = 7
        first: int
        second: list[int] = field(default_factory=list, compare=False, repr=False)
        third: str = "three"
        last: dict[str, int] = field(default_factory=dict, init=False, compare=False)

    @made_by(**options)
    class Derived(Base):
        """Documented."""

        fourth: float = 4.0
        only: int = field(default=5, kw_only=True)

        def __post_init__(self) -> None:
            self.last["sum"] = self.first + self.only

    return Derived


@dataclass(frozen=True)
class Known:
    """Can be found by its name, as pickles must."""

    value: int


@pytest.mark.parametrize("options", KINDS, ids=str)
def test_instances_are_those_of_the_standard_library(options: dict[str, bool]) -> None:
    ours, theirs = of(dataclass, **options), of(dataclasses.dataclass, **options)
    assert [one.name for one in dataclasses.fields(ours)] == [one.name for one in dataclasses.fields(theirs)]
    assert [*inspect.signature(ours).parameters] == [*inspect.signature(theirs).parameters]
    arguments: tuple[dict[str, Any], ...] = ({"first": 1}, {"first": 2, "second": [3], "third": "x", "only": 6})
    for given in arguments:
        mine, other = ours(**given), theirs(**given)
        assert vars(mine) == vars(other)
        assert vars(dataclasses.replace(mine, first=9)) == vars(dataclasses.replace(other, first=9))
        if options.get("repr", True):
            assert repr(mine) == repr(other)
        assert (mine == ours(**given)) is (other == theirs(**given))
        assert mine != other
        assert mine != dataclasses.replace(mine, first=9)
    with pytest.raises(TypeError, match=r"Derived.__init__\(\) missing"):
        ours()


def test_what_is_compared_is_hashed() -> None:
    frozen = of(dataclass, frozen=True)
    assert hash(frozen(1, second=[2])) == hash(frozen(1))
    with pytest.raises(TypeError, match="unhashable"):
        hash(of(dataclass)(1))


def test_frozen_ones_refuse() -> None:
    one = of(dataclass, frozen=True)(1)
    with pytest.raises(dataclasses.FrozenInstanceError, match="first"):
        one.first = 2
    with pytest.raises(dataclasses.FrozenInstanceError, match="first"):
        del one.first
    with pytest.raises(dataclasses.FrozenInstanceError, match="other"):
        one.other = 2
    of(dataclass)(1).first = 2


def test_a_derived_class_has_attributes_of_its_own() -> None:
    class Plain(Known):
        own = 1

    one = Plain(1)
    one.own = 2
    assert one.own == 2
    with pytest.raises(dataclasses.FrozenInstanceError, match="value"):
        setattr(one, "value", 2)  # noqa: B010  mypy refuses it, too


def test_pickles_hold_the_fields() -> None:
    assert pickle.loads(pickle.dumps(Known(3))) == Known(3)
