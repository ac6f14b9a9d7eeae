"""The head of glstat and matsum: title and solver, as they are read and as we write them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.version import __version__

if TYPE_CHECKING:
    from d2rpick.histories.content import Content


def head(data: bytes | Content) -> tuple[str, str, int]:
    """Read the head of an LS-DYNA text database.

    Returns
    -------
    title, version : str
        Empty if there is no head.
    begin : int
        Address behind it.
    """
    lines = data[:4096].split(b"\n")
    if len(lines) < 3 or b"ls-dyna" not in lines[1]:
        return "", "", 0
    title, version = (line.decode("latin-1") for line in lines[:2])
    return title.strip(), " ".join(version.split()), len(title) + len(version) + 2


def written_head(title: str, database: str) -> str:
    """Two lines as solvers write them; no release of a solver wrote this, its name alone tells the layout."""
    return f" {title}\n{' ' * 25}d2rpick {__version__}, layout of ls-dyna {database}\n"
