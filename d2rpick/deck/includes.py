"""Includes: which files a deck asks for, where they are looked for, and how they are transformed."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from d2rpick.deck.card import Transform

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.card import Card
    from d2rpick.deck.rows import Field, Problem, Row

_CONTINUED = " +"
_FACTORS, _OF_TIME = 3, 1  # of mass, time and length
UNKNOWN_KIND = "this kind of include is not read"


@dataclass(frozen=True)
class Asked:
    """A file an ``*INCLUDE`` card asks for: its name as written, the transform of the card, its unreadable fields."""

    name: Field
    transform: Transform
    problems: tuple[Problem, ...] = ()


@dataclass(frozen=True)
class Unread:
    """An include that was not read: its name as written, and why."""

    name: Field
    reason: str


def asked_by(card: Card) -> Iterator[Asked]:
    """Files named by ``*INCLUDE`` (one per line) or ``*INCLUDE_TRANSFORM`` (one, and its numbers)."""
    names = _names(card)
    if card.name == "INCLUDE":
        yield from (Asked(name, card.transform) for name, _ in names)
    elif first := next(names, None):
        name, rest = first
        own, problems = _transform(card, rest)
        yield Asked(name, own.inside(card.transform), problems)


def _names(card: Card) -> Iterator[tuple[Field, list[Row]]]:
    """Every file name, joined over lines that end in blank-plus, its parameters resolved, and the rows below it."""
    waiting = list(card.rows)
    while waiting:
        first = waiting.pop(0)
        if first.blank:
            continue
        text = first.text.rstrip()
        while text.endswith(_CONTINUED) and waiting:
            text = text.removesuffix(_CONTINUED).rstrip() + waiting.pop(0).text.strip()
        yield first.field(0)._replace(text=card.scope.text(text.strip().strip('"'))), waiting


def _transform(card: Card, rows: list[Row]) -> tuple[Transform, tuple[Problem, ...]]:
    """Numbers of ``*INCLUDE_TRANSFORM``; a row left out, a blank and a factor 0 mean no change."""
    places = ((0, 0), (0, 2), (0, 3), (0, 4), (1, 0))
    offsets = [card.integer(rows[row], position) if row < len(rows) else None for row, position in places]
    factors = [card.real(rows[2], at, 1.0) for at in range(_FACTORS)] if len(rows) > 2 else []
    factor = factors[_OF_TIME] if factors else None
    node, part, material, set_, rest = (value.value if value else 0 for value in offsets)
    time = (factor.value if factor else 0.0) or 1.0
    problems = tuple((value.field, value.problem) for value in (*offsets, factor) if value and value.problem)
    scaled = any(one.value not in (0.0, 1.0) for one in factors)
    turn = card.integer(rows[3], 0) if len(rows) > 3 else None
    moved = turn is not None and (bool(turn.problem) or turn.value != 0)  # what cannot be read may move them
    return Transform(node, part, material, set_, rest, time, scaled, moved), problems


class Folders:
    """Where includes are looked for: folder of the main deck, *INCLUDE_PATH in order, the including file's.

    Readers of decks differ in this order; all of these are tried, the first that has the file counts.
    """

    def __init__(self, main: str) -> None:
        self._main = Path(main).parent
        self._paths: list[Path] = []

    def add(self, card: Card) -> None:
        """Take over ``*INCLUDE_PATH``, or ``_RELATIVE`` to the main deck's folder."""
        for name, _ in _names(card):
            self._paths.append(self._main / _portable(name.text))

    def find(self, name: Field) -> str | None:
        """Path of the include as messages should show it, or None."""
        for folder in (self._main, *self._paths, Path(name.file).parent):
            for spelling in (name.text, _portable(name.text), _recoded(name.text)):
                path = str(folder / spelling)
                if spelling and os.path.isfile(path):  # noqa: PTH113 - Path.is_file raises on names too long
                    return path
        return None


def _portable(name: str) -> str:
    return name.replace("\\", "/")


def _recoded(name: str) -> str:
    """Return the name with its bytes taken as the file system takes them, not as Latin-1."""
    return os.fsdecode(name.encode("latin-1", "replace"))
