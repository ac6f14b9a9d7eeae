"""Parts, part sets and rigid materials of a deck: what the ids on switching cards refer to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from d2rpick.deck.card import Value

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.card import Card, Problem, Row
    from d2rpick.deck.reader import Deck

_EXTRA_LINES: Final = {"CONTACT": 1, "REPOSITION": 1, "PRINT": 1, "FIELD": 1, "INERTIA": 3}
_WITHOUT_LINES: Final = {"AVERAGED", "TITLE"}
_NO_DEFINITION: Final = {"MOVE", "MODES", "SENSOR", "STACKED", "ADAPTIVE", "ANNEAL"}
_ROTATED = 1  # IRCS of *PART_INERTIA: one more line follows
_SET_OPTIONS: Final = {"LIST", "TITLE", "COLLECT", "GENERATE", "COLUMN", "ADD"}
_PER_LINE = 8


@dataclass(frozen=True)
class PartSet:
    """Members of a part set, ranges still to be compared with the parts there are, and sets it adds up.

    ``problems`` are fields that say nothing usable; with one of them the members cannot be known.
    """

    parts: tuple[int, ...] = ()
    ranges: tuple[tuple[int, int], ...] = ()
    sets: tuple[int, ...] = ()
    problems: tuple[Problem, ...] = ()

    def joined(self, other: PartSet) -> PartSet:
        """Return both together (``_COLLECT``)."""
        return PartSet(
            self.parts + other.parts,
            self.ranges + other.ranges,
            self.sets + other.sets,
            self.problems + other.problems,
        )


@dataclass(eq=False)
class Parts:
    """Parts by id with material, title and section; part sets by id (None: of a kind that is not read).

    ``all_known`` is False when an include was not read, a block is encrypted, or a keyword makes parts in a
    way that is not followed: then a part that is missing here may still exist.  ``problems`` are ids of parts
    and sets, and numbers of includes, that could not be read.
    """

    materials: dict[int, str] = field(default_factory=dict)
    titles: dict[int, str] = field(default_factory=dict)
    sections: dict[int, int] = field(default_factory=dict)
    sets: dict[int, PartSet | None] = field(default_factory=dict)
    rigid_materials: set[str] = field(default_factory=set)
    problems: list[Problem] = field(default_factory=list)
    all_known: bool = True

    def is_rigid(self, part: int) -> bool:
        """Whether the part has *MAT_RIGID from the start."""
        return part in self.materials and self.materials[part] in self.rigid_materials

    def members(self, set_id: int) -> tuple[int, ...] | None:
        """Parts of a part set, ascending; None when they cannot be known."""
        found: set[int] = set()
        for current in self.reached(set_id):
            content = self.sets.get(current)
            if content is None or content.problems or (content.ranges and not self.materials):
                return None
            found.update(content.parts)
            found.update(part for low, high in content.ranges for part in self.materials if low <= part <= high)
        return tuple(sorted(found))

    def reached(self, set_id: int) -> tuple[int, ...]:
        """Return the set itself and all sets it adds up, directly or not, whether the deck has them or not."""
        seen: dict[int, None] = {}
        waiting = [set_id]
        while waiting:
            current = waiting.pop()
            if current not in seen:
                seen[current] = None
                content = self.sets.get(current)
                waiting.extend(content.sets if content else ())
        return tuple(seen)


def read_parts(deck: Deck) -> Parts:
    """Collect the parts, part sets and rigid materials of a deck."""
    parts = Parts(problems=list(deck.problems), all_known=not deck.unread and not deck.encrypted)
    for card in deck.named("MAT_RIGID", "MAT_020", "MAT_20"):
        if card.name.split("_")[2:3] == ["DISCRETE"]:
            continue
        rows = card.rows[1:] if card.name.endswith("_TITLE") else card.rows
        if rows:
            parts.rigid_materials.add(_material(card, rows[0], 0))
    for card in deck.named("PART"):
        _take_parts(card, parts)
    for card in deck.named("SET_PART"):
        _take_set(card, parts)
    parts.all_known = parts.all_known and not parts.problems
    return parts


def _material(card: Card, row: Row, position: int) -> str:
    """Id of a material with its offset, or its name where the deck uses names."""
    value = card.integer(row, position)
    return value.field.text.upper() if value.problem else str(value.value + card.transform.material)


def _take_parts(card: Card, parts: Parts) -> None:
    options = set(card.name.split("_")[1:])
    if options & _NO_DEFINITION:
        return
    if "ATTACHMENT" in options:
        options = (options - {"ATTACHMENT", "NODES"}) | {"PRINT"}  # one line more, like _PRINT
    if "COMPOSITE" in options:  # one part, and a material for every ply: none of them makes it rigid
        if len(card.rows) > 1:
            _add(card, card.rows[:2], "", parts)
        return
    if not options <= _EXTRA_LINES.keys() | _WITHOUT_LINES:
        parts.all_known = False
        return
    rows = list(card.rows)
    while len(rows) > 1:  # a title, the ids, and what the options add
        _, ids, *rest = rows
        _add(card, rows[:2], _material(card, ids, 2), parts)
        skip = sum(_EXTRA_LINES.get(option, 0) for option in options)
        if "INERTIA" in options and rest and card.integer(rest[0], 4).value == _ROTATED:
            skip += 1
        rows = rest[skip:]


def _add(card: Card, lines: Sequence[Row], material: str, parts: Parts) -> None:
    """Take the title and the ids of a part."""
    title, row = lines
    part, section = card.integer(row, 0), card.integer(row, 1)
    if part.problem:
        parts.problems.append((part.field, part.problem))
    elif part.value > 0:
        number = part.value + card.transform.part
        parts.materials[number], parts.titles[number] = material, title.text.strip()
        if material and not section.problem and section.value:
            parts.sections[number] = section.value + card.transform.rest


def _take_set(card: Card, parts: Parts) -> None:
    options = set(card.name.split("_")[2:])
    rows = [row for row in (card.rows[1:] if "TITLE" in options else card.rows) if not row.blank]
    if not rows:
        return
    first = card.integer(rows[0], 0)
    if first.problem:
        parts.problems.append((first.field, first.problem))
        return
    set_id = first.value + card.transform.set_
    ranges = "ADD" in options and any(_id(card, row, at).value < 0 for row in rows[1:] for at in range(_PER_LINE))
    if ranges or not options <= _SET_OPTIONS:
        parts.sets[set_id] = None
        return
    content = _content(card, options, rows[1:])
    known = parts.sets.get(set_id)
    parts.sets[set_id] = known.joined(content) if known and "COLLECT" in options else content


def _content(card: Card, options: set[str], rows: list[Row]) -> PartSet:
    offset = card.transform.set_ if "ADD" in options else card.transform.part
    per_line = 1 if "COLUMN" in options else _PER_LINE
    values = [value for row in rows for position in range(per_line) if (value := _id(card, row, position)).field.text]
    problems = tuple((value.field, value.problem) for value in values if value.problem)
    ids = tuple(value.value + offset for value in values if value.value > 0)
    if "GENERATE" in options:
        return PartSet(ranges=tuple(zip(ids[::2], ids[1::2], strict=False)), problems=problems)
    return PartSet(sets=ids, problems=problems) if "ADD" in options else PartSet(parts=ids, problems=problems)


def _id(card: Card, row: Row, position: int) -> Value[int]:
    value = card.integer(row, position)
    if value.problem or value.value >= 0:
        return value
    return Value(
        value.value, value.field, f"{value.field.text!r} in a part set is not followed, a positive id was expected"
    )
