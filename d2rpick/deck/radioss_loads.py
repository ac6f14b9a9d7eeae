"""What acts on the parts of a Radioss deck: gravity, supports, imposed motion, and joints of parts.

Joints hold parts together that share no nodes: ties, and rigid bodies that are always on.  While a part is rigid, they
must be off: a node cannot obey two (Altair's help on incompatible kinematic conditions).

Columns: Altair's public help for /GRAV, /FUNCT, /BCS, /IMPVEL, /IMPDISP, /IMPACC and /INTER/TYPE2.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.deck.model import Boundary, Gravity, Hold, Joint, Joints, ids, plateaus
from d2rpick.deck.radioss_deck import Starter, below_title, blocks, keyword, number_of, reals, whole

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.radioss_run import Run


# The same of Radioss, by the first word.
_OTHER_OF_RADIOSS: Final = ("RBE2", "RBE3", "RLINK", "MPC")
_MOTIONS: Final = ("IMPVEL", "IMPDISP", "IMPACC")
_AXES: Final = "XYZ"
_WIDTH: Final = 10
_TRANSLATIONS, _ROTATIONS = slice(3, 6), slice(7, 10)  # codes of /BCS


def read(run: Run, starter: Starter, cards: Sequence[Card]) -> Boundary:
    """Collect what acts on the model from outside."""
    acting = [card for card in cards if card.words[0] in ("GRAV", "BCS", *_MOTIONS)]
    if starter.moved and acting:
        return Boundary(notes=("ids of a //SUBMODEL may be moved: supports and gravity of the deck are not followed",))
    found = [*_holds(run, starter, acting)]
    found += [*_of_bodies(run, starter, [one for one in found if isinstance(one, Hold)])]
    return Boundary.of(found, [*_gravity(starter, acting, cards)], whole=not run.deck.unread)


def _name(card: Card) -> str:
    return f"/{card.name} ({card.at})"


# Supports and imposed motion.


def _holds(run: Run, starter: Starter, acting: Sequence[Card]) -> Iterator[Hold | str]:
    engine = [source for source in run.deck.sources if source not in starter.sources]
    lifted = any(keyword(block)[:1] == ("BCSR",) for source in engine for block in blocks(source))
    for card in acting:
        words, rows = card.words, below_title(card)
        if words[0] == "GRAV" or not rows:
            continue
        if words[0] == "BCS" and lifted:
            yield f"{_name(card)}: an engine file lifts supports (/BCSR), which is not followed"
        elif words[1:2] == ("FGEO",):
            group = frozenset({card.integer(rows[0], 1).value} - {0})
            nodes = ids({whole(row.text[:_WIDTH]) for row in rows[2:]} - {0})
            yield Hold(_name(card), nodes, group, counts=True)
        else:
            held = _support(card, rows) if words[0] == "BCS" else _motion(card, rows)
            members = starter.group_members(card.integer(rows[0], 2 if words[0] == "BCS" else 4).value)
            if members is None:
                yield f"{_name(card)}: the nodes of its group are not followed"
            elif held:
                yield held._replace(nodes=ids(members[0]), parts=frozenset(members[1]))


def _support(card: Card, rows: Sequence[Row]) -> Hold | None:
    """Give what a /BCS fixes; along the axes of a skew it counts in any case, unless it fixes all."""
    moves, turns = (rows[0].text[at].ljust(3) for at in (_TRANSLATIONS, _ROTATIONS))
    axes = frozenset(axis for axis, code in enumerate(moves) if code == "1")
    if not axes and "1" not in turns:
        return None
    skewed = bool(card.integer(rows[0], 1).value) and 0 < len(axes) < len(_AXES)
    return Hold(_name(card), ids(()), axes=axes, counts=skewed)


def _motion(card: Card, rows: Sequence[Row]) -> Hold:
    """Give the times of an imposed motion; with a sensor, or units of its own, these are all."""
    timed = len(rows) > 1 and not card.integer(rows[0], 3).value and not number_of(card, 2)
    start, stop = reals(rows[1], 4)[2:] if timed else (0.0, 0.0)
    known = np.isfinite([start, stop]).all()
    return Hold(_name(card), ids(()), counts=True, start=start if known else 0.0, end=stop if known and stop else inf)


def _of_bodies(run: Run, starter: Starter, holds: Sequence[Hold]) -> Iterator[Hold]:
    """What holds the main node of a rigid body that is on holds all of its nodes."""
    for body in starter.bodies:
        members = None if body.sensor or body.node.value in run.named else starter.group_members(body.group)
        for one in holds if members else ():
            if members and body.node.value in one.nodes:
                yield one._replace(nodes=ids(members[0]), parts=frozenset(members[1]))


# Gravity.


def _gravity(starter: Starter, acting: Sequence[Card], cards: Sequence[Card]) -> Iterator[Gravity | str]:
    loads = [card for card in acting if card.words[0] == "GRAV" and below_title(card)]
    if not loads:
        return
    functions = dict(_functions(cards))
    units = next((card.rows[2:4] for card in cards if card.words == ("BEGIN",)), ())
    converted = len(units) > 1 and units[0].text.split() != units[1].text.split() and units[1].text.strip() != ""
    for card in loads:
        found = None if converted or number_of(card, 2) else _of_card(card, starter, functions)
        yield found or f"{_name(card)} is not followed: whether gravity acts is seen in the run alone"


def _of_card(card: Card, starter: Starter, functions: Mapping[int, tuple[float, ...]]) -> Gravity | None:
    """Give the values and nodes of a /GRAV, None where they are not known; before its sensor it is off."""
    row = below_title(card)[0]
    function, skew, sensor, group = (card.integer(row, at).value for at in (0, 2, 3, 4))
    scale = reals(row, 5)[4] or 1.0
    values = plateaus(functions.get(function, ()), scale) if function else (scale,)
    members = starter.group_members(group) if group else (set[int](), set[int]())
    direction = row.text[_WIDTH : 2 * _WIDTH].strip().upper() or "Z"
    if not values or not np.isfinite(values).all() or members is None or direction not in _AXES:
        return None
    axis = None if skew else _AXES.index(direction)
    values = (0.0, *values) if sensor else values
    return Gravity(axis, values, ids(members[0]), frozenset(members[1])) if group else Gravity(axis, values)


def _functions(cards: Sequence[Card]) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Ordinates of the functions, none of those that the deck scales."""
    moved = {number_of(card) for card in cards if card.words[0] == "MOVE_FUNCT" and card.words[1:]}
    for card in cards:
        if card.words[0] == "FUNCT" and card.words[1:]:
            number = number_of(card)
            yield number, () if number in moved else tuple(reals(row, 2)[1] for row in below_title(card))


