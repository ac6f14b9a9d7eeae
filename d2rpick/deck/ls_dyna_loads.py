"""What acts on the parts of an LS-DYNA deck: gravity, supports, prescribed motion, and joints of parts.

Joints hold parts together that share no nodes: welds, nodal rigid bodies, extra nodes and ties.  While a part is rigid,
such a constraint on it must be off: a node cannot obey two (the vendor's keyword data for NRBF and NCSF of the
switching cards).  Parts that it holds together come apart then, unless they are one rigid body.

Columns: the vendor's keyword data as published in its Python library, and Altair's public help on these keywords.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.deck.ls_dyna_parts import (
    Parts,
    material_of,
    nodes_of_set,
    read_constraints,
    rigid_materials,
)
from d2rpick.deck.mesh import layout, lines_of
from d2rpick.deck.model import Boundary, Gravity, Hold, Joint, Joints, ids, plateaus

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.mesh import Reals
    from d2rpick.deck.model import Places
    from d2rpick.deck.reader import Deck

_PART_ID, _NODE_SET = 3, 4  # SSTYP, MSTYP
# Keywords that hold parts together too, by the first words of their names.
_OTHER_TIES: Final = (
    *(
        "CONSTRAINED_TIED_NODES_FAILURE",
        "CONSTRAINED_TIE-BREAK",
        "CONSTRAINED_SPR2",
        "CONSTRAINED_SPR3",
    ),
    *(
        "CONSTRAINED_INTERPOLATION",
        "CONSTRAINED_NODE_INTERPOLATION",
        "CONSTRAINED_LINEAR",
        "CONSTRAINED_POINTS",
    ),
    *(
        "CONSTRAINED_MULTIPLE_GLOBAL",
        "CONSTRAINED_SHELL_TO_SOLID",
        "CONSTRAINED_NODE_SET",
    ),
    *(f"CONSTRAINED_{one}_IN_SOLID" for one in ("BEAM", "SHELL", "SOLID", "LAGRANGE")),
)
# Directions that a code of *NODE, *MAT_RIGID and *CONSTRAINED_GLOBAL fixes.
CODES: Final = ((), (0,), (1,), (2,), (0, 1), (1, 2), (2, 0), (0, 1, 2))
_ALONG: Final = {f"LOAD_BODY_{letter}": axis for axis, letter in enumerate("XYZ")}
_MOTION, _SPC = "BOUNDARY_PRESCRIBED_MOTION", "BOUNDARY_SPC"
_SYMMETRY: Final = "BOUNDARY_SPC_SYMMETRY_PLANE"
_OWN_CENTRE: Final = (9, 10, 11)  # DOF with a second line
_RELATIVE: Final = 4  # VAD with a second line
_POINT: Final = layout(20, 20)  # of a curve
_FLAT: Final = (
    1e-4  # of the size of the model: nodes on the plane of a *CONSTRAINED_GLOBAL
)


def read(deck: Deck, parts: Parts, nodes: tuple[Places, Reals, Places]) -> Boundary:
    """Collect what acts on the model from outside; ``nodes`` are ids, coordinates and codes of translation."""
    numbers, places, codes = nodes
    found = [
        *_supports(deck),
        *_motions(deck),
        *_of_nodes(numbers, codes),
        *_of_materials(deck, parts),
    ]
    found += [
        _of_plane(card, numbers, places) for card in deck.named("CONSTRAINED_GLOBAL")
    ]
    return Boundary.of(
        found, [*_gravity(deck, parts)], whole=not deck.unread and not deck.encrypted
    )


def _name(card: Card) -> str:
    return f"*{card.name} ({card.at})"


def _not_followed(card: Card) -> str:
    return f"{_name(card)}: the nodes that it holds are not followed"


# Supports.


def _supports(deck: Deck) -> Iterator[Hold | str]:
    for card in deck.named(_SPC):
        options = card.options(_SPC)
        if card.name.startswith(_SYMMETRY):
            continue
        if not options <= {"NODE", "SET", "ID", "BIRTH", "DEATH"}:
            yield _not_followed(card)
            continue
        step = 1 + ("ID" in options) + ("BIRTH" in options)
        for at in range("ID" in options, len(card.lines), step):
            times = (
                card.lines[at + 1]
                if "BIRTH" in options and at + 1 < len(card.lines)
                else None
            )
            yield _spc(deck, card, card.lines[at], times)


def _spc(deck: Deck, card: Card, row: Row, times: Row | None) -> Hold | str:
    """Read a line of nodes or of a set; along the axes of a system of its own it counts in any case."""
    nodes = _members(deck, card, row)
    fixed = [bool(card.integer(row, at).value) for at in range(2, 8)]
    if nodes is None:
        return _not_followed(card)
    axes = frozenset(axis for axis in range(3) if fixed[axis])
    own = bool(card.integer(row, 1).value) and 0 < len(axes) < len(CODES[-1])
    held = Hold(_name(card), nodes if any(fixed) else ids(()), axes=axes, counts=own)
    return held if times is None else _timed(held, card, times, 0)


def _timed(hold: Hold, card: Card, row: Row, birth: int, death: int = 1) -> Hold:
    """Add birth and death, the one 0 and the other never where they are not given."""
    start, end = (
        card.real(row, at).value * card.transform.time for at in (birth, death)
    )
    return hold._replace(start=start, end=end if end > 0 else inf)


def _members(deck: Deck, card: Card, row: Row) -> Places | None:
    """The node, or the nodes of the set (``_SET``), that a line begins with."""
    number = card.integer(row, 0).value
    single = None if "SET" in card.name.split("_") else {number + card.transform.node}
    found = single or nodes_of_set(deck, card, number)
    return None if found is None else ids(found)


def _of_nodes(numbers: Places, codes: Places) -> Iterator[Hold]:
    """What *NODE itself fixes."""
    for code, axes in enumerate(CODES):
        held = numbers[codes == code] if code else ids(())
        if held.size:
            yield Hold(f"*NODE, TC {code}", np.sort(held), axes=frozenset(axes))


def _of_plane(card: Card, numbers: Places, places: Reals) -> Hold | str:
    """Nodes on a plane, which a *CONSTRAINED_GLOBAL fixes."""
    rows = card.lines
    code, normal = (
        (card.integer(rows[0], at).value for at in (0, 2)) if rows else (0, 0)
    )
    if not 0 < code < len(CODES) or normal not in (1, 2, 3) or not numbers.size:
        return _not_followed(card)
    height = places[:, normal - 1] - card.real(rows[0], 2 + normal).value
    near = np.abs(height) <= _FLAT * float(np.nanmax(np.ptp(places, axis=0)))
    return Hold(_name(card), np.sort(numbers[near]), axes=frozenset(CODES[code]))


def _of_materials(deck: Deck, parts: Parts) -> Iterator[Hold]:
    """What *MAT_RIGID fixes."""
    for card in rigid_materials(deck):
        if len(card.data) < 2:
            continue
        name, row = material_of(card, card.data[0], 0), card.data[1]
        kind, code = card.real(row, 0).value, card.integer(row, 1).value
        axes = frozenset(CODES[code] if kind > 0 and 0 < code < len(CODES) else ())
        own = kind < 0 and bool(card.integer(row, 2).value)
        held = frozenset(
            part for part, material in parts.materials.items() if material == name
        )
        if held and (axes or own):
            yield Hold(_name(card), ids(()), held, axes, counts=own)


# Prescribed motion.


def _motions(deck: Deck) -> Iterator[Hold | str]:
    for card in deck.named(_MOTION):
        options = card.options(_MOTION)
        if not options & {"NODE", "SET", "RIGID"} or options - {
            "NODE",
            "SET",
            "RIGID",
            "LOCAL",
            "ID",
        }:
            yield _not_followed(card)
            continue
        rows = card.lines
        while len(rows) > ("ID" in options):
            rows = rows["ID" in options :]
            row = rows[0]
            further = (
                abs(card.integer(row, 1).value) in _OWN_CENTRE
                or card.integer(row, 2).value == _RELATIVE
            )
            yield _motion(deck, card, row, options)
            rows = rows[1 + further :]


def _motion(deck: Deck, card: Card, row: Row, options: frozenset[str]) -> Hold | str:
    part = (
        frozenset({card.integer(row, 0).value + card.transform.part})
        if "RIGID" in options
        else frozenset[int]()
    )
    nodes = ids(()) if part else _members(deck, card, row)
    if nodes is None:
        return _not_followed(card)
    return _timed(Hold(_name(card), nodes, part, counts=True), card, row, 7, 6)


# Gravity.


def _gravity(deck: Deck, parts: Parts) -> Iterator[Gravity | str]:
    """Body loads, which accelerate against their axis; given to some parts they act on these alone."""
    curves = dict(_curves(deck)) if deck.named("LOAD_BODY", "LOAD_GRAVITY") else {}
    limits = [_limited(card, parts) for card in deck.named("LOAD_BODY_PARTS")]
    for card in deck.named("LOAD_BODY", "LOAD_GRAVITY"):
        if card.name == "LOAD_BODY_PARTS":
            continue
        found = (
            [_of_row(card, row, curves) for row in card.lines[:1]]
            if card.name in _ALONG
            else [None]
        )
        for one in found:
            if one is None or None in limits:
                yield f"{_name(card)} is not followed: whether gravity acts is seen in the run alone"
            elif one.values:
                yield (
                    one._replace(nodes=ids(()), parts=limits[0] or frozenset())
                    if limits
                    else one
                )


def _limited(card: Card, parts: Parts) -> frozenset[int] | None:
    members = (
        parts.members(card.integer(card.lines[0], 0).value + card.transform.set_)
        if card.lines
        else None
    )
    return None if members is None else frozenset(members)


def _of_row(
    card: Card, row: Row, curves: Mapping[int, tuple[float, ...]]
) -> Gravity | None:
    """Give the values of a *LOAD_BODY, none of one for dynamic relaxation alone; None where they are not known."""
    curve, relaxing, system = (card.integer(row, at) for at in (0, 2, 6))
    if not curve.value and relaxing.value:
        return Gravity(None, ())
    scale = card.real(row, 1)
    ordinates = curves.get(curve.value + card.transform.rest, ())
    values = plateaus(
        ordinates, -(scale.value or 1.0)
    )  # it is the ground that is accelerated
    if (
        card.transform.scaled
        or curve.problem
        or scale.problem
        or not values
        or not np.isfinite(values).all()
    ):
        return None
    return Gravity(None if system.value else _ALONG[card.name], values)


def _curves(deck: Deck) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Ordinates of the curves."""
    for card in deck.named("DEFINE_CURVE"):
        if card.data and card.options("DEFINE_CURVE") <= {"TITLE"}:
            row = card.data[0]
            number, factor, offset = (
                card.integer(row, 0),
                card.real(row, 3),
                card.real(row, 5),
            )
            points = np.concatenate(
                [
                    lines.reals(_POINT, slice(1, 2))[:, 0]
                    for lines in lines_of(card)
                    if len(lines)
                ]
            )
            ordinates = points[len(card.lines) - len(card.data) + 1 :]
            scaled = (factor.value or 1.0) * (ordinates + offset.value)
            yield number.value + card.transform.rest, tuple(scaled.tolist())


