"""Nodes that parts share: the one question for which the element data of a deck are read."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from d2rpick.deck.card import LONG

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from d2rpick.deck.card import Card
    from d2rpick.deck.reader import Deck

_NODES: Final = {
    "SHELL": 8,
    "SOLID": 10,
    "TSHELL": 8,
    "BEAM": 2,
}  # that hold the part; a beam's third orients it
_OPTIONS: Final = {  # their lines hold reals or words, or a single integer
    *("THICKNESS", "BETA", "MCID", "OFFSET", "ORTHO", "ORIENTATION", "COMPOSITE", "LONG", "SCALAR", "SECTION"),
    "ELFORM",
}
_INTEGERS = re.compile(r"[-+\d\s,]*\Z", re.ASCII)
_WIDTH, _WIDTH_PERCENT = 8, 10


def first_shared_nodes(deck: Deck, bodies: Mapping[int, int]) -> dict[tuple[int, int], int]:
    """Find a node for every two parts of different bodies that share one.

    Parameters
    ----------
    deck : Deck
        The deck whose *ELEMENT cards are read.
    bodies : mapping
        Body of every part in question; parts of one body may share nodes.

    Returns
    -------
    dict
        The first node found for each pair of parts (lower id first).
    """
    owner: dict[int, int] = {}
    shared: dict[tuple[int, int], int] = {}
    for card in _elements(deck, read=True):
        kind = card.name.split("_")[1]
        for part, nodes in _connectivity(card, _NODES[kind], bodies):
            for node in nodes:
                other = owner.setdefault(node, part)
                if other != part and bodies[other] != bodies[part]:
                    shared.setdefault((min(part, other), max(part, other)), node)
    return shared


def nodes_of(deck: Deck, parts: Collection[int]) -> dict[int, int]:
    """Nodes of some parts, each with the first of these parts that has it."""
    bodies = dict.fromkeys(parts, 0)
    found: dict[int, int] = {}
    for card in _elements(deck, read=True):
        for part, nodes in _connectivity(card, _NODES[card.name.split("_")[1]], bodies):
            found.update((node, part) for node in nodes if node not in found)
    return found


def unread_elements(deck: Deck) -> list[Card]:
    """Cards of elements whose lines are not followed: nodes that their parts share are not found."""
    return list(_elements(deck, read=False))


def _elements(deck: Deck, *, read: bool) -> Iterator[Card]:
    for card in deck.named(*(f"ELEMENT_{kind}" for kind in _NODES)):
        if read == (set(card.name.split("_")[2:]) <= _OPTIONS):
            yield card


def _connectivity(card: Card, count: int, bodies: Mapping[int, int]) -> Iterator[tuple[int, set[int]]]:
    """Part and nodes (with their offsets) of the elements whose part is in question."""
    width = LONG if card.width == LONG else _WIDTH_PERCENT if "%" in card.block.head else _WIDTH
    part: int | None = None  # of an element whose nodes stand on the next line
    for _, line in card.block.lines():
        if not line.strip() or not _INTEGERS.match(line):
            continue
        cells = line.split(",") if "," in line else _cells(line, width, count + 2)
        if part is None:
            if "ELFORM" in card.name and not any(cell.strip() for cell in cells[2:]):
                continue
            part, cells = _integer(cells, 1) + card.transform.part, cells[2:]
            if not any(cell.strip() for cell in cells):
                continue
        if part in bodies:
            nodes = {_integer(cells, position) for position in range(min(count, len(cells)))}
            yield part, {node + card.transform.node for node in nodes if node}
        part = None


def _cells(line: str, width: int, count: int) -> list[str]:
    return [line[start : start + width] for start in range(0, min(len(line), width * count), width)]


def _integer(cells: list[str], position: int) -> int:
    """Return an id; 0 for what is none, since a part that cannot be read is not one in question."""
    text = cells[position].strip() if position < len(cells) else ""
    return int(text) if text.isascii() and text.isdigit() and len(text) <= LONG else 0
