"""Files of a deck that seem to be cut, as their ends tell."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.reader import Deck
    from d2rpick.deck.source import Block

_MESH: Final = re.compile(
    r"\*(ELEMENT_|NODE\b)|"
    r"/(NODE|SHELL|SH3N|BRICK|TETRA4|TETRA10|PENTA6|QUAD|TRIA|BEAM|TRUSS|SPRING|BRIC20|SHEL16|SPHCEL|XELEM)(/|\s*\Z)",
    re.IGNORECASE,
)


def cuts(deck: Deck) -> Iterator[tuple[Block, str]]:
    """Give the last block of each file that seems to be cut, and what speaks for it.

    An include may do without *END, and the main file too unless it ends within a mesh: a mesh is written by a program,
    which ends what it writes.  A last line without line end may lack digits of a number.
    """
    seen = set()
    for block, main in deck.ends:
        told = _told(block, main=main)
        if told and block.source.name not in seen:
            seen.add(block.source.name)
            yield block, f"{told}; is it cut?"


def cure(block: Block) -> str:
    """What to do about a file that ends with this block, of which `cuts` speaks."""
    return f"take the whole file, or {'add that line' if block.source.ends_with_line() else 'end its last line'}"


def holds_mesh(block: Block) -> bool:
    """Whether a block holds nodes or elements."""
    return _MESH.match(block.head) is not None


def _told(block: Block, *, main: bool) -> str:
    mesh, radioss = holds_mesh(block), block.head.startswith("/")
    if not block.source.ends_with_line():
        return f"the file ends within a line of {'its mesh' if mesh else block.head.strip()}"
    if main and mesh:
        return f"the {'starter' if radioss else 'main'} deck ends within its mesh, without {'/' if radioss else '*'}END"
    return ""
