"""LS-DYNA's ASCII databases rcforc (contacts) and rwforc (rigid walls): forces, beside the other files of a run.

A line of rcforc is a side of a contact at a time: ``slave 1 time 0.1 x 0.0 y 0.0 z 0.0 mass 0.0``; newer releases call
the sides SURFA and SURFB.  A line of rwforc is the time, the number of a wall, and its normal force and that along each
axis.  Titles are in the legend.  A line that is cut is left out, as that of a run that is still writing.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.contact_forces import ContactForce, joined
from d2rpick.histories.samples import newest_states

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.histories.source import Source

_NUMBER: Final = rb"([-+]?\d*\.?\d+(?:[Ee][-+]?\d+)?)"
_SIDE: Final = rb"(?mi)^ *(?:slave|master|surf[ _]?[ab]) +\d+ +time"
# Patterns are compiled where they are needed: start-up.
_CONTACT_LINE: Final = (
    rb"(?mi)^ *(?:slave|master|surf[ _]?[ab]) +(\d+) +time *"
    + rb" +[xyz] *".join([_NUMBER] * 4)
    + rb"(?=[ \r\n])"
)
_WALL_HEAD: Final = rb"(?i)wall# +normal-force"
_WALL_LINE: Final = (
    rb"(?m)^ +" + rb" +".join([_NUMBER, rb"(\d+)", *[_NUMBER] * 4]) + rb"(?=[ \r\n])"
)
_LEGEND: Final = rb"(?m)^\{BEGIN LEGEND\}[ \r]*\n(?:.*\n)*?\{END LEGEND\}"
_ENTRY: Final = rb"(?m)^ *(\d+)(?: +(\S[^\r\n]*))?\r?$"
_HEAD: Final = 1 << 16  # bytes in which the legend ends


class _Rows(NamedTuple):
    """Forces of all lines: id (n,), time (n,) and force (n, 3) of each."""

    ids: Samples
    time: Samples
    forces: Samples


def recognises(head: bytes) -> bool:
    """Whether a file that begins like this is an rcforc or rwforc; never raises."""
    return re.search(_SIDE, head) is not None or re.search(_WALL_HEAD, head) is not None


def forces_of(sources: Sequence[Source]) -> tuple[ContactForce, ...]:
    """Give the forces of some files, those of one contact in several files as the legs of a run.

    Raises
    ------
    FormatError
        If a file has no line that can be read.
    """
    found: dict[str, list[ContactForce]] = {}
    for source in sources:
        for force in _of_file(source):
            found.setdefault(force.name, []).append(force)
    ordered = (
        sorted(pieces, key=lambda piece: float(piece.time[0]))
        for pieces in found.values()
    )
    return tuple(_newest(pieces) for pieces in ordered)


def _newest(pieces: Sequence[ContactForce]) -> ContactForce:
    return joined(
        pieces, newest_states(np.concatenate([piece.time for piece in pieces]))[0]
    )


def _of_file(source: Source) -> Iterator[ContactForce]:
    data = bytes(source.data)
    is_wall = re.search(_WALL_HEAD, data[:_HEAD]) is not None
    rows = _wall_rows(data) if is_wall else _contact_rows(data)
    if not rows.time.size:
        found = f"{source.name}: no forces of {'rigid walls' if is_wall else 'contacts'} can be read in it"
        raise FormatError(
            f"{found}; is it a whole {'rwforc' if is_wall else 'rcforc'} of LS-DYNA?"
        )
    kind, titles = "rigid wall" if is_wall else "contact", _titles(data[:_HEAD])
    for id_ in dict.fromkeys(rows.ids.astype(int).tolist()):
        mine = rows.ids == id_
        title = titles.get(id_, "")
        time, forces = _of_sides(rows.time[mine], rows.forces[mine])
        yield ContactForce.of_forces(
            f"{kind} {id_}{f' {title!r}' if title else ''}", time, forces
        )


def _of_sides(time: Samples, forces: Samples) -> tuple[Samples, Samples]:
    """Take of the lines of one time the one with the largest force: the sides of a contact have the same or none."""
    order = np.lexsort((np.abs(forces).sum(axis=1), time))
    last = np.append(np.diff(time[order]) > 0, True)
    return time[order][last], forces[order][last]


def _contact_rows(data: bytes) -> _Rows:
    found = (
        np.array(re.findall(_CONTACT_LINE, data), dtype="S32")
        .astype(np.float64)
        .reshape(-1, 5)
    )
    return _Rows(found[:, 0], found[:, 1], found[:, 2:])


def _wall_rows(data: bytes) -> _Rows:
    found = (
        np.array(re.findall(_WALL_LINE, data), dtype="S32")
        .astype(np.float64)
        .reshape(-1, 6)
    )
    forces = found[:, 3:]
    without = ~forces.any(axis=1)
    forces[without, 0] = found[without, 2]  # of a wall that has its normal force alone
    return _Rows(found[:, 1], found[:, 0], forces)


def _titles(head: bytes) -> dict[int, str]:
    legend = re.search(_LEGEND, head)
    entries = re.findall(_ENTRY, legend[0]) if legend else []
    return {int(id_): title.decode("latin-1").strip() for id_, title in entries}
