"""Records of the project behave as those of the standard library do."""

from __future__ import annotations

import dataclasses
import pickle
import typing
from inspect import signature

import pytest

from d2rpick.base.records import NamedTuple, dataclass, field, fields, replace


class Ours(NamedTuple):
    """A pair."""

    first: int
    second: str = "two"

    @property
    def both(self) -> str:
        """The two of them."""
        return f"{self.first} {self.second}"


class Theirs(typing.NamedTuple):
    """A pair."""

    first: int
    second: str = "two"


def test_fields_defaults_and_names_are_those_of_typing() -> None:
    assert (Ours._fields, Ours._field_defaults) == (Theirs._fields, Theirs._field_defaults)
    assert (Ours.__module__, Ours.__doc__) == (Theirs.__module__, Theirs.__doc__)
    assert repr(Ours(1)) == repr(Theirs(1)).replace("Theirs", "Ours")


def test_it_is_a_tuple_with_what_its_class_defines() -> None:
    one = Ours(1)
    assert one == (1, "two")
    assert one._replace(first=3).both == "3 two"
    assert pickle.loads(pickle.dumps(one)) == one


@dataclass(frozen=True, eq=False, repr=False)
class Held:
    """What nothing changes."""

    first: int
    second: str = "two"
    more: list[int] = field(default_factory=list)
    made: list[int] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        """Use what was made."""
        self.made.append(self.first)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Named(Held):
    """One that says all by name."""

    third: float


class Derived(Held):
    """No record itself."""

    def __init__(self) -> None:
        self.own = 1


@dataclass(eq=False, repr=False)
class Changing:
    """What may change."""

    first: int = 1


def test_a_dataclass_has_fields_that_can_be_replaced_and_pickled() -> None:
    one = Held(1)
    assert [each.name for each in fields(one)] == ["first", "second", "more", "made"]
    assert (one.second, one.more, one.made) == ("two", [], [1])
    assert Held(1).more is not one.more
    assert dataclasses.asdict(replace(one, second="2", first=3)) == {"first": 3, "second": "2", "more": [], "made": [3]}
    assert vars(pickle.loads(pickle.dumps(one))) == vars(one)
    assert (Named(1, "2", third=0.5).third, Named(first=1, third=0.5).second) == (0.5, "two")


@pytest.mark.parametrize(
    ("args", "named"),
    [((), {}), ((1, "2", [], 4), {}), ((1,), {"first": 1}), ((1,), {"none": 1}), ((1,), {"made": []})],
)
def test_a_dataclass_takes_its_fields_and_no_others(args: tuple[typing.Any, ...], named: dict[str, typing.Any]) -> None:
    with pytest.raises(TypeError, match="Held is made of first, more, second; found"):
        Held(*args, **named)


def test_the_signature_of_a_dataclass_says_what_it_is_made_of() -> None:
    told = "(first: 'int', second: 'str' = 'two', more: 'list[int]' = <factory>"
    assert str(signature(Held)) == f"{told}) -> None"
    assert str(signature(Named)) == f"{told}, *, third: 'float') -> None"


def test_what_is_frozen_stays() -> None:
    for name in ("first", "new"):
        with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field"):
            setattr(Held(1), name, 2)
    derived = Derived()
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot delete field 'first'"):
        delattr(derived, "first")
    del derived.own
    changing = Changing()
    changing.first = 3
    assert (changing.first, hasattr(derived, "own")) == (3, False)
