"""Switches by the force of a contact or rigid wall, in a run whose history shows when something pushes.

Momenta show that something pushes, not what: a deck with several contacts and walls is not judged.
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

_CODES: Final = {
    1: False,
    2: False,
    3: True,
    4: True,
}  # whether a set waits for a force
_NEVER: Final = 1e20
# A window of so much of the longest one is none that anybody wants.
_SHORT: Final = 0.1


class Forced(NamedTuple):
    """A switch by force, or a pair of them, with its windows in the history, and when something pushes there [time].

    ``place`` is the card that makes the parts rigid, ``cards`` are those of the pair; ``wait`` is what to call the time
    that keeps it from switching.
    """

    place: Card
    cards: tuple[Card, ...]
    windows: tuple[Window, ...]
    contacts: Spans
    wait: str

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


def follow_forced_switches(
    deck: Deck, events: Sequence[Event], judge: HistoryJudge, end: float
) -> Iterator[Forced]:
    """Follow the sets of a deck of LS-DYNA that switch by force; none where the history does not show contacts."""
    if not _has_one_force(deck):
        return
    by_card = {
        event.by: [one for one in events if one.by is event.by] for event in events
    }
    waiting = {
        card: made for card in by_card if (made := _read_waiting(card)) is not None
    }
    for there, rigid in waiting.items():
        if not rigid.to_rigid:
            continue
        back = _find_pair(there, by_card, waiting)
        windows: list[Window] = []
        contacts: Spans = ()
        for event in by_card[there]:
            pushed = (
                None if event.unit.part is None else judge.pushed([event.unit.part])
            )
            if pushed is not None:
                contacts = _shift_contacts(pushed, back)
                windows += _follow_windows(event, back, by_card, waiting, contacts, end)
        if windows:
            cards = (there.card, back.card) if back else (there.card,)
            yield Forced(there.card, cards, tuple(windows), contacts, "TIME3")


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
        _CODES[header.code.value],
        header.time1.value * factor,
        latest if 0 < latest < _NEVER else math.inf,
        header.time3.value * factor,
        bool(header.paired.value),
    )


def _shift_contacts(pushed: ContactTimes, back: SwitchSet | None) -> Spans:
    """Give the contacts as the set sees them that makes parts deformable: earlier by the time to fly its OFFSET."""
    offset = (
        back.header.offset.value
        if back and back.header and not back.header.offset.problem
        else 0.0
    )
    lead = offset / pushed.speed if pushed.speed and offset > 0 else 0.0
    return tuple((start - lead, end) for start, end in pushed.spans)


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


def _follow_windows(
    event: Event,
    back: SwitchSet | None,
    by_card: dict[SwitchSet, list[Event]],
    waiting: dict[SwitchSet, ForceSwitch],
    contacts: Spans,
    end: float,
) -> Iterator[Window]:
    """Give the windows of a unit that an event makes rigid."""
    rigid = waiting[event.by]
    closing = _find_event(event.unit, by_card[back]) if back else None
    other = waiting[back] if back and closing else None
    for tr, td in follow_pair(rigid, other, contacts, end):
        yield Window(event.unit, tr, td, event, closing if td is not None else None)


def _find_event(unit: Unit, events: Sequence[Event]) -> Event | None:
    return next((one for one in events if one.unit == unit), None)
