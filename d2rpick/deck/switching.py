"""Switching cards of LS-DYNA field by field, and the windows in which cards of any solver make parts rigid.

The cards are *DEFORMABLE_TO_RIGID and its variants, and their restart relatives.

Columns and defaults: the vendor's keyword data as published in its Python library, and two independent
sources; which of the D2R and R2D lines hold PTYPE in which column is a trap several writers fell into.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

from d2rpick.base.caching import cached_property
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.card import Field, Row, Value
from d2rpick.deck.reader import SWITCHING, Deck, Restart

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.ls_dyna_parts import Parts

Kind = Literal["automatic", "plain", "inertia", "restart"]

BY_TIME, BY_SENSOR = 0, 5  # CODE
_KINDS: Final[dict[str, Kind]] = {
    "DEFORMABLE_TO_RIGID": "plain",
    "DEFORMABLE_TO_RIGID_AUTOMATIC": "automatic",
    "DEFORMABLE_TO_RIGID_INERTIA": "inertia",
    "RIGID_DEFORMABLE_CONTROL": "restart",
    "RIGID_DEFORMABLE_D2R": "restart",
    "RIGID_DEFORMABLE_R2D": "restart",
}
_HEADER_ROWS = 2
_FIRST_LINE = (
    int,
    int,
    float,
    float,
    float,
    int,
    int,
    int,
)  # how the fields of a header are read
_SECOND_LINE = (int, int, float, float, int, int, float)
_COUNTS_FIELD = 4  # of the second line: D2R
_PTYPES: Final = {"PART", "PSET"}
_INERTIA_ROWS: Final = (
    "the first line (PID)",
    "the second line (XC to TM)",
    "the third line (IXX to IZZ)",
)
_REALS: Final = {
    "automatic": (4, 0),
    "inertia": (4, 6),
    "restart": (0, 0),
    "plain": (0, 0),
}


class Switched(NamedTuple):
    """One line: a part (or a part set, ``by_set``) that is made rigid or deformable."""

    part: Value[int]
    by_set: bool
    to_rigid: bool
    lead: Value[int] | None = None  # LRB; a D2R line only


class Header(NamedTuple):
    """The two first lines of *DEFORMABLE_TO_RIGID_AUTOMATIC, field by field; counts are D2R and R2D."""

    swset: Value[int]
    code: Value[int]
    time1: Value[float]
    time2: Value[float]
    time3: Value[float]
    entno: Value[int]
    relsw: Value[int]
    paired: Value[int]
    nrbf: Value[int]
    ncsf: Value[int]
    rwf: Value[float]
    dtmax: Value[float]
    to_rigid: Value[int]
    to_deformable: Value[int]
    offset: Value[float]


@dataclass(eq=False, repr=False)
class SwitchSet:
    """One switching card as read: its header where it has one, and its parts.

    ``count_problem`` says how lines and counts differ (empty: they agree); ``problems`` are the fields
    that could not be read, each with the reason.
    """

    card: Card
    kind: Kind
    header: Header | None
    switched: tuple[Switched, ...]
    values: tuple[Value[int] | Value[float] | Value[str], ...]
    count_problem: str = ""
    part: Value[int] | None = None  # of *DEFORMABLE_TO_RIGID_INERTIA
    restart: Restart | None = (
        None  # in which it stands, where it is known when that begins
    )

    @cached_property
    def time(self) -> float | None:
        """When it switches [time of the whole deck]; None when that is not for a clock to say."""
        if self.restart:
            return self.restart.at
        if self.kind == "plain":
            return 0.0
        header = self.header
        if (
            header is None
            or header.code.problem
            or header.time1.problem
            or header.code.value != BY_TIME
        ):
            return None
        return header.time1.value * self.card.transform.time

    @property
    def time_field(self) -> Field:
        """TIME1, the end of the run before a restart, or the keyword of a card without either."""
        if self.restart:
            return self.restart.stop_field
        return self.header.time1.field if self.header else self.card.here

    @property
    def problems(self) -> Iterator[tuple[Field, str]]:
        """Fields that say nothing usable."""
        return ((value.field, value.problem) for value in self.values if value.problem)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters the card uses."""
        return tuple(
            dict.fromkeys(name for value in self.values for name in value.parameters)
        )


