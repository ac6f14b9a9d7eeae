"""Cards: a keyword with its data lines, and what their fields say."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from d2rpick.deck.expression import ExpressionError, names_in
from d2rpick.deck.rows import STANDARD, Field, Row, Value

if TYPE_CHECKING:
    from d2rpick.deck.parameters import Scope
    from d2rpick.deck.source import Block


@dataclass(frozen=True)
class Transform:
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
        return Transform(
            self.node + outer.node,
            self.part + outer.part,
            self.material + outer.material,
            self.set_ + outer.set_,
            self.rest + outer.rest,
            self.time * outer.time,
            self.scaled or outer.scaled,
            self.moved or outer.moved,
        )


@dataclass(frozen=True, eq=False)
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

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """All data lines, blank ones too; comments are left out."""
        return tuple(Row(self.block, distance, text, self.width) for distance, text in self.block.lines())

    @property
    def here(self) -> Field:
        """The keyword itself, as a place to point at."""
        return Field(f"*{self.name}", self.block, 0, 1)

    def real(self, row: Row, position: int, default: float = 0.0) -> Value[float]:
        """Read a real number; parameters and expressions are evaluated, a blank field is the default."""
        found = row.field(position)
        if not found.text:
            return Value(default, found)
        names = names_in(found.text)
        try:
            return Value(float(self.scope.value(found.text)), found, parameters=names)
        except (ExpressionError, OverflowError) as error:
            return Value(default, found, str(error), names)

    def integer(self, row: Row, position: int, default: int = 0) -> Value[int]:
        """Read an integer; a real without fraction is accepted."""
        found = self.real(row, position, default)
        if found.problem:
            return Value(default, found.field, found.problem, found.parameters)
        if found.value != int(found.value):
            problem = f"{found.field.text!r} is not an integer"
            return Value(default, found.field, problem, found.parameters)
        return Value(int(found.value), found.field, "", found.parameters)

    def word(self, row: Row, position: int, default: str = "") -> Value[str]:
        """Read a word, in upper case."""
        found = row.field(position)
        return Value(self.scope.text(found.text).upper() or default, found, parameters=names_in(found.text))
