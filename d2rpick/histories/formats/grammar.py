"""What the blocks of a solver text database look like: one is taken apart, the others are like it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from d2rpick.version import __version__

if TYPE_CHECKING:
    import re
    from collections.abc import Callable, Hashable, Mapping

    from d2rpick.histories.content import Content

Bytes = NDArray[np.uint8]

UNSURE: Final = -1  # in place of an offset: the field is cut, or stands in the block twice

_OVERLONG: Final = 512  # bytes of a line that no solver writes


@dataclass(frozen=True, eq=False)
class BlockLayout:
    """Where in a block what stands.

    ``fields`` maps the name of a number to its offset in the block, or to UNSURE.  ``literal`` is 255 for the
    bytes that all blocks of this layout share, line ends among them, and 0 for the others; its shape is that
    of the block.  No line of a block can be hidden between literal bytes.
    ``last`` names the number the block ends with.  ``broken_off`` is True when the head of another run
    follows in place of the next block.
    """

    fields: Mapping[Any, int]
    literal: Bytes
    last: Hashable
    broken_off: bool


@dataclass(frozen=True)
class Grammar:
    """What the engine has to know about a database.

    ``start`` is the text a block's first line begins with, ``describe`` takes a block apart, ``whole`` tells
    whether a block that stands alone in its file is known to be whole.  The numbers have ``width`` columns
    and ``decimals`` places.  ``compare_all`` compares every block in full when the file is opened; otherwise,
    where all blocks have one size, only their first lines, and the rest when it is read.
    """

    start: bytes
    describe: Callable[[bytes], BlockLayout]
    whole: Callable[[BlockLayout], bool]
    width: int
    decimals: int
    compare_all: bool


def release(literal: Bytes, block: bytes, changing: re.Pattern[bytes], first: int, behind: int) -> None:
    """Let what ``changing`` matches in a piece of a block differ from block to block.

    It must match short pieces only, lest a whole line hide in one.
    """
    for piece in changing.finditer(block, first, behind):
        literal[piece.start() : piece.end()] = 0


def overlong(block: bytes) -> bool:
    """Whether a line is longer than solvers write: states were blanked, and hide in it."""
    return max(map(len, block.split(b"\n"))) >= _OVERLONG


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
