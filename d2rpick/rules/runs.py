"""D2R307, D2R401-409, D2R411-412: the legs of a Radioss run, and its rigid bodies.

Bodies may go through walls, begin at rest, or be rigid all along.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import name_units
from d2rpick.deck.radioss_files import AT_REST, NOT_FOLLOWED, THROUGH_WALL
from d2rpick.rules.base import ERROR, INFO, RADIOSS, WARNING, Objection, RunCase
from d2rpick.rules.rule import (
    GOOD_RUN,
    WINDOW,
    Example,
    engine_files,
    fails,
    passes,
    rule,
    run_of,
    starter_deck,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.radioss_deck import Leg
    from d2rpick.deck.radioss_run import LeftRigid

_MOST_CAP = 0.01  # of the rigid window: the release comes up to a step late
_MOST_LISTED = 8

_MIXED: Final = {
    name: text.replace("VERS/2022", "VERS/2019") if "0002" in name else text
    for name, text in engine_files(*WINDOW).items()
}


def _row(*fields: float | str, width: int = 10) -> str:
    return "".join(f"{field:>{width}}" for field in fields) + "\n"


_LEGS: Final = engine_files(*WINDOW)
_NODES: Final = "/GRNOD/NODE/8\nnodes of the box\n" + _row(1, 2, 3, 4)
_MAIN: Final = "/GRNOD/NODE/9\nmain node\n" + _row(1808)
_PLACES: Final = "/NODE\n" + "".join(
    _row(n)[:-1] + _row(0.1 * n, 0.0, 0.05, width=20) for n in (1, 2, 3, 4)
)
_KEEPS: Final = (
    starter_deck()
    .partition("/GRNOD")[0]
    .replace("         7\n", "         7         1\n")
)  # Ikrem


def _wall(added: int, left_out: int = 0, reach: float = 0.0) -> str:
    """Write the ground, at z = 0: nodes of a group, less those of another, and those that are near."""
    text = (
        "/RWALL/PLANE/3\nground\n"
        + _row(0, 0, added, left_out)
        + _row(reach, 0.0, 0.0, width=20)
    )
    return text + _row(0.0, 0.0, 0.0, width=20) + _row(0.0, 0.0, 1.0, width=20)


def _velocity(group: int, speed: float = 10.0) -> str:
    return (
        "/INIVEL/TRA/4\nthrown\n" + _row(speed, 0.0, 0.0, width=20)[:-1] + _row(group)
    )


def _with(*more: str) -> Example:
    """Add to the starter deck of a good run."""
    return run_of(_LEGS, starter_deck(more="".join(more)))


def _start(state: str, *nodes: int) -> Example:
    """Give nodes a velocity in the first leg, in which the body is on or off."""
    files = engine_files(("0.02", state), ("0.2", "OFF"))
    files["box_0001.rad"] += "/INIV/TRA/X/1\n10.0\n" + _row(*nodes)
    return run_of(files, starter_deck(_NODES.replace("NODE/8", "NODE/7")))


# A matsum in which the third part deforms, and no other.
_SPRING: Final = "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.3 --dt 1e-3 --write-as matsum"


def _wheel(
    named: str = "", members: tuple[int, ...] = (5, 6, 7, 8), part: int = 2
) -> Example:
    """Add a wheel that is a rigid body of its own; ``named`` stands in the /RBODY/OFF of the first leg too."""
    mesh = f"/PART/{part}\nwheel\n{_row(1, 1)}/SHELL/{part}\n{_row(2, 5, 6, 7, 8)}"
    wheel = f"{mesh}/GRNOD/NODE/6\nwheel\n{_row(*members)}"
    body = "/RBODY/2\nwheel\n" + _row(1809, 0, 0, 0, "", 0, 6)
    files = {
        **_LEGS,
        "box_0001.rad": _LEGS["box_0001.rad"].replace("1808\n", f"1808 {named}\n"),
    }
    return run_of(files, starter_deck(more=wheel + body))


def _switching_legs(case: RunCase) -> list[Leg]:
    """Legs of a run in which one switches a body; none of any other, whose legs are nobody's business here."""
    return case.run.legs if any(leg.switched for leg in case.run.legs) else []


