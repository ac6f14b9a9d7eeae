"""Describe each option in one place: its help text, and the type and limits of its value.

The command line, the arguments of Python and the settings of a choice are made from tables of such options: dataclasses
whose fields are made by `make_option`.
"""

from __future__ import annotations

from dataclasses import field, fields
from functools import cache
from typing import Any, Final

from d2rpick.base.ranges import Number
from d2rpick.base.tuples import NamedTuple

# Upper limit of an integer range if no other upper limit is defined.
UNLIMITED: Final = 2**63
# Ranges of numbers, with names that describe the numbers in the range.
TIME: Final = Number()
POSITIVE: Final = Number(0.0, above=True)
NOT_NEGATIVE: Final = Number(0.0)
FRACTION: Final = Number(0.0, 1.0)
AT_LEAST_ONE: Final = Number(1.0)


class Option(NamedTuple):
    """An option: the ``kind`` of its value, its help text, and the options that it overrides.

    ``kind`` is a `Number`, a range of whole numbers, a list of names, or a kind of the command line: "flag", "file",
    "names", ...  ``many``: it can be repeated; ``pair``: two values.
    """

    help: str
    kind: Number | range | tuple[str, ...] | str = "text"
    metavar: str | None = None
    many: bool = False
    pair: bool = False
    instead_of: tuple[str, ...] = ()
    short: tuple[str, ...] = ()

    @property
    def is_time(self) -> bool:
        """True if the value of the option is a time of the run or a time window."""
        return self.metavar in ("T", "LO HI")


def make_option(
    text: str,
    kind: Any = "text",
    metavar: str | None = None,
    *,
    default: Any = None,
    **keywords: Any,
) -> Any:
    """Return a dataclass field for an option; the default of an option that can be repeated is an empty tuple.

    What is known of the option besides, the ``metadata`` of the field, may be given as a mapping.
    """
    metadata = keywords.pop("metadata", {})
    default = () if keywords.get("many") else default
    option = Option(text, kind, metavar, **keywords)
    return field(default=default, metadata={"option": option, **metadata})


@cache
def list_options(table: Any) -> dict[str, Option]:
    """Return the options of a table, keyed by field name."""
    return {
        field.name: field.metadata["option"]
        for field in fields(table)
        if "option" in field.metadata
    }


def make_option_name(name: str) -> str:
    """Return the name of an option as it is typed on the command line."""
    return name.replace("_", "-")