# Joints.


def joints_of(run: Run, starter: Starter, cards: Sequence[Card]) -> Joints:
    """Collect the tied interfaces (/INTER/TYPE2) of a starter deck whose main surface is one part, and rigid bodies.

    A rigid body that no engine file and no sensor switches is always on, and joins what it has nodes of.  Without
    engine files all are taken for those that are switched.
    """
    surfaces = {number_of(card, -1): card for card in cards if card.words[:2] == ("SURF", "PART") and card.words[2:]}
    found, switched, unknown = list[Joint](), list[Joint](), list[str]()
    for card in cards:
        interface = card.words[:2] == ("INTER", "TYPE2")
        tie = _of_interface(card, starter, surfaces) if interface else None
        if tie:
            found.append(tie)
        elif interface or card.words[0] in _OTHER_OF_RADIOSS:
            unknown.append(_name(card))
    for body in starter.bodies:
        always = bool(run.legs) and not body.sensor and body.node.value not in run.named
        members = starter.group_members(body.group)
        if members:
            held = Joint("rigid body", ids(members[0] | {body.node.value}), frozenset(members[1]))
            (found if always else switched).append(held)
        elif always:
            unknown.append(f"/RBODY/{body.id} ({body.card.at})")
    return Joints(tuple(found), tuple(unknown), tuple(switched))


def _of_interface(card: Card, starter: Starter, surfaces: dict[int, Card]) -> Joint | None:
    rows = below_title(card)
    group, surface = (card.integer(rows[0], at).value for at in range(2)) if rows else (0, 0)
    members = starter.group_members(group)
    main = frozenset(_listed(surfaces[surface]) if surface in surfaces else ())
    if members is None or len(main) != 1:
        return None
    return Joint("tied interface", ids(members[0]), frozenset(members[1]) | main)


def _listed(card: Card) -> Iterator[int]:
    """Ids below the title of a surface."""
    for row in below_title(card):
        yield from (value for at in range(10) if (value := card.integer(row, at).value) > 0)
