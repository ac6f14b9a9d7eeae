"""Write an LS-DYNA switch set (*DEFORMABLE_TO_RIGID_AUTOMATIC): its two header lines and its part lines."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import list_names
from d2rpick.deck.ls_dyna_columns import (
    SWITCH_COUNTS,
    SWITCH_TIMES,
    TO_DEFORMABLE,
    TO_RIGID,
)
from d2rpick.deck.part_sets import NO_SETS, PartSets, name_parts
from d2rpick.deck.printed_card import write_number

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.printed_card import Printing

# Values of NRBF and NCSF that delete the constraints on the parts and activate them again.
_DELETE, _ACTIVATE = 1, 2
# Remarks on constraints between separate rigid bodies.
_PARTING: Final = (
    "CHECK BEFORE USE: parts may separate while they are rigid, because the cards delete (NRBF or NCSF 1) what connects"
    " separate rigid bodies"
)
_MERGE_THEM: Final = (
    "Merge these parts (d2rpick card --merge), or keep them deformable."
)
_KEPT_JOINTS: Final = "Joints between separate rigid bodies stay active (NCSF 0)"
_OF_JOINTS: Final = (
    "They are valid between rigid bodies. This was not tested with the solver: check the motion in "
    "the animation."
)


def write_rigid_lines(
    ids: Sequence[int], printing: Printing, part_sets: PartSets = NO_SETS
) -> Iterator[str]:
    """Yield the D2R lines of the given parts or their part sets, with lead parts first."""
    yield TO_RIGID.write_names()
    for lead, members in group_by_lead(ids, printing).items():
        yield from (
            TO_RIGID.write(PID=name, LRB=lead, PTYPE=kind)
            for name, kind in name_parts(members, part_sets)
        )


def write_deformable_lines(
    ids: Sequence[int], part_sets: PartSets = NO_SETS
) -> Iterator[str]:
    """Yield the R2D lines of the given parts, or the line of their part set."""
    yield TO_DEFORMABLE.write_names()
    yield from (
        TO_DEFORMABLE.write(PID=name, PTYPE=kind)
        for name, kind in name_parts(ids, part_sets)
    )


def group_by_lead(ids: Sequence[int], printing: Printing) -> dict[int, list[int]]:
    """Return the parts grouped by their lead part; parts without a lead part come first, under 0."""
    leads = _find_leads(ids, printing)
    by_lead: dict[int, list[int]] = {}
    for part in sorted(ids, key=lambda part: part in leads):
        by_lead.setdefault(leads.get(part, 0), []).append(part)
    return by_lead


def _find_leads(ids: Sequence[int], printing: Printing) -> dict[int, int]:
    """Return the lead part of each part that is merged into the rigid body of another part."""
    if printing.merge is not None:
        return {part: printing.merge for part in ids if part != printing.merge}
    bodies = [[part for part in body if part in ids] for body in printing.bodies]
    return {part: body[0] for body in bodies for part in body[1:]}


class Waiting(NamedTuple):
    """Conditions of a switch set: CODE, the contact, and TIME3 [time].

    ``latest`` is TIME2, the last time at which the set switches [time]. ``offset`` is the gap before a contact at which
    it switches [length]. A value of 0 stands for no such condition.
    """

    code: int = 0
    contact: int = 0
    delay: float = 0.0
    latest: float = 0.0
    offset: float = 0.0


def write_header(
    swset: int,
    time: str,
    step_cap: str,
    counts: tuple[int, int],
    waiting: Waiting,
    pair: tuple[int, int],
    constraints: Sequence[int] = (0, 0),
) -> Iterator[str]:
    """Yield the header lines of a switch set; TIME1 is ``time``, or the earliest time for a set that needs a force.

    ``pair`` contains the id of the other set and PAIRED, which are needed if the set waits. ``counts`` contains D2R and
    R2D. ``constraints`` contains NRBF and NCSF: 0 keeps constraints, 1 deletes them, 2 activates them.
    """
    other, paired = pair if waiting.code else (0, 0)
    yield "*DEFORMABLE_TO_RIGID_AUTOMATIC"
    yield SWITCH_TIMES.write_names()
    yield SWITCH_TIMES.write(
        SWSET=swset,
        CODE=waiting.code,
        TIME1=time,
        TIME2=write_number(waiting.latest),
        TIME3=write_number(waiting.delay),
        ENTNO=waiting.contact,
        RELSW=other,
        PAIRED=paired,
    )
    yield SWITCH_COUNTS.write_names()
    nrbf, ncsf = constraints
    yield SWITCH_COUNTS.write(
        NRBF=nrbf,
        NCSF=ncsf,
        RWF=0,
        DTMAX=step_cap,
        D2R=counts[0],
        R2D=counts[1],
        OFFSET=write_number(waiting.offset),
    )


def write_joint_remarks(printing: Printing) -> Iterator[str]:
    """Yield the remarks about constraints between separate rigid bodies."""
    if printing.parting:
        yield f"{_PARTING}: {list_names(printing.parting)}. {_MERGE_THEM}"
    if printing.kept_joints:
        yield f"{_KEPT_JOINTS}: {list_names(printing.kept_joints)}. {_OF_JOINTS}"


def write_set_pair(
    sets: tuple[int, int],
    times: tuple[str, str],
    step_cap: str,
    ids: Sequence[int],
    printing: Printing,
    part_sets: PartSets = NO_SETS,
    waits: tuple[Waiting, Waiting] = (Waiting(), Waiting()),
) -> Iterator[str]:
    """Yield the lines of a switch set that makes parts rigid and of one that makes them deformable again.

    ``sets``, ``times`` and ``waits`` contain one value for each of the two sets. ``step_cap`` applies while the parts
    are rigid.
    """
    rigid_lines = [*write_rigid_lines(ids, printing, part_sets)]
    deformable_lines = [*write_deformable_lines(ids, part_sets)]
    is_deleted = (printing.delete_nodal_bodies, printing.delete_node_sets)
    deleted = [flag * _DELETE for flag in is_deleted]
    activated = [flag * _ACTIVATE for flag in is_deleted]
    counts = (len(rigid_lines) - 1, 0), (0, len(deformable_lines) - 1)
    first, second = sets
    yield from write_header(
        first, times[0], step_cap, counts[0], waits[0], (second, 1), deleted
    )
    yield from rigid_lines
    yield from write_header(
        second, times[1], "0.0", counts[1], waits[1], (first, -1), activated
    )
    yield from deformable_lines
