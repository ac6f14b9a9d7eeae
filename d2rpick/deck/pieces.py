"""What hangs together of a mesh, node by node, and which of it supports and imposed motions hold.

Four wheels that nothing joins may be one part.  A support holds all that hangs together with its nodes.  A symmetry
plane holds nothing: the model and its mirror image fly together as one body does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final
from weakref import WeakKeyDictionary

import numpy as np

from d2rpick.deck.mesh import NO_NODE
from d2rpick.deck.model import SPRING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from numpy.typing import NDArray

    from d2rpick.deck.model import Hold, Inventory, Places

    Mask = NDArray[np.bool_]

# What was found: a mesh may have millions of nodes.
_LABELS: WeakKeyDictionary[Inventory, dict[tuple[frozenset[int], bool], Places]] = WeakKeyDictionary()


def pieces_of(inventory: Inventory, parts: Collection[int], among: Collection[int] | None = None) -> int:
    """Number of pieces of some parts that nothing joins; none without elements.

    ``among`` are the parts through which they may hang together, by default the same; joints and springs count in any
    case.
    """
    labels = labels_of(inventory, frozenset(parts if among is None else among))
    nodes = [inventory.nodes_by_part.get(part, np.empty(0, np.int64)) for part in parts]
    return np.unique(labels[np.concatenate(nodes)]).size


def labels_of(inventory: Inventory, parts: frozenset[int], *, springs: bool = True) -> Places:
    """Number of the piece of each node of the deck (nodes,): what parts, springs and joints make hang together."""
    known = _LABELS.setdefault(inventory, {})
    if (parts, springs) not in known:
        known[parts, springs] = _labels(inventory, parts, springs=springs)
    return known[parts, springs]


def _labels(inventory: Inventory, parts: frozenset[int], *, springs: bool) -> Places:
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = len(inventory.coordinates)
    ends = [
        np.stack([np.repeat(one[:, 0], one.shape[1]), one.ravel()])
        for one in _rows(inventory, parts, springs=springs)
        if one.size
    ]
    links = np.concatenate([np.empty((2, 0), np.int64), *ends], axis=1)
    # older versions of scipy take no wider numbers
    links = links[:, (links != NO_NODE).all(axis=0)].astype(np.int32)
    graph = coo_array((np.ones(links.shape[1], bool), (links[0], links[1])), shape=(size, size))
    return np.asarray(connected_components(graph, directed=False)[1])


def _rows(inventory: Inventory, parts: frozenset[int], *, springs: bool) -> Iterator[Places]:
    """Nodes that hang together, a row each."""
    wanted, own = np.array([*parts], np.int64), inventory.nodes_by_part
    for elements in inventory.elements:
        of_springs = np.full(len(elements.part), springs)
        yield elements.nodes[of_springs if elements.kind == SPRING else np.isin(elements.part, wanted)]
    for _, nodes, named in inventory.joints:
        yield np.concatenate([nodes, *(own[part] for part in named & own.keys())])[np.newaxis]


# Kinds of elements whose nodes do not turn.
_UNTURNED: Final = {"solid", "tetrahedron", "pentahedron", "quad", "tria", "truss", "thick shell", "particle"}
# Nodes lie in one plane within this share of the size of what they belong to.
_FLAT: Final = 1e-6


def supports_of(inventory: Inventory) -> tuple[Mapping[int, tuple[Hold, ...]], tuple[Hold, ...]]:
    """Give what holds each part that is held, and what holds the model.

    What is fixed all over is an obstacle: it is held itself, and holds nothing that it does not hang together with.
    """
    holds = inventory.boundary.holds
    if not holds:
        return {}, ()
    own = inventory.nodes_by_part
    labels = labels_of(inventory, frozenset(own))
    held = [np.concatenate([one.nodes, *(own[part] for part in one.parts & own.keys())]) for one in holds]
    fixed = np.zeros((len(labels), 3), bool)
    for one, nodes in zip(holds, held, strict=True):
        if not one.counts and one.start <= 0 and np.isinf(one.end):
            for axis in one.axes:
                fixed[nodes, axis] = True
    turning = _turning(inventory)
    by_piece: dict[int, tuple[int, ...]] = {}
    whole: set[int] = set()
    for piece, members in _pieces(inventory, labels, np.concatenate(held)):
        excused = _symmetries(inventory, members, fixed[members])
        by_piece[piece] = tuple(
            number
            for number, (one, nodes) in enumerate(zip(holds, held, strict=True))
            if _counts(one, nodes[labels[nodes] == piece], excused, turning & ~fixed.any(axis=1))
        )
        whole |= set() if fixed[members].all() else set(by_piece[piece])
    by_part = {part: sorted({number for piece in np.unique(labels[nodes]).tolist()
                             for number in by_piece.get(piece, ())}) for part, nodes in own.items()}  # fmt: skip
    named = {part: tuple(holds[number] for number in numbers) for part, numbers in by_part.items() if numbers}
    return named, tuple(holds[number] for number in sorted(whole))


def _pieces(inventory: Inventory, labels: Places, held: Places) -> Iterator[tuple[int, Places]]:
    """Pieces of which some nodes are held, and the nodes of elements in each."""
    used = np.unique(np.concatenate([np.empty(0, np.int64), *inventory.nodes_by_part.values()]))
    used = used[np.argsort(labels[used], kind="stable")]
    of = labels[used]
    for piece in np.unique(labels[held]).tolist():
        members = used[slice(*np.searchsorted(of, [piece, piece + 1]))]
        if members.size:
            yield piece, members


def _counts(hold: Hold, nodes: Places, excused: frozenset[int], turned: Mask) -> bool:
    """Whether a support holds some nodes of a piece; rotations count where translations are free."""
    if not nodes.size or hold.counts:
        return bool(nodes.size)
    return bool(hold.axes - excused) if hold.axes else bool(turned[nodes].any())


def _turning(inventory: Inventory) -> Mask:
    """Whether each node has rotations."""
    found = np.zeros(len(inventory.coordinates) + 1, bool)  # the last stands for NO_NODE
    for elements in inventory.elements:
        if elements.kind not in _UNTURNED:
            found[elements.nodes] = True
    for joint in inventory.joints:
        found[joint.nodes] = True
    return found[:-1]


def _symmetries(inventory: Inventory, members: Places, fixed: Mask) -> frozenset[int]:
    """Directions (of ``fixed``, (members, 3)) in which a piece is held as by a symmetry plane, or has no motion at all.

    It lies on one side of the plane, which holds all of its nodes there, and gravity does not pull it against it.
    """
    gravity = inventory.boundary.gravity
    pulled = {None} if gravity is None else {one.axis for one in gravity}
    if fixed.any(axis=0).all() or None in pulled:
        return frozenset()
    places = inventory.coordinates[members]
    room = _FLAT * float(np.ptp(places, axis=0).max())
    return frozenset(
        axis
        for axis in np.flatnonzero(fixed.any(axis=0)).tolist()
        if axis not in pulled
        and (fixed[:, axis].all() or (not inventory.moved and _is_plane(places[:, axis], fixed[:, axis], room)))
    )


def _is_plane(heights: NDArray[np.float64], fixed: Mask, room: float) -> bool:
    plane = heights[fixed][0]
    beside = np.abs(heights - plane) <= room
    one_side = heights.min() >= plane - room or heights.max() <= plane + room
    return bool(one_side and (beside == fixed).all())
