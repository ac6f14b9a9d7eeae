"""Samples over ascending times: which lie in a window, their running integral, and how far they are from straight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def window(time: NDArray[np.float64], start: float, end: float) -> slice:
    """Slice of ascending times from ``start`` to ``end``, both included [time].

    Examples
    --------
    >>> window(np.array([0.0, 1.0, 2.0, 3.0]), 1.0, 2.0)
    slice(1, 3, None)
    """
    first, last = np.searchsorted(time, [start, np.nextafter(end, np.inf)]).tolist()
    return slice(first, last)


def integral(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integral of values (n,) or (n, k) from the first time on, by trapezia, of their shape.

    Examples
    --------
    >>> integral(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 2.0])).tolist()
    [0.0, 1.0, 5.0]
    """
    areas = np.diff(time) * (values[1:] + values[:-1]).T / 2
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(areas.T, axis=0)])


def bent(time: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give what is left of each column of values (n, k) beside a straight line.

    Examples
    --------
    >>> bent(np.array([0.0, 1.0, 2.0]), np.array([[1.0, 0.0], [2.0, 3.0], [3.0, 0.0]])).round(12).tolist()
    [[0.0, -1.0], [0.0, 2.0], [0.0, -1.0]]
    """
    t = time - time.sum() / time.size  # as mean(), which is slow for few
    centred = values - values.sum(axis=0) / time.size
    centred -= t[:, np.newaxis] * (t @ centred / (t @ t))
    return np.asarray(centred)
