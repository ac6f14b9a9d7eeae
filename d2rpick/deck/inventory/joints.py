"""What holds parts together that share no nodes: welds, nodal rigid bodies, extra nodes and ties of a deck.

While a part is rigid, such a constraint on it must be off: a node cannot obey two (the vendor's keyword data for NRBF
and NCSF of the switching cards; Altair's help on incompatible kinematic conditions).  Parts that it holds together come
apart then, unless they are one rigid body.
"""

from __future__ import annotations

from functools import cache, partial
from itertools import chain
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.deck.constraints import node_sets, read_constraints, read_welds
from d2rpick.deck.inventory.model import NO_NODE, Joint
from d2rpick.deck.radioss.blocks import whole

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.deck.card import Card
    from d2rpick.deck.inventory.model import Places
    from d2rpick.deck.radioss.files import Run
    from d2rpick.deck.radioss.starter import Starter
    from d2rpick.deck.reader import Deck

_PART_ID, _NODE_SET = 3, 4  # SSTYP, MSTYP
# Keywords that hold parts together too, by the first words of their names.
_OTHER_TIES: Final = (
    *("CONSTRAINED_TIED_NODES_FAILURE", "CONSTRAINED_TIE-BREAK", "CONSTRAINED_SPR2", "CONSTRAINED_SPR3"),
    *("CONSTRAINED_INTERPOLATION", "CONSTRAINED_NODE_INTERPOLATION", "CONSTRAINED_LINEAR", "CONSTRAINED_POINTS"),
    *("CONSTRAINED_MULTIPLE_GLOBAL", "CONSTRAINED_SHELL_TO_SOLID", "CONSTRAINED_NODE_SET"),
    *(f"CONSTRAINED_{one}_IN_SOLID" for one in ("BEAM", "SHELL", "SOLID", "LAGRANGE")),
)
# The same of Radioss, by the first word.
_OTHER_OF_RADIOSS: Final = ("RBE2", "RBE3", "RLINK", "MPC")
_CONSTRAINTS: Final = ("CONSTRAINED_NODAL_RIGID_BODY", "CONSTRAINED_EXTRA_NODES")


class Held(NamedTuple):
    """What joins the parts that are named and those that have one of the nodes, by id; ``kind`` is what to call it."""

    kind: str
    nodes: frozenset[int] = frozenset()
    parts: frozenset[int] = frozenset()


class Joints(NamedTuple):
    """Joints that are followed, and names and places of ties of which it is not known which parts they hold.

    ``switched`` are rigid bodies that are there to be switched.
    """

    found: tuple[Held, ...]
    unknown: tuple[str, ...]
    switched: tuple[Held, ...] = ()


def placed(held: Sequence[Held], table: Places) -> tuple[Joint, ...]:
    """Give joints with the places of their nodes in a table of ids; nodes that are not in it are left out."""
    if not held:
        return ()
    ends = np.cumsum([len(one.nodes) for one in held])
    ids = np.fromiter(chain.from_iterable(one.nodes for one in held), np.int64, int(ends[-1]))
    order = np.argsort(table, kind="stable")
    at = np.minimum(np.searchsorted(table, ids, sorter=order), table.size - 1)
    places = np.where(table[order[at]] == ids, order[at], NO_NODE) if table.size else np.full(ids.size, NO_NODE)
    split = np.split(places, ends[:-1])
    return tuple(Joint(one.kind, at[at != NO_NODE], one.parts) for one, at in zip(held, split, strict=True))


