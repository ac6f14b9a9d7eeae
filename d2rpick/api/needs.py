"""Tell the command line what it lacks according to the deck, the installation and the solver of a card."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.api.option_names import replace_arguments
from d2rpick.base.errors import D2RPickError

if TYPE_CHECKING:
    from collections.abc import Sequence


def list_needs_of_first_run(
    deck: str, has_parts: bool, wait: float | None
) -> Sequence[str]:
    """Return the options that a first run of a deck needs besides the given ones; empty if the deck has an error."""
    from d2rpick.running.first import list_needs  # Imported here to keep start-up fast.

    try:
        needs = list_needs(deck, has_parts, wait)
    except (D2RPickError, OSError):
        # The error is reported when the options are complete.
        return ()
    return [replace_arguments(need) for need in needs]


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
