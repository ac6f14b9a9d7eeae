"""Define rules D2R307, D2R401-409 and D2R411-412: engine files and rigid bodies of a Radioss run."""

from __future__ import annotations

import os
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import name_units
from d2rpick.deck.radioss_columns import AFTER_DELAY
from d2rpick.deck.radioss_files import (
    AT_REST,
    NOT_FOLLOWED,
    THROUGH_WALL,
    find_packed_starter,
)
from d2rpick.rules.base import ERROR, INFO, RADIOSS, WARNING, PlacedMessage, RunCase
from d2rpick.rules.example import (
    WINDOW,
    Example,
    make_run,
    write_engine_files,
    write_row,
    write_starter_deck,
)
from d2rpick.rules.rule import GOOD_RUN, make_rule_decorator, set_failing, set_passing

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.radioss_deck import RadiossLeg
    from d2rpick.deck.radioss_run import LeftRigid

# Largest time step, as a fraction of the rigid window [-]; the parts are released up to one time step late.
_MOST_CAP = 0.01
_MOST_LISTED = 8  # Largest number of main nodes that a message lists.

_MIXED: Final = {
    name: text.replace("VERS/2022", "VERS/2019") if "0002" in name else text
    for name, text in write_engine_files(*WINDOW).items()
}

_LEGS: Final = write_engine_files(*WINDOW)
_KEEPS: Final = (
    write_starter_deck()
    .partition("/GRNOD")[0]
    .replace("         7\n", "         7         1\n")
)  # Starter deck with a rigid body for which Ikrem is 1.
_NODES: Final = "/GRNOD/NODE/8\nnodes of the box\n" + write_row(1, 2, 3, 4)
_MAIN: Final = "/GRNOD/NODE/9\nmain node\n" + write_row(1808)
_PLACES: Final = "/NODE\n" + "".join(
    write_row(n)[:-1] + write_row(0.1 * n, 0.0, 0.05, width=20) for n in (1, 2, 3, 4)
)
# Arguments of `d2rpick replay` for a matsum history in which only the third part deforms.
_SPRING: Final = "--stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.3 --dt 1e-3 --write-as matsum"


def _write_wall(added: int, left_out: int = 0, reach: float = 0.0) -> str:
    """Return a rigid wall at z = 0 that acts on nodes within ``reach`` and on group ``added``, not on ``left_out``."""
    text = (
        "/RWALL/PLANE/3\nground\n"
        + write_row(0, 0, added, left_out)
        + write_row(reach, 0.0, 0.0, width=20)
    )
    return (
        text + write_row(0.0, 0.0, 0.0, width=20) + write_row(0.0, 0.0, 1.0, width=20)
    )


def _write_velocity(group: int, speed: float = 10.0) -> str:
    """Return an /INIVEL that gives this speed to the nodes of a group."""
    return (
        "/INIVEL/TRA/4\nthrown\n"
        + write_row(speed, 0.0, 0.0, width=20)[:-1]
        + write_row(group)
    )


def _make_run_with(*more: str) -> Example:
    """Return an example run that passes all rules, with the given cards added to the starter deck."""
    return make_run(_LEGS, write_starter_deck(more="".join(more)))


def _make_started_run(state: str, *nodes: int) -> Example:
    """Return a run whose first engine file gives nodes an initial velocity while the body is ``state`` (ON or OFF)."""
    files = write_engine_files(("0.02", state), ("0.2", "OFF"))
    files["box_0001.rad"] += "/INIV/TRA/X/1\n10.0\n" + write_row(*nodes)
    return make_run(files, write_starter_deck(_NODES.replace("NODE/8", "NODE/7")))


def _make_wheel_run(
    further_nodes: str = "", members: tuple[int, ...] = (5, 6, 7, 8), part: int = 2
) -> Example:
    """Return a run that has a wheel as a second rigid body; the first /RBODY/OFF also lists ``further_nodes``."""
    mesh = f"/PART/{part}\nwheel\n{write_row(1, 1)}/SHELL/{part}\n{write_row(2, 5, 6, 7, 8)}"
    wheel = f"{mesh}/GRNOD/NODE/6\nwheel\n{write_row(*members)}"
    body = "/RBODY/2\nwheel\n" + write_row(1809, 0, 0, 0, "", 0, 6)
    files = {
        **_LEGS,
        "box_0001.rad": _LEGS["box_0001.rad"].replace(
            "1808\n", f"1808 {further_nodes}\n"
        ),
    }
    return make_run(files, write_starter_deck(more=wheel + body))