def of_ls_dyna(deck: Deck) -> Joints:
    """Collect what joins parts in an LS-DYNA deck; joints of two rigid bodies that may turn are none."""
    found, unknown = [], [_named(card) for name in _OTHER_TIES for card in deck.named(name)]
    constraints = read_constraints(deck) if deck.named(*_CONSTRAINTS) else []
    for one in (*constraints, *read_welds(deck)):
        if one.kind != "joint" and one.nodes:
            found.append(Held(one.kind, one.nodes, frozenset([one.part] if one.part else [])))
        elif one.kind != "joint":
            unknown.append(f"{one.kind} ({one.place.file}:{one.place.line})")
    sets = cache(partial(node_sets, deck))
    for card in deck.named("CONTACT"):
        if card.name.startswith(("CONTACT_TIED", "CONTACT_SPOTWELD")) or "TIEBREAK" in card.name:
            tie = _of_contact(card, sets)
            found += [tie] if tie else []
            unknown += [] if tie else [_named(card)]
    return Joints(tuple(found), tuple(unknown))


def _named(card: Card) -> str:
    return f"*{card.name} ({card.file}:{card.line})"


def _of_contact(card: Card, sets: Callable[[], dict[int, frozenset[int]]]) -> Held | None:
    """Parts that a tied contact of two parts, or of nodes and a part, holds together; None for any other."""
    options = set(card.name.split("_"))
    rows = [row for row in card.rows if not row.blank][int(bool({"ID", "TITLE"} & options)) :]
    if not rows or "MPP" in options:
        return None
    values = [card.integer(rows[0], at) for at in range(4)]
    if any(value.problem for value in values):
        return None
    one, other, kind, main = (value.value for value in values)
    moved = card.transform
    if main != _PART_ID or kind not in (_PART_ID, _NODE_SET):
        return None
    if kind == _PART_ID:
        return Held("tied contact", parts=frozenset({one + moved.part, other + moved.part}))
    nodes = sets().get(one + moved.set_)
    return Held("tied contact", nodes, frozenset({other + moved.part})) if nodes else None


def of_radioss(run: Run, starter: Starter, cards: Sequence[tuple[Card, tuple[str, ...]]]) -> Joints:
    """Collect the tied interfaces (/INTER/TYPE2) of a starter deck whose main surface is one part, and rigid bodies.

    A rigid body that no engine file and no sensor switches is always on, and joins what it has nodes of.  Without
    engine files all are taken for those that are switched.
    """
    surfaces = {whole(words[-1]): card for card, words in cards if words[:2] == ("SURF", "PART") and words[2:]}
    found, switched, unknown = list[Held](), list[Held](), list[str]()
    for card, words in cards:
        interface = words[:2] == ("INTER", "TYPE2")
        tie = _of_interface(card, starter, surfaces) if interface else None
        if tie:
            found.append(tie)
        elif interface or (words and words[0] in _OTHER_OF_RADIOSS):
            unknown.append(f"/{'/'.join(words)} ({card.file}:{card.line})")
    named = {value.value for leg in run.legs for _, _, nodes in leg.switched for value in nodes}
    for body in starter.bodies:
        always = bool(run.legs) and not body.sensor and body.node.value not in named
        members = starter.group_members(body.group)
        if members:
            held = Held("rigid body", frozenset(members[0] | {body.node.value}), frozenset(members[1]))
            (found if always else switched).append(held)
        elif always:
            unknown.append(f"/RBODY/{body.id} ({body.card.file}:{body.card.line})")
    return Joints(tuple(found), tuple(unknown), tuple(switched))


def _of_interface(card: Card, starter: Starter, surfaces: dict[int, Card]) -> Held | None:
    rows = [row for row in card.rows if not row.blank]
    group, surface = (card.integer(rows[1], at).value for at in range(2)) if len(rows) > 1 else (0, 0)
    members = starter.group_members(group)
    main = frozenset(_listed(surfaces[surface]) if surface in surfaces else ())
    if members is None or len(main) != 1:
        return None
    return Held("tied interface", frozenset(members[0]), frozenset(members[1]) | main)


def _listed(card: Card) -> Iterator[int]:
    """Ids below the title of a surface."""
    for row in [row for row in card.rows if not row.blank][1:]:
        yield from (value for at in range(10) if (value := card.integer(row, at).value) > 0)
