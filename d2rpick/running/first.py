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
    from collections.abc import Collection

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
    chosen = tuple(parts)
    if inventory.solver == "radioss":
        chosen = chosen or find_parts_off(read_run(path))
    if not chosen:
        is_radioss = inventory.solver == "radioss"
        lack = (
            f", and {path} deactivates no rigid body (/RBODY/OFF)" if is_radioss else ""
        )
        raise ArgumentError(
            f"no parts were given{lack}; name those to be switched with `parts`"
        )
    refuse_held(path, inventory, chosen)
    needed = _choose_wait(path, inventory, wait)
    first_run = FirstRunDeck(path, inventory, chosen, needed.time, needed.reason, after)
    return print_first_run_cards(first_run), needed


def _choose_wait(path: str, inventory: Inventory, given: float | None) -> Wait:
    """Return the given waiting time or half of the deck's longest period; raise ArgumentError if neither is known."""
    of_deck = wait_of_deck(inventory)
    if given is not None:
        check_wait(given, of_deck, path)
        return Wait(given, "given", "as given")
    if of_deck is None:
        raise ArgumentError(
            f"`wait` cannot be derived from {path} (no masses on linear springs found); give the force-free time that"
            " marks a flight: more than half of the longest natural period of the parts"
        )
    return of_deck._replace(time=float(f"{of_deck.time:.3g}"))
