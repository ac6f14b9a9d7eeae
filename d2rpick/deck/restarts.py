"""Join small restart decks of LS-DYNA to a run; the cards of a restart switch when the previous run ends.

A small restart has no parts. Its *RIGID_DEFORMABLE cards have no time; they act when the restart begins, at the ENDTIM
of the previous run. Source: the vendor's keyword data as published in its Python library.
"""

from __future__ import annotations

import os
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import DeckError
from d2rpick.deck.ls_dyna_columns import TERMINATION
from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.reader import Deck, Restart, read_deck

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.card import Value

_KEYWORD: Final = "RIGID_DEFORMABLE"
# Largest file that may be a small restart [bytes].
_LARGEST: Final = 1 << 20


def is_restart(path: str) -> bool:
    """Return True if a file is a small restart that switches parts."""
    try:
        if not os.path.isfile(path) or os.path.getsize(path) > _LARGEST:  # noqa: PTH113, PTH202  pathlib would slow down start-up
            return False
        with open(path, "rb") as file:  # noqa: PTH123  pathlib would slow down start-up
            if _KEYWORD.encode() not in file.read().upper():
                return False
        deck = read_deck(path)
    except (DeckError, OSError):
        return False  # The deck check reports the error.
    return bool(deck.named(_KEYWORD)) and not read_parts(deck).material_by_part


def join_restarts(main: Deck, restarts: Sequence[str]) -> Deck:
    """Return a run and its restarts as one deck in which each restart card has a time.

    The times remain unknown unless each run ends later than the previous one.

    Raises
    ------
    DeckError
        If a restart cannot be read.
    """
    legs = sorted(
        map(read_deck, restarts),
        key=lambda deck: end.value if (end := _find_end(deck)) else float("inf"),
    )
    ends = [_find_end(deck) for deck in (main, *legs)]
    known_ends = [end.value for end in ends if end]
    # The end of the last run may be unknown, because no restart begins there.
    timed = all(ends[:-1]) and all(
        end_time < next_end_time for end_time, next_end_time in pairwise(known_ends)
    )
    run = Deck(main.path, scope=main.scope, long=main.long)
    for deck, end in zip((main, *legs), [None, *ends[:-1]], strict=True):
        for name in (
            "cards",
            "disabled",
            "encrypted",
            "included",
            "unread",
            "problems",
            "sources",
            "ends",
        ):
            getattr(run, name).extend(getattr(deck, name))
        if end and timed:
            run.restarts |= dict.fromkeys(deck.files, Restart(end.value, end.field))
    return run


def _find_end(deck: Deck) -> Value[float] | None:
    """Return the ENDTIM of a deck; None if it is not positive."""
    rows = [
        (card, card.rows[0]) for card in deck.named("CONTROL_TERMINATION") if card.rows
    ]
    end = rows[-1][0].real(rows[-1][1], TERMINATION["ENDTIM"]) if rows else None
    return end if end and not end.problem and end.value > 0 else None
