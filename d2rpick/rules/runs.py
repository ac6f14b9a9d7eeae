"""D2R401-405: the legs of a Radioss run."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

from d2rpick.errors import name_units
from d2rpick.rules.base import RADIOSS, Rule, Severity
from d2rpick.rules.example_runs import GOOD_RUN, WINDOW, engine_files, run_of, starter_deck
from d2rpick.rules.run_case import RunCase

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.radioss_engine import Leg
    from d2rpick.rules.base import Case, Objection

_MOST_CAP = 0.01  # of the rigid window: the release comes up to a step late
_MOST_LISTED = 8


def _switching_legs(case: Case) -> list[Leg]:
    """Legs of a run in which one switches a body; none of any other, whose legs are nobody's business here."""
    legs = case.run.legs if isinstance(case, RunCase) else []
    return legs if any(leg.switched for leg in legs) else []


def _order(case: Case) -> Iterator[Objection]:
    legs = _switching_legs(case)
    for expected, leg in enumerate(legs, start=1):
        if leg.number != expected:
            yield leg.run.here, f"leg {leg.number} of the run, leg {expected} was expected; add or write the others"
            break
    for before, leg in pairwise(legs):
        if not leg.stop.problem and not before.stop.problem and leg.stop.value < before.stop.value:
            place = before.stop.field
            found = f"leg {leg.number} ends at {leg.stop.value:g}, before leg {before.number} at {before.stop.value:g}"
            yield leg.stop.field, f"{found} ({place.file}:{place.line}); the end of each leg must follow the one before"
        if leg.name.casefold() != before.name.casefold():
            yield leg.run.here, f"leg {leg.number} belongs to run {leg.name!r}, the one before to {before.name!r}"


def _main_nodes(case: Case) -> Iterator[Objection]:
    if not isinstance(case, RunCase) or case.run.starter is None or case.run.starter.moved or case.unread:
        return
    bodies = {body.node.value: body for body in case.run.starter.bodies}
    by_id = {body.id: body for body in bodies.values()}
    for leg in case.run.legs:
        for _, _, nodes in leg.switched:
            for node in nodes:
                if node.problem or node.value == 0 or node.value in bodies:
                    continue
                mixed = by_id.get(node.value)
                hint = f"it is the id of rigid body {mixed.id}, whose main node is {mixed.node.value}" if mixed else ""
                there = ", ".join(map(str, sorted(bodies)[:_MOST_LISTED])) or "none"
                found = f"{node.value} is not the main node of a rigid body, so it is skipped without a message"
                yield node.field, f"{found}; {hint or f'main nodes here: {there}'}"


def _never_off(case: Case) -> Iterator[Objection]:
    if not isinstance(case, RunCase) or not case.run.legs or case.run.legs[0].number != 1:
        return
    said: set[int] = set()
    for leg in case.run.legs:
        for card, rigid, nodes in leg.switched:
            late = [node.value for node in nodes if node.value and node.value not in said]
            if rigid and late and leg.number > 1:
                found = f"{name_units(late, 'main node')} switched on in leg {leg.number}, but rigid from the start"
                yield card.here, f"{found}: no leg before says /RBODY/OFF; add it to leg 1"
            said.update(node.value for node in nodes)


def _step(case: Case) -> Iterator[Objection]:
    if not isinstance(case, RunCase):
        return
    for index, held in case.rigid_legs:
        leg = case.run.legs[index]
        back = [window.td - window.tr for window in held if window.td is not None]
        if leg.cap is not None and not leg.cap.problem and back and leg.cap.value > _MOST_CAP * min(back):
            found = f"/DTIX lets the step grow to {leg.cap.value:g} in a rigid window of {min(back):g}"
            yield leg.cap.field, f"{found}; the release may come a step late: take less than a hundredth of it"
        elif leg.cap is None and back and not _deformable_left(case, {window.unit.id for window in held}):
            yield (
                leg.run.here,
                f"nothing is deformable in leg {leg.number}, so the step grows without limit; add /DTIX",
            )


