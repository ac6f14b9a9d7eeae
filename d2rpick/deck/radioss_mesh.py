"""Elements and nodes of a Radioss starter deck, as arrays.

Columns: Altair's public help for the elements, and the solver's published source.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck.columns import layout, lines_of
from d2rpick.deck.radioss_engine import whole

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.columns import Integers, Layout, Reals


_COMMENTS: Final = b"$#"
_WIDTH, _REAL = 10, 20


class _Kind(NamedTuple):
    """Kind of elements: what to call it, nodes that hold the part, ids on each of its lines."""

    name: str
    nodes: int
    lines: tuple[int, ...]


KINDS: Final = {
    "SHELL": _Kind("shell", 4, (5,)), "SH3N": _Kind("triangle", 3, (4,)), "BRICK": _Kind("solid", 8, (9,)),
    "TETRA4": _Kind("tetrahedron", 4, (5,)), "PENTA6": _Kind("pentahedron", 6, (7,)), "QUAD": _Kind("quad", 4, (5,)),
    "TRIA": _Kind("tria", 3, (4,)), "BEAM": _Kind("beam", 2, (3,)), "TRUSS": _Kind("truss", 2, (3,)),
    "SPRING": _Kind("spring", 2, (3,)), "TETRA10": _Kind("tetrahedron", 10, (1, 10)),
    "BRIC20": _Kind("solid", 20, (9, 8, 4)), "SHEL16": _Kind("thick shell", 16, (9, 8)),
}  # fmt: skip
NOT_COUNTED: Final = {"SPHCEL", "XELEM"}


def elements_of(card: Card, words: tuple[str, ...]) -> Iterator[tuple[str, Integers, Integers]]:
    """Kind, parts and node ids of the elements of a card."""
    kind, part = KINDS[words[0]], whole(words[1]) if words[1:] else 0
    fields: Layout = layout(*[_WIDTH] * max(kind.lines))
    found = [lines.integers(fields) for lines in lines_of(card, _COMMENTS) if len(lines)]
    if not found:
        return
    values = np.concatenate(found)
    per = len(kind.lines)
    values = values[: len(values) // per * per].reshape(-1, per, values.shape[1])
    flat = np.concatenate([values[:, line, :count] for line, count in enumerate(kind.lines)], axis=1)
    good = (flat[:, 0] > 0) & (flat[:, 1 : 1 + min(kind.nodes, 3)] > 0).all(axis=1)
    nodes = np.maximum(flat[good, 1 : 1 + kind.nodes], 0)
    yield kind.name, np.full(len(nodes), part, np.int64), nodes


def nodes_of(cards: Sequence[Card]) -> tuple[Integers, Reals]:
    """Ids of nodes (n,) and where they lie (n, 3) [length]."""
    ids, places = [np.empty(0, np.int64)], [np.empty((0, 3))]
    fields: Layout = layout(_WIDTH, _REAL, _REAL, _REAL)
    for card in cards:
        for lines in lines_of(card, _COMMENTS):
            if len(lines):
                numbers = lines.integers(fields[:1])[:, 0]
                ids.append(numbers[numbers > 0])
                places.append(lines.reals(fields, slice(1, 4))[numbers > 0])
    return np.concatenate(ids), np.concatenate(places)
