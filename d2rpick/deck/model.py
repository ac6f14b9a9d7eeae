"""What a deck says about its parts: elements by kind and formulation, material, nodes that parts share.

Arrays of elements hold places of nodes in the table of nodes, not their ids; -1 where an element has no further node.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple, TypeVar

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.graph import reached
from d2rpick.deck.mesh import NO_NODE, Elements, NodeTable, distinct

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.deck.radioss_files import Flaw
    from d2rpick.deck.radioss_run import LeftRigid
    from d2rpick.deck.source import SourceFile

    Places = NDArray[np.int64]
    Reals = NDArray[np.float64]

_LAYERS: Final = 3  # points through the thickness where the deck does not tell: most shells have 2 to 5
SPRING: Final = "spring"
DISCRETE: Final = frozenset(
    {SPRING, "seatbelt"}
)  # kinds of elements that are not switched by part


class Hold(NamedTuple):
    """A support or an imposed motion: what to call it, and whom it holds from ``start`` to ``end`` [time].

    ``nodes`` are ids, or places once it is placed; ``parts`` are held as a whole.  ``axes`` are the global directions
    of translation that it fixes, none where it fixes rotations alone.  ``counts``: whatever these are, since it moves
    what it holds, or fixes it along axes of its own.
    """

    name: str
    nodes: Places
    parts: frozenset[int] = frozenset()
    axes: frozenset[int] = frozenset()
    counts: bool = False
    start: float = 0.0
    end: float = inf


class Gravity(NamedTuple):
    """Gravity along an ``axis``, None where that is one of its own, by the ``values`` that it keeps for a while.

    ``values`` are accelerations [length/time^2].  It acts on ``nodes`` (ids, or places) and ``parts``; None: on all.
    """

    axis: int | None
    values: tuple[float, ...]
    nodes: Places | None = None
    parts: frozenset[int] = frozenset()


class Joint(NamedTuple):
    """A weld, tie or rigid body: ``kind`` is what to call it; its nodes (ids, or places), and parts that it names."""

    kind: str
    nodes: Places
    parts: frozenset[int] = frozenset()


class Joints(NamedTuple):
    """Joints that are followed, and names and places of ties of which it is not known which parts they hold.

    ``switched`` are rigid bodies that are there to be switched.
    """

    found: tuple[Joint, ...]
    unknown: tuple[str, ...]
    switched: tuple[Joint, ...] = ()


class Boundary(NamedTuple):
    """All that a deck has of them; ``gravity`` is None where it is not known.  ``notes`` say what is not followed."""

    holds: tuple[Hold, ...] = ()
    gravity: tuple[Gravity, ...] | None = None
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, holds: Sequence[Hold | str], pulls: Sequence[Gravity | str], *, whole: bool
    ) -> Boundary:
        """Sort what was found from what is not followed; without the ``whole`` of a deck gravity is not known."""
        gravity = tuple(one for one in pulls if isinstance(one, Gravity))
        known = whole and len(gravity) == len(pulls)
        notes = tuple(one for one in (*holds, *pulls) if isinstance(one, str))
        return cls(
            tuple(one for one in holds if isinstance(one, Hold)),
            gravity if known else None,
            notes,
        )

    def placed(self, table: NodeTable) -> Boundary:
        """Give it with the places of its nodes in a table of ids."""
        return Boundary(
            placed(self.holds, table),
            self.gravity and placed(self.gravity, table),
            self.notes,
        )


NO_BOUNDARY: Final = Boundary()


Acting = TypeVar("Acting", Hold, Gravity, Joint)


def placed(acting: Iterable[Acting], table: NodeTable) -> tuple[Acting, ...]:
    """Put places of nodes for their ids; nodes that are not in the table are left out."""
    # The nodes of a joint are never None, which mypy reports for that kind alone.
    return tuple(
        one if one.nodes is None else one._replace(nodes=table.known(one.nodes))  # type: ignore[redundant-expr]
        for one in acting
    )


def ids(numbers: Iterable[int]) -> Places:
    """Give node ids as an array, ascending."""
    return np.array(sorted(numbers), np.int64)


def plateaus(ordinates: Sequence[float], scale: float) -> tuple[float, ...]:
    """Values that a function keeps from one point to the next, by a factor; none where it changes all the time.

    Examples
    --------
    >>> plateaus([0.0, 0.0, 1.0, 1.0], 9.81)
    (0.0, 9.81)
    """
    return tuple(
        sorted({scale * one for one, other in pairwise(ordinates) if one == other})
    )


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


class Material(NamedTuple):
    """Name of a material, ``kind`` ("deformable", "rigid", "spring", "airbag", "void"), and what makes its wave speed.

    Numbers are None where the deck does not give them in a way that is followed.
    """

    name: str
    kind: str = "deformable"
    density: float | None = None
    modulus: float | None = None
    poisson: float | None = None


_NO_FORMULATIONS: Final[Mapping[str, Formulation]] = {}


class Section(NamedTuple):
    """Section of a part: formulations by kind of element, thickness of shells, area of beams, damping of springs.

    ``turns`` False: stresses of its solids do not turn with a rigid body.  ``damped`` is None where it is not known;
    ``mass`` is that of one spring, ``stiffness`` its own along its length where that is constant; ``layers`` are
    integration points through the thickness of shells.
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
    """What the deck says about one part besides its elements; ``unswitchable`` is why it must not be switched."""

    id: int
    title: str
    material: Material | None = None
    section: Section = Section()
    unswitchable: str = ""


