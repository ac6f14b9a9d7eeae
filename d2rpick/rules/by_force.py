"""Evaluate switches triggered by a contact or rigid-wall force, with a history that shows when this force acts.

Forces that the solver wrote show when each contact and wall acts. Momenta show that a force acts on a part, but not
which contact exerts it, so decks with several contacts or walls are not judged by momenta.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from d2rpick.deck.force_switching import ForceSwitch, follow_pair
from d2rpick.deck.ls_dyna_parts import read_entities
from d2rpick.deck.switching import SwitchEvent, SwitchSet, SwitchWindow

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.base.spans import Spans
    from d2rpick.deck.card import Card
    from d2rpick.deck.reader import Deck
    from d2rpick.deck.switching import SwitchHeader, Unit
    from d2rpick.rules.judgement import HistoryJudge


# For each CODE: what exerts the force, and True if the set waits until the force begins, False if it ends.
_CODES: Final = {
    1: ("rigid wall", False),
    2: ("contact", False),
    3: ("rigid wall", True),
    4: ("contact", True),
}
_KEYWORDS: Final[Mapping[str, Literal["CONTACT", "RIGIDWALL"]]] = {
    "contact": "CONTACT",
    "rigid wall": "RIGIDWALL",
}
# From this TIME2 on, there is no latest switching time.
_NEVER: Final = 1e20
# A window up to this fraction of the longest window is treated as chatter instead of a flight [-].
_SHORT: Final = 0.1


class Forced(NamedTuple):
    """A force-triggered switch or pair of switches: its windows in the history, and the spans of the force [time].

    ``place`` is the card that makes the parts rigid, ``cards`` are the cards of the pair.  ``wait`` is the name of the
    time that delays the next switch (TIME3, or Tdelay of the sensor).  ``source`` names what shows the contacts.
    """

    place: Card
    cards: tuple[Card, ...]
    windows: tuple[SwitchWindow, ...]
    contacts: Spans
    wait: str
    source: str = "momenta"

    @property
    def times(self) -> list[tuple[float, float | None]]:
        """Return the windows of the switched parts in ascending order, without duplicates."""
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
        """Return the windows that are not chatter. A window without an end lasts until infinity."""
        closed = [(tr, math.inf if td is None else td) for tr, td in self.times]
        longest = max((td - tr for tr, td in closed if td < math.inf), default=0.0)
        return [(tr, td) for tr, td in closed if td - tr >= _SHORT * longest]


class _Seen(NamedTuple):
    """The time spans of the contact force that switches a set [time], and the data that show them."""

    contacts: Spans
    source: str


def follow_forced_switches(
    deck: Deck, events: Sequence[SwitchEvent], judge: HistoryJudge, end: float
) -> Iterator[Forced]:
    """Yield the force-triggered switches of an LS-DYNA deck with their windows; none if the history has no contacts."""
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
        windows: list[SwitchWindow] = []
        last_seen: _Seen | None = None
        for event in by_card[rigid_card]:
            seen_contacts = _see_contacts(deck, rigid_card, event.unit, judge)
            if back_card:
                seen_back = _see_contacts(deck, back_card, event.unit, judge)
            else:
                seen_back = seen_contacts
            if seen_contacts is None or seen_back is None:
                continue
            last_seen = seen_contacts
            closing = _find_event(event.unit, by_card[back_card]) if back_card else None
            deformable = waiting[back_card] if back_card and closing else None
            spans = follow_pair(
                rigid, deformable, seen_contacts.contacts, end, seen_back.contacts
            )
            windows += (
                SwitchWindow(
                    event.unit, tr, td, event, closing if td is not None else None
                )
                for tr, td in spans
            )
        if last_seen:
            cards = [rigid_card.card]
            if back_card:
                cards.append(back_card.card)
            yield Forced(
                rigid_card.card,
                tuple(cards),
                tuple(windows),
                last_seen.contacts,
                "TIME3",
                last_seen.source,
            )


def _see_contacts(
    deck: Deck, card: SwitchSet, unit: Unit, judge: HistoryJudge
) -> _Seen | None:
    """Return the contact spans for a set from written forces or, if the deck has only one contact, from part momenta.

    For a set with OFFSET, each contact begins earlier by the time in which the parts fly this distance. The result is
    None if the history does not show the contacts, or if the force of the contact triggers no switch (D2R008).
    """
    header = card.header
    if header is None or not _can_trigger(deck, header):
        return None
    pushed = None if unit.part is None else judge.pushed([unit.part])
    kind, _ = _CODES[header.code.value]
    by_force = find_spans_of_force(deck, judge, kind, header.entno.value)
    if by_force is not None:
        seen_contacts = _Seen(by_force, "contact forces")
    elif pushed is not None and _has_one_force(deck):
        seen_contacts = _Seen(pushed.spans, "momenta")
    else:
        return None
    offset = 0.0 if header.offset.problem else header.offset.value
    if offset <= 0 or card.switched[0].to_rigid:
        return seen_contacts
    if pushed is None or not pushed.speed:
        return None
    lead = offset / pushed.speed
    return seen_contacts._replace(
        contacts=tuple((start - lead, end) for start, end in seen_contacts.contacts)
    )


def _can_trigger(deck: Deck, header: SwitchHeader) -> bool:
    """Return True if the force of the contact or rigid wall ENTNO may switch parts, or if the deck lacks ENTNO."""
    kind, _ = _CODES[header.code.value]
    entity = read_entities(deck, _KEYWORDS[kind]).named(header.entno.value)
    return entity is None or kind != "contact" or entity.triggers


def find_spans_of_force(
    deck: Deck, judge: HistoryJudge, kind: str, number: int, least: float = 0.0
) -> Spans | None:
    """Return the time spans in which the written force of a contact or rigid wall exceeds ``least`` [force] [time].

    Files identify a contact by its id or, if it has none, by its position in the order of definition. Some files always
    identify rigid walls by position; if there are several walls whose ids differ from their positions, no wall is used.
    """
    entities = read_entities(deck, _KEYWORDS[kind])
    entity = entities.named(number)
    if entity is None:
        # A file of switching cards defines no contacts.
        alone = not entities.found and number > 0
        return judge.find_force_spans(kind, number, least) if alone else None
    name = entity.id or entity.number
    is_order = kind == "rigid wall"
    if is_order and any(entry.id not in (0, entry.number) for entry in entities.found):
        if len(entities.found) > 1:
            return None
        by_order = judge.find_force_spans(kind, entity.number, least)
        if by_order is not None:
            return by_order
    return judge.find_force_spans(kind, name, least)


def _has_one_force(deck: Deck) -> bool:
    """Return True if a deck has at most one contact or rigid wall; a file of switching cards has none."""
    return (
        len(read_entities(deck, "CONTACT").found)
        + len(read_entities(deck, "RIGIDWALL").found)
        <= 1
    )


def _read_waiting(card: SwitchSet) -> ForceSwitch | None:
    """Return the conditions of a switch set; None if it does not wait for a force or has an unreadable field."""
    header = card.header
    factor = card.card.transform.time
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
        _CODES[header.code.value][1],
        header.time1.value * factor,
        latest if 0 < latest < _NEVER else math.inf,
        header.time3.value * factor,
        bool(header.paired.value),
    )


def _find_pair(
    rigid_card: SwitchSet,
    by_card: dict[SwitchSet, list[SwitchEvent]],
    waiting: dict[SwitchSet, ForceSwitch],
) -> SwitchSet | None:
    """Return the set that makes the parts of ``rigid_card`` deformable again; None if there is no such set."""
    units = {event.unit for event in by_card[rigid_card]}
    for card, switch in waiting.items():
        if not switch.to_rigid and units & {event.unit for event in by_card[card]}:
            return card
    return None


def _find_event(unit: Unit, events: Sequence[SwitchEvent]) -> SwitchEvent | None:
    """Return the event that switches a part or other unit; None if there is no such event."""
    return next((event for event in events if event.unit == unit), None)
