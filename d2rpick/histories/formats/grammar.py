"""What the blocks of a solver text database look like: one is taken apart, the others are like it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import re
    from collections.abc import Callable, Hashable, Mapping

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
