"""Read supports, prescribed motions, gravity and joints from an LS-DYNA deck.

Joints connect parts that share no nodes: welds, nodal rigid bodies, extra nodes and ties. While a part is rigid, such a
constraint on it must be deleted, because a node cannot obey two constraints (vendor's keyword data for NRBF and NCSF of
the switching cards). The parts that the constraint connects then separate, unless they are one rigid body.

The columns come from the vendor's keyword data as published in its Python library, and from Altair's public help on
these keywords.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.deck.ls_dyna_columns import (
    BODY_LOAD,
    CONTACT,
    CURVE,
    CURVE_POINT,
    GLOBAL_CONSTRAINT,
    LOADED_PARTS,
    MATERIAL,
    MOTION,
    RIGID_MATERIAL,
    SPC,
    SPC_TIMES,
)
from d2rpick.deck.ls_dyna_parts import (
    DeckParts,
    find_rigid_materials,
    find_set_nodes,
    find_tied_contacts,
    name_material,
    read_constraints,
)
from d2rpick.deck.mesh import read_lines
from d2rpick.deck.model import (
    Boundary,
    Gravity,
    Hold,
    Joint,
    Joints,
    find_plateaus,
    make_ids,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from d2rpick.deck.card import Card, Row
    from d2rpick.deck.columns import DataLine
    from d2rpick.deck.mesh import Reals
    from d2rpick.deck.model import Places
    from d2rpick.deck.reader import Deck

_PART_ID, _NODE_SET = 3, 4  # Values of SSTYP and MSTYP for a part and a node set.
# Beginnings of other keywords that connect parts; d2rpick does not read which parts these keywords connect.
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
    *(
        f"CONSTRAINED_{kind}_IN_SOLID"
        for kind in ("BEAM", "SHELL", "SOLID", "LAGRANGE")
    ),
)
# Global directions that each code (0 to 7) of *NODE, *MAT_RIGID and *CONSTRAINED_GLOBAL fixes.
CODES: Final = ((), (0,), (1,), (2,), (0, 1), (1, 2), (2, 0), (0, 1, 2))
_ALONG: Final = {f"LOAD_BODY_{letter}": axis for axis, letter in enumerate("XYZ")}
_MOTION, _SPC = "BOUNDARY_PRESCRIBED_MOTION", "BOUNDARY_SPC"
_SYMMETRY: Final = "BOUNDARY_SPC_SYMMETRY_PLANE"
# Values of DOF with which a prescribed motion has a second line.
_OWN_CENTRE: Final = (9, 10, 11)
_RELATIVE: Final = 4  # Value of VAD with which a prescribed motion has a second line.
# Nodes are on a *CONSTRAINED_GLOBAL plane up to this distance, as a fraction of the model size [-].
_FLAT: Final = 1e-4


def read_ls_dyna_boundary(
    deck: Deck, parts: DeckParts, nodes: tuple[Places, Reals, Places]
) -> Boundary:
    """Return the supports, prescribed motions and gravity in a deck.

    ``nodes`` contains the ids, the coordinates and the codes of fixed translations of the nodes.
    """
    numbers, coordinates, codes = nodes
    holds = [
        *_read_supports(deck),
        *_read_motions(deck),
        *_read_node_supports(numbers, codes),
        *_read_material_supports(deck, parts),
    ]
    holds += [
        _read_plane_support(card, numbers, coordinates)
        for card in deck.named("CONSTRAINED_GLOBAL")
    ]
    return Boundary.of(
        holds,
        [*_read_gravity(deck, parts)],
        whole=not deck.unread and not deck.encrypted,
    )


def _describe_card(card: Card) -> str:
    """Return the keyword, file and line of a card for messages."""
    return f"*{card.name} ({card.at})"


def _note_unknown_nodes(card: Card) -> str:
    """Return the note on a card whose nodes are unknown."""
    return f"{_describe_card(card)}: the nodes that it constrains are not known"


# The functions below read supports.


def _read_supports(deck: Deck) -> Iterator[Hold | str]:
    """Yield the supports in *BOUNDARY_SPC, or notes on those that cannot be read."""
    for card in deck.named(_SPC):
        options = card.options(_SPC)
        if card.name.startswith(_SYMMETRY):
            continue
        if not options <= {"NODE", "SET", "ID", "BIRTH", "DEATH"}:
            yield _note_unknown_nodes(card)
            continue
        step = 1 + ("ID" in options) + ("BIRTH" in options)
        for at in range("ID" in options, len(card.lines), step):
            if "BIRTH" in options and at + 1 < len(card.lines):
                times = card.lines[at + 1]
            else:
                times = None
            yield _read_support(deck, card, card.lines[at], times)


def _read_support(deck: Deck, card: Card, row: Row, times: Row | None) -> Hold | str:
    """Read a line of *BOUNDARY_SPC for a node or node set.

    A constraint in local axes is always treated as a support.
    """
    nodes = _find_nodes(deck, card, row)
    _, system, *flags = card.numbers(row, SPC)
    fixed = [bool(flag.value) for flag in flags]
    if nodes is None:
        return _note_unknown_nodes(card)
    axes = frozenset(axis for axis in range(3) if fixed[axis])
    along_own_axes = bool(system.value) and 0 < len(axes) < len(CODES[-1])
    held = Hold(
        _describe_card(card),
        nodes if any(fixed) else make_ids(()),
        axes=axes,
        counts=along_own_axes,
    )
    return held if times is None else _set_times(held, card, times, SPC_TIMES)


def _set_times(hold: Hold, card: Card, row: Row, line: DataLine) -> Hold:
    """Add the birth and death times of a card to its load; missing times mean 0 and infinity."""
    start, end = (
        card.real(row, line[name]).value * card.transform.time
        for name in ("BIRTH", "DEATH")
    )
    return hold._replace(start=start, end=end if end > 0 else inf)


def _find_nodes(deck: Deck, card: Card, row: Row) -> Places | None:
    """Return the node, or the nodes of the node set (``_SET``), at the beginning of a line.

    None if they are unknown.
    """
    number = card.integer(row, SPC["NID"]).value
    single = None if "SET" in card.name.split("_") else {number + card.transform.node}
    node_ids = single or find_set_nodes(deck, card, number)
    return None if node_ids is None else make_ids(node_ids)


def _read_node_supports(numbers: Places, codes: Places) -> Iterator[Hold]:
    """Yield the supports that the codes of *NODE define."""
    for code, axes in enumerate(CODES):
        held = numbers[codes == code] if code else make_ids(())
        if held.size:
            yield Hold(f"*NODE, TC {code}", np.sort(held), axes=frozenset(axes))


def _read_plane_support(card: Card, numbers: Places, coordinates: Reals) -> Hold | str:
    """Return the support of the nodes on the plane of a *CONSTRAINED_GLOBAL card, or a note if these are unknown."""
    rows = card.lines
    if rows:
        code, normal = (
            card.integer(rows[0], GLOBAL_CONSTRAINT[name]).value
            for name in ("TC", "DIR")
        )
    else:
        code, normal = (0, 0)
    if not 0 < code < len(CODES) or normal not in (1, 2, 3) or not numbers.size:
        return _note_unknown_nodes(card)
    level = card.real(rows[0], GLOBAL_CONSTRAINT["XYZ"[normal - 1]]).value
    height = coordinates[:, normal - 1] - level
    near = np.abs(height) <= _FLAT * float(np.nanmax(np.ptp(coordinates, axis=0)))
    return Hold(
        _describe_card(card), np.sort(numbers[near]), axes=frozenset(CODES[code])
    )


def _read_material_supports(deck: Deck, parts: DeckParts) -> Iterator[Hold]:
    """Yield the supports that *MAT_RIGID defines."""
    for card in find_rigid_materials(deck):
        if len(card.data) < 2:
            continue
        name = name_material(card, card.data[0], MATERIAL["MID"])
        row = card.data[1]
        kind = card.real(row, RIGID_MATERIAL["CMO"]).value
        code = card.integer(row, RIGID_MATERIAL["CON1"]).value
        axes = frozenset(CODES[code] if kind > 0 and 0 < code < len(CODES) else ())
        along_own_axes = kind < 0 and bool(
            card.integer(row, RIGID_MATERIAL["CON2"]).value
        )
        rigid_parts = frozenset(
            part
            for part, material in parts.material_by_part.items()
            if material == name
        )
        if rigid_parts and (axes or along_own_axes):
            yield Hold(
                _describe_card(card),
                make_ids(()),
                rigid_parts,
                axes,
                counts=along_own_axes,
            )


# The functions below read prescribed motions.


def _read_motions(deck: Deck) -> Iterator[Hold | str]:
    """Yield the prescribed motions, or notes on those that cannot be read."""
    for card in deck.named(_MOTION):
        options = card.options(_MOTION)
        if not options & {"NODE", "SET", "RIGID"} or options - {
            "NODE",
            "SET",
            "RIGID",
            "LOCAL",
            "ID",
        }:
            yield _note_unknown_nodes(card)
            continue
        rows = card.lines
        while len(rows) > ("ID" in options):
            rows = rows["ID" in options :]
            row = rows[0]
            further = (
                abs(card.integer(row, MOTION["DOF"]).value) in _OWN_CENTRE
                or card.integer(row, MOTION["VAD"]).value == _RELATIVE
            )
            yield _read_motion(deck, card, row, options)
            rows = rows[1 + further :]


def _read_motion(
    deck: Deck, card: Card, row: Row, options: frozenset[str]
) -> Hold | str:
    """Read a line of *BOUNDARY_PRESCRIBED_MOTION."""
    if "RIGID" in options:
        number = card.integer(row, MOTION["TYPEID"]).value
        part = frozenset({number + card.transform.part})
    else:
        part = frozenset[int]()
    nodes = make_ids(()) if part else _find_nodes(deck, card, row)
    if nodes is None:
        return _note_unknown_nodes(card)
    return _set_times(
        Hold(_describe_card(card), nodes, part, counts=True), card, row, MOTION
    )


# The functions below read gravity.


def _read_gravity(deck: Deck, parts: DeckParts) -> Iterator[Gravity | str]:
    """Yield the body loads, which act against their axis, or notes on loads that cannot be read.

    *LOAD_BODY_PARTS restricts all body loads to some parts.
    """
    curves = dict(_read_curves(deck)) if deck.named("LOAD_BODY", "LOAD_GRAVITY") else {}
    limits = [_read_loaded_parts(card, parts) for card in deck.named("LOAD_BODY_PARTS")]
    for card in deck.named("LOAD_BODY", "LOAD_GRAVITY"):
        if card.name == "LOAD_BODY_PARTS":
            continue
        if card.name in _ALONG:
            loads = [_read_body_load(card, row, curves) for row in card.lines[:1]]
        else:
            loads = [None]
        for load in loads:
            if load is None or None in limits:
                yield f"{_describe_card(card)} cannot be read, so gravity is found from the run alone"
            elif load.values:
                yield (
                    load._replace(nodes=make_ids(()), parts=limits[0] or frozenset())
                    if limits
                    else load
                )


def _read_loaded_parts(card: Card, parts: DeckParts) -> frozenset[int] | None:
    """Return the parts on a *LOAD_BODY_PARTS card; None if they are unknown."""
    if card.lines:
        members = parts.members(
            card.integer(card.lines[0], LOADED_PARTS["PSID"]).value
            + card.transform.set_
        )
    else:
        members = None
    return None if members is None else frozenset(members)


def _read_body_load(
    card: Card, row: Row, curves: Mapping[int, tuple[float, ...]]
) -> Gravity | None:
    """Return the accelerations on a *LOAD_BODY card.

    The result is empty if the load acts only in dynamic relaxation, and None if the accelerations are unknown.
    """
    curve, relaxing, system = (
        card.integer(row, BODY_LOAD[name]) for name in ("LCID", "LCIDDR", "CID")
    )
    if not curve.value and relaxing.value:
        return Gravity(None, ())
    scale = card.real(row, BODY_LOAD["SF"])
    ordinates = curves.get(curve.value + card.transform.rest, ())
    # The sign is negative, because the card accelerates the ground instead of the parts.
    values = find_plateaus(ordinates, -(scale.value or 1.0))
    if (
        card.transform.scaled
        or curve.problem
        or scale.problem
        or not values
        or not np.isfinite(values).all()
    ):
        return None
    return Gravity(None if system.value else _ALONG[card.name], values)


def _read_curves(deck: Deck) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Yield the id and the ordinates of each curve."""
    for card in deck.named("DEFINE_CURVE"):
        if card.data and card.options("DEFINE_CURVE") <= {"TITLE"}:
            row = card.data[0]
            number = card.integer(row, CURVE["LCID"])
            factor = card.real(row, CURVE["SFO"])
            offset = card.real(row, CURVE["OFFO"])
            points = np.concatenate(
                [
                    lines.reals(CURVE_POINT.layout, slice(1, 2))[:, 0]
                    for lines in read_lines(card)
                    if len(lines)
                ]
            )
            ordinates = points[len(card.lines) - len(card.data) + 1 :]
            scaled = (factor.value or 1.0) * (ordinates + offset.value)
            yield number.value + card.transform.rest, tuple(scaled.tolist())


