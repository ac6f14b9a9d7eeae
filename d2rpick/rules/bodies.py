"""D2R307, D2R406-408: rigid bodies of a Radioss run that go through walls, begin at rest, or are rigid all along."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

from d2rpick.deck.radioss_run import AT_REST, NOT_FOLLOWED, THROUGH_WALL, left_rigid
from d2rpick.rules.base import RADIOSS, Rule, Severity
from d2rpick.rules.example_runs import GOOD_RUN, WINDOW, engine_files, run_of, starter_deck
from d2rpick.rules.run_case import RunCase

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.rules.base import Case, Example, Objection


def _flaws(case: Case, *, code: str) -> Iterator[Objection]:
    for flaw in case.flaws if isinstance(case, RunCase) else ():
        if flaw.code == code:
            yield flaw.place, flaw.message


def _left_rigid(case: Case) -> Iterator[Objection]:
    """Find the bodies that no leg switches; an error where their parts deform in the history."""
    left = left_rigid(case.run, case.windows.windows) if isinstance(case, RunCase) else None
    deforming = case.judge.deforming(left.parts) if left and case.judge else None
    if left is None or deforming == ():
        return
    if deforming:
        yield left.place, f"{left.found}, which deform in the history; {left.way_out}", Severity.ERROR
    else:
        yield left.place, f"{left.found}; where the run without switching keeps the bodies off, {left.way_out}"


def _row(*fields: float | str, width: int = 10) -> str:
    return "".join(f"{field:>{width}}" for field in fields) + "\n"


_LEGS: Final = engine_files(*WINDOW)
_NODES: Final = "/GRNOD/NODE/8\nnodes of the box\n" + _row(1, 2, 3, 4)
_MAIN: Final = "/GRNOD/NODE/9\nmain node\n" + _row(1808)
_PLACES: Final = "/NODE\n" + "".join(_row(n)[:-1] + _row(0.1 * n, 0.0, 0.05, width=20) for n in (1, 2, 3, 4))
_KEEPS: Final = starter_deck().partition("/GRNOD")[0].replace("         7\n", "         7         1\n")  # Ikrem


def _wall(added: int, left_out: int = 0, reach: float = 0.0) -> str:
    """Write the ground, at z = 0: nodes of a group, less those of another, and those that are near."""
    text = "/RWALL/PLANE/3\nground\n" + _row(0, 0, added, left_out) + _row(reach, 0.0, 0.0, width=20)
    return text + _row(0.0, 0.0, 0.0, width=20) + _row(0.0, 0.0, 1.0, width=20)


def _velocity(group: int, speed: float = 10.0) -> str:
    return "/INIVEL/TRA/4\nthrown\n" + _row(speed, 0.0, 0.0, width=20)[:-1] + _row(group)


def _with(*more: str) -> Example:
    """Add to the starter deck of a good run."""
    return run_of(_LEGS, starter_deck(more="".join(more)))


def _start(state: str, *nodes: int) -> Example:
    """Give nodes a velocity in the first leg, in which the body is on or off."""
    files = engine_files(("0.02", state), ("0.2", "OFF"))
    files["box_0001.rad"] += "/INIV/TRA/X/1\n10.0\n" + _row(*nodes)
    return run_of(files, starter_deck(_NODES.replace("NODE/8", "NODE/7")))


def _wheel(named: str = "", members: tuple[int, ...] = (5, 6, 7, 8)) -> Example:
    """Add a wheel that is a rigid body of its own; ``named`` stands in the /RBODY/OFF of the first leg too."""
    wheel = (
        "/PART/2\nwheel\n" + _row(1, 1) + "/SHELL/2\n" + _row(2, 5, 6, 7, 8) + "/GRNOD/NODE/6\nwheel\n" + _row(*members)
    )
    body = "/RBODY/2\nwheel\n" + _row(1809, 0, 0, 0, "", 0, 6)
    files = {**_LEGS, "box_0001.rad": _LEGS["box_0001.rad"].replace("1808\n", f"1808 {named}\n")}
    return run_of(files, starter_deck(more=wheel + body))


RULES: Final = (
    Rule(
        "D2R307",
        Severity.INFO,
        "a rigid wall, an initial velocity or a rigid body whose nodes are not known",
        "What walls and velocities do to the nodes of rigid bodies (D2R406, D2R407) is judged by groups of nodes, "
        "parts and subsets, and by the distance from the wall. Other groups, nodes that /TRANSFORM moves and the ids "
        "of a //SUBMODEL are not followed.",
        partial(_flaws, code=NOT_FOLLOWED),
        (GOOD_RUN, _with(_NODES, _wall(8))),
        (
            _with("/GRNOD/BOX/8\nbox\n", _row(1), _wall(8)),
            _with(_velocity(8)),
            _with(_PLACES, "/TRANSFORM/TRA/1\n", _wall(0, 0, 0.1)),
        ),
        (RADIOSS,),
    ),
    Rule(
        "D2R406",
        Severity.ERROR,
        "a rigid wall that does not hold what a switched rigid body holds",
        "The starter removes the nodes of every /RBODY with Ikrem 0 from all /RWALL, also of one that the engine puts "
        "off in the first leg (warning 446): what they hold goes through the wall. OpenRadioss takes the Ikrem of the "
        "/RBODY with the highest id for all. With Ikrem 1 the wall holds the nodes while the body is off, and not "
        "while it is on: switch back before it touches. Walls with the penalty formulation (Iform 1, since 2026) keep "
        "their nodes. Source: Altair's help for /RBODY and /RWALL, the published source of OpenRadioss, and runs "
        "computed with it (a car that flew through a pole).",
        partial(_flaws, code=THROUGH_WALL),
        (
            GOOD_RUN,
            _with(_NODES, _wall(8, 8)),
            run_of(_LEGS, f"{_KEEPS}{_NODES.replace('/8', '/7')}{_wall(7)}/END\n"),
            _with(_PLACES, _wall(0, 0, 0.01)),
            run_of({}, starter_deck(more=_NODES + _wall(8))),
        ),
        (_with(_NODES, _wall(8)), _with(_PLACES, _wall(0, 0, 0.1)), _with(_wall(7))),
        (RADIOSS,),
    ),
    Rule(
        "D2R407",
        Severity.ERROR,
        "an initial velocity that moves nodes of a switched rigid body and not its main node",
        "The starter gives all nodes of an /RBODY the velocity of its main node, also of one that the engine puts off "
        "in the first leg. Where the node group of /INIVEL lacks that node the body begins at rest, without a "
        "message. An /INIV of an engine file moves a body that is on by its main node alone, one that is off by its "
        "nodes. Velocities that begin later (tstart, a sensor) are not judged. Source: runs computed with "
        "OpenRadioss.",
        partial(_flaws, code=AT_REST),
        (
            GOOD_RUN,
            _with(_NODES, _velocity(8), _MAIN, _velocity(9)),
            _with(_NODES, _velocity(8, 0.0)),
            _start("OFF", 1, 4),
            _start("ON", 1, 1808),
        ),
        (_with(_NODES, _velocity(8)), _with(_velocity(7)), _start("ON", 1, 4)),
        (RADIOSS,),
    ),
    Rule(
        "D2R408",
        Severity.WARNING,
        "a rigid body that no leg switches, in a run that switches others",
        "A body is on from time 0 unless the first leg says /RBODY/OFF, and what it holds is rigid to the end: the "
        "wheels of a car whose legs name its body alone. Reported where the body holds whole parts. With a history it "
        "is an error if these parts have internal energy there, and nothing if they have none; without one it may be "
        "meant: a comment silences it. Source: Altair's help for /RBODY in engine files, and runs computed with "
        "OpenRadioss.",
        _left_rigid,
        (GOOD_RUN, _wheel("1809"), _wheel(members=(5, 6, 7)), run_of(engine_files(("0.2", "OFF")), _wheel().deck)),
        (_wheel(),),
        (RADIOSS,),
    ),
)
