"""Numbers taken from blocks of one layout while these are compared: then their bytes lie in the cache."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.histories.formats.fortran import decode

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

    Bytes = NDArray[np.uint8]

BATCH: Final = 1 << 15  # numbers converted at a time: they stay in the cache


class Ahead:
    """Numbers at the same ``offsets`` of all blocks, of so many columns and decimals, converted in batches."""

    def __init__(self, offsets: NDArray[np.int64], width: int, decimals: int, batch: int = BATCH) -> None:
        self._offsets, self._width, self._decimals, self._batch = offsets, width, decimals, batch
        self._waiting: list[NDArray[np.bytes_]] = []
        self._moving = np.zeros(offsets.size, bool)
        self._done: list[Samples] = []

    def take(self, rows: Bytes, differing: Bytes) -> None:
        """Take the numbers of further blocks, shape (count, stride), which differ in these bits, shape (stride,)."""
        self._waiting.append(self._fields(rows))
        self._moving |= self._fields(differing[np.newaxis])[0].view(np.uint8).reshape(-1, self._width).any(axis=1)
        if sum(one.size for one in self._waiting) >= self._batch:
            self._convert()

    def numbers(self) -> Samples:
        """Give all numbers taken, shape (blocks, len(offsets)); NaN for what is no number."""
        self._convert()
        return np.concatenate([np.empty((0, self._offsets.size)), *self._done])

    def _convert(self) -> None:
        """Turn what waits into numbers; what is the same in all blocks, as of a part at rest, only once."""
        if not self._waiting:
            return
        fields, moving = np.concatenate(self._waiting), self._moving
        values = np.empty(fields.shape)
        values[:, ~moving] = decode(fields[0, ~moving], self._decimals)
        values[:, moving] = decode(fields[:, moving].ravel(), self._decimals).reshape(len(fields), -1)
        self._done.append(values)
        self._waiting, self._moving = [], np.zeros_like(moving)

    def _fields(self, rows: Bytes) -> NDArray[np.bytes_]:
        count, size = rows.shape
        starts = np.ndarray((count, size - self._width + 1), f"S{self._width}", rows, strides=(rows.strides[0], 1))
        return starts[:, self._offsets]
