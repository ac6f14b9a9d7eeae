"""Represent cards (keywords with data lines of fields), and the parameters (``&name``) in their fields.

Numbers are evaluated on request. Each field has its place in the file, and each parameter its definitions and the files
in which it is visible.
"""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

from d2rpick.base.caching import cached_property
from d2rpick.base.graph import find_reachable
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.expression import (
    LONGEST,
    REFERENCE,
    ExpressionError,
    Number,
    convert_plain,
    convert_text,
    evaluate,
    find_parameters,
    is_deck_number,
    parse_number,
)
from d2rpick.deck.ls_dyna_columns import PARAMETER_FLAG, PARAMETERS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.deck.columns import CardColumn, DataLine
    from d2rpick.deck.source import Block


STANDARD, LONG = 10, 20  # Widths of a field in standard and long format [characters].
# Pattern of the text between commas. A comma inside an expression, e.g. <max(1,2)>, does not separate fields.
_BETWEEN_COMMAS: Final = r"((?:[^,<]|<[^>]*>?)*),?"

T = TypeVar("T", int, float, str)

_LISTED = r"(?ai)\s*[RIC]\s*&?\s*\w+\s*"  # This pattern is compiled on first use to keep start-up fast.
_PARAMETERS: Final = [*PARAMETERS]
_FLAG: Final = PARAMETER_FLAG["DFLAG"]


class CardField(NamedTuple):
    """The text of one field without surrounding spaces, and its position; columns are counted from 1."""

    text: str
    block: Block
    distance: int  # Number of lines between the keyword line and the field.
    column: int

    @property
    def file(self) -> str:
        """Return the name of the file."""
        return self.block.source.name

    @property
    def line(self) -> int:
        """Return the line number in the file, which is computed on first use."""
        return self.block.line + self.distance

    @property
    def at(self) -> str:
        """Return the file and line as they appear in messages."""
        return f"{self.file}:{self.line}"


Problem = tuple[CardField, str]
"""A field that cannot be read, and the reason."""


class Value(Generic[T]):
    """The value of a field. If ``value`` is a default for an unreadable field, ``problem`` gives the reason.

    ``place`` is the field, or the row in which the field has this ``position``; the field itself is built only for a
    message.
    """

    __slots__ = ("parameters", "place", "position", "problem", "value")

    def __init__(
        self,
        value: T,
        place: CardField | Row,
        problem: str = "",
        parameters: tuple[str, ...] = (),
        position: int = 0,
    ) -> None:
        self.value: T = value
        self.place = place
        self.problem = problem
        self.parameters = parameters
        self.position = position

    def change_to(self, value: T) -> Value[T]:
        """Return another value for the same field."""
        return Value(value, self.place, self.problem, self.parameters, self.position)

    def refuse(self, problem: str) -> Value[T]:
        """Return the value with the reason why it is wrong."""
        return Value(self.value, self.place, problem, (), self.position)

    @property
    def field(self) -> CardField:
        """Return the field that contains the value."""
        if isinstance(self.place, Row):
            return self.place.field(self.position)
        return self.place


class Row:
    """One data line of a card."""

    __slots__ = ("_cells", "block", "distance", "text", "width")

    def __init__(self, block: Block, distance: int, text: str, width: int) -> None:
        self.block, self.distance, self.text, self.width = block, distance, text, width
        self._cells: list[str] | None = None

    @property
    def blank(self) -> bool:
        """Return True if the line is blank or empty."""
        return not self.text.strip()

    def field(self, position: int) -> CardField:
        """Return the field at the 0-based ``position``; fields are separated by commas or have fixed columns.

        The text is empty beyond the end of the line.
        """
        pieces = self._pieces()
        comma = int("," in self.text)
        text = "".join(pieces[position : position + 1])
        start = min(
            sum(len(piece) + comma for piece in pieces[:position]), len(self.text)
        )
        column = 1 + start + len(text) - len(text.lstrip() or text)
        return CardField(text.strip(), self.block, self.distance, column)

    def cell(self, position: int) -> str:
        """Return the text of a field. The texts of all fields are cached, because callers read the fields in order."""
        cells = self._cells
        if cells is None:
            cells = self._cells = [*map(str.strip, self._pieces())]
        return cells[position] if position < len(cells) else ""

    def _pieces(self) -> list[str]:
        """Split the line into the texts of its fields."""
        line = self.text
        width = self.width
        if "," in line:
            return re.findall(_BETWEEN_COMMAS, line)
        return [line[at : at + width] for at in range(0, len(line), width)]


