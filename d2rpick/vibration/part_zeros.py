"""The zeros of a part's deformation, at which its sign turns, read from the part's own energy.

The root of a part's energy is proportional to its deformation but for the sign, and the sign turns where the energy
passes through zero.  In a record no energy is zero exactly.  But the deformation is smooth: through a zero the root
bends sharply unless the sign is turned there, at any other minimum it bends sharply if it is.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

Places: TypeAlias = "NDArray[np.intp]"

# One way must be this many times smoother than the other to be believed.  At 24 samples per period of a chain of two
# springs the least clear of 35 minima has 2.5, the usual ones have 5 to 60.
_CLEARLY = 2.0
# Every other sample is left out again and again while minima are unclear: in fine output a zero drowns in the error
# of the solver, 1e-5 of the highest energy, and the root is round there.  But minima stay this many samples apart.
_LEAST_APART = 8
# Samples of parts that are looked at together: what is made of them stays in the cache.
_TOGETHER = 1 << 14
# Signs of five samples about a minimum where the deformation turns nowhere, just before the minimum, just after it.
_TURNS = np.array([[1, 1, 1, 1, 1], [-1, -1, 1, 1, 1], [-1, -1, -1, 1, 1]])


class Zeros(NamedTuple):
    """Times at which a deformation passes zero, at which it may or may not, and, near the ends, cannot be seen to."""

    sure: Samples
    doubtful: Samples
    unseen: Samples


def all_zeros(time: Samples, roots: Samples) -> Iterator[Zeros]:
    """Find the zeros of each row of ``roots``, shape (k, n)."""
    rows = max(1, _TOGETHER // time.size)
    for first in range(0, len(roots), rows):
        yield from _zeros(time, roots[first : first + rows])


def _zeros(time: Samples, roots: Samples) -> list[Zeros]:
    """Find the zeros of each row from every sample, or every other, and so on: what leaves the fewest doubts."""
    best, stride = _zeros_of(time, roots, _minima(roots)), 2
    unsure = _unsure(best, range(len(best)))
    while unsure.size:
        coarse = roots[unsure, ::stride]
        minima = _minima(coarse)
        apart = coarse.shape[1] >= _LEAST_APART * np.maximum(1, np.count_nonzero(minima, axis=1))
        rows = unsure[apart].tolist()
        for row, coarser in zip(rows, _zeros_of(time[::stride], coarse[apart], minima[apart]), strict=True):
            best[row] = min(best[row], coarser, key=lambda found: found.doubtful.size)
        unsure, stride = _unsure(best, rows), 2 * stride
    return best


def _unsure(zeros: Sequence[Zeros], rows: Iterable[int]) -> Places:
    return np.array([row for row in rows if zeros[row].doubtful.size], dtype=np.intp)


def _zeros_of(time: Samples, roots: Samples, minima: NDArray[np.bool_]) -> list[Zeros]:
    """Zeros of each row from just these samples, which have these minima."""
    row, at = np.nonzero(minima)
    # two samples to either side tell how the root bends; of a minimum nearer to an end nothing is known
    early, late = at < 2, at >= time.size - 2
    own, middle = row[~early & ~late], at[~early & ~late]
    around = middle[:, np.newaxis] + np.arange(-2, 3)
    plain, before, after = _bends(time[around], roots[own[:, np.newaxis], around] * _TURNS[:, np.newaxis])
    turned = np.minimum(before, after)
    zero = plain > _CLEARLY * turned
    doubt = ~zero & (turned <= _CLEARLY * plain)
    left = np.where(before < after, middle - 1, middle)[zero]
    low, high = roots[own[zero], left], roots[own[zero], left + 1]
    share = np.divide(low, low + high, out=np.full(left.shape, 0.5), where=low + high > 0)
    sure = time[left] + share * (time[left + 1] - time[left])
    # a zero beside a minimum near an end may lie one sample further inwards
    ends, unseen = np.append(row[early], row[late]), np.append(time[at[early] + 1], time[at[late] - 1])
    order = np.argsort(ends, kind="stable")
    tables = (sure, own[zero]), (time[middle[doubt]], own[doubt]), (unseen[order], ends[order])
    parted = (_by_row(times, owners, len(roots)) for times, owners in tables)
    return [Zeros(*one) for one in zip(*parted, strict=True)]


def _by_row(values: Samples, row: Places, rows: int) -> list[Samples]:
    """Values of each row, of which some may have none; they stand in the order of the rows."""
    edges = np.searchsorted(row, np.arange(rows + 1)).tolist()
    return [values[first:last] for first, last in pairwise(edges)]


def _minima(values: Samples) -> NDArray[np.bool_]:
    """Where in each row local minima are, of a flat one the first; an end below its neighbour counts."""
    around = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    return np.asarray((values < around[:, :-2]) & (values <= around[:, 2:]))


def _bends(times: Samples, values: Samples) -> Samples:
    """Largest second difference of the slopes in each row of five samples, of any number of tables of such rows."""
    slopes = (values[..., 1:] - values[..., :-1]) / (times[:, 1:] - times[:, :-1])
    return np.asarray(np.abs(slopes[..., 1:] - slopes[..., :-1]).max(axis=-1, initial=0.0))
