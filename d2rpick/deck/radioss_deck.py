"""Read keyword blocks of Radioss files: the engine runs, the bodies that they switch, and the starter deck.

A block consists of a line that begins with ``/`` and the data lines below it. The columns of the starter deck come from
Altair's public help for /RBODY, /PART, /GRNOD and /SUBSET, and from the solver's published source.
"""

from __future__ import annotations

from dataclasses import field
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.graph import find_reachable
from d2rpick.deck.card import Card, CardField, Row, Scope, Value
from d2rpick.deck.columns import cut_fields
from d2rpick.deck.expression import ExpressionError, parse_number, parse_real
from d2rpick.deck.radioss_columns import (
    BEGIN,
    MERGE,
    NODE,
    PART,
    RIGID_BODY,
    RIGID_PART,
    SOLID_FLAGS,
)
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

    from d2rpick.deck.columns import CardColumn


_INCLUDE = b"#include"
_ENDS: Final = (["/END"], ["/END/ENGINE"])
_DIGITS = 10  # Maximum number of digits in an id.

# Element kinds whose stresses do not rotate with a rigid body.
WITHOUT_FRAME: Final = {
    "TETRA4",
    "TETRA10",
    "BRIC20",
    "SHEL16",
}
_RIGID_PARTS_SINCE: Final = 2612  # First input version with Irigid in /PART.
_ICOROTATIONAL: Final = 2  # Value of Iframe that selects a co-rotational frame.
# Values of Isolid for bricks without a co-rotational frame (including 12, according to the help up to 2017).
_NOT_TURNED: Final = {
    1,
    2,
    12,
}
_DEFAULT_ISOLID: Final = 1
SOLIDS: Final = {"SOLID", "TYPE14", "SOL_ORTH", "TYPE6"}


def read_blocks(source: SourceFile) -> Iterator[Block]:
    """Yield keyword blocks and ``#include`` lines in file order, up to ``/END``."""
    start: tuple[int, str] | None = None
    for position, raw in _find_marks(source):
        if start:
            yield Block(source, start[0], position, start[1])
        start = position, raw.rstrip(b"\r\n").decode("latin-1")
        if start[1].upper().split() in _ENDS:
            return
    if start:
        yield Block(source, start[0], None, start[1])


def _find_marks(source: SourceFile) -> Iterator[tuple[int, bytes]]:
    """Yield the offset and text of each line that begins with ``/`` or ``#include``.

    To save time, the lines of a mesh are not examined one by one.
    """
    position = 0
    for lines in source.pieces(0):
        yield from ((position + at, raw) for at, raw in _find_marks_in_piece(lines))
        position += len(lines)


def _find_marks_in_piece(lines: bytes) -> list[tuple[int, bytes]]:
    """Return the offset and text of each line in this block that begins with ``/`` or ``#include``."""
    offsets = [0] if lines[:1] in (b"/", b"#") else []
    for mark in (b"\n/", b"\n#"):
        at = lines.find(mark)
        while at >= 0:
            offsets.append(at + 1)
            at = lines.find(mark, at + 1)
    marked = [
        (at, lines[at : lines.find(b"\n", at) + 1 or None]) for at in sorted(offsets)
    ]
    return [
        (at, raw)
        for at, raw in marked
        if raw.startswith(b"/") or raw[: len(_INCLUDE)].lower() == _INCLUDE
    ]


def split_keyword(block: Block) -> tuple[str, ...]:
    """Return the words of a keyword line in upper case; no words for an ``#include``.

    The run name in ``/RUN/name/1`` is in upper case, too; `Card.block` contains it as written.
    """
    if block.head.startswith("/"):
        return tuple(word.strip().upper() for word in block.head[1:].split("/"))
    return ()


def parse_id(text: str) -> int:
    """Read an id from a keyword line or a field of 10 columns; 0 for other text."""
    text = text.strip()
    return int(text) if text.isdecimal() and len(text) <= _DIGITS else 0


def make_card(block: Block) -> Card:
    """Return a block as a card with fields of 10 columns."""
    return Card("/".join(split_keyword(block)), block, Scope())


def get_number(card: Card, at: int = 1) -> int:
    """Return the id at a given position in a keyword; 0 if there is no id."""
    return parse_id("".join(card.words[at:][:1]))


def get_lines_below_title(card: Card) -> tuple[Row, ...]:
    """Return the non-blank lines below the title, which may be blank itself."""
    return tuple(row for row in card.rows[1:] if not row.blank)


class InitialVelocity(NamedTuple):
    """An /INIV card: initial velocities in an engine run for ranges of nodes or a group (0 if there is no group)."""

    card: Card
    ranges: tuple[tuple[int, int], ...]
    group: int


