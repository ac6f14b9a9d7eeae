"""Elements and nodes of a Radioss starter deck, as arrays.

Columns: Altair's public help for the elements, and the solver's published source.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck.mesh import layout, lines_of
from d2rpick.deck.radioss_engine import number_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from d2rpick.deck.card import Card
    from d2rpick.deck.mesh import Integers, Layout, Reals
    from d2rpick.deck.radioss_starter import Starter


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


def elements_of(card: Card, *, damaged: bool = False) -> Iterator[tuple[str, Integers, Integers]]:
    """Kind, parts and node ids of the elements of a card, ``damaged`` ones too, with 0 for what is no node."""
    kind = KINDS[card.words[0]]
    fields: Layout = layout(*[_WIDTH] * max(kind.lines))
    found = [lines.integers(fields) for lines in lines_of(card, _COMMENTS) if len(lines)]
    if not found:
        return
    values = np.concatenate(found)
    per = len(kind.lines)
    values = values[: len(values) // per * per].reshape(-1, per, values.shape[1])
    flat = np.concatenate([values[:, line, :count] for line, count in enumerate(kind.lines)], axis=1)
    good = (flat[:, : 1 + min(kind.nodes, 3)] > 0).all(axis=1) | damaged
    nodes = np.maximum(flat[good, 1 : 1 + kind.nodes], 0)
    yield kind.name, np.full(len(nodes), number_of(card), np.int64), nodes


def parts_with_elements(starter: Starter) -> set[int]:
    """Parts that have elements of any kind."""
    return {part for part, _ in _elements(starter)}


def parts_within(starter: Starter, groups: Mapping[int, Collection[int]]) -> dict[int, set[int]]:
    """Parts all of whose nodes are some of these, by the keys of ``groups``."""
    known = {key: np.array([0, *group]) for key, group in groups.items()}
    inside: dict[tuple[int, int], bool] = {}
    for part, nodes in _elements(starter):
        real = bool((nodes > 0).any(axis=1).all())
        for key, own in known.items():
            inside[key, part] = inside.get((key, part), True) and real and bool(np.isin(nodes, own).all())
    return {key: {part for (one, part), whole in inside.items() if whole and one == key} for key in groups}


def _elements(starter: Starter) -> Iterator[tuple[int, Integers]]:
    """Part and node ids of elements, block by block; none where their lines are not followed."""
    for card in starter.named(*KINDS, *NOT_COUNTED):
        kind = KINDS.get(card.words[0])
        if kind and len(kind.lines) == 1 and card.words[1:]:
            yield from ((number_of(card), nodes) for _, _, nodes in elements_of(card, damaged=True))
        elif card.words[1:]:
            yield number_of(card), np.zeros((1, 1), np.int64)


def nodes_of(cards: Iterable[Card]) -> tuple[Integers, Reals]:
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