def read_switching(deck: Deck) -> tuple[SwitchSet, ...]:
    """Return all switching cards of a deck, in reading order."""
    kinds = ((card, _KINDS.get(card.name)) for card in deck.cards)
    return tuple(
        _automatic(card)
        if kind == "automatic"
        else _simple(card, kind, deck.restarts.get(card.file))
        for card, kind in kinds
        if kind is not None
    )


def misspelt(deck: Deck) -> Iterator[tuple[Card, str]]:
    """Cards that look like switching cards but are none, and the keyword that was probably meant."""
    for card in deck.cards:
        if card.name not in _KINDS and SWITCHING.match(card.block.head):
            from difflib import get_close_matches  # start-up

            name = re.sub(r"\W+", "_", card.block.head.upper()).strip("_")
            yield card, f"*{get_close_matches(name, _KINDS, n=1, cutoff=0)[0]}"


def _simple(card: Card, kind: Kind, restart: Restart | None) -> SwitchSet:
    restart = restart if kind == "restart" else None
    rows = card.lines
    if kind == "inertia":
        part = [_moved(card.integer(rows[0], 0), card.transform.part)] if rows else []
        reals = [
            card.real(row, at)
            for row, count in zip(rows[1:], _REALS[kind], strict=False)
            for at in range(count)
        ]
        missing = _INERTIA_ROWS[len(rows) :]
        problem = (
            f"{' and '.join(missing)} {'are' if len(missing) > 1 else 'is'} missing"
            if missing
            else ""
        )
        return SwitchSet(
            card, kind, None, (), (*part, *reals), problem, next(iter(part), None)
        )
    if card.name.endswith("_CONTROL"):
        values = [card.real(row, at) for row in rows[:1] for at in range(4)]
        return SwitchSet(card, kind, None, (), tuple(values), restart=restart)
    to_rigid = not card.name.endswith("_R2D")
    lines = [_line(card, row, to_rigid=to_rigid, ptype=kind == "plain") for row in rows]
    return replace(_with(card, kind, None, lines), restart=restart)


def _automatic(card: Card) -> SwitchSet:
    rows = list(card.rows)
    while rows and rows[-1].blank:
        rows.pop()
    if missing := _missing(rows):
        return SwitchSet(card, "automatic", None, (), (), missing)
    header = _header(card, rows[0], rows[1])
    lines = rows[_HEADER_ROWS:]
    if header.to_rigid.problem or header.to_deformable.problem:
        return _with(card, "automatic", header, [])
    rigid, deformable = header.to_rigid.value, header.to_deformable.value
    problem = ""
    if rigid < 0 or deformable < 0:
        problem = (
            f"D2R is {rigid} and R2D is {deformable}, counts from 0 on were expected"
        )
    elif len(lines) != rigid + deformable:
        problem = f"D2R is {rigid} and R2D is {deformable}, but {_lines(len(lines))} of parts follow"
        problem += "" if lines else ": the third line, with the first part, is missing"
    elif not lines:
        short = (
            sum(bool(rows[1].cell(at)) for at in range(_COUNTS_FIELD + 1))
            <= _COUNTS_FIELD
        )
        lost = "; is the second line (NRBF to OFFSET) missing?" if short else ""
        problem = f"D2R and R2D are 0, so the card switches nothing{lost}"
    elif any(row.blank for row in lines):
        problem = "a line is empty where a part was expected"
    rigid, deformable = max(rigid, 0), max(deformable, 0)
    switched = [
        _line(card, row, to_rigid=True, ptype=True)
        for row in lines[:rigid]
        if not row.blank
    ]
    back = lines[rigid : rigid + deformable]
    switched += [
        _line(card, row, to_rigid=False, ptype=True) for row in back if not row.blank
    ]
    return _with(card, "automatic", header, switched, problem)


