"""D2R103, D2R104, D2R106-108: the parts that are switched."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.deck.elements import first_shared_nodes
from d2rpick.errors import name_units
from d2rpick.rules.base import BOTH, Example, Rule, Severity
from d2rpick.rules.example_decks import BACK, END, GOOD, HEAD, PARTS, THERE, automatic

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from d2rpick.deck import Parts, SwitchSet
    from d2rpick.deck.switching import Switched
    from d2rpick.deck.windows import Event, Unit
    from d2rpick.rules.base import Case, Objection

_NEAREST = 3  # ids that are named in place of one that the deck does not have


def _by_card(events: Iterable[Event]) -> dict[SwitchSet, list[Event]]:
    found: dict[SwitchSet, list[Event]] = {}
    for event in events:
        found.setdefault(event.by, []).append(event)
    return found


def _named(events: Iterable[Event]) -> str:
    by_kind: dict[str, list[int]] = {}
    for event in events:
        by_kind.setdefault(event.unit.kind, []).append(event.unit.id)
    return " and ".join(name_units(ids, kind) for kind, ids in sorted(by_kind.items()))


def _unknown_members(case: Case, *, to_rigid: bool) -> bool:
    """Whether a part set that cannot be resolved is switched: any part may be in it."""
    return any(event.unit.is_set and event.line.to_rigid == to_rigid for event in case.windows.events)


def _never_rigid(case: Case) -> Iterator[Objection]:
    if _unknown_members(case, to_rigid=True):
        return
    orphans = [
        event
        for event in case.windows.orphans
        if event.unit not in case.windows.other_rigid and not case.parts.is_rigid(event.unit.id)
    ]
    for events in _by_card(orphans).values():
        yield (
            events[0].line.part.field,
            (f"{_named(events)} switched back, but no card makes it rigid before; add the D2R line or remove this"),
        )


def _never_back(case: Case) -> Iterator[Objection]:
    if _unknown_members(case, to_rigid=False):
        return
    opened = [
        window.opened
        for window in case.windows.windows
        if window.closed is None and window.unit not in case.windows.other_deformable
    ]
    for card, events in _by_card(opened).items():
        yield (
            events[0].line.part.field,
            f"{_named(events)} made rigid at {card.time:g} and never switched back in this deck",
        )


def _exists(case: Case) -> Iterator[Objection]:
    if not (case.parts.all_known and case.parts.materials):
        return  # a file with nothing but cards is for another deck to include
    for card in case.sets:
        missing: dict[str, list[int]] = {}
        for line in card.switched:
            if not line.part.problem:
                for kind, absent in _absent(line, case.parts).items():
                    missing.setdefault(kind, []).extend(absent)
            if line.lead and line.lead.value and line.lead.value not in case.parts.materials:
                missing.setdefault("lead part", []).append(line.lead.value)
        for kind, ids in missing.items():
            if ids:
                near = "" if kind == "part set" else _nearest(ids[0], case.parts)
                what = f"{name_units(ids, kind)} not in the deck{near}"
                yield card.card.here, f"{what}; check the ids and include offsets"
        empty = [
            line.part.value
            for line in card.switched
            if line.by_set and not line.part.problem and case.parts.members(line.part.value) == ()
        ]
        if empty:
            yield card.card.here, f"{name_units(empty, 'part set')} without a part in the deck, so nothing is switched"


def _nearest(number: int, parts: Parts) -> str:
    """List the nearest ids of the deck, with their titles."""
    near = sorted(sorted(parts.materials, key=lambda part: abs(part - number))[:_NEAREST])
    listed = (f"{part} {parts.titles[part]!r}" if parts.titles[part] else str(part) for part in near)
    return f" (nearest to {number}: {', '.join(listed)})"


def _absent(line: Switched, parts: Parts) -> dict[str, list[int]]:
    """Part, part sets and members of part sets of a line that the deck does not have."""
    if not line.by_set:
        return {"part": [line.part.value] if line.part.value not in parts.materials else []}
    members = parts.members(line.part.value) or ()
    return {
        "part set": [one for one in parts.reached(line.part.value) if one not in parts.sets],
        "part": [part for part in members if part not in parts.materials],
    }


def _always_rigid(case: Case) -> Iterator[Objection]:
    back = [
        event
        for event in case.windows.events
        if not event.line.to_rigid and not event.unit.is_set and case.parts.is_rigid(event.unit.id)
    ]
    for events in _by_card(back).values():
        yield (
            events[0].line.part.field,
            (
                f"{_named(events)} has *MAT_RIGID and cannot become deformable; give it its deformable "
                "material and let a D2R line make it rigid"
            ),
        )


def _torn(case: Case) -> Iterator[Objection]:
    made = [event for event in case.windows.events if event.line.to_rigid and not event.unit.is_set]
    first = {event.unit.id: event for event in reversed(made)}
    bodies = {part: _body(part, first) for part in first}
    if len(set(bodies.values())) < 2:
        return
    for (low, high), node in first_shared_nodes(case.deck, bodies).items():
        if _together(case, first[low].unit, first[high].unit):
            place = (first[high].line.lead or first[high].line.part).field
            named = " and ".join(f"part {part}{_of_set(first[part])}" for part in (low, high))
            yield (
                place,
                (
                    f"{named} share node {node} but become separate rigid bodies that both own "
                    f"it; merge them: LRB {low} on the line of part {high}{_of_set(first[high])}"
                ),
            )


def _of_set(event: Event) -> str:
    return f" (of part set {event.line.part.value})" if event.line.by_set else ""


def _body(part: int, first: dict[int, Event]) -> int:
    """Return the lead at the end of the LRB chain; a part that merges into nobody leads itself."""
    seen = {part}
    while part in first:
        lead = first[part].line.lead
        if lead is None or not lead.value or lead.value in seen:
            break
        part = lead.value
        seen.add(part)
    return part


def _together(case: Case, one: Unit, other: Unit) -> bool:
    """Whether two units may be rigid at the same time; by force nobody knows."""
    if {one, other} & case.windows.other_rigid:
        return True
    far = float("inf")
    spans = {
        unit: [(w.tr, far if w.td is None else w.td) for w in case.windows.windows if w.unit == unit]
        for unit in (one, other)
    }
    return any(a < d and c < b for a, b in spans[one] for c, d in spans[other])


_LAYERED = "*PART_COMPOSITE\nroof\n         7         2\n         1       0.5\n"
_RIGID = "*MAT_RIGID\n         1    7.8E-9     210.0       0.3\n"
_TOUCHING = """\
*ELEMENT_SHELL
       1       1       1       2       3       4
       2       2       3       4       5       6
