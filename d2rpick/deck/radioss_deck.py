"""Keyword blocks of Radioss files: engine files, with legs of a run and the rigid bodies they switch, and the starter.

A block is a line that begins with ``/``, and the data lines below it.  Columns of the starter: Altair's public help for
/RBODY, /PART, /GRNOD and /SUBSET, and the solver's published source.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.caching import cached_property
from d2rpick.base.graph import reached
from d2rpick.deck.card import Card, Field, Row, Scope, Value
from d2rpick.deck.expression import ExpressionError, number, real
from d2rpick.deck.radioss_rigid import (
    BODY,
    MADE_HERE,
    Body,
    Merge,
    RigidBodies,
    make_rigid_bodies,
)
from d2rpick.deck.source import Block, SourceFile

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence


_INCLUDE = b"#include"
_ENDS: Final = (["/END"], ["/END/ENGINE"])
_DIGITS = 10  # of an id


def blocks(source: SourceFile) -> Iterator[Block]:
    """Keyword blocks and ``#include`` lines in the order of the file, up to ``/END``."""
    start: tuple[int, str] | None = None
    for position, raw in _marks(source):
        if start:
            yield Block(source, start[0], position, start[1])
        start = position, raw.rstrip(b"\r\n").decode("latin-1")
        if start[1].upper().split() in _ENDS:
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
    marked = [
        (at, lines[at : lines.find(b"\n", at) + 1 or None]) for at in sorted(found)
    ]
    return [
        (at, raw)
        for at, raw in marked
        if raw.startswith(b"/") or raw[: len(_INCLUDE)].lower() == _INCLUDE
    ]


def keyword(block: Block) -> tuple[str, ...]:
    """Words of a keyword line in upper case; empty for an ``#include``.

    The name of the run in ``/RUN/name/1`` is in upper case too: `Card.block` has it as written.
    """
    return (
        tuple(word.strip().upper() for word in block.head[1:].split("/"))
        if block.head.startswith("/")
        else ()
    )


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


@dataclass(eq=False, repr=False)
class Leg:
    """One engine run: its name and number as /RUN gives them, its end, the main nodes it switches, its step limit."""

    run: Card
    name: str
    number: int
    stop: Value[float]
    switched: list[tuple[Card, bool, tuple[Value[int], ...]]] = field(
        default_factory=list
    )  # True: made rigid
    cap: Value[float] | None = None
    version: str = ""
    starts: list[Start] = field(default_factory=list)
    resets: list[int] = field(
        default_factory=list
    )  # sensors that are reset at its start
    sensor: int = 0  # which ends it, at a time that nobody knows before


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
    states = {
        node.value: rigid
        for leg in legs[:1]
        for _, rigid, nodes in leg.switched
        for node in nodes
        if node.value
    }
    on = {
        node.value
        for leg in legs
        for _, rigid, nodes in leg.switched
        for node in nodes
        if rigid
    }
    return tuple(node for node, rigid in states.items() if not rigid and node not in on)


def _leg(card: Card) -> Leg:
    missing = Value(0.0, card.here, "the end of the run is missing below /RUN")
    name = card.block.head.split("/")[2].strip() if card.words[1:] else ""
    return Leg(card, name, number_of(card, 2), next(numbers(card), missing))


def _take(leg: Leg, card: Card) -> None:
    words = card.words
    if words[:2] in {("RBODY", "ON"), ("RBODY", "OFF")}:
        leg.switched.append(
            (card, words[1] == "ON", tuple(_integer(value) for value in numbers(card)))
        )
    elif words[:2] == ("STOP", "LSENSOR"):
        leg.sensor = next((int(value.value) for value in numbers(card)), 0)
    elif words[:2] == ("SENS", "RESET"):
        leg.resets += [int(value.value) for value in numbers(card)]
    elif words == ("DTIX",):
        leg.cap = next(reversed(list(numbers(card))), None)
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
    ids = [_integer(value).value for value in numbers(card)][before:]
    if type_ == 2:
        return Start(card, (), ids[0] if ids else 0)
    pairs = (
        zip(ids[::2], ids[1::2], strict=False)
        if type_ == 1
        else zip(ids, ids, strict=True)
    )
    return Start(card, tuple(pairs), 0)


def numbers(card: Card) -> Iterator[Value[float]]:
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


