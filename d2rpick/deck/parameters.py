"""Parameters of a deck (``&name``): where each is visible, which definition counts, and its value."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from d2rpick.base.graph import reached
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.expression import REFERENCE, ExpressionError, Number, evaluate, names_in, number

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.fields import Field, Row

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
        self._whole: Scope = outer._whole if outer else self  # that of the main file, which has what all files share
        self._shared: _Table = {}
        self._latest_wins = False
        self._count = 0
        self._known: float = math.inf  # how many definitions of the deck were read before
        self._seen = self

    def as_of_now(self) -> Scope:
        """Return the same scope as a card sees it that stands here: later definitions do not count for its values."""
        if self._seen._known != self._whole._count:
            self._seen = Scope(self._outer)
            self._seen._local, self._seen._whole, self._seen._known = self._local, self._whole, self._whole._count
        return self._seen

    def definitions(self, name: str) -> tuple[Definition, ...]:
        """All definitions of ``name`` (lower case), later ones too, in the innermost scope that has one by now."""
        found = [table[name] for table in self._tables() if name in table]
        return tuple(next((each for each in found if each[0].order < self._known), found[0] if found else ()))

    def definition(self, name: str) -> Definition | None:
        """Return the definition that counts."""
        found = [definition for definition in self.definitions(name) if definition.order < self._known]
        if not found:
            return None
        return found[-1] if self._whole._latest_wins or found[-1].replaceable else found[0]

    def closure(self, names: tuple[str, ...]) -> list[str]:
        """Return ``names`` and all parameters their definitions refer to, directly or not."""
        return reached(names, lambda name: (use for one in self.definitions(name) for use in one.uses), wide=True)

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
            return found.value if found and isinstance(found.value, str) else reference[0]

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

    def _definition(self, row: Row, named: str, text: str, replaceable: bool) -> Definition | None:
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
                value = evaluate(text, self._number) if uses or not _is_number(text) else number(text)
                value = int(value) if kind == "I" else float(value)
            except ExpressionError as error:
                value, problem = 0, str(error)
        return Definition(name, value, row.field(0), self._whole._count, replaceable, uses, problem)

    def _number(self, name: str) -> Number:
        definition = self.definition(name)
        if definition is None:
            if later := self.definitions(name):
                place = later[0].place
                raise ExpressionError(f"parameter &{name} is defined only below, at {place.at}")
            raise ExpressionError(f"parameter &{name} is not defined")
        if definition.problem:
            place = definition.place
            raise ExpressionError(f"parameter &{name} has no value ({place.at}: {definition.problem})")
        if isinstance(definition.value, str):
            raise ExpressionError(f"parameter &{name} is a text, a number was expected")
        return definition.value


def _is_number(text: str) -> bool:
    try:
        number(text)
    except ExpressionError:
        return False
    return True


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
