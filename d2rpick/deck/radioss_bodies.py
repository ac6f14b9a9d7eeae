"""The rigid bodies that a Radioss deck lacks: cards for its starter deck, one /RBODY for each group of joined parts.

Source: Altair's public help for /RBODY, /GRNOD, /INIVEL and /GRAV, and runs computed with OpenRadioss: gravity and
initial velocities act on a rigid body only by its main node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import DeckError, are, name_units
from d2rpick.deck import radioss_inventory
from d2rpick.deck.geometry import Placement, masses_and_steps
from d2rpick.deck.mesh import nodes_of
from d2rpick.deck.model import DISCRETE, Inventory
from d2rpick.deck.pieces import pieces_of
from d2rpick.deck.radioss_deck import (
    Starter,
    below_title,
    blocks,
    kept_off,
    keyword,
    whole,
)
from d2rpick.deck.radioss_flaws import NodeGroups
from d2rpick.deck.radioss_rigid import Body
from d2rpick.deck.radioss_run import Run, read_run, rigid_parts
from d2rpick.deck.reader import cuts
from d2rpick.deck.source import SourceFile

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.mesh import Reals
    from d2rpick.deck.radioss_rigid import Body

_PER_LINE: Final = 10
_STAYS: Final = 1  # Ikrem: the starter leaves the nodes in rigid walls
# Where cards that act on a group of nodes name it: columns of 10, in the first line below the title.
_GROUP_OF_VELOCITY: Final = {"TRA": 6, "ROT": 6, "T+G": 6, "GRID": 6, "AXIS": 2}
_GROUP_OF_GRAVITY: Final = 4


class Bodies(NamedTuple):
    """Rigid bodies that switch some parts.

    ``nodes`` are the main nodes of all of them; ``cards`` is what the starter deck lacks, to stand before its /END,
    empty where it has all; ``notes`` say what these cards add.  ``sensor`` and all ids above it are free for sensors.
    ``replaced`` are main nodes of bodies that have to leave the starter deck.
    """

    nodes: tuple[int, ...]
    cards: str = ""
    notes: tuple[str, ...] = ()
    sensor: int = 1
    replaced: tuple[int, ...] = ()


def bodies_for(path: str, parts: Collection[int]) -> Bodies:
    """Find the rigid bodies of some parts in a Radioss deck, and write those that it lacks.

    A new body has a new main node at the centre of mass of its parts and takes all their nodes (/GRNOD/PART).  Initial
    velocities and gravity of groups of nodes get the main node too.  Bodies are on by default: the first leg has to
    put them off.

    Parameters
    ----------
    path : str
        A file of the run.
    parts : collection of int
        Ids of the parts to be switched.

    Raises
    ------
    DeckError
        If the deck is no whole Radioss deck, a part has no elements, or a rigid body of the deck holds some of their
        nodes and cannot switch them.
    """
    run = read_run(path)
    starter = _whole(run)
    inventory = radioss_inventory.read(run)
    groups = NodeGroups(starter)
    if unknown := sorted(part for part in parts if not _nodes([part], groups)):
        raise DeckError(
            f"{path}: {name_units(unknown)} {are(unknown)} without nodes that are followed; name others"
        )
    nodes, lacking = list[int](), list[tuple[int, ...]]()
    unused = frozenset(kept_off(run.legs))
    for group in inventory.bodies(parts):
        there = _ready(starter, inventory, group, groups, unused)
        nodes += there
        if not there:
            lacking.append(group)
    made = _Made(starter, inventory, groups)
    texts = [made.body(group) for group in lacking]
    mains = tuple(main for main, _ in texts)
    notes = tuple(
        f"/RBODY with main node {main} is new, for {name_units(group)}{_apart(inventory, group)}"
        for main, group in zip(mains, lacking, strict=True)
    )
    cards = "".join(text for _, text in texts)
    gone = replaced(run, cards)
    notes += tuple(
        f"/RBODY {body.id}, which every leg of the run keeps off, has to go ({body.card.at}): a new one takes its nodes"
        for body in gone
    )
    return Bodies(
        (*nodes, *mains),
        cards,
        notes,
        made.next("SENSOR"),
        tuple(body.node.value for body in gone),
    )


def replaced(run: Run, cards: str) -> tuple[Body, ...]:
    """Give the bodies of a run that its legs keep off all the time, and whose nodes new bodies in ``cards`` take.

    A node lies in one body, so that these have to leave the starter deck.
    """
    if run.starter is None or not cards:
        return ()
    added = Starter(blocks=[*blocks(SourceFile("the card", cards.encode()))])
    members = [
        known for body in added.bodies if (known := added.group_members(body.group))
    ]
    groups, unused = NodeGroups(run.starter), frozenset(kept_off(run.legs))
    taken = _nodes({part for _, parts in members for part in parts}, groups)
    return tuple(
        body
        for body in run.starter.bodies
        if _is_unused(body, unused) and _touches(body, groups, taken)
    )


def _is_unused(body: Body, unused: Collection[int]) -> bool:
    """Whether a body is never rigid; ``unused`` are the main nodes of those that no leg puts on."""
    return body.node.value in unused and not body.sensor


def _apart(inventory: Inventory, parts: Sequence[int]) -> str:
    pieces = pieces_of(inventory, parts)
    return (
        f"; it keeps {pieces} pieces together that nothing joins" if pieces > 1 else ""
    )


def _stiff(inventory: Inventory, parts: Collection[int]) -> list[int]:
    """Those of some parts that are not springs alone; of springs alone all."""
    return [
        part for part in parts if not set(inventory.counts.get(part, ())) <= DISCRETE
    ] or list(parts)


def _nodes(parts: Collection[int], groups: NodeGroups) -> frozenset[int]:
    return frozenset(
        node
        for part in parts
        for node in groups.by_part.get(part, np.empty(0, np.int64)).tolist()
    )


def _whole(run: Run) -> Starter:
    """Give the starter deck; DeckError where ids, nodes or their places may be unknown."""
    starter, path = run.starter, run.deck.path
    if starter is None:
        raise DeckError(
            f"{path}: the run has no starter deck (NAME_0000.rad); name a run that has one"
        )
    for one in run.deck.unread:
        raise DeckError(
            f"{one.name.at}: {one.name.text} was not read: {one.reason}; its ids may be those of new cards"
        )
    for block, told in cuts(run.deck):
        raise DeckError(f"{block.source.name}: {told} Complete it first")
    if starter.moved or starter.transformed:
        what = (
            "ids of a //SUBMODEL may be moved"
            if starter.moved
            else "/TRANSFORM moves nodes"
        )
        raise DeckError(
            f"{path}: {what}, which is not followed; write the /RBODY by hand, and name its main node"
        )
    return starter


def _ready(
    starter: Starter,
    inventory: Inventory,
    group: Sequence[int],
    groups: NodeGroups,
    unused: Collection[int],
) -> tuple[int, ...]:
    """Main nodes of the bodies of the deck that hold a group of parts.

    None where it has nothing of it in any, or in bodies alone that are never rigid, which a new one replaces.
    """
    stiff = set(_stiff(inventory, group))
    own = _nodes(stiff, groups)
    touching = [body for body in starter.bodies if _touches(body, groups, own)]
    if not touching:
        return ()
    held = rigid_parts(starter, {body.node.value: body.group for body in touching})
    whole = {node: set(_stiff(inventory, parts)) for node, parts in held.items()}
    found = frozenset[int]().union(*whole.values())
    if (
        found == stiff
        and all(whole.values())
        and not any(body.sensor for body in touching)
    ):
        return tuple(body.node.value for body in touching)
    if all(_is_unused(one, unused) for one in touching):
        return ()
    body = next(
        (one for one in touching if one.sensor or not whole[one.node.value] <= stiff),
        touching[0],
    )
    place, who = f"{body.card.at}: /RBODY {body.id}", name_units(sorted(stiff))
    if body.sensor:
        raise DeckError(
            f"{place} of {who} is switched by sensor {body.sensor} already; remove that first"
        )
    raise DeckError(
        f"{place} holds nodes of {who}, but not these parts alone and whole: a node lies in one body;"
        " name the parts that it holds, or remove it"
    )


def _touches(body: Body, groups: NodeGroups, nodes: frozenset[int]) -> bool:
    members = groups.members(body.group)
    if members is None:
        raise DeckError(
            f"{body.card.at}: the nodes of /RBODY {body.id} are not known; name them by parts or numbers"
        )
    return body.node.value in nodes or not nodes.isdisjoint(members)


class _Made:
    """Writes new bodies with ids that no card of the deck has."""

    def __init__(
        self, starter: Starter, inventory: Inventory, groups: NodeGroups
    ) -> None:
        self._starter, self._inventory, self._groups = starter, inventory, groups
        self._masses = {
            part: mass for part, (mass, _) in masses_and_steps(inventory).items()
        }
        self._placed = Placement(inventory).parts
        self._free = {"NODE": int(nodes_of(starter.named("NODE"))[0].max(initial=0))}

    def body(self, parts: Sequence[int]) -> tuple[int, str]:
        """Main node and cards of the body of some parts, with what moves and pulls its main node."""
        node, group, alone = self.next("NODE"), self.next("GRNOD"), self.next("GRNOD")
        moving = "".join(self._moving(parts, alone))
        x, y, z = self._centre(parts)
        text = f"/NODE\n{node:10d}{x:20.12g}{y:20.12g}{z:20.12g}\n"
        rows = (parts[at : at + _PER_LINE] for at in range(0, len(parts), _PER_LINE))
        text += f"/GRNOD/PART/{group}\nparts to be switched\n"
        text += "".join("".join(f"{part:10d}" for part in row) + "\n" for row in rows)
        text += f"/RBODY/{self.next('RBODY')}\nparts to be switched\n"
        text += f"{node:10d}{0:10d}{0:10d}{0:10d}{0:20d}{group:10d}{_STAYS:10d}{0:10d}{0:10d}\n"
        text += 2 * (3 * f"{0:20d}" + "\n") + 3 * f"{0:10d}" + "\n"
        if moving:
            text += f"/GRNOD/NODE/{alone}\nmain node of parts to be switched\n{node:10d}\n{moving}"
        return node, text

    def next(self, kind: str) -> int:
        """Give an id above all that cards of a kind have."""
        if kind not in self._free:
            words = (keyword(block) for block in self._starter.blocks)
            ids = (
                whole(word)
                for first, *others in words
                if first == kind
                for word in others
            )
            self._free[kind] = max(ids, default=0)
        self._free[kind] += 1
        return self._free[kind]

    def _centre(self, parts: Sequence[int]) -> Reals:
        """Centre of mass (3,) [length]; where a mass is not known the mean of the nodes: the starter moves it there."""
        parts = _stiff(self._inventory, parts)
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
        """Give the main node what moves or pulls the nodes of its body."""
        own = _nodes(parts, self._groups)
        for card in self._starter.named("INIVEL"):
            column = _GROUP_OF_VELOCITY.get("".join(card.words[1:2]))
            reached = own & self._reached(card, column)
            if reached and (column is None or reached != own):
                raise DeckError(
                    f"{card.at}: it does not move all nodes of {name_units(parts)} as one body, and the starter gives"
                    " them the velocity of the main node; write the /RBODY by hand, or move all of them by one card"
                )
            if reached and column is not None:
                yield self._again(card, column, alone)
        for card in self._starter.named("GRAV"):
            if below_title(card) and own & self._reached(card, _GROUP_OF_GRAVITY):
                yield self._again(card, _GROUP_OF_GRAVITY, alone)

    def _reached(self, card: Card, column: int | None) -> frozenset[int]:
        """Nodes of the group that a card names in a column, or those that it lists; none of one that acts on all."""
        rows = card.rows[1:]
        if column is None:
            return frozenset(card.integer(row, 0).value for row in rows)
        members = self._groups.members(
            card.integer(rows[0], column).value if rows else 0
        )
        if members is None:
            raise DeckError(
                f"{card.at}: its nodes are not known; name them by parts or numbers"
            )
        return members

    def _again(self, card: Card, column: int, group: int) -> str:
        """Write a card with a new id and another group."""
        title, first, *rest = (row.text for row in card.rows)
        at = 1 + (card.words[0] == "INIVEL")
        head = "/".join(
            ["", *card.words[:at], str(self.next(card.words[0])), *card.words[at + 1 :]]
        )
        before, after = (
            first[: 10 * column].ljust(10 * column),
            first[10 * (column + 1) :],
        )
        return "\n".join([head, title, f"{before}{group:10d}{after}", *rest]) + "\n"
