"""Compute element sizes and, from them, the mass, the smallest stable time step and the position of each part.

The time step is the time in which a wave crosses an element, before any factor of the solver: L/c with c^2 = E/rho for
beams, E/(rho (1 - nu^2)) for shells and E (1 - nu)/(rho (1 + nu)(1 - 2 nu)) for solids. L is the length of a beam, the
area of a shell over its longest side (twice that for a triangle), or the volume of a solid over its largest face (three
times that for a tetrahedron). Solvers add mass, scale the time step or use a nodal time step, so the actual time step
may differ by about 10 %.

The mass of a part is distributed evenly over the volume of its elements. Each element is a point mass at the mean of
its nodes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.deck.mesh import NO_NODE, Elements
from d2rpick.deck.model import DISCRETE

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from d2rpick.deck.model import Inventory, Material, PartData, Places, Reals

# Number of elements that are processed at a time, so that their arrays fit into the processor cache.
_PIECE: Final = 1 << 14
# Nodes of each face of a brick, in order as seen from outside.
_FACES: Final = (
    (0, 3, 2, 1),
    (4, 5, 6, 7),
    (0, 1, 5, 4),
    (1, 2, 6, 5),
    (2, 3, 7, 6),
    (3, 0, 4, 7),
)
_SURFACES: Final = frozenset({"shell", "triangle"})
_LINES: Final = frozenset({"beam", "truss"})
_VOLUMES: Final = frozenset({"solid", "tetrahedron", "thick shell"})


class _ElementTotals(NamedTuple):
    """Number, total size and shortest wave path of the elements of one kind in one part."""

    kind: str
    number: int
    size: float
    length: float


def compute_masses_and_steps(
    inventory: Inventory,
) -> dict[int, tuple[float | None, float | None]]:
    """Return the mass [mass] and the smallest stable time step [time] of every part with elements, keyed by part id.

    A value is None if the deck does not define the density, modulus, thickness or position of every element of the
    part.
    """
    measured: dict[int, list[_ElementTotals]] = {}
    for elements in inventory.elements:
        sizes, lengths = compute_sizes_and_lengths(
            elements.kind, elements.nodes, inventory.coordinates
        )
        order = np.argsort(elements.part, kind="stable")
        parts, starts, counts = np.unique(
            elements.part[order], return_index=True, return_counts=True
        )
        sums = np.add.reduceat(sizes[order], starts)
        lows = np.minimum.reduceat(lengths[order], starts)
        for part, *values in zip(
            *(a.tolist() for a in (parts, counts, sums, lows)), strict=True
        ):
            measured.setdefault(part, []).append(_ElementTotals(elements.kind, *values))
    return {
        part: (
            _compute_mass(inventory.parts[part], part_elements),
            _compute_step(inventory.parts[part], part_elements),
        )
        for part, part_elements in measured.items()
        if part in inventory.parts
    }


def _compute_mass(data: PartData, measured: Sequence[_ElementTotals]) -> float | None:
    """Return the mass of a part [mass]; None if it is unknown."""
    mass = 0.0
    for elements in measured:
        if elements.kind == "spring" and data.section.mass is not None:
            mass += elements.number * data.section.mass
            continue
        density = data.material.density if data.material else None
        depth = _get_depth(elements.kind, data)
        if density is None or depth is None:
            return None
        mass += density * depth * elements.size
    return mass if math.isfinite(mass) and mass > 0 else None


def _compute_step(data: PartData, measured: Sequence[_ElementTotals]) -> float | None:
    """Return the smallest stable time step of a part [time]; None if it is unknown."""
    steps: list[float] = []
    for elements in measured:
        speed = _compute_wave_speed(elements.kind, data.material)
        if speed is None:
            return None
        steps.append(elements.length / speed)
    if all(math.isfinite(step) and step > 0 for step in steps):
        return min(steps)
    return None


def _get_depth(kind: str, data: PartData) -> float | None:
    """Return the factor from element size to volume [length, area or 1]; None if it is unknown."""
    if kind in _SURFACES:
        return data.section.thickness
    if kind in _LINES:
        return data.section.area
    return 1.0 if kind in _VOLUMES else None


def _compute_wave_speed(kind: str, material: Material | None) -> float | None:
    """Return the wave speed in elements of the given kind [length/time]; None if it is unknown."""
    if material is None or material.density is None or material.modulus is None:
        return None
    plain = material.modulus / material.density
    nu = material.poisson or 0.0
    if kind in _LINES:
        return math.sqrt(plain)
    if kind in _SURFACES:
        return math.sqrt(plain / (1 - nu**2)) if nu < 1 else None
    if kind in _VOLUMES and nu < 0.5:
        return math.sqrt(plain * (1 - nu) / ((1 + nu) * (1 - 2 * nu)))
    return None


def compute_sizes_and_lengths(
    kind: str, nodes: Places, coordinates: Reals
) -> tuple[Reals, Reals]:
    """Return the size of each element, and the shortest length that a wave crosses in it; NaN if unknown."""
    pieces = [
        _compute_sizes(kind, nodes[at : at + _PIECE], coordinates)
        for at in range(0, len(nodes), _PIECE)
    ]
    return np.concatenate([size for size, _ in pieces]), np.concatenate(
        [length for _, length in pieces]
    )


def _compute_sizes(kind: str, nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    """Return the size of each element, and the shortest length that a wave crosses in it, both (n,); NaN if unknown."""
    if kind in _LINES:
        length = np.linalg.norm(
            coordinates[nodes[:, 1]] - coordinates[nodes[:, 0]], axis=1
        )
        return length, length
    if kind in _SURFACES:
        return _measure_surfaces(nodes, coordinates)
    if kind in _VOLUMES:
        if kind == "tetrahedron":
            return _measure_tetrahedra(nodes, coordinates)
        return _measure_bricks(nodes, coordinates)
    unknown = np.full(len(nodes), np.nan)
    return unknown, unknown


def _measure_surfaces(nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    """Return the areas of shells, and the shortest lengths that a wave crosses in them."""
    third = nodes[:, 2]
    last = nodes[:, 3] if nodes.shape[1] > 3 else third
    last = np.where(last == NO_NODE, third, last)
    corners = coordinates[np.stack([nodes[:, 0], nodes[:, 1], third, last], axis=1)]
    area = _compute_areas(corners)
    sides = corners - corners[:, [1, 2, 3, 0]]
    longest = np.sqrt(np.einsum("ijk,ijk->ij", sides, sides).max(axis=1))
    return area, np.where(last == third, 2.0, 1.0) * area / longest


def _compute_areas(corners: Reals) -> Reals:
    """Return the areas of quadrilaterals (n, 4, 3): half the cross product of their diagonals."""
    cross = _compute_cross_products(
        corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    )
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", cross, cross)) / 2)


def _compute_cross_products(a: Reals, b: Reals) -> Reals:
    """Return the cross products of vectors (n, 3), several times faster than numpy.cross."""
    next_axis = [1, 2, 0]
    second_axis = [2, 0, 1]
    return np.asarray(
        a[:, next_axis] * b[:, second_axis] - a[:, second_axis] * b[:, next_axis]
    )


def _measure_tetrahedra(nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    """Return the volumes of tetrahedra, and the shortest lengths that a wave crosses in them."""
    corners = coordinates[nodes[:, :4]]
    volume = np.abs(_compute_tetrahedron_volumes(corners, (0, 1, 2, 3)))
    faces = np.stack(
        [
            _compute_areas(corners[:, [*face, face[-1]]])
            for face in ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3))
        ]
    )
    return volume, 3 * volume / faces.max(axis=0)


def _measure_bricks(nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    """Return the volumes of solids, and the shortest wave paths; the nodes of a brick may be repeated or missing."""
    eight = nodes[:, :8].copy()
    for column in range(1, 8):
        eight[:, column] = np.where(
            eight[:, column] == NO_NODE, eight[:, column - 1], eight[:, column]
        )
    corners = coordinates[eight]
    volume = np.abs(sum(_compute_volume_below(corners, face) for face in _FACES))
    faces = np.stack([_compute_areas(corners[:, list(face)]) for face in _FACES])
    is_tetrahedron = (eight[:, 3:8] == eight[:, 3:4]).all(axis=1)
    factor = np.where(is_tetrahedron, 3.0, 1.0)
    return np.asarray(volume), factor * volume / faces.max(axis=0)


def _compute_volume_below(corners: Reals, face: tuple[int, int, int, int]) -> Reals:
    """Return the signed volumes between the first corner and a face, whose sum over all faces is the volume."""
    a, b, c, d = face
    return _compute_tetrahedron_volumes(
        corners, (0, a, b, c)
    ) + _compute_tetrahedron_volumes(corners, (0, a, c, d))


def _compute_tetrahedron_volumes(
    corners: Reals, four: tuple[int, int, int, int]
) -> Reals:
    """Return the signed volumes of the tetrahedra with these corners."""
    a, b, c, d = (corners[:, at] for at in four)
    return np.asarray(
        np.einsum("ij,ij->i", _compute_cross_products(b - a, c - a), d - a) / 6
    )


class PartPosition(NamedTuple):
    """Position, inertia and watched nodes of a part according to the deck.

    ``centre`` (3,) is the centre of mass [length], and ``spread`` (3, 3) contains the second moments divided by the
    mass [length^2]. ``watched`` contains the coordinates of the nodes whose motion is written, keyed by their index in
    the node table.
    """

    centre: Reals
    spread: Reals
    watched: Mapping[int, Reals]


class _PartShare(NamedTuple):
    """Totals over the elements of a part: size, first moments (3,) and second moments (3, 3)."""

    size: float
    first: Reals
    second: Reals


class Placement:
    """Positions of the parts of a deck, computed on request."""

    def __init__(self, inventory: Inventory) -> None:
        self._inventory = inventory

    @cached_property
    def parts(self) -> Mapping[int, PartPosition]:
        """Return the position of each part whose coordinates are known.

        The result is empty if elements may be missing or if the deck moves nodes.
        """
        if self._inventory.moved or not self._inventory.complete:
            return {}
        shares_by_part: dict[int, list[_PartShare]] = {}
        for elements in self._inventory.elements:
            for part, share in _compute_shares(elements, self._inventory.coordinates):
                shares_by_part.setdefault(part, []).append(share)
        placed = (
            (part, _combine_shares(self._inventory, part, shares))
            for part, shares in shares_by_part.items()
        )
        return {
            part: placed_part
            for part, placed_part in placed
            if np.isfinite(placed_part.spread).all()
        }

    def watched_centre(self, parts: Iterable[int]) -> Reals | None:
        """Return the mean position (3,) of the watched nodes of the given parts [length]; each node counts once.

        The result is None if no node is watched.
        """
        coordinates = {
            node: position
            for part in parts
            for node, position in self.parts[part].watched.items()
        }
        return np.mean(list(coordinates.values()), axis=0) if coordinates else None

    def find_watched_nodes(self, parts: Iterable[int]) -> dict[int, Reals]:
        """Return the positions (3,) of the watched nodes of the given parts [length], keyed by node number.

        Nodes whose motion is written in local axes are omitted.
        """
        inventory = self._inventory
        numbers = dict(
            zip(inventory.watched.tolist(), inventory.watched_ids.tolist(), strict=True)
        )
        return {
            numbers[node]: position
            for part in parts
            for node, position in self.parts[part].watched.items()
            if numbers[node] not in inventory.local_ids
        }

    def find_nodes(self, parts: Collection[int]) -> Reals:
        """Return the positions of all element nodes of the given parts, shape (n, 3) [length]."""
        numbers = [
            elements.nodes[np.isin(elements.part, list(parts))].ravel()
            for elements in self._inventory.elements
        ]
        nodes = np.unique(np.concatenate(numbers))
        return np.asarray(self._inventory.coordinates[nodes[nodes != NO_NODE]])

    def hanging_together(self, parts: Collection[int]) -> frozenset[int]:
        """Return the largest group of these parts that is connected by shared nodes."""
        groups = self._inventory.groups(parts)
        return frozenset(max(groups, key=self._inventory.rigid_nodes, default=()))


def _compute_shares(
    elements: Elements, coordinates: Reals
) -> Iterable[tuple[int, _PartShare]]:
    """Return the contribution of the elements of one kind to the position of each part."""
    if elements.nodes.shape[1] == 0:
        return []
    if elements.kind in DISCRETE:
        sizes = np.ones(len(elements.nodes))
    else:
        sizes = compute_sizes_and_lengths(elements.kind, elements.nodes, coordinates)[0]
    middles = _compute_centres(elements.nodes, coordinates)
    parts, part_index = np.unique(elements.part, return_inverse=True)
    total = np.bincount(part_index, sizes)
    # Elements whose size is unknown do not contribute to the position of their part.
    total[total == 0] = np.nan
    first = np.stack(
        [np.bincount(part_index, sizes * axis) for axis in middles.T], axis=1
    )
    # Coordinates are taken relative to the part centre, because rounding far from the origin would lose digits.
    x, y, z = (middles - (first / total[:, np.newaxis])[part_index]).T
    xx, yy, zz, xy, yz, zx = (
        np.bincount(part_index, sizes * a * b)
        for a, b in ((x, x), (y, y), (z, z), (x, y), (y, z), (z, x))
    )
    second = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    return [
        (part, _PartShare(size, first_moment, second_moment))
        for part, size, first_moment, second_moment in zip(
            parts.tolist(),
            total.tolist(),
            first,
            second.transpose(2, 0, 1),
            strict=True,
        )
    ]


def _compute_centres(nodes: Places, coordinates: Reals) -> Reals:
    """Return the mean position of the nodes of each element, shape (n, 3)."""
    if (nodes != NO_NODE).all():
        return np.asarray(
            sum(coordinates[column] for column in nodes.T) / nodes.shape[1]
        )
    is_real = nodes != NO_NODE
    summed = sum(
        np.where(is_node[:, np.newaxis], coordinates[column], 0.0)
        for column, is_node in zip(nodes.T, is_real.T, strict=True)
    )
    return np.asarray(summed / is_real.sum(axis=1)[:, np.newaxis])


def _combine_shares(
    inventory: Inventory, part: int, shares: Sequence[_PartShare]
) -> PartPosition:
    """Combine the contributions of all element kinds to the position of a part."""
    size = sum(share.size for share in shares)
    centre = np.asarray(sum(share.first for share in shares) / size)
    offsets = [(share, share.first / share.size - centre) for share in shares]
    spread = (
        sum(
            share.second + share.size * np.outer(offset, offset)
            for share, offset in offsets
        )
        / size
    )
    # The nodes are in ascending order, so that a bisection can find the watched nodes.
    nodes = inventory.nodes_by_part[part]
    positions = np.minimum(np.searchsorted(nodes, inventory.watched), nodes.size - 1)
    watched_nodes = inventory.watched[nodes[positions] == inventory.watched]
    watched = {node: inventory.coordinates[node] for node in watched_nodes.tolist()}
    return PartPosition(centre, np.asarray(spread), watched)
