"""Sizes of elements, and what follows for parts: mass, smallest stable time step, where they lie.

The step is that in which a wave crosses an element, before any factor of the solver: L/c with c^2 = E/rho for beams,
E/(rho (1 - nu^2)) for shells and E (1 - nu)/(rho (1 + nu)(1 - 2 nu)) for solids.  L is the length of a beam, the area
of a shell over its longest side (twice that for a triangle), the volume of a solid over its largest face (three times
that for a tetrahedron).  Solvers add mass, scale the step or take that of the nodes, so the real one may differ by
some ten percent.

The mass of a part is spread evenly over its elements, each of which counts as a point at the mean of its nodes.
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

_PIECE: Final = 1 << 14
# Corners of a brick, seen from outside.
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


class _Measured(NamedTuple):
    """Elements of one kind in one part: how many, their size together, and the smallest length a wave crosses."""

    kind: str
    number: int
    size: float
    length: float


def masses_and_steps(
    inventory: Inventory,
) -> dict[int, tuple[float | None, float | None]]:
    """Mass by density and size [mass] and smallest stable step [time] of every part that has elements.

    None where the deck does not give the density, modulus, thickness or place of every element of the part.
    """
    measured: dict[int, list[_Measured]] = {}
    for elements in inventory.elements:
        sizes, lengths = sizes_and_lengths(
            elements.kind, elements.nodes, inventory.coordinates
        )
        order = np.argsort(elements.part, kind="stable")
        parts, starts, counts = np.unique(
            elements.part[order], return_index=True, return_counts=True
        )
        sums, lows = (
            np.add.reduceat(sizes[order], starts),
            np.minimum.reduceat(lengths[order], starts),
        )
        for part, *values in zip(
            *(a.tolist() for a in (parts, counts, sums, lows)), strict=True
        ):
            measured.setdefault(part, []).append(_Measured(elements.kind, *values))
    return {
        part: (_mass(inventory.parts[part], found), _step(inventory.parts[part], found))
        for part, found in measured.items()
        if part in inventory.parts
    }


def _mass(data: PartData, measured: Sequence[_Measured]) -> float | None:
    mass = 0.0
    for one in measured:
        if one.kind == "spring" and data.section.mass is not None:
            mass += one.number * data.section.mass
            continue
        density, depth = (
            data.material.density if data.material else None,
            _depth(one.kind, data),
        )
        if density is None or depth is None:
            return None
        mass += density * depth * one.size
    return mass if math.isfinite(mass) and mass > 0 else None


def _step(data: PartData, measured: Sequence[_Measured]) -> float | None:
    steps: list[float] = []
    for one in measured:
        speed = _wave_speed(one.kind, data.material)
        if speed is None:
            return None
        steps.append(one.length / speed)
    return (
        min(steps) if all(math.isfinite(step) and step > 0 for step in steps) else None
    )


def _depth(kind: str, data: PartData) -> float | None:
    """What a size is multiplied by to be a volume [length, area or 1]; None where it is not known."""
    if kind in _SURFACES:
        return data.section.thickness
    return data.section.area if kind in _LINES else 1.0 if kind in _VOLUMES else None


def _wave_speed(kind: str, material: Material | None) -> float | None:
    if material is None or material.density is None or material.modulus is None:
        return None
    plain, nu = material.modulus / material.density, material.poisson or 0.0
    if kind in _LINES:
        return math.sqrt(plain)
    if kind in _SURFACES:
        return math.sqrt(plain / (1 - nu**2)) if nu < 1 else None
    if kind in _VOLUMES and nu < 0.5:
        return math.sqrt(plain * (1 - nu) / ((1 + nu) * (1 - 2 * nu)))
    return None


def sizes_and_lengths(
    kind: str, nodes: Places, coordinates: Reals
) -> tuple[Reals, Reals]:
    """Size of each element [length, area or volume], and the length that a wave has to cross; NaN where unknown."""
    # so many at once that they stay in the processor's cache
    pieces = [
        _sizes(kind, nodes[at : at + _PIECE], coordinates)
        for at in range(0, len(nodes), _PIECE)
    ]
    return np.concatenate([size for size, _ in pieces]), np.concatenate(
        [length for _, length in pieces]
    )


def _sizes(kind: str, nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    """Length, area or volume of elements, and the length that a wave has to cross; both (n,), NaN where unknown."""
    if kind in _LINES:
        length = np.linalg.norm(
            coordinates[nodes[:, 1]] - coordinates[nodes[:, 0]], axis=1
        )
        return length, length
    if kind in _SURFACES:
        return _surfaces(nodes, coordinates)
    if kind in _VOLUMES:
        return (
            _tetrahedra(nodes, coordinates)
            if kind == "tetrahedron"
            else _bricks(nodes, coordinates)
        )
    unknown = np.full(len(nodes), np.nan)
    return unknown, unknown


def _surfaces(nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    third = nodes[:, 2]
    last = nodes[:, 3] if nodes.shape[1] > 3 else third
    last = np.where(last == NO_NODE, third, last)
    corners = coordinates[np.stack([nodes[:, 0], nodes[:, 1], third, last], axis=1)]
    area = _area(corners)
    sides = corners - corners[:, [1, 2, 3, 0]]
    longest = np.sqrt(np.einsum("ijk,ijk->ij", sides, sides).max(axis=1))
    return area, np.where(last == third, 2.0, 1.0) * area / longest


def _area(corners: Reals) -> Reals:
    """Areas of quadrilaterals, (n, 4, 3), half the product of their diagonals."""
    cross = _cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", cross, cross)) / 2)


def _cross(a: Reals, b: Reals) -> Reals:
    """Vector products, (n, 3); numpy's own is slower by a factor."""
    turned, again = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[:, turned] * b[:, again] - a[:, again] * b[:, turned])


