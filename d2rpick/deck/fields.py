"""Data lines of a card in fields, between commas or in fixed columns, each with its place."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Generic, TypeVar

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

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

    @property
    def at(self) -> str:
        """File and line, as messages show them."""
        return f"{self.file}:{self.line}"


Problem = tuple[Field, str]
"""A field that says nothing usable, and why."""


class Value(NamedTuple, Generic[T]):
    """What a field says: ``problem`` is empty, or tells why ``value`` is only the default.

    ``place`` is the field, or its row, where it has that ``position``: most are never pointed at.
    """

    value: T
    place: Field | Row
    problem: str = ""
    parameters: tuple[str, ...] = ()
    position: int = 0

    @property
    def field(self) -> Field:
        """The field itself."""
        return self.place.field(self.position) if isinstance(self.place, Row) else self.place


@dataclass(eq=False, repr=False)
class Row:
    """One data line of a card."""

    block: Block
    distance: int
    text: str
    width: int
    _cells: list[str] | None = None

    @property
    def blank(self) -> bool:
        """Whether nothing stands on the line."""
        return not self.text.strip()

    def field(self, position: int) -> Field:
        """Field ``position`` from 0, between commas or in fixed columns; empty beyond the end of the line."""
        start, text = next(islice(self._pieces(), position, None), (len(self.text), ""))
        column = 1 + start + len(text) - len(text.lstrip() or text)
        return Field(text.strip(), self.block, self.distance, column)

    def cell(self, position: int) -> str:
        """Text of a field alone; all are kept, since they are asked for one after the other, and again."""
        if self._cells is None:
            self._cells = [text.strip() for _, text in self._pieces()]
        return self._cells[position] if position < len(self._cells) else ""

    def _pieces(self) -> Iterable[tuple[int, str]]:
        line, width = self.text, self.width
        in_columns = ((at, line[at : at + width]) for at in range(0, len(line), width))
        return _between_commas(line) if "," in line else in_columns


def _between_commas(text: str) -> Iterator[tuple[int, str]]:
    start, depth = 0, 0
    for position, letter in enumerate(text):
        if letter in "<>":
            depth = int(letter == "<")  # a comma inside <max(1,2)> belongs to the expression
        elif letter == "," and not depth:
            yield start, text[start:position]
            start = position + 1
    yield start, text[start:]
