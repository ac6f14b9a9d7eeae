"""Read the files of a run repeatedly while it is computed, and return the new states.

Of the histories of solvers only the last states are read again.  Files of other formats are read as a whole each time.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import FormatError, HistoryError
from d2rpick.choice.parts.deck_of_run import add_surroundings
from d2rpick.choice.question import Reference
from d2rpick.histories.opening import Source, open_sources
from d2rpick.histories.resuming import ResumePoint
from d2rpick.histories.source import open_files, open_source
from d2rpick.running.record import find_last_states, skip_states

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Selection
    from d2rpick.histories.run import OpenedRun
    from d2rpick.running.record import Table

# A record with fewer states is read completely, since early results may change, such as which parts are springs.
_FEWEST_STATES: Final = 200


class _ReadFile(NamedTuple):
    """A file that was read: where the next read begins, and its number in the file system."""

    point: ResumePoint
    inode: int

    def shift(self, point: ResumePoint) -> ResumePoint:
        """Return a position in the file from its offset behind the header of this one."""
        skipped = self.point.begin - len(self.point.head)
        return ResumePoint(point.head, point.begin + skipped, point.end + skipped)


class Looks:
    """Reads the same run repeatedly, with the same ``selection`` and deck."""

    def __init__(
        self, selection: Selection, inventory: Inventory | None = None
    ) -> None:
        self._selection, self._inventory = selection, inventory
        self._last_states: list[Table] = []
        # Positions at which the next read continues, and all files of the last read.
        self._read_files: dict[str, _ReadFile] = {}
        self._names: frozenset[str] = frozenset()

    @property
    def grow(self) -> bool:
        """Return True if the next read covers the last states only."""
        return bool(self._read_files)

    def new_states(self, names: Sequence[str]) -> tuple[History, bool]:
        """Read the new states, and report whether they follow those read before.

        If they do not, since files were written anew, all states are given.

        Raises
        ------
        FormatError, HistoryError
            If the files cannot be read, or have no history.
        OSError
            If a file is no longer there.
        """
        if not self._names <= {*names}:
            self._read_files, self._last_states = {}, []  # a file was removed
        history = self._read_on(names)
        new_states = None
        if history is not None:
            new_states = skip_states(history, self._last_states)
        if history is None or new_states is None:
            history = self._read_whole(names)
            new_states = skip_states(history, self._last_states)
        follows = new_states is not None
        if new_states is None:
            new_states, self._last_states = history, []
        self._names = frozenset(names)
        self._last_states = find_last_states(new_states, self._last_states)
        return new_states, follows

    def _read_whole(self, names: Sequence[str]) -> History:
        """Read all states of the files; errors as `new_states`."""
        self._read_files = {}
        sources = open_files(names)
        history, points = self._open(sources)
        is_packed = any(source.packed is not None for source in sources)
        if history.time.size >= _FEWEST_STATES and not is_packed:
            self._note_read(points)
        return history

    def _read_on(self, names: Sequence[str]) -> History | None:
        """Read the last states of each file, including the known ones, and all of new files.

        Return None if a file was written anew, or if one of the files cannot be read from its middle.
        """
        sources = self._list_last_pieces(names)
        if not sources:
            return None
        try:
            history, points = self._open(sources)
        except (FormatError, HistoryError):  # a file was rewritten
            return None
        for name, read_file in self._read_files.items():
            if name in points:
                points[name] = read_file.shift(points[name])
        self._note_read(points)
        return history

    def _list_last_pieces(self, names: Sequence[str]) -> list[Source]:
        """Return the header and the last states of each file; [] if a file was rewritten."""
        if not self._read_files:
            return []
        sources = []
        for name in names:
            read_file = self._read_files.get(name)
            if read_file is not None:
                status = Path(name).stat()
                is_same = status.st_ino == read_file.inode
                if not is_same or status.st_size < read_file.point.begin:
                    return []
                sources.append(Source(name, read_file.point.read_on(name)))
            elif name not in self._names:
                sources.append(open_source(name))
        return sources

    def _open(
        self, sources: Sequence[Source]
    ) -> tuple[History, dict[str, ResumePoint]]:
        """Return the history in the files without an incomplete last state, and where to continue in them.

        The places are {} if the format of a file is always read as a whole.
        """
        run = open_sources(sources, self._selection)
        points = _find_resume_points(run)
        whole_states = [_cut_half_state(source, points) for source in sources]
        if whole_states != [*sources]:
            run = open_sources(whole_states, self._selection)
            points = _find_resume_points(run)
        run = add_surroundings(run, self._inventory)
        return Reference.of(run, self._selection).history, points

    def _note_read(self, points: Mapping[str, ResumePoint]) -> None:
        """Store where the next read continues; files without such a position, with forces only, are not read again."""
        self._read_files = {
            name: _ReadFile(point, Path(name).stat().st_ino)
            for name, point in points.items()
        }


def _find_resume_points(run: OpenedRun) -> dict[str, ResumePoint]:
    """Return where to continue in the files of a run; {} if one format is always read completely."""
    points: dict[str, ResumePoint] = {}
    for database in run.databases:
        points_of_format = database.find_resume_points()
        if not points_of_format:
            return {}
        points |= points_of_format
    return points


def _cut_half_state(source: Source, points: Mapping[str, ResumePoint]) -> Source:
    """Return a file without an incomplete last state."""
    point = points.get(source.name)
    if point is None or point.end == len(source.data):
        return source
    return source._replace(data=source.data[: point.end])
