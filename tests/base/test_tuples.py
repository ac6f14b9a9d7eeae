"""Named tuples of the project behave as those of typing do."""

from __future__ import annotations

import pickle
import typing
from typing import Any, cast

import pytest

from d2rpick.base.tuples import NamedTuple, Record


class Ours(NamedTuple):
    """A pair."""

    first: int
    second: str = "two"

    @property
    def both(self) -> str:
        """Both values in one text."""
        return f"{self.first} {self.second}"


class Theirs(typing.NamedTuple):
    """A pair."""

    first: int
    second: str = "two"


class Measure(Record):
    """A record whose field others inherit."""

    share: float | None = None


class Wide(Measure, Record):
    """The inherited field is between the required and the optional fields."""

    name: str
    kind: str = "any"


def test_fields_defaults_and_names_are_those_of_typing() -> None:
    assert (Ours._fields, Ours._field_defaults) == (
        Theirs._fields,
        Theirs._field_defaults,
    )
    assert (Ours.__module__, Ours.__doc__) == (Theirs.__module__, Theirs.__doc__)
    assert repr(Ours(1)) == repr(Theirs(1)).replace("Theirs", "Ours")


def test_it_is_a_tuple_with_what_its_class_defines() -> None:
    record = Ours(1)
    assert record == (1, "two")
    assert record._replace(first=3).both == "3 two"
    assert pickle.loads(pickle.dumps(record)) == record


@pytest.mark.parametrize(
    ("in_order", "by_name"),
    [
        ((), {}),
        ((1,), {"first": 2}),
        ((1,), {"third": 3}),
        ((1, "two", 3), {}),
        ((), {"second": "two", "third": 3}),
    ],
)
def test_wrong_arguments_are_refused(
    in_order: tuple[Any, ...], by_name: dict[str, Any]
) -> None:
    for pair in (Ours, Theirs):
        with pytest.raises(TypeError):
            pair(*in_order, **by_name)


def test_changed_copies_and_matches_are_those_of_typing() -> None:
    for pair in (Ours(1), Theirs(1)):
        assert pair._replace(second="2")._asdict() == {"first": 1, "second": "2"}
        match pair:
            case Ours(first, second) | Theirs(first, second):
                assert (first, second) == (1, "two")
        with pytest.raises((TypeError, ValueError), match="third"):
            pair._replace(third=3)  # type: ignore[call-arg]
        with pytest.raises(AttributeError):
            pair.first = 2  # type: ignore[misc]
    assert [*Ours._make([1, "2"])] == [*Theirs._make([1, "2"])]


def test_a_record_has_the_fields_of_its_base_behind_those_that_must_be_given() -> None:
    assert Wide._fields == ("name", "share", "kind")
    assert Wide(name="x", share=0.5)._asdict() == {
        "name": "x",
        "share": 0.5,
        "kind": "any",
    }
    assert [*cast("tuple[object, ...]", Wide(name="x"))] == ["x", None, "any"]
    assert pickle.loads(pickle.dumps(Wide(name="x"))) == Wide(name="x")
