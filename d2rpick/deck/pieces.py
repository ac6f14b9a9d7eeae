"""What hangs together of a mesh, node by node, what supports and imposed motions hold, and what swings on springs.

Four wheels that nothing joins may be one part.  A support holds all that hangs together with its nodes.  A symmetry
plane holds nothing: the model and its mirror image fly together as one body does.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from d2rpick.base.errors import name_units
from d2rpick.deck.geometry import masses_and_steps, sizes_and_lengths
from d2rpick.deck.mesh import NO_NODE
from d2rpick.deck.model import DISCRETE, SPRING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from numpy.typing import NDArray

    from d2rpick.deck.mesh import Reals
    from d2rpick.deck.model import Hold, Inventory, Places

    Mask = NDArray[np.bool_]

# What was found: a mesh may have millions of nodes.
_LABELS: WeakKeyDictionary[Inventory, dict[tuple[frozenset[int], bool], Places]] = (
    WeakKeyDictionary()
)


def pieces_of(
    inventory: Inventory, parts: Collection[int], among: Collection[int] | None = None
) -> int:
    """Number of pieces of some parts that nothing joins; none without elements.

    ``among`` are the parts through which they may hang together, by default the same; joints and springs count in any
    case.
    """
    labels = labels_of(inventory, frozenset(parts if among is None else among))
    nodes = [inventory.nodes_by_part.get(part, np.empty(0, np.int64)) for part in parts]
    return np.unique(labels[np.concatenate(nodes)]).size


def labels_of(
    inventory: Inventory, parts: frozenset[int], *, springs: bool = True
) -> Places:
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
    graph = coo_array(
        (np.ones(links.shape[1], bool), (links[0], links[1])), shape=(size, size)
    )
    return np.asarray(connected_components(graph, directed=False)[1])


def _rows(
    inventory: Inventory, parts: frozenset[int], *, springs: bool
) -> Iterator[Places]:
    """Nodes that hang together, a row each."""
    wanted, own = np.array([*parts], np.int64), inventory.nodes_by_part
    for elements in inventory.elements:
        of_springs = np.full(len(elements.part), springs)
        yield elements.nodes[
            of_springs if elements.kind == SPRING else np.isin(elements.part, wanted)
        ]
    for _, nodes, named in inventory.joints:
        yield np.concatenate([nodes, *(own[part] for part in named & own.keys())])[
            np.newaxis
        ]


# Kinds of elements whose nodes do not turn.
_UNTURNED: Final = {
    "solid",
    "tetrahedron",
    "pentahedron",
    "quad",
    "tria",
    "truss",
    "thick shell",
    "particle",
}
# Nodes lie in one plane within this share of the size of what they belong to.
_FLAT: Final = 1e-6


def supports_of(
    inventory: Inventory,
) -> tuple[Mapping[int, tuple[Hold, ...]], tuple[Hold, ...]]:
    """Give what holds each part that is held, and what holds the model.

    What is fixed all over is an obstacle: it is held itself, and holds nothing that it does not hang together with.
    """
    holds = inventory.boundary.holds
    if not holds:
        return {}, ()
    own = inventory.nodes_by_part
    labels = labels_of(inventory, frozenset(own))
    held = [
        np.concatenate([one.nodes, *(own[part] for part in one.parts & own.keys())])
        for one in holds
    ]
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
            if _counts(
                one,
                nodes[labels[nodes] == piece],
                excused,
                turning & ~fixed.any(axis=1),
            )
        )
        whole |= set() if fixed[members].all() else set(by_piece[piece])
    by_part = {part: sorted({number for piece in np.unique(labels[nodes]).tolist()
                             for number in by_piece.get(piece, ())}) for part, nodes in own.items()}  # fmt: skip
    named = {
        part: tuple(holds[number] for number in numbers)
        for part, numbers in by_part.items()
        if numbers
    }
    return named, tuple(holds[number] for number in sorted(whole))


def _pieces(
    inventory: Inventory, labels: Places, held: Places
) -> Iterator[tuple[int, Places]]:
    """Pieces of which some nodes are held, and the nodes of elements in each."""
    used = np.unique(
        np.concatenate([np.empty(0, np.int64), *inventory.nodes_by_part.values()])
    )
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
    found = np.zeros(
        len(inventory.coordinates) + 1, bool
    )  # the last stands for NO_NODE
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
        and (
            fixed[:, axis].all()
            or (
                not inventory.moved and _is_plane(places[:, axis], fixed[:, axis], room)
            )
        )
    )


def _is_plane(heights: NDArray[np.float64], fixed: Mask, room: float) -> bool:
    plane = heights[fixed][0]
    beside = np.abs(heights - plane) <= room
    one_side = heights.min() >= plane - room or heights.max() <= plane + room
    return bool(one_side and (beside == fixed).all())


# The longest period in which what springs hold together swings, by the masses and springs of a deck.
#
# A piece that hangs together without springs has mass m, those that its springs join it to have M: it swings against
# them as their reduced mass mu = m M/(m + M) does.  By a spring of stiffness k along the unit vector l the stiffness
# of all is the matrix K, the sum of k l l^T, and the period along an eigenvector of K is 2 pi (mu/lambda)^(1/2).  A
# push is handed on first where the springs are stiffest, with the largest lambda; no period is below that with the
# sum of all k, the trace of K.

# What swings with a smaller share of the mass of all that hangs on springs moves the others too little.
_HEAVY: Final = 0.05


class InnerPeriod(NamedTuple):
    """The longest period [time], what it cannot be below [time], and in words what swings."""

    time: float
    least: float
    reason: str


class _Piece(NamedTuple):
    """What hangs together without springs: its parts and its mass."""

    parts: frozenset[int]
    mass: float


class _Spring(NamedTuple):
    """A spring: its stiffness along its length as a matrix (3, 3), and the labels of what it joins."""

    stiffness: Reals
    joins: frozenset[int]


def inner_period(inventory: Inventory) -> InnerPeriod | None:
    """Find the longest period in which the parts of a deck swing on springs against each other.

    None where no springs join them, or the deck does not give every mass and stiffness in a way that is followed:
    springs that are linear along their length (Radioss: /PROP/SPRING without functions).
    """
    stiff = frozenset(
        part
        for part in inventory.nodes_by_part
        if not set(inventory.counts[part]) <= DISCRETE
    )
    if inventory.moved or not inventory.complete:
        return None
    labels = labels_of(inventory, stiff, springs=False)
    pieces = _masses_of_pieces(inventory, stiff, labels)
    springs = list(_springs(inventory, labels, pieces)) if pieces else []
    if not pieces or None in springs:
        return None
    held = {
        label: [one for one in springs if one and label in one.joins]
        for label in pieces
    }
    whole = sum(piece.mass for label, piece in pieces.items() if held[label])
    heavy = [
        label
        for label in pieces
        if held[label] and pieces[label].mass >= _HEAVY * whole
    ]
    return max(
        (_period(label, pieces, held[label]) for label in heavy),
        key=lambda one: one.time,
        default=None,
    )


def _masses_of_pieces(
    inventory: Inventory, parts: Collection[int], labels: Places
) -> Mapping[int, _Piece] | None:
    """Pieces by their label; None where the mass of a part is not known."""
    masses, made = masses_and_steps(inventory), dict[int, _Piece]()
    sizes: dict[int, dict[int, float]] = {part: {} for part in parts}
    for elements in inventory.elements:
        own, _ = sizes_and_lengths(elements.kind, elements.nodes, inventory.coordinates)
        for part in set(np.unique(elements.part).tolist()) & sizes.keys():
            of = elements.part == part
            found, at = np.unique(labels[elements.nodes[of, 0]], return_inverse=True)
            for label, size in zip(
                found.tolist(), np.bincount(at, own[of]).tolist(), strict=True
            ):
                sizes[part][label] = sizes[part].get(label, 0.0) + size
    for part, pieces in sizes.items():
        mass = masses.get(part, (None,))[0]
        if mass is None:
            return None
        for label, size in pieces.items():
            before = made.get(label, _Piece(frozenset(), 0.0))
            made[label] = _Piece(
                before.parts | {part}, before.mass + mass * size / sum(pieces.values())
            )
    return made


def _springs(
    inventory: Inventory, labels: Places, pieces: Mapping[int, _Piece]
) -> Iterator[_Spring | None]:
    """Springs between two pieces; None for one that is not known."""
    springs = (elements for elements in inventory.elements if elements.kind == SPRING)
    for elements in springs:
        for part, ends in zip(
            elements.part.tolist(), elements.nodes[:, :2], strict=True
        ):
            joins = frozenset[int](labels[ends].tolist())
            if len(joins) < 2 or not joins & pieces.keys():
                continue
            data = inventory.parts.get(part)
            stiffness = data.section.stiffness if data else None
            way = np.subtract(*inventory.coordinates[ends])
            known = stiffness is not None and joins <= pieces.keys() and way.any()
            yield (
                _Spring(stiffness * np.outer(way, way) / (way @ way), joins)
                if stiffness and known
                else None
            )


def _period(
    label: int, pieces: Mapping[int, _Piece], springs: list[_Spring]
) -> InnerPeriod:
    """Period in which a piece swings against those that springs join it to."""
    piece, others = (
        pieces[label],
        frozenset[int]().union(*(one.joins for one in springs)) - {label},
    )
    mass = 1 / (1 / piece.mass + 1 / sum(pieces[one].mass for one in others))
    stiffness = np.sum([one.stiffness for one in springs], axis=0)
    most = float(np.linalg.eigvalsh(stiffness)[-1])
    time, least = (
        2 * math.pi * math.sqrt(mass / one)
        for one in (most, float(np.trace(stiffness)))
    )
    return InnerPeriod(
        time,
        least,
        f"{name_units(piece.parts)} of mass {piece.mass:.4g} on {len(springs)} springs",
    )
