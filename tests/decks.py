"""Write deck texts into a folder, read them back, and check them."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from d2rpick.deck.ls_dyna_parts import read_parts
from d2rpick.deck.reader import Deck, read_deck
from d2rpick.deck.switching import Windows, find_windows, read_switching
from d2rpick.rules import check_deck

MAIN = "main.k"


def pad(*fields: object, width: int = 10) -> str:
    """Return a line of fields, each right-aligned in its columns."""
    return "".join(f"{field:>{width}}" for field in fields) + "\n"


def make_row(*ids: int, width: int = 8) -> str:
    """Return a line of a mesh of LS-DYNA."""
    return pad(*ids, width=width)


def write(
    folder: Path,
    deck: str | bytes,
    files: Mapping[str, str] | None = None,
    name: str = MAIN,
) -> str:
    """Write the main deck and the files that it includes; return the path of the main deck."""
    for file_name, text in (files or {}).items():
        (folder / file_name).parent.mkdir(parents=True, exist_ok=True)
        (folder / file_name).write_bytes(text.encode("latin-1"))
    path = folder / name
    path.write_bytes(deck if isinstance(deck, bytes) else deck.encode("latin-1"))
    return str(path)


def read(
    folder: Path, deck: str | bytes, files: Mapping[str, str] | None = None
) -> Deck:
    return read_deck(write(folder, deck, files))


def windows(deck: Deck) -> Windows:
    return find_windows(read_switching(deck), read_parts(deck))


def list_spans(deck: Deck) -> list[tuple[int | None, float, float | None]]:
    """Return part, tr and td of every window of a deck."""
    return [(window.part, window.tr, window.td) for window in windows(deck).windows]


def count_findings(
    folder: Path, deck: str | bytes, files: Mapping[str, str] | None = None
) -> Counter[str]:
    """Count the findings of each rule."""
    return Counter(
        finding.rule for finding in check_deck(write(folder, deck, files)).findings
    )
