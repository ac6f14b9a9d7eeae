"""Nodal rigid bodies, extra nodes, joints and welds of a deck, its contacts and rigid walls.

Columns: the vendor's keyword data as published in its Python library.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.card import Card, Field, Row
    from d2rpick.deck.reader import Deck


Kind = Literal["nodal rigid body", "extra nodes", "joint", "spotweld", "rivet", "generalized weld"]
_PER_LINE = 8
_JOINT_NODES = 6
_LISTS = {"LIST", "TITLE", "GENERATE", "COLUMN"}


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
    found: list[Constraint] = []
    for card in deck.named("CONSTRAINED_NODAL_RIGID_BODY"):
        found += _nodal_rigid_bodies(card, sets)
    for card in deck.named("CONSTRAINED_EXTRA_NODES"):
        found += _extra_nodes(card, sets)
    for card in deck.named("CONSTRAINED_JOINT"):
        found += _joints(card)
    return found


def read_welds(deck: Deck) -> Iterator[Constraint]:
    """Collect spotwelds, rivets and generalized welds; one whose nodes cannot be known has none."""
    kinds: tuple[tuple[str, Kind], ...] = (("CONSTRAINED_SPOTWELD", "spotweld"), ("CONSTRAINED_RIVET", "rivet"))
    for name, kind in kinds:
        for card in deck.named(name):
            yield from _pairs(card, kind, name)
    sets = node_sets(deck) if any(True for _ in deck.named("CONSTRAINED_GENERALIZED_WELD")) else {}
    for card in deck.named("CONSTRAINED_GENERALIZED_WELD"):
        rows = [row for row in card.rows if not row.blank]
        for row in rows[1:2] if card.name.endswith("_ID") else rows[:1]:
            members = card.integer(row, 0)
            nodes = sets.get(members.value + card.transform.set_, frozenset())
            yield Constraint("generalized weld", members.field, 0, nodes)


def _pairs(card: Card, kind: Kind, name: str) -> Iterator[Constraint]:
    """Two nodes on a line, on each where no option adds lines."""
    rows, options = [row for row in card.rows if not row.blank], card.name.removeprefix(name)
    first = int(options.endswith("_ID"))
    for row in rows[first : first + 1] if options else rows:
        nodes = [card.integer(row, at) for at in range(2)]
        ids = frozenset(node.value + card.transform.node for node in nodes if node.value > 0)
        yield Constraint(kind, nodes[0].field, 0, ids)


def _nodal_rigid_bodies(card: Card, sets: dict[int, frozenset[int]]) -> Iterator[Constraint]:
    options = set(card.name.removeprefix("CONSTRAINED_NODAL_RIGID_BODY").split("_")) - {""}
    rows = [row for row in card.rows if not row.blank]
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
    rows = [row for row in card.rows if not row.blank]
    number = card.integer(rows[0], 0).value if rows and card.name.endswith("_ID") else 0
    for row in rows[1:2] if card.name.endswith("_ID") else rows[:1]:
        values = [card.integer(row, at) for at in range(_JOINT_NODES)]
        nodes = frozenset(value.value + card.transform.node for value in values if value.value > 0)
        yield Constraint("joint", values[0].field, number, nodes)


def node_sets(deck: Deck) -> dict[int, frozenset[int]]:
    """Members of the node sets whose lines are followed."""
    found: dict[int, frozenset[int]] = {}
    for card in deck.named("SET_NODE"):
        options = set(card.name.split("_")[2:])
        rows = [row for row in (card.rows[1:] if "TITLE" in options else card.rows) if not row.blank]
        if rows and options <= _LISTS:
            members = _members(card, rows[1:], options)
            found[card.integer(rows[0], 0).value + card.transform.set_] = members
    return found


def _members(card: Card, rows: Sequence[Row], options: set[str]) -> frozenset[int]:
    per_line = 1 if "COLUMN" in options else _PER_LINE
    ids = [card.integer(row, at).value for row in rows for at in range(per_line)]
    ids = [number + card.transform.node for number in ids if number > 0]
    if "GENERATE" not in options:
        return frozenset(ids)
    return frozenset(node for low, high in zip(ids[::2], ids[1::2], strict=False) for node in range(low, high + 1))


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


def read_contacts(deck: Deck) -> Entities:
    """List the contacts of a deck."""
    return _read(deck, "CONTACT")


def read_rigid_walls(deck: Deck) -> Entities:
    """List the rigid walls of a deck."""
    return _read(deck, "RIGIDWALL")


def _read(deck: Deck, kind: str) -> Entities:
    found: list[Entity] = []
    all_known = not deck.unread and not deck.encrypted
    for keyword, number, title, rows, moved in _cards(deck, kind):
        all_known = all_known and not moved and (number > 0 or rows <= _MOST_ROWS)
        found.append(Entity(keyword, number, title, len(found) + 1))
    return Entities(tuple(found), all_known)


def _cards(deck: Deck, kind: str) -> Iterator[tuple[str, int, str, int, bool]]:
    """Keyword, id, title, number of lines, and whether the ids are moved by an include, of each definition."""
    for card in deck.named(kind):
        words = card.name.split("_")
        if words[1:2] and words[1] in _NO_CONTACTS:
            continue
        number, title = 0, ""
        if {"ID", "TITLE"} & {*words} and card.rows:
            value = card.integer(card.rows[0], 0)
            number, title = value.value, card.rows[0].text[card.width :].strip()
        yield card.name, number, title, len(card.rows), card.transform.rest != 0
