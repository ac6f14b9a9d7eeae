"""Find connected pieces of a mesh, the supports of each part, and the longest period of masses on springs.

A part may consist of several pieces, such as four wheels. A support holds all pieces that are connected to its nodes. A
symmetry plane does not hold the model, because the model and its mirror image fly together like one body.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from d2rpick.base.errors import name_units
from d2rpick.deck.geometry import compute_masses_and_steps, compute_sizes_and_lengths
from d2rpick.deck.mesh import NO_NODE
from d2rpick.deck.model import DISCRETE, SPRING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from numpy.typing import NDArray

    from d2rpick.deck.mesh import Reals
    from d2rpick.deck.model import Hold, Inventory, Places

    Mask = NDArray[np.bool_]

# Numbers of the connected pieces by node, which are cached because a mesh may have millions of nodes.
_LABELS: WeakKeyDictionary[Inventory, dict[tuple[frozenset[int], bool], Places]] = (
    WeakKeyDictionary()
)

# Element kinds whose nodes have no rotational degrees of freedom.
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
# Nodes are on a plane up to this distance, as a fraction of the size of the connected piece [-].
_FLAT: Final = 1e-6
# A piece moves other pieces on springs if its mass is at least this fraction of their total mass [-].
_HEAVY: Final = 0.05


def count_pieces(
    inventory: Inventory, parts: Collection[int], among: Collection[int] | None = None
) -> int:
    """Return the number of disconnected mesh pieces of the given parts; 0 if there are no elements.

    ``among`` contains the parts that may connect the pieces, by default the given parts. Joints and springs always
    connect pieces.
    """
    labels = label_pieces(inventory, frozenset(parts if among is None else among))
    nodes = [inventory.nodes_by_part.get(part, np.empty(0, np.int64)) for part in parts]
    return np.unique(labels[np.concatenate(nodes)]).size


def label_pieces(
    inventory: Inventory, parts: frozenset[int], *, springs: bool = True
) -> Places:
    """Return the number of the connected piece to which each node of the deck belongs, shape (nodes,). It is cached.

    Nodes are connected by elements of ``parts``, by joints and, unless ``springs`` is False, by springs.
    """
    labels_by_parts = _LABELS.setdefault(inventory, {})
    if (parts, springs) not in labels_by_parts:
        labels_by_parts[parts, springs] = _compute_labels(
            inventory, parts, springs=springs
        )
    return labels_by_parts[parts, springs]


def _compute_labels(
    inventory: Inventory, parts: frozenset[int], *, springs: bool
) -> Places:
    """Compute the number of the connected piece to which each node belongs."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = len(inventory.coordinates)
    ends = [
        np.stack([np.repeat(row[:, 0], row.shape[1]), row.ravel()])
        for row in _list_connections(inventory, parts, springs=springs)
        if row.size
    ]
    links = np.concatenate([np.empty((2, 0), np.int64), *ends], axis=1)
    # Older versions of scipy accept only 32-bit indices.
    links = links[:, (links != NO_NODE).all(axis=0)].astype(np.int32)
    graph = coo_array(
        (np.ones(links.shape[1], bool), (links[0], links[1])), shape=(size, size)
    )
    return np.asarray(connected_components(graph, directed=False)[1])


def _list_connections(
    inventory: Inventory, parts: frozenset[int], *, springs: bool
) -> Iterator[Places]:
    """Yield arrays of nodes; the nodes in each row are connected."""
    wanted = np.array([*parts], np.int64)
    part_nodes = inventory.nodes_by_part
    for elements in inventory.elements:
        of_springs = np.full(len(elements.part), springs)
        yield elements.nodes[
            of_springs if elements.kind == SPRING else np.isin(elements.part, wanted)
        ]
    for _, nodes, joint_parts in inventory.joints:
        yield np.concatenate(
            [nodes, *(part_nodes[part] for part in joint_parts & part_nodes.keys())]
        )[np.newaxis]