WITHOUT_FRAME: Final = {
    "TETRA4",
    "TETRA10",
    "BRIC20",
    "SHEL16",
}  # their stresses do not turn with a rigid body
_WIDTH: Final = 10
_OF_BODY: Final = (
    0,
    1,
    6,
    7,
)  # main node, sensor, group, Ikrem in columns of 10: the mass between takes two
# /PART of a rigid part: Irigid in its first line, main node and sensor in its second.
_IRIGID: Final = 5
_OF_RIGID_PART: Final = (0, 5)
_RIGID_PARTS_SINCE: Final = 2612  # version of the format
_ICOROTATIONAL: Final = 2  # Iframe
_NOT_TURNED: Final = {
    1,
    2,
    12,
}  # Isolid of bricks without a co-rotating frame; 12 by the help up to 2017
_DEFAULT_ISOLID: Final = 1
SOLIDS: Final = {"SOLID", "TYPE14", "SOL_ORTH", "TYPE6"}


class PartLine(NamedTuple):
    """What /PART says: ids of property, material and subset."""

    title: str
    prop: int
    material: int
    subset: int


@dataclass(eq=False, repr=False)
class Starter:
    """What a starter deck says about its rigid bodies; by its ``blocks`` from the files ``sources``."""

    sources: list[SourceFile] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)

    @cached_property
    def cards(self) -> Sequence[Card]:
        """All blocks as cards, in reading order."""
        return [card_of(block) for block in self.blocks]

    def named(self, *keywords: str) -> list[Card]:
        """Cards whose first word is one of these."""
        return [card for card in self.cards if card.words[0] in keywords]

    @cached_property
    def version(self) -> int:
        """That of the format."""
        found = [card for card in self.named("BEGIN") if card.rows]
        rows = below_title(found[-1]) if found else ()
        return found[-1].integer(rows[0], 0).value if rows else 0

    @property
    def bodies(self) -> Sequence[Body]:
        """Rigid bodies, each with all that is merged into it.

        One of /RBODY/LAGMUL, whose keyword has no id there, is never switched.
        """
        return self.rigid.bodies

    @cached_property
    def rigid(self) -> RigidBodies:
        """Rigid bodies as the engine has them."""
        written = [*self._written_bodies(), *self._bodies_of_parts()]
        return make_rigid_bodies(written, [*self._merges()], self._last_node)

    def _written_bodies(self) -> Iterator[Body]:
        for card in self.named("RBODY"):
            for row in below_title(card)[: number_of(card) > 0]:
                node, sensor, group, keeps = (card.integer(row, at) for at in _OF_BODY)
                stays = bool(sensor.value or keeps.value)
                yield Body(
                    number_of(card), node, sensor.value, group.value, card, stays
                )

    def _bodies_of_parts(self) -> Iterator[Body]:
        """Bodies that the starter makes of parts with Irigid 1."""
        for card in self.named("PART") if self.version >= _RIGID_PARTS_SINCE else ():
            if len(card.rows) > 2 and card.integer(card.rows[1], _IRIGID).value == 1:
                node, sensor = (card.integer(card.rows[2], at) for at in _OF_RIGID_PART)
                part = number_of(card)
                yield Body(
                    0,
                    node,
                    sensor.value,
                    MADE_HERE + part,
                    card,
                    bool(sensor.value),
                    part,
                )

    def _merges(self) -> Iterator[Merge]:
        for card in self.named("MERGE"):
            for row in below_title(card) if card.words[1:2] == ("RBODY",) else ():
                main, main_kind, other, kind = (
                    card.integer(row, at).value for at in range(4)
                )
                yield Merge(main_kind or BODY, main, kind or BODY, other)

    def _last_node(self) -> int:
        """Highest id of a node."""
        return max(self._node_ids(), default=0)

    def _node_ids(self) -> Iterator[int]:
        for card in self.named("NODE"):
            for _, line in card.block.lines():
                yield whole(line[:_WIDTH])

    @cached_property
    def parts(self) -> Mapping[int, PartLine]:
        """What /PART says, by the ids of the parts."""
        return {
            number_of(card): PartLine(
                card.rows[0].text.strip(),
                *(card.integer(row, at).value for at in range(3)),
            )
            for card in self.named("PART")
            for row in below_title(card)[:1]
        }

    @cached_property
    def subsets(self) -> Mapping[int, tuple[int, ...]]:
        """Ids of the subsets in each."""
        return {
            number_of(card): _ids(below_title(card)) for card in self.named("SUBSET")
        }

    @cached_property
    def groups(self) -> Mapping[int, tuple[str, tuple[int, ...]]]:
        """What a group of nodes is made of, and the ids of that."""
        found = (card for card in self.named("GRNOD") if card.words[1:])
        written = {
            number_of(card, 2): (card.words[1], _ids(below_title(card)))
            for card in found
        }
        rigid_parts = {
            body.group: ("PART", (body.part,)) for body in self._bodies_of_parts()
        }
        return {**written, **rigid_parts, **self.rigid.groups}

    @cached_property
    def sensors(self) -> Mapping[int, Card]:
        """Cards of the sensors by id."""
        return {
            number_of(card, 2): card for card in self.named("SENSOR") if card.words[1:]
        }

    @property
    def moved(self) -> bool:
        """Whether a submodel may offset its ids."""
        return bool(self.named(""))  # before the second slash of //SUBMODEL

    @property
    def transformed(self) -> bool:
        """Whether nodes are moved."""
        return bool(self.named("TRANSFORM"))

    @property
    def unturned(self) -> dict[int, str]:
        """Parts of solids whose stresses do not turn with a rigid body, and of which kind these are."""
        defaults = [
            _isolid_and_iframe(card, card.rows[0])
            for card in self.named("DEF_SOLID")
            if card.rows
        ]
        isolid, iframe = defaults[0] if defaults else (0, 0)  # the first one counts
        solids = (
            card
            for card in self.named("PROP")
            if card.words[1:2] and card.words[1] in SOLIDS and card.rows[1:]
        )
        flags = {
            number_of(card, 2): _isolid_and_iframe(card, card.rows[1])
            for card in solids
        }  # it may be blank
        props = {
            prop
            for prop, (own, frame) in flags.items()
            if (own or isolid or _DEFAULT_ISOLID) in _NOT_TURNED
            and (frame or iframe) != _ICOROTATIONAL
        }
        bricks = {number_of(card) for card in self.named("BRICK")}
        turned = [
            part
            for part, line in self.parts.items()
            if part in bricks and line.prop in props
        ]
        found = dict.fromkeys(turned, "bricks with Isolid 1, 2 or 12 without Iframe 2")
        others = map(number_of, self.named(*WITHOUT_FRAME))
        return found | dict.fromkeys(
            others, "tetrahedra, 20-node bricks or 16-node shells"
        )

    def group_members(self, group: int) -> tuple[set[int], set[int]] | None:
        """Nodes and whole parts of a group of nodes; None where they cannot be known."""
        nodes, parts = set[int](), set[int]()
        for kind, ids in map(self._group, reached([group], self._groups_in)):
            if kind in ("NODE", "NODENS"):
                nodes.update(ids)
            elif kind == "GENE" and -1 not in ids:
                nodes.update(self._nodes_in_ranges(ids))
            elif kind == "PART":
                parts.update(ids)
            elif kind in ("MAT", "PROP"):
                parts.update(self._parts_of(kind, ids))
            elif kind == "SUBSET":
                below = {*reached(ids, lambda one: self.subsets.get(one, ()))}
                parts.update(
                    part for part, line in self.parts.items() if line.subset in below
                )
            elif kind != "GRNOD" or any(one <= 0 for one in ids):
                return None
        return nodes, parts

    def _nodes_in_ranges(self, ends: Sequence[int]) -> Iterator[int]:
        """Give the nodes of the deck from a first to a last one, of each pair of ends."""
        ranges = [
            range(first, last + 1)
            for first, last in zip(ends[::2], ends[1::2], strict=False)
        ]
        for node in self._node_ids():
            if any(node in among for among in ranges):
                yield node

    def _parts_of(self, kind: str, ids: Collection[int]) -> Iterator[int]:
        """Give the parts that have one of some materials, or properties."""
        for part, line in self.parts.items():
            if (line.material if kind == "MAT" else line.prop) in ids:
                yield part

    def _group(self, group: int) -> tuple[str, tuple[int, ...]]:
        return self.groups.get(group, ("", ()))

    def _groups_in(self, group: int) -> tuple[int, ...]:
        kind, ids = self._group(group)
        return ids if kind == "GRNOD" else ()


def _isolid_and_iframe(card: Card, row: Row) -> tuple[int, int]:
    return card.integer(row, 0).value, card.integer(row, 7).value


def _ids(rows: Iterable[Row]) -> tuple[int, ...]:
    """Ids on lines of 10 columns; a word ends what can be followed and counts as -1."""
    cells = [
        row.text[start : start + _WIDTH].strip()
        for row in rows
        for start in range(0, len(row.text), _WIDTH)
    ]
    return tuple(whole(cell) or -1 for cell in cells if cell)


def reals(row: Row, count: int) -> list[float]:
    """Read numbers of 20 columns each; a blank is 0, NaN what is none."""
    return [
        real(row.text[at : at + 2 * _WIDTH])
        for at in range(0, count * 2 * _WIDTH, 2 * _WIDTH)
    ]
