"""Small restarts of LS-DYNA as legs of a run: their cards switch when the run before them ends.

A small restart has no parts of its own.  Its *RIGID_DEFORMABLE cards have no time: they act when it begins, at the
ENDTIM of the run before.  Source: the vendor's keyword data as published in its Python library.
"""

from __future__ import annotations

import os
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import DeckError
from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.reader import Deck, Restart, read_deck

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.card import Value

_KEYWORD: Final = "RIGID_DEFORMABLE"
_LARGEST: Final = 1 << 20  # bytes of a small restart


def is_restart(path: str) -> bool:
    """Whether a file is a small restart that switches parts."""
    try:
        if not os.path.isfile(path) or os.path.getsize(path) > _LARGEST:  # noqa: PTH113, PTH202  start-up
            return False
        with open(path, "rb") as file:  # noqa: PTH123
            if _KEYWORD.encode() not in file.read().upper():
                return False
        deck = read_deck(path)
    except (DeckError, OSError):
        return False  # what is wrong is said when it is checked
    return bool(deck.named(_KEYWORD)) and not read_parts(deck).materials


def join_restarts(main: Deck, restarts: Sequence[str]) -> Deck:
    """Give a run with its restarts as one deck, in which the cards of these have a time.

    Without an end of each run, after that of the one before, their times stay unknown.

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
    # the end of the last run is that of no other: it may be unknown
    timed = all(ends[:-1]) and all(one < other for one, other in pairwise(known_ends))
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
    """Give the ENDTIM of a deck; None for none above 0."""
    rows = [
        (card, card.rows[0]) for card in deck.named("CONTROL_TERMINATION") if card.rows
    ]
    found = rows[-1][0].real(rows[-1][1], 0) if rows else None
    return found if found and not found.problem and found.value > 0 else None
