"""What ruins a Radioss run with rigid bodies that are switched, without more than a warning of the starter.

Source: the published source of OpenRadioss at bd4557ba7 (kinchk.F, checkrby.F, hm_read_rwall_*.F, lecinv.F), Altair's
public help for /RWALL, /RBODY, /INIVEL and /INIV, and runs computed with OpenRadioss.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import in_rows
from d2rpick.deck.mesh import KINDS, NOT_COUNTED, elements_of, nodes_of
from d2rpick.deck.radioss_deck import Start, Starter, number_of, reals
from d2rpick.deck.radioss_files import AT_REST, NOT_FOLLOWED, THROUGH_WALL, Flaw

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, Field
    from d2rpick.deck.mesh import Integers, Reals
    from d2rpick.deck.radioss_rigid import Body
    from d2rpick.deck.radioss_run import Run

_PENALTY_SINCE: Final = 2026  # version of the format from which on a wall has Iform
_GEOMETRIES: Final = {"CYL", "SPHER", "PLANE", "PARAL"}
_WITH_KIND: Final = {"LAGMUL", "THERM"}  # a wall's geometry may stand behind it


class NodeGroups:
    """Groups of nodes of a starter deck; its mesh is read when a group asks for it."""

    def __init__(self, starter: Starter) -> None:
        self._starter = starter
        self._found: dict[int, frozenset[int] | None] = {0: frozenset()}

    def members(self, group: int) -> frozenset[int] | None:
        """Ids of the nodes of a group; None where they are not known."""
        if group not in self._found:
            self._found[group] = self._members(group)
        return self._found[group]

    def _members(self, group: int) -> frozenset[int] | None:
        known = self._starter.group_members(group)
        if known is None or any(part not in self.by_part for part in known[1]):
            return None
        return frozenset(known[0]).union(
            *(self.by_part[part].tolist() for part in known[1])
        )

    @cached_property
    def by_part(self) -> Mapping[int, Integers]:
        """Ids of nodes by part; a part with particles, which are not followed, is left out."""
        found: dict[int, list[Integers]] = {
            part: [np.empty(0, np.int64)] for part in self._starter.parts
        }
        for card in self._starter.named(*KINDS):
            if card.words[1:]:
                part = found.setdefault(number_of(card), [np.empty(0, np.int64)])
                part += [np.unique(nodes) for _, _, nodes in elements_of(card)]
        unknown = {
            number_of(card)
            for card in self._starter.named(*NOT_COUNTED)
            if card.words[1:]
        }
        joined = {
            part: np.unique(np.concatenate(nodes)) for part, nodes in found.items()
        }
        return {
            part: nodes[nodes > 0]
            for part, nodes in joined.items()
            if part not in unknown
        }

    @cached_property
    def placed(self) -> tuple[Integers, Reals]:
        """Ids of all nodes (n,) and where they lie (n, 3) [length]."""
        return nodes_of(self._starter.named("NODE"))


def flaws_of(run: Run, switched: Collection[int]) -> tuple[Flaw, ...]:
    """Find what ruins a run in which the rigid bodies with these main nodes are switched, or kept off.

    `NOT_FOLLOWED` tells what is not known, and why.
    """
    starter = run.starter
    bodies = (
        [body for body in starter.bodies if body.node.value in switched]
        if starter
        else []
    )
    if starter is None or not bodies or not run.pushed:
        return ()
    if starter.moved:
        why = "ids of a //SUBMODEL may be moved: what its rigid walls and initial velocities do to /RBODY is not known"
        return (Flaw(NOT_FOLLOWED, bodies[0].card.here, why),)
    groups = NodeGroups(starter)
    unknown = [body for body in bodies if groups.members(body.group) is None]
    found = [
        _unknown(body.group, _numbered([body]), body.card.here) for body in unknown
    ]
    found += [
        flaw
        for wall in starter.named("RWALL")
        for flaw in _of_wall(wall, starter, groups, bodies)
    ]
    found += [*_of_starts(run, groups, bodies)]
    if not run.deck.unread:  # else a velocity may stand in what was not read
        found += _of_velocities(run, starter, groups, bodies)
    return tuple(dict.fromkeys(found))


def _unknown(group: int, whose: str, place: Field) -> Flaw:
    told = f"the nodes of group {group} of {whose} are not known: what becomes of those of rigid bodies was not judged"
    return Flaw(NOT_FOLLOWED, place, told)


def _numbered(bodies: Sequence[Body]) -> str:
    return f"/RBODY {', '.join(in_rows(body.id for body in bodies))}"


def _within(body: Body, groups: NodeGroups) -> frozenset[int]:
    return groups.members(body.group) or frozenset()


# Rigid walls.


def _of_wall(
    card: Card, starter: Starter, groups: NodeGroups, bodies: Sequence[Body]
) -> Iterator[Flaw]:
    """Find the bodies whose nodes the starter takes from a wall.

    A body keeps them by its Ikrem; OpenRadioss takes the Ikrem of the /RBODY with the highest id for that of all.
    """
    keeps = max(starter.bodies, key=lambda body: body.id).stays
    bodies = [body for body in bodies if not (body.stays and keeps)]
    rows = card.rows[1:]
    if not bodies or len(rows) < 2:
        return
    node, _, added, left_out, form = (
        card.integer(rows[0], at).value for at in range(5)
    )
    if form > 0 and starter.version >= _PENALTY_SINCE:
        return
    wall = f"/{card.name}"
    for group in (added, left_out):
        if groups.members(group) is None:
            yield _unknown(group, wall, card.here)
    near, without = _near(card, node, starter, groups), groups.members(left_out)
    if near is None:
        yield Flaw(
            NOT_FOLLOWED,
            card.here,
            f"which nodes lie near {wall} is not known: it was not judged by them",
        )
    if without is None:
        return
    nodes = ((groups.members(added) or frozenset()) | (near or frozenset())) - without
    lost = [(body, nodes & _within(body, groups)) for body in bodies]
    owners = [body for body, taken in lost if taken]
    if owners:
        count = len(frozenset[int]().union(*(taken for _, taken in lost)))
        found = f"the starter takes {count} of {len(nodes)} nodes from {wall}, those of {_numbered(owners)}, also while"
        why = "the bodies are off (warning 446): they go through the wall"
        way_out = (
            "give every /RBODY Ikrem 1, and let none be on while it touches the wall"
        )
        yield Flaw(THROUGH_WALL, card.here, f"{found} {why}; {way_out}")


def _near(
    card: Card, node: int, starter: Starter, groups: NodeGroups
) -> frozenset[int] | None:
    """Nodes within the distance of a wall in front of it; None where they are not known."""
    rows = card.rows[1:]
    reach, _, diameter = reals(rows[1], 3)
    if reach == 0:
        return frozenset()
    words = set(card.name.split("/"))
    kind = next(iter(words & _GEOMETRIES), "PLANE" if words & _WITH_KIND else "")
    points = np.array([reals(row, 3) for row in rows[2:5]])
    if not kind or not len(points) or starter.transformed:
        return None
    ids, places = groups.placed
    if node:
        if not (ids == node).any():
            return None
        points[0] = places[ids == node][0]
    with np.errstate(invalid="ignore", over="ignore"):  # of a field that is no number
        distance = _distance(kind, places, points, diameter / 2)
    return (
        None
        if distance is None
        else frozenset(
            ids[(distance >= 0) & (distance <= reach) & (ids != node)].tolist()
        )
    )


def _distance(kind: str, places: Reals, points: Reals, radius: float) -> Reals | None:
    """Distance of nodes (n, 3) in front of a wall; None where it is not given."""
    off = places - points[0]
    if kind == "SPHER":
        return np.asarray(np.linalg.norm(off, axis=1) - radius)
    if len(points) < (3 if kind == "PARAL" else 2):
        return None
    along = points[1:] - points[0]
    normal = np.cross(along[0], along[1]) if kind == "PARAL" else along[0]
    length = float(np.linalg.norm(normal))
    if not length > 0:
        return None
    normal = normal / length
    ahead = off @ normal
    return np.asarray(
        np.linalg.norm(off - np.outer(ahead, normal), axis=1) - radius
        if kind == "CYL"
        else ahead
    )


# Initial velocities.


def _of_velocities(
    run: Run, starter: Starter, groups: NodeGroups, bodies: Sequence[Body]
) -> Iterator[Flaw]:
    """Find the bodies with moving nodes whose main node is in no /INIVEL.

    The starter gives all nodes of a body the velocity of its main node, also where the first leg puts the body off.
    """
    given: list[tuple[Card, int, frozenset[int]]] = []
    for card in starter.named("INIVEL"):
        group, nodes = _moved(card)
        members = nodes or groups.members(group)
        if members is None:
            yield _unknown(group, f"/{card.name}", card.here)
            return
        given.append((card, group, members))
    started = run.legs[0].starts if run.legs else []
    moving = frozenset().union(*(nodes for _, _, nodes in given))
    resting = [body for body in bodies if body.node.value not in moving]
    resting = [
        body
        for body in resting
        if not any(_reached(one, groups, _within(body, groups)) for one in started)
    ]
    for card, group, nodes in given:
        held = [body for body in resting if nodes & _within(body, groups)]
        if held:
            mains = ", ".join(in_rows(body.node.value for body in held))
            found = f"/{card.name} moves nodes of {_numbered(held)}, and no /INIVEL the main node ({mains})"
            why = "the starter gives all nodes of a body the velocity of its main node, also where it is off: they rest"
            yield Flaw(
                AT_REST,
                card.here,
                f"{found}: {why}; move it too" + f" (node group {group})" * bool(group),
            )


def _moved(card: Card) -> tuple[int, frozenset[int]]:
    """Group of nodes of an /INIVEL, or the nodes that it lists; neither where it moves nothing, or later."""
    kind, rows = "".join(card.name.split("/")[1:2]), card.rows[1:]
    if kind == "NODE":
        return 0, frozenset(
            node for row in rows if (node := card.integer(row, 0).value) > 0
        )
    axis = kind == "AXIS"
    if kind == "FVM" or len(rows) < 1 + axis:
        return 0, frozenset()
    speeds, later = reals(rows[axis], 3 + axis), rows[1 + axis : 2 + axis]
    if not any(speeds) or any(
        reals(row, 1)[0] or card.integer(row, 2).value for row in later
    ):
        return 0, frozenset()
    return card.integer(rows[0], 2 if axis else 6).value, frozenset()


def _of_starts(run: Run, groups: NodeGroups, bodies: Sequence[Body]) -> Iterator[Flaw]:
    """Find the bodies that are on in a leg whose /INIV moves their nodes and not their main node."""
    on = {body.node.value for body in bodies if not body.sensor}
    for leg in run.legs:
        for _, rigid, nodes in leg.switched:
            named = {node.value for node in nodes}
            on = on | named if rigid else on - named
        mains = frozenset(body.node.value for body in bodies if body.node.value in on)
        resting = mains - frozenset().union(
            *(_reached(start, groups, mains) for start in leg.starts)
        )
        for start in leg.starts:
            if groups.members(start.group) is None:
                yield _unknown(start.group, f"/{start.card.name}", start.card.here)
            held = [body for body in bodies if body.node.value in resting]
            held = [
                body for body in held if _reached(start, groups, _within(body, groups))
            ]
            if held:
                found = (
                    f"/{start.card.name} moves nodes of {_numbered(held)}, on in leg {leg.number}, "
                    f"not the main node"
                )
                why = "a body that is on has the velocity of its main node, so this gives it none"
                yield Flaw(
                    AT_REST, start.card.here, f"{found}: {why}; move the main node too"
                )


def _reached(start: Start, groups: NodeGroups, nodes: frozenset[int]) -> frozenset[int]:
    """Those of some nodes that an /INIV moves."""
    listed = (
        node
        for node in nodes
        if any(first <= node <= last for first, last in start.ranges)
    )
    return frozenset(listed) | (nodes & (groups.members(start.group) or frozenset()))
