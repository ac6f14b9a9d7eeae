"""What hangs together of a mesh, node by node: four wheels that nothing joins may be one part."""

from __future__ import annotations

from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from d2rpick.deck.inventory.model import NO_NODE, SPRING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator

    from d2rpick.deck.inventory.model import Inventory, Places

# What was found: a mesh may have millions of nodes.
_LABELS: WeakKeyDictionary[Inventory, dict[frozenset[int], Places]] = WeakKeyDictionary()


def pieces_of(inventory: Inventory, parts: Collection[int], among: Collection[int] | None = None) -> int:
    """Number of pieces of some parts that nothing joins; none without elements.

    ``among`` are the parts through which they may hang together, by default the same; joints and springs count in any
    case.
    """
    labels = labels_of(inventory, frozenset(parts if among is None else among))
    nodes = [inventory.nodes_by_part.get(part, np.empty(0, np.int64)) for part in parts]
    return np.unique(labels[np.concatenate(nodes)]).size


def labels_of(inventory: Inventory, parts: frozenset[int]) -> Places:
    """Number of the piece of each node of the deck (nodes,): what parts, springs and joints make hang together."""
    known = _LABELS.setdefault(inventory, {})
    if parts not in known:
        known[parts] = _labels(inventory, parts)
    return known[parts]


def _labels(inventory: Inventory, parts: frozenset[int]) -> Places:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = len(inventory.coordinates)
    ends = [np.stack([np.repeat(one[:, 0], one.shape[1]), one.ravel()]) for one in _rows(inventory, parts) if one.size]
    links = np.concatenate([np.empty((2, 0), np.int64), *ends], axis=1)
    # older versions of scipy take no wider numbers
    links = links[:, (links != NO_NODE).all(axis=0)].astype(np.int32)
    graph = coo_array((np.ones(links.shape[1], bool), (links[0], links[1])), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1])


def _rows(inventory: Inventory, parts: frozenset[int]) -> Iterator[Places]:
    """Nodes that hang together, a row each."""
    wanted, own = np.array([*parts], np.int64), inventory.nodes_by_part
    for elements in inventory.elements:
        yield elements.nodes[np.isin(elements.part, wanted) | (elements.kind == SPRING)]
    for _, nodes, named in inventory.joints:
        yield np.concatenate([nodes, *(own[part] for part in named & own.keys())])[np.newaxis]
