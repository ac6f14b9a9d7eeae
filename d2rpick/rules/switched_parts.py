"""D2R103, D2R104, D2R106-108, D2R112, D2R113, D2R116-120: the parts that are switched, and what holds on to them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import are, name_units
from d2rpick.base.graph import reached
from d2rpick.deck.ls_dyna_parts import Parts, element_cards
from d2rpick.rules.base import BOTH, ERROR, INFO, WARNING, Case, Objection, grouped
from d2rpick.rules.rule import (
    BACK,
    PASS,
    THERE,
    Example,
    automatic,
    deck,
    fails,
    passes,
    rule,
)

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from d2rpick.deck.card import Field
    from d2rpick.deck.switching import Event, Switched, SwitchSet, Unit

_NEAREST = 3  # ids that are named in place of one that the deck does not have

_LAYERED = "*PART_COMPOSITE\nroof\n         7         2\n         1       0.5\n"
_RIGID = "*MAT_RIGID\n         1    7.8E-9     210.0       0.3\n"
_TOUCHING = """\
*ELEMENT_SHELL
       1       1       1       2       3       4
       2       2       3       4       5       6
"""


def _both(*lines: str) -> Example:
    there = automatic(1, "0.02", rigid=lines)
    return deck(_TOUCHING + there + automatic(2, "0.09", deformable=["1", "2"]))


_LAYERS, _BEAMS = (
    Example(_both("1", "2").deck.replace(_TOUCHING, text))
    for text in (
        _TOUCHING.replace("SHELL", "SHELL_COMPOSITE").replace(
            "       4\n", "       4\n         1       0.5\n"
        ),
        "*ELEMENT_BEAM_ELFORM\n"
        + "".join(f"{one:8d}{one:8d}{one:8d}{one + 1:8d}\n{1:10d}\n" for one in (1, 2)),
    )
)


_DELETED = 1  # NRBF, NCSF
_MESH: Final = "*ELEMENT_SHELL\n       1       1       1       2       3       4\n"
_SET: Final = "*SET_NODE_LIST\n         5\n         3         4        99\n"
_NODAL: Final = "*CONSTRAINED_NODAL_RIGID_BODY\n         9         0         5\n"
_EXTRA: Final = "*CONSTRAINED_EXTRA_NODES_NODE\n         8         3\n"
_JOINT: Final = (
    "*CONSTRAINED_JOINT_REVOLUTE\n"
    + "".join(f"{node:10d}" for node in (3, 3, 50, 51, 52, 53))
    + "\n"
)
_COUNTS: Final = "         0         0         0       0.0         1         0"


def _constrained(text: str, flags: str = "         0         0") -> Example:
    there = THERE.replace(_COUNTS, flags + _COUNTS[20:])
    return deck(_MESH + _SET + text + there + BACK)


def _solid(elform: str, tr: str = "0.02") -> Example:
    cards = automatic(1, tr, rigid=["1"]) + BACK
    return deck(f"*SECTION_SOLID\n         1{elform:>10s}\n" + cards)


def _by_card(events: Iterable[Event]) -> Iterator[tuple[SwitchSet, Field, str]]:
    """Each card with some events, where the first of them stands, and the names of all its units."""
    for card, those in grouped((event.by, event) for event in events).items():
        by_kind = grouped((event.unit.kind, event.unit.id) for event in those)
        named = " and ".join(
            name_units(ids, kind) for kind, ids in sorted(by_kind.items())
        )
        yield card, those[0].line.part.field, named


def _unknown_members(case: Case, *, to_rigid: bool) -> bool:
    """Whether a part set that cannot be resolved is switched: any part may be in it."""
    return any(
        event.unit.is_set and event.line.to_rigid == to_rigid
        for event in case.windows.events
    )


@fails(deck(BACK), deck(THERE + BACK.replace("  1  ", "  2  ")))
@rule("D2R103", ERROR, "a part switched back that nothing made rigid")
def _never_rigid(case: Case) -> Iterator[Objection]:
    """An R2D line for a part that no D2R line made rigid before has no effect; usually an id is wrong on one of the
    two cards.
    """
    if _unknown_members(case, to_rigid=True):
        return
    orphans = [
        event
        for event in case.windows.orphans
        if event.unit not in case.windows.other_rigid
        and not case.parts.is_rigid(event.unit.id)
    ]
    for _, place, named in _by_card(orphans):
        yield (
            place,
            f"{named} switched back, but no card makes it rigid before; add the D2R line or remove this",
        )


_RESTART: Final = "*RIGID_DEFORMABLE_D2R\n{:10d}\n*RIGID_DEFORMABLE_R2D\n{:10d}\n"


@passes(PASS, Example(_RESTART.format(1, 2)))
@fails(Example(_RESTART.format(1, 1)))
@rule("D2R117", ERROR, "a part made rigid and deformable in one restart")
def _both_ways(case: Case) -> Iterator[Objection]:
    """*RIGID_DEFORMABLE_D2R and _R2D of a restart act together, when it begins: a part that both name is not rigid
    for any time, or rigid to the end, and nobody knows which.
    """
    of_restarts = [event for event in case.windows.events if event.by.kind == "restart"]
    for file, events in grouped(
        (event.by.card.file, event) for event in of_restarts
    ).items():
        rigid = {event.unit for event in events if event.line.to_rigid}
        both = [
            event for event in events if not event.line.to_rigid and event.unit in rigid
        ]
        for _, place, named in _by_card(both):
            found = f"{named} made rigid and deformable when the restart {file} begins"
            yield place, f"{found}; one of them belongs into another restart"


@fails(deck(THERE), deck("*DEFORMABLE_TO_RIGID\n         1\n"))
@rule("D2R104", INFO, "a part made rigid and never switched back", BOTH)
def _never_back(case: Case) -> Iterator[Objection]:
    """It stays rigid to the end of the run, unless a restart deck switches it back. What it would have deformed in
    the next contact is missing from the result.
    """
    if _unknown_members(case, to_rigid=False):
        return
    opened = {
        window.opened: window.tr
        for window in case.windows.windows
        if window.closed is None and window.unit not in case.windows.other_deformable
    }
    for card, place, named in _by_card([*opened]):
        times = [tr for event, tr in opened.items() if event.by is card]
        yield (
            place,
            f"{named} made rigid at {min(times):g} and never switched back in this deck",
        )


@passes(PASS, Example(THERE + BACK), deck("*INCLUDE\nmore_parts.k\n" + BACK))
@fails(
    deck(automatic(1, "0.02", rigid=["7"])),
    *(
        deck(text + "*DEFORMABLE_TO_RIGID\n         3         0      PSET\n")
        for text in (
            "",
            "*SET_PART\n         3\n",
            "*SET_PART\n         3\n         1         7\n",
        )
    ),
    deck(_LAYERED + automatic(1, "0.02", rigid=["8"])),
)
@rule(
    "D2R106",
    ERROR,
    "part or part set not in the deck (only when every include was read)",
)
def _exists(case: Case) -> Iterator[Objection]:
    """A switching card names a part, part set or lead part that no *PART or *SET_PART defines, or a set without
    parts. Judged only when all of the deck could be read and it has parts at all.
    """
    for card in case.sets if case.whole else ():
        missing = grouped(
            absent for line in card.switched for absent in _absent(line, case.parts)
        )
        for kind in sorted(missing, key=["part set", "part", "lead part"].index):
            near = "" if kind == "part set" else _nearest(missing[kind][0], case.parts)
            what = f"{name_units(missing[kind], kind)} not in the deck{near}"
            yield card.card.here, f"{what}; check the ids and include offsets"
        empty = [
            line.part.value
            for line in card.switched
            if line.by_set
            and not line.part.problem
            and case.parts.members(line.part.value) == ()
        ]
        if empty:
            yield (
                card.card.here,
                f"{name_units(empty, 'part set')} without a part in the deck, so nothing is switched",
            )


def _nearest(number: int, parts: Parts) -> str:
    """List the nearest ids of the deck, with their titles."""
    from heapq import nsmallest  # not above: start-up

    near = sorted(
        nsmallest(_NEAREST, parts.materials, key=lambda part: abs(part - number))
    )
    listed = (
        f"{part} {parts.titles[part]!r}" if parts.titles[part] else str(part)
        for part in near
    )
    return f" (nearest to {number}: {', '.join(listed)})"


def _absent(line: Switched, parts: Parts) -> Iterator[tuple[str, int]]:
    """Parts, part sets, their members and the lead part of a line that the deck does not have, by kind."""
    if line.by_set and not line.part.problem:
        yield from (
            ("part set", one)
            for one in parts.reached(line.part.value)
            if one not in parts.sets
        )
    if not line.part.problem:
        members = (
            (parts.members(line.part.value) or ())
            if line.by_set
            else (line.part.value,)
        )
        yield from (("part", part) for part in members if part not in parts.materials)
    if line.lead and line.lead.value and line.lead.value not in parts.materials:
        yield "lead part", line.lead.value


@fails(deck(_RIGID + BACK))
@rule("D2R107", WARNING, "a *MAT_RIGID part switched to deformable")
def _always_rigid(case: Case) -> Iterator[Objection]:
    """A part with *MAT_RIGID is rigid from the start and cannot become deformable. It must be modelled with its
    deformable material and made rigid by the card.
    """
    back = [
        event
        for event in case.windows.events
        if not event.line.to_rigid
        and not event.unit.is_set
        and case.parts.is_rigid(event.unit.id)
    ]
    for _, place, named in _by_card(back):
        found = f"{named} has *MAT_RIGID and cannot become deformable"
        yield (
            place,
            f"{found}; give it its deformable material and let a D2R line make it rigid",
        )


@passes(_both("1", "         2         1      PART"))
@fails(_both("1", "2"), _LAYERS, _BEAMS)
@rule("D2R108", ERROR, "several parts made rigid with LRB 0 although they share nodes")
def _torn(case: Case) -> Iterator[Objection]:
    """With LRB 0 each part becomes a rigid body of its own, and the bodies fight over the nodes they share. Merge
    them: the lead part with LRB 0, the others with LRB = the lead.
    """
    first = {event.unit.id: event for event in reversed(case.made_rigid)}
    if len(first) < 2:
        return
    bodies = _find_bodies(first)
    cards = element_cards(case.deck, searched=True)
    if len(set(bodies.values())) < 2 or not cards:
        return
    from d2rpick.deck.ls_dyna_inventory import first_shared_nodes  # loads numpy

    for (low, high), node in first_shared_nodes(cards, bodies).items():
        if _together(case, first[low].unit, first[high].unit):
            place = (first[high].line.lead or first[high].line.part).field
            lines = ((part, first[part].line) for part in (low, high))
            one, other = (
                f"part {part}" + f" (of part set {line.part.value})" * line.by_set
                for part, line in lines
            )
            found = f"{one} and {other} share node {node} but become separate rigid bodies that both own it"
            yield place, f"{found}; merge them: LRB {low} on the line of {other}"


def _find_bodies(first: Mapping[int, Event]) -> dict[int, int]:
    """Give the lead of the rigid body of each part by the event that makes it rigid: the end of its LRB chain.

    A part that merges into nobody leads itself.
    """
    leads = {
        part: event.line.lead.value for part, event in first.items() if event.line.lead
    }
    return {
        part: reached([part], lambda one: [lead] if (lead := leads.get(one)) else [])[
            -1
        ]
        for part in first
    }


def _together(case: Case, one: Unit, other: Unit) -> bool:
    """Whether two units may be rigid at the same time; by force nobody knows."""
    if {one, other} & case.windows.other_rigid:
        return True
    far = float("inf")
    spans = {
        unit: [
            (w.tr, far if w.td is None else w.td)
            for w in case.windows.windows
            if w.unit == unit
        ]
        for unit in (one, other)
    }
    return any(a < d and c < b for a, b in spans[one] for c, d in spans[other])


def _held(case: Case, *, nodal: bool) -> Iterator[Objection]:
    """Constraints on parts that cards make rigid while leaving the constraints active."""
    switched = _left_active(case, nodal=nodal)
    wanted = [
        one
        for one in (case.constraints if switched else ())
        if (one.kind == "nodal rigid body") == nodal
    ]
    owner = _owners(case, switched) if wanted else {}
    for constraint in wanted:
        own = (owner[node] for node in sorted(constraint.nodes) if node in owner)
        part = constraint.part if constraint.part in switched else next(own, None)
        if part is None:
            continue
        name = (
            f"{constraint.kind} {constraint.id}" if constraint.id else constraint.kind
        )
        flag = f"{'NRBF' if nodal else 'NRBF and NCSF'} {switched[part].nrbf}"
        found_at = f"{name} on part {part}, which is made rigid at {switched[part].place.at} with {flag}"
        way_out = (
            "it stays active; delete it there (1) and activate it on the way back (2)"
        )
        yield constraint.place, f"{found_at}: {way_out}"


def _owners(case: Case, parts: Collection[int]) -> dict[int, int]:
    """Nodes of some parts, each with the first of these that has it."""
    cards = element_cards(case.deck, searched=True)
    if not cards:
        return {}
    from d2rpick.deck.ls_dyna_inventory import first_parts  # loads numpy

    return first_parts(cards, parts)


class _Flags(NamedTuple):
    """NRBF and NCSF with which a card makes parts rigid, and where they stand."""

    nrbf: int
    ncsf: int
    place: Field


def _find_flags(case: Case, card: SwitchSet) -> _Flags | None:
    """Give the flags of a card; those of a restart are on its *RIGID_DEFORMABLE_CONTROL.  A plain card has none."""
    if card.header:
        nrbf, ncsf = card.header.nrbf, card.header.ncsf
        return _Flags(nrbf.value, ncsf.value, nrbf.field)
    if card.kind != "restart":
        return None
    controls = (
        other
        for other in case.sets
        if other.card.file == card.card.file and other.card.name.endswith("_CONTROL")
    )
    values = next((control.values for control in controls if control.values), None)
    if values is None:
        return _Flags(0, 0, card.card.here)
    nrbf_value, ncsf_value = values[0].value, values[1].value
    return _Flags(int(nrbf_value), int(ncsf_value), values[0].field)


def _left_active(case: Case, *, nodal: bool) -> dict[int, _Flags]:
    """Parts made rigid by cards that delete nothing, with the flags of the first such card."""
    found: dict[int, _Flags] = {}
    for event in case.made_rigid:
        flags = _find_flags(case, event.by)
        if flags and flags.nrbf != _DELETED and (nodal or flags.ncsf != _DELETED):
            found.setdefault(event.unit.id, flags)
    return found


@passes(PASS, _solid("0"), _solid("2", "0.0"))
@fails(_solid("2"), _solid(""), _solid("13"))
@rule("D2R116", WARNING, "solids whose stresses do not turn with the rigid body", BOTH)
def _unturned(case: Case) -> Iterator[Objection]:
    """While a part is rigid its elements are not computed. Formulations without a co-rotating frame keep their
    stresses in global axes: after a rotation they spring back in the wrong direction. Parts that are rigid from the
    start hold no stress and are not reported. Source: Altair's help says so for Radioss (bricks with Isolid 1 or 2
    without Iframe 2, tetrahedra, 16-node thick shells, 20-node bricks; not HEPH, HA8). For LS-DYNA it is concluded
    from the theory of the formulations; sources differ on what it does with their stresses.
    """
    loaded = [
        window
        for window in case.windows.windows
        if window.td is not None and window.tr > 0
    ]
    formulations = case.unturned if loaded else {}
    held = (
        (window.part, window.opened.line.part.field)
        for window in loaded
        if window.part in formulations
    )
    for form, those in grouped(
        (formulations[part], (part, place)) for part, place in held if part is not None
    ).items():
        found = f"{name_units(part for part, _ in those)} of solids that do not co-rotate ({form})"
        why = "the stresses locked in do not turn with the rigid body"
        yield those[0][1], f"{found}: {why}; expect an error after a large rotation"


def _unswitchable(case: Case, *, flows: bool) -> Iterator[Objection]:
    """Parts that are switched, by cards that act at any time, and must not be."""
    kept = (
        {
            part: why.reason
            for part, why in case.unswitchable.items()
            if why.flows == flows
        }
        if case.sets
        else {}
    )
    opened = [
        event
        for event in case.windows.events
        if event.line.to_rigid and event.unit.part in kept
    ]
    first = {event.unit.id: event for event in reversed(opened)}
    for reason, parts in grouped((kept[part], part) for part in sorted(first)).items():
        yield (
            first[parts[0]].line.part.field,
            f"{name_units(parts)}: {reason}; do not switch it",
        )


def _of_law(law: str) -> Example:
    return deck(f"{law}\n         1     1.0e-9       1.0       0.3\n" + THERE + BACK)


@passes(PASS, _solid("1"))
@fails(_solid("5"), _solid("11"), _solid("12"))
@rule("D2R118", ERROR, "a switched part whose material flows through its mesh", BOTH)
def _flows(case: Case) -> Iterator[Objection]:
    """ALE and Eulerian elements (LS-DYNA: ELFORM 5, 6, 7, 11, 12; Radioss: /ALE/MAT, /EULER/MAT) hold whatever flows
    through them: there is no body to be made rigid. Source: the vendor's keyword data, Altair's help.
    """
    return _unswitchable(case, flows=True)


@passes(PASS, _of_law("*MAT_ELASTIC"))
@fails(
    _of_law("*MAT_MOONEY-RIVLIN_RUBBER"),
    _of_law("*MAT_077_O"),
    _of_law("*MAT_ORTHOTROPIC_ELASTIC"),
)
@rule(
    "D2R119", WARNING, "a switched part whose law keeps a stress-free reference", BOTH
)
def _with_reference(case: Case) -> Iterator[Objection]:
    """Hyperelastic and total Lagrangian laws compute the stress from the deformation since the start, and not from
    what was stored when the part was made rigid: it may come back with a stress that it did not have. Source: the
    theory of the laws, and a report of 2026 on LS-DYNA R14 in which a hyperelastic solid did; not tried with the
    solver. Radioss: hyperelastic laws, and solids with Ismstr 10 to 12.
    """
    return _unswitchable(case, flows=False)


@passes(
    PASS,
    _constrained(_NODAL, "         1         0"),
    _constrained(_NODAL.replace("   5\n", "   6\n")),
)
@fails(_constrained(_NODAL), _constrained(_NODAL, "         2         1"))
@rule("D2R112", ERROR, "a nodal rigid body on a switched part stays active (NRBF)")
def _d2r112(case: Case) -> Iterator[Objection]:
    """A node cannot belong to two rigid bodies. A nodal rigid body on a part that is made rigid must be deleted by
    the same card (NRBF 1) and activated again on the way back (2); else the run stops (Error 30164, as a public drop
    tool reports). Source: vendor keyword data for NRBF, which says that such bodies cause instabilities.
    """
    return _held(case, nodal=True)


_TWO: Final = _MESH + "       2       2       5       6       7       8\n"
_JOINING: Final = (
    "*SET_NODE_LIST\n         5\n         3         6        99\n" + _NODAL
)


def _joined(*lines: str) -> Example:
    """Join two parts by a nodal rigid body that the card deletes; node 99 is of no element."""
    there = automatic(1, "0.02", rigid=lines)
    back = automatic(2, "0.09", deformable=["1", "2"][: len(lines)])
    there, back = (
        text.replace(_COUNTS[:40], f"{flag:10d}{_COUNTS[10:40]}", 1)
        for text, flag in ((there, 1), (back, 2))
    )
    return deck(_TWO + _JOINING + there + back)


@passes(PASS, _joined("1", "         2         1      PART"))
@fails(_joined("1", "2"), _joined("1"))
@rule("D2R120", ERROR, "a deleted nodal rigid body (NRBF 1) that joins separate bodies")
def _come_apart(case: Case) -> Iterator[Objection]:
    """While NRBF 1 deletes a nodal rigid body, only the rigid body of its parts holds them together. Parts that it
    joined come apart if they become several rigid bodies, or if one of them is not switched. Merge them, or switch all
    of them. Source: vendor keyword data for NRBF and LRB.
    """
    deleting = [
        event
        for event in case.made_rigid
        if (flags := _find_flags(case, event.by)) and flags.nrbf == _DELETED
    ]
    joining = [
        constraint
        for constraint in (case.constraints if deleting else ())
        if constraint.kind == "nodal rigid body"
    ]
    cards = element_cards(case.deck, searched=True) if joining else ()
    if not cards:
        return
    from d2rpick.deck.ls_dyna_inventory import find_parts_of_nodes  # loads numpy

    bodies = _find_bodies({event.unit.id: event for event in reversed(deleting)})
    every = frozenset[int]().union(*(constraint.nodes for constraint in joining))
    owners = find_parts_of_nodes(cards, every)
    for constraint in joining:
        parts = set[int]().union(*(owners.get(node, ()) for node in constraint.nodes))
        switched = parts & bodies.keys()
        if not switched or len({bodies.get(part) for part in parts}) == 1:
            continue
        found = f"nodal rigid body {constraint.id} joins {name_units(parts)} and is deleted (NRBF 1)"
        if others := parts - switched:
            yield (
                constraint.place,
                f"{found}, but {name_units(others)} {are(others)} not made rigid with the others; switch all of them",
            )
        else:
            yield (
                constraint.place,
                f"{found}, but they become separate rigid bodies; merge them by LRB",
            )


@passes(
    PASS,
    _constrained(_EXTRA, "         0         1"),
    _constrained(_JOINT, "         1         0"),
)
@fails(
    _constrained(_EXTRA),
    _constrained(_JOINT),
    _constrained(_EXTRA.replace("  8  ", "  1  ")),
)
@rule(
    "D2R113",
    WARNING,
    "extra nodes or a joint on a switched part stay active (NRBF, NCSF)",
)
def _d2r113(case: Case) -> Iterator[Objection]:
    """Extra nodes and joints tie nodes to a rigid body; on a part that a card makes rigid the nodes then belong to
    two. The vendor asks to delete what lies in switched parts (1) and to activate it on the way back (2); which of
    NRBF and NCSF does so for joints and extra nodes is not confirmed, so either keeps this quiet.
    """
    return _held(case, nodal=False)