class Transform(NamedTuple):
    """Effects of ``*INCLUDE_TRANSFORM`` on an included file: id offsets and a time factor.

    ``scaled`` is True if the file has a different unit of mass, time or length. ``moved`` is True if its nodes are
    moved.
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
        """Combine the transform of an included file with the transform of the file that includes it."""
        node, part, material, set_, other_id = (
            offset + outer_offset
            for offset, outer_offset in zip(self[:5], outer[:5], strict=True)
        )
        scaled = self.scaled or outer.scaled
        moved = self.moved or outer.moved
        return Transform(
            node, part, material, set_, other_id, self.time * outer.time, scaled, moved
        )


_UNCHANGED: Final = Transform()


class Card:
    """A keyword block that d2rpick uses; ``name`` is the keyword in upper case, without ``*`` and format suffix."""

    # The initialiser of a data class would take longer, and a deck has many keywords.
    def __init__(
        self,
        name: str,
        block: Block,
        scope: Scope,
        width: int = STANDARD,
        transform: Transform = _UNCHANGED,
    ) -> None:
        self.name = name
        self.block = block
        self.scope = scope
        self.width = width
        self.transform = transform

    @property
    def file(self) -> str:
        """Return the name of the file."""
        return self.block.source.name

    @property
    def line(self) -> int:
        """Return the 1-based line number of the keyword line."""
        return self.block.line

    @property
    def at(self) -> str:
        """Return the file and line of the keyword as they appear in messages."""
        return f"{self.file}:{self.line}"

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Return all data lines, including blank lines but excluding comments."""
        return tuple(
            [
                Row(self.block, distance, text, self.width)
                for distance, text in self.block.lines()
            ]
        )

    @cached_property
    def lines(self) -> tuple[Row, ...]:
        """Return all data lines except blank lines."""
        return tuple(row for row in self.rows if not row.blank)

    @cached_property
    def data(self) -> tuple[Row, ...]:
        """Return all data lines except blank lines and the title line of a keyword with ``_TITLE``."""
        if "TITLE" in self.name:
            return tuple(row for row in self.rows[1:] if not row.blank)
        return self.lines

    @property
    def words(self) -> tuple[str, ...]:
        """Return the words of a Radioss keyword, which are separated by slashes."""
        return tuple(self.name.split("/"))

    def options(self, keyword: str) -> frozenset[str]:
        """Return the words of the card name after ``keyword``, which are separated by underscores."""
        return frozenset(self.name.removeprefix(keyword).split("_")) - {""}

    @property
    def here(self) -> CardField:
        """Return the keyword as a field, for messages."""
        return CardField(f"*{self.name}", self.block, 0, 1)

    def real(self, row: Row, column: CardColumn, default: float = 0.0) -> Value[float]:
        """Read a real number; parameters and expressions are evaluated, and a blank field gives the default."""
        return self._number(row, column.position, default, float)

    def integer(self, row: Row, column: CardColumn, default: int = 0) -> Value[int]:
        """Read an integer; a real number is accepted if it has no fractional part."""
        return self._number(row, column.position, default, int)

    def numbers(self, row: Row, line: DataLine) -> list[Any]:
        """Read all columns of a line that contains only numbers."""
        return [
            self.real(row, column)
            if column.kind is float
            else self.integer(row, column)
            for column in line
        ]

    def _number(
        self, row: Row, position: int, default: T, kind: Callable[[float], T]
    ) -> Value[T]:
        """Read a field as a number of the given type, evaluating any parameters in it."""
        text = row.cell(position)
        if not text:
            return Value(default, row, "", (), position)
        parameters: tuple[str, ...] = ()
        if (
            len(text) > LONGEST
            or (value_and_problem := convert_plain(kind, text)) is None
        ):
            value_and_problem = convert_text(kind, text, self.scope.value)
            parameters = find_parameters(text)
        value, problem = value_and_problem
        return Value(default if problem else value, row, problem, parameters, position)

    def positive(self, row: Row, column: CardColumn) -> float | None:
        """Read a positive number; None if it is not positive or if its include file has different units."""
        number = self.real(row, column)
        if self.transform.scaled or number.problem or number.value <= 0:
            return None
        return number.value

    def word(self, row: Row, column: CardColumn, default: str = "") -> Value[str]:
        """Read a word and return it in upper case."""
        text = row.cell(column.position)
        return Value(
            self.scope.text(text).upper() or default,
            row,
            "",
            find_parameters(text),
            column.position,
        )


