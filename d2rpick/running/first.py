"""Choose the parts and the force-free time of a first run that switches its parts by contact forces."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.errors import ArgumentError
from d2rpick.deck import read_inventory
from d2rpick.deck.first_run_cards import FirstRunDeck, print_first_run_cards
from d2rpick.deck.radioss_run import find_parts_off, read_run
from d2rpick.running.checks import refuse_held
from d2rpick.running.inner_motion import Wait, check_wait, wait_of_deck

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from d2rpick.deck.model import Inventory
    from d2rpick.deck.printed_card import PrintedCard


def first_card(
    path: str,
    parts: Collection[int] = (),
    wait: float | None = None,
    after: float | None = None,
) -> tuple[PrintedCard, Wait]:
    """Print the cards that switch the parts in the first run of a deck, triggered by contact forces.

    Parameters
    ----------
    path : str
        Main deck of LS-DYNA, or a file of a Radioss run with one engine file.
    parts : collection of int
        Parts to be switched; for Radioss, the default is the parts of the rigid bodies that the engine file
        deactivates.
    wait : float, optional
        Force-free time after which a flight is detected [time]; by default, half of the longest period of the deck's
        springs.
    after : float, optional
        No part becomes rigid before this time [time].

    Returns
    -------
    (PrintedCard, Wait)
        The card with notes for the user, and its waiting time (the force-free time after which a flight is detected).

    Raises
    ------
    DeckError
        If the deck has no contact that shows a flight, or if other loads than contacts and gravity act on the parts.
    RangeError
        If the waiting time is shorter than half of a known period.
    ArgumentError
        If the waiting time or the parts are not given and do not follow from the deck.
    """
    inventory = read_inventory(path)
    chosen = tuple(parts) or _find_default_parts(path, inventory)
    refuse_held(path, inventory, chosen)
    if needs := [*_list_needs(inventory, bool(chosen), wait)]:
        raise ArgumentError(f"{path}: missing: {'; '.join(needs)}")
    needed = _choose_wait(path, inventory, wait)
    first_run = FirstRunDeck(path, inventory, chosen, needed.time, needed.reason, after)
    return print_first_run_cards(first_run), needed


def list_needs(path: str, has_parts: bool, wait: float | None) -> tuple[str, ...]:
    """Return the arguments that a first run of a deck needs besides the given ones, with their meanings.

    ``has_parts`` is True if the parts to be switched are given; ``wait`` is the given force-free time [time].
    """
    inventory = read_inventory(path)
    has_parts = has_parts or bool(_find_default_parts(path, inventory))
    return tuple(_list_needs(inventory, has_parts, wait))


def _list_needs(
    inventory: Inventory, has_parts: bool, wait: float | None
) -> Iterator[str]:
    """Yield the missing arguments that do not follow from the deck."""
    if not has_parts:
        lack = (
            "; the deck deactivates no rigid body (/RBODY/OFF) that names them"
            if inventory.solver == "radioss"
            else ""
        )
        yield f"`parts` (parts to switch{lack})"
    if wait is None and wait_of_deck(inventory) is None:
        yield (
            "`wait` (force-free time that marks a flight: more than half of the longest natural period of the parts, "
            "for example 0.02 for a period of 0.03)"
        )


def _find_default_parts(path: str, inventory: Inventory) -> tuple[int, ...]:
    """Return the parts of the rigid bodies that a Radioss run deactivates; empty for LS-DYNA."""
    return find_parts_off(read_run(path)) if inventory.solver == "radioss" else ()


def _choose_wait(path: str, inventory: Inventory, given: float | None) -> Wait:
    """Return the given waiting time, or half of the longest period that the deck contains."""
    of_deck = wait_of_deck(inventory)
    if given is not None:
        check_wait(given, of_deck, path)
        return Wait(given, "given", "as given")
    assert of_deck is not None  # The missing arguments were refused before.
    return of_deck._replace(time=float(f"{of_deck.time:.3g}"))