@dataclass(eq=False, repr=False)
class RadiossLeg:
    """One engine run: its name and number from /RUN, its end, its switched main nodes, and its time-step limit."""

    run: Card
    name: str
    number: int
    stop: Value[float]
    # Switching cards, each with the main nodes of its bodies, and True if the card makes these bodies rigid.
    switched: list[tuple[Card, bool, tuple[Value[int], ...]]] = field(
        default_factory=list
    )
    cap: Value[float] | None = None
    version: str = ""
    starts: list[InitialVelocity] = field(default_factory=list)
    # Ids of the sensors that are reset when the engine run starts.
    resets: list[int] = field(default_factory=list)
    sensor: int = 0  # Id of a sensor that ends the engine run at an unknown time, or 0.


def read_legs(source: SourceFile) -> list[RadiossLeg]:
    """Read the engine runs in a file, which may contain several printed engine files."""
    legs: list[RadiossLeg] = []
    waiting: list[Card] = []
    for card in map(make_card, read_blocks(source)):
        waiting.append(card)
        if card.words[0] == "RUN":
            legs.append(_begin_leg(card))
        while legs and waiting:
            _add_to_leg(legs[-1], waiting.pop(0))
    return legs


def find_bodies_kept_off(legs: Sequence[RadiossLeg]) -> tuple[int, ...]:
    """Return the main nodes that the first engine run deactivates and no engine run activates, in file order."""
    is_rigid_in_first_leg: dict[int, bool] = {}
    activated: set[int] = set()
    for index, leg in enumerate(legs):
        for _, rigid, nodes in leg.switched:
            numbers_of_card = [node.value for node in nodes]
            if rigid:
                activated.update(numbers_of_card)
            if index == 0:
                is_rigid_in_first_leg.update(dict.fromkeys(numbers_of_card, rigid))
    return tuple(
        node
        for node, rigid in is_rigid_in_first_leg.items()
        if node and not rigid and node not in activated
    )


def _begin_leg(card: Card) -> RadiossLeg:
    """Start an engine run at its /RUN card."""
    missing = Value(0.0, card.here, "the end time is missing below /RUN")
    name = card.block.head.split("/")[2].strip() if card.words[1:] else ""
    return RadiossLeg(
        card, name, get_number(card, 2), next(read_numbers(card), missing)
    )


def _add_to_leg(leg: RadiossLeg, card: Card) -> None:
    """Add a card of an engine file to its engine run."""
    words = card.words
    if words[:2] in {("RBODY", "ON"), ("RBODY", "OFF")}:
        leg.switched.append(
            (
                card,
                words[1] == "ON",
                tuple(_make_integer(value) for value in read_numbers(card)),
            )
        )
    elif words[:2] == ("STOP", "LSENSOR"):
        leg.sensor = next((int(value.value) for value in read_numbers(card)), 0)
    elif words[:2] == ("SENS", "RESET"):
        leg.resets += [int(value.value) for value in read_numbers(card)]
    elif words == ("DTIX",):
        leg.cap = next(reversed(list(read_numbers(card))), None)
    elif words[0] == "INIV":
        leg.starts.append(_read_start(card))
    elif words[0] == "VERS":
        leg.version = "".join(words[1:2])


def _read_start(card: Card) -> InitialVelocity:
    """Read the nodes of an /INIV: type 0 lists nodes, type 1 node ranges, and type 2 a node group.

    Source: Altair's public help for /INIV, and the published source of OpenRadioss.
    """
    type_ = get_number(card, 3)
    if card.words[1:2] == ("AXIS",):
        velocity_count = 5
    else:
        velocity_count = 1
    ids = [_make_integer(value).value for value in read_numbers(card)][velocity_count:]
    if type_ == 2:
        return InitialVelocity(card, (), ids[0] if ids else 0)
    if type_ == 1:
        pairs = zip(ids[::2], ids[1::2], strict=False)
    else:
        pairs = zip(ids, ids, strict=True)
    return InitialVelocity(card, tuple(pairs), 0)


def read_numbers(card: Card) -> Iterator[Value[float]]:
    """Yield all numbers below a keyword; they are in free format."""
    for distance, line in card.block.lines():
        column = 0
        for word in line.split():
            column = line.index(word, column)
            word_field = CardField(word, card.block, distance, column + 1)
            column += len(word)
            try:
                yield Value(float(parse_number(word)), word_field)
            except ExpressionError as error:
                yield Value(0.0, word_field, str(error))


def _make_integer(value: Value[float]) -> Value[int]:
    """Return a number as an integer."""
    if not value.problem and value.value != int(value.value):
        return Value(0, value.field, f"{value.field.text!r} is not an integer")
    return Value(int(value.value), value.field, value.problem)