# The classes below represent the parameters in a deck.


class Definition(NamedTuple):
    """One definition of a parameter.

    ``problem`` is the reason why the definition has no value, and ``order`` is its index among all definitions of the
    deck.
    """

    name: str
    value: Number | str
    place: CardField
    order: int
    replaceable: bool = False
    uses: tuple[str, ...] = ()
    problem: str = ""


_Table = dict[str, list[Definition]]


class Scope:
    """The parameters visible in one file. Local parameters hide global ones and those of including files.

    If a parameter is defined several times, the first definition is used (Vol I R17 as quoted by a converter: DFLAG 1
    warns and keeps the first), unless ``*PARAMETER_DUPLICATION`` or ``_MUTABLE`` lets a later one replace it.
    """

    def __init__(self, outer: Scope | None = None) -> None:
        self._outer = outer
        self._local: _Table = {}
        # The scope of the main file contains the global parameters.
        self._whole: Scope = outer._whole if outer else self
        self._shared: _Table = {}
        self._latest_wins = False
        self._count = 0
        # Number of definitions before a card; later definitions do not apply to it.
        self._known: float = math.inf
        self._seen = self

    def as_of_now(self) -> Scope:
        """Return the scope at the current position; later definitions do not change the values in this scope."""
        if self._seen._known != self._whole._count:
            self._seen = Scope(self._outer)
            self._seen._local, self._seen._whole, self._seen._known = (
                self._local,
                self._whole,
                self._whole._count,
            )
        return self._seen

    def definitions(self, name: str) -> tuple[Definition, ...]:
        """Return all definitions of ``name`` (in lower case), including later ones.

        The definitions come from the innermost scope that has one before the current position.
        """
        by_scope = [table[name] for table in self._tables() if name in table]
        return tuple(
            next(
                (
                    scope_definitions
                    for scope_definitions in by_scope
                    if scope_definitions[0].order < self._known
                ),
                by_scope[0] if by_scope else (),
            )
        )

    def definition(self, name: str) -> Definition | None:
        """Return the definition that applies; None if the parameter is not yet defined."""
        earlier = [
            definition
            for definition in self.definitions(name)
            if definition.order < self._known
        ]
        if not earlier:
            return None
        if self._whole._latest_wins or earlier[-1].replaceable:
            return earlier[-1]
        return earlier[0]

    def closure(self, names: tuple[str, ...]) -> list[str]:
        """Return ``names`` and all parameters that their definitions use, directly or indirectly."""
        return find_reachable(
            names,
            lambda name: (
                use for definition in self.definitions(name) for use in definition.uses
            ),
            wide=True,
        )

    def value(self, text: str) -> Number:
        """Evaluate a field: a number, a reference or an expression; raise ExpressionError for other text."""
        text = text.strip()
        if text[:1] == "<" and text[-1:] == ">":
            return evaluate(text[1:-1], self._number)
        if "&" in text:
            return evaluate(text, self._number)
        return parse_number(text)

    def text(self, text: str) -> str:
        """Return the text of a field with each reference ``&name`` to a character parameter replaced by its value."""

        def value(reference: re.Match[str]) -> str:
            definition = self.definition(reference[1].lower())
            if definition and isinstance(definition.value, str):
                return definition.value
            return reference[0]

        return re.sub(REFERENCE, value, text) if "&" in text else text

    def define(self, keyword: str, rows: Sequence[Row]) -> None:
        """Store the definitions of a ``*PARAMETER`` card."""
        options = set(keyword.split("_")[1:])
        if "DUPLICATION" in options:
            flags = [row.cell(_FLAG.position) for row in rows[:1]]
            self._whole._latest_wins = flags[:1] in (["2"], ["4"])
            return
        target = self._local if "LOCAL" in options else self._whole._shared
        for row, name, text in _read_definitions(rows, options):
            definition = self._definition(row, name, text, "MUTABLE" in options)
            if definition is not None:
                target.setdefault(definition.name, []).append(definition)
                self._whole._count += 1

    def _tables(self) -> Iterator[_Table]:
        """Yield the tables of definitions, from the innermost scope to the global scope."""
        yield self._local
        yield from self._outer._tables() if self._outer else (self._whole._shared,)

    def _definition(
        self, row: Row, name_field: str, text: str, replaceable: bool
    ) -> Definition | None:
        """Evaluate one definition of a parameter.

        ``name_field`` contains the type letter and the name. Return None if the type letter is not the expected one.
        """
        kind = name_field[:1].upper()
        name = name_field[1:].strip().lstrip("&").strip().lower()
        if kind not in {"R", "I", "C"} or not name:
            return None
        value: Number | str
        problem = ""
        uses = find_parameters(text)
        if kind == "C":
            value = text.strip().strip('"')
        else:
            try:
                if uses or not is_deck_number(text):
                    value = evaluate(text, self._number)
                else:
                    value = parse_number(text)
                value = int(value) if kind == "I" else float(value)
            except ExpressionError as error:
                value = 0
                problem = str(error)
        return Definition(
            name, value, row.field(0), self._whole._count, replaceable, uses, problem
        )

    def _number(self, name: str) -> Number:
        """Return the value of a numeric parameter; raise ExpressionError if the parameter has no value."""
        definition = self.definition(name)
        if definition is None:
            if later := self.definitions(name):
                field = later[0].place
                raise ExpressionError(
                    f"parameter &{name} is defined only below, at {field.at}"
                )
            raise ExpressionError(f"parameter &{name} is not defined")
        if definition.problem:
            field = definition.place
            raise ExpressionError(
                f"parameter &{name} has no value ({field.at}: {definition.problem})"
            )
        if isinstance(definition.value, str):
            raise ExpressionError(f"parameter &{name} is a text, expected a number")
        return definition.value


