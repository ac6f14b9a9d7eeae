"""Blocks of one size in a text: how many repeat what they share with an example, and what differs between them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.content import Content
    from d2rpick.histories.formats.ahead import Ahead

    Bytes = NDArray[np.uint8]

CHUNK: Final = 1 << 20  # bytes compared at a time: they stay in the cache between the two passes
_FOLD: Final = 16  # blocks side by side compared as one row: saves half the time


class Stretch(NamedTuple):
    """``repeats`` blocks of ``stride`` bytes from ``start`` on, laid out like the one at ``example``."""

    start: int
    stride: int
    repeats: int
    example: int


def like_example(
    data: Content, run: Stretch, offset: int, literal: Bytes, varied: Bytes | None = None, ahead: Ahead | None = None
) -> int:
    """Count the blocks of ``run`` that have, from ``offset`` on, the literal bytes of its example.

    Parameters
    ----------
    data : Content
    run : Stretch
    offset : int
        Where in the blocks to begin.
    literal : array of shape (size,)
        255 for the bytes that must be those of the example, 0 for the others.
    varied : array of shape (size,), optional
        Gets the bits in which a byte of any counted block differs from the example.
    ahead : Ahead, optional
        Takes numbers from the counted blocks, with ``offset`` 0.

    Examples
    --------
    >>> from d2rpick.histories.content import Content
    >>> literal, varied = np.array([255, 255, 0, 0], np.uint8), np.zeros(4, np.uint8)
    >>> like_example(Content(b"a=10a=12b=14"), Stretch(0, 4, 3, 0), 0, literal, varied), varied.tolist()
    (2, [0, 0, 0, 2])
    """
    size = literal.size
    example = data.view(run.example + offset, run.example + offset + size).copy()
    done, step = (0, 1) if size else (run.repeats, 1)
    most = max(1, CHUNK // max(1, size))
    most -= most % _FOLD if most > _FOLD else 0
    while done < run.repeats:
        step = min(step, run.repeats - done)
        rows = _rows(data, run.start + done * run.stride + offset, run.stride, step, size)
        differing = _differing(rows, example)
        alike = not (differing & literal).max()
        if not alike:
            step = int(((rows ^ example) & literal).any(axis=1).argmax())
        if varied is not None and step:
            varied |= differing if alike else _differing(rows[:step], example)
        if ahead is not None and step:
            ahead.take(rows[:step], differing)
        done += step
        if not alike:
            break
        step = min(2 * step, most)
    return done


def _rows(data: Content, first: int, stride: int, count: int, size: int) -> Bytes:
    """``size`` bytes of each of ``count`` blocks, shape (count, size)."""
    if 2 * size < stride:
        return data.fields(first + stride * np.arange(count), size)
    span = data.view(first, first + (count - 1) * stride + size)
    return np.ndarray((count, size), np.uint8, span, strides=(stride, 1))


def _differing(rows: Bytes, example: Bytes) -> Bytes:
    """Bits in which any of the rows differs from the example, shape (size,)."""
    count, size = rows.shape
    if count % _FOLD == 0 and rows.flags.c_contiguous:
        rows = rows.reshape(count // _FOLD, _FOLD * size)
    # a bit is the example's in all rows where it is so in their AND and in their OR
    differing = np.bitwise_and.reduce(rows, axis=0).reshape(-1, size) ^ example
    differing |= np.bitwise_or.reduce(rows, axis=0).reshape(-1, size) ^ example
    return np.asarray(np.bitwise_or.reduce(differing, axis=0))
