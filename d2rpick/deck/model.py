"""Represent the contents of a deck: elements by kind and formulation, materials, shared nodes, supports and joints.

Element arrays contain the indices of nodes in the node table instead of node ids; -1 stands for a missing node.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import field
from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.graph import find_reachable
from d2rpick.deck.mesh import NO_NODE, Elements, NodeTable, find_distinct

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.deck.radioss_files import Flaw
    from d2rpick.deck.radioss_run import LeftRigid
    from d2rpick.deck.source import SourceFile

    Places = NDArray[np.int64]
    Reals = NDArray[np.float64]

# Assumed number of integration points through the thickness of a shell; most shells have 2 to 5.
_LAYERS: Final = 3
SPRING: Final = "spring"
# Element kinds that stay deformable when their part is made rigid.
DISCRETE: Final = frozenset({SPRING, "seatbelt"})
_NO_FORMULATIONS: Final[Mapping[str, Formulation]] = {}


class Hold(NamedTuple):
    """A support or a prescribed motion: its name, and the nodes and parts held from ``start`` to ``end`` [time].

    ``nodes`` are node ids, or node indices after a call of `placed`. ``parts`` are held as a whole. ``axes`` are the
    fixed global directions of translation; empty if only rotations are fixed. ``counts`` is True if it holds the part
    regardless of the axes, because it prescribes a motion or fixes local axes.
    """

    name: str
    nodes: Places
    parts: frozenset[int] = frozenset()
    axes: frozenset[int] = frozenset()
    counts: bool = False
    start: float = 0.0
    end: float = inf


class Gravity(NamedTuple):
    """Gravity along a global ``axis`` (None: a local axis), with the ``values`` at which its load curve is constant.

    ``values`` are accelerations [length/time^2]. Gravity acts on ``nodes`` (ids or indices) and ``parts``; if they are
    None, it acts on all nodes.
    """

    axis: int | None
    values: tuple[float, ...]
    nodes: Places | None = None
    parts: frozenset[int] = frozenset()


class Joint(NamedTuple):
    """A weld, tie or rigid body (named by ``kind``) with its nodes (ids or indices) and its parts."""

    kind: str
    nodes: Places
    parts: frozenset[int] = frozenset()


class Joints(NamedTuple):
    """Joints between known parts (``found``), and the names of ties whose parts are unknown.

    ``switched`` contains the rigid bodies that the deck defines in order to switch them.
    """

    found: tuple[Joint, ...]
    unknown: tuple[str, ...]
    switched: tuple[Joint, ...] = ()


class Boundary(NamedTuple):
    """Supports, prescribed motions and gravity of a deck; ``gravity`` is None if it is unknown.

    ``notes`` lists the cards that cannot be read.
    """

    holds: tuple[Hold, ...] = ()
    gravity: tuple[Gravity, ...] | None = None
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, holds: Sequence[Hold | str], loads: Sequence[Gravity | str], *, whole: bool
    ) -> Boundary:
        """Separate supports and gravity from notes (strings); gravity is unknown unless the deck is ``whole``."""
        gravity = tuple(load for load in loads if isinstance(load, Gravity))
        is_known = whole and len(gravity) == len(loads)
        notes = tuple(note for note in (*holds, *loads) if isinstance(note, str))
        return cls(
            tuple(hold for hold in holds if isinstance(hold, Hold)),
            gravity if is_known else None,
            notes,
        )

    def placed(self, table: NodeTable) -> Boundary:
        """Return the same supports, motions and gravity with node indices in place of node ids."""
        return Boundary(
            place_nodes(self.holds, table),
            self.gravity and place_nodes(self.gravity, table),
            self.notes,
        )


NO_BOUNDARY: Final = Boundary()


Acting = TypeVar("Acting", Hold, Gravity, Joint)


def place_nodes(acting: Iterable[Acting], table: NodeTable) -> tuple[Acting, ...]:
    """Replace node ids by indices in the table; drop nodes that the table lacks."""
    # The nodes of a joint are never None, which mypy cannot infer for this type.
    return tuple(
        load if load.nodes is None else load._replace(nodes=table.known(load.nodes))  # type: ignore[redundant-expr]
        for load in acting
    )


def make_ids(numbers: Iterable[int]) -> Places:
    """Return node ids as an ascending array."""
    return np.array(sorted(numbers), np.int64)


def find_plateaus(ordinates: Sequence[float], scale: float) -> tuple[float, ...]:
    """Return the values that a curve keeps between two successive points, multiplied by ``scale``.

    The result is empty if the curve is never constant.

    Examples
    --------
    >>> find_plateaus([0.0, 0.0, 1.0, 1.0], 9.81)
    (0.0, 9.81)
    """
    return tuple(
        sorted(
            {
                scale * ordinate
                for ordinate, next_ordinate in pairwise(ordinates)
                if ordinate == next_ordinate
            }
        )
    )


class Formulation(NamedTuple):
    """Formulation of the elements of a part: its name, and the class that determines the cost per element.

    ``cost`` is a key of the weights, or None if it is unknown. ``measured`` is True if the weight was measured for this
    formulation rather than for a similar one. ``in_plane`` is the number of integration points in each layer of a
    shell.
    """

    name: str
    cost: str | None
    measured: bool = True
    in_plane: int = 0


class Material(NamedTuple):
    """A material of a deck: its keyword, its kind, and its elastic constants.

    The fields are its keyword, ``kind`` ("deformable", "rigid", "spring", "airbag" or "void"), and its elastic
    constants.

    Numbers are None if the deck does not define them in a way that can be read.
    """

    name: str
    kind: str = "deformable"
    density: float | None = None
    modulus: float | None = None
    poisson: float | None = None


class Section(NamedTuple):
    """Section of a part: formulation of each element kind, shell thickness, beam area, spring properties.

    ``turns`` is False if the stresses of its solids do not rotate with a rigid body. ``damped`` is True if its springs
    have damping; None if this is unknown. ``mass`` and ``stiffness`` are those of one spring; the stiffness is None if
    it is not constant. ``layers`` is the number of integration points through the shell thickness.
    """

    formulations: Mapping[str, Formulation] = _NO_FORMULATIONS
    thickness: float | None = None
    area: float | None = None
    damped: bool | None = None
    mass: float | None = None
    turns: bool = True
    layers: int | None = None
    stiffness: float | None = None


class PartData(NamedTuple):
    """Data of one part without its elements; ``unswitchable`` is the reason not to switch the part, if any."""

    id: int
    title: str
    material: Material | None = None
    section: Section = Section()
    unswitchable: str = ""


@dataclass(frozen=True, eq=False)
class Inventory:
    """All parts and elements of a deck; ``solver`` is "ls-dyna" or "radioss".

    Attributes
    ----------
    coordinates : array
        Shape (nodes, 3), NaN for a node without coordinates [length].
    notes : tuple of str
        Messages about cards that cannot be read, and about a card that already switches parts; ``complete`` is False if
        elements or parts may be missing.
    joints, switched : tuple of Joint
        Connections between parts that share no nodes, and rigid bodies that the deck defines in order to switch them.
    ties : tuple of str
        Connections between unknown parts.
    watched, watched_ids : array
        Indices of the nodes whose motion the run writes, and their ids in the deck, both of shape (k,).
    local_ids : frozenset of int
        Ids of the nodes whose motion is written in local axes, which may rotate.
    moved : bool
        True if the deck moves nodes away from their coordinates.
    files : tuple of SourceFile
        All files of the deck.
    history_groups : frozenset of int
        Ids of /THPART: element groups that a time history lists among its parts.
    kept_off : tuple of int
        Main nodes of rigid bodies that a Radioss run keeps inactive.
    flaws : tuple of Flaw
        Faults that ruin a run with rigid bodies.
    boundary : Boundary
        Supports, prescribed motions and gravity.
    left_rigid : LeftRigid, optional
        Bodies that remain rigid in a run that switches others.
    """

    solver: str
    parts: Mapping[int, PartData]
    elements: tuple[Elements, ...]
    coordinates: Reals
    notes: tuple[str, ...] = ()
    complete: bool = True
    joints: tuple[Joint, ...] = ()
    switched: tuple[Joint, ...] = ()
    ties: tuple[str, ...] = ()
    watched: Places = field(default_factory=lambda: np.empty(0, np.int64))
    watched_ids: Places = field(default_factory=lambda: np.empty(0, np.int64))
    local_ids: frozenset[int] = frozenset()
    moved: bool = False
    files: tuple[SourceFile, ...] = ()
    history_groups: frozenset[int] = frozenset()
    kept_off: tuple[int, ...] = ()
    flaws: tuple[Flaw, ...] = ()
    boundary: Boundary = NO_BOUNDARY
    left_rigid: LeftRigid | None = None

    @property
    def rigid_parts(self) -> set[int]:
        """Ids of the parts whose material is rigid from the start."""
        return {
            part
            for part, data in self.parts.items()
            if data.material and data.material.kind == "rigid"
        }

    @cached_property
    def counts(self) -> Mapping[int, Counter[str]]:
        """Return the number of elements per part and kind, keyed by part id."""
        counts: dict[int, Counter[str]] = {}
        for elements in self.elements:
            _count_elements(elements.kind, elements.part, counts)
        return counts

    def formulation(self, part: int, kind: str) -> Formulation:
        """Return the element formulation of one kind in a part; its cost is None if the deck does not define it."""
        data = self.parts.get(part)
        formulation = data.section.formulations.get(kind) if data else None
        return formulation or Formulation(kind, None, measured=False)

    def further_points(self, part: int, kind: str) -> int:
        """Return the number of integration points of a shell element in all layers except the first.

        The result is 0 for other elements.
        """
        data = self.parts.get(part)
        if data is None or data.section.layers is None:
            layers = _LAYERS
        else:
            layers = data.section.layers
        return self.formulation(part, kind).in_plane * max(layers - 1, 0)

    @cached_property
    def nodes_by_part(self) -> Mapping[int, Places]:
        """Return the ascending node indices of each part, keyed by part id."""
        pieces_by_part: dict[int, list[Places]] = {}
        for elements in self.elements:
            order = np.argsort(elements.part, kind="stable")
            parts, starts = np.unique(elements.part[order], return_index=True)
            for part, rows in zip(
                parts.tolist(), np.split(order, starts[1:]), strict=True
            ):
                pieces_by_part.setdefault(part, []).append(
                    find_distinct(elements.nodes[rows])
                )
        joined = {
            part: find_distinct(np.concatenate(pieces))
            for part, pieces in pieces_by_part.items()
        }
        return {part: nodes[nodes != NO_NODE] for part, nodes in joined.items()}

    @cached_property
    def neighbours(self) -> Mapping[int, frozenset[int]]:
        """Return the parts that share nodes with each part, keyed by part id."""
        owner_count = np.zeros(len(self.coordinates), np.int32)
        for nodes in self.nodes_by_part.values():
            owner_count[nodes] += 1
        owners: dict[int, list[int]] = {}
        for part, nodes in self.nodes_by_part.items():
            for node in nodes[owner_count[nodes] > 1].tolist():
                owners.setdefault(node, []).append(part)
        neighbours: dict[int, set[int]] = {part: set() for part in self.nodes_by_part}
        for sharing in {tuple(parts) for parts in owners.values()}:
            for part in sharing:
                neighbours[part].update(
                    neighbour for neighbour in sharing if neighbour != part
                )
        return {
            part: frozenset(part_neighbours)
            for part, part_neighbours in neighbours.items()
        }

    @cached_property
    def joined(self) -> Mapping[int, Mapping[int, frozenset[str]]]:
        """Return the parts that joints connect to each part, with the kinds of these joints, keyed by part id."""
        incomplete_bodies = (
            body
            for body, whole in zip(self.switched, self.ready, strict=True)
            if not whole
        )
        return self._held_by([*self.joints, *incomplete_bodies])

    @cached_property
    def sprung(self) -> Mapping[int, Mapping[int, frozenset[str]]]:
        """Return the parts that springs connect to each part (so that they can move relative to it), by part id."""
        ends = (elements.nodes for elements in self.elements if elements.kind == SPRING)
        return self._held_by(
            [
                Joint(SPRING, nodes[nodes != NO_NODE], frozenset())
                for spring_nodes in ends
                for nodes in spring_nodes
            ]
        )

    def _held_by(
        self, joints: Sequence[Joint]
    ) -> Mapping[int, Mapping[int, frozenset[str]]]:
        """Return the parts that the given joints connect to each part, with the kinds of joints, keyed by part id."""
        wanted = np.zeros(len(self.coordinates), bool)
        for _, nodes, _ in joints:
            wanted[nodes] = True
        owners: dict[int, set[int]] = {}
        for part, nodes in self.nodes_by_part.items():
            for node in nodes[wanted[nodes]].tolist():
                owners.setdefault(node, set()).add(part)
        kinds_by_pair: dict[int, dict[int, frozenset[str]]] = {}
        for kind, nodes, parts in joints:
            linked_parts = parts.union(
                *(owners.get(node, ()) for node in nodes.tolist())
            )
            for part in linked_parts:
                part_links = kinds_by_pair.setdefault(part, {})
                part_links.update(
                    {
                        linked_part: part_links.get(linked_part, frozenset()) | {kind}
                        for linked_part in linked_parts
                        if linked_part != part
                    }
                )
        return kinds_by_pair

    @cached_property
    def ready(self) -> tuple[frozenset[int], ...]:
        """Return, for each rigid body in ``switched``, the non-spring parts that belong to it completely."""
        whole_parts = []
        for _, nodes, parts in self.switched:
            mask = self._mask(parts)
            mask[nodes] = True
            whole_parts.append(frozenset(part for part, part_nodes in self.nodes_by_part.items()
                                   if not self._discrete(part) and mask[part_nodes].all()))  # fmt: skip
        return tuple(whole_parts)

    def bodies(self, parts: Collection[int]) -> tuple[tuple[int, ...], ...]:
        """Return the rigid bodies that these parts form; parts connected by nodes, joints or springs form one body.

        A car with its engine on mounts is one body. Engine, battery and wheels alone are several, like loose wheels. If
        all parts of a rigid body of the deck (attribute `switched`) are among these parts, they form one body. Springs
        do not connect parts of two such bodies. A part of springs belongs to the body that contains all its nodes.
        """
        rigid = {part for part in parts if not self._discrete(part)} or set(parts)
        ready = [body for body in self.ready if body and body <= rigid]
        body_of_part = {part: body for body in ready for part in body}

        def linked(part: int) -> Iterable[int]:
            own_body = body_of_part.get(part, frozenset[int]())
            springs = (
                sprung_part
                for sprung_part in self.sprung.get(part, ())
                if sprung_part in own_body
                or not (own_body and sprung_part in body_of_part)
            )
            return {*self._linked(part), *springs, *own_body}

        springs = set(parts) - rigid
        return tuple(
            tuple(sorted([*body, *self._within(body, springs)]))
            for body in _group_linked(rigid, linked)
        )

    def _within(self, body: Collection[int], springs: Collection[int]) -> list[int]:
        """Return the spring parts whose nodes all belong to a body."""
        mask = self._mask(body if springs else ())
        return [part for part in springs if mask[self.nodes_by_part[part]].all()]

    @property
    def springs(self) -> frozenset[int]:
        """Parts that consist only of springs and other discrete elements."""
        return frozenset(
            part for part, kinds in self.counts.items() if {*kinds} <= DISCRETE
        )

    def _discrete(self, part: int) -> bool:
        """Return True if a part consists of springs. Springs do not form a rigid body, but move with one."""
        return part in self.counts and set(self.counts[part]) <= DISCRETE

    def groups(self, parts: Collection[int]) -> tuple[tuple[int, ...], ...]:
        """Return groups of these parts that share nodes or are joined, directly or indirectly."""
        return _group_linked(parts, self._linked)

    def _linked(self, part: int) -> Iterable[int]:
        """Return the parts that share nodes with a part or are joined to it."""
        return self.neighbours.get(part, frozenset()) | self.joined.get(part, {}).keys()

    def rigid_nodes(self, parts: Iterable[int]) -> int:
        """Return the number of nodes of the given parts."""
        return int(np.count_nonzero(self._mask(parts)))

    def elements_within(self, parts: Collection[int]) -> Mapping[int, Counter[str]]:
        """Return the number of elements that are rigid once these parts are rigid bodies, per part id and kind.

        Radioss deactivates every element whose nodes all lie in a body, LS-DYNA the elements of the switched parts.
        """
        if self.solver != "radioss":
            return {part: self.counts[part] for part in parts if part in self.counts}
        counts_by_part: dict[int, Counter[str]] = {}
        for body in self.bodies(parts):
            for part, counts in self._inside(body).items():
                counts_by_part[part] = counts_by_part.get(part, Counter()) + counts
        return counts_by_part

    def _inside(self, parts: Collection[int]) -> Mapping[int, Counter[str]]:
        """Return the number of elements whose nodes all belong to these parts, per part id and kind."""
        # The index NO_NODE is -1 and therefore selects this last entry.
        inside = np.append(self._mask(parts), True)
        counts_by_part: dict[int, Counter[str]] = {}
        for elements in self.elements:
            _count_elements(
                elements.kind,
                elements.part[inside[elements.nodes].all(axis=1)],
                counts_by_part,
            )
        return counts_by_part

    def _mask(self, parts: Iterable[int]) -> NDArray[np.bool_]:
        """Return a mask (nodes,) of the nodes of the given parts."""
        mask = np.zeros(len(self.coordinates), bool)
        for part in parts:
            mask[self.nodes_by_part.get(part, np.empty(0, np.int64))] = True
        return mask


def _count_elements(kind: str, parts: Places, counts: dict[int, Counter[str]]) -> None:
    """Add elements of one kind to the element counts of the parts."""
    for part, count in zip(
        *(values.tolist() for values in np.unique(parts, return_counts=True)),
        strict=True,
    ):
        counts.setdefault(part, Counter())[kind] += count


def _group_linked(
    parts: Collection[int], linked: Callable[[int], Iterable[int]]
) -> tuple[tuple[int, ...], ...]:
    """Return the groups of parts that are linked to each other, directly or indirectly."""
    remaining = set(parts)
    groups = []
    while remaining:
        body = find_reachable(
            [min(remaining)], lambda part: remaining.intersection(linked(part))
        )
        remaining.difference_update(body)
        groups.append(tuple(sorted(body)))
    return tuple(sorted(groups))