@passes(GOOD_RUN, run_of(engine_files(("0.05", "ON"), ("0.05", "OFF"))))
@fails(
    run_of(engine_files(("0.09", "OFF"), ("0.02", "ON"), ("0.2", "OFF"))),
    run_of(
        {
            name: text
            for name, text in engine_files(*WINDOW).items()
            if "0002" not in name
        }
    ),
)
@rule(
    "D2R401", ERROR, "legs of a Radioss run that do not follow each other", (RADIOSS,)
)
def _order(case: RunCase) -> Iterator[Objection]:
    """Each engine file continues the run where the one before ended: their numbers count up from 1, their /RUN names
    are the same, and none ends before the one before it. Otherwise nothing can be said about when a part is rigid.
    Two legs with the same end are not reported. Source: Altair's help for /RUN, and runs computed with OpenRadioss.
    """
    legs = _switching_legs(case)
    for expected, leg in enumerate(legs, start=1):
        if leg.number != expected:
            yield (
                leg.run.here,
                f"leg {leg.number} of the run, leg {expected} was expected; add or write the others",
            )
            break
    for before, leg in pairwise(legs):
        if (
            not leg.stop.problem
            and not before.stop.problem
            and leg.stop.value < before.stop.value
        ):
            place = before.stop.field
            found = f"leg {leg.number} ends at {leg.stop.value:g}, before leg {before.number} at {before.stop.value:g}"
            yield (
                leg.stop.field,
                f"{found} ({place.at}); the end of each leg must follow the one before",
            )
        if leg.name.casefold() != before.name.casefold():
            yield (
                leg.run.here,
                f"leg {leg.number} belongs to run {leg.name!r}, the one before to {before.name!r}",
            )


@passes(GOOD_RUN, run_of(engine_files(*WINDOW, node="0")))
@fails(
    run_of(engine_files(*WINDOW, node="1")),
    run_of(engine_files(*WINDOW, node="1808 77")),
)
@rule(
    "D2R402", ERROR, "/RBODY/ON or /RBODY/OFF names what is not a main node", (RADIOSS,)
)
def _main_nodes(case: RunCase) -> Iterator[Objection]:
    """The engine takes the main nodes of rigid bodies, not the ids of bodies, and skips an unknown one without a
    message: the part stays as it was. It skips the main node of a body that /MERGE/RBODY joins to another, too. 0
    names nothing and is not reported. Judged only when the starter deck and its includes could be read. Source:
    Altair's help and the published source of OpenRadioss.
    """
    if case.run.starter is None or case.run.starter.moved or case.unread:
        return
    bodies = {body.node.value: body for body in case.run.starter.bodies}
    by_id = {body.id: body for body in bodies.values() if body.id}
    joined_to = case.run.starter.rigid.joined_to
    for leg in case.run.legs:
        for _, _, nodes in leg.switched:
            for node in nodes:
                if node.problem or node.value == 0 or node.value in bodies:
                    continue
                mixed = by_id.get(node.value)
                hint = (
                    f"it is the id of rigid body {mixed.id}, whose main node is {mixed.node.value}"
                    if mixed
                    else ""
                )
                if main := joined_to.get(node.value):
                    hint = f"its body is merged into {main.name}, whose main node is {main.node.value}"
                there = ", ".join(map(str, sorted(bodies)[:_MOST_LISTED])) or "none"
                found = f"{node.value} is not the main node of a rigid body, so it is skipped without a message"
                yield node.field, f"{found}; {hint or f'main nodes here: {there}'}"


