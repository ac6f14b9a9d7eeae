"""Contacts and rigid walls of a deck: what ENTNO of a switching card can name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.reader import Deck

_NO_CONTACTS: Final = {"ADD", "AUTO", "COUPLING", "EXCLUDE", "GEBOD", "GUIDED"}  # first words of their names
_MOST_ROWS = 8  # of one definition without an id; more rows may hold another one


class Entity(NamedTuple):
    """A contact or rigid wall: keyword, id and title as given (0 and empty: none), its number in the deck."""

    keyword: str
    id: int
    title: str
    number: int


class Entities(NamedTuple):
    """What there is to name; ``all_known`` is False where one keyword may define several."""

    found: tuple[Entity, ...]
    all_known: bool

    def named(self, number: int) -> Entity | None:
        """Find by id, else by the order of definition, which counts for those without an id."""
        by_id = next((one for one in self.found if one.id == number), None)
        return by_id or next((one for one in self.found if one.number == number and not one.id), None)


def read_contacts(deck: Deck) -> Entities:
    """List the contacts of a deck."""
    return _read(deck, "CONTACT")


def read_rigid_walls(deck: Deck) -> Entities:
    """List the rigid walls of a deck."""
    return _read(deck, "RIGIDWALL")


def _read(deck: Deck, kind: str) -> Entities:
    found: list[Entity] = []
    all_known = not deck.unread and not deck.encrypted
    for keyword, number, title, rows, moved in _cards(deck, kind):
        all_known = all_known and not moved and (number > 0 or rows <= _MOST_ROWS)
        found.append(Entity(keyword, number, title, len(found) + 1))
    return Entities(tuple(found), all_known)


def _cards(deck: Deck, kind: str) -> Iterator[tuple[str, int, str, int, bool]]:
    """Keyword, id, title, number of lines, and whether the ids are moved by an include, of each definition."""
    for card in deck.named(kind):
        words = card.name.split("_")
        if words[1:2] and words[1] in _NO_CONTACTS:
            continue
        number, title = 0, ""
        if {"ID", "TITLE"} & {*words} and card.rows:
            value = card.integer(card.rows[0], 0)
            number, title = value.value, card.rows[0].text[card.width :].strip()
        yield card.name, number, title, len(card.rows), card.transform.rest != 0
