"""Decks of LS-DYNA and runs of Radioss: cards with file, line and column, switching windows, parts and elements."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.deck.parts import Parts, read_parts
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.switching import SwitchSet, Window, Windows, find_windows, read_switching

if TYPE_CHECKING:
    from d2rpick.deck.model import Inventory

__all__ = [
    "Deck",
    "Parts",
    "SwitchSet",
    "Window",
    "Windows",
    "find_windows",
    "read_deck",
    "read_inventory",
    "read_parts",
    "read_switching",
]


def read_inventory(path: str) -> Inventory:
    """Read the parts and elements of a main deck and its includes.

    Parameters
    ----------
    path : str
        Main deck of LS-DYNA, or a starter or engine file of Radioss.

    Raises
    ------
    DeckError
        If the deck cannot be read, or has no parts.
    """
    from d2rpick.base.errors import DeckError
    from d2rpick.deck import ls_dyna, radioss, radioss_run

    is_run = radioss_run.run_files(path)
    found = radioss.read(radioss_run.read_run(path)) if is_run else ls_dyna.read(read_deck(path))
    if not found.parts:
        why = f" ({found.notes[0]})" if found.notes else ""
        raise DeckError(f"{path}: no parts were found{why}; name the main deck of the run")
    return found
