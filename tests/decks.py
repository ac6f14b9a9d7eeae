"""Decks on disk for a test: write texts into a folder, read them back, check them."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.switching import Windows, find_windows, read_switching
from d2rpick.rules import check_deck

MAIN = "main.k"


def wide(*fields: object, width: int = 10) -> str:
    """A line of fields, each at the right of its columns."""
    return "".join(f"{field:>{width}}" for field in fields) + "\n"


def row(*ids: int, width: int = 8) -> str:
    """A line of a mesh of LS-DYNA."""
    return wide(*ids, width=width)


def write(
    folder: Path,
    deck: str | bytes,
    files: Mapping[str, str] | None = None,
    name: str = MAIN,
) -> str:
    """Path of the main deck, written with the files it includes."""
    for other, text in (files or {}).items():
        (folder / other).parent.mkdir(parents=True, exist_ok=True)
        (folder / other).write_bytes(text.encode("latin-1"))
    path = folder / name
    path.write_bytes(deck if isinstance(deck, bytes) else deck.encode("latin-1"))
    return str(path)


def read(
    folder: Path, deck: str | bytes, files: Mapping[str, str] | None = None
) -> Deck:
    return read_deck(write(folder, deck, files))


def windows(deck: Deck) -> Windows:
    return find_windows(read_switching(deck), read_parts(deck))


def spans(deck: Deck) -> list[tuple[int | None, float, float | None]]:
    """Part, tr and td of every window."""
    return [(window.part, window.tr, window.td) for window in windows(deck).windows]


def found(
    folder: Path, deck: str | bytes, files: Mapping[str, str] | None = None
) -> Counter[str]:
    """How often each rule objects."""
    return Counter(
        finding.rule for finding in check_deck(write(folder, deck, files)).findings
    )
