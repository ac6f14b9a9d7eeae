"""Read LS-DYNA switching cards field by field, and find the rigid windows that the cards of either solver define.

The cards are *DEFORMABLE_TO_RIGID, its variants, and the restart cards *RIGID_DEFORMABLE.

The columns and defaults come from the vendor's keyword data as published in its Python library, and from two
independent sources. PTYPE has different columns on D2R and R2D lines; several programs that write decks confuse them.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import replace
from typing import TYPE_CHECKING, Final, Literal

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.tuples import NamedTuple
from d2rpick.deck.card import CardField, Row, Value
from d2rpick.deck.ls_dyna_columns import (
    INERTIA_CENTRE,
    INERTIA_PART,
    INERTIA_TENSOR,
    RESTART_CONTROL,
    SWITCH_COUNTS,
    SWITCH_TIMES,
    TO_DEFORMABLE,
    TO_RIGID,
)
from d2rpick.deck.reader import SWITCHING, Deck, Restart

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.ls_dyna_parts import DeckParts

Kind = Literal["automatic", "plain", "inertia", "restart"]

BY_TIME, BY_SENSOR = 0, 5  # Values of CODE for switches by time and by a sensor.
_KINDS: Final[dict[str, Kind]] = {
    "DEFORMABLE_TO_RIGID": "plain",
    "DEFORMABLE_TO_RIGID_AUTOMATIC": "automatic",
    "DEFORMABLE_TO_RIGID_INERTIA": "inertia",
    "RIGID_DEFORMABLE_CONTROL": "restart",
    "RIGID_DEFORMABLE_D2R": "restart",
    "RIGID_DEFORMABLE_R2D": "restart",
}
_HEADER_ROWS = 2
_PTYPES: Final = {"PART", "PSET"}
_INERTIA_ROWS: Final = (
    "the first line (PID)",
    "the second line (XC to TM)",
    "the third line (IXX to IZZ)",
)


class Switched(NamedTuple):
    """One part line of a card: a part or part set (``by_set``) that becomes rigid or deformable."""

    part: Value[int]
    by_set: bool
    to_rigid: bool
    lead: Value[int] | None = None  # Value of LRB, which only D2R lines contain.


class SwitchHeader(NamedTuple):
    """The two header lines of *DEFORMABLE_TO_RIGID_AUTOMATIC; ``to_rigid`` is D2R and ``to_deformable`` is R2D."""

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
    """One switching card: its header (if any) and its parts.

    ``count_problem`` states how the numbers of lines differ from the counts; it is empty if they agree. ``values``
    contains all fields of the card.
    """

    card: Card
    kind: Kind
    header: SwitchHeader | None
    switched: tuple[Switched, ...]
    values: tuple[Value[int] | Value[float] | Value[str], ...]
    count_problem: str = ""
    part: Value[int] | None = None  # Id of the part on *DEFORMABLE_TO_RIGID_INERTIA.
    # The restart that contains the card, if the start time of the restart is known.
    restart: Restart | None = None

    @cached_property
    def time(self) -> float | None:
        """Return the switching time [time of the whole deck]; None if the card does not switch by time."""
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
    def time_field(self) -> CardField:
        """Return the field that contains the switching time, or the keyword if the card has no such field.

        This time is TIME1, or the end of the run before a restart.
        """
        if self.restart:
            return self.restart.stop_field
        return self.header.time1.field if self.header else self.card.here

    @property
    def problems(self) -> Iterator[tuple[CardField, str]]:
        """Return the fields that cannot be read, each with the reason."""
        return ((value.field, value.problem) for value in self.values if value.problem)


def read_switching(deck: Deck) -> tuple[SwitchSet, ...]:
    """Return all switching cards of a deck, in reading order."""
    kinds = ((card, _KINDS.get(card.name)) for card in deck.cards)
    return tuple(
        _read_automatic(card)
        if kind == "automatic"
        else _read_simple(card, kind, deck.restarts.get(card.file))
        for card, kind in kinds
        if kind is not None
    )


def find_misspelt(deck: Deck) -> Iterator[tuple[Card, str]]:
    """Yield misspelled switching cards, each with the keyword that was probably meant."""
    for card in deck.cards:
        if card.name not in _KINDS and SWITCHING.match(card.block.head):
            # Imported here to keep start-up fast.
            from difflib import get_close_matches

            name = re.sub(r"\W+", "_", card.block.head.upper()).strip("_")
            yield card, f"*{get_close_matches(name, _KINDS, n=1, cutoff=0)[0]}"


def _read_simple(card: Card, kind: Kind, restart: Restart | None) -> SwitchSet:
    """Read a switching card without header lines."""
    restart = restart if kind == "restart" else None
    rows = card.lines
    if kind == "inertia":
        part = (
            [
                _add_offset(
                    card.integer(rows[0], INERTIA_PART["PID"]), card.transform.part
                )
            ]
            if rows
            else []
        )
        lines_of_reals = (INERTIA_CENTRE, INERTIA_TENSOR)
        reals = [
            value
            for row, line in zip(rows[1:], lines_of_reals, strict=False)
            for value in card.numbers(row, line)
        ]
        missing = _INERTIA_ROWS[len(rows) :]
        if missing:
            problem = (
                f"{' and '.join(missing)} {'are' if len(missing) > 1 else 'is'} missing"
            )
        else:
            problem = ""
        return SwitchSet(
            card, kind, None, (), (*part, *reals), problem, next(iter(part), None)
        )
    if card.name.endswith("_CONTROL"):
        values = card.numbers(rows[0], RESTART_CONTROL) if rows else []
        return SwitchSet(card, kind, None, (), tuple(values), restart=restart)
    to_rigid = not card.name.endswith("_R2D")
    lines = [
        _read_part_line(card, row, to_rigid=to_rigid, ptype=kind == "plain")
        for row in rows
    ]
    return replace(_make_switch_set(card, kind, None, lines), restart=restart)


def _read_automatic(card: Card) -> SwitchSet:
    """Read a *DEFORMABLE_TO_RIGID_AUTOMATIC."""
    rows = list(card.rows)
    while rows and rows[-1].blank:
        rows.pop()
    if missing := _describe_missing(rows):
        return SwitchSet(card, "automatic", None, (), (), missing)
    header = _read_header(card, rows[0], rows[1])
    lines = rows[_HEADER_ROWS:]
    if header.to_rigid.problem or header.to_deformable.problem:
        return _make_switch_set(card, "automatic", header, [])
    rigid = header.to_rigid.value
    deformable = header.to_deformable.value
    problem = ""
    if rigid < 0 or deformable < 0:
        problem = (
            f"D2R is {rigid} and R2D is {deformable}, expected counts of 0 or more"
        )
    elif len(lines) != rigid + deformable:
        problem = (
            f"D2R is {rigid} and R2D is {deformable}, but {_count_lines(len(lines))}"
        )
        problem += "" if lines else ": the third line, with the first part, is missing"
    elif not lines:
        up_to_d2r = range(SWITCH_COUNTS["D2R"].position + 1)
        short = not all(rows[1].cell(position) for position in up_to_d2r)
        lost = "; is the second line (NRBF to OFFSET) missing?" if short else ""
        problem = f"D2R and R2D are 0, so the card switches nothing{lost}"
    elif any(row.blank for row in lines):
        problem = "a line is empty where a part was expected"
    rigid = max(rigid, 0)
    deformable = max(deformable, 0)
    switched = [
        # If the counts are wrong, a line may belong to the other list.
        _read_part_line(
            card, row, to_rigid=not (problem and _is_back_line(row)), ptype=True
        )
        for row in lines[:rigid]
        if not row.blank
    ]
    back = lines[rigid : rigid + deformable]
    switched += [
        _read_part_line(card, row, to_rigid=False, ptype=True)
        for row in back
        if not row.blank
    ]
    return _make_switch_set(card, "automatic", header, switched, problem)


def _describe_missing(rows: Sequence[Row]) -> str:
    """Describe header lines that are missing or replaced by a part line; empty if none are missing."""
    both_missing = (
        "the first line (SWSET to PAIRED) and the second (NRBF to OFFSET) are missing"
    )
    if not rows:
        return both_missing
    if _is_part_line(rows[0]):
        return f"{both_missing}, {rows[0].text.strip()!r} stands in their place"
    if len(rows) < _HEADER_ROWS:
        return "the second line (NRBF to OFFSET) is missing"
    if _is_part_line(rows[1]):
        return f"the second line (NRBF to OFFSET) is missing, {rows[1].text.strip()!r} stands in its place"
    return ""


def _is_part_line(row: Row) -> bool:
    """Return True if a line has a PTYPE in one of its columns."""
    return any(
        row.cell(line["PTYPE"].position).upper() in _PTYPES
        for line in (TO_DEFORMABLE, TO_RIGID)
    )


def _is_back_line(row: Row) -> bool:
    """Return True if a line has its PTYPE in the column of a part that becomes deformable."""
    return row.cell(TO_DEFORMABLE["PTYPE"].position).upper() in _PTYPES


def _count_lines(count: int) -> str:
    """Return a phrase that states how many part lines follow the header lines."""
    return "1 part line follows" if count == 1 else f"{count or 'no'} part lines follow"


def _read_header(card: Card, first: Row, second: Row) -> SwitchHeader:
    """Read the two header lines of a switch set."""
    values = card.numbers(first, SWITCH_TIMES) + card.numbers(second, SWITCH_COUNTS)
    swset, code, time1, time2, time3, entno, relsw, *further_values = values
    if not code.problem and not BY_TIME <= code.value <= BY_SENSOR:
        code = code.refuse(f"CODE is {code.value}, expected {BY_TIME} to {BY_SENSOR}")
    if not swset.problem and swset.value <= 0:
        swset = swset.refuse(f"SWSET is {swset.value}, expected a positive number")
    if code.value == BY_TIME and not time1.problem and _is_overlong(first):
        next_text = first.cell(SWITCH_TIMES["TIME2"].position)
        problem = f"TIME1 runs over its columns into TIME2 ({time1.field.text} and {next_text})"
        time1 = time1.refuse(problem)
    swset, relsw = (
        _add_offset(set_id, card.transform.rest) for set_id in (swset, relsw)
    )
    return SwitchHeader(swset, code, time1, time2, time3, entno, relsw, *further_values)


def _is_overlong(row: Row) -> bool:
    """Return True if the digits of TIME1 run on into the columns of TIME2, so that TIME2 is not a separate number."""
    border = SWITCH_TIMES["TIME2"].position * row.width
    next_field = row.text[border : border + row.width].strip()
    touching = (
        row.text[border - 1 : border].isdigit()
        and row.text[border : border + 1].isdigit()
    )
    return (
        touching
        and "," not in row.text
        and "." not in next_field
        and next_field.strip("0") != ""
    )


_Line = tuple[Switched, Value[str]]


def _read_part_line(card: Card, row: Row, *, to_rigid: bool, ptype: bool) -> _Line:
    """Read a part line: the part, LRB if it is a D2R line, and PTYPE if the keyword has it."""
    line = TO_RIGID if to_rigid else TO_DEFORMABLE
    if ptype:
        kind = card.word(row, line["PTYPE"], "PART")
    else:
        kind = Value("PART", card.here)
    if kind.value not in _PTYPES:
        kind = Value(
            "PART",
            kind.field,
            f"PTYPE is {kind.field.text!r}, but PART or PSET was expected",
        )
    by_set = kind.value == "PSET"
    part = _add_offset(
        card.integer(row, line["PID"]),
        card.transform.set_ if by_set else card.transform.part,
    )
    if not part.problem and part.value <= 0:
        part = Value(
            0,
            part.field,
            f"{part.field.text!r} is not a part id; a positive number was expected",
        )
    if to_rigid:
        lead = _add_offset(card.integer(row, line["LRB"]), card.transform.part)
    else:
        lead = None
    return Switched(part, by_set, to_rigid, lead), kind


def _add_offset(value: Value[int], offset: int) -> Value[int]:
    """Add the id offset of the include file to an id; 0 stays 0."""
    if value.problem or not value.value or not offset:
        return value
    return value.change_to(value.value + offset)


def _make_switch_set(
    card: Card,
    kind: Kind,
    header: SwitchHeader | None,
    lines: Sequence[_Line],
    count_problem: str = "",
) -> SwitchSet:
    """Return the switch set of a card with its part lines."""
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


# The code below finds the windows in which parts are rigid.


class Unit(NamedTuple):
    """The target of a switch: a part, or a part set or rigid body (given by its main node) whose parts are unknown."""

    id: int
    is_set: bool = False
    is_body: bool = False

    @property
    def kind(self) -> str:
        """Return the kind of the id: part, part set or main node."""
        if self.is_set:
            return "part set"
        return "main node" if self.is_body else "part"

    @property
    def part(self) -> int | None:
        """Return the part id; None for a part set or rigid body whose parts are unknown."""
        return None if self.is_set or self.is_body else self.id


class SwitchEvent(NamedTuple):
    """A switch of a part or other unit, caused by one line of a card."""

    unit: Unit
    by: SwitchSet
    line: Switched


class SwitchWindow(NamedTuple):
    """A rigid window of a part or other unit from ``tr`` to ``td`` [time of the deck]; ``td`` is None if it has no end.

    ``td`` may be earlier than ``tr`` if the cards contain such times, which a rule reports.
    """

    unit: Unit
    tr: float
    td: float | None
    opened: SwitchEvent
    closed: SwitchEvent | None

    @property
    def part(self) -> int | None:
        """Return the part id; None if the parts are unknown."""
        return self.unit.part


class Windows(NamedTuple):
    """All rigid windows of a deck by unit and time; ``orphans`` are releases of units that were not rigid.

    ``other_rigid`` and ``other_deformable`` are units that are switched at unknown times (CODE 1-5, restarts).
    """

    windows: tuple[SwitchWindow, ...]
    orphans: tuple[SwitchEvent, ...]
    events: tuple[SwitchEvent, ...]
    other_rigid: frozenset[Unit]
    other_deformable: frozenset[Unit]


def find_windows(
    sets: Iterable[SwitchSet],
    parts: DeckParts,
    by_sensor: Iterable[tuple[float, SwitchEvent]] = (),
) -> Windows:
    """Return the windows of every part, from the cards in order of their times.

    ``by_sensor`` contains the switches by sensors with their times, which the cards do not contain.

    Part sets are replaced by their parts. If a part that is already rigid is made rigid again (with a new lead part),
    its window continues. If a part is switched back first and made rigid later, and no other switch matches, the two
    form one inverted window.
    """
    events = tuple(event for card in sets for event in _list_events(card, parts))
    timed: dict[Unit, list[tuple[float, SwitchEvent]]] = defaultdict(list)
    for event in events:
        if event.by.time is not None:
            timed[event.unit].append((event.by.time, event))
    for time, event in by_sensor:
        timed[event.unit].append((time, event))
    windows: list[SwitchWindow] = []
    orphans: list[SwitchEvent] = []
    for unit in sorted(timed):
        # At equal times, the switch to deformable comes first, so that there is no window of length 0.
        unit_windows, unit_orphans = follow_unit(
            unit,
            sorted(timed[unit], key=lambda timed: (timed[0], timed[1].line.to_rigid)),
        )
        if unit_orphans and unit_windows and unit_windows[-1].td is None:
            td, closed = unit_orphans.pop()
            unit_windows[-1] = unit_windows[-1]._replace(td=td, closed=closed)
        windows += unit_windows
        orphans += [event for _, event in unit_orphans]
    untimed = [event for event in events if event.by.time is None]
    rigid, back = (
        frozenset(event.unit for event in untimed if event.line.to_rigid == to_rigid)
        for to_rigid in (True, False)
    )
    return Windows(tuple(windows), tuple(orphans), events, rigid, back)


def _list_events(card: SwitchSet, parts: DeckParts) -> Iterable[SwitchEvent]:
    """Yield the switches that a card causes, one per part."""
    for line in card.switched:
        if line.part.problem:
            continue
        members = parts.members(line.part.value) if line.by_set else (line.part.value,)
        if members is None:
            yield SwitchEvent(Unit(line.part.value, is_set=True), card, line)
        else:
            yield from (SwitchEvent(Unit(part), card, line) for part in members)


def follow_unit(
    unit: Unit, events: Iterable[tuple[float, SwitchEvent]]
) -> tuple[list[SwitchWindow], list[tuple[float, SwitchEvent]]]:
    """Return the windows of a part or other unit from its ordered switches, and each release while it is deformable."""
    windows: list[SwitchWindow] = []
    orphans: list[tuple[float, SwitchEvent]] = []
    opened: tuple[float, SwitchEvent] | None = None
    for time, event in events:
        if event.line.to_rigid:
            opened = opened or (time, event)
        elif opened:
            windows.append(SwitchWindow(unit, opened[0], time, opened[1], event))
            opened = None
        else:
            orphans.append((time, event))
    if opened:
        windows.append(SwitchWindow(unit, opened[0], None, opened[1], None))
    return windows, orphans
