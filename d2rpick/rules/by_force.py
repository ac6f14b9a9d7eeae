"""Evaluate switches by a contact or rigid-wall force over a history that shows when a contact force acts.

Momenta show that a force acts on a part, not which contact exerts it. A deck with several contacts and walls is
therefore not judged.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.deck.force_switching import ForceSwitch, follow_pair
from d2rpick.deck.ls_dyna_parts import read_entities
from d2rpick.deck.switching import Event, SwitchSet, Window

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.reader import Deck
    from d2rpick.deck.switching import Unit
    from d2rpick.flight.contact_times import ContactTimes
    from d2rpick.rules.judgement import HistoryJudge

    Spans = tuple[tuple[float, float], ...]  # of time

# By CODE, True if the set waits for a force, False if it waits until there is none.
_CODES: Final = {
    1: False,
    2: False,
    3: True,
    4: True,
}
_NEVER: Final = 1e20  # TIME2 from which on there is no latest time
# Windows below this fraction of the longest one are chatter, not flights.
_SHORT: Final = 0.1


class Forced(NamedTuple):
    """A switch by a force, or a pair of them, with its windows in the history and the spans of the contact force
    [time].

    ``place`` is the card that makes the parts rigid, ``cards`` are the cards of the pair. ``wait`` is the name of the
    time that delays the next switch (TIME3, or Tdelay of the sensor).
    """

    place: Card
    cards: tuple[Card, ...]
    windows: tuple[Window, ...]
    contacts: Spans
    wait: str

    @property
    def times(self) -> list[tuple[float, float | None]]:
        """Return the windows of its parts without duplicates, ascending."""
        return sorted(
            {(window.tr, window.td) for window in self.windows},
            key=lambda pair: pair[0],
        )

    @property
    def switches(self) -> int:
        """Return the number of switches in the history."""
        return sum(1 + (td is not None) for _, td in self.times)

    @property
    def lasting(self) -> list[tuple[float, float]]:
        """Return the windows that are not chatter; a window that stays open ends at infinity."""
        closed = [(tr, math.inf if td is None else td) for tr, td in self.times]
        longest = max((td - tr for tr, td in closed if td < math.inf), default=0.0)
        return [(tr, td) for tr, td in closed if td - tr >= _SHORT * longest]


def follow_forced_switches(
    deck: Deck, events: Sequence[Event], judge: HistoryJudge, end: float
) -> Iterator[Forced]:
    """Yield the switches by a force in an LS-DYNA deck with their windows; nothing if the history shows no contacts."""
    if not _has_one_force(deck):
        return
    by_card = {
        event.by: [unit_event for unit_event in events if unit_event.by is event.by]
        for event in events
    }
    waiting = {
        card: conditions
        for card in by_card
        if (conditions := _read_waiting(card)) is not None
    }
    for rigid_card, rigid in waiting.items():
        if not rigid.to_rigid:
            continue
        back_card = _find_pair(rigid_card, by_card, waiting)
        windows: list[Window] = []
        contacts: Spans = ()
        for event in by_card[rigid_card]:
            pushed = (
                None if event.unit.part is None else judge.pushed([event.unit.part])
            )
            if pushed is not None:
                contacts = _shift_contacts(pushed, back_card)
                windows += _follow_windows(
                    event, back_card, by_card, waiting, contacts, end
                )
        if windows:
            cards = (
                (rigid_card.card, back_card.card) if back_card else (rigid_card.card,)
            )
            yield Forced(rigid_card.card, cards, tuple(windows), contacts, "TIME3")


def _has_one_force(deck: Deck) -> bool:
    """Return True if a deck has at most one contact or rigid wall; a deck of switching cards alone has none."""
    return (
        len(read_entities(deck, "CONTACT").found)
        + len(read_entities(deck, "RIGIDWALL").found)
        <= 1
    )


def _read_waiting(card: SwitchSet) -> ForceSwitch | None:
    """Return the conditions of a switch set; None if it does not wait for a force, or one of its fields is
    unreadable.
    """
    header, factor = card.header, card.card.transform.time
    if header is None or header.code.value not in _CODES or not card.switched:
        return None
    if any(
        value.problem
        for value in (
            header.code,
            header.time1,
            header.time2,
            header.time3,
            header.paired,
        )
    ):
        return None
    latest = header.time2.value * factor
    return ForceSwitch(
        card.switched[0].to_rigid,
        _CODES[header.code.value],
        header.time1.value * factor,
        latest if 0 < latest < _NEVER else math.inf,
        header.time3.value * factor,
        bool(header.paired.value),
    )


def _shift_contacts(pushed: ContactTimes, back_card: SwitchSet | None) -> Spans:
    """Return the contacts as the set sees them that makes parts deformable: OFFSET lets it act before the contact
    begins.
    """
    offset = (
        back_card.header.offset.value
        if back_card and back_card.header and not back_card.header.offset.problem
        else 0.0
    )
    lead = offset / pushed.speed if pushed.speed and offset > 0 else 0.0
    return tuple((start - lead, end) for start, end in pushed.spans)


def _find_pair(
    rigid_card: SwitchSet,
    by_card: dict[SwitchSet, list[Event]],
    waiting: dict[SwitchSet, ForceSwitch],
) -> SwitchSet | None:
    """Return the set that makes the same parts deformable as ``rigid_card`` makes rigid, or None."""
    units = {event.unit for event in by_card[rigid_card]}
    for card, switch in waiting.items():
        if not switch.to_rigid and units & {event.unit for event in by_card[card]}:
            return card
    return None


def _follow_windows(
    event: Event,
    back_card: SwitchSet | None,
    by_card: dict[SwitchSet, list[Event]],
    waiting: dict[SwitchSet, ForceSwitch],
    contacts: Spans,
    end: float,
) -> Iterator[Window]:
    """Yield the windows of the unit that an event makes rigid."""
    rigid = waiting[event.by]
    closing = _find_event(event.unit, by_card[back_card]) if back_card else None
    deformable = waiting[back_card] if back_card and closing else None
    for tr, td in follow_pair(rigid, deformable, contacts, end):
        yield Window(event.unit, tr, td, event, closing if td is not None else None)


def _find_event(unit: Unit, events: Sequence[Event]) -> Event | None:
    """Return the event of a unit, or None."""
    return next((event for event in events if event.unit == unit), None)
