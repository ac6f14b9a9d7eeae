"""Samples over time: which count and lie in a window, their running integral, and how far they are from straight."""

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


def newest_states(time: NDArray[np.float64]) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Which states of a file count, and what to say of the others.

    A state gives way to any later one at or before its time: of equal printed times the last counts, and
    where a restarted run steps back its newer leg wins.

    Parameters
    ----------
    time : array of shape (n,)
        Times in the order of the file [unit of the run].

    Returns
    -------
    keep : array of bool, shape (n,)
        ``time[keep]`` increases strictly.
    notes : tuple of str
        A sentence for each kind of state left out.

    Examples
    --------
    >>> keep, notes = newest_states(np.array([0.0, 1.0, 2.0, 1.5, 2.5, 2.5]))
    >>> keep.tolist()
    [True, True, False, True, False, True]
    """
    step = np.diff(time)
    if step.min(initial=1.0) > 0:  # as nearly always
        return np.ones(time.size, dtype=bool), ()
    equal, back = int(np.count_nonzero(step == 0)), int(np.count_nonzero(step < 0))
    later = np.minimum.accumulate(time[::-1])[::-1]
    keep = np.append(time[:-1] < later[1:], np.ones(min(1, time.size), dtype=bool))
    notes = []
    if equal:
        same = "1 state has" if equal == 1 else f"{equal} states have"
        notes.append(f"{same} the same printed time as the next one; the last of equal times counts")
    if back:
        steps = "once" if back == 1 else f"{back} times"
        lost = int(np.count_nonzero(~keep)) - equal
        dropped = "1 older state was" if lost == 1 else f"{lost} older states were"
        notes.append(f"time steps back {steps} (restart); where legs overlap the newer one counts, {dropped} dropped")
    return keep, tuple(notes)