@passes(GOOD_RUN, run_of(engine_files(("0.09", "ON"), ("0.2", "OFF"))))
@fails(run_of(engine_files(("0.02", ""), ("0.09", "ON"), ("0.2", "OFF"))))
@rule(
    "D2R403",
    WARNING,
    "/RBODY/ON in a later leg for a body that was rigid from the start",
    (RADIOSS,),
)
def _never_off(case: RunCase) -> Iterator[Objection]:
    """A rigid body is on by default in the first leg. Where no leg before says /RBODY/OFF the part is rigid from
    time 0 on, through the load as well. A node that D2R402 reports is not reported here. Source: Altair's help for
    /RBODY in engine files.
    """
    if not case.run.legs or case.run.legs[0].number != 1:
        return
    starter = case.run.starter
    known = starter is not None and not starter.moved and not case.unread
    said = (
        {*case.run.named} - {body.node.value for body in starter.bodies}
        if starter and known
        else set[int]()
    )
    for leg in case.run.legs:
        for card, rigid, nodes in leg.switched:
            late = [
                node.value for node in nodes if node.value and node.value not in said
            ]
            if rigid and late and leg.number > 1:
                found = f"{name_units(late, 'main node')} switched on in leg {leg.number}, but rigid from the start"
                yield (
                    card.here,
                    f"{found}: no leg before says /RBODY/OFF; add it to leg 1",
                )
            said.update(node.value for node in nodes)


@passes(GOOD_RUN, run_of(engine_files(("0.09", "ON"), ("0.1", ""), ("0.2", "OFF"))))
@fails(
    run_of(
        engine_files(("0.02", "OFF"), ("0.05", "ON"), ("0.09", "ON"), ("0.2", "OFF"))
    )
)
@rule(
    "D2R411",
    WARNING,
    "/RBODY/ON in a later leg for a body that is rigid already",
    (RADIOSS,),
)
def _on_again(case: RunCase) -> Iterator[Objection]:
    """What a restart finds rigid stays so. Switched on once more it moves as before, but the internal energy of its
    elements is counted again: in one run the model had a third too much of it behind td. Source: runs computed with
    OpenRadioss.
    """
    rigid_now: set[int] = set()
    for leg in case.run.legs:
        for card, rigid, nodes in leg.switched:
            named = {node.value for node in nodes}
            again = sorted(named & rigid_now)
            if rigid and again:
                found = f"{name_units(again, 'main node')} switched on in leg {leg.number}, though rigid already"
                yield (
                    card.here,
                    f"{found}: the internal energy behind it is too high; remove it from this leg",
                )
            rigid_now = rigid_now | named if rigid else rigid_now - named


@passes(
    GOOD_RUN,
    run_of(
        engine_files(*WINDOW, cap=""),
        starter_deck().replace("/RBODY", "/SHELL/2\n         2         1\n/RBODY"),
    ),
)
@fails(
    run_of(engine_files(*WINDOW, cap="")),
    run_of(engine_files(*WINDOW, cap="1e-5 1e-3")),
)
@rule(
    "D2R404",
    WARNING,
    "no limit of the time step, or a large one, in a leg with rigid parts",
    (RADIOSS,),
)
def _step(case: RunCase) -> Iterator[Objection]:
    """With nothing deformable left the step grows by 10 % per cycle without limit, and the release comes late with a
    kick; /DTIX caps it. A cap above a hundredth of the rigid window is reported too. A leg without cap is reported
    only where every element lies in a rigid part. Source: runs computed with OpenRadioss (td came 0.26 ms late).
    """
    for index, held in case.rigid_legs:
        leg = case.run.legs[index]
        back = [window.td - window.tr for window in held if window.td is not None]
        if (
            leg.cap is not None
            and not leg.cap.problem
            and back
            and leg.cap.value > _MOST_CAP * min(back)
        ):
            found = f"/DTIX lets the step grow to {leg.cap.value:g} in a rigid window of {min(back):g}"
            yield (
                leg.cap.field,
                f"{found}; the release may come a step late: take less than a hundredth of it",
            )
        elif (
            leg.cap is None
            and back
            and not _deformable_left(case, {window.unit.id for window in held})
        ):
            found = f"nothing is deformable in leg {leg.number}, so the step grows without limit"
            yield leg.run.here, f"{found}; add /DTIX"