# The functions below read joints.


def read_joints(deck: Deck) -> Joints:
    """Return the joints between parts of an LS-DYNA deck, except joints that let two rigid bodies rotate freely."""
    joints = []
    unknown = [
        _describe_card(card) for name in _OTHER_TIES for card in deck.named(name)
    ]
    for constraint in read_constraints(
        deck, "nodal rigid body", "extra nodes", "spotweld", "rivet", "generalized weld"
    ):
        if constraint.nodes:
            joints.append(
                Joint(
                    constraint.kind,
                    make_ids(constraint.nodes),
                    frozenset([constraint.part] if constraint.part else []),
                )
            )
        else:
            unknown.append(f"{constraint.kind} ({constraint.place.at})")
    for card, tie in read_tied_contacts(deck):
        joints += [tie] if tie else []
        unknown += [] if tie else [_describe_card(card)]
    return Joints(tuple(joints), tuple(unknown))


def read_tied_contacts(deck: Deck) -> Iterator[tuple[Card, Joint | None]]:
    """Yield each tied contact with its joint between two parts, or between nodes and a part; None if it is unknown."""
    for card in find_tied_contacts(deck):
        yield card, _read_tied_contact(deck, card)


def _find_contact_line(card: Card) -> Row | None:
    """Return the line of a contact that names its two sides; None if the card is incomplete.

    An id or title and, with the option MPP, one or two further lines precede it. The second of these begins with ``&``.
    """
    options = card.options("CONTACT")
    has_title = bool({"ID", "TITLE"} & options)
    if "MPP" not in options:
        return next(iter(card.lines[int(has_title) :]), None)
    # The first line of the option MPP may be blank.
    rows = card.rows[int(has_title) + 1 :]
    return next((row for row in rows if not row.text.lstrip().startswith("&")), None)


def _read_tied_contact(deck: Deck, card: Card) -> Joint | None:
    """Return the joint that a tied contact makes between two parts, or between nodes and a part; otherwise None."""
    row = _find_contact_line(card)
    if row is None:
        return None
    values = card.numbers(row, CONTACT)
    if any(value.problem for value in values):
        return None
    first_id, second_id, kind, main = (value.value for value in values)
    offsets = card.transform
    if main != _PART_ID or kind not in (_PART_ID, _NODE_SET):
        return None
    if kind == _PART_ID:
        return Joint(
            "tied contact",
            make_ids(()),
            frozenset({first_id + offsets.part, second_id + offsets.part}),
        )
    nodes = find_set_nodes(deck, card, first_id)
    if nodes:
        return Joint(
            "tied contact", make_ids(nodes), frozenset({second_id + offsets.part})
        )
    return None
