"""Tell the command line what it lacks according to the deck, the installation and the solver of a card."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.api.option_names import replace_arguments
from d2rpick.base.errors import D2RPickError, format_in_one_line

if TYPE_CHECKING:
    from collections.abc import Sequence


def list_needs_of_first_run(
    deck: str, has_parts: bool, wait: float | None
) -> Sequence[str]:
    """Return the options that a first run of a deck needs besides the given ones, or a deck that can be read."""
    from d2rpick.running.first import list_needs  # Imported here to keep start-up fast.

    try:
        needs = list_needs(deck, has_parts, wait)
    except (D2RPickError, OSError) as error:
        return (_ask_for_other_deck(error),)
    return [replace_arguments(need) for need in needs]


def list_needs_of_deck(deck: str) -> Sequence[str]:
    """Return the need for another deck if a deck cannot be read; otherwise nothing."""
    from d2rpick.deck import read_inventory  # Imported here to keep start-up fast.

    try:
        read_inventory(deck)
    except (D2RPickError, OSError) as error:
        return (_ask_for_other_deck(error),)
    return ()


def _ask_for_other_deck(error: D2RPickError | OSError) -> str:
    """Return the need for a deck that can be read, with the reason why the given one cannot."""
    return f"a readable DECK ({replace_arguments(format_in_one_line(error))})"


def list_unknown_programs(starter: str | None, engine: str | None) -> Sequence[str]:
    """Return the programs of Radioss that are neither given nor installed."""
    from d2rpick.running.engine import Commands  # Imported here to keep start-up fast.

    return Commands(starter, engine).list_unknown()


def deactivates_no_body(deck: str) -> bool:
    """Return True if the engine file of a run deactivates no rigid body, so that the parts must be named."""
    # Imported here to keep start-up fast.
    from d2rpick.deck.radioss_run import find_parts_off, read_run

    try:
        return not find_parts_off(read_run(deck))
    except (D2RPickError, OSError):
        # The error is reported when the options are complete.
        return False


def list_needs_of_solver(solver: str | None) -> Sequence[str]:
    """Return the names of the arguments without which no card for a solver can be printed."""
    from d2rpick.deck.printing import (  # Imported here to keep start-up fast.
        DEFAULT,
        SOLVERS,
    )

    printer = SOLVERS[solver or DEFAULT]
    return (printer.switches, *(name for name in ("end",) if name in printer.takes))
