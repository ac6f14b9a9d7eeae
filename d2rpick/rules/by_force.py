"""Switches by the force of a contact or rigid wall, in a run whose history shows when something pushes.

Forces that the solver wrote show when each contact and wall pushes.  Momenta show that something pushes, not what: with
them alone a deck with several contacts and walls is not judged.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from d2rpick.deck.force_switching import ForceSwitch, follow_pair
from d2rpick.deck.ls_dyna_parts import read_entities
from d2rpick.deck.switching import Event, SwitchSet, Window

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.reader import Deck
    from d2rpick.deck.switching import Header, Unit
    from d2rpick.rules.judgement import HistoryJudge

    Spans = tuple[tuple[float, float], ...]  # of time

# What pushes, and whether a set waits for a force or for none, by CODE.
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
_NEVER: Final = 1e20
# A window of so much of the longest one is none that anybody wants.
_SHORT: Final = 0.1


class Forced(NamedTuple):
    """A switch by force, or a pair of them, with its windows in the history, and when something pushes there [time].

    ``place`` is the card that makes the parts rigid, ``cards`` are those of the pair; ``wait`` is what to call the time
    that keeps it from switching, ``source`` says what of the history shows the contacts.
    """

    place: Card
    cards: tuple[Card, ...]
    windows: tuple[Window, ...]
    contacts: Spans
    wait: str
    source: str = "momenta"

    @property
    def times(self) -> list[tuple[float, float | None]]:
        """Windows of its parts, each once, ascending."""
        return sorted(
            {(one.tr, one.td) for one in self.windows}, key=lambda pair: pair[0]
        )

    @property
    def switches(self) -> int:
        """How often it switches."""
        return sum(1 + (td is not None) for _, td in self.times)

    @property
    def lasting(self) -> list[tuple[float, float]]:
        """Windows that are no chatter; the end of one that stays open is infinite."""
        closed = [(tr, math.inf if td is None else td) for tr, td in self.times]
        longest = max((td - tr for tr, td in closed if td < math.inf), default=0.0)
        return [(tr, td) for tr, td in closed if td - tr >= _SHORT * longest]


class _Seen(NamedTuple):
    """The contacts that a switch set sees [time], and what of the history shows them."""

    contacts: Spans
    source: str


def follow_forced_switches(
    deck: Deck, events: Sequence[Event], judge: HistoryJudge, end: float
) -> Iterator[Forced]:
    """Follow the sets of a deck of LS-DYNA that switch by force; none where the history does not show contacts."""
    by_card = {
        event.by: [other for other in events if other.by is event.by]
        for event in events
    }
    waiting = {
        card: made for card in by_card if (made := _read_waiting(card)) is not None
    }
    for there, rigid in waiting.items():
        if not rigid.to_rigid:
            continue
        back = _find_pair(there, by_card, waiting)
        windows: list[Window] = []
        known: _Seen | None = None
        for event in by_card[there]:
            seen = _see_contacts(deck, there, event.unit, judge)
            seen_back = _see_contacts(deck, back, event.unit, judge) if back else seen
            if seen is None or seen_back is None:
                continue
            known = seen
            closing = _find_event(event.unit, by_card[back]) if back else None
            other = waiting[back] if back and closing else None
            spans = follow_pair(rigid, other, seen.contacts, end, seen_back.contacts)
            windows += (
                Window(event.unit, tr, td, event, closing if td is not None else None)
                for tr, td in spans
            )
        if known:
            cards = (there.card, back.card) if back else (there.card,)
            yield Forced(
                there.card, cards, tuple(windows), known.contacts, "TIME3", known.source
            )


def _see_contacts(
    deck: Deck, card: SwitchSet, unit: Unit, judge: HistoryJudge
) -> _Seen | None:
    """Find the contacts that a set sees: by written forces, else by the momenta of a part if only one thing pushes.

    A contact begins earlier for a set with OFFSET, by the time to fly so far.  None where the history does not show it,
    and for a contact whose force triggers no switch (D2R008).
    """
    header = card.header
    if header is None or not _can_trigger(deck, header):
        return None
    pushed = None if unit.part is None else judge.pushed([unit.part])
    kind, _ = _CODES[header.code.value]
    by_force = find_spans_of_force(deck, judge, kind, header.entno.value)
    if by_force is not None:
        seen = _Seen(by_force, "contact forces")
    elif pushed is not None and _has_one_force(deck):
        seen = _Seen(pushed.spans, "momenta")
    else:
        return None
    offset = 0.0 if header.offset.problem else header.offset.value
    if offset <= 0 or card.switched[0].to_rigid:
        return seen
    if pushed is None or not pushed.speed:
        return None
    lead = offset / pushed.speed
    return seen._replace(
        contacts=tuple((start - lead, end) for start, end in seen.contacts)
    )


def _can_trigger(deck: Deck, header: Header) -> bool:
    """Whether the contact or rigid wall that ENTNO names may switch parts, as far as the deck has it."""
    kind, _ = _CODES[header.code.value]
    entity = read_entities(deck, _KEYWORDS[kind]).named(header.entno.value)
    return entity is None or kind != "contact" or entity.triggers


def find_spans_of_force(
    deck: Deck, judge: HistoryJudge, kind: str, number: int, least: float = 0.0
) -> Spans | None:
    """Find when a contact or rigid wall pushes by more than ``least`` [force], by its written force [time].

    Files call a contact by its id, or by its order if it has none.  Some call rigid walls by their order in any case:
    of several whose ids are not their order, none is taken.
    """
    entities = read_entities(deck, _KEYWORDS[kind])
    entity = entities.named(number)
    if entity is None:
        # cards alone have none to name: their deck is not at hand
        alone = not entities.found and number > 0
        return judge.find_force_spans(kind, number, least) if alone else None
    name, is_order = entity.id or entity.number, kind == "rigid wall"
    if is_order and any(each.id not in (0, each.number) for each in entities.found):
        if len(entities.found) > 1:
            return None
        by_order = judge.find_force_spans(kind, entity.number, least)
        if by_order is not None:
            return by_order
    return judge.find_force_spans(kind, name, least)


def _has_one_force(deck: Deck) -> bool:
    """Whether a deck has one contact or rigid wall at most; cards alone have none."""
    return (
        len(read_entities(deck, "CONTACT").found)
        + len(read_entities(deck, "RIGIDWALL").found)
        <= 1
    )


def _read_waiting(card: SwitchSet) -> ForceSwitch | None:
    """Give what a set waits for; None for one that does not wait for a force, or says it in a way that is not read."""
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
        _CODES[header.code.value][1],
        header.time1.value * factor,
        latest if 0 < latest < _NEVER else math.inf,
        header.time3.value * factor,
        bool(header.paired.value),
    )


def _find_pair(
    there: SwitchSet,
    by_card: dict[SwitchSet, list[Event]],
    waiting: dict[SwitchSet, ForceSwitch],
) -> SwitchSet | None:
    """Give the set that makes the parts of another deformable again: its pair, or one that names the same parts."""
    units = {event.unit for event in by_card[there]}
    for card, switch in waiting.items():
        if not switch.to_rigid and units & {event.unit for event in by_card[card]}:
            return card
    return None


def _find_event(unit: Unit, events: Sequence[Event]) -> Event | None:
    return next((one for one in events if one.unit == unit), None)
