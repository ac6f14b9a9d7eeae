"""A curve with fewer points that looks the same: no extreme of it is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples


def outline(time: Samples, values: Samples, stretches: int) -> Samples:
    """Give times and values that draw the curve, shape (2, m): all, or the extremes of each of many stretches.

    Parameters
    ----------
    time, values : array of shape (n,)
    stretches : int
        Stretches of equally many samples; the first and the last sample stay, too, and m is at most
        ``2 * stretches + 2``.

    Examples
    --------
    >>> outline(np.arange(8.0), np.array([0.0, 9.0, 0.0, 1.0, 2.0, -7.0, 1.0, 0.0]), 2).tolist()
    [[0.0, 1.0, 4.0, 5.0, 7.0], [0.0, 9.0, 2.0, -7.0, 0.0]]
    """
    if time.size <= 2 * stretches:
        return np.stack([time, values])
    pieces = np.array_split(np.arange(time.size), stretches)
    kept = [piece[0] + place for piece in pieces for place in (values[piece].argmin(), values[piece].argmax())]
    at = np.unique([0, *kept, time.size - 1])
    return np.stack([time[at], values[at]])
