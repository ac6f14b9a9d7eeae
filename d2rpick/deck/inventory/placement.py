"""Where the parts of a deck lie: their centres of mass and moments of inertia, and the nodes that a run watches.

The mass of a part is spread evenly over its elements, each of which counts as a point at the mean of its nodes.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.deck.inventory.model import DISCRETE, NO_NODE
from d2rpick.deck.inventory.size import sizes_and_lengths

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from d2rpick.deck.inventory.model import Elements, Inventory, Places, Reals


class Placed(NamedTuple):
    """Where a part lies: ``centre`` (3,) of its mass [length], ``spread`` (3, 3) second moments over it [length^2].

    ``watched`` has the coordinates of its nodes whose motion the run writes, by their places in the table of nodes.
    """

    centre: Reals
    spread: Reals
    watched: Mapping[int, Reals]


class _Share(NamedTuple):
    """Elements of a part together: their size, its first moments and its second, (), (3,) and (3, 3)."""

    size: float
    first: Reals
    second: Reals


class Placement:
    """Where the parts of a deck lie, found when it is asked for."""

    def __init__(self, inventory: Inventory) -> None:
        self._inventory = inventory

    @cached_property
    def parts(self) -> Mapping[int, Placed]:
        """Parts whose elements are all placed; none where some may be missing, or the deck moves its nodes."""
        if self._inventory.moved or not self._inventory.complete:
            return {}
        found: dict[int, list[_Share]] = {}
        for elements in self._inventory.elements:
            for part, share in _shares(elements, self._inventory.coordinates):
                found.setdefault(part, []).append(share)
        placed = ((part, _placed(self._inventory, part, shares)) for part, shares in found.items())
        return {part: one for part, one in placed if np.isfinite(one.spread).all()}

    def watched_centre(self, parts: Iterable[int]) -> Reals | None:
        """Mean of the watched nodes of some parts (3,) [length], each node once; None without any."""
        places = {place: where for part in parts for place, where in self.parts[part].watched.items()}
        return np.mean(list(places.values()), axis=0) if places else None

    def hanging_together(self, parts: Collection[int]) -> frozenset[int]:
        """Those of some parts that share nodes, directly or not, in the largest group of them."""
        groups = self._inventory.groups(parts)
        return frozenset(max(groups, key=self._inventory.rigid_nodes, default=()))


def _shares(elements: Elements, coordinates: Reals) -> Iterable[tuple[int, _Share]]:
    """What the elements of one kind add to each part."""
    if elements.nodes.shape[1] == 0:
        return []
    sizes = np.ones(len(elements.nodes)) if elements.kind in DISCRETE else (
        sizes_and_lengths(elements.kind, elements.nodes, coordinates)[0]
    )  # fmt: skip
    middles = _middles(elements.nodes, coordinates)
    parts, at = np.unique(elements.part, return_inverse=True)
    total = np.bincount(at, sizes)
    total[total == 0] = np.nan  # elements without any size do not tell where their part is
    first = np.stack([np.bincount(at, sizes * axis) for axis in middles.T], axis=1)
    x, y, z = (middles - (first / total[:, np.newaxis])[at]).T  # from there: far from the origin digits would be lost
    xx, yy, zz, xy, yz, zx = (
        np.bincount(at, sizes * a * b) for a, b in ((x, x), (y, y), (z, z), (x, y), (y, z), (z, x))
    )
    second = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    return [
        (part, _Share(size, one, other))
        for part, size, one, other in zip(parts.tolist(), total.tolist(), first, second.transpose(2, 0, 1), strict=True)
    ]


def _middles(nodes: Places, coordinates: Reals) -> Reals:
    """Mean of the nodes of each element (n, 3)."""
    if (nodes != NO_NODE).all():
        return np.asarray(sum(coordinates[column] for column in nodes.T) / nodes.shape[1])
    real = nodes != NO_NODE
    summed = sum(
        np.where(there[:, np.newaxis], coordinates[column], 0.0) for column, there in zip(nodes.T, real.T, strict=True)
    )
    return np.asarray(summed / real.sum(axis=1)[:, np.newaxis])


def _placed(inventory: Inventory, part: int, shares: Sequence[_Share]) -> Placed:
    size = sum(one.size for one in shares)
    centre = np.asarray(sum(one.first for one in shares) / size)
    apart = [(one, one.first / one.size - centre) for one in shares]
    spread = sum(one.second + one.size * np.outer(way, way) for one, way in apart) / size
    nodes = inventory.nodes_by_part[part]  # ascending, and many more than those that are watched
    at = np.minimum(np.searchsorted(nodes, inventory.watched), nodes.size - 1)
    own = inventory.watched[nodes[at] == inventory.watched]
    watched = {place: inventory.coordinates[place] for place in own.tolist()}
    return Placed(centre, np.asarray(spread), watched)