def _tetrahedra(nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    corners = coordinates[nodes[:, :4]]
    volume = np.abs(_sixth(corners, (0, 1, 2, 3)))
    faces = np.stack(
        [
            _area(corners[:, [*face, face[-1]]])
            for face in ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3))
        ]
    )
    return volume, 3 * volume / faces.max(axis=0)


def _bricks(nodes: Places, coordinates: Reals) -> tuple[Reals, Reals]:
    """Bricks, wedges and tetrahedra that repeat a node, or leave the last ones out."""
    eight = nodes[:, :8].copy()
    for column in range(1, 8):
        eight[:, column] = np.where(
            eight[:, column] == NO_NODE, eight[:, column - 1], eight[:, column]
        )
    corners = coordinates[eight]
    volume = np.abs(sum(_below(corners, face) for face in _FACES))
    faces = np.stack([_area(corners[:, list(face)]) for face in _FACES])
    is_tetrahedron = (eight[:, 3:8] == eight[:, 3:4]).all(axis=1)
    factor = np.where(is_tetrahedron, 3.0, 1.0)
    return np.asarray(volume), factor * volume / faces.max(axis=0)


def _below(corners: Reals, face: tuple[int, int, int, int]) -> Reals:
    """Volumes between the first corner and a face, with sign: together those of the brick, also where nodes repeat."""
    a, b, c, d = face
    return _sixth(corners, (0, a, b, c)) + _sixth(corners, (0, a, c, d))


def _sixth(corners: Reals, four: tuple[int, int, int, int]) -> Reals:
    """Volumes of tetrahedra with these corners, with sign."""
    a, b, c, d = (corners[:, at] for at in four)
    return np.asarray(np.einsum("ij,ij->i", _cross(b - a, c - a), d - a) / 6)


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
        placed = (
            (part, _placed(self._inventory, part, shares))
            for part, shares in found.items()
        )
        return {part: one for part, one in placed if np.isfinite(one.spread).all()}

    def watched_centre(self, parts: Iterable[int]) -> Reals | None:
        """Mean of the watched nodes of some parts (3,) [length], each node once; None without any."""
        places = {
            place: where
            for part in parts
            for place, where in self.parts[part].watched.items()
        }
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
    total[total == 0] = (
        np.nan
    )  # elements without any size do not tell where their part is
    first = np.stack([np.bincount(at, sizes * axis) for axis in middles.T], axis=1)
    x, y, z = (
        middles - (first / total[:, np.newaxis])[at]
    ).T  # from there: far from the origin digits would be lost
    xx, yy, zz, xy, yz, zx = (
        np.bincount(at, sizes * a * b)
        for a, b in ((x, x), (y, y), (z, z), (x, y), (y, z), (z, x))
    )
    second = np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])
    return [
        (part, _Share(size, one, other))
        for part, size, one, other in zip(
            parts.tolist(),
            total.tolist(),
            first,
            second.transpose(2, 0, 1),
            strict=True,
        )
    ]


def _middles(nodes: Places, coordinates: Reals) -> Reals:
    """Mean of the nodes of each element (n, 3)."""
    if (nodes != NO_NODE).all():
        return np.asarray(
            sum(coordinates[column] for column in nodes.T) / nodes.shape[1]
        )
    real = nodes != NO_NODE
    summed = sum(
        np.where(there[:, np.newaxis], coordinates[column], 0.0)
        for column, there in zip(nodes.T, real.T, strict=True)
    )
    return np.asarray(summed / real.sum(axis=1)[:, np.newaxis])


def _placed(inventory: Inventory, part: int, shares: Sequence[_Share]) -> Placed:
    size = sum(one.size for one in shares)
    centre = np.asarray(sum(one.first for one in shares) / size)
    apart = [(one, one.first / one.size - centre) for one in shares]
    spread = (
        sum(one.second + one.size * np.outer(way, way) for one, way in apart) / size
    )
    nodes = inventory.nodes_by_part[
        part
    ]  # ascending, and many more than those that are watched
    at = np.minimum(np.searchsorted(nodes, inventory.watched), nodes.size - 1)
    own = inventory.watched[nodes[at] == inventory.watched]
    watched = {place: inventory.coordinates[place] for place in own.tolist()}
    return Placed(centre, np.asarray(spread), watched)