def _deformable_left(case: RunCase, rigid: set[int]) -> bool:
    """Whether an element may lie outside the parts that are rigid; where that is not known it may."""
    if case.run.starter is None or not case.found.parts or case.deck.unread:
        return True
    kinds = {part for part, _ in case.run.starter.elements()}
    return not kinds or bool(kinds - rigid)


def _versions(case: Case) -> Iterator[Objection]:
    for before, leg in pairwise([leg for leg in _switching_legs(case) if leg.version]):
        if leg.version != before.version:
            found = f"/VERS/{leg.version} in leg {leg.number}, /VERS/{before.version} in leg {before.number}"
            yield leg.run.here, f"{found}; fields are read by the version: give the same in all legs"


_MIXED: Final = {
    name: text.replace("VERS/2022", "VERS/2019") if "0002" in name else text
    for name, text in engine_files(*WINDOW).items()
}

RULES: Final = (
    Rule(
        "D2R401",
        Severity.ERROR,
        "legs of a Radioss run that do not follow each other",
        "Each engine file continues the run where the one before ended: their numbers count up from 1, their /RUN "
        "names are the same, and none ends before the one before it. Otherwise nothing can be said about when a part "
        "is rigid. Two legs with the same end are not reported. Source: Altair's help for /RUN, and runs computed with "
        "OpenRadioss.",
        _order,
        (GOOD_RUN, run_of(engine_files(("0.05", "ON"), ("0.05", "OFF")))),
        (
            run_of(engine_files(("0.09", "OFF"), ("0.02", "ON"), ("0.2", "OFF"))),
            run_of({name: text for name, text in engine_files(*WINDOW).items() if "0002" not in name}),
        ),
        (RADIOSS,),
    ),
    Rule(
        "D2R402",
        Severity.ERROR,
        "/RBODY/ON or /RBODY/OFF names what is not a main node",
        "The engine takes the main nodes of rigid bodies, not the ids of bodies, and skips an unknown one without a "
        "message: the part stays as it was. 0 names nothing and is not reported. Judged only when the starter deck and "
        "its includes could be read. Source: Altair's help and the published source of OpenRadioss.",
        _main_nodes,
        (GOOD_RUN, run_of(engine_files(*WINDOW, node="0"))),
        (run_of(engine_files(*WINDOW, node="1")), run_of(engine_files(*WINDOW, node="1808 77"))),
        (RADIOSS,),
    ),
    Rule(
        "D2R403",
        Severity.WARNING,
        "/RBODY/ON in a later leg for a body that was rigid from the start",
        "A rigid body is on by default in the first leg. Where no leg before says /RBODY/OFF the part is rigid from "
        "time 0 on, through the load as well. Source: Altair's help for /RBODY in engine files.",
        _never_off,
        (GOOD_RUN, run_of(engine_files(("0.09", "ON"), ("0.2", "OFF")))),
        (run_of(engine_files(("0.02", ""), ("0.09", "ON"), ("0.2", "OFF"))),),
        (RADIOSS,),
    ),
    Rule(
        "D2R404",
        Severity.WARNING,
        "no limit of the time step, or a large one, in a leg with rigid parts",
        "With nothing deformable left the step grows by 10 % per cycle without limit, and the release comes late with "
        "a kick; /DTIX caps it. A cap above a hundredth of the rigid window is reported too. A leg without cap is "
        "reported only where every element lies in a rigid part. Source: runs computed with OpenRadioss (td came "
        "0.26 ms late).",
        _step,
        (
            GOOD_RUN,
            run_of(
                engine_files(*WINDOW, cap=""),
                starter_deck().replace("/RBODY", "/SHELL/2\n         2         1\n/RBODY"),
            ),
        ),
        (run_of(engine_files(*WINDOW, cap="")), run_of(engine_files(*WINDOW, cap="1e-5 1e-3"))),
        (RADIOSS,),
    ),
    Rule(
        "D2R405",
        Severity.WARNING,
        "legs of different /VERS",
        "The version says how the fields of an engine file are read. Source: Altair's help for /VERS; that a mixture "
        "does harm was not seen.",
        _versions,
        (GOOD_RUN,),
        (run_of(_MIXED),),
        (RADIOSS,),
    ),
)
