"""Data lines of a deck, and the fields on them with file, line and column."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Generic, NamedTuple, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.source import Block

STANDARD, LONG = 10, 20  # columns of a field

T = TypeVar("T", int, float, str)


class Field(NamedTuple):
    """The text of one field, without the blanks around it, and where it stands (counted from 1)."""

    text: str
    block: Block
    distance: int  # lines below the keyword
    column: int

    @property
    def file(self) -> str:
        """Name of the file."""
        return self.block.source.name

    @property
    def line(self) -> int:
        """Number of the line in its file; counted when it is asked for."""
        return self.block.line + self.distance


Problem = tuple[Field, str]
"""A field that says nothing usable, and why."""


class Value(NamedTuple, Generic[T]):
    """What a field says: ``problem`` is empty, or tells why ``value`` is only the default."""

    value: T
    field: Field
    problem: str = ""
    parameters: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Row:
    """One data line of a card."""

    block: Block
    distance: int
    text: str
    width: int

    @property
    def blank(self) -> bool:
        """Whether nothing stands on the line."""
        return not self.text.strip()

    def field(self, position: int) -> Field:
        """Field ``position`` from 0, between commas or in fixed columns; empty beyond the end of the line."""
        start, text = self._pieces[position] if position < len(self._pieces) else (len(self.text), "")
        found = text.strip()
        indent = text.index(found[0]) if found else 0
        return Field(found, self.block, self.distance, start + indent + 1)

    @cached_property
    def _pieces(self) -> list[tuple[int, str]]:
        if "," in self.text:
            return list(_between_commas(self.text))
        return [(start, self.text[start : start + self.width]) for start in range(0, len(self.text), self.width)]


def _between_commas(text: str) -> Iterator[tuple[int, str]]:
    start, depth = 0, 0
    for position, letter in enumerate(text):
        if letter in "<>":
            depth = int(letter == "<")  # a comma inside <max(1,2)> belongs to the expression
        elif letter == "," and not depth:
            yield start, text[start:position]
            start = position + 1
    yield start, text[start:]
