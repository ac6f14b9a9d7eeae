"""Read the files of a run repeatedly while the run is being computed, and return the new states.

Of time-history files written by a solver, only the last states are read again. Other files are read completely each
time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, HistoryError
from d2rpick.choice.parts.deck_of_run import add_surroundings
from d2rpick.choice.question import Reference
from d2rpick.histories.opening import Source, open_sources
from d2rpick.histories.resuming import join_resume_points
from d2rpick.histories.source import open_files, open_source
from d2rpick.running.evidence import GrowingEvidence
from d2rpick.running.inner_motion import wait_of_deck
from d2rpick.running.record import GrowingRecord

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Selection
    from d2rpick.histories.resuming import ResumePoint

# Up to this number of states, each read covers the whole record, because early results may still change.
_FEWEST_STATES: Final = 200


class Looks:
    """Reads the same run repeatedly with the same ``selection`` and deck, and collects the ``evidence`` of its flights.

    ``wait`` is the waiting time that the user gave [time].
    """

    def __init__(
        self,
        selection: Selection,
        inventory: Inventory | None = None,
        wait: float | None = None,
    ) -> None:
        self._selection = selection
        self._inventory = inventory
        self._waits = (wait, wait_of_deck(inventory) if inventory else None)
        self.evidence = GrowingEvidence(*self._waits)
        self.record = GrowingRecord()
        # Position in each file at which the next read continues; empty if the next read starts at the first state.
        self.resume_points: dict[str, ResumePoint] = {}
        # Names of all files of the last read.
        self._names: frozenset[str] = frozenset()

    def look(self, names: Sequence[str], wait_before: float = 0.0) -> bool:
        """Add the new states to the evidence, or begin the evidence anew; return True if there are new states.

        ``wait_before`` is the waiting time of earlier flights [time]. The errors are those of `new_states`.
        """
        states, follows = self.new_states(names)
        if not follows:
            self.evidence = GrowingEvidence(*self._waits, wait_before)
        if states.time.size and self.record.history:
            self.evidence.take(states, self.record.history)
        return bool(states.time.size)

    def new_states(self, names: Sequence[str]) -> tuple[History, bool]:
        """Return the new states, and True if they continue the states that were read before.

        If they do not, because files were written anew, all states are returned.

        Raises
        ------
        FormatError, HistoryError
            If the files cannot be read or contain no history.
        OSError
            If a file no longer exists.
        """
        if not self._names <= {*names}:
            # If a file no longer exists, all files are read from their start.
            self.resume_points = {}
            self.record = GrowingRecord()
        follows = self.record.history is not None
        states = self._read_on(names)
        new_states = states and self.record.extend(states)
        if new_states is None:
            whole = self._read_whole(names)
            new_states = self.record.extend(whole)
            if new_states is None:
                self.record = GrowingRecord()
                follows = False
                new_states = self.record.extend(whole)
                assert new_states is not None  # An empty record accepts all states.
        self._names = frozenset(names)
        return new_states, follows

    def _read_whole(self, names: Sequence[str]) -> History:
        """Read all states of the files; the errors are those of `new_states`."""
        sources = open_files(names)
        history, points = self._open(sources)
        is_packed = any(source.packed is not None for source in sources)
        is_short = history.time.size < _FEWEST_STATES
        self.resume_points = {} if is_packed or is_short else points
        return history

    def _read_on(self, names: Sequence[str]) -> History | None:
        """Read the last states of each file, including some known states, and read new files completely.

        Files without a resume point, such as files with forces only, are not read again.  Return None if a file cannot
        be read from its resume point, for example because it was written anew.
        """
        if not self.resume_points:
            return None
        sources = []
        for name in names:
            if name in self.resume_points:
                sources.append(Source(name, self.resume_points[name].read_on(name)))
            elif name not in self._names:
                sources.append(open_source(name))
        try:
            history, points = self._open(sources)
        except (FormatError, HistoryError):
            return None
        for name, point in self.resume_points.items():
            if name in points:
                points[name] = point.locate(points[name])
        self.resume_points = points
        return history

    def _open(
        self, sources: Sequence[Source]
    ) -> tuple[History, dict[str, ResumePoint]]:
        """Return the history in the files, without an incomplete last state, and where to resume reading each file.

        The positions are empty if files of this format are always read completely.
        """
        run = open_sources(sources, self._selection)
        points = join_resume_points(
            database.find_resume_points() for database in run.databases
        )
        whole_states = [*sources]
        for number, source in enumerate(sources):
            if source.name in points:
                data = source.data[: points[source.name].end]
                whole_states[number] = source._replace(data=data)
        if whole_states != [*sources]:
            return self._open(whole_states)
        run = add_surroundings(run, self._inventory)
        return Reference.of(run, self._selection).history, points
