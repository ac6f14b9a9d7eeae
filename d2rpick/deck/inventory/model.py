"""What a deck says about its parts: elements by kind and formulation, material, nodes that parts share.

Arrays of elements hold places of nodes in the table of nodes, not their ids; -1 where an element has no further node.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.deck.radioss.flaws import Flaw
    from d2rpick.deck.source import SourceFile

    Places = NDArray[np.int64]
    Reals = NDArray[np.float64]

NO_NODE: Final = -1
_ONE_BODY: Final = 0.75  # share of the nodes of some parts from which on one group of them is the body
_LAYERS: Final = 3  # points through the thickness where the deck does not tell: most shells have 2 to 5
_DENSE: Final = 50_000_000  # up to this id a table of all ids is small enough
DISCRETE: Final = frozenset({"spring", "seatbelt"})  # kinds of elements that are not switched by part


class Formulation(NamedTuple):
    """How the elements of a part are computed: what to call it, and the class by which their cost is known.

    ``cost`` is a key of the weights, or None where nothing is known; ``measured`` tells whether the weight of its
    class was measured for this formulation, or is taken over from one alike.  ``in_plane`` are the integration points
    in each layer of a shell.
    """

    name: str
    cost: str | None
    measured: bool = True
    in_plane: int = 0


@dataclass(frozen=True)
class Material:
    """Name of a material, ``kind`` ("deformable", "rigid", "spring", "airbag", "void"), and what makes its wave speed.

    Numbers are None where the deck does not give them in a way that is followed.
    """

    name: str
    kind: str = "deformable"
    density: float | None = None
    modulus: float | None = None
    poisson: float | None = None


@dataclass(frozen=True)
class Section:
    """Section of a part: formulations by kind of element, thickness of shells, area of beams, damping of springs.

    ``turns`` False: stresses of its solids do not turn with a rigid body.  ``damped`` is None where it is not known;
    ``mass`` is that of one spring, ``layers`` are integration points through the thickness of shells.
    """

    formulations: Mapping[str, Formulation] = field(default_factory=dict)
    thickness: float | None = None
    area: float | None = None
    damped: bool | None = None
    mass: float | None = None
    turns: bool = True
    layers: int | None = None


@dataclass(frozen=True)
class PartData:
    """What the deck says about one part besides its elements."""

    id: int
    title: str
    material: Material | None = None
    section: Section = Section()


@dataclass(frozen=True, eq=False)
class Elements:
    """Elements of one kind: the id of the part, shape (n,), and the places of the nodes, shape (n, nodes)."""

    kind: str
    part: Places
    nodes: Places

    def of(self, part: int) -> Places:
        """Nodes of the elements of a part."""
        return np.asarray(self.nodes[self.part == part])


class Joint(NamedTuple):
    """A weld, tie or nodal rigid body: ``kind`` is what to call it; places of its nodes, and parts that it names."""

    kind: str
    nodes: Places
    parts: frozenset[int]


@dataclass(frozen=True, eq=False)
class Inventory:
    """All parts and elements of a deck; ``solver`` is "ls-dyna" or "radioss".

    ``coordinates`` is (nodes, 3), NaN for a node that the deck does not place.  ``notes`` say what was not followed;
    ``complete`` is False where elements or parts may be missing because of it.  ``joints`` hold parts together that
    share no nodes; ``ties`` do too, but it is not known which.  ``watched`` are the places of nodes whose motion is
    written.  ``moved``: something moves nodes away from the coordinates of the deck.  ``files`` are those of the deck.
    ``history_groups`` are the ids of /THPART: groups of elements that a time history lists among its parts.
    ``kept_off`` are main nodes of rigid bodies that a Radioss run keeps off, ``flaws`` what ruins it because of bodies.
    """

    solver: str
    parts: Mapping[int, PartData]
    elements: tuple[Elements, ...]
    coordinates: Reals
    notes: tuple[str, ...] = ()
    complete: bool = True
    joints: tuple[Joint, ...] = ()
    ties: tuple[str, ...] = ()
    watched: Places = field(default_factory=lambda: np.empty(0, np.int64))
    moved: bool = False
    files: tuple[SourceFile, ...] = ()
    history_groups: frozenset[int] = frozenset()
    kept_off: tuple[int, ...] = ()
    flaws: tuple[Flaw, ...] = ()

    @cached_property
    def counts(self) -> Mapping[int, Counter[str]]:
        """Numbers of elements by part and kind."""
        found: dict[int, Counter[str]] = {}
        for elements in self.elements:
            for part, count in zip(*np.unique(elements.part, return_counts=True), strict=True):
                found.setdefault(int(part), Counter())[elements.kind] += int(count)
        return found

    def formulation(self, part: int, kind: str) -> Formulation:
        """How elements of a kind are computed in a part; without a cost where the deck does not tell."""
        data = self.parts.get(part)
        found = data.section.formulations.get(kind) if data else None
        return found or Formulation(kind, None, measured=False)

    def further_points(self, part: int, kind: str) -> int:
        """Integration points of an element of a part beside those of one layer; of shells alone."""
        data = self.parts.get(part)
        layers = _LAYERS if data is None or data.section.layers is None else data.section.layers
        return self.formulation(part, kind).in_plane * max(layers - 1, 0)

    @cached_property
    def nodes_by_part(self) -> Mapping[int, Places]:
        """Places of the nodes of every part, ascending."""
        found: dict[int, list[Places]] = {}
        for elements in self.elements:
            order = np.argsort(elements.part, kind="stable")
            parts, starts = np.unique(elements.part[order], return_index=True)
            for part, rows in zip(parts.tolist(), np.split(order, starts[1:]), strict=True):
                found.setdefault(part, []).append(_distinct(elements.nodes[rows]))
        joined = {part: _distinct(np.concatenate(pieces)) for part, pieces in found.items()}
        return {part: nodes[nodes != NO_NODE] for part, nodes in joined.items()}

    @cached_property
    def neighbours(self) -> Mapping[int, frozenset[int]]:
        """Parts that share nodes with each part."""
        times = np.zeros(len(self.coordinates), np.int32)
        for nodes in self.nodes_by_part.values():
            times[nodes] += 1
        owners: dict[int, list[int]] = {}
        for part, nodes in self.nodes_by_part.items():
            for node in nodes[times[nodes] > 1].tolist():
                owners.setdefault(node, []).append(part)
        found: dict[int, set[int]] = {part: set() for part in self.nodes_by_part}
        for together in {tuple(parts) for parts in owners.values()}:
            for part in together:
                found[part].update(other for other in together if other != part)
        return {part: frozenset(others) for part, others in found.items()}

    @cached_property
    def joined(self) -> Mapping[int, Mapping[int, frozenset[str]]]:
        """By part the others that welds, ties or nodal rigid bodies join to it, and what these are."""
        wanted = np.zeros(len(self.coordinates), bool)
        for _, nodes, _ in self.joints:
            wanted[nodes] = True
        owners: dict[int, set[int]] = {}
        for part, nodes in self.nodes_by_part.items():
            for node in nodes[wanted[nodes]].tolist():
                owners.setdefault(node, set()).add(part)
        found: dict[int, dict[int, frozenset[str]]] = {}
        for kind, nodes, parts in self.joints:
            together = parts.union(*(owners.get(node, ()) for node in nodes.tolist()))
            for part in together:
                own = found.setdefault(part, {})
                own.update({other: own.get(other, frozenset()) | {kind} for other in together if other != part})
        return found

    def bodies(self, parts: Collection[int]) -> tuple[tuple[int, ...], ...]:
        """Rigid bodies that these parts make: one where most of their nodes hang together, else a body per group.

        The parts of a car with an engine on its mounts are one body; an engine, a battery and wheels alone are several.
        """
        rigid = [part for part in parts if not self._discrete(part)] or parts
        groups = self.groups(rigid)
        largest = max((self.rigid_nodes(group) for group in groups), default=0)
        if len(rigid) > 1 and (len(groups) == 1 or largest >= _ONE_BODY * self.rigid_nodes(rigid)):
            return (tuple(sorted(parts)),)
        return groups

    def _discrete(self, part: int) -> bool:
        """Whether a part has springs alone: these hold no rigid body together, and move with it."""
        return part in self.counts and set(self.counts[part]) <= DISCRETE

    def pieces(self, part: int) -> int:
        """Number of pieces of a part that share no nodes; none without elements."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        nodes = self.nodes_by_part.get(part, np.empty(0, np.int64))
        rows, columns = [np.empty(0, np.int64)], [np.empty(0, np.int64)]
        for one in (elements.of(part) for elements in self.elements):
            at, other = np.nonzero(one != NO_NODE)
            first = np.repeat(one[:, :1], one.shape[1], axis=1)
            rows.append(np.searchsorted(nodes, first[at, other]))
            columns.append(np.searchsorted(nodes, one[at, other]))
        # older versions of scipy take no wider numbers; a part has fewer nodes
        joined = np.concatenate(rows).astype(np.int32), np.concatenate(columns).astype(np.int32)
        links = coo_array((np.ones(joined[0].size, bool), joined), shape=(nodes.size, nodes.size))
        return int(connected_components(links, directed=False, return_labels=False))

    def groups(self, parts: Collection[int]) -> tuple[tuple[int, ...], ...]:
        """Groups of these parts that share nodes or are joined, directly or not."""
        left, found = set(parts), []
        while left:
            waiting, body = [min(left)], set[int]()
            while waiting:
                part = waiting.pop()
                if part in left:
                    left.discard(part)
                    body.add(part)
                    waiting += (self.neighbours.get(part, frozenset()) | self.joined.get(part, {}).keys()) & left
            found.append(tuple(sorted(body)))
        return tuple(sorted(found))

    def rigid_nodes(self, parts: Iterable[int]) -> int:
        """Number of nodes of some parts."""
        return int(np.count_nonzero(self._mask(parts)))

    def elements_within(self, parts: Collection[int]) -> Mapping[int, Counter[str]]:
        """Numbers of elements by part and kind that are rigid once these parts are rigid bodies.

        Radioss puts off every element whose nodes all lie in a body; LS-DYNA puts off those of the parts.
        """
        if self.solver != "radioss":
            return {part: self.counts[part] for part in parts if part in self.counts}
        found: dict[int, Counter[str]] = {}
        for body in self.bodies(parts):
            for part, counts in self._inside(body).items():
                found[part] = found.get(part, Counter()) + counts
        return found

    def _inside(self, parts: Collection[int]) -> Mapping[int, Counter[str]]:
        """Numbers of elements whose nodes all lie in these parts."""
        inside = np.append(self._mask(parts), True)  # the last stands for NO_NODE
        found: dict[int, Counter[str]] = {}
        for elements in self.elements:
            rigid = inside[elements.nodes].all(axis=1)
            for part, count in zip(*np.unique(elements.part[rigid], return_counts=True), strict=True):
                found.setdefault(int(part), Counter())[elements.kind] += int(count)
        return found

    def _mask(self, parts: Iterable[int]) -> NDArray[np.bool_]:
        mask = np.zeros(len(self.coordinates), bool)
        for part in parts:
            mask[self.nodes_by_part.get(part, np.empty(0, np.int64))] = True
        return mask


