"""What hangs together of a mesh, node by node: four wheels that nothing joins may be one part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.deck.inventory.model import NO_NODE, SPRING

if TYPE_CHECKING:
    from collections.abc import Collection

    from d2rpick.deck.inventory.model import Inventory, Places


def pieces_of(inventory: Inventory, parts: Collection[int], among: Collection[int] | None = None) -> int:
    """Number of pieces of some parts that nothing joins; none without elements.

    ``among`` are the parts through which they may hang together, by default the same; joints and springs count always.
    """
    nodes = [inventory.nodes_by_part[part] for part in parts if part in inventory.nodes_by_part]
    labels = _labels(inventory, parts if among is None else among)
    return np.unique(np.concatenate([labels[one] for one in nodes])).size if nodes else 0


def _labels(inventory: Inventory, parts: Collection[int]) -> Places:
    """Number of the piece of each node of the deck (nodes,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size, wanted = len(inventory.coordinates), np.array(sorted(parts), np.int64)
    rows = [one.nodes[np.isin(one.part, wanted) | (one.kind == SPRING)] for one in inventory.elements]
    for joint in inventory.joints:
        named = [inventory.nodes_by_part[part] for part in joint.parts & inventory.nodes_by_part.keys()]
        rows.append(np.concatenate([joint.nodes, *named])[np.newaxis])
    ends = [np.stack([np.repeat(one[:, 0], one.shape[1]), one.ravel()]) for one in rows if one.size]
    # older versions of scipy take no wider numbers
    links = np.concatenate([np.empty((2, 0), np.int64), *ends], axis=1).astype(np.int32)
    links = links[:, (links != NO_NODE).all(axis=0)]
    graph = coo_array((np.ones(links.shape[1], bool), (links[0], links[1])), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1])