def _make_sprung_run(title: str, part: int) -> Example:
    """Return the run with a wheel and the history of a mass on a spring; ``title`` is that of the wheel's ``part``."""
    example = _make_wheel_run(part=part)
    deck = example.deck.replace("/PART/1\nbox\n", "/PART/1\nframe\n").replace(
        f"/PART/{part}\nwheel\n", f"/PART/{part}\n{title}\n"
    )
    return example._replace(deck=deck, history=_SPRING)


def _find_switching_legs(case: RunCase) -> list[RadiossLeg]:
    """Return the engine runs if any of them switches a body; otherwise an empty sequence."""
    return case.run.legs if any(leg.switched for leg in case.run.legs) else []


@set_passing(
    lambda: [GOOD_RUN, make_run(write_engine_files(("0.05", "ON"), ("0.05", "OFF")))]
)
@set_failing(
    lambda: [
        make_run(write_engine_files(("0.09", "OFF"), ("0.02", "ON"), ("0.2", "OFF"))),
        make_run(
            {
                name: text
                for name, text in write_engine_files(*WINDOW).items()
                if "0002" not in name
            }
        ),
    ]
)
@make_rule_decorator(
    "D2R401",
    ERROR,
    "engine files of a Radioss run that are not consecutive",
    (RADIOSS,),
)
def _check_order(case: RunCase) -> Iterator[PlacedMessage]:
    """Each engine file continues the run from the end of the previous engine file. The files must be numbered from 1
    without gaps, and their /RUN lines must have the same name. No file may end before the previous file. Otherwise
    d2rpick cannot determine when a part is rigid. Two engine files with the same end time are not reported. Source:
    Altair's help for /RUN, and runs computed with OpenRadioss.

    Fix: Add the missing engine files, and correct their numbers, run names and end times.
    """
    legs = _find_switching_legs(case)
    for expected, leg in enumerate(legs, start=1):
        if leg.number != expected:
            yield (
                leg.run.here,
                f"engine file {leg.number} of the run, expected engine file {expected}; add the missing engine files",
            )
            break
    for previous, leg in pairwise(legs):
        if (
            not leg.stop.problem
            and not previous.stop.problem
            and leg.stop.value < previous.stop.value
        ):
            previous_field = previous.stop.field
            problem = (
                f"engine file {leg.number} ends at {leg.stop.value:g}, "
                f"earlier than engine file {previous.number} at {previous.stop.value:g}"
            )
            yield (
                leg.stop.field,
                f"{problem} ({previous_field.at}); give each engine file a later end than the one before",
            )
        if leg.name.casefold() != previous.name.casefold():
            problem = f"engine file {leg.number} belongs to run {leg.name!r}"
            yield (
                leg.run.here,
                f"{problem}, engine file {previous.number} to {previous.name!r}; give all /RUN the same name",
            )