def _distinct(values: Places) -> Places:
    """Give the distinct values, ascending; by sorting, which is quicker here than by a table of hashes."""
    ordered = np.sort(values, axis=None)
    return ordered[np.append(True, ordered[1:] != ordered[:-1])] if ordered.size else ordered


def places_of(ids: Places, table: Places) -> Places:
    """Places in a table of node ids; ids that it does not have are left out.

    Examples
    --------
    >>> places_of(np.array([7, 9]), np.array([3, 7, 5])).tolist()
    [1]
    """
    order = np.argsort(table, kind="stable")
    at = np.minimum(np.searchsorted(table[order], ids), max(table.size - 1, 0))
    found = order[at] if table.size else order
    return np.asarray(found[table[found] == ids] if table.size else found)


def _used(wanted: Sequence[Places]) -> Places:
    """Node ids that elements have, ascending."""
    highest = max((int(one.max(initial=0)) for one in wanted), default=0)
    if highest > _DENSE:
        used = _distinct(np.concatenate([_distinct(one) for one in wanted]))
        return used[used > 0]
    mask = np.zeros(highest + 1, bool)
    for one in wanted:
        mask[one] = True
    mask[0] = False
    return np.flatnonzero(mask)


def placed(ids: Places, wanted: Sequence[Places]) -> tuple[Places, list[Places]]:
    """Give every node id its place in one table.

    Parameters
    ----------
    ids : array of int, shape (n,)
        Nodes that have coordinates, in the order of these.
    wanted : sequence of arrays
        Node ids of elements, 0 for none.

    Returns
    -------
    table : array of int
        Ids by place: ``ids`` first, then those that elements have beyond them.
    places : list of arrays
        Of the shapes of ``wanted``.
    """
    order = np.argsort(ids, kind="stable")
    known = ids[order]
    used = _used(wanted)
    at = np.minimum(np.searchsorted(known, used), max(known.size - 1, 0))
    absent = used[known[at] != used] if known.size else used
    table = np.concatenate([ids, absent])
    order = np.argsort(table, kind="stable")
    known = table[order]
    dense = known.size and int(known[-1]) <= _DENSE
    if dense:
        lookup = np.full(int(known[-1]) + 1, NO_NODE, np.int64)
        lookup[table[::-1]] = np.arange(table.size)[::-1]
        return table, [lookup[one] for one in wanted]
    places = [
        np.where(one > 0, order[np.minimum(np.searchsorted(known, one), known.size - 1)], NO_NODE)
        if known.size
        else one
        for one in wanted
    ]
    return table, places
