"""Read LS-DYNA decks and Radioss runs: cards with file, line and column, rigid windows, parts and elements.

This module finds the main decks of a folder, and reads the parts of a deck given by its path.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from d2rpick.base.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.model import Inventory

# Number of bytes from which a deck is recognised; titles and comments may precede its first keyword.
_HEAD = 64 * 1024
# Ends of the names of packed decks, which neither solver nor d2rpick reads.
_PACKED_DECKS = tuple(f".{suffix}.gz" for suffix in ("k", "key", "dyn", "rad"))


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
    # These modules are imported late, because they import numpy.
    from d2rpick.deck import (
        ls_dyna_inventory,
        radioss_files,
        radioss_inventory,
    )
    from d2rpick.deck.radioss_run import read_run
    from d2rpick.deck.reader import read_deck

    is_run = radioss_files.list_run_files(path)
    if is_run:
        inventory = radioss_inventory.read_radioss_inventory(read_run(path))
    else:
        inventory = ls_dyna_inventory.read_ls_dyna_inventory(read_deck(path))
    if not inventory.parts:
        is_explained = inventory.notes and not inventory.complete
        why = f", because {inventory.notes[0]}" if is_explained else ""
        packed = radioss_files.find_packed_starter(path) if is_run else ""
        cure = f"unpack {packed}" if packed else "give the main deck of the run"
        raise DeckError(f"{path}: no parts were found{why}; {cure}")
    return inventory


def find_time_unit(path: str) -> str:
    """Return the time unit that a Radioss deck gives for both itself and the computation; empty if they differ.

    LS-DYNA decks contain no units.

    Raises
    ------
    DeckError
        If the deck cannot be read.
    """
    # Imported here to keep start-up fast.
    from d2rpick.deck.radioss_files import list_run_files

    if not list_run_files(path):
        return ""
    from d2rpick.deck.radioss_run import find_time_units, read_run

    of_deck, of_run = find_time_units(read_run(path))
    return of_deck if of_deck == of_run else ""


def find_main_decks(folder: str, cure: str = "give the deck itself") -> list[str]:
    """Return the paths of the main decks in a folder and its subfolders.

    A main deck contains ``*KEYWORD`` (LS-DYNA) or ``/BEGIN`` (Radioss) near its beginning, and no other deck of the
    folder includes it. Hidden files and folders are ignored. ``cure`` is the advice if there is no deck at all.

    Raises
    ------
    DeckError
        If there is no main deck; the message says what to do.
    """
    files = [*_list_files(folder)]
    decks = [path for path in files if _is_main_deck(path)]
    included = {
        os.path.realpath(path) for deck in decks for path in _list_includes(deck)
    }
    main_paths = [path for path in decks if os.path.realpath(path) not in included]
    if not main_paths:
        packed = next(filter(_is_packed_deck, files), None)
        if decks:
            reason = "each deck is included by another one"
        elif packed:
            reason = f"{packed} is packed"
            cure = "unpack it, for example with gunzip"
        elif engine := next(filter(_is_engine_file, files), None):
            reason = "only engine files, without their starter deck"
            cure = f"add the starter deck, or give the engine file {engine}"
        else:
            reason = "no file with *KEYWORD or /BEGIN"
        raise DeckError(f"{folder}: no main deck in this folder ({reason}); {cure}")
    return main_paths


def find_decks_of_run(folder: str) -> list[str]:
    """Return the paths of the main decks with parts in the folder of a run.

    Restart decks and files that contain only switching cards are not main decks with parts. A Radioss run is
    represented by its starter deck.
    """
    try:
        decks = find_main_decks(folder)
    except DeckError:
        return []
    return [
        path
        for path in decks
        if os.path.samefile(os.path.dirname(path) or os.curdir, folder)  # noqa: PTH120, PTH121  pathlib would slow down start-up
        and _has_parts(path)
    ]


def _is_packed_deck(path: str) -> bool:
    """Return True if the name is that of a packed deck, such as ``CAR_0000.rad.gz``."""
    return path.lower().endswith(_PACKED_DECKS)


def _is_engine_file(path: str) -> bool:
    """Return True if a file begins an engine run of Radioss."""
    from d2rpick.deck.radioss_files import (
        list_run_files,
    )  # Imported here to keep start-up fast.

    return path.lower().endswith(".rad") and bool(list_run_files(path))


def _has_parts(path: str) -> bool:
    """Return True if a deck has parts or cannot be read."""
    from d2rpick.deck import radioss_files  # Imported here to keep start-up fast.

    try:
        if radioss_files.list_run_files(path):
            from d2rpick.deck.radioss_run import read_run

            starter = read_run(path).starter
            return bool(starter and starter.parts)
        from d2rpick.deck.ls_dyna_parts import read_parts
        from d2rpick.deck.reader import read_deck

        return bool(read_parts(read_deck(path)).material_by_part)
    except DeckError:
        return True  # The error is reported when the deck is read.


def _list_includes(path: str) -> list[str]:
    """Return the names of the files that a deck includes; empty for an unreadable deck, which its check reports."""
    # Imported here to keep start-up fast.
    from d2rpick.deck import radioss_files, reader

    try:
        if radioss_files.list_run_files(path):
            from d2rpick.deck.radioss_run import read_run

            return list(read_run(path).included)
        return reader.read_deck(path).files[1:]
    except DeckError:
        return []


def _list_files(folder: str) -> Iterator[str]:
    """Yield the paths of all visible files in a folder and its subfolders."""
    from pathlib import Path  # Imported here to keep start-up fast.

    for root, folders, names in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (
            str(Path(root) / name) for name in sorted(names) if not name.startswith(".")
        )


def _is_main_deck(path: str) -> bool:
    """Return True if the beginning of a file identifies it as a main deck."""
    try:
        head = _read_head(path) if os.path.isfile(path) else b""  # noqa: PTH113  a pipe can be read only once
    except OSError:
        return False
    lines = (
        line.strip().upper() for line in head.removeprefix(b"\xef\xbb\xbf").splitlines()
    )
    first = next((line for line in lines if line[:1] in {b"*", b"/"}), b"")
    return first.startswith((b"*KEYWORD", b"/BEGIN")) and b"\0" not in head


def _read_head(path: str) -> bytes:
    """Return the first bytes of a file.

    A small file may be in the process of being saved, so its content is awaited. The beginning of a large file is
    complete, even if a solver is still writing to the file.
    """
    from d2rpick.deck.source import SourceFile

    with open(path, "rb", buffering=0) as file:  # noqa: PTH123  pathlib would slow down start-up
        head = file.read(_HEAD)
    try:
        return head if len(head) == _HEAD else SourceFile(path).read(0, _HEAD)
    except DeckError:
        return head  # The error is reported by the check of the deck.