"""


def _both(*lines: str) -> Example:
    there = automatic(1, "0.02", rigid=lines)
    return Example(HEAD + PARTS + _TOUCHING + there + automatic(2, "0.09", deformable=["1", "2"]) + END)


_LAYERS, _BEAMS = (
    Example(_both("1", "2").deck.replace(_TOUCHING, text))
    for text in (
        _TOUCHING.replace("SHELL", "SHELL_COMPOSITE").replace("       4\n", "       4\n         1       0.5\n"),
        "*ELEMENT_BEAM_ELFORM\n" + "".join(f"{one:8d}{one:8d}{one:8d}{one + 1:8d}\n{1:10d}\n" for one in (1, 2)),
    )
)

RULES: Final = (
    Rule(
        "D2R103",
        Severity.ERROR,
        "a part switched back that nothing made rigid",
        "An R2D line for a part that no D2R line made rigid before has no effect; usually an id is "
        "wrong on one of the two cards.",
        _never_rigid,
        (Example(GOOD),),
        (
            Example(HEAD + PARTS + BACK + END),
            Example(HEAD + PARTS + THERE + BACK.replace("  1  ", "  2  ") + END),
        ),
    ),
    Rule(
        "D2R104",
        Severity.INFO,
        "a part made rigid and never switched back",
        "It stays rigid to the end of the run, unless a restart deck switches it back. What it would have "
        "deformed in the next contact is missing from the result.",
        _never_back,
        (Example(GOOD),),
        (
            Example(HEAD + PARTS + THERE + END),
            Example(HEAD + PARTS + "*DEFORMABLE_TO_RIGID\n         1\n" + END),
        ),
        solvers=BOTH,
    ),
    Rule(
        "D2R106",
        Severity.ERROR,
        "part or part set not in the deck (only when every include was read)",
        "A switching card names a part, part set or lead part that no *PART or *SET_PART defines, or a set "
        "without parts. Judged "
        "only when all of the deck could be read and it has parts at all.",
        _exists,
        (
            Example(GOOD),
            Example(THERE + BACK),
            Example(HEAD + PARTS + "*INCLUDE\nmore_parts.k\n" + BACK + END),
        ),
        (
            Example(HEAD + PARTS + automatic(1, "0.02", rigid=["7"]) + END),
            *(
                Example(HEAD + PARTS + text + "*DEFORMABLE_TO_RIGID\n         3         0      PSET\n" + END)
                for text in ("", "*SET_PART\n         3\n", "*SET_PART\n         3\n         1         7\n")
            ),
            Example(HEAD + PARTS + _LAYERED + automatic(1, "0.02", rigid=["8"]) + END),
        ),
    ),
    Rule(
        "D2R107",
        Severity.WARNING,
        "a *MAT_RIGID part switched to deformable",
        "A part with *MAT_RIGID is rigid from the start and cannot become deformable. It must be modelled "
        "with its deformable material and made rigid by the card.",
        _always_rigid,
        (Example(GOOD),),
        (Example(HEAD + PARTS + _RIGID + BACK + END),),
    ),
    Rule(
        "D2R108",
        Severity.WARNING,
        "several parts made rigid with LRB 0 although they share nodes",
        "With LRB 0 each part becomes a rigid body of its own, and the bodies fight over the nodes they "
        "share. Merge them: the lead part with LRB 0, the others with LRB = the lead.",
        _torn,
        (_both("1", "         2         1      PART"),),
        (_both("1", "2"), _LAYERS, _BEAMS),
    ),
)
