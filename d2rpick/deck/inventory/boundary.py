"""What acts on a model from outside, as its deck tells: gravity, supports, imposed motion."""

from __future__ import annotations

from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from numpy.typing import NDArray

    Places = NDArray[np.int64]


class Hold(NamedTuple):
    """A support or an imposed motion: what to call it, and whom it holds from ``start`` to ``end`` [time].

    ``nodes`` are ids, or places once it is `placed`; ``parts`` are held as a whole.  ``axes`` are the global directions
    of translation that it fixes, none where it fixes rotations alone.  ``counts``: whatever these are, since it moves
    what it holds, or fixes it along axes of its own.
    """

    name: str
    nodes: Places
    parts: frozenset[int] = frozenset()
    axes: frozenset[int] = frozenset()
    counts: bool = False
    start: float = 0.0
    end: float = inf


class Gravity(NamedTuple):
    """Gravity along an ``axis``, None where that is one of its own, by the ``values`` that it keeps for a while.

    ``values`` are accelerations [length/time^2].  It acts on ``nodes`` (ids, or places) and ``parts``; None: on all.
    """

    axis: int | None
    values: tuple[float, ...]
    nodes: Places | None = None
    parts: frozenset[int] = frozenset()


class Boundary(NamedTuple):
    """All that a deck has of them; ``gravity`` is None where it is not known.  ``notes`` say what is not followed."""

    holds: tuple[Hold, ...] = ()
    gravity: tuple[Gravity, ...] | None = None
    notes: tuple[str, ...] = ()


NOTHING: Final = Boundary()


def ids(numbers: Iterable[int]) -> Places:
    """Give node ids as an array, ascending."""
    return np.array(sorted(numbers), np.int64)


def plateaus(ordinates: Sequence[float], scale: float) -> tuple[float, ...]:
    """Values that a function keeps from one point to the next, by a factor; none where it changes all the time.

    Examples
    --------
    >>> plateaus([0.0, 0.0, 1.0, 1.0], 9.81)
    (0.0, 9.81)
    """
    return tuple(sorted({scale * one for one, other in pairwise(ordinates) if one == other}))
