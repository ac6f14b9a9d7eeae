"""Cards: a keyword with its data lines in fields, and the parameters (``&name``) that stand there.

Numbers are evaluated where they are asked for.  Each field knows its place, each parameter where it is visible, which
definition counts, and its value.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

from d2rpick.base.caching import cached_property
from d2rpick.base.graph import reached
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.expression import (
    LONGEST,
    REFERENCE,
    ExpressionError,
    Number,
    evaluate,
    is_number,
    names_in,
    number,
    of_kind,
    plain,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.deck.source import Block


STANDARD, LONG = 10, 20  # columns of a field
# A text between commas, compiled where it is needed: a comma inside <max(1,2)> belongs to the expression.
_BETWEEN_COMMAS: Final = r"((?:[^,<]|<[^>]*>?)*),?"

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


@dataclass(eq=False, repr=False, slots=True)
class Value(Generic[T]):
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
        return (
            self.place.field(self.position)
            if isinstance(self.place, Row)
            else self.place
        )


@dataclass(eq=False, repr=False, slots=True)
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
        pieces, comma = self._pieces(), int("," in self.text)
        text = "".join(pieces[position : position + 1])
        start = min(
            sum(len(piece) + comma for piece in pieces[:position]), len(self.text)
        )
        column = 1 + start + len(text) - len(text.lstrip() or text)
        return Field(text.strip(), self.block, self.distance, column)

    def cell(self, position: int) -> str:
        """Text of a field alone; all are kept, since they are asked for one after the other, and again."""
        cells = self._cells
        if cells is None:
            cells = self._cells = [*map(str.strip, self._pieces())]
        return cells[position] if position < len(cells) else ""

    def _pieces(self) -> list[str]:
        line, width = self.text, self.width
        if "," in line:
            return re.findall(_BETWEEN_COMMAS, line)
        return [line[at : at + width] for at in range(0, len(line), width)]


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
        node, part, material, set_, rest = (
            own + further for own, further in zip(self[:5], outer[:5], strict=True)
        )
        scaled, moved = self.scaled or outer.scaled, self.moved or outer.moved
        return Transform(
            node, part, material, set_, rest, self.time * outer.time, scaled, moved
        )


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
        return tuple(
            [
                Row(self.block, distance, text, self.width)
                for distance, text in self.block.lines()
            ]
        )

    @cached_property
    def lines(self) -> tuple[Row, ...]:
        """All data lines that are not blank."""
        return tuple(row for row in self.rows if not row.blank)

    @cached_property
    def data(self) -> tuple[Row, ...]:
        """Lines that are not blank, below that of the title where the keyword has one (``_TITLE``)."""
        return (
            tuple(row for row in self.rows[1:] if not row.blank)
            if "TITLE" in self.name
            else self.lines
        )

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

    def numbers(self, row: Row, kinds: Sequence[type[int] | type[float]]) -> list[Any]:
        """Read the first fields of a line, each of its kind."""
        return [self._number(row, at, kind(), kind) for at, kind in enumerate(kinds)]

    def _number(
        self, row: Row, position: int, default: T, kind: Callable[[float], T]
    ) -> Value[T]:
        text = row.cell(position)
        if not text:
            return Value(default, row, "", (), position)
        parameters: tuple[str, ...] = ()
        if len(text) > LONGEST or (found := plain(kind, text)) is None:
            found, parameters = of_kind(kind, text, self.scope.value), names_in(text)
        value, problem = found
        return Value(default if problem else value, row, problem, parameters, position)

    def positive(self, row: Row, position: int) -> float | None:
        """Read a positive number, or None; of an include in other units none is known."""
        found = self.real(row, position)
        return (
            None
            if self.transform.scaled or found.problem or found.value <= 0
            else found.value
        )

    def word(self, row: Row, position: int, default: str = "") -> Value[str]:
        """Read a word, in upper case."""
        text = row.cell(position)
        return Value(
            self.scope.text(text).upper() or default, row, "", names_in(text), position
        )


# Parameters.

_LISTED = r"(?ai)\s*[RIC]\s*&?\s*\w+\s*"  # compiled where it is needed
_PAIRS = 4  # name and value, repeated in a line of *PARAMETER


class Definition(NamedTuple):
    """One line that gives a parameter a value; ``problem`` says why it has none, ``order`` counts all of a deck."""

    name: str
    value: Number | str
    place: Field
    order: int
    replaceable: bool = False
    uses: tuple[str, ...] = ()
    problem: str = ""


_Table = dict[str, list[Definition]]


class Scope:
    """Parameters visible in one file: its own local ones first, then those of the files that include it.

    The parameters that are not local come last.

    Of several definitions the first counts (Vol I R17 as quoted by a converter: DFLAG 1 warns and keeps the
    first), unless ``*PARAMETER_DUPLICATION`` or ``_MUTABLE`` let the later one win.
    """

    def __init__(self, outer: Scope | None = None) -> None:
        self._outer = outer
        self._local: _Table = {}
        self._whole: Scope = (
            outer._whole if outer else self
        )  # that of the main file, which has what all files share
        self._shared: _Table = {}
        self._latest_wins = False
        self._count = 0
        self._known: float = (
            math.inf
        )  # how many definitions of the deck were read before
        self._seen = self

    def as_of_now(self) -> Scope:
        """Return the same scope as a card sees it that stands here: later definitions do not count for its values."""
        if self._seen._known != self._whole._count:
            self._seen = Scope(self._outer)
            self._seen._local, self._seen._whole, self._seen._known = (
                self._local,
                self._whole,
                self._whole._count,
            )
        return self._seen

    def definitions(self, name: str) -> tuple[Definition, ...]:
        """All definitions of ``name`` (lower case), later ones too, in the innermost scope that has one by now."""
        found = [table[name] for table in self._tables() if name in table]
        return tuple(
            next(
                (each for each in found if each[0].order < self._known),
                found[0] if found else (),
            )
        )

    def definition(self, name: str) -> Definition | None:
        """Return the definition that counts."""
        found = [
            definition
            for definition in self.definitions(name)
            if definition.order < self._known
        ]
        if not found:
            return None
        return (
            found[-1] if self._whole._latest_wins or found[-1].replaceable else found[0]
        )

    def closure(self, names: tuple[str, ...]) -> list[str]:
        """Return ``names`` and all parameters their definitions refer to, directly or not."""
        return reached(
            names,
            lambda name: (use for one in self.definitions(name) for use in one.uses),
            wide=True,
        )

    def value(self, text: str) -> Number:
        """Value of a field: a number, a reference, or an expression; ExpressionError if it is none."""
        text = text.strip()
        if text[:1] == "<" and text[-1:] == ">":
            return evaluate(text[1:-1], self._number)
        if "&" in text:
            return evaluate(text, self._number)
        return number(text)

    def text(self, text: str) -> str:
        """Return the text of a field, where ``&name`` of a character parameter stands for its text."""

        def value(reference: re.Match[str]) -> str:
            found = self.definition(reference[1].lower())
            return (
                found.value if found and isinstance(found.value, str) else reference[0]
            )

        return re.sub(REFERENCE, value, text) if "&" in text else text

    def define(self, keyword: str, rows: Sequence[Row]) -> None:
        """Take over the definitions of a ``*PARAMETER`` card."""
        options = set(keyword.split("_")[1:])
        if "DUPLICATION" in options:
            flags = [row.cell(0) for row in rows[:1]]
            self._whole._latest_wins = flags[:1] in (["2"], ["4"])
            return
        target = self._local if "LOCAL" in options else self._whole._shared
        for row, name, text in _pairs(rows, options):
            definition = self._definition(row, name, text, "MUTABLE" in options)
            if definition is not None:
                target.setdefault(definition.name, []).append(definition)
                self._whole._count += 1

    def _tables(self) -> Iterator[_Table]:
        yield self._local
        yield from self._outer._tables() if self._outer else (self._whole._shared,)

    def _definition(
        self, row: Row, named: str, text: str, replaceable: bool
    ) -> Definition | None:
        kind, name = named[:1].upper(), named[1:].strip().lstrip("&").strip().lower()
        if kind not in {"R", "I", "C"} or not name:
            return None
        value: Number | str
        problem = ""
        uses = names_in(text)
        if kind == "C":
            value = text.strip().strip('"')
        else:
            try:
                value = (
                    evaluate(text, self._number)
                    if uses or not is_number(text)
                    else number(text)
                )
                value = int(value) if kind == "I" else float(value)
            except ExpressionError as error:
                value, problem = 0, str(error)
        return Definition(
            name, value, row.field(0), self._whole._count, replaceable, uses, problem
        )

    def _number(self, name: str) -> Number:
        definition = self.definition(name)
        if definition is None:
            if later := self.definitions(name):
                place = later[0].place
                raise ExpressionError(
                    f"parameter &{name} is defined only below, at {place.at}"
                )
            raise ExpressionError(f"parameter &{name} is not defined")
        if definition.problem:
            place = definition.place
            raise ExpressionError(
                f"parameter &{name} has no value ({place.at}: {definition.problem})"
            )
        if isinstance(definition.value, str):
            raise ExpressionError(f"parameter &{name} is a text, a number was expected")
        return definition.value


def _pairs(rows: Sequence[Row], options: set[str]) -> Iterator[tuple[Row, str, str]]:
    """Name (with its type letter) and value text of every definition on the card."""
    if "EXPRESSION" in options:
        yield from _expressions(rows)
        return
    for row in rows:
        for pair in range(1 if "TYPE" in options else _PAIRS):
            name = row.cell(2 * pair)
            if name:
                yield row, name, row.cell(2 * pair + 1)


def _expressions(rows: Sequence[Row]) -> Iterator[tuple[Row, str, str]]:
    """One definition per line; a line whose name field is blank goes on with the expression before."""
    pending: tuple[Row, str, str] | None = None
    for row in rows:
        before, comma, after = row.text.partition(",")
        if comma and re.fullmatch(_LISTED, before):
            name, text = before.strip(), after
        else:
            name, text = row.text[: row.width].strip(), row.text[row.width :]
        if name or pending is None:
            if pending is not None:
                yield pending
            pending = (row, name, text)
        else:
            pending = (pending[0], pending[1], pending[2] + text)
    if pending is not None:
        yield pending
