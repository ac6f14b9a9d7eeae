"""How often a block of records repeats at a constant stride, all bytes of structure checked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.content import Content

# A block longer than this is left to the walk, and no more than this is compared at a time.
_LONGEST: Final = 1 << 22
_CHUNK: Final = 1 << 18


@dataclass(frozen=True)
class Pattern:
    """What has to be equal in every repetition of a block.

    ``fixed`` is 0xFF for each byte of structure and 0 for each byte of data; ``numbers`` are place and width
    of the decimal state numbers; each goes up by a step of its own, the same from block to block.
    """

    fixed: NDArray[np.uint8]
    numbers: tuple[tuple[int, int], ...]


def repeats(data: Content, begin: int, pattern: Pattern) -> tuple[int, list[int]]:
    """Count the whole repetitions that follow the block at ``begin`` without a gap.

    Returns
    -------
    times : int
        Number of repetitions behind the first block.
    steps : list of int
        How much each state number grows from one to the next.

    Examples
    --------
    >>> from d2rpick.histories.content import Content
    >>> blocks = Content(b"[d01:x][d02:y][d03:z][d05:x]")
    >>> fixed = np.frombuffer(b"~~00~0~", dtype=np.uint8) // 126 * 255
    >>> repeats(blocks, 0, Pattern(fixed, ((2, 2),)))
    (2, [1])
    """
    stride = pattern.fixed.size
    total = (len(data) - begin) // stride
    if stride > _LONGEST or total < 2:
        return 0, []
    example, following = data.view(begin, begin + 2 * stride).reshape(2, stride).copy()
    first = _decimals(example[None], pattern.numbers)
    steps = _decimals(following[None], pattern.numbers) - first
    if steps.min(initial=1) < 1:
        return 0, []
    done, rows = 1, 1
    while done < total:
        rows = min(rows, total - done)
        chunk = data.view(begin + done * stride, begin + (done + rows) * stride).reshape(rows, stride)
        differs = ((chunk ^ example) & pattern.fixed).max(axis=1) > 0
        expected = first + steps * np.arange(done, done + len(chunk))[:, None]
        differs |= (_decimals(chunk, pattern.numbers) != expected).any(axis=1)
        if differs.any():
            done += int(differs.argmax())
            break
        done += len(chunk)
        rows = min(2 * rows, max(1, _CHUNK // stride))  # a pattern that soon ends costs little
    return done - 1, steps[0].tolist()


def _decimals(blocks: NDArray[np.uint8], places: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Decimal numbers of each block, shape (blocks, places); -1 where a byte is no digit."""
    numbers = np.empty((len(blocks), len(places)), dtype=np.int64)
    for column, (at, width) in enumerate(places):
        digits = blocks[:, at : at + width].astype(np.int64) - ord("0")
        number = digits @ 10 ** np.arange(width - 1, -1, -1, dtype=np.int64)
        numbers[:, column] = np.where(((digits < 0) | (digits > 9)).any(axis=1), -1, number)
    return numbers
