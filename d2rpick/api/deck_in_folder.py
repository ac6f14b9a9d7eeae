"""Find the main deck in the folder of a run, which defines the parts that become one rigid body."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import (
    SEVERAL_RUNS,
    ArgumentError,
    Caution,
    FormatError,
    list_names,
)

if TYPE_CHECKING:
    from d2rpick.api.request import Request

FOUND: Final = "deck-in-folder"


def find_deck_in_folder(request: Request) -> Request:
    """Use the main deck in the folder of the run, unless the user names or excludes a deck.

    Raises
    ------
    ArgumentError
        If the folder has several main decks, or what is asked needs a deck and there is none.
    """
    folder = request.folder
    if folder is None:
        return request
    from d2rpick.deck import find_decks_of_run  # Imported here to keep start-up fast.

    decks = find_decks_of_run(folder)
    if len(decks) > 1:
        problem = f"{folder}: this folder contains {len(decks)} main decks ({list_names(decks, most=5)})"
        several_runs = _describe_several_runs(folder)
        files = "give the files of one run, and " if several_runs else ""
        raise ArgumentError(
            f"{problem}{several_runs}; {files}name the deck of the run with `deck`, or use none with `no_deck`"
        )
    if not decks:
        request.check_deck()
        return request
    return replace(request, deck=decks[0], deck_in_folder=True)


def _describe_several_runs(folder: str) -> str:
    """Return that a folder has the files of several runs too, so that one message names both; otherwise empty."""
    from d2rpick.histories.source import expand  # Imported here to keep start-up fast.

    try:
        expand([folder])
    except FormatError as error:
        if SEVERAL_RUNS in str(error):
            reason = str(error).removeprefix(f"{folder}: this folder contains ")
            return f" and {reason.partition(', one was')[0]}"
    return ""


def name_deck(request: Request) -> tuple[Caution, ...]:
    """Return a caution that names the deck found in the folder of the run."""
    if not request.deck_in_folder:
        return ()
    message = f"{request.deck} is the main deck in the folder of the run and is used; `no_deck` ignores it"
    return (Caution(FOUND, message),)
