"""Read the files of a run repeatedly while it is computed, and return the new states.

Only the last states of a solver's histories are read again.  Files of other formats are read completely each time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, HistoryError
from d2rpick.choice.parts.deck_of_run import add_surroundings
from d2rpick.choice.question import Reference
from d2rpick.histories.opening import Source, open_sources
from d2rpick.histories.source import open_files, open_source
from d2rpick.running.record import find_last_states, hold_back_states, skip_states

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Selection
    from d2rpick.histories.resuming import ResumePoint
    from d2rpick.histories.run import OpenedRun
    from d2rpick.running.record import Table

# Number of states below which a record is read completely each time, because early results may still change.
_FEWEST_STATES: Final = 200


class Looks:
    """Reads the same run repeatedly, with the same ``selection`` and deck."""

    def __init__(
        self, selection: Selection, inventory: Inventory | None = None
    ) -> None:
        self._selection, self._inventory = selection, inventory
        self._last_states: list[Table] = []
        # Place in each file where the next read continues, and all files of the last read.
        self._resume_points: dict[str, ResumePoint] = {}
        self._names: frozenset[str] = frozenset()

    @property
    def grow(self) -> bool:
        """Return True if the next read covers only the last states."""
        return bool(self._resume_points)

    def new_states(self, names: Sequence[str]) -> tuple[History, bool]:
        """Read the new states, and return them with True if they follow the states read before.

        If they do not, since files were written anew, all states are given.

        Raises
        ------
        FormatError, HistoryError
            If the files cannot be read, or have no history.
        OSError
            If a file is no longer there.
        """
        if not self._names <= {*names}:
            # A file no longer exists, so all files are read from their start.
            self._resume_points, self._last_states = {}, []
        history = self._read_on(names)
        new_states = history and skip_states(history, self._last_states)
        follows = True
        if new_states is None:
            whole = self._read_whole(names)
            new_states = skip_states(whole, self._last_states)
            if new_states is None:
                new_states, follows, self._last_states = whole, False, []
        self._names = frozenset(names)
        self._last_states = find_last_states(new_states, self._last_states)
        return new_states, follows

    def _read_whole(self, names: Sequence[str]) -> History:
        """Read all states of the files, with the errors of `new_states`."""
        sources = open_files(names)
        history, points = self._open(sources)
        is_packed = any(source.packed is not None for source in sources)
        is_short = history.time.size < _FEWEST_STATES
        self._resume_points = {} if is_packed or is_short else points
        return history

    def _read_on(self, names: Sequence[str]) -> History | None:
        """Read the last states of each file, including known states, and read new files completely.

        Files without a resume point, such as files with forces only, are not read again.  Return None if a file cannot
        be read from its resume point, as when it was written anew.
        """
        if not self._resume_points:
            return None
        sources = []
        for name in names:
            if name in self._resume_points:
                sources.append(Source(name, self._resume_points[name].read_on(name)))
            elif name not in self._names:
                sources.append(open_source(name))
        try:
            history, points = self._open(sources)
        except (FormatError, HistoryError):
            return None
        for name, point in self._resume_points.items():
            if name in points:
                points[name] = point.locate(points[name])
        self._resume_points = points
        return history

    def _open(
        self, sources: Sequence[Source]
    ) -> tuple[History, dict[str, ResumePoint]]:
        """Return the history in the files, without an incomplete last state, and where to continue in each file.

        The places are {} if the format of a file is always read as a whole.
        """
        run = open_sources(sources, self._selection)
        points = _find_resume_points(run)
        whole_states = [_cut_half_state(source, points) for source in sources]
        if whole_states != [*sources]:
            run = open_sources(whole_states, self._selection)
            points = _find_resume_points(run)
        run = add_surroundings(run, self._inventory)
        history = Reference.of(run, self._selection).history
        return hold_back_states(history), points


def _find_resume_points(run: OpenedRun) -> dict[str, ResumePoint]:
    """Return the places where to continue in the files of a run; empty if a format is always read completely."""
    points: dict[str, ResumePoint] = {}
    for database in run.databases:
        points_of_format = database.find_resume_points()
        if not points_of_format:
            return {}
        points |= points_of_format
    return points


def _cut_half_state(source: Source, points: Mapping[str, ResumePoint]) -> Source:
    """Remove an incomplete last state from a file."""
    point = points.get(source.name)
    if point is None or point.end == len(source.data):
        return source
    return source._replace(data=source.data[: point.end])