@set_passing(lambda: [GOOD_RUN, make_run(write_engine_files(*WINDOW, node="0"))])
@set_failing(
    lambda: [
        make_run(write_engine_files(*WINDOW, node="1")),
        make_run(write_engine_files(*WINDOW, node="1808 77")),
    ]
)
@make_rule_decorator(
    "D2R402",
    ERROR,
    "a node in /RBODY/ON or /RBODY/OFF that is not a main node",
    (RADIOSS,),
)
def _check_main_nodes(case: RunCase) -> Iterator[PlacedMessage]:
    """/RBODY/ON and /RBODY/OFF list the main nodes of rigid bodies, not the ids of the bodies. The engine skips any
    other node without a message, so the part does not change its state. It also skips the main node of a body that
    /MERGE/RBODY merges into another body. This rule ignores an entry of 0. It applies only if d2rpick could read the
    starter deck and its includes. Source: Altair's help and the published source of OpenRadioss.

    Fix: List the main node of the rigid body, or of the body into which it is merged.
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
                if mixed:
                    hint = f"it is the id of rigid body {mixed.id}: write its main node {mixed.node.value}"
                else:
                    hint = ""
                if main := joined_to.get(node.value):
                    hint = f"its body is merged into {main.name}: write main node {main.node.value}"
                main_nodes = (
                    ", ".join(map(str, sorted(bodies)[:_MOST_LISTED])) or "none"
                )
                problem = f"node {node.value} is not the main node of a rigid body, so the engine skips it silently"
                yield (
                    node.field,
                    f"{problem}; {hint or f'main nodes of this deck: {main_nodes}'}",
                )


@set_passing(
    lambda: [GOOD_RUN, make_run(write_engine_files(("0.09", "ON"), ("0.2", "OFF")))]
)
@set_failing(
    lambda: [make_run(write_engine_files(("0.02", ""), ("0.09", "ON"), ("0.2", "OFF")))]
)
@make_rule_decorator(
    "D2R403",
    WARNING,
    "/RBODY/ON in a later engine file for a body that is rigid from the start",
    (RADIOSS,),
)
def _check_never_off(case: RunCase) -> Iterator[PlacedMessage]:
    """A rigid body is active by default from the first engine file on. If no earlier engine file has /RBODY/OFF for it,
    the part is rigid from time 0, during the load too. If D2R402 reports a node, this rule does not. Source: Altair's
    help for /RBODY in engine files.

    Fix: Add /RBODY/OFF with this main node to the first engine file.
    """
    if not case.run.legs or case.run.legs[0].number != 1:
        return
    starter = case.run.starter
    is_readable = starter is not None and not starter.moved and not case.unread
    if starter and is_readable:
        switched_nodes = {*case.run.named} - {
            body.node.value for body in starter.bodies
        }
    else:
        switched_nodes = set[int]()
    for leg in case.run.legs:
        for card, rigid, nodes in leg.switched:
            late = [
                node.value
                for node in nodes
                if node.value and node.value not in switched_nodes
            ]
            if rigid and late and leg.number > 1:
                nodes_text = name_units(late, "main node")
                problem = f"{nodes_text} activated in engine file {leg.number}, but rigid from the start"
                yield (
                    card.here,
                    f"{problem}, as no engine file before has /RBODY/OFF; add it to engine file 1",
                )
            switched_nodes.update(node.value for node in nodes)


@set_passing(
    lambda: [
        GOOD_RUN,
        make_run(write_engine_files(("0.09", "ON"), ("0.1", ""), ("0.2", "OFF"))),
    ]
)
@set_failing(
    lambda: [
        make_run(
            write_engine_files(
                ("0.02", "OFF"), ("0.05", "ON"), ("0.09", "ON"), ("0.2", "OFF")
            )
        )
    ]
)
@make_rule_decorator(
    "D2R411",
    WARNING,
    "/RBODY/ON in a later engine file for a body that is rigid already",
    (RADIOSS,),
)
def _check_on_again(case: RunCase) -> Iterator[PlacedMessage]:
    """A restart keeps a rigid body rigid. If /RBODY/ON activates it again, the motion stays the same, but the internal
    energy of its elements is added again: in one run the model had 173 J instead of 129 J after td. Source: runs
    computed with OpenRadioss.

    Fix: Remove the main node from the /RBODY/ON of this engine file.
    """
    rigid_now: set[int] = set()
    for leg in case.run.legs:
        for card, rigid, nodes in leg.switched:
            leg_nodes = {node.value for node in nodes}
            again = sorted(leg_nodes & rigid_now)
            if rigid and again:
                problem = f"{name_units(again, 'main node')} activated in engine file {leg.number}, but rigid already"
                yield (
                    card.here,
                    f"{problem}: the internal energy is too high from then on; remove it from this engine file",
                )
            rigid_now = rigid_now | leg_nodes if rigid else rigid_now - leg_nodes


@set_passing(
    lambda: [
        GOOD_RUN,
        make_run(
            write_engine_files(*WINDOW, cap=""),
            write_starter_deck().replace(
                "/RBODY", "/SHELL/2\n         2         1\n/RBODY"
            ),
        ),
    ]
)
@set_failing(
    lambda: [
        make_run(write_engine_files(*WINDOW, cap="")),
        make_run(write_engine_files(*WINDOW, cap="1e-5 1e-3")),
    ]
)
@make_rule_decorator(
    "D2R404",
    WARNING,
    "no limit on the time step, or a large limit, while parts are rigid",
    (RADIOSS,),
)
def _check_step_limit(case: RunCase) -> Iterator[PlacedMessage]:
    """If nothing deformable is left, the time step grows by 10 % per cycle without limit. The release at td then occurs
    late. The keyword /DTIX limits the time step. This rule also reports a limit above 1 % of the rigid window. It
    reports a missing limit only if every element lies in a rigid part. Source: runs computed with OpenRadioss (td was
    0.26 ms late).

    Fix: Add /DTIX to the engine file, with a largest time step below 1 % of the rigid window.
    """
    for index, leg_windows in case.rigid_legs:
        leg = case.run.legs[index]
        window_lengths = [
            window.td - window.tr for window in leg_windows if window.td is not None
        ]
        if (
            leg.cap is not None
            and not leg.cap.problem
            and window_lengths
            and leg.cap.value > _MOST_CAP * min(window_lengths)
        ):
            problem = f"/DTIX permits a time step of {leg.cap.value:g} in a rigid window of {min(window_lengths):g}"
            yield (
                leg.cap.field,
                f"{problem}, so the release may be one step late; use less than 1 % of the window",
            )
        elif (
            leg.cap is None
            and window_lengths
            and not _has_deformable(case, {window.unit.id for window in leg_windows})
        ):
            problem = f"nothing is deformable in engine file {leg.number}, so the time step grows without limit"
            yield leg.run.here, f"{problem}; add /DTIX"


def _has_deformable(case: RunCase, rigid: set[int]) -> bool:
    """Return True if an element may lie outside the rigid parts, or if this is unknown."""
    if case.run.starter is None or not case.found.parts or case.deck.unread:
        return True
    # Imported here to keep start-up fast.
    from d2rpick.deck.mesh import find_parts_with_elements

    parts = find_parts_with_elements(case.run.starter)
    return not parts or bool(parts - rigid)


@set_failing(lambda: [make_run(_MIXED)])
@make_rule_decorator("D2R405", WARNING, "engine files with different /VERS", (RADIOSS,))
def _check_versions(case: RunCase) -> Iterator[PlacedMessage]:
    """/VERS defines how the fields of an engine file are read. Source: Altair's help for /VERS. No run has shown that
    different versions cause errors.

    Fix: Give all engine files of the run the same /VERS.
    """
    for previous, leg in pairwise(
        [leg for leg in _find_switching_legs(case) if leg.version]
    ):
        if leg.version != previous.version:
            problem = (
                f"/VERS/{leg.version} in engine file {leg.number}, "
                f"/VERS/{previous.version} in engine file {previous.number}"
            )
            yield (
                leg.run.here,
                f"{problem}, and the version defines how fields are read; give all engine files the same",
            )


def _report_flaws(case: RunCase, *, code: str) -> Iterator[PlacedMessage]:
    """Yield the flaws of the run that have the given code."""
    for flaw in case.flaws:
        if flaw.code == code:
            yield flaw.place, flaw.message


@set_passing(
    lambda: [
        GOOD_RUN,
        _make_wheel_run("1809"),
        _make_wheel_run(members=(5, 6, 7)),
        make_run(write_engine_files(("0.2", "OFF")), _make_wheel_run().deck),
    ]
)
@set_failing(lambda: [_make_wheel_run()])
@make_rule_decorator(
    "D2R408",
    WARNING,
    "a rigid body that no engine file switches, in a run that switches others",
    (RADIOSS,),
)
def _check_left_rigid(case: RunCase) -> Iterator[PlacedMessage]:
    """A rigid body is active from time 0 unless the first engine file has /RBODY/OFF for it. Its parts stay rigid to
    the end of the run. An example is the wheels of a car, if the engine files list only the main node of the car body.
    A body is reported if it contains whole parts and no history shows whether these deform (D2R409 reports bodies whose
    parts deform). Source: Altair's help for /RBODY in engine files, and runs computed with OpenRadioss.

    Fix: Add the main node to the /RBODY/OFF of every engine file. If the body is meant to be rigid, silence the finding
    with a comment.
    """
    left_bodies, deforming = _find_left_rigid_parts(case)
    if left_bodies and deforming is None:
        yield (
            left_bodies.place,
            f"{left_bodies.found}; if the reference run keeps these bodies off, {left_bodies.way_out}",
        )


@set_passing(
    lambda: [GOOD_RUN, _make_wheel_run(), _make_sprung_run("suspended mass", part=2)]
)
@set_failing(lambda: [_make_sprung_run("spring", part=3)])
@make_rule_decorator(
    "D2R409",
    ERROR,
    "a rigid body that no engine file switches, although its parts deform in the history",
    (RADIOSS,),
)
def _check_left_rigid_deforming(case: RunCase) -> Iterator[PlacedMessage]:
    """The rigid body is active from time 0 (D2R408), but its parts have internal energy in the history. They deform in
    the reference run and cannot deform in this run. If the history contains their energy and it is zero, the parts are
    meant to be rigid, and d2rpick reports nothing.

    Fix: Add the main node to the /RBODY/OFF of every engine file.
    """
    left_bodies, deforming = _find_left_rigid_parts(case)
    if left_bodies and deforming:
        yield (
            left_bodies.place,
            f"{left_bodies.found}, which deform in the history; {left_bodies.way_out}",
        )


def _find_left_rigid_parts(
    case: RunCase,
) -> tuple[LeftRigid | None, tuple[int, ...] | None]:
    """Return the bodies that no engine run switches, with those of their parts that deform; None without a history."""
    # Imported here to keep start-up fast.
    from d2rpick.deck.radioss_run import find_left_rigid

    left_bodies = find_left_rigid(case.run, case.windows.windows)
    return left_bodies, case.judge.deforming(
        left_bodies.parts
    ) if left_bodies and case.judge else None


@set_passing(lambda: [GOOD_RUN, _make_run_with(_NODES, _write_wall(8))])
@set_failing(
    lambda: [
        _make_run_with("/GRNOD/BOX/8\nbox\n", write_row(1), _write_wall(8)),
        _make_run_with(_write_velocity(8)),
        _make_run_with(_PLACES, "/TRANSFORM/TRA/1\n", _write_wall(0, 0, 0.1)),
        Example(_LEGS["box_0001.rad"], _LEGS, name="box_0001.rad"),
    ]
)
@make_rule_decorator(
    "D2R307",
    INFO,
    "a rigid wall, an initial velocity or a rigid body whose nodes are unknown",
    (RADIOSS,),
)
def _report_unknown_nodes(case: RunCase) -> Iterator[PlacedMessage]:
    """D2R406 and D2R407 check what rigid walls and initial velocities do to the nodes of rigid bodies. They evaluate
    node groups defined by nodes, parts and subsets, and the distance from a wall. They do not evaluate other groups,
    nodes moved by /TRANSFORM, or ids inside a //SUBMODEL. Without the starter deck, nothing is known of the bodies that
    the engine files switch.

    Fix: Define the group by /GRNOD/NODE, /GRNOD/PART or /GRNOD/SUBSET, or check walls and velocities yourself. Put a
    missing starter deck into the folder of the engine files.
    """
    yield from _report_flaws(case, code=NOT_FOLLOWED)
    yield from _report_missing_starter(case)


def _report_missing_starter(case: RunCase) -> Iterator[PlacedMessage]:
    """Yield the first card that switches bodies of a starter deck that is not in the folder of the engine files.

    Cards from standard input belong to no folder, so that a starter deck cannot be expected.
    """
    cards = [card for leg in case.run.legs for card, _, _ in leg.switched]
    main = case.run.deck.path
    is_file = os.path.isfile(main)  # noqa: PTH113  pathlib would slow down start-up
    if case.run.starter is not None or not cards or not is_file:
        return
    packed = find_packed_starter(main)
    cure = f"unpack {packed}" if packed else "put it into the folder of this file"
    yield (
        cards[0].here,
        f"the bodies that /{cards[0].name} switches are unknown, because the starter deck was not read; {cure}",
    )


@set_passing(
    lambda: [
        GOOD_RUN,
        _make_run_with(_NODES, _write_wall(8, 8)),
        make_run(_LEGS, f"{_KEEPS}{_NODES.replace('/8', '/7')}{_write_wall(7)}/END\n"),
        _make_run_with(_PLACES, _write_wall(0, 0, 0.01)),
        make_run({}, write_starter_deck(more=_NODES + _write_wall(8))),
    ]
)
@set_failing(
    lambda: [
        _make_run_with(_NODES, _write_wall(8)),
        _make_run_with(_PLACES, _write_wall(0, 0, 0.1)),
        _make_run_with(_write_wall(7)),
    ]
)
@make_rule_decorator(
    "D2R406",
    ERROR,
    "a rigid wall that does not act on the nodes of a switched rigid body",
    (RADIOSS,),
)
def _check_walls(case: RunCase) -> Iterator[PlacedMessage]:
    """The starter removes the nodes of every /RBODY with Ikrem 0 from all /RWALL (warning 446). It does so even if the
    first engine file deactivates the body. These nodes can pass through the wall. OpenRadioss applies the Ikrem of the
    /RBODY with the highest id to all bodies. With Ikrem 1 the wall acts on the nodes while the body is off, but not
    while it is on. Walls with the penalty formulation (Iform 1, since 2026) keep their nodes. Source: Altair's help for
    /RBODY and /RWALL, the published source of OpenRadioss, and runs computed with it (a car that went through a pole).

    Fix: Give every /RBODY Ikrem 1, and deactivate the body before it touches the wall.
    """
    return _report_flaws(case, code=THROUGH_WALL)


@set_passing(
    lambda: [
        GOOD_RUN,
        _make_run_with(_NODES, _write_velocity(8), _MAIN, _write_velocity(9)),
        _make_run_with(_NODES, _write_velocity(8, 0.0)),
        _make_started_run("OFF", 1, 4),
        _make_started_run("ON", 1, 1808),
    ]
)
@set_failing(
    lambda: [
        _make_run_with(_NODES, _write_velocity(8)),
        _make_run_with(_write_velocity(7)),
        _make_started_run("ON", 1, 4),
    ]
)
@make_rule_decorator(
    "D2R407",
    ERROR,
    "an initial velocity for the nodes of a switched rigid body but not for its main node",
    (RADIOSS,),
)
def _check_velocities(case: RunCase) -> Iterator[PlacedMessage]:
    """The starter gives all nodes of an /RBODY the velocity of its main node, even if the first engine file deactivates
    the body. If the node group of /INIVEL lacks the main node, the body begins at rest, and the solver issues no
    message. An /INIV in an engine file acts on an active body through its main node alone, and on an inactive body
    through all its nodes. The rule does not evaluate velocities that begin later (tstart, a sensor). Source: runs
    computed with OpenRadioss.

    Fix: Add the main node to the node group of the initial velocity.
    """
    return _report_flaws(case, code=AT_REST)


def _make_sensed_run(*lines: str) -> Example:
    """Return a run in which a /SENSOR/TIME with the given lines switches the body."""
    deck = write_starter_deck().replace(
        write_row(1808, 0)[:-1], write_row(1808, 5)[:-1]
    )
    return make_run(
        write_engine_files(("0.2", "")),
        deck.replace("/END", f"/SENSOR/TIME/5\nclock\n{''.join(lines)}/END"),
    )


@set_passing(
    lambda: [
        GOOD_RUN,
        _make_sensed_run(write_row(0.02, width=20), write_row(0.09, width=20)),
    ]
)
@set_failing(lambda: [_make_sensed_run(write_row(0.02, 0.09, width=20))])
@make_rule_decorator(
    "D2R412",
    WARNING,
    "a /SENSOR/TIME with a second number on the line of Tdelay",
    (RADIOSS,),
)
def _check_sensor_stop(case: RunCase) -> Iterator[PlacedMessage]:
    """Tstop has a line of its own below Tdelay. Radioss does not read a number after Tdelay on the same line. So the
    sensor stays active to the end, and the body that it switches stays deformable. Source: the format files of
    OpenRadioss, and runs computed with it.

    Fix: Write Tstop on the line below Tdelay.
    """
    for card in case.run.starter.named("SENSOR") if case.run.starter else ():
        rows = card.rows[1:2] if card.words[1:2] == ("TIME",) else ()
        for row in rows:
            if stop := AFTER_DELAY["number"].cut(row.text).strip():
                problem = f"{stop} follows Tdelay on the same line, where it is not read, so the sensor has no Tstop"
                yield row.field(2), f"{problem}; write it on a line of its own"
