"""Nodal rigid bodies, extra nodes, joints and welds of a deck, its contacts and rigid walls.

Columns: the vendor's keyword data as published in its Python library.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from d2rpick.deck.parts import node_sets

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.card import Card, Field, Row
    from d2rpick.deck.reader import Deck


Kind = Literal["nodal rigid body", "extra nodes", "joint", "spotweld", "rivet", "generalized weld"]
_BODY, _EXTRA = "CONSTRAINED_NODAL_RIGID_BODY", "CONSTRAINED_EXTRA_NODES"
_JOINT_NODES = 6


class Constraint(NamedTuple):
    """A constraint: what it is, where it stands, its id (0: none), its nodes and the rigid part it belongs to."""

    kind: Kind
    place: Field
    id: int
    nodes: frozenset[int]
    part: int | None = None


def read_constraints(deck: Deck) -> list[Constraint]:
    """Collect the constraints of a deck; one whose nodes cannot be known has none."""
    sets = node_sets(deck)
    bodies = (one for card in deck.named(_BODY) for one in _nodal_rigid_bodies(card, sets))
    extra = (one for card in deck.named(_EXTRA) for one in _extra_nodes(card, sets))
    joints = (one for card in deck.named("CONSTRAINED_JOINT") for one in _joints(card))
    return [*bodies, *extra, *joints]


def read_welds(deck: Deck) -> Iterator[Constraint]:
    """Collect spotwelds, rivets and generalized welds; one whose nodes cannot be known has none."""
    kinds: tuple[tuple[str, Kind], ...] = (("CONSTRAINED_SPOTWELD", "spotweld"), ("CONSTRAINED_RIVET", "rivet"))
    for name, kind in kinds:
        for card in deck.named(name):  # two nodes on a line, on each where no option adds lines
            rows = _first(card) if card.name != name else card.lines
            yield from (_of_nodes(card, row, kind, 2) for row in rows)
    welds = deck.named("CONSTRAINED_GENERALIZED_WELD")
    sets = node_sets(deck) if welds else {}
    for card in welds:
        for row in _first(card):
            members = card.integer(row, 0)
            nodes = sets.get(members.value + card.transform.set_, frozenset())
            yield Constraint("generalized weld", members.field, 0, nodes)


def _first(card: Card) -> tuple[Row, ...]:
    """The first line, below that of an id (``_ID``)."""
    return card.lines[1:2] if card.name.endswith("_ID") else card.lines[:1]


def _of_nodes(card: Card, row: Row, kind: Kind, most: int, number: int = 0) -> Constraint:
    """Read a constraint whose line lists its nodes."""
    nodes = [card.integer(row, at) for at in range(most)]
    ids = frozenset(node.value + card.transform.node for node in nodes if node.value > 0)
    return Constraint(kind, nodes[0].field, number, ids)


def _nodal_rigid_bodies(card: Card, sets: dict[int, frozenset[int]]) -> Iterator[Constraint]:
    options, rows = card.options(_BODY), card.lines
    if options - {"TITLE"}:  # further lines follow the first: one body per keyword
        rows = rows[:2] if "TITLE" in options else rows[:1]
    for row in rows[1::2] if "TITLE" in options else rows:
        body, nodes = card.integer(row, 0), card.integer(row, 2)
        members = sets.get(nodes.value + card.transform.set_, frozenset()) if nodes.value else frozenset()
        yield Constraint("nodal rigid body", body.field, body.value, members)


def _extra_nodes(card: Card, sets: dict[int, frozenset[int]]) -> Iterator[Constraint]:
    for row in card.rows:
        part, other = card.integer(row, 0), card.integer(row, 1)
        if row.blank or part.problem or other.problem:
            continue
        if card.name.endswith("_SET"):
            nodes = sets.get(other.value + card.transform.set_, frozenset())
        else:
            nodes = frozenset({other.value + card.transform.node})
        yield Constraint("extra nodes", part.field, 0, nodes, part.value + card.transform.part)


def _joints(card: Card) -> Iterator[Constraint]:
    if card.name.startswith(("CONSTRAINED_JOINT_STIFFNESS", "CONSTRAINED_JOINT_COOR", "CONSTRAINED_JOINT_USER_FORCE")):
        return
    for row in _first(card):
        number = card.integer(card.lines[0], 0).value if card.name.endswith("_ID") else 0
        yield _of_nodes(card, row, "joint", _JOINT_NODES, number)


_NO_CONTACTS: Final = {"ADD", "AUTO", "COUPLING", "EXCLUDE", "GEBOD", "GUIDED"}  # first words of their names
_MOST_ROWS = 8  # of one definition without an id; more rows may hold another one


class Entity(NamedTuple):
    """A contact or rigid wall: keyword, id and title as given (0 and empty: none), its number in the deck."""

    keyword: str
    id: int
    title: str
    number: int


class Entities(NamedTuple):
    """What there is to name; ``all_known`` is False where one keyword may define several."""

    found: tuple[Entity, ...]
    all_known: bool

    def named(self, number: int) -> Entity | None:
        """Find by id, else by the order of definition, which counts for those without an id."""
        by_id = next((one for one in self.found if one.id == number), None)
        return by_id or next((one for one in self.found if one.number == number and not one.id), None)


def read_entities(deck: Deck, keyword: Literal["CONTACT", "RIGIDWALL"]) -> Entities:
    """List the contacts, or the rigid walls, of a deck."""
    found: list[Entity] = []
    all_known = not deck.unread and not deck.encrypted
    for card in deck.named(keyword):
        words, number, title = card.name.split("_"), 0, ""
        if words[1:2] and words[1] in _NO_CONTACTS:
            continue
        if {"ID", "TITLE"} & {*words} and card.rows:
            number, title = card.integer(card.rows[0], 0).value, card.rows[0].text[card.width :].strip()
        all_known = all_known and not card.transform.rest and (number > 0 or len(card.rows) <= _MOST_ROWS)
        found.append(Entity(card.name, number, title, len(found) + 1))
    return Entities(tuple(found), all_known)
