"""What a deck says about its parts: elements, formulations, materials, shared nodes, masses, stable steps."""

from __future__ import annotations

from d2rpick.deck.inventory.model import Inventory

__all__ = ["Inventory", "read_inventory"]


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
    from d2rpick.deck import radioss as runs
    from d2rpick.deck.reader import read_deck
    from d2rpick.errors import DeckError

    if runs.run_files(path):
        from d2rpick.deck.inventory import radioss

        found = radioss.read(runs.read_run(path))
    else:
        from d2rpick.deck.inventory import ls_dyna

        found = ls_dyna.read(read_deck(path))
    if not found.parts:
        why = f" ({found.notes[0]})" if found.notes else ""
        raise DeckError(f"{path}: no parts were found{why}; name the main deck of the run")
    return found