def _read_definitions(
    rows: Sequence[Row], options: set[str]
) -> Iterator[tuple[Row, str, str]]:
    """Yield the row, the name with its type letter, and the value text of each definition on a parameter card."""
    if "EXPRESSION" in options:
        yield from _read_expressions(rows)
        return
    columns = _PARAMETERS[:2] if "TYPE" in options else _PARAMETERS
    pairs = list(zip(columns[::2], columns[1::2], strict=True))
    for row in rows:
        for name_column, value_column in pairs:
            name = row.cell(name_column.position)
            if name:
                yield row, name, row.cell(value_column.position)


def _read_expressions(rows: Sequence[Row]) -> Iterator[tuple[Row, str, str]]:
    """Yield one definition per line; a line with a blank name field continues the previous expression."""
    pending: tuple[Row, str, str] | None = None
    for row in rows:
        name_part, comma, value_part = row.text.partition(",")
        if comma and re.fullmatch(_LISTED, name_part):
            name = name_part.strip()
            text = value_part
        else:
            name = row.text[: row.width].strip()
            text = row.text[row.width :]
        if name or pending is None:
            if pending is not None:
                yield pending
            pending = (row, name, text)
        else:
            pending = (pending[0], pending[1], pending[2] + text)
    if pending is not None:
        yield pending