def _deformable_left(case: RunCase, rigid: set[int]) -> bool:
    """Whether an element may lie outside the parts that are rigid; where that is not known it may."""
    if case.run.starter is None or not case.found.parts or case.deck.unread:
        return True
    from d2rpick.deck.mesh import parts_with_elements  # loads numpy

    parts = parts_with_elements(case.run.starter)
    return not parts or bool(parts - rigid)


@fails(run_of(_MIXED))
@rule("D2R405", WARNING, "legs of different /VERS", (RADIOSS,))
def _versions(case: RunCase) -> Iterator[Objection]:
    """The version says how the fields of an engine file are read. Source: Altair's help for /VERS; that a mixture
    does harm was not seen.
    """
    for before, leg in pairwise([leg for leg in _switching_legs(case) if leg.version]):
        if leg.version != before.version:
            found = f"/VERS/{leg.version} in leg {leg.number}, /VERS/{before.version} in leg {before.number}"
            yield (
                leg.run.here,
                f"{found}; fields are read by the version: give the same in all legs",
            )


def _flaws(case: RunCase, *, code: str) -> Iterator[Objection]:
    for flaw in case.flaws:
        if flaw.code == code:
            yield flaw.place, flaw.message


@passes(
    GOOD_RUN,
    _wheel("1809"),
    _wheel(members=(5, 6, 7)),
    run_of(engine_files(("0.2", "OFF")), _wheel().deck),
)
@fails(_wheel())
@rule(
    "D2R408",
    WARNING,
    "a rigid body that no leg switches, in a run that switches others",
    (RADIOSS,),
)
def _left_rigid(case: RunCase) -> Iterator[Objection]:
    """A body is on from time 0 unless the first leg says /RBODY/OFF, and what it holds is rigid to the end: the
    wheels of a car whose legs name its body alone. Reported where the body holds whole parts, and no history tells
    whether these deform: it may be meant, and a comment silences it; D2R409 is for what a history tells. Source:
    Altair's help for /RBODY in engine files, and runs computed with OpenRadioss.
    """
    left, deforming = _left_rigid_parts(case)
    if left and deforming is None:
        yield (
            left.place,
            f"{left.found}; where the run without switching keeps the bodies off, {left.way_out}",
        )


@passes(GOOD_RUN, _wheel(), _wheel()._replace(history=_SPRING))
@fails(_wheel(part=3)._replace(history=_SPRING))
@rule(
    "D2R409",
    ERROR,
    "a rigid body that no leg switches, though its parts deform in the history",
    (RADIOSS,),
)
def _left_rigid_deforming(case: RunCase) -> Iterator[Objection]:
    """As D2R408, where a history has internal energy of the parts of that body: they deform in the run without
    switching, and cannot in this one. Where the history has their energy and it is zero, they are meant to be rigid.
    """
    left, deforming = _left_rigid_parts(case)
    if left and deforming:
        yield left.place, f"{left.found}, which deform in the history; {left.way_out}"


def _left_rigid_parts(case: RunCase) -> tuple[LeftRigid | None, tuple[int, ...] | None]:
    """What no leg switches, and which of its parts deform; None where no history tells."""
    from d2rpick.deck.radioss_run import left_rigid  # not above: start-up

    left = left_rigid(case.run, case.windows.windows)
    return left, case.judge.deforming(left.parts) if left and case.judge else None


@passes(GOOD_RUN, _with(_NODES, _wall(8)))
@fails(
    _with("/GRNOD/BOX/8\nbox\n", _row(1), _wall(8)),
    _with(_velocity(8)),
    _with(_PLACES, "/TRANSFORM/TRA/1\n", _wall(0, 0, 0.1)),
)
@rule(
    "D2R307",
    INFO,
    "a rigid wall, an initial velocity or a rigid body whose nodes are not known",
    (RADIOSS,),
)
def _d2r307(case: RunCase) -> Iterator[Objection]:
    """What walls and velocities do to the nodes of rigid bodies (D2R406, D2R407) is judged by groups of nodes, parts
    and subsets, and by the distance from the wall. Other groups, nodes that /TRANSFORM moves and the ids of a
    //SUBMODEL are not followed.
    """
    return _flaws(case, code=NOT_FOLLOWED)


