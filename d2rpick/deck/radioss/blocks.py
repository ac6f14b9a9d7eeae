"""Keyword blocks of Radioss files: a line that begins with ``/``, and the data lines below it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.deck.card import Card
from d2rpick.deck.parameters import Scope
from d2rpick.deck.source import Block

if TYPE_CHECKING:
    from collections.abc import Iterator

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
