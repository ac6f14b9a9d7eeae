"""Cards: a keyword with its data lines, whose numbers are evaluated where they are asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.expression import ExpressionError, names_in, number
from d2rpick.deck.fields import STANDARD, Field, Row, T, Value

if TYPE_CHECKING:
    from collections.abc import Callable

    from d2rpick.deck.parameters import Scope
    from d2rpick.deck.source import Block


class Transform(NamedTuple):
    """What ``*INCLUDE_TRANSFORM`` does to a file: offsets of its ids, factor of its times.

    ``scaled``: any unit of the file is another one; ``moved``: its nodes are moved.
    """

    node: int = 0
    part: int = 0
    material: int = 0
    set_: int = 0
    rest: int = 0
    time: float = 1.0
    scaled: bool = False
    moved: bool = False

    def inside(self, outer: Transform) -> Transform:
        """Return this transform of a file that is itself included by a transformed one."""
        node, part, material, set_, rest = (own + further for own, further in zip(self[:5], outer[:5], strict=True))
        scaled, moved = self.scaled or outer.scaled, self.moved or outer.moved
        return Transform(node, part, material, set_, rest, self.time * outer.time, scaled, moved)


@dataclass(eq=False, repr=False)
class Card:
    """A keyword block that matters: ``name`` in upper case without ``*`` and format suffix."""

    name: str
    block: Block
    scope: Scope
    width: int = STANDARD
    transform: Transform = field(default_factory=Transform)

    @property
    def file(self) -> str:
        """Name of the file."""
        return self.block.source.name

    @property
    def line(self) -> int:
        """Number of the keyword line, from 1."""
        return self.block.line

    @property
    def at(self) -> str:
        """File and line of the keyword, as messages show them."""
        return f"{self.file}:{self.line}"

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All data lines, blank ones too; comments are left out."""
        return tuple(Row(self.block, distance, text, self.width) for distance, text in self.block.lines())

    @cached_property
    def lines(self) -> tuple[Row, ...]:
        """All data lines that are not blank."""
        return tuple(row for row in self.rows if not row.blank)

    @cached_property
    def data(self) -> tuple[Row, ...]:
        """Lines that are not blank, below that of the title where the keyword has one (``_TITLE``)."""
        return tuple(row for row in self.rows[1:] if not row.blank) if "TITLE" in self.name else self.lines

    @property
    def words(self) -> tuple[str, ...]:
        """Words of the keyword of Radioss."""
        return tuple(self.name.split("/"))

    def options(self, keyword: str) -> frozenset[str]:
        """Words of the name behind a keyword."""
        return frozenset(self.name.removeprefix(keyword).split("_")) - {""}

    @property
    def here(self) -> Field:
        """The keyword itself, as a place to point at."""
        return Field(f"*{self.name}", self.block, 0, 1)

    def real(self, row: Row, position: int, default: float = 0.0) -> Value[float]:
        """Read a real number; parameters and expressions are evaluated, a blank field is the default."""
        return self._number(row, position, default, float)

    def integer(self, row: Row, position: int, default: int = 0) -> Value[int]:
        """Read an integer; a real without fraction is accepted."""
        return self._number(row, position, default, int)

    def _number(self, row: Row, position: int, default: T, kind: Callable[[float], T]) -> Value[T]:
        text = row.cell(position)
        if not text:
            return Value(default, row, "", (), position)
        names: tuple[str, ...] = ()
        try:
            if "&" in text or text[0] == "<":
                names = names_in(text)
                exact = float(self.scope.value(text))
            else:
                exact = float(number(text))
            if (value := kind(exact)) == exact:
                return Value(value, row, "", names, position)
        except (ExpressionError, OverflowError) as error:
            return Value(default, row, str(error), names, position)
        return Value(default, row, f"{text!r} is not an integer", names, position)

    def positive(self, row: Row, position: int) -> float | None:
        """Read a positive number, or None; of an include in other units none is known."""
        found = self.real(row, position)
        return None if self.transform.scaled or found.problem or found.value <= 0 else found.value

    def word(self, row: Row, position: int, default: str = "") -> Value[str]:
        """Read a word, in upper case."""
        text = row.cell(position)
        return Value(self.scope.text(text).upper() or default, row, "", names_in(text), position)