@passes(
    GOOD_RUN,
    _with(_NODES, _wall(8, 8)),
    run_of(_LEGS, f"{_KEEPS}{_NODES.replace('/8', '/7')}{_wall(7)}/END\n"),
    _with(_PLACES, _wall(0, 0, 0.01)),
    run_of({}, starter_deck(more=_NODES + _wall(8))),
)
@fails(_with(_NODES, _wall(8)), _with(_PLACES, _wall(0, 0, 0.1)), _with(_wall(7)))
@rule(
    "D2R406",
    ERROR,
    "a rigid wall that does not hold what a switched rigid body holds",
    (RADIOSS,),
)
def _d2r406(case: RunCase) -> Iterator[Objection]:
    """The starter removes the nodes of every /RBODY with Ikrem 0 from all /RWALL, also of one that the engine puts
    off in the first leg (warning 446): what they hold goes through the wall. OpenRadioss takes the Ikrem of the
    /RBODY with the highest id for all. With Ikrem 1 the wall holds the nodes while the body is off, and not while it
    is on: switch back before it touches. Walls with the penalty formulation (Iform 1, since 2026) keep their nodes.
    Source: Altair's help for /RBODY and /RWALL, the published source of OpenRadioss, and runs computed with it (a
    car that flew through a pole).
    """
    return _flaws(case, code=THROUGH_WALL)


@passes(
    GOOD_RUN,
    _with(_NODES, _velocity(8), _MAIN, _velocity(9)),
    _with(_NODES, _velocity(8, 0.0)),
    _start("OFF", 1, 4),
    _start("ON", 1, 1808),
)
@fails(_with(_NODES, _velocity(8)), _with(_velocity(7)), _start("ON", 1, 4))
@rule(
    "D2R407",
    ERROR,
    "an initial velocity that moves nodes of a switched rigid body and not its main node",
    (RADIOSS,),
)
def _d2r407(case: RunCase) -> Iterator[Objection]:
    """The starter gives all nodes of an /RBODY the velocity of its main node, also of one that the engine puts off
    in the first leg. Where the node group of /INIVEL lacks that node the body begins at rest, without a message. An
    /INIV of an engine file moves a body that is on by its main node alone, one that is off by its nodes. Velocities
    that begin later (tstart, a sensor) are not judged. Source: runs computed with OpenRadioss.
    """
    return _flaws(case, code=AT_REST)


def _sensed(*lines: str) -> Example:
    """Let a sensor of time switch the body, with these lines below its title."""
    deck = starter_deck().replace(_row(1808, 0)[:-1], _row(1808, 5)[:-1])
    return run_of(
        engine_files(("0.2", "")),
        deck.replace("/END", f"/SENSOR/TIME/5\nclock\n{''.join(lines)}/END"),
    )


@passes(GOOD_RUN, _sensed(_row(0.02, width=20), _row(0.09, width=20)))
@fails(_sensed(_row(0.02, 0.09, width=20)))
@rule(
    "D2R412",
    WARNING,
    "a /SENSOR/TIME with a second number on the line of Tdelay",
    (RADIOSS,),
)
def _d2r412(case: RunCase) -> Iterator[Objection]:
    """Tstop has a line of its own below Tdelay. A number that stands behind Tdelay is not read, so the sensor stays
    active to the end, and the body that it switches deformable. Source: the format files of OpenRadioss, and runs
    computed with it.
    """
    for card in case.run.starter.named("SENSOR") if case.run.starter else ():
        rows = card.rows[1:2] if card.words[1:2] == ("TIME",) else ()
        for row in rows:
            if stop := row.text[20:40].strip():
                found = f"{stop} stands behind Tdelay, where nothing is read, so the sensor has no Tstop"
                yield row.field(2), f"{found}; put it on a line of its own"
