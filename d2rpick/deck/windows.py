"""Switching windows: from when to when every part of a deck is rigid, and which cards say so."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterable

    from d2rpick.deck.parts import Parts
    from d2rpick.deck.switching import Switched, SwitchSet


class Unit(NamedTuple):
    """A part; or a part set or a rigid body (by its main node) whose parts cannot be known."""

    id: int
    is_set: bool = False
    is_body: bool = False

    @property
    def kind(self) -> str:
        """What the id is one of."""
        return "part set" if self.is_set else "main node" if self.is_body else "part"


class Event(NamedTuple):
    """A unit is switched by a line of a card."""

    unit: Unit
    by: SwitchSet
    line: Switched


@dataclass(frozen=True)
class Window:
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
        """The part; None for a part set or rigid body whose parts cannot be known."""
        return self.unit.id if self.unit.kind == "part" else None


@dataclass(frozen=True)
class Windows:
    """All windows of a deck by unit and time; ``orphans`` switch back what nothing made rigid before.

    ``other_rigid`` and ``other_deformable`` are switched at times that no clock tells (CODE 1-5, restarts).
    """

    windows: tuple[Window, ...]
    orphans: tuple[Event, ...]
    events: tuple[Event, ...]
    other_rigid: frozenset[Unit]
    other_deformable: frozenset[Unit]


def find_windows(sets: Iterable[SwitchSet], parts: Parts) -> Windows:
    """Follow every part through the cards in the order of their times.

    Part sets are resolved to their parts.  A part that is made rigid while it is rigid (a new lead) stays in
    its window.  When a part is switched back first and made rigid later and nothing else matches, the two
    belong to one inverted window.
    """
    events = tuple(event for card in sets for event in _events(card, parts))
    timed: dict[Unit, list[tuple[float, Event]]] = defaultdict(list)
    for event in events:
        if event.by.time is not None:
            timed[event.unit].append((event.by.time, event))
    windows: list[Window] = []
    orphans: list[Event] = []
    for unit in sorted(timed):
        found, left = _follow(unit, timed[unit])
        windows += found
        orphans += left
    return Windows(
        tuple(windows),
        tuple(orphans),
        events,
        frozenset(event.unit for event in events if event.by.time is None and event.line.to_rigid),
        frozenset(event.unit for event in events if event.by.time is None and not event.line.to_rigid),
    )


def _events(card: SwitchSet, parts: Parts) -> Iterable[Event]:
    for line in card.switched:
        if line.part.problem:
            continue
        members = parts.members(line.part.value) if line.by_set else (line.part.value,)
        if members is None:
            yield Event(Unit(line.part.value, is_set=True), card, line)
        else:
            yield from (Event(Unit(part), card, line) for part in members)


def _follow(unit: Unit, events: list[tuple[float, Event]]) -> tuple[list[Window], list[Event]]:
    windows: list[Window] = []
    orphans: list[tuple[float, Event]] = []
    opened: tuple[float, Event] | None = None
    # at equal times the way back counts as the earlier one: both at once is no window
    for time, event in sorted(events, key=lambda timed: (timed[0], timed[1].line.to_rigid)):
        if event.line.to_rigid:
            opened = opened or (time, event)
        elif opened is None:
            orphans.append((time, event))
        else:
            windows.append(Window(unit, opened[0], time, opened[1], event))
            opened = None
    if opened is not None:
        td, closed = orphans.pop() if orphans else (None, None)
        windows.append(Window(unit, opened[0], td, opened[1], closed))
    return windows, [event for _, event in orphans]
