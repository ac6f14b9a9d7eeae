"""Find the motion of nodes in a run, which may be in LS-DYNA's ASCII database nodout; this module reads it.

A state begins with ``n o d a l   p r i n t   o u t   f o r   t i m e  s t e p`` and its time. A line contains the
number of a node and its displacements, velocities, accelerations and coordinates; rotations follow in a separate block.
A state that is truncated at the end of the file is omitted; it occurs, for instance, while a run is still writing.
"""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import DamageError, FormatError, give_if_written
from d2rpick.histories.damaged_rows import refuse_damaged_rows
from d2rpick.histories.history import NodeMotion
from d2rpick.histories.samples import find_newest_states

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from d2rpick.histories.database import Legs
    from d2rpick.histories.source import Source

_STATE: Final = rb"(?m)^ *n o d a l   p r i n t   o u t   f o r   t i m e  s t e p"
_COLUMNS: Final = rb"nodal point +x-disp +y-disp +z-disp"
_NUMBER: Final = rb"([-+]?\d+\.\d*(?:[Ee][-+]\d+)?)"
# These patterns are compiled on first use to keep start-up fast.
_TIME: Final = rb" *\d+ *\( *at time *" + _NUMBER + rb" *\)"
_ROW: Final = rb" *(\d+) +" + rb" *".join([_NUMBER] * 3) + rb"(?=[-+ \r\n])"


def recognises(head: bytes) -> bool:
    """Return True if a file with these first bytes is a nodout with displacements. This function never raises."""
    return re.search(_STATE, head) is not None and re.search(_COLUMNS, head) is not None


def find_motion(
    databases: Sequence[Legs], listings: Sequence[Source], wanted: set[int]
) -> NodeMotion | None:
    """Return the motion of the ``wanted`` nodes from the first source that contains any of them.

    The result is None if neither the databases nor the node listings of the run contain them.
    """
    for database in databases:
        motion = give_if_written(partial(_read_database, database, wanted))
        if motion:
            return motion
    if not listings:
        return None
    return give_if_written(partial(read_listed_nodes, listings, wanted))


def _read_database(database: Legs, wanted: set[int]) -> NodeMotion | None:
    """Return the motion of the ``wanted`` nodes that a database contains; None if it contains none of them."""
    ids = tuple(id_ for id_ in database.node_ids if id_ in wanted)
    if not ids:
        return None
    return NodeMotion(database.node_time, ids, database.node_displacements(ids))


def read_listed_nodes(
    sources: Sequence[Source], wanted: Collection[int]
) -> NodeMotion | None:
    """Return the motion of those ``wanted`` nodes that occur in each file; the files are restart segments of one run.

    Raises
    ------
    FormatError
        If a file has no readable state. It is a DamageError if a line cannot be read, or if the states of a file have
        different nodes.
    """
    pieces = [_read_file(source) for source in sources]
    pieces.sort(key=lambda piece: float(piece.time[0]))
    common = set(wanted).intersection(*(piece.ids for piece in pieces))
    ids = tuple(id_ for id_ in pieces[0].ids if id_ in common)
    if not ids:
        return None
    time = np.concatenate([piece.time for piece in pieces])
    columns = [[piece.ids.index(id_) for id_ in ids] for piece in pieces]
    moved = [
        piece.displacements[:, chosen]
        for piece, chosen in zip(pieces, columns, strict=True)
    ]
    newest = find_newest_states(time)[0]
    return NodeMotion(time[newest], ids, np.concatenate(moved)[newest])


def _read_file(source: Source) -> NodeMotion:
    """Read all nodes of one file."""
    data = bytes(source.data)
    refuse_damaged_rows(source.name, data, _ROW)
    states = list(_read_states(data))
    if len(states) > 1 and len(states[-1].ids) < len(states[0].ids):
        states.pop()
    if not states:
        raise FormatError(
            f"{source.name}: no displacements of nodes can be read in it; is it a whole nodout of LS-DYNA?"
        )
    first = states[0]
    for state in states:
        if state.ids != first.ids:
            raise DamageError(
                f"{source.name}: at {state.time[0]:.6g} it has other nodes than at {first.time[0]:.6g}, so that their "
                "motion is not known throughout; copy the file again"
            )
    return NodeMotion(
        np.concatenate([state.time for state in states]),
        first.ids,
        np.concatenate([state.displacements for state in states]),
    )


def _read_states(data: bytes) -> Iterator[NodeMotion]:
    """Yield the motion at each state that has displacements."""
    for block in re.split(_STATE, data)[1:]:
        time = re.match(_TIME, block)
        if time is None or re.search(_COLUMNS, block) is None:
            continue
        lines = np.array(re.findall(rb"(?m)^" + _ROW, block), dtype="S32").reshape(
            -1, 4
        )
        if lines.size:
            ids = tuple(lines[:, 0].astype(np.int64).tolist())
            moved = lines[:, 1:].astype(np.float64)
            yield NodeMotion(np.array([float(time[1])]), ids, moved[np.newaxis])