def find_supports(
    inventory: Inventory,
) -> tuple[Mapping[int, tuple[Hold, ...]], tuple[Hold, ...]]:
    """Return the supports of each supported part by part id, and the supports of the model.

    A completely fixed piece is an obstacle: it is supported, but it does not support other pieces that are not
    connected to it.
    """
    holds = inventory.boundary.holds
    if not holds:
        return {}, ()
    part_nodes = inventory.nodes_by_part
    labels = label_pieces(inventory, frozenset(part_nodes))
    hold_nodes = [
        np.concatenate(
            [hold.nodes, *(part_nodes[part] for part in hold.parts & part_nodes.keys())]
        )
        for hold in holds
    ]
    fixed = np.zeros((len(labels), 3), bool)
    for hold, nodes in zip(holds, hold_nodes, strict=True):
        if not hold.counts and hold.start <= 0 and np.isinf(hold.end):
            for axis in hold.axes:
                fixed[nodes, axis] = True
    turning = _find_rotating_nodes(inventory)
    by_piece: dict[int, tuple[int, ...]] = {}
    whole: set[int] = set()
    for piece, members in _find_held_pieces(
        inventory, labels, np.concatenate(hold_nodes)
    ):
        excused = _find_symmetry_axes(inventory, members, fixed[members])
        by_piece[piece] = tuple(
            number
            for number, (hold, nodes) in enumerate(zip(holds, hold_nodes, strict=True))
            if _is_held(
                hold,
                nodes[labels[nodes] == piece],
                excused,
                turning & ~fixed.any(axis=1),
            )
        )
        whole |= set() if fixed[members].all() else set(by_piece[piece])
    by_part = {part: sorted({number for piece in np.unique(labels[nodes]).tolist()
                             for number in by_piece.get(piece, ())}) for part, nodes in part_nodes.items()}  # fmt: skip
    holds_by_part = {
        part: tuple(holds[number] for number in numbers)
        for part, numbers in by_part.items()
        if numbers
    }
    return holds_by_part, tuple(holds[number] for number in sorted(whole))


def _find_held_pieces(
    inventory: Inventory, labels: Places, held: Places
) -> Iterator[tuple[int, Places]]:
    """Yield each connected piece with supported nodes, and the nodes of its elements."""
    used = np.unique(
        np.concatenate([np.empty(0, np.int64), *inventory.nodes_by_part.values()])
    )
    used = used[np.argsort(labels[used], kind="stable")]
    node_labels = labels[used]
    for piece in np.unique(labels[held]).tolist():
        members = used[slice(*np.searchsorted(node_labels, [piece, piece + 1]))]
        if members.size:
            yield piece, members


def _is_held(hold: Hold, nodes: Places, excused: frozenset[int], turned: Mask) -> bool:
    """Return True if a support holds nodes of a piece. Fixed rotations count only if the translations are free."""
    if not nodes.size or hold.counts:
        return bool(nodes.size)
    return bool(hold.axes - excused) if hold.axes else bool(turned[nodes].any())


def _find_rotating_nodes(inventory: Inventory) -> Mask:
    """Return a mask of the nodes that have rotational degrees of freedom."""
    # The index NO_NODE is -1, and therefore selects this last entry.
    has_rotations = np.zeros(len(inventory.coordinates) + 1, bool)
    for elements in inventory.elements:
        if elements.kind not in _UNTURNED:
            has_rotations[elements.nodes] = True
    for joint in inventory.joints:
        has_rotations[joint.nodes] = True
    return has_rotations[:-1]


def _find_symmetry_axes(
    inventory: Inventory, members: Places, fixed: Mask
) -> frozenset[int]:
    """Return the axes along which a symmetry plane, or fixing all nodes, holds a piece; ``fixed`` is (members, 3).

    The piece lies on one side of the plane, all its nodes on the plane are fixed, and gravity does not act along the
    axis.
    """
    gravity = inventory.boundary.gravity
    gravity_axes = {None} if gravity is None else {load.axis for load in gravity}
    if fixed.any(axis=0).all() or None in gravity_axes:
        return frozenset()
    coordinates = inventory.coordinates[members]
    tolerance = _FLAT * float(np.ptp(coordinates, axis=0).max())
    return frozenset(
        axis
        for axis in np.flatnonzero(fixed.any(axis=0)).tolist()
        if axis not in gravity_axes
        and (
            fixed[:, axis].all()
            or (
                not inventory.moved
                and _is_plane(coordinates[:, axis], fixed[:, axis], tolerance)
            )
        )
    )


def _is_plane(heights: NDArray[np.float64], fixed: Mask, tolerance: float) -> bool:
    """Return True if the fixed nodes are exactly the nodes on a plane that bounds the connected piece."""
    plane = heights[fixed][0]
    on_plane = np.abs(heights - plane) <= tolerance
    one_side = heights.min() >= plane - tolerance or heights.max() <= plane + tolerance
    return bool(one_side and (on_plane == fixed).all())


# The code below computes the longest period of connected pieces that oscillate on springs.
# A piece without inner springs has mass m, and its springs connect it to pieces of total mass M.
# The reduced mass of a piece of mass m whose springs connect it to pieces of total mass M is mu = m M/(m + M).
# A spring of stiffness k along the unit vector l adds k l l^T to the stiffness matrix K of the piece.
# The period of a piece along an eigenvector of K with eigenvalue lambda is 2 pi (mu/lambda)^(1/2).
# A load is transmitted in the stiffest direction first, so the largest eigenvalue of K determines the period.
# With the trace of K in place of lambda, this formula gives a lower bound on all periods.