@dataclass(frozen=True, eq=False)
class Inventory:
    """All parts and elements of a deck; ``solver`` is "ls-dyna" or "radioss".

    ``coordinates`` is (nodes, 3), NaN for a node that the deck does not place.  ``notes`` say what was not followed;
    ``complete`` is False where elements or parts may be missing because of it.  ``joints`` hold parts together that
    share no nodes; ``ties`` do too, but it is not known which; ``switched`` are rigid bodies that are there to be
    switched.  ``watched`` are the places of nodes whose motion is
    written.  ``moved``: something moves nodes away from the coordinates of the deck.  ``files`` are those of the deck.
    ``history_groups`` are the ids of /THPART: groups of elements that a time history lists among its parts.
    ``kept_off`` are main nodes of rigid bodies that a Radioss run keeps off, ``flaws`` what ruins it because of bodies.
    ``boundary`` is what acts on the model from outside, ``left_rigid`` what stays rigid in a run that switches others.
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
    moved: bool = False
    files: tuple[SourceFile, ...] = ()
    history_groups: frozenset[int] = frozenset()
    kept_off: tuple[int, ...] = ()
    flaws: tuple[Flaw, ...] = ()
    boundary: Boundary = NO_BOUNDARY
    left_rigid: LeftRigid | None = None

    @cached_property
    def counts(self) -> Mapping[int, Counter[str]]:
        """Numbers of elements by part and kind."""
        found: dict[int, Counter[str]] = {}
        for elements in self.elements:
            _count(elements.kind, elements.part, found)
        return found

    def formulation(self, part: int, kind: str) -> Formulation:
        """How elements of a kind are computed in a part; without a cost where the deck does not tell."""
        data = self.parts.get(part)
        found = data.section.formulations.get(kind) if data else None
        return found or Formulation(kind, None, measured=False)

    def further_points(self, part: int, kind: str) -> int:
        """Integration points of an element of a part beside those of one layer; of shells alone."""
        data = self.parts.get(part)
        layers = (
            _LAYERS
            if data is None or data.section.layers is None
            else data.section.layers
        )
        return self.formulation(part, kind).in_plane * max(layers - 1, 0)

    @cached_property
    def nodes_by_part(self) -> Mapping[int, Places]:
        """Places of the nodes of every part, ascending."""
        found: dict[int, list[Places]] = {}
        for elements in self.elements:
            order = np.argsort(elements.part, kind="stable")
            parts, starts = np.unique(elements.part[order], return_index=True)
            for part, rows in zip(
                parts.tolist(), np.split(order, starts[1:]), strict=True
            ):
                found.setdefault(part, []).append(distinct(elements.nodes[rows]))
        joined = {
            part: distinct(np.concatenate(pieces)) for part, pieces in found.items()
        }
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
        """By part the others that welds, ties or rigid bodies join to it, and what these are."""
        holds = (
            one
            for one, whole in zip(self.switched, self.ready, strict=True)
            if not whole
        )
        return self._held_by([*self.joints, *holds])

    @cached_property
    def sprung(self) -> Mapping[int, Mapping[int, frozenset[str]]]:
        """By part the others that springs hold to it, which then move against it."""
        ends = (elements.nodes for elements in self.elements if elements.kind == SPRING)
        return self._held_by(
            [
                Joint(SPRING, nodes[nodes != NO_NODE], frozenset())
                for of in ends
                for nodes in of
            ]
        )

    def _held_by(
        self, joints: Sequence[Joint]
    ) -> Mapping[int, Mapping[int, frozenset[str]]]:
        wanted = np.zeros(len(self.coordinates), bool)
        for _, nodes, _ in joints:
            wanted[nodes] = True
        owners: dict[int, set[int]] = {}
        for part, nodes in self.nodes_by_part.items():
            for node in nodes[wanted[nodes]].tolist():
                owners.setdefault(node, set()).add(part)
        found: dict[int, dict[int, frozenset[str]]] = {}
        for kind, nodes, parts in joints:
            together = parts.union(*(owners.get(node, ()) for node in nodes.tolist()))
            for part in together:
                own = found.setdefault(part, {})
                own.update(
                    {
                        other: own.get(other, frozenset()) | {kind}
                        for other in together
                        if other != part
                    }
                )
        return found

    @cached_property
    def ready(self) -> tuple[frozenset[int], ...]:
        """Parts that lie whole in each of the rigid bodies that are there to be switched, springs left out."""
        found = []
        for _, nodes, parts in self.switched:
            mask = self._mask(parts)
            mask[nodes] = True
            found.append(frozenset(part for part, own in self.nodes_by_part.items()
                                   if not self._discrete(part) and mask[own].all()))  # fmt: skip
        return tuple(found)

    def bodies(self, parts: Collection[int]) -> tuple[tuple[int, ...], ...]:
        """Rigid bodies that these parts make: what springs hold together is one too, what nothing joins never is.

        A car with its engine on mounts is one body; engine, battery and wheels alone are several, as loose wheels are.
        A rigid body that is there to be switched, and has none but these parts, makes one of those that it has;
        parts on springs that it has in different ones stay apart.  Springs go with the body that has all their nodes.
        """
        rigid = {part for part in parts if not self._discrete(part)} or set(parts)
        ready = [body for body in self.ready if body and body <= rigid]
        of = {part: body for body in ready for part in body}

        def linked(part: int) -> Iterable[int]:
            own = of.get(part, frozenset[int]())
            springs = (
                other
                for other in self.sprung.get(part, ())
                if other in own or not (own and other in of)
            )
            return {*self._linked(part), *springs, *own}

        springs = set(parts) - rigid
        return tuple(
            tuple(sorted([*body, *self._within(body, springs)]))
            for body in _together(rigid, linked)
        )

    def _within(self, body: Collection[int], springs: Collection[int]) -> list[int]:
        """Those of some parts of springs whose nodes are all nodes of a body."""
        mask = self._mask(body if springs else ())
        return [part for part in springs if mask[self.nodes_by_part[part]].all()]

    def _discrete(self, part: int) -> bool:
        """Whether a part has springs alone: these hold no rigid body together, and move with it."""
        return part in self.counts and set(self.counts[part]) <= DISCRETE

    def groups(self, parts: Collection[int]) -> tuple[tuple[int, ...], ...]:
        """Groups of these parts that share nodes or are joined, directly or not."""
        return _together(parts, self._linked)

    def _linked(self, part: int) -> Iterable[int]:
        return self.neighbours.get(part, frozenset()) | self.joined.get(part, {}).keys()

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
            _count(
                elements.kind, elements.part[inside[elements.nodes].all(axis=1)], found
            )
        return found

    def _mask(self, parts: Iterable[int]) -> NDArray[np.bool_]:
        mask = np.zeros(len(self.coordinates), bool)
        for part in parts:
            mask[self.nodes_by_part.get(part, np.empty(0, np.int64))] = True
        return mask


def _count(kind: str, parts: Places, counts: dict[int, Counter[str]]) -> None:
    """Add elements of a kind to the counts of their parts."""
    for part, count in zip(
        *(one.tolist() for one in np.unique(parts, return_counts=True)), strict=True
    ):
        counts.setdefault(part, Counter())[kind] += count


def _together(
    parts: Collection[int], linked: Callable[[int], Iterable[int]]
) -> tuple[tuple[int, ...], ...]:
    """Groups of parts that are linked to each other, directly or not."""
    left, found = set(parts), []
    while left:
        body = reached([min(left)], lambda part: left.intersection(linked(part)))
        left.difference_update(body)
        found.append(tuple(sorted(body)))
    return tuple(sorted(found))
