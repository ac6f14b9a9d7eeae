"""Decks of LS-DYNA and runs of Radioss: cards with file, line and column, switching windows, parts and elements.

Here is what begins with a name: what a deck says about its parts, and which files of a folder are main decks.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from d2rpick.base.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.model import Inventory


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
    from d2rpick.deck import (
        ls_dyna_inventory,
        radioss_files,
        radioss_inventory,
    )  # not above: they load numpy
    from d2rpick.deck.radioss_run import read_run
    from d2rpick.deck.reader import read_deck

    is_run = radioss_files.run_files(path)
    found = (
        radioss_inventory.read(read_run(path))
        if is_run
        else ls_dyna_inventory.read(read_deck(path))
    )
    if not found.parts:
        why = f" ({found.notes[0]})" if found.notes else ""
        raise DeckError(
            f"{path}: no parts were found{why}; name the main deck of the run"
        )
    return found


_HEAD = (
    64 * 1024
)  # bytes in which a deck shows what it is: titles and comments come before


def main_decks(folder: str) -> list[str]:
    """Find the main decks in a folder and below it.

    A main deck holds ``*KEYWORD`` (LS-DYNA) or ``/BEGIN`` (Radioss) near its beginning, and no other deck of the
    folder includes it.  Hidden files and folders are passed over.

    Raises
    ------
    DeckError
        If there is none, with what to do.
    """
    decks = [path for path in _files(folder) if _begins(path)]
    included = {os.path.realpath(path) for deck in decks for path in _includes(deck)}
    found = [path for path in decks if os.path.realpath(path) not in included]
    if not found:
        what = (
            "every one is included by another"
            if decks
            else "no file with *KEYWORD or /BEGIN"
        )
        raise DeckError(
            f"{folder}: no main deck in this folder ({what}); give the deck itself"
        )
    return found


def find_decks_of_run(folder: str) -> list[str]:
    """Find the main decks that lie in the folder of a run and have parts.

    Restart decks and files of switching cards alone have none.  A run of Radioss is named by its starter deck.
    """
    try:
        decks = main_decks(folder)
    except DeckError:
        return []
    return [
        path
        for path in decks
        if os.path.samefile(os.path.dirname(path) or os.curdir, folder)  # noqa: PTH120, PTH121
        and _has_parts(path)
    ]


def _has_parts(path: str) -> bool:
    from d2rpick.deck import radioss_files  # not above: start-up

    try:
        if radioss_files.run_files(path):
            from d2rpick.deck.radioss_run import read_run

            starter = read_run(path).starter
            return bool(starter and starter.parts)
        from d2rpick.deck.ls_dyna_parts import read_parts
        from d2rpick.deck.reader import read_deck

        return bool(read_parts(read_deck(path)).materials)
    except DeckError:
        return True  # what is wrong is said by who reads it


def _includes(path: str) -> list[str]:
    """Names of the files that a deck includes; none of a deck that cannot be read, which is said when it is checked."""
    from d2rpick.deck import radioss_files, reader  # not above: start-up

    try:
        if radioss_files.run_files(path):
            from d2rpick.deck.radioss_run import read_run

            return list(read_run(path).included)
        return reader.read_deck(path).files[1:]
    except DeckError:
        return []


def _files(folder: str) -> Iterator[str]:
    from pathlib import Path  # not above: start-up

    for root, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (
            str(Path(root) / name) for name in sorted(names) if not name.startswith(".")
        )


def _begins(path: str) -> bool:
    """Whether a file says near its beginning that it is a main deck."""
    try:
        head = _head(path) if os.path.isfile(path) else b""  # noqa: PTH113  a pipe gives it once
    except OSError:
        return False
    lines = (
        line.strip().upper() for line in head.removeprefix(b"\xef\xbb\xbf").splitlines()
    )
    first = next((line for line in lines if line[:1] in {b"*", b"/"}), b"")
    return first.startswith((b"*KEYWORD", b"/BEGIN")) and b"\0" not in head


def _head(path: str) -> bytes:
    """Read the beginning of a file.

    A small file may just be saved, and is waited for.  That of a large one is there, however long a solver goes on
    writing to it.
    """
    from d2rpick.deck.source import SourceFile

    with open(path, "rb", buffering=0) as file:  # noqa: PTH123  start-up
        head = file.read(_HEAD)
    try:
        return head if len(head) == _HEAD else SourceFile(path).read(0, _HEAD)
    except DeckError:
        return head  # what is wrong is said when it is checked