class PartLine(NamedTuple):
    """Title of a /PART, and the ids of its property, material and subset."""

    title: str
    prop: int
    material: int
    subset: int


@dataclass(eq=False, repr=False)
class Starter:
    """A starter deck: its ``blocks`` in reading order from the files ``sources``."""

    sources: list[SourceFile] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)

    @cached_property
    def cards(self) -> Sequence[Card]:
        """Return all blocks as cards, in reading order."""
        return [make_card(block) for block in self.blocks]

    def named(self, *keywords: str) -> list[Card]:
        """Return the cards whose keyword begins with one of the given words."""
        return [card for card in self.cards if card.words[0] in keywords]

    @cached_property
    def version(self) -> int:
        """Return the input version given in /BEGIN; 0 if the deck gives none."""
        begin_cards = [card for card in self.named("BEGIN") if card.rows]
        rows = get_lines_below_title(begin_cards[-1]) if begin_cards else ()
        return begin_cards[-1].integer(rows[0], BEGIN["Invers"]).value if rows else 0

    @property
    def bodies(self) -> Sequence[Body]:
        """Return the rigid bodies, each together with all bodies merged into it.

        Bodies of /RBODY/LAGMUL are omitted, because they are never switched; their keyword has the id in a different
        place.
        """
        return self.rigid.bodies

    @cached_property
    def rigid(self) -> RigidBodies:
        """Return the rigid bodies as the engine uses them."""
        written = [*self._written_bodies(), *self._bodies_of_parts()]
        return make_rigid_bodies(written, [*self._merges()], self._last_node)

    def _written_bodies(self) -> Iterator[Body]:
        """Yield the bodies that /RBODY defines."""
        for card in self.named("RBODY"):
            for row in get_lines_below_title(card)[: get_number(card) > 0]:
                node, sensor, group, keeps = (
                    card.integer(row, RIGID_BODY[name])
                    for name in ("node_ID", "sens_ID", "grnd_ID", "Ikrem")
                )
                stays = bool(sensor.value or keeps.value)
                yield Body(
                    get_number(card), node, sensor.value, group.value, card, stays
                )

    def _bodies_of_parts(self) -> Iterator[Body]:
        """Yield the rigid bodies that the starter creates for parts with Irigid = 1."""
        for card in self.named("PART") if self.version >= _RIGID_PARTS_SINCE else ():
            if len(card.rows) < 3:
                continue
            if card.integer(card.rows[1], PART["Irigid"]).value == 1:
                node, sensor = (
                    card.integer(card.rows[2], RIGID_PART[name])
                    for name in ("node_ID", "sens_ID")
                )
                part = get_number(card)
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
        """Yield the lines of all /MERGE/RBODY cards."""
        for card in self.named("MERGE"):
            for row in (
                get_lines_below_title(card) if card.words[1:2] == ("RBODY",) else ()
            ):
                main, main_kind, merged, kind = (
                    value.value for value in card.numbers(row, MERGE)
                )
                yield Merge(main_kind or BODY, main, kind or BODY, merged)

    def _last_node(self) -> int:
        """Return the highest node id."""
        return max(self._node_ids(), default=0)

    def _node_ids(self) -> Iterator[int]:
        """Yield the ids of all nodes of the deck."""
        column = NODE["node_ID"]
        for card in self.named("NODE"):
            for _, line in card.block.lines():
                yield parse_id(column.cut(line))

    @cached_property
    def parts(self) -> Mapping[int, PartLine]:
        """Return the /PART lines, keyed by part id."""
        return {
            get_number(card): PartLine(
                card.rows[0].text.strip(),
                *(
                    card.integer(row, PART[name]).value
                    for name in ("prop_ID", "mat_ID", "subset_ID")
                ),
            )
            for card in self.named("PART")
            for row in get_lines_below_title(card)[:1]
        }

    @cached_property
    def subsets(self) -> Mapping[int, tuple[int, ...]]:
        """Return the ids of the subsets contained in each subset."""
        return {
            get_number(card): _read_ids(get_lines_below_title(card))
            for card in self.named("SUBSET")
        }

    @cached_property
    def groups(self) -> Mapping[int, tuple[str, tuple[int, ...]]]:
        """Return the kind of the members (NODE, PART, SUBSET or GRNOD) and their ids, by node group."""
        group_cards = (card for card in self.named("GRNOD") if card.words[1:])
        written = {
            get_number(card, 2): (card.words[1], _read_ids(get_lines_below_title(card)))
            for card in group_cards
        }
        rigid_parts = {
            body.group: ("PART", (body.part,)) for body in self._bodies_of_parts()
        }
        return {**written, **rigid_parts, **self.rigid.groups}

    @cached_property
    def sensors(self) -> Mapping[int, Card]:
        """Return the sensor cards, keyed by sensor id."""
        return {
            get_number(card, 2): card for card in self.named("SENSOR") if card.words[1:]
        }

    @property
    def moved(self) -> bool:
        """Return True if a submodel may add an offset to ids."""
        # The keyword //SUBMODEL has no word between its two slashes.
        return bool(self.named(""))

    @property
    def transformed(self) -> bool:
        """Return True if a card of the deck moves nodes."""
        return bool(self.named("TRANSFORM"))

    @property
    def unturned(self) -> dict[int, str]:
        """Return the element kind of solids whose stresses do not rotate with a rigid body, by part id."""
        defaults = [
            _read_isolid_and_iframe(card, card.rows[0])
            for card in self.named("DEF_SOLID")
            if card.rows
        ]
        # If several cards define the default flags of solids, the solver uses the first card.
        isolid, iframe = defaults[0] if defaults else (0, 0)
        solids = (
            card
            for card in self.named("PROP")
            if card.words[1:2] and card.words[1] in SOLIDS and card.rows[1:]
        )
        # The flags are read by line number, because their line may be blank.
        flags = {
            get_number(card, 2): _read_isolid_and_iframe(card, card.rows[1])
            for card in solids
        }
        props = {
            prop
            for prop, (prop_isolid, frame) in flags.items()
            if (prop_isolid or isolid or _DEFAULT_ISOLID) in _NOT_TURNED
            and (frame or iframe) != _ICOROTATIONAL
        }
        bricks = {get_number(card) for card in self.named("BRICK")}
        turned = [
            part
            for part, line in self.parts.items()
            if part in bricks and line.prop in props
        ]
        formulations = dict.fromkeys(
            turned, "bricks with Isolid 1, 2 or 12 without Iframe 2"
        )
        parts_without_frame = map(get_number, self.named(*WITHOUT_FRAME))
        return formulations | dict.fromkeys(
            parts_without_frame, "tetrahedra, 20-node bricks or 16-node shells"
        )

    def group_members(self, group: int) -> tuple[set[int], set[int]] | None:
        """Return the nodes and the complete parts of a node group; None if they are unknown."""
        nodes = set[int]()
        parts = set[int]()
        for kind, ids in map(self._group, find_reachable([group], self._groups_in)):
            if kind in ("NODE", "NODENS"):
                nodes.update(ids)
            elif kind == "GENE" and -1 not in ids:
                nodes.update(self._nodes_in_ranges(ids))
            elif kind == "PART":
                parts.update(ids)
            elif kind in ("MAT", "PROP"):
                parts.update(self._parts_of(kind, ids))
            elif kind == "SUBSET":
                below = {
                    *find_reachable(ids, lambda number: self.subsets.get(number, ()))
                }
                parts.update(
                    part for part, line in self.parts.items() if line.subset in below
                )
            elif kind != "GRNOD" or any(number <= 0 for number in ids):
                return None
        return nodes, parts

    def _nodes_in_ranges(self, ends: Sequence[int]) -> Iterator[int]:
        """Yield the nodes of the deck in ranges that are given as pairs of first and last node."""
        ranges = [
            range(first, last + 1)
            for first, last in zip(ends[::2], ends[1::2], strict=False)
        ]
        for node in self._node_ids():
            if any(node in among for among in ranges):
                yield node

    def _parts_of(self, kind: str, ids: Collection[int]) -> Iterator[int]:
        """Yield the parts with one of the given materials or properties."""
        for part, line in self.parts.items():
            if (line.material if kind == "MAT" else line.prop) in ids:
                yield part

    def _group(self, group: int) -> tuple[str, tuple[int, ...]]:
        """Return the kind of the members of a group, and their ids."""
        return self.groups.get(group, ("", ()))

    def _groups_in(self, group: int) -> tuple[int, ...]:
        """Return the ids of the node groups contained in a group."""
        kind, ids = self._group(group)
        return ids if kind == "GRNOD" else ()


def _read_isolid_and_iframe(card: Card, row: Row) -> tuple[int, int]:
    """Return the values of Isolid and Iframe on a line."""
    isolid = card.integer(row, SOLID_FLAGS["Isolid"])
    iframe = card.integer(row, SOLID_FLAGS["Iframe"])
    return isolid.value, iframe.value


def _read_ids(rows: Iterable[Row]) -> tuple[int, ...]:
    """Return the ids on lines of 10-column fields; -1 for text that is not an id."""
    cells = [cell for row in rows for cell in cut_fields(row.text)]
    return tuple(parse_id(cell) or -1 for cell in cells if cell)


def read_reals(row: Row, columns: Iterable[CardColumn]) -> list[float]:
    """Read the numbers in the columns of a line: 0 for a blank field, NaN for text that is not a number."""
    return [parse_real(column.cut(row.text)) for column in columns]