class InnerPeriod(NamedTuple):
    """The longest period [time], its lower bound ``least`` [time], and a description of what oscillates."""

    time: float
    least: float
    reason: str


class _Piece(NamedTuple):
    """A piece of the mesh that elements other than springs connect: its parts and its mass."""

    parts: frozenset[int]
    mass: float


class _Spring(NamedTuple):
    """A spring: its stiffness matrix (3, 3), and the numbers of the pieces that it connects."""

    stiffness: Reals
    joins: frozenset[int]


def find_inner_period(inventory: Inventory) -> InnerPeriod | None:
    """Return the longest period in which the parts of a deck oscillate on springs relative to each other.

    The result is None if no springs connect the parts, or if a mass or stiffness is unknown. Springs must be linear
    along their length (in Radioss, /PROP/SPRING without functions).
    """
    stiff_parts = frozenset(
        part
        for part in inventory.nodes_by_part
        if not set(inventory.counts[part]) <= DISCRETE
    )
    if inventory.moved or not inventory.complete:
        return None
    labels = label_pieces(inventory, stiff_parts, springs=False)
    pieces = _weigh_pieces(inventory, stiff_parts, labels)
    springs = list(_find_springs(inventory, labels, pieces)) if pieces else []
    if not pieces or None in springs:
        return None
    springs_by_piece = {
        label: [spring for spring in springs if spring and label in spring.joins]
        for label in pieces
    }
    sprung_mass = sum(
        piece.mass for label, piece in pieces.items() if springs_by_piece[label]
    )
    heavy = [
        label
        for label in pieces
        if springs_by_piece[label] and pieces[label].mass >= _HEAVY * sprung_mass
    ]
    return max(
        (_compute_period(label, pieces, springs_by_piece[label]) for label in heavy),
        key=lambda spring: spring.time,
        default=None,
    )


def _weigh_pieces(
    inventory: Inventory, parts: Collection[int], labels: Places
) -> Mapping[int, _Piece] | None:
    """Return the connected pieces, keyed by number; None if the mass of a part is unknown."""
    masses = compute_masses_and_steps(inventory)
    pieces_by_label = dict[int, _Piece]()
    sizes: dict[int, dict[int, float]] = {part: {} for part in parts}
    for elements in inventory.elements:
        element_sizes, _ = compute_sizes_and_lengths(
            elements.kind, elements.nodes, inventory.coordinates
        )
        for part in set(np.unique(elements.part).tolist()) & sizes.keys():
            is_of_part = elements.part == part
            piece_labels, label_index = np.unique(
                labels[elements.nodes[is_of_part, 0]], return_inverse=True
            )
            for label, size in zip(
                piece_labels.tolist(),
                np.bincount(label_index, element_sizes[is_of_part]).tolist(),
                strict=True,
            ):
                sizes[part][label] = sizes[part].get(label, 0.0) + size
    for part, pieces in sizes.items():
        mass = masses.get(part, (None,))[0]
        if mass is None:
            return None
        for label, size in pieces.items():
            earlier = pieces_by_label.get(label, _Piece(frozenset(), 0.0))
            pieces_by_label[label] = _Piece(
                earlier.parts | {part},
                earlier.mass + mass * size / sum(pieces.values()),
            )
    return pieces_by_label


def _find_springs(
    inventory: Inventory, labels: Places, pieces: Mapping[int, _Piece]
) -> Iterator[_Spring | None]:
    """Yield the springs between two pieces, with None for a spring of unknown stiffness."""
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
            direction = np.subtract(*inventory.coordinates[ends])
            is_known = (
                stiffness is not None and joins <= pieces.keys() and direction.any()
            )
            yield (
                _Spring(
                    stiffness
                    * np.outer(direction, direction)
                    / (direction @ direction),
                    joins,
                )
                if stiffness and is_known
                else None
            )


def _compute_period(
    label: int, pieces: Mapping[int, _Piece], springs: list[_Spring]
) -> InnerPeriod:
    """Return the period in which a piece oscillates relative to the pieces at the other ends of its springs."""
    piece = pieces[label]
    joined = frozenset[int]().union(*(spring.joins for spring in springs))
    mass_of_others = sum(pieces[other].mass for other in joined - {label})
    reduced_mass = 1 / (1 / piece.mass + 1 / mass_of_others)
    stiffness = np.sum([spring.stiffness for spring in springs], axis=0)
    largest = float(np.linalg.eigvalsh(stiffness)[-1])
    total = float(np.trace(stiffness))
    time = 2 * math.pi * math.sqrt(reduced_mass / largest)
    shortest_period = 2 * math.pi * math.sqrt(reduced_mass / total)
    return InnerPeriod(
        time,
        shortest_period,
        f"{name_units(piece.parts)} of mass {piece.mass:.4g} on {len(springs)} springs",
    )
