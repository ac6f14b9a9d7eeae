"""Check, before the first run of a deck is computed, that the run will be able to switch its parts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.errors import DeckError, RangeError, name_units
from d2rpick.deck.pieces import find_supports
from d2rpick.deck.radioss_run import read_run
from d2rpick.deck.radioss_sensors import require_forces
from d2rpick.flight.window import FEWEST

if TYPE_CHECKING:
    from collections.abc import Collection

    from d2rpick.deck.model import Inventory
    from d2rpick.deck.radioss_deck import Starter
    from d2rpick.running.sequence import Limits


def refuse_absent(path: str, inventory: Inventory, parts: Collection[int]) -> None:
    """Raise DeckError if one of the parts has no elements in the deck."""
    unknown = sorted(set(parts) - inventory.nodes_by_part.keys())
    if unknown:
        known = name_units(inventory.nodes_by_part)
        raise DeckError(
            f"{path}: {name_units(unknown)}: no elements in the deck; give others with `parts`: the deck has {known}"
        )


def refuse_held(path: str, inventory: Inventory, parts: Collection[int]) -> None:
    """Raise DeckError if a support holds one of the parts, because a support force is not a contact force."""
    refuse_absent(path, inventory, parts)
    held = find_supports(inventory)[0]
    for part in sorted(held.keys() & set(parts)):
        raise DeckError(
            f"{path}: part {part} is held by {held[part][0].name}: it does not fly; leave it out"
        )


def check_driven(
    path: str,
    inventory: Inventory,
    parts: Collection[int],
    limits: Limits,
    wait: float | None,
) -> None:
    """Check that `drive` can drive a Radioss run.

    Raises
    ------
    DeckError
        If a support holds the parts, no contact can end a flight, or the history does not contain part momenta.
    RangeError
        If no flight of the run can last for the ``wait`` or keep the margin of the ``limits``.
    """
    refuse_held(path, inventory, parts)
    starter = read_run(path).starter
    assert starter is not None  # A run without a starter deck cannot be driven.
    require_forces(path, starter)
    _check_history(path, starter, {*parts} - inventory.springs)
    shortest, longest = FEWEST * limits.interval, limits.end / 2
    if wait is not None and not shortest <= wait < longest:
        raise RangeError(
            f"{path}: `wait` {wait:g}: a time from {shortest:g}, {FEWEST} states of the history, to {longest:g}, half"
            " of the run, was expected"
        )
    if limits.margin is not None and not limits.margin < longest:
        raise RangeError(
            f"{path}: `margin` {limits.margin:g}: less than {longest:g}, half of the run, was expected"
        )


def _check_history(path: str, starter: Starter, parts: Collection[int]) -> None:
    """Raise DeckError if the time history lacks the momenta of any of the ``parts``."""
    cards = [card for card in starter.named("TH") if card.words[1:2] == ("PART",)]
    written: set[int] = set()
    for card in cards:
        words: set[str] = set()
        for row in card.rows[1:]:
            if not row.text.startswith("#"):
                words |= {*row.text.split()}
        if words & {"DEF", "XMOM"}:
            written |= {int(word) for word in words if word.isdigit()} or {*parts}
    missing = sorted({*parts} - written)
    if missing:
        where = cards[0].at if cards else path
        raise DeckError(
            f"{where}: no momenta of {name_units(missing)} in the time history; /TH/PART with DEF and MASS of all parts"
            " that are switched was expected"
        )
