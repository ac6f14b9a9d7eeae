"""Read the ASCII databases of LS-DYNA that contain only forces: rcforc (contacts) and rwforc (rigid walls).

A line of rcforc contains the force on one side of a contact at one time: ``slave 1 time 0.1 x 0.0 y 0.0 z 0.0 mass
0.0``; newer releases call the sides SURFA and SURFB. A line of rwforc contains the time, the number of a wall, its
normal force and the force along each axis. Titles are in the legend. A truncated line is omitted; it occurs, for
instance, while a run is still writing.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.damaged_rows import refuse_damaged_rows
from d2rpick.histories.samples import find_newest_states

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.history import Samples
    from d2rpick.histories.source import Source

_NUMBER: Final = rb"([-+]?\d*\.?\d+(?:[Ee][-+]?\d+)?)"
_SIDE: Final = rb"(?mi)^ *(?:slave|master|surf[ _]?[ab]) +\d+ +time"
# These patterns are compiled on first use to keep start-up fast.
_CONTACT_ROW: Final = (
    rb" *(?:slave|master|surf[ _]?[ab]) +(\d+) +time *"
    + rb" +[xyz] *".join([_NUMBER] * 4)
    + rb"(?=[ \r\n])"
)
_WALL_HEAD: Final = rb"(?i)wall# +normal-force"
_WALL_ROW: Final = (
    rb" +" + rb" +".join([_NUMBER, rb"(\d+)", *[_NUMBER] * 4]) + rb"(?=[ \r\n])"
)
_LEGEND: Final = rb"(?m)^\{BEGIN LEGEND\}[ \r]*\n(?:.*\n)*?\{END LEGEND\}"
_ENTRY: Final = rb"(?m)^ *(\d+)(?: +(\S[^\r\n]*))?\r?$"
# Number of bytes at the start of a file that contain the complete legend.
_HEAD: Final = 1 << 16


class _Rows(NamedTuple):
    """The content of all data lines: ids (n,), times (n,) and forces (n, 3)."""

    ids: Samples
    time: Samples
    forces: Samples


def recognises(head: bytes) -> bool:
    """Return True if a file with these first bytes is an rcforc or rwforc. This function never raises."""
    return re.search(_SIDE, head) is not None or re.search(_WALL_HEAD, head) is not None


def read_listed_forces(sources: Sequence[Source]) -> tuple[ContactForce, ...]:
    """Return the forces in files; files that contain the same contact are treated as restart segments of a run.

    Raises
    ------
    FormatError
        If a file has no line that can be read.
    """
    pieces_of: dict[str, list[ContactForce]] = {}
    for source in sources:
        for force in _read_forces_of_file(source):
            pieces_of.setdefault(force.name, []).append(force)
    ordered = (
        sorted(pieces, key=lambda piece: float(piece.time[0]))
        for pieces in pieces_of.values()
    )
    return tuple(_join_legs(pieces) for pieces in ordered)


def _join_legs(pieces: Sequence[ContactForce]) -> ContactForce:
    """Join the restart segments of one contact. If two overlap, the newer segment is used."""
    # Imported here to keep start-up fast.
    from d2rpick.histories.contact_forces import join_contact_forces

    return join_contact_forces(
        pieces, find_newest_states(np.concatenate([piece.time for piece in pieces]))[0]
    )


def _read_forces_of_file(source: Source) -> Iterator[ContactForce]:
    """Yield the forces of one file; raise FormatError if there are none, DamageError if a line cannot be read."""
    # Imported here to keep start-up fast.
    from d2rpick.histories.contact_forces import ContactForce

    data = bytes(source.data)
    is_wall = re.search(_WALL_HEAD, data[:_HEAD]) is not None
    refuse_damaged_rows(source.name, data, _WALL_ROW if is_wall else _CONTACT_ROW)
    rows = _read_wall_rows(data) if is_wall else _read_contact_rows(data)
    if not rows.time.size:
        listed, name = ("rigid walls", "rwforc") if is_wall else ("contacts", "rcforc")
        raise FormatError(
            f"{source.name}: no forces of {listed} can be read in it; is it a whole {name} of LS-DYNA?"
        )
    kind = "rigid wall" if is_wall else "contact"
    titles = _read_titles_of_legend(data[:_HEAD])
    for id_ in dict.fromkeys(rows.ids.astype(int).tolist()):
        mine = rows.ids == id_
        title = titles.get(id_, "")
        time, forces = _choose_largest_of_sides(rows.time[mine], rows.forces[mine])
        yield ContactForce.of_forces(
            f"{kind} {id_}{f' {title!r}' if title else ''}", time, forces
        )


def _choose_largest_of_sides(time: Samples, forces: Samples) -> tuple[Samples, Samples]:
    """Return, for each time, the line with the larger force, because a contact may be listed for one or both sides."""
    order = np.lexsort((np.abs(forces).sum(axis=1), time))
    last = np.append(np.diff(time[order]) > 0, True)
    return time[order][last], forces[order][last]


def _read_contact_rows(data: bytes) -> _Rows:
    """Read the data lines of an rcforc."""
    lines = np.array(re.findall(rb"(?mi)^" + _CONTACT_ROW, data), dtype="S32")
    numbers = lines.astype(np.float64).reshape(-1, 5)
    return _Rows(numbers[:, 0], numbers[:, 1], numbers[:, 2:])


def _read_wall_rows(data: bytes) -> _Rows:
    """Read the data lines of an rwforc. If they contain no components, the normal force is the first component."""
    lines = np.array(re.findall(rb"(?m)^" + _WALL_ROW, data), dtype="S32")
    numbers = lines.astype(np.float64).reshape(-1, 6)
    forces = numbers[:, 3:]
    without_components = ~forces.any(axis=1)
    forces[without_components, 0] = numbers[without_components, 2]
    return _Rows(numbers[:, 1], numbers[:, 0], forces)


def _read_titles_of_legend(head: bytes) -> dict[int, str]:
    """Return the titles in the legend, keyed by contact number."""
    legend = re.search(_LEGEND, head)
    entries = re.findall(_ENTRY, legend[0]) if legend else []
    return {int(id_): title.decode("latin-1").strip() for id_, title in entries}