# Joints.


def joints_of(deck: Deck) -> Joints:
    """Collect what joins parts in an LS-DYNA deck; joints of two rigid bodies that may turn are none."""
    found, unknown = (
        [],
        [_name(card) for name in _OTHER_TIES for card in deck.named(name)],
    )
    for one in read_constraints(
        deck, "nodal rigid body", "extra nodes", "spotweld", "rivet", "generalized weld"
    ):
        if one.nodes:
            found.append(
                Joint(
                    one.kind, ids(one.nodes), frozenset([one.part] if one.part else [])
                )
            )
        else:
            unknown.append(f"{one.kind} ({one.place.at})")
    for card in deck.named("CONTACT"):
        if (
            card.name.startswith(("CONTACT_TIED", "CONTACT_SPOTWELD"))
            or "TIEBREAK" in card.name
        ):
            tie = _of_contact(deck, card)
            found += [tie] if tie else []
            unknown += [] if tie else [_name(card)]
    return Joints(tuple(found), tuple(unknown))


def _of_contact(deck: Deck, card: Card) -> Joint | None:
    """Parts that a tied contact of two parts, or of nodes and a part, holds together; None for any other."""
    options = card.options("CONTACT")
    rows = card.lines[int(bool({"ID", "TITLE"} & options)) :]
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
        return Joint(
            "tied contact", ids(()), frozenset({one + moved.part, other + moved.part})
        )
    nodes = nodes_of_set(deck, card, one)
    return (
        Joint("tied contact", ids(nodes), frozenset({other + moved.part}))
        if nodes
        else None
    )
