"""Write the rigid bodies that a Radioss deck lacks as cards for its starter deck, one /RBODY per group of parts.

Source: Altair's public help for /RBODY, /GRNOD, /INIVEL and /GRAV, and runs computed with OpenRadioss: gravity and
initial velocities act on a rigid body only through its main node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import DeckError, choose_verb, name_units
from d2rpick.deck import radioss_inventory
from d2rpick.deck.columns import write_list
from d2rpick.deck.geometry import Placement, compute_masses_and_steps
from d2rpick.deck.mesh import read_nodes
from d2rpick.deck.model import DISCRETE, Inventory
from d2rpick.deck.pieces import count_pieces
from d2rpick.deck.radioss_columns import (
    AXIS_GROUP,
    BODY_FLAGS,
    BODY_INERTIA,
    BODY_PRODUCTS,
    GRAVITY,
    ID_LIST,
    NODE,
    RIGID_BODY,
    VELOCITY,
)
from d2rpick.deck.radioss_deck import (
    Starter,
    find_bodies_kept_off,
    get_lines_below_title,
    parse_id,
    read_blocks,
    split_keyword,
)
from d2rpick.deck.radioss_flaws import NodeGroups
from d2rpick.deck.radioss_rigid import Body
from d2rpick.deck.radioss_run import RadiossRun, find_rigid_parts, read_run
from d2rpick.deck.reader import find_cuts
from d2rpick.deck.source import SourceFile

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.columns import CardColumn
    from d2rpick.deck.mesh import Reals
    from d2rpick.deck.radioss_rigid import Body

# Value of Ikrem with which the starter keeps the nodes of a body in rigid walls.
_STAYS: Final = 1
# Column of the node group in the first line below the title, by keyword of the initial velocity.
_GROUP_OF_VELOCITY: Final = dict.fromkeys(
    ("TRA", "ROT", "T+G", "GRID"), VELOCITY["grnod_ID"]
) | {"AXIS": AXIS_GROUP["grnod_ID"]}
_GROUP_OF_GRAVITY: Final = GRAVITY["grnod_ID"]


class SwitchedBodies(NamedTuple):
    """The rigid bodies that switch the given parts, and the cards of those bodies that are new.

    ``nodes`` contains all their main nodes. ``cards`` is the text to be inserted before /END of the starter deck; empty
    if no body is missing. ``notes`` describes these cards. ``sensor`` and all ids above it are free for sensors.
    ``replaced`` contains the main nodes of bodies that have to be removed from the starter deck.
    """

    nodes: tuple[int, ...]
    cards: str = ""
    notes: tuple[str, ...] = ()
    sensor: int = 1
    replaced: tuple[int, ...] = ()


def find_bodies(path: str, parts: Collection[int]) -> SwitchedBodies:
    """Find the rigid bodies of the given parts in a Radioss deck, and write the missing ones.

    A new body has a new main node at the centre of mass of its parts, and all their nodes (/GRNOD/PART). The main node
    is added to the node groups of initial velocities and gravity. Bodies are active by default, so the first engine run
    has to deactivate them.

    Parameters
    ----------
    path : str
        A file of the run.
    parts : collection of int
        Ids of the parts to switch.

    Raises
    ------
    DeckError
        If the deck is not a complete Radioss deck, a part has no elements, or a rigid body of the deck contains some of
        their nodes and cannot switch them.
    """
    run = read_run(path)
    starter = _require_whole_starter(run)
    inventory = radioss_inventory.read_radioss_inventory(run)
    groups = NodeGroups(starter)
    if unknown := sorted(part for part in parts if not _collect_nodes([part], groups)):
        raise DeckError(
            f"{path}: {name_units(unknown)} {choose_verb(unknown)} without elements that can be read; give other parts"
        )
    nodes = list[int]()
    lacking = list[tuple[int, ...]]()
    unused = frozenset(find_bodies_kept_off(run.legs))
    for group in inventory.bodies(parts):
        main_nodes = _find_ready_bodies(starter, inventory, group, groups, unused)
        nodes += main_nodes
        if not main_nodes:
            lacking.append(group)
    new_bodies = _BodyWriter(starter, inventory, groups)
    texts = [new_bodies.body(group) for group in lacking]
    mains = tuple(main for main, _ in texts)
    notes = tuple(
        f"/RBODY with main node {main} is new, for {name_units(group)}{_describe_pieces(inventory, group)}"
        for main, group in zip(mains, lacking, strict=True)
    )
    cards = "".join(text for _, text in texts)
    replaced_bodies = find_replaced_bodies(run, cards)
    notes += tuple(
        f"/RBODY {body.id} ({body.card.at}) is off in the whole run and must be removed: a new body takes its nodes"
        for body in replaced_bodies
    )
    return SwitchedBodies(
        (*nodes, *mains),
        cards,
        notes,
        new_bodies.next("SENSOR"),
        tuple(body.node.value for body in replaced_bodies),
    )


def find_replaced_bodies(run: RadiossRun, cards: str) -> tuple[Body, ...]:
    """Return the bodies that are inactive throughout the run and share nodes with the new bodies in ``cards``.

    A node can belong to only one body, so these bodies have to be removed from the starter deck.
    """
    if run.starter is None or not cards:
        return ()
    added = Starter(blocks=[*read_blocks(SourceFile("the card", cards.encode()))])
    members = [
        group_members
        for body in added.bodies
        if (group_members := added.group_members(body.group))
    ]
    groups = NodeGroups(run.starter)
    unused = frozenset(find_bodies_kept_off(run.legs))
    taken = _collect_nodes({part for _, parts in members for part in parts}, groups)
    return tuple(
        body
        for body in run.starter.bodies
        if _is_unused(body, unused) and _has_nodes(body, groups, taken)
    )


def _is_unused(body: Body, unused: Collection[int]) -> bool:
    """Return True if a body is never rigid; ``unused`` contains main nodes that no engine run activates."""
    return body.node.value in unused and not body.sensor


def _describe_pieces(inventory: Inventory, parts: Sequence[int]) -> str:
    """Return a remark if the rigid body of these parts joins mesh pieces that are not otherwise connected."""
    pieces = count_pieces(inventory, parts)
    if pieces > 1:
        return f"; it joins {pieces} pieces that nothing else connects"
    return ""


def _select_stiff_parts(inventory: Inventory, parts: Collection[int]) -> list[int]:
    """Return the parts that have elements other than springs; if there are none, return all parts."""
    return [
        part for part in parts if not set(inventory.counts.get(part, ())) <= DISCRETE
    ] or list(parts)


def _collect_nodes(parts: Collection[int], groups: NodeGroups) -> frozenset[int]:
    """Return the ids of all nodes of the given parts."""
    return frozenset(
        node
        for part in parts
        for node in groups.by_part.get(part, np.empty(0, np.int64)).tolist()
    )


def _require_whole_starter(run: RadiossRun) -> Starter:
    """Return the starter deck; raise DeckError if it is missing or incomplete.

    Raises
    ------
    DeckError
        If ids, nodes or their positions may be unknown.
    """
    starter = run.starter
    path = run.deck.path
    if starter is None:
        raise DeckError(
            f"{path}: the run has no starter deck (NAME_0000.rad); give a run that has one"
        )
    for include in run.deck.unread:
        raise DeckError(
            f"{include.name.at}: {include.name.text} was not read ({include.reason}), so free ids are unknown; add it"
        )
    for block, sign in find_cuts(run.deck):
        raise DeckError(f"{block.source.name}: {sign} Complete the file first")
    if starter.moved or starter.transformed:
        if starter.moved:
            problem = "ids of a //SUBMODEL may be moved"
        else:
            problem = "/TRANSFORM moves nodes"
        raise DeckError(
            f"{path}: {problem}, which d2rpick does not evaluate; write the /RBODY yourself and give its main node"
        )
    return starter


def _find_ready_bodies(
    starter: Starter,
    inventory: Inventory,
    group: Sequence[int],
    groups: NodeGroups,
    unused: Collection[int],
) -> tuple[int, ...]:
    """Return the main nodes of the bodies in the deck that contain exactly the given parts.

    The result is empty if no body contains any of their nodes, or only bodies that are never rigid, which a new body
    replaces.
    """
    stiff = set(_select_stiff_parts(inventory, group))
    group_nodes = _collect_nodes(stiff, groups)
    touching = [
        body for body in starter.bodies if _has_nodes(body, groups, group_nodes)
    ]
    if not touching:
        return ()
    parts_by_body = find_rigid_parts(
        starter, {body.node.value: body.group for body in touching}
    )
    stiff_by_body = {
        node: set(_select_stiff_parts(inventory, parts))
        for node, parts in parts_by_body.items()
    }
    held_parts = frozenset[int]().union(*stiff_by_body.values())
    if (
        held_parts == stiff
        and all(stiff_by_body.values())
        and not any(body.sensor for body in touching)
    ):
        return tuple(body.node.value for body in touching)
    if all(_is_unused(body, unused) for body in touching):
        return ()
    body = next(
        (
            body
            for body in touching
            if body.sensor or not stiff_by_body[body.node.value] <= stiff
        ),
        touching[0],
    )
    location = f"{body.card.at}: /RBODY {body.id}"
    part_names = name_units(sorted(stiff))
    if body.sensor:
        raise DeckError(
            f"{location} of {part_names} is switched by sensor {body.sensor} already; remove the sensor first"
        )
    raise DeckError(
        f"{location} contains nodes of {part_names}, but not exactly these parts, and a node belongs to one body;"
        " give the parts that it contains, or remove it"
    )


def _has_nodes(body: Body, groups: NodeGroups, nodes: frozenset[int]) -> bool:
    """Return True if a body contains one of these nodes."""
    members = groups.members(body.group)
    if members is None:
        raise DeckError(
            f"{body.card.at}: the nodes of /RBODY {body.id} are unknown; define its group by parts or node ids"
        )
    return body.node.value in nodes or not nodes.isdisjoint(members)


class _BodyWriter:
    """Writes new bodies with ids that no card of the deck uses."""

    def __init__(
        self, starter: Starter, inventory: Inventory, groups: NodeGroups
    ) -> None:
        self._starter, self._inventory, self._groups = starter, inventory, groups
        self._masses = {
            part: mass
            for part, (mass, _) in compute_masses_and_steps(inventory).items()
        }
        self._placed = Placement(inventory).parts
        self._free = {"NODE": int(read_nodes(starter.named("NODE"))[0].max(initial=0))}

    def body(self, parts: Sequence[int]) -> tuple[int, str]:
        """Return the main node of a new rigid body of the given parts, and its cards with velocity and gravity."""
        node = self.next("NODE")
        group = self.next("GRNOD")
        alone = self.next("GRNOD")
        moving = "".join(self._moving(parts, alone))
        x, y, z = self._centre(parts)
        lines = [
            "/NODE",
            NODE.write(node_ID=node, X=f"{x:.12g}", Y=f"{y:.12g}", Z=f"{z:.12g}"),
            f"/GRNOD/PART/{group}",
            "parts to be switched",
            *write_list(ID_LIST, parts),
            f"/RBODY/{self.next('RBODY')}",
            "parts to be switched",
            RIGID_BODY.write(node_ID=node, Mass=0, grnd_ID=group, Ikrem=_STAYS),
            BODY_INERTIA.write(Jxx=0, Jyy=0, Jzz=0),
            BODY_PRODUCTS.write(Jxy=0, Jyz=0, Jxz=0),
            BODY_FLAGS.write(),
        ]
        if moving:
            lines += [
                f"/GRNOD/NODE/{alone}",
                "main node of parts to be switched",
                *write_list(ID_LIST, [node]),
            ]
        return node, "\n".join(lines) + f"\n{moving}"

    def next(self, kind: str) -> int:
        """Return an unused id above all ids of cards of one kind."""
        if kind not in self._free:
            words = (split_keyword(block) for block in self._starter.blocks)
            ids = (
                parse_id(word)
                for first, *further_words in words
                if first == kind
                for word in further_words
            )
            self._free[kind] = max(ids, default=0)
        self._free[kind] += 1
        return self._free[kind]

    def _centre(self, parts: Sequence[int]) -> Reals:
        """Return the centre of mass (3,) of the nodes of parts [length], or their mean position if a mass is unknown.

        The result need not be exact, because the starter corrects it.
        """
        parts = _select_stiff_parts(self._inventory, parts)
        masses = [
            mass
            for part in parts
            if part in self._placed and (mass := self._masses.get(part))
        ]
        if len(masses) < len(parts):
            nodes = np.unique(
                np.concatenate([self._inventory.nodes_by_part[part] for part in parts])
            )
            return np.asarray(self._inventory.coordinates[nodes].mean(axis=0))
        return np.asarray(
            np.average(
                [self._placed[part].centre for part in parts], axis=0, weights=masses
            )
        )

    def _moving(self, parts: Sequence[int], alone: int) -> Iterator[str]:
        """Yield cards that apply the initial velocities and the gravity of the body's nodes to its main node."""
        body_nodes = _collect_nodes(parts, self._groups)
        for card in self._starter.named("INIVEL"):
            column = _GROUP_OF_VELOCITY.get("".join(card.words[1:2]))
            reached = body_nodes & self._reached(card, column)
            if reached and (column is None or reached != body_nodes):
                raise DeckError(
                    f"{card.at}: it does not give all nodes of {name_units(parts)} one velocity, as the starter does"
                    " with a rigid body; write the /RBODY yourself, or use one card for all nodes"
                )
            if reached and column is not None:
                yield self._again(card, column, alone)
        for card in self._starter.named("GRAV"):
            if get_lines_below_title(card) and body_nodes & self._reached(
                card, _GROUP_OF_GRAVITY
            ):
                yield self._again(card, _GROUP_OF_GRAVITY, alone)

    def _reached(self, card: Card, column: CardColumn | None) -> frozenset[int]:
        """Return the nodes of the group whose id is in a column of a card, or the nodes that the card itself lists.

        The result is empty if a card has no group.
        """
        rows = card.rows[1:]
        if column is None:
            return frozenset(card.integer(row, ID_LIST["ID1"]).value for row in rows)
        members = self._groups.members(
            card.integer(rows[0], column).value if rows else 0
        )
        if members is None:
            raise DeckError(
                f"{card.at}: its nodes are unknown; define its group by parts or node ids"
            )
        return members

    def _again(self, card: Card, column: CardColumn, group: int) -> str:
        """Return a copy of a card with a new id and a different node group."""
        title, first, *further_lines = (row.text for row in card.rows)
        at = 1 + (card.words[0] == "INIVEL")
        head = "/".join(
            ["", *card.words[:at], str(self.next(card.words[0])), *card.words[at + 1 :]]
        )
        lines = [head, title, column.put(first, group), *further_lines]
        return "\n".join(lines) + "\n"