def _missing(rows: Sequence[Row]) -> str:
    """Say which of the two first lines are missing: they are, too, where a line of a part stands in their place."""
    both = (
        "the first line (SWSET to PAIRED) and the second (NRBF to OFFSET) are missing"
    )
    if not rows:
        return both
    if _is_of_part(rows[0]):
        return f"{both}, {rows[0].text.strip()!r} stands in their place"
    if len(rows) < _HEADER_ROWS:
        return "the second line (NRBF to OFFSET) is missing"
    if _is_of_part(rows[1]):
        return f"the second line (NRBF to OFFSET) is missing, {rows[1].text.strip()!r} stands in its place"
    return ""


def _is_of_part(row: Row) -> bool:
    return row.cell(1).upper() in _PTYPES or row.cell(2).upper() in _PTYPES


def _lines(count: int) -> str:
    return "1 line" if count == 1 else f"{count or 'no'} lines"


def _header(card: Card, first: Row, second: Row) -> Header:
    values = card.numbers(first, _FIRST_LINE) + card.numbers(second, _SECOND_LINE)
    swset, code, time1, time2, time3, entno, relsw, *others = values
    if not code.problem and not BY_TIME <= code.value <= BY_SENSOR:
        code = replace(
            code,
            problem=f"CODE is {code.value}, {BY_TIME} to {BY_SENSOR} was expected",
            parameters=(),
        )
    if not swset.problem and swset.value <= 0:
        swset = replace(
            swset,
            problem=f"SWSET is {swset.value}, a positive number was expected",
            parameters=(),
        )
    if code.value == BY_TIME and not time1.problem and _runs_over(first):
        problem = f"TIME1 runs over its columns into TIME2 ({time1.field.text} and {first.cell(3)})"
        time1 = replace(time1, problem=problem, parameters=())
    swset, relsw = (_moved(one, card.transform.rest) for one in (swset, relsw))
    return Header(swset, code, time1, time2, time3, entno, relsw, *others)


def _runs_over(row: Row) -> bool:
    """Whether digits of TIME1 seem to go on as TIME2: a number of its own that fills its field has a point."""
    border = 3 * row.width
    rest = row.text[border : border + row.width].strip()
    touching = (
        row.text[border - 1 : border].isdigit()
        and row.text[border : border + 1].isdigit()
    )
    return (
        touching and "," not in row.text and "." not in rest and rest.strip("0") != ""
    )


_Line = tuple[Switched, Value[str]]


def _line(card: Card, row: Row, *, to_rigid: bool, ptype: bool) -> _Line:
    """Part, LRB where the line has it, and PTYPE: column 21 of a D2R line, column 11 of an R2D line."""
    kind = (
        card.word(row, 2 if to_rigid else 1, "PART")
        if ptype
        else Value("PART", card.here)
    )
    if kind.value not in _PTYPES:
        kind = Value(
            "PART",
            kind.field,
            f"PTYPE is {kind.field.text!r}, PART or PSET was expected",
        )
    by_set = kind.value == "PSET"
    part = _moved(
        card.integer(row, 0), card.transform.set_ if by_set else card.transform.part
    )
    if not part.problem and part.value <= 0:
        part = Value(
            0,
            part.field,
            f"{part.field.text!r} is not a part id; a positive number was expected",
        )
    lead = _moved(card.integer(row, 1), card.transform.part) if to_rigid else None
    return Switched(part, by_set, to_rigid, lead), kind


def _moved(value: Value[int], offset: int) -> Value[int]:
    """Add the offset of the include to an id; 0 stays none."""
    return (
        value
        if value.problem or not value.value or not offset
        else replace(value, value=value.value + offset)
    )


def _with(
    card: Card,
    kind: Kind,
    header: Header | None,
    lines: Sequence[_Line],
    count_problem: str = "",
) -> SwitchSet:
    values: list[Value[int] | Value[float] | Value[str]] = list(header or ())
    for switched, ptype in lines:
        values += (
            [switched.part, ptype]
            if switched.lead is None
            else [switched.part, switched.lead, ptype]
        )
    return SwitchSet(
        card,
        kind,
        header,
        tuple(line for line, _ in lines),
        tuple(values),
        count_problem,
    )


# Windows.


