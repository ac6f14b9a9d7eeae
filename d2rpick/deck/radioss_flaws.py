"""Find flaws that ruin a Radioss run with switched rigid bodies although the starter issues at most a warning.

Source: the published source of OpenRadioss at bd4557ba7 (kinchk.F, checkrby.F, hm_read_rwall_*.F, lecinv.F), Altair's
public help for /RWALL, /RBODY, /INIVEL and /INIV, and runs computed with OpenRadioss.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import format_ranges
from d2rpick.deck.mesh import KINDS, NOT_COUNTED, read_elements, read_nodes
from d2rpick.deck.radioss_columns import (
    AXIS_GROUP,
    AXIS_VELOCITY,
    ID_LIST,
    POINT,
    VELOCITY,
    VELOCITY_START,
    WALL,
    WALL_SIZES,
)
from d2rpick.deck.radioss_deck import InitialVelocity, Starter, get_number, read_reals
from d2rpick.deck.radioss_files import AT_REST, NOT_FOLLOWED, THROUGH_WALL, Flaw

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, CardField
    from d2rpick.deck.mesh import Integers, Reals
    from d2rpick.deck.radioss_rigid import Body
    from d2rpick.deck.radioss_run import RadiossRun

_PENALTY_SINCE: Final = 2026  # First input version in which a rigid wall has Iform.
_GEOMETRIES: Final = {"CYL", "SPHER", "PLANE", "PARAL"}
# Words that may precede the geometry in a rigid-wall keyword.
_WITH_KIND: Final = {"LAGMUL", "THERM"}


class NodeGroups:
    """Node groups of a starter deck; its mesh is read on request."""

    def __init__(self, starter: Starter) -> None:
        self._starter = starter
        self._found: dict[int, frozenset[int] | None] = {0: frozenset()}

    def members(self, group: int) -> frozenset[int] | None:
        """Return the node ids of a group; None if they are unknown."""
        if group not in self._found:
            self._found[group] = self._members(group)
        return self._found[group]

    def _members(self, group: int) -> frozenset[int] | None:
        """Find the node ids of a group."""
        nodes_and_parts = self._starter.group_members(group)
        if nodes_and_parts is None or any(
            part not in self.by_part for part in nodes_and_parts[1]
        ):
            return None
        return frozenset(nodes_and_parts[0]).union(
            *(self.by_part[part].tolist() for part in nodes_and_parts[1])
        )

    @cached_property
    def by_part(self) -> Mapping[int, Integers]:
        """Return the node ids by part id, without parts that contain particles, because particles are not read."""
        nodes_by_part: dict[int, list[Integers]] = {
            part: [np.empty(0, np.int64)] for part in self._starter.parts
        }
        for card in self._starter.named(*KINDS):
            if card.words[1:]:
                part = nodes_by_part.setdefault(
                    get_number(card), [np.empty(0, np.int64)]
                )
                part += [np.unique(nodes) for _, _, nodes in read_elements(card)]
        unknown = {
            get_number(card)
            for card in self._starter.named(*NOT_COUNTED)
            if card.words[1:]
        }
        joined_nodes = {
            part: np.unique(np.concatenate(nodes))
            for part, nodes in nodes_by_part.items()
        }
        return {
            part: nodes[nodes > 0]
            for part, nodes in joined_nodes.items()
            if part not in unknown
        }

    @cached_property
    def placed(self) -> tuple[Integers, Reals]:
        """Return ids (n,) and coordinates (n, 3) of all nodes [length]."""
        return read_nodes(self._starter.named("NODE"))


def find_flaws(run: RadiossRun, switched: Collection[int]) -> tuple[Flaw, ...]:
    """Return the flaws of a run in which the rigid bodies with these main nodes are switched or kept inactive.

    The message of a flaw with the code `NOT_FOLLOWED` says what could not be checked, and why.
    """
    starter = run.starter
    if starter:
        bodies = [body for body in starter.bodies if body.node.value in switched]
    else:
        bodies = []
    if starter is None or not bodies or not run.pushed:
        return ()
    if starter.moved:
        why = "a //SUBMODEL may offset ids, so rigid walls and initial velocities of rigid bodies were not checked"
        return (Flaw(NOT_FOLLOWED, bodies[0].card.here, why),)
    groups = NodeGroups(starter)
    unknown = [body for body in bodies if groups.members(body.group) is None]
    flaws = [
        _make_unknown(body.group, _name_bodies([body]), body.card.here)
        for body in unknown
    ]
    flaws += [
        flaw
        for wall in starter.named("RWALL")
        for flaw in _check_wall(wall, starter, groups, bodies)
    ]
    flaws += [*_check_starts(run, groups, bodies)]
    # An include file that was not read may contain a velocity.
    if not run.deck.unread:
        flaws += _check_velocities(run, starter, groups, bodies)
    return tuple(dict.fromkeys(flaws))


def _make_unknown(group: int, whose: str, field: CardField) -> Flaw:
    """Return a flaw that reports that the nodes of a group are unknown."""
    message = f"the nodes of group {group} of {whose} are unknown, so nodes of rigid bodies in it were not checked"
    return Flaw(NOT_FOLLOWED, field, message)


def _name_bodies(bodies: Sequence[Body]) -> str:
    """Return the names of some bodies, joined for a message."""
    return f"/RBODY {', '.join(format_ranges(body.id for body in bodies))}"


def _get_body_nodes(body: Body, groups: NodeGroups) -> frozenset[int]:
    """Return the nodes of a body."""
    return groups.members(body.group) or frozenset()


# The functions below check rigid walls.


def _check_wall(
    card: Card, starter: Starter, groups: NodeGroups, bodies: Sequence[Body]
) -> Iterator[Flaw]:
    """Yield the flaws of a rigid wall: bodies whose nodes the starter removes from the wall.

    With Ikrem 1, the wall keeps the nodes of a body; OpenRadioss applies the Ikrem of the /RBODY with the highest id to
    all bodies.
    """
    keeps = max(starter.bodies, key=lambda body: body.id).stays
    bodies = [body for body in bodies if not (body.stays and keeps)]
    rows = card.rows[1:]
    if not bodies or len(rows) < 2:
        return
    node, _, added, left_out, form = (
        value.value for value in card.numbers(rows[0], WALL)
    )
    if form > 0 and starter.version >= _PENALTY_SINCE:
        return
    wall = f"/{card.name}"
    for group in (added, left_out):
        if groups.members(group) is None:
            yield _make_unknown(group, wall, card.here)
    near = _find_nodes_near_wall(card, node, starter, groups)
    without = groups.members(left_out)
    if near is None:
        yield Flaw(
            NOT_FOLLOWED,
            card.here,
            f"the nodes near {wall} are unknown, so they were not checked",
        )
    if without is None:
        return
    nodes = ((groups.members(added) or frozenset()) | (near or frozenset())) - without
    lost = [(body, nodes & _get_body_nodes(body, groups)) for body in bodies]
    owners = [body for body, taken in lost if taken]
    if owners:
        count = len(frozenset[int]().union(*(taken for _, taken in lost)))
        problem = f"the starter removes {count} of {len(nodes)} nodes from {wall}, those of {_name_bodies(owners)}"
        why = "even while the bodies are off (warning 446), so they go through the wall"
        cure = "give every /RBODY Ikrem 1, and deactivate the body before it touches the wall"
        yield Flaw(THROUGH_WALL, card.here, f"{problem}, {why}; {cure}")


def _find_nodes_near_wall(
    card: Card, node: int, starter: Starter, groups: NodeGroups
) -> frozenset[int] | None:
    """Return the nodes within a given distance in front of a wall; None if they are unknown."""
    rows = card.rows[1:]
    reach, _, diameter = read_reals(rows[1], WALL_SIZES)
    if reach == 0:
        return frozenset()
    words = set(card.name.split("/"))
    kind = next(iter(words & _GEOMETRIES), "PLANE" if words & _WITH_KIND else "")
    points = np.array([read_reals(row, POINT) for row in rows[2:5]])
    if not kind or not len(points) or starter.transformed:
        return None
    ids, coordinates = groups.placed
    if node:
        if not (ids == node).any():
            return None
        points[0] = coordinates[ids == node][0]
    # Fields that are not numbers give NaN, which must not cause numpy warnings.
    with np.errstate(invalid="ignore", over="ignore"):
        distance = _compute_distance(kind, coordinates, points, diameter / 2)
    if distance is None:
        return None
    return frozenset(
        ids[(distance >= 0) & (distance <= reach) & (ids != node)].tolist()
    )


def _compute_distance(
    kind: str, coordinates: Reals, points: Reals, radius: float
) -> Reals | None:
    """Return the distances of nodes (n, 3) from the front of a wall [length]; None if the geometry is incomplete."""
    offsets = coordinates - points[0]
    if kind == "SPHER":
        return np.asarray(np.linalg.norm(offsets, axis=1) - radius)
    if len(points) < (3 if kind == "PARAL" else 2):
        return None
    along = points[1:] - points[0]
    normal = np.cross(along[0], along[1]) if kind == "PARAL" else along[0]
    length = float(np.linalg.norm(normal))
    if not length > 0:
        return None
    normal = normal / length
    ahead = offsets @ normal
    return np.asarray(
        np.linalg.norm(offsets - np.outer(ahead, normal), axis=1) - radius
        if kind == "CYL"
        else ahead
    )


# The functions below check initial velocities.


def _check_velocities(
    run: RadiossRun, starter: Starter, groups: NodeGroups, bodies: Sequence[Body]
) -> Iterator[Flaw]:
    """Yield a flaw for bodies whose nodes have an initial velocity although their main node is not in any /INIVEL.

    The starter gives all nodes of a body the velocity of its main node, even if the first engine run deactivates the
    body.
    """
    velocities: list[tuple[Card, int, frozenset[int]]] = []
    for card in starter.named("INIVEL"):
        group, nodes = _read_moved_nodes(card)
        members = nodes or groups.members(group)
        if members is None:
            yield _make_unknown(group, f"/{card.name}", card.here)
            return
        velocities.append((card, group, members))
    started = run.legs[0].starts if run.legs else []
    moving = frozenset().union(*(nodes for _, _, nodes in velocities))
    resting = [body for body in bodies if body.node.value not in moving]
    resting = [
        body
        for body in resting
        if not any(
            _find_moved_nodes(start, groups, _get_body_nodes(body, groups))
            for start in started
        )
    ]
    for card, group, nodes in velocities:
        held = [body for body in resting if nodes & _get_body_nodes(body, groups)]
        if held:
            mains = ", ".join(format_ranges(body.node.value for body in held))
            problem = f"/{card.name} moves nodes of {_name_bodies(held)}, but no /INIVEL moves the main node ({mains})"
            why = "the starter gives all nodes of a body the velocity of its main node, even if it is off, so they rest"
            yield Flaw(
                AT_REST,
                card.here,
                f"{problem}: {why}; add the main node"
                + f" to node group {group}" * bool(group),
            )


def _read_moved_nodes(card: Card) -> tuple[int, frozenset[int]]:
    """Return the node group or the listed nodes of an /INIVEL card; both are empty if the card moves no nodes."""
    kind = "".join(card.name.split("/")[1:2])
    rows = card.rows[1:]
    if kind == "NODE":
        return 0, frozenset(
            node
            for row in rows
            if (node := card.integer(row, ID_LIST["ID1"]).value) > 0
        )
    axis = kind == "AXIS"
    if kind == "FVM" or len(rows) < 1 + axis:
        return 0, frozenset()
    line = AXIS_VELOCITY if axis else VELOCITY
    speeds = read_reals(rows[axis], [column for column in line if column.kind is float])
    later = rows[1 + axis : 2 + axis]
    if not any(speeds) or any(
        read_reals(row, [VELOCITY_START["Tstart"]])[0]
        or card.integer(row, VELOCITY_START["sens_ID"]).value
        for row in later
    ):
        return 0, frozenset()
    group_line = AXIS_GROUP if axis else VELOCITY
    return card.integer(rows[0], group_line["grnod_ID"]).value, frozenset()


def _check_starts(
    run: RadiossRun, groups: NodeGroups, bodies: Sequence[Body]
) -> Iterator[Flaw]:
    """Yield a flaw for bodies active in an engine run whose /INIV moves their nodes but not their main node."""
    on = {body.node.value for body in bodies if not body.sensor}
    for leg in run.legs:
        for _, rigid, nodes in leg.switched:
            leg_nodes = {node.value for node in nodes}
            on = on | leg_nodes if rigid else on - leg_nodes
        mains = frozenset(body.node.value for body in bodies if body.node.value in on)
        resting = mains - frozenset().union(
            *(_find_moved_nodes(start, groups, mains) for start in leg.starts)
        )
        for start in leg.starts:
            if groups.members(start.group) is None:
                yield _make_unknown(start.group, f"/{start.card.name}", start.card.here)
            held = [body for body in bodies if body.node.value in resting]
            held = [
                body
                for body in held
                if _find_moved_nodes(start, groups, _get_body_nodes(body, groups))
            ]
            if held:
                problem = (
                    f"/{start.card.name} moves nodes of {_name_bodies(held)}, which is on in engine file {leg.number}, "
                    f"but not the main node"
                )
                why = "a body that is on has the velocity of its main node, so it does not move"
                yield Flaw(
                    AT_REST,
                    start.card.here,
                    f"{problem}: {why}; add the main node",
                )


def _find_moved_nodes(
    start: InitialVelocity, groups: NodeGroups, nodes: frozenset[int]
) -> frozenset[int]:
    """Return those of ``nodes`` that an /INIV moves."""
    listed = (
        node
        for node in nodes
        if any(first <= node <= last for first, last in start.ranges)
    )
    return frozenset(listed) | (nodes & (groups.members(start.group) or frozenset()))
