"""Keyword blocks of Radioss files, and the engine files: legs of a run, their ends, the rigid bodies they switch.

A block is a line that begins with ``/``, and the data lines below it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from d2rpick.deck.card import Card, Field, Row, Scope, Value
from d2rpick.deck.expression import ExpressionError, number
from d2rpick.deck.source import Block

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.source import SourceFile

_INCLUDE = b"#include"
_DIGITS = 10  # of an id


def blocks(source: SourceFile) -> Iterator[Block]:
    """Keyword blocks and ``#include`` lines in the order of the file, up to ``/END``."""
    start: tuple[int, str] | None = None
    for position, raw in _marks(source):
        if start:
            yield Block(source, start[0], position, start[1])
        start = position, raw.rstrip(b"\r\n").decode("latin-1")
        if start[1].upper().split() == ["/END"]:
            return
    if start:
        yield Block(source, start[0], None, start[1])


def _marks(source: SourceFile) -> Iterator[tuple[int, bytes]]:
    """Lines that begin with ``/`` or ``#include``, and where; found without a look at each line of a mesh."""
    position = 0
    for lines in source.pieces(0):
        yield from ((position + at, raw) for at, raw in _marked(lines))
        position += len(lines)


def _marked(lines: bytes) -> list[tuple[int, bytes]]:
    found = [0] if lines[:1] in (b"/", b"#") else []
    for mark in (b"\n/", b"\n#"):
        at = lines.find(mark)
        while at >= 0:
            found.append(at + 1)
            at = lines.find(mark, at + 1)
    marked = [(at, lines[at : lines.find(b"\n", at) + 1 or None]) for at in sorted(found)]
    return [(at, raw) for at, raw in marked if raw.startswith(b"/") or raw[: len(_INCLUDE)].lower() == _INCLUDE]


def keyword(block: Block) -> tuple[str, ...]:
    """Words of a keyword line in upper case; empty for an ``#include``.

    The name of the run in ``/RUN/name/1`` is in upper case too: `Card.block` has it as written.
    """
    return tuple(word.strip().upper() for word in block.head[1:].split("/")) if block.head.startswith("/") else ()


def whole(text: str) -> int:
    """Read an id of a keyword line or of 10 columns; 0 for what is none."""
    text = text.strip()
    return int(text) if text.isdecimal() and len(text) <= _DIGITS else 0


def card_of(block: Block) -> Card:
    """Show a block as a card, whose fields are 10 columns wide."""
    return Card("/".join(keyword(block)), block, Scope())


def number_of(card: Card, at: int = 1) -> int:
    """Id in the keyword of a card, as one of its words; 0 for none."""
    return whole("".join(card.words[at:][:1]))


def below_title(card: Card) -> tuple[Row, ...]:
    """Lines that are not blank, below that of the title, which may be blank."""
    return tuple(row for row in card.rows[1:] if not row.blank)


class Start(NamedTuple):
    """An /INIV: velocities given at the start of a leg to ranges of nodes, or to a group of nodes (else 0)."""

    card: Card
    ranges: tuple[tuple[int, int], ...]
    group: int


@dataclass(eq=False)
class Leg:
    """One engine run: its name and number as /RUN gives them, its end, the main nodes it switches, its step limit."""

    run: Card
    name: str
    number: int
    stop: Value[float]
    switched: list[tuple[Card, bool, tuple[Value[int], ...]]] = field(default_factory=list)  # True: made rigid
    cap: Value[float] | None = None
    version: str = ""
    starts: list[Start] = field(default_factory=list)


def read_legs(source: SourceFile) -> list[Leg]:
    """Read the legs of a file: one, or several where printed cards are read as they come."""
    legs: list[Leg] = []
    waiting: list[Card] = []
    for card in map(card_of, blocks(source)):
        waiting.append(card)
        if card.words[0] == "RUN":
            legs.append(_leg(card))
        while legs and waiting:
            _take(legs[-1], waiting.pop(0))
    return legs


def kept_off(legs: Sequence[Leg]) -> tuple[int, ...]:
    """Main nodes of the bodies that the first leg puts off and none puts on, in the order of the file."""
    states = {node.value: rigid for leg in legs[:1] for _, rigid, nodes in leg.switched for node in nodes if node.value}
    on = {node.value for leg in legs for _, rigid, nodes in leg.switched for node in nodes if rigid}
    return tuple(node for node, rigid in states.items() if not rigid and node not in on)


def _leg(card: Card) -> Leg:
    missing = Value(0.0, card.here, "the end of the run is missing below /RUN")
    name = card.block.head.split("/")[2].strip() if card.words[1:] else ""
    return Leg(card, name, number_of(card, 2), next(_numbers(card), missing))


def _take(leg: Leg, card: Card) -> None:
    words = card.words
    if words[:2] in {("RBODY", "ON"), ("RBODY", "OFF")}:
        leg.switched.append((card, words[1] == "ON", tuple(_integer(value) for value in _numbers(card))))
    elif words == ("DTIX",):
        leg.cap = next(reversed(list(_numbers(card))), None)
    elif words[0] == "INIV":
        leg.starts.append(_start(card))
    elif words[0] == "VERS":
        leg.version = "".join(words[1:2])


def _start(card: Card) -> Start:
    """Read whom an /INIV moves: single nodes, by type 1 first and last of ranges, by type 2 a group.

    Source: Altair's public help for /INIV, and the published source of OpenRadioss.
    """
    type_ = number_of(card, 3)
    before = 5 if card.words[1:2] == ("AXIS",) else 1  # numbers of the velocity
    ids = [_integer(value).value for value in _numbers(card)][before:]
    if type_ == 2:
        return Start(card, (), ids[0] if ids else 0)
    pairs = zip(ids[::2], ids[1::2], strict=False) if type_ == 1 else zip(ids, ids, strict=True)
    return Start(card, tuple(pairs), 0)


def _numbers(card: Card) -> Iterator[Value[float]]:
    """All numbers below a keyword, in free format."""
    for distance, line in card.block.lines():
        column = 0
        for word in line.split():
            column = line.index(word, column)
            place = Field(word, card.block, distance, column + 1)
            column += len(word)
            try:
                yield Value(float(number(word)), place)
            except ExpressionError as error:
                yield Value(0.0, place, str(error))


def _integer(value: Value[float]) -> Value[int]:
    if not value.problem and value.value != int(value.value):
        return Value(0, value.field, f"{value.field.text!r} is not an integer")
    return Value(int(value.value), value.field, value.problem)