class Unit(NamedTuple):
    """A part; or a part set or a rigid body (by its main node) whose parts cannot be known."""

    id: int
    is_set: bool = False
    is_body: bool = False

    @property
    def kind(self) -> str:
        """What the id is one of."""
        return "part set" if self.is_set else "main node" if self.is_body else "part"

    @property
    def part(self) -> int | None:
        """The part; None for a part set or rigid body whose parts cannot be known."""
        return None if self.is_set or self.is_body else self.id


class Event(NamedTuple):
    """A unit is switched by a line of a card."""

    unit: Unit
    by: SwitchSet
    line: Switched


class Window(NamedTuple):
    """A unit is rigid from ``tr`` to ``td`` [time of the deck]; ``td`` is None when it stays rigid.

    ``td`` may lie before ``tr``: that is what the cards say, and a finding.
    """

    unit: Unit
    tr: float
    td: float | None
    opened: Event
    closed: Event | None

    @property
    def part(self) -> int | None:
        """The part; None where it cannot be known."""
        return self.unit.part


class Windows(NamedTuple):
    """All windows of a deck by unit and time; ``orphans`` switch back what nothing made rigid before.

    ``other_rigid`` and ``other_deformable`` are switched at times that no clock tells (CODE 1-5, restarts).
    """

    windows: tuple[Window, ...]
    orphans: tuple[Event, ...]
    events: tuple[Event, ...]
    other_rigid: frozenset[Unit]
    other_deformable: frozenset[Unit]


def find_windows(
    sets: Iterable[SwitchSet],
    parts: Parts,
    by_sensor: Iterable[tuple[float, Event]] = (),
) -> Windows:
    """Follow every part through the cards in the order of their times.

    ``by_sensor`` are switches whose times are known from elsewhere.

    Part sets are resolved to their parts.  A part that is made rigid while it is rigid (a new lead) stays in
    its window.  When a part is switched back first and made rigid later and nothing else matches, the two
    belong to one inverted window.
    """
    events = tuple(event for card in sets for event in _events(card, parts))
    timed: dict[Unit, list[tuple[float, Event]]] = defaultdict(list)
    for event in events:
        if event.by.time is not None:
            timed[event.unit].append((event.by.time, event))
    for time, event in by_sensor:
        timed[event.unit].append((time, event))
    windows: list[Window] = []
    orphans: list[Event] = []
    for unit in sorted(timed):
        # at equal times the way back counts as the earlier one: both at once is no window
        found, left = follow(
            unit,
            sorted(timed[unit], key=lambda timed: (timed[0], timed[1].line.to_rigid)),
        )
        if left and found and found[-1].td is None:
            td, closed = left.pop()
            found[-1] = found[-1]._replace(td=td, closed=closed)
        windows += found
        orphans += [event for _, event in left]
    other = [event for event in events if event.by.time is None]
    rigid, back = (
        frozenset(one.unit for one in other if one.line.to_rigid == way)
        for way in (True, False)
    )
    return Windows(tuple(windows), tuple(orphans), events, rigid, back)


def _events(card: SwitchSet, parts: Parts) -> Iterable[Event]:
    for line in card.switched:
        if line.part.problem:
            continue
        members = parts.members(line.part.value) if line.by_set else (line.part.value,)
        if members is None:
            yield Event(Unit(line.part.value, is_set=True), card, line)
        else:
            yield from (Event(Unit(part), card, line) for part in members)


def follow(
    unit: Unit, events: Iterable[tuple[float, Event]]
) -> tuple[list[Window], list[tuple[float, Event]]]:
    """Windows of a unit by its events and their times, in order; and the events that find it deformable already."""
    windows: list[Window] = []
    orphans: list[tuple[float, Event]] = []
    opened: tuple[float, Event] | None = None
    for time, event in events:
        if event.line.to_rigid:
            opened = opened or (time, event)
        elif opened:
            windows.append(Window(unit, opened[0], time, opened[1], event))
            opened = None
        else:
            orphans.append((time, event))
    if opened:
        windows.append(Window(unit, opened[0], None, opened[1], None))
    return windows, orphans
