"""Define rules D2R103-104, D2R106-108 and D2R116-119 on switched parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import name_units
from d2rpick.base.graph import find_reachable
from d2rpick.deck.ls_dyna_parts import (
    DeckParts,
    find_element_cards,
    read_merged_bodies,
)
from d2rpick.deck.switching import find_misspelt
from d2rpick.rules.base import (
    BOTH,
    ERROR,
    INFO,
    WARNING,
    Case,
    PlacedMessage,
    group_values,
)
from d2rpick.rules.example import Example, make_deck, write_automatic_card
from d2rpick.rules.rule import (
    BACK,
    PASS,
    THERE,
    make_rule_decorator,
    set_failing,
    set_passing,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from d2rpick.deck.card import CardField
    from d2rpick.deck.switching import Switched, SwitchEvent, SwitchSet, Unit

_NEAREST = 3  # Largest number of part ids that are suggested for an unknown id.

_LAYERED = "*PART_COMPOSITE\nroof\n         7         2\n         1       0.5\n"
_RIGID = "*MAT_RIGID\n         1    7.8E-9     210.0       0.3\n"
_TOUCHING = """\
*ELEMENT_SHELL
       1       1       1       2       3       4
       2       2       3       4       5       6
"""

_RESTART: Final = "*RIGID_DEFORMABLE_D2R\n{:10d}\n*RIGID_DEFORMABLE_R2D\n{:10d}\n"


def _make_touching_deck(*lines: str) -> Example:
    """Return a deck with two parts that share nodes; ``lines`` are the D2R lines of the first card."""
    rigid_card = write_automatic_card(1, "0.02", rigid=lines)
    return make_deck(
        _TOUCHING + rigid_card + write_automatic_card(2, "0.09", deformable=["1", "2"])
    )


def _make_layered_deck() -> Example:
    """Return the deck of `_make_touching_deck` with layered shells."""
    layered = _TOUCHING.replace("SHELL", "SHELL_COMPOSITE").replace(
        "       4\n", "       4\n         1       0.5\n"
    )
    return Example(_make_touching_deck("1", "2").deck.replace(_TOUCHING, layered))


def _make_beam_deck() -> Example:
    """Return the deck of `_make_touching_deck` with beams that state their formulation."""
    beams = "*ELEMENT_BEAM_ELFORM\n" + "".join(
        f"{element:8d}{element:8d}{element:8d}{element + 1:8d}\n{1:10d}\n"
        for element in (1, 2)
    )
    return Example(_make_touching_deck("1", "2").deck.replace(_TOUCHING, beams))


def _make_solid_deck(elform: str, tr: str = "0.02") -> Example:
    """Return a deck in which part 1 is a solid with this ELFORM that a card makes rigid at ``tr``."""
    cards = write_automatic_card(1, tr, rigid=["1"]) + BACK
    return make_deck(f"*SECTION_SOLID\n         1{elform:>10s}\n" + cards)


def _group_by_card(
    events: Iterable[SwitchEvent],
) -> Iterator[tuple[SwitchSet, CardField, str]]:
    """Yield each card, the field of its first event, and the names of all parts and part sets that it switches."""
    for card, card_events in group_values(
        (event.by, event) for event in events
    ).items():
        by_kind = group_values(
            (event.unit.kind, event.unit.id) for event in card_events
        )
        unit_names = " and ".join(
            name_units(ids, kind) for kind, ids in sorted(by_kind.items())
        )
        yield card, card_events[0].line.part.field, unit_names


def _has_wrong_card(case: Case) -> bool:
    """Return True if a switching keyword is misspelt, or a D2R line names a part that the deck does not have."""
    if any(find_misspelt(case.deck)):
        return True
    return case.knows_all_parts and any(
        event.line.to_rigid and _is_absent(event.unit, case.parts)
        for event in case.windows.events
    )


def _is_absent(unit: Unit, parts: DeckParts) -> bool:
    """Return True if a unit is a part that the deck does not have."""
    return not unit.is_set and unit.id not in parts.material_by_part


def _has_unknown_members(case: Case, *, to_rigid: bool) -> bool:
    """Return True if the deck switches a part set whose parts are unknown and may therefore be any parts."""
    return any(
        event.unit.is_set and event.line.to_rigid == to_rigid
        for event in case.windows.events
    )


@set_failing(
    lambda: [make_deck(BACK), make_deck(THERE + BACK.replace("  1  ", "  2  "))]
)
@make_rule_decorator(
    "D2R103", ERROR, "a part switched back although no card made it rigid"
)
def _check_never_rigid(case: Case) -> Iterator[PlacedMessage]:
    """An R2D line has no effect on a part that no earlier D2R line made rigid. Usually a part id is wrong on one of the
    two cards.

    Fix: Add the D2R line, correct the part id, or remove the R2D line.
    """
    if _has_unknown_members(case, to_rigid=True):
        return
    orphans = [
        event
        for event in case.windows.orphans
        if event.unit not in case.windows.other_rigid
        and not case.parts.is_rigid(event.unit.id)
    ]
    cure = "add a D2R line or remove this R2D line"
    if _has_wrong_card(case):
        cure = "first correct the errors of the D2R cards, which may be the cause"
    for _, field, unit_names in _group_by_card(orphans):
        object_ = "them" if unit_names.startswith("parts") else "it"
        yield (
            field,
            f"{unit_names} switched back, but no card makes {object_} rigid before; {cure}",
        )


@set_passing(lambda: [PASS, Example(_RESTART.format(1, 2))])
@set_failing(lambda: [Example(_RESTART.format(1, 1))])
@make_rule_decorator("D2R117", ERROR, "a part made rigid and deformable in one restart")
def _check_both_ways(case: Case) -> Iterator[PlacedMessage]:
    """*RIGID_DEFORMABLE_D2R and *RIGID_DEFORMABLE_R2D of one restart act together when the restart begins. A part on
    both cards has no rigid window or stays rigid to the end; no available source states which.

    Fix: Move one of the two cards to another restart.
    """
    of_restarts = [event for event in case.windows.events if event.by.kind == "restart"]
    for file, events in group_values(
        (event.by.card.file, event) for event in of_restarts
    ).items():
        rigid = {event.unit for event in events if event.line.to_rigid}
        back_events = [
            event for event in events if not event.line.to_rigid and event.unit in rigid
        ]
        for _, field, unit_names in _group_by_card(back_events):
            problem = (
                f"{unit_names} made rigid and deformable when the restart {file} begins"
            )
            yield field, f"{problem}; move one of the two to another restart"


@set_failing(
    lambda: [make_deck(THERE), make_deck("*DEFORMABLE_TO_RIGID\n         1\n")]
)
@make_rule_decorator("D2R104", INFO, "a part made rigid and never switched back", BOTH)
def _check_never_back(case: Case) -> Iterator[PlacedMessage]:
    """The part stays rigid to the end of the run, unless a restart deck switches it back. It does not deform in the
    next contact.

    Fix: Add an R2D line at td, before the next contact. If the part is meant to stay rigid, silence the finding with a
    comment.
    """
    if _has_unknown_members(case, to_rigid=False):
        return
    opened = {
        window.opened: window.tr
        for window in case.windows.windows
        if window.closed is None
        and window.unit not in case.windows.other_deformable
        # D2R106 names a part that does not exist.
        and not (case.knows_all_parts and _is_absent(window.unit, case.parts))
    }
    for card, field, unit_names in _group_by_card([*opened]):
        times = [tr for event, tr in opened.items() if event.by is card]
        yield (
            field,
            f"{unit_names} made rigid at {min(times):g} and never made deformable again in this deck",
        )


@set_passing(
    lambda: [PASS, Example(THERE + BACK), make_deck("*INCLUDE\nmore_parts.k\n" + BACK)]
)
@set_failing(
    lambda: [
        make_deck(write_automatic_card(1, "0.02", rigid=["7"])),
        *(
            make_deck(text + "*DEFORMABLE_TO_RIGID\n         3         0      PSET\n")
            for text in (
                "",
                "*SET_PART\n         3\n",
                "*SET_PART\n         3\n         1         7\n",
            )
        ),
        make_deck(_LAYERED + write_automatic_card(1, "0.02", rigid=["8"])),
    ]
)
@make_rule_decorator(
    "D2R106",
    ERROR,
    "a part or part set that is not in the deck (only if every include file was read)",
)
def _check_ids_exist(case: Case) -> Iterator[PlacedMessage]:
    """A switching card names a part, part set or lead part that no *PART or *SET_PART defines, or a part set without
    parts. d2rpick applies this rule only if it could read the whole deck and the deck has parts.

    Fix: Correct the id, and check the id offsets of *INCLUDE_TRANSFORM.
    """
    for card in case.sets if case.knows_all_parts else ():
        missing = group_values(
            absent
            for line in card.switched
            for absent in _find_absent(line, case.parts)
        )
        for kind in sorted(missing, key=["part set", "part", "lead part"].index):
            if kind == "part set":
                nearest_ids = ""
            else:
                nearest_ids = _list_nearest(missing[kind][0], case.parts)
            problem = f"{name_units(missing[kind], kind)} not in the deck{nearest_ids}"
            yield (
                card.card.here,
                f"{problem}; correct the ids, or the offsets of the includes",
            )
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
                f"{name_units(empty, 'part set')} without parts in the deck, so nothing is switched; add the parts",
            )


def _list_nearest(number: int, parts: DeckParts) -> str:
    """Return the closest part ids in the deck with their titles, as text in brackets."""
    from heapq import nsmallest  # Imported here to keep start-up fast.

    near = sorted(
        nsmallest(_NEAREST, parts.material_by_part, key=lambda part: abs(part - number))
    )
    listed = (
        f"{part} {parts.titles[part]!r}" if parts.titles[part] else str(part)
        for part in near
    )
    return f" (nearest to {number}: {', '.join(listed)})"


def _find_absent(line: Switched, parts: DeckParts) -> Iterator[tuple[str, int]]:
    """Yield the kind and id of each part set, part or lead part that is named on a line but not defined in the deck."""
    if line.by_set and not line.part.problem:
        yield from (
            ("part set", set_id)
            for set_id in parts.reached(line.part.value)
            if set_id not in parts.sets
        )
    if not line.part.problem:
        if line.by_set:
            members = parts.members(line.part.value) or ()
        else:
            members = (line.part.value,)
        yield from (
            ("part", part) for part in members if part not in parts.material_by_part
        )
    if line.lead and line.lead.value and line.lead.value not in parts.material_by_part:
        yield "lead part", line.lead.value


@set_failing(lambda: [make_deck(_RIGID + BACK)])
@make_rule_decorator("D2R107", WARNING, "a *MAT_RIGID part switched to deformable")
def _check_always_rigid(case: Case) -> Iterator[PlacedMessage]:
    """A part with *MAT_RIGID is rigid from the start and cannot become deformable.

    Fix: Leave the part out of the switched parts. If the part is meant to deform, give it a deformable material and
    make it rigid with a D2R line.
    """
    back_events = [
        event
        for event in case.windows.events
        if not event.line.to_rigid
        and not event.unit.is_set
        and case.parts.is_rigid(event.unit.id)
    ]
    for _, field, unit_names in _group_by_card(back_events):
        is_one = not unit_names.startswith("parts")
        has, object_ = ("has", "it") if is_one else ("have", "them")
        problem = f"{unit_names} {has} *MAT_RIGID and cannot become deformable"
        yield (
            field,
            f"{problem}; leave {object_} out of the switched parts, or give {object_} a deformable material",
        )


@set_passing(lambda: [_make_touching_deck("1", "         2         1      PART")])
@set_failing(
    lambda: [_make_touching_deck("1", "2"), _make_layered_deck(), _make_beam_deck()]
)
@make_rule_decorator("D2R108", ERROR, "separate rigid bodies that share nodes (LRB)")
def _check_shared_nodes(case: Case) -> Iterator[PlacedMessage]:
    """With LRB 0 each part becomes a rigid body of its own. If two rigid bodies share nodes, both prescribe the motion
    of these nodes, which is a contradiction. The same applies to a switched part that shares nodes with a part that has
    *MAT_RIGID.

    Fix: Merge the parts: the lead part has LRB 0, the other parts have LRB = id of the lead part. A part with
    *MAT_RIGID is not listed on the card: write its id as LRB of the parts that it shares nodes with.
    """
    first = {event.unit.id: event for event in reversed(case.made_rigid)}
    if not first:
        return
    bodies = find_bodies_of_parts(case, first)
    cards = find_element_cards(case.deck, searched=True)
    if len(set(bodies.values())) < 2 or not cards:
        return
    # Imported here to keep start-up fast.
    from d2rpick.deck.ls_dyna_inventory import find_shared_nodes

    for (low, high), node in find_shared_nodes(cards, bodies).items():
        switched = [part for part in (low, high) if part in first]
        if len(switched) == 1:
            (part,) = switched
            lead = low + high - part
            line = first[part].line
            problem = f"part {part} becomes rigid and shares node {node} with part {lead}, which has *MAT_RIGID"
            cure = f"merge it into that part (LRB {lead} on its line), or keep part {part} deformable"
            yield (line.lead or line.part).field, f"{problem}; {cure}"
        elif switched and are_rigid_together(case, first[low].unit, first[high].unit):
            field = (first[high].line.lead or first[high].line.part).field
            lines = ((part, first[part].line) for part in (low, high))
            low_name, high_name = (
                f"part {part}" + f" (of part set {line.part.value})" * line.by_set
                for part, line in lines
            )
            problem = f"{low_name} and {high_name} share node {node} but become separate rigid bodies that both own it"
            yield field, f"{problem}; merge them: LRB {low} on the line of {high_name}"


def find_bodies_of_parts(
    case: Case, first: Mapping[int, SwitchEvent]
) -> dict[int, int]:
    """Return the rigid body of each part in ``first`` and of each part with *MAT_RIGID, by part id."""
    always_rigid = _find_always_rigid_bodies(case)
    return always_rigid | {
        part: always_rigid.get(lead, lead)
        for part, lead in find_lead_parts(first).items()
    }


def _find_always_rigid_bodies(case: Case) -> dict[int, int]:
    """Return the rigid body of each part with *MAT_RIGID, named after its lowest part.

    The keyword *CONSTRAINED_RIGID_BODIES merges such parts.
    """
    pairs = [merged for _, merged in read_merged_bodies(case.deck)]

    def find_merged(part: int) -> list[int]:
        return [other for pair in pairs if part in pair for other in pair]

    return {
        part: min(find_reachable([part], find_merged))
        for part in case.parts.material_by_part
        if case.parts.is_rigid(part)
    }


def find_lead_parts(first: Mapping[int, SwitchEvent]) -> dict[int, int]:
    """Return the lead part of the rigid body of each part in ``first``, by part id.

    The lead part is the end of the chain of LRB entries.  A part that is not merged leads itself.
    """
    leads = {
        part: event.line.lead.value for part, event in first.items() if event.line.lead
    }

    def find_lead(part: int) -> list[int]:
        lead = leads.get(part)
        return [lead] if lead else []

    return {part: find_reachable([part], find_lead)[-1] for part in first}


def are_rigid_together(case: Case, first: Unit, second: Unit) -> bool:
    """Return True if two parts or sets may be rigid at the same time; this is assumed if a force switches them."""
    if {first, second} & case.windows.other_rigid:
        return True
    far = float("inf")
    spans = {
        unit: [
            (w.tr, far if w.td is None else w.td)
            for w in case.windows.windows
            if w.unit == unit
        ]
        for unit in (first, second)
    }
    return any(a < d and c < b for a, b in spans[first] for c, d in spans[second])


@set_passing(lambda: [PASS, _make_solid_deck("0"), _make_solid_deck("2", "0.0")])
@set_failing(
    lambda: [_make_solid_deck("2"), _make_solid_deck(""), _make_solid_deck("13")]
)
@make_rule_decorator(
    "D2R116", WARNING, "solids whose stresses do not rotate with the rigid body", BOTH
)
def _check_unturned_stresses(case: Case) -> Iterator[PlacedMessage]:
    """While a part is rigid, the solver does not compute its elements. Formulations without a co-rotational stress
    update keep their stresses in global axes, so after a rotation the elements spring back in the wrong direction.
    Parts that are rigid from the start have no stress, so d2rpick does not report them. Source for Radioss: Altair's
    help (bricks with Isolid 1 or 2 without Iframe 2, tetrahedra, 16-node thick shells, 20-node bricks; not HEPH or
    HA8). For LS-DYNA the rule follows from the theory of the formulations; sources disagree on what LS-DYNA does with
    the stresses.

    Fix: Use a co-rotational formulation for these solids or keep them deformable. If the part rotates little between
    tr and td, the error is small.
    """
    loaded = [
        window
        for window in case.windows.windows
        if window.td is not None and window.tr > 0
    ]
    formulations = case.unturned if loaded else {}
    affected = (
        (window.part, window.opened.line.part.field)
        for window in loaded
        if window.part in formulations
    )
    for formulation, affected_parts in group_values(
        (formulations[part], (part, field))
        for part, field in affected
        if part is not None
    ).items():
        names = name_units(part for part, _ in affected_parts)
        problem = f"{names} of solids without a co-rotational frame ({formulation})"
        why = "the locked-in stresses do not rotate with the rigid body, which is wrong after a large rotation"
        yield affected_parts[0][1], f"{problem}: {why}; use a co-rotational formulation"


def _report_unswitchable(case: Case, *, flows: bool) -> Iterator[PlacedMessage]:
    """Yield the parts that must not be switched but that a card makes rigid at some time."""
    if case.sets:
        reasons = {
            part: unswitchable.reason
            for part, unswitchable in case.unswitchable.items()
            if unswitchable.flows == flows
        }
    else:
        reasons = {}
    opened = [
        event
        for event in case.windows.events
        if event.line.to_rigid and event.unit.part in reasons
    ]
    first = {event.unit.id: event for event in reversed(opened)}
    for reason, parts in group_values(
        (reasons[part], part) for part in sorted(first)
    ).items():
        yield (
            first[parts[0]].line.part.field,
            f"{name_units(parts)}: {reason}; keep it deformable",
        )


def _make_law_deck(law: str) -> Example:
    """Return a deck in which part 1 has the material law with the given keyword."""
    return make_deck(
        f"{law}\n         1     1.0e-9       1.0       0.3\n" + THERE + BACK
    )


@set_passing(lambda: [PASS, _make_solid_deck("1")])
@set_failing(
    lambda: [_make_solid_deck("5"), _make_solid_deck("11"), _make_solid_deck("12")]
)
@make_rule_decorator(
    "D2R118", ERROR, "a switched part whose material flows through its mesh", BOTH
)
def _check_flowing_material(case: Case) -> Iterator[PlacedMessage]:
    """Material flows through ALE and Eulerian elements (LS-DYNA: ELFORM 5, 6, 7, 11, 12; Radioss: /ALE/MAT,
    /EULER/MAT), so there is no body to make rigid. Source: the vendor's keyword data and Altair's help.

    Fix: Remove the part from the switching cards.
    """
    return _report_unswitchable(case, flows=True)


@set_passing(lambda: [PASS, _make_law_deck("*MAT_ELASTIC")])
@set_failing(
    lambda: [
        _make_law_deck("*MAT_MOONEY-RIVLIN_RUBBER"),
        _make_law_deck("*MAT_077_O"),
        _make_law_deck("*MAT_ORTHOTROPIC_ELASTIC"),
    ]
)
@make_rule_decorator(
    "D2R119", WARNING, "a switched part whose law keeps a stress-free reference", BOTH
)
def _check_reference_laws(case: Case) -> Iterator[PlacedMessage]:
    """Hyperelastic and total Lagrangian laws compute the stress from the deformation since the start. They do not use
    the stress that the part had when it was made rigid. After the switch back the part may have a stress that it did
    not have before. In Radioss, the rule applies to hyperelastic laws and to solids with Ismstr 10 to 12. Source: the
    theory of the laws, and a report of 2026 on a hyperelastic solid in LS-DYNA R14. Not tested with the solver.

    Fix: Keep the part deformable, or compare its stress after td with the reference run.
    """
    return _report_unswitchable(case, flows=False)
