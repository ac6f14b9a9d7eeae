"""Decks: cards with file, line and column; includes, parameters, switching windows; `radioss` has its own files."""

from d2rpick.deck.parts import Parts, read_parts
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.switching import SwitchSet, read_switching
from d2rpick.deck.windows import Window, Windows, find_windows

__all__ = [
    "Deck",
    "Parts",
    "SwitchSet",
    "Window",
    "Windows",
    "find_windows",
    "read_deck",
    "read_parts",
    "read_switching",
]
