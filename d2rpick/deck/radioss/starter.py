"""The starter deck: rigid bodies with their main nodes, sensors and parts.

Columns: Altair's public help for /RBODY, /PART, /GRNOD, /SUBSET and /SENSOR/TIME, and the solver's published source.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.deck.expression import ExpressionError, number
from d2rpick.deck.radioss.blocks import blocks, keyword, whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from d2rpick.deck.card import Card
    from d2rpick.deck.rows import Row, Value
    from d2rpick.deck.source import SourceFile

# Nodes of an element, behind its id on one line; elements of other kinds take more lines and are not followed.
NODES: Final = {
    "SHELL": 4,
    "SH3N": 3,
    "BRICK": 8,
    "TETRA4": 4,
    "PENTA6": 6,
    "QUAD": 4,
    "TRIA": 3,
    "BEAM": 2,
    "TRUSS": 2,
    "SPRING": 2,
}
_UNFOLLOWED: Final = {"BRIC20", "TETRA10", "SHEL16", "SPHCEL", "XELEM"}
WITHOUT_FRAME: Final = {"TETRA4", "TETRA10", "BRIC20", "SHEL16"}  # their stresses do not turn with a rigid body
_SUBMODEL: Final = ""  # before the second slash of //SUBMODEL
_GROUP_FIELD: Final = 6  # of the first line of /RBODY, in columns of 10: the mass before it takes two
_ICOROTATIONAL: Final = 2  # Iframe
_NOT_TURNED: Final = {1, 2}  # Isolid of bricks without a co-rotating frame
_WIDTH: Final = 10


class Body(NamedTuple):
    """A rigid body: its id, main node, sensor and group of nodes (0: none)."""

    id: int
    node: Value[int]
    sensor: int
    group: int
    card: Card


class PartLine(NamedTuple):
    """What /PART says: ids of property, material and subset."""

    title: str
    prop: int
    subset: int


@dataclass(eq=False)
class Starter:
    """What a starter deck says about its rigid bodies; ``sources`` are its files."""

    name: str = ""
    bodies: list[Body] = field(default_factory=list)
    parts: dict[int, PartLine] = field(default_factory=dict)
    subsets: dict[int, tuple[int, ...]] = field(default_factory=dict)
    groups: dict[int, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    timed: dict[int, tuple[float, float]] = field(default_factory=dict)  # sensors: active from, to
    unturned: set[int] = field(default_factory=set)  # properties of bricks without a co-rotating frame
    unturned_parts: set[int] = field(default_factory=set)  # of elements that have none
    moved: bool = False  # whether a submodel may offset its ids
    sources: list[SourceFile] = field(default_factory=list)

    def take(self, card: Card, words: tuple[str, ...]) -> None:
        """Keep what a card says."""
        if words[0] == _SUBMODEL:
            self.moved = True
            return
        if words[0] in WITHOUT_FRAME:
            self.unturned_parts.add(whole(words[1]) if words[1:] else 0)
            return
        rows = [row for row in card.rows if not row.blank]
        id_ = whole(words[_ID_AT.get(words[0], 1)]) if len(words) > _ID_AT.get(words[0], 1) else 0
        if words[0] == "BEGIN" and rows:
            self.name = rows[0].text.strip()
        elif words[0] == "RBODY" and len(rows) > 1:
            first = rows[1]
            sensor, group = card.integer(first, 1).value, card.integer(first, _GROUP_FIELD).value
            self.bodies.append(Body(id_, card.integer(first, 0), sensor, group, card))
        elif words[0] == "PART" and len(rows) > 1:
            prop, subset = card.integer(rows[1], 0).value, card.integer(rows[1], 2).value
            self.parts[id_] = PartLine(rows[0].text.strip(), prop, subset)
        elif words[0] == "SUBSET":
            self.subsets[id_] = _ids(rows[1:])
        elif words[0] == "GRNOD" and words[1:]:
            self.groups[id_] = words[1], _ids(rows[1:])
        elif words[:2] == ("SENSOR", "TIME") and len(rows) > 1:
            start, stop = (_real(rows[1].text[at : at + 2 * _WIDTH]) for at in (0, 2 * _WIDTH))
            self.timed[id_] = start, stop if stop > 0 else math.inf
        elif words[:2] in {("PROP", "SOLID"), ("PROP", "TYPE14")} and len(rows) > 1:
            isolid, iframe = card.integer(rows[1], 0).value, card.integer(rows[1], 7).value
            if isolid in _NOT_TURNED and iframe != _ICOROTATIONAL:
                self.unturned.add(id_)

    def elements(self) -> Iterator[tuple[int, frozenset[int]]]:
        """Part and nodes of every element; no nodes for one whose lines are not followed."""
        for source in self.sources:
            for block in blocks(source):
                words = keyword(block)
                if words[1:] and words[0] in NODES:
                    part = whole(words[1])
                    yield from ((part, _nodes(line, NODES[words[0]])) for _, line in block.lines() if line.strip())
                elif words[1:] and words[0] in _UNFOLLOWED:
                    yield whole(words[1]), frozenset()

    def parts_in(self, subset: int) -> set[int]:
        """Parts of a subset and of those below it."""
        waiting, seen = [subset], set[int]()
        while waiting:
            current = waiting.pop()
            if current not in seen:
                seen.add(current)
                waiting += self.subsets.get(current, ())
        return {part for part, line in self.parts.items() if line.subset in seen}

    def group_members(self, group: int) -> tuple[set[int], set[int]] | None:
        """Nodes and whole parts of a group of nodes; None where they cannot be known."""
        nodes, parts = set[int](), set[int]()
        waiting, seen = [group], set[int]()
        while waiting:
            current = waiting.pop()
            if current in seen:
                continue
            seen.add(current)
            kind, ids = self.groups.get(current, ("", ()))
            if kind == "NODE":
                nodes.update(ids)
            elif kind == "PART":
                parts.update(ids)
            elif kind == "SUBSET":
                parts.update(*(self.parts_in(one) for one in ids))
            elif kind == "GRNOD" and all(one > 0 for one in ids):
                waiting += ids
            else:
                return None
        return nodes, parts


_ID_AT: Final = {"GRNOD": 2, "SENSOR": 2, "PROP": 2}  # where a keyword has its id; others behind their name
# Keywords of the cards that say what a `Starter` keeps.
KEPT: Final = {*WITHOUT_FRAME, _SUBMODEL, "BEGIN", "RBODY", "PART", "SUBSET", "GRNOD", "SENSOR", "PROP"}


def rigid_parts(starter: Starter, bodies: Mapping[int, int]) -> dict[int, set[int]]:
    """Parts that lie whole in the group of each body.

    Parameters
    ----------
    starter : Starter
        The deck.
    bodies : mapping
        Group of nodes by main node.

    Returns
    -------
    dict
        Parts by main node; empty where the members of the group are not known.
    """
    members = {node: starter.group_members(group) for node, group in bodies.items()}
    named = {node: set(known[1]) if known else set() for node, known in members.items()}
    of_nodes = {node: known[0] for node, known in members.items() if known and known[0]}
    if of_nodes:
        whole: dict[tuple[int, int], bool] = {}
        for part, nodes in starter.elements():
            for node, group in of_nodes.items():
                key = node, part
                whole[key] = whole.get(key, True) and bool(nodes) and nodes <= group
        for (node, part), inside in whole.items():
            if inside:
                named[node].add(part)
    return named


def _nodes(line: str, count: int) -> frozenset[int]:
    cells = (line[start : start + _WIDTH].strip() for start in range(_WIDTH, _WIDTH * (count + 1), _WIDTH))
    return frozenset(node for cell in cells if (node := whole(cell)))


def _ids(rows: Iterable[Row]) -> tuple[int, ...]:
    """Ids on lines of 10 columns; a word ends what can be followed and counts as -1."""
    cells = [row.text[start : start + _WIDTH].strip() for row in rows for start in range(0, len(row.text), _WIDTH)]
    return tuple(whole(cell) or -1 for cell in cells if cell)


def _real(text: str) -> float:
    """Read a number; a blank is 0, and what is none is not known."""
    try:
        return float(number(text)) if text.strip() else 0.0
    except ExpressionError:
        return math.nan
