"""Build rigid bodies as the Radioss starter does: each has a main node, and /MERGE/RBODY merges them.

Source: the published source of OpenRadioss at bd4557ba7 (hm_read_merge.F, hm_rbodies_add_main_node.F90), and runs
computed with it. Bodies of parts were not tested in a run, because the available version of OpenRadioss cannot make
them: their columns are those of the format file (radioss2612, part.cfg), and their order is that of a public version of
the function.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.graph import find_reachable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, Value

    # Kind of the members of a node group, and their ids.
    Group = tuple[str, tuple[int, ...]]

# Kinds of ids in /MERGE/RBODY: a rigid body, a node, a node group, or the body of a part with Irigid.
BODY, NODE, GROUP, OF_PART = 1, 2, 3, 4
# First id of the node groups that d2rpick adds; it is larger than any id in a deck.
MADE_HERE: Final = 10**10


class Body(NamedTuple):
    """A rigid body: its id, main node, sensor and node group; an id of 0 means that there is none.

    ``stays`` is True if the starter keeps its nodes in rigid walls (Ikrem 1, or a sensor). ``part`` is the part from
    which the starter makes the body (Irigid); such a body has no id in the deck.
    """

    id: int
    node: Value[int]
    sensor: int
    group: int
    card: Card
    stays: bool
    part: int = 0

    @property
    def name(self) -> str:
        """Return the name of the body for messages."""
        return f"/RBODY {self.id}" if self.id else f"the rigid body of part {self.part}"


class Merge(NamedTuple):
    """A line of /MERGE/RBODY: the main body and the body merged into it, each with the kind of its id."""

    main_kind: int
    main: int
    kind: int
    other: int


class RigidBodies(NamedTuple):
    """Rigid bodies as the engine uses them.

    ``joined_to`` maps the main node of each merged body, which the engine does not know, to the body that contains it.
    ``groups`` are the node groups that contain merged bodies.
    """

    bodies: tuple[Body, ...]
    joined_to: Mapping[int, Body]
    groups: Mapping[int, Group]


def make_rigid_bodies(
    in_deck: Sequence[Body], merges: Sequence[Merge], last_node: Callable[[], int]
) -> RigidBodies:
    """Return the rigid bodies of a deck as the engine uses them.

    Parameters
    ----------
    in_deck : sequence of Body
        Bodies as written in the deck, followed by the bodies of parts.
    merges : sequence of Merge
        All lines of /MERGE/RBODY.
    last_node : callable
        Function that returns the highest node id; it is called only if a body has no main node.
    """
    bodies = [*_add_main_nodes(in_deck, last_node)]
    if not merges:
        return RigidBodies(tuple(bodies), {}, {})
    by_name = {
        (OF_PART, body.part) if body.part else (BODY, body.id): body for body in bodies
    }
    mains: dict[int, int] = {}
    further_groups: dict[int, list[Group]] = {}
    for merge in merges:
        main = by_name.get((merge.main_kind, merge.main))
        joined = by_name.get((merge.kind, merge.other))
        if main is None:
            continue
        if joined and joined is not main:
            mains[joined.node.value] = main.node.value
        elif merge.kind in (NODE, GROUP):
            group = "GRNOD" if merge.kind == GROUP else "NODE"
            further_groups.setdefault(main.node.value, []).append(
                (group, (merge.other,))
            )

    def find_top(node: int) -> int:
        return find_reachable(
            [node],
            lambda node_above: [mains[node_above]] if node_above in mains else [],
        )[-1]

    members: dict[int, list[Group]] = {}
    for body in bodies:
        own_group = [("GRNOD", (body.group,))] if body.group else []
        members.setdefault(find_top(body.node.value), []).extend(
            [*own_group, *further_groups.get(body.node.value, ())]
        )
    groups: dict[int, Group] = {}
    by_node: dict[int, Body] = {}
    for body in bodies:
        node = body.node.value
        if node not in mains:
            by_node[node] = body._replace(group=_join_groups(members[node], groups))
    joined_to = {
        node: by_node[find_top(node)] for node in mains if find_top(node) in by_node
    }
    return RigidBodies(tuple(by_node.values()), joined_to, groups)


def _add_main_nodes(
    in_deck: Sequence[Body], last_node: Callable[[], int]
) -> Iterator[Body]:
    """Yield the bodies with their main nodes, some of which the starter creates.

    The ids of the added nodes follow the highest node id, in the order of the body ids. The bodies of parts come last,
    in the order of the parts in the deck, because their ids are higher than all others.
    """
    lacking = sorted(
        (body for body in in_deck if not body.node.value),
        key=lambda body: (bool(body.part), body.id),
    )
    first = last_node() + 1 if lacking else 0
    numbers = {body: number for number, body in enumerate(lacking, start=first)}
    for body in in_deck:
        number = numbers.get(body)
        yield (
            body if number is None else body._replace(node=body.node.change_to(number))
        )


def _join_groups(members: Sequence[Group], groups: dict[int, Group]) -> int:
    """Return the id of a node group that contains all members; if there is none, add one to ``groups``."""
    if not members:
        return 0
    if len(members) == 1 and members[0][0] == "GRNOD":
        return members[0][1][0]
    ids: list[int] = []
    for kind, numbers in members:
        if kind == "NODE":
            ids.append(_add_group((kind, numbers), groups))
        else:
            ids += numbers
    return _add_group(("GRNOD", tuple(ids)), groups)


def _add_group(group: Group, groups: dict[int, Group]) -> int:
    """Add a node group under an unused id above `MADE_HERE`, and return this id."""
    number = 2 * MADE_HERE + len(groups)
    groups[number] = group
    return number
