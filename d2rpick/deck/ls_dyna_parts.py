"""Read the data of an LS-DYNA deck to which switching cards refer: parts, sections, sets, materials and constraints.

The columns come from the vendor's keyword data as published in its Python library.
"""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Final, Literal
from weakref import WeakKeyDictionary

from d2rpick.base.data_classes import dataclass
from d2rpick.base.graph import find_reachable
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.ls_dyna_columns import (
    ENTITY,
    EXTRA_NODES,
    JOINT,
    MATERIAL,
    MERGED_BODIES,
    NODAL_BODY,
    NODE_PAIR,
    NODE_SET,
    PART,
    PART_INERTIA,
    SECTION,
    SECTION_SIZES,
    SET,
    SET_COLUMN,
    SET_MEMBERS,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, CardField, Problem, Row, Value
    from d2rpick.deck.columns import CardColumn, DataLine
    from d2rpick.deck.reader import Deck


_EXTRA_LINES: Final = {
    "CONTACT": 1,
    "REPOSITION": 1,
    "PRINT": 1,
    "FIELD": 1,
    "INERTIA": 3,
}
# Options of *PART that d2rpick can read; the options AVERAGED and TITLE add no line.
_FOLLOWED: Final = {*_EXTRA_LINES, "AVERAGED", "TITLE"}
_NO_DEFINITION: Final = {"MOVE", "MODES", "SENSOR", "STACKED", "ADAPTIVE", "ANNEAL"}
_ROTATED = 1  # Value of IRCS with which *PART_INERTIA has one more line.
_SET_OPTIONS: Final = {"LIST", "TITLE", "COLLECT", "GENERATE", "COLUMN", "ADD"}
_NODE_SET_OPTIONS: Final = {"LIST", "TITLE", "GENERATE", "COLUMN"}
# Node sets of each deck that have been read.
_NODE_SETS: WeakKeyDictionary[Deck, Mapping[int, frozenset[int]]] = WeakKeyDictionary()
# Nodes of the nodal rigid body to which each node belongs, by deck.
_NODAL_BODIES: WeakKeyDictionary[Deck, Mapping[int, frozenset[int]]] = (
    WeakKeyDictionary()
)
# Solid formulations, by ELFORM, that keep their stresses in global axes; 0 and 9 are co-rotational.
NOT_TURNED: Final = {
    -2: "8 points, selectively reduced, for poor aspect ratios",
    -1: "8 points, selectively reduced, for poor aspect ratios",
    1: "constant stress",
    2: "8 points, selectively reduced",
    3: "8 nodes with rotations",
    4: "4 nodes with rotations",
    10: "tetrahedron with 1 point",
    13: "tetrahedron with nodal pressure",
    15: "pentahedron with 2 points",
    16: "tetrahedron with 10 nodes",
    17: "tetrahedron with 10 nodes",
}
# Number of lines per section, keyed by kind of element.
_LINES: Final = {
    "SOLID": 1,
    "DISCRETE": 2,
    "SHELL": 2,
    "BEAM": 2,
    "TSHELL": 2,
}
_SEARCHED: Final = ("ELEMENT_SHELL", "ELEMENT_SOLID", "ELEMENT_TSHELL", "ELEMENT_BEAM")
# Options of element keywords whose additional lines have no integers in the id columns.
OPTIONS_WITHOUT_IDS: Final = {
    "THICKNESS",
    "BETA",
    "MCID",
    "OFFSET",
    "ORTHO",
    "ORIENTATION",
    "COMPOSITE",
    "LONG",
    "SCALAR",
    "SECTION",
    "ELFORM",
}

_BODY: Final = "CONSTRAINED_NODAL_RIGID_BODY"
# Second words of *CONTACT keywords that do not define a contact.
_NO_CONTACTS: Final = {
    "ADD",
    "AUTO",
    "COUPLING",
    "EXCLUDE",
    "GEBOD",
    "GUIDED",
}
# Words in the names of those contacts whose force can trigger a switch.
_ABLE: Final = (
    "SURFACE_TO_SURFACE",
    "NODES_TO_SURFACE",
    "NODE_TO_SURFACE",
)
# A contact or wall without an id has at most this number of lines; more lines may define a second one.
_MOST_ROWS: Final = 8
# Flags of a switching card that delete each kind of constraint (vendor keyword data).
# No source states which flag deletes extra nodes and joints, so both are listed.
DELETING_FLAGS: Final[Mapping[Kind, tuple[str, ...]]] = {
    "nodal rigid body": ("NRBF",),
    "generalized weld": ("NRBF",),
    "spotweld": ("NCSF",),
    "rivet": ("NCSF",),
    "constrained node set": ("NCSF",),
    "extra nodes": ("NRBF", "NCSF"),
    "joint": ("NRBF", "NCSF"),
}


class DeckPartSet(NamedTuple):
    """Members of a part set: parts, ranges of part ids, and other part sets.

    ``problems`` contains fields that cannot be read; if there are any, the members are unknown.
    """

    parts: tuple[int, ...] = ()
    ranges: tuple[tuple[int, int], ...] = ()
    sets: tuple[int, ...] = ()
    problems: tuple[Problem, ...] = ()

    def joined(self, further: DeckPartSet) -> DeckPartSet:
        """Return the union of this set and another set (``_COLLECT``)."""
        return DeckPartSet(
            self.parts + further.parts,
            self.ranges + further.ranges,
            self.sets + further.sets,
            self.problems + further.problems,
        )


@dataclass(eq=False, repr=False)
class DeckParts:
    """Data of each part, and part sets, by id; None stands for a kind of set that cannot be read.

    ``material_by_part`` contains the material (MID) that each *PART names; the material itself need not be in the deck.
    ``all_known`` is False if an include was not read, a block is encrypted, or a keyword creates parts in a way that
    cannot be read; the deck may then have further parts. ``problems`` contains unreadable ids of parts and sets, and
    unreadable numbers of includes.
    """

    material_by_part: dict[int, str] = field(default_factory=dict)
    titles: dict[int, str] = field(default_factory=dict)
    sections: dict[int, int] = field(default_factory=dict)
    sets: dict[int, DeckPartSet | None] = field(default_factory=dict)
    rigid_materials: set[str] = field(default_factory=set)
    problems: list[Problem] = field(default_factory=list)
    all_known: bool = True

    def is_rigid(self, part: int) -> bool:
        """Return True if the material of the part is a *MAT_RIGID."""
        return (
            part in self.material_by_part
            and self.material_by_part[part] in self.rigid_materials
        )

    def members(self, set_id: int) -> tuple[int, ...] | None:
        """Return the parts of a part set in ascending order; None if they are unknown."""
        part_ids: set[int] = set()
        for current in self.reached(set_id):
            content = self.sets.get(current)
            if (
                content is None
                or content.problems
                or (content.ranges and not self.material_by_part)
            ):
                return None
            part_ids.update(content.parts)
            part_ids.update(
                part
                for low, high in content.ranges
                for part in self.material_by_part
                if low <= part <= high
            )
        return tuple(sorted(part_ids))

    def reached(self, set_id: int) -> list[int]:
        """Return the ids of the set and of all sets that it contains, directly or indirectly.

        Sets that the deck does not define are included.
        """
        return find_reachable(
            [set_id],
            lambda one: content.sets if (content := self.sets.get(one)) else (),
        )


def read_parts(deck: Deck) -> DeckParts:
    """Return the parts, part sets and rigid materials of a deck."""
    parts = DeckParts(
        problems=list(deck.problems), all_known=not deck.unread and not deck.encrypted
    )
    parts.rigid_materials.update(
        name_material(card, card.data[0], MATERIAL["MID"])
        for card in find_rigid_materials(deck)
    )
    for card in deck.named("PART"):
        _add_parts(card, parts)
    for card in deck.named("SET_PART"):
        _add_set(card, parts)
    parts.all_known = parts.all_known and not parts.problems
    return parts


def find_rigid_materials(deck: Deck) -> Iterator[Card]:
    """Yield the *MAT cards of rigid materials."""
    cards = deck.named("MAT_RIGID", "MAT_020", "MAT_20")
    return (
        card
        for card in cards
        if card.data and card.name.split("_")[2:3] != ["DISCRETE"]
    )


def name_material(card: Card, row: Row, column: CardColumn) -> str:
    """Return the id of a material (with its offset) as text, or the name of the material if the deck uses names."""
    value = card.integer(row, column)
    if value.problem:
        return value.field.text.upper()
    return str(value.value + card.transform.material)


def _add_parts(card: Card, parts: DeckParts) -> None:
    """Add the parts on a card."""
    options = card.options("PART")
    if options & _NO_DEFINITION:
        return
    if "ATTACHMENT" in options:
        # The option ATTACHMENT adds one line, like the option PRINT.
        options = (options - {"ATTACHMENT", "NODES"}) | {"PRINT"}
    # A composite is one part with a material per ply, none of which makes the part rigid.
    if "COMPOSITE" in options:
        if len(card.rows) > 1:
            _add_part(card, card.rows[:2], "", parts)
        return
    if not options <= _FOLLOWED:
        parts.all_known = False
        return
    rows = card.rows
    at = 0
    extra_lines = sum(_EXTRA_LINES.get(option, 0) for option in options)
    # A part has a title line, a line of ids, and the lines of its options.
    while at + 1 < len(rows):
        material = name_material(card, rows[at + 1], PART["MID"])
        _add_part(card, rows[at : at + 2], material, parts)
        at += 2
        is_rotated = (
            "INERTIA" in options
            and at < len(rows)
            and card.integer(rows[at], PART_INERTIA["IRCS"]).value == _ROTATED
        )
        at += extra_lines + is_rotated


def _add_part(
    card: Card, lines: Sequence[Row], material: str, parts: DeckParts
) -> None:
    """Add a part from its title line and its line of ids."""
    title, row = lines
    part = card.integer(row, PART["PID"])
    section = card.integer(row, PART["SECID"])
    if part.problem:
        parts.problems.append((part.field, part.problem))
    elif part.value > 0:
        number = part.value + card.transform.part
        parts.material_by_part[number], parts.titles[number] = (
            material,
            title.text.strip(),
        )
        if material and not section.problem and section.value:
            parts.sections[number] = section.value + card.transform.rest


def _add_set(card: Card, parts: DeckParts) -> None:
    """Add the part set on a card."""
    options = card.options("SET_PART")
    rows = card.data
    if not rows:
        return
    first = card.integer(rows[0], SET["SID"])
    if first.problem:
        parts.problems.append((first.field, first.problem))
        return
    set_id = first.value + card.transform.set_
    values = _read_listed_ids(card, options)
    ranges = "ADD" in options and any(value.value < 0 for value in values)
    if ranges or not options <= _SET_OPTIONS:
        parts.sets[set_id] = None
        return
    content = _read_set_members(card, options, values)
    earlier = parts.sets.get(set_id)
    if earlier and "COLLECT" in options:
        parts.sets[set_id] = earlier.joined(content)
    else:
        parts.sets[set_id] = content


def _read_set_members(
    card: Card, options: Collection[str], values: Sequence[Value[int]]
) -> DeckPartSet:
    """Return the members of a part set from the values on its lines."""
    offset = card.transform.set_ if "ADD" in options else card.transform.part
    message = "{!r} in a part set cannot be used, expected a positive id"
    wrong_values = (value for value in values if value.problem or value.value < 0)
    problems = tuple(
        (value.field, value.problem or message.format(value.field.text))
        for value in wrong_values
    )
    ids = tuple(value.value + offset for value in values if value.value > 0)
    if "GENERATE" in options:
        return DeckPartSet(
            ranges=tuple(zip(ids[::2], ids[1::2], strict=False)), problems=problems
        )
    if "ADD" in options:
        return DeckPartSet(sets=ids, problems=problems)
    return DeckPartSet(parts=ids, problems=problems)


def find_set_nodes(deck: Deck, card: Card, number: int) -> frozenset[int] | None:
    """Return the nodes of the node set to which a card refers; None if the set is missing or cannot be read."""
    if deck not in _NODE_SETS:
        _NODE_SETS[deck] = {
            id_: ids
            for set_card in deck.named("SET_NODE")
            for id_, ids in _read_node_set(set_card)
        }
    return _NODE_SETS[deck].get(number + card.transform.set_)


def _read_node_set(card: Card) -> Iterator[tuple[int, frozenset[int]]]:
    """Yield the id and the nodes of a node set."""
    options = card.options("SET_NODE")
    if card.data and options <= _NODE_SET_OPTIONS:
        ids = [
            value.value + card.transform.node
            for value in _read_listed_ids(card, options)
            if value.value > 0
        ]
        if "GENERATE" in options:
            ids = [
                node
                for low, high in zip(ids[::2], ids[1::2], strict=False)
                for node in range(low, high + 1)
            ]
        number = card.integer(card.data[0], SET["SID"]).value
        yield number + card.transform.set_, frozenset(ids)


def _read_listed_ids(card: Card, options: Collection[str]) -> list[Value[int]]:
    """Return the ids below the first line of a set."""
    columns = SET_COLUMN if "COLUMN" in options else SET_MEMBERS
    return [
        card.integer(row, column)
        for row in card.data[1:]
        for column in columns
        if row.cell(column.position)
    ]


class SectionCard(NamedTuple):
    """A *SECTION card: its element kind and its ELFORM.

    ``first`` is the first number of its second line, and ``layers`` the number of integration points through the
    thickness.
    """

    kind: str
    elform: int
    first: float | None
    layers: int | None

    @property
    def unturned(self) -> str:
        """Return the formulation of solids whose stresses do not rotate with a rigid body; empty for other elements."""
        return NOT_TURNED.get(self.elform, "") if self.kind == "SOLID" else ""


def read_sections(deck: Deck) -> dict[int, SectionCard]:
    """Return the sections, keyed by id."""
    return {
        number: section
        for card in deck.named("SECTION")
        for number, section in _read_card_sections(card)
    }


def _read_card_sections(card: Card) -> Iterator[tuple[int, SectionCard]]:
    """Yield the id and the content of each section on a card."""
    kind = card.name.split("_")[1]
    options = card.options(f"SECTION_{kind}")
    rows = card.lines
    titled = "TITLE" in options
    per_section = _LINES.get(kind)
    if per_section is None or options - {"TITLE"}:
        rows = rows[int(titled) :][:2]
        per_section = 2
        titled = False
    for at in range(titled, len(rows), per_section + titled):
        number = card.integer(rows[at], SECTION["SECID"])
        default = 1 if kind == "SOLID" else 2
        elform = card.integer(rows[at], SECTION["ELFORM"], default)
        layers = card.integer(rows[at], SECTION["NIP"], 2) if kind == "SHELL" else None
        through = (layers.value or 2) if layers and not layers.problem else None
        second = rows[at + 1] if per_section > 1 and at + 1 < len(rows) else None
        first = card.positive(second, SECTION_SIZES["FIRST"]) if second else None
        if not number.problem:
            section = SectionCard(
                kind, 0 if elform.problem else elform.value, first, through
            )
            yield number.value + card.transform.rest, section


def find_element_cards(deck: Deck, *, searched: bool) -> list[Card]:
    """Return the element cards in which the nodes of constraints are searched for; the others if not ``searched``."""
    cards = deck.named(*_SEARCHED)
    return [
        card
        for card in cards
        if searched == (set(card.name.split("_")[2:]) <= OPTIONS_WITHOUT_IDS)
    ]


def find_tied_contacts(deck: Deck) -> list[Card]:
    """Return the cards of tied contacts, which join parts."""
    return [
        card
        for card in deck.named("CONTACT")
        if card.name.startswith(("CONTACT_TIED", "CONTACT_SPOTWELD"))
        or "TIEBREAK" in card.name
    ]


Kind = Literal[
    "nodal rigid body",
    "extra nodes",
    "joint",
    "spotweld",
    "rivet",
    "generalized weld",
    "constrained node set",
]


class Constraint(NamedTuple):
    """A constraint: its kind, field, id (0 if it has none), nodes, and the rigid part to which it belongs.

    The nodes of a joint include all nodes of the nodal rigid bodies that it connects.
    """

    kind: Kind
    place: CardField
    id: int
    nodes: frozenset[int]
    part: int | None = None


def read_constraints(deck: Deck, *kinds: Kind) -> Iterator[Constraint]:
    """Yield the constraints of the given kinds; a constraint has no nodes if its nodes are unknown."""
    for kind in kinds:
        keyword, read_card = _CONSTRAINTS[kind]
        for card in deck.named(keyword):
            yield from read_card(deck, card, kind)


def _read_nodal_rigid_bodies(
    deck: Deck, card: Card, kind: Kind
) -> Iterator[Constraint]:
    """Yield the nodal rigid bodies on a card."""
    options = card.options(_BODY)
    rows = card.lines
    # Other options add lines, so a keyword with such options defines only one body.
    if options - {"TITLE"}:
        rows = rows[:2] if "TITLE" in options else rows[:1]
    for row in rows[1::2] if "TITLE" in options else rows:
        body = card.integer(row, NODAL_BODY["PID"])
        nodes = card.integer(row, NODAL_BODY["NSID"])
        members = find_set_nodes(deck, card, nodes.value) if nodes.value else None
        yield Constraint(kind, body.field, body.value, members or frozenset())


def _read_extra_nodes(deck: Deck, card: Card, kind: Kind) -> Iterator[Constraint]:
    """Yield the extra nodes on a card."""
    for row in card.rows:
        part = card.integer(row, EXTRA_NODES["PID"])
        node_or_set = card.integer(row, EXTRA_NODES["NID"])
        if row.blank or part.problem or node_or_set.problem:
            continue
        if card.name.endswith("_SET"):
            single = None
        else:
            single = frozenset({node_or_set.value + card.transform.node})
        nodes = single or find_set_nodes(deck, card, node_or_set.value) or frozenset()
        yield Constraint(kind, part.field, 0, nodes, part.value + card.transform.part)


def _read_joint(deck: Deck, card: Card, kind: Kind) -> Iterator[Constraint]:
    """Yield the joint on a card."""
    if card.name.startswith(
        (
            "CONSTRAINED_JOINT_STIFFNESS",
            "CONSTRAINED_JOINT_COOR",
            "CONSTRAINED_JOINT_USER_FORCE",
        )
    ):
        return
    for row in _get_first_line(card):
        if card.name.endswith("_ID"):
            number = card.integer(card.lines[0], ENTITY["ID"]).value
        else:
            number = 0
        joint = _read_node_list(card, row, kind, JOINT, number)
        bodies = _map_nodal_bodies(deck)
        further = (bodies.get(node, frozenset()) for node in joint.nodes)
        yield joint._replace(nodes=joint.nodes.union(*further))


def _map_nodal_bodies(deck: Deck) -> Mapping[int, frozenset[int]]:
    """Return the nodes of the nodal rigid body to which each node belongs, keyed by node id."""
    if deck not in _NODAL_BODIES:
        _NODAL_BODIES[deck] = {
            node: body.nodes
            for body in read_constraints(deck, "nodal rigid body")
            for node in body.nodes
        }
    return _NODAL_BODIES[deck]


def _read_node_pairs(_: Deck, card: Card, kind: Kind) -> Iterator[Constraint]:
    """Return the constraints between two nodes: one per line, or one per card if an option adds lines."""
    rows = card.lines if card.name == _CONSTRAINTS[kind][0] else _get_first_line(card)
    return (_read_node_list(card, row, kind, NODE_PAIR) for row in rows)


def _read_constrained_set(deck: Deck, card: Card, kind: Kind) -> Iterator[Constraint]:
    """Yield the constraint of a node set on a card."""
    for row in _get_first_line(card):
        members = card.integer(row, NODE_SET["NSID"])
        yield Constraint(
            kind,
            members.field,
            0,
            find_set_nodes(deck, card, members.value) or frozenset(),
        )


def _get_first_line(card: Card) -> tuple[Row, ...]:
    """Return the first line of a card, or the next line if the option ``_ID`` adds an id line."""
    return card.lines[1:2] if card.name.endswith("_ID") else card.lines[:1]


def _read_node_list(
    card: Card, row: Row, kind: Kind, line: DataLine, number: int = 0
) -> Constraint:
    """Read a constraint from a line that lists its nodes."""
    nodes = [card.integer(row, column) for column in line]
    ids = frozenset(
        node.value + card.transform.node for node in nodes if node.value > 0
    )
    return Constraint(kind, nodes[0].field, number, ids)


# For each kind of constraint, its keyword and the function that reads a card with this keyword.
_CONSTRAINTS: Final[
    Mapping[Kind, tuple[str, Callable[[Deck, Card, Kind], Iterator[Constraint]]]]
] = {
    "nodal rigid body": (_BODY, _read_nodal_rigid_bodies),
    "extra nodes": ("CONSTRAINED_EXTRA_NODES", _read_extra_nodes),
    "joint": ("CONSTRAINED_JOINT", _read_joint),
    "spotweld": ("CONSTRAINED_SPOTWELD", _read_node_pairs),
    "rivet": ("CONSTRAINED_RIVET", _read_node_pairs),
    "generalized weld": ("CONSTRAINED_GENERALIZED_WELD", _read_constrained_set),
    "constrained node set": ("CONSTRAINED_NODE_SET", _read_constrained_set),
}


def read_merged_bodies(deck: Deck) -> Iterator[tuple[CardField, frozenset[int]]]:
    """Yield the place and the two parts of each pair that *CONSTRAINED_RIGID_BODIES merges into one rigid body.

    With the option SET, the second number is a part set, and only the first part is returned.
    """
    for card in deck.named("CONSTRAINED_RIGID_BODIES"):
        has_set = "SET" in card.options("CONSTRAINED_RIGID_BODIES")
        for row in card.data:
            values = card.numbers(row, MERGED_BODIES)[: 1 if has_set else 2]
            ids = (
                value.value + card.transform.part
                for value in values
                if not value.problem and value.value > 0
            )
            yield values[0].field, frozenset(ids)


class Entity(NamedTuple):
    """A contact or rigid wall: keyword, id and title (0 and empty if missing), and its position in the deck."""

    keyword: str
    id: int
    title: str
    number: int

    @property
    def triggers(self) -> bool:
        """Return True if the force of the contact can trigger a switch."""
        return any(name in self.keyword for name in _ABLE)


class Entities(NamedTuple):
    """The contacts or rigid walls of a deck; ``all_known`` is False if one keyword may define several of them."""

    found: tuple[Entity, ...]
    all_known: bool

    def named(self, number: int) -> Entity | None:
        """Return the contact or wall with this id or, failing that, with this number in the order of definition.

        An entry with an id is never found by its number.
        """
        by_id = next((entity for entity in self.found if entity.id == number), None)
        return by_id or next(
            (
                entity
                for entity in self.found
                if entity.number == number and not entity.id
            ),
            None,
        )


def read_entities(deck: Deck, keyword: Literal["CONTACT", "RIGIDWALL"]) -> Entities:
    """Return the contacts, or the rigid walls, of a deck."""
    entities: list[Entity] = []
    all_known = not deck.unread and not deck.encrypted
    for card in deck.named(keyword):
        words = card.name.split("_")
        number = 0
        title = ""
        if words[1:2] and words[1] in _NO_CONTACTS:
            continue
        if {"ID", "TITLE"} & {*words} and card.rows:
            number = card.integer(card.rows[0], ENTITY["ID"]).value
            title = card.rows[0].text[card.width :].strip()
        all_known = (
            all_known
            and not card.transform.rest
            and (number > 0 or len(card.rows) <= _MOST_ROWS)
        )
        entities.append(Entity(card.name, number, title, len(entities) + 1))
    return Entities(tuple(entities), all_known)
