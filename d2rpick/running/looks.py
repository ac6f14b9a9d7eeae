"""Read the files of a run again and again while it is computed, and give the new states.

Of a Radioss history only the new states are read.  Files of other formats are read as a whole each time.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.choice.parts.deck_of_run import add_surroundings
from d2rpick.choice.question import Reference
from d2rpick.histories.formats.radioss_th import TimeHistory, recognises
from d2rpick.histories.opening import Source, open_run, open_sources
from d2rpick.running.record import list_tables, skip_states

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Selection
    from d2rpick.histories.run import OpenedRun
    from d2rpick.running.record import Table

_HEAD: Final = 8192  # bytes by which a Radioss history is recognised


class _ReadPart(NamedTuple):
    """How far a file was read: its head, the bytes of the last state, where they end, and the number of the file."""

    head: bytes
    last_state: bytes
    end: int
    inode: int


class Looks:
    """Reads the same run again and again, with the same ``selection`` and deck."""

    def __init__(
        self, selection: Selection, inventory: Inventory | None = None
    ) -> None:
        self._selection, self._inventory = selection, inventory
        self._read_parts: dict[str, _ReadPart] = {}
        self._last_time = float("-inf")
        self._known_tables: list[Table] = []  # of files that are read as a whole

    @property
    def grow(self) -> bool:
        """Return True if the format lets new states be read without the states before them."""
        return bool(self._read_parts)

    def new_states(self, names: Sequence[str]) -> tuple[History | None, bool]:
        """Read the new states, None if there are none, and whether they follow the states that were read before.

        If they do not, since files were written anew, all states are given.

        Raises
        ------
        FormatError, HistoryError
            If the files cannot be read, or have no history.
        OSError
            If a file is no longer there.
        """
        sources = self._read_new(names)
        history = None
        if sources:
            history = self._make_history(open_sources(sources, self._selection))
        follows = (
            history is None
            or not history.time.size
            or float(history.time[0]) > self._last_time
        )
        if sources is None or not follows:
            self._read_parts.clear()
            history = self.whole(names)
            if len(list_tables(history)) < len(self._known_tables):
                return (
                    None,
                    True,
                )  # its last state is being written and lacks quantities
            new_states = self._skip_known(history)
            follows = new_states is not None
            history = history if new_states is None else new_states
        if history is not None and history.time.size:
            self._last_time = float(history.time[-1])
        return history, follows and self._last_time > float("-inf")

    def _skip_known(self, history: History) -> History | None:
        """Return the new states of files that were read as a whole; None if they do not follow those before."""
        known_tables, self._known_tables = self._known_tables, []
        if self._read_parts:
            return None
        self._known_tables = list_tables(history)
        return skip_states(history, known_tables) if known_tables else None

    def whole(self, names: Sequence[str]) -> History:
        """Read all states of the files; errors as `new_states`."""
        history = self._make_history(open_run(names, self._selection))
        for name in names:
            with Path(name).open("rb") as stream:
                if recognises(stream.read(_HEAD)):
                    stream.seek(0)
                    self._note_read(name, stream.read(), 0)
        return history

    def _read_new(self, names: Sequence[str]) -> list[Source] | None:
        """Return the head of each file with its new states; None if a file was written anew or has another format."""
        if not self._read_parts or not {*self._read_parts} <= {*names}:
            return None
        sources = []
        for name in names:
            read_part = self._read_parts.get(name)
            data = _read_file(name) if read_part is None else _read_on(name, read_part)
            if data is None:
                return None
            skipped = read_part.end - len(read_part.head) if read_part else 0
            if self._note_read(name, data, skipped):
                sources.append(Source(name, data))
        return sources

    def _note_read(self, name: str, data: bytes, skipped: int) -> bool:
        """Note how far a file was read, ``skipped`` bytes before ``data``; return whether that has a whole state."""
        history = TimeHistory(data, name)
        begin, end = history.size_until(float("-inf")), history.size_until(float("inf"))
        if end > begin:
            state_size = (end - begin) // history.time.size
            self._read_parts[name] = _ReadPart(
                data[:begin],
                data[end - state_size : end],
                skipped + end,
                Path(name).stat().st_ino,
            )
        return end > begin

    def _make_history(self, run: OpenedRun) -> History:
        return Reference.of(
            add_surroundings(run, self._inventory), self._selection
        ).history


def _read_file(name: str) -> bytes | None:
    """Return the content of a Radioss history; None if the file has another format."""
    data = Path(name).read_bytes()
    return data if recognises(data[:_HEAD]) else None


def _read_on(name: str, read_part: _ReadPart) -> bytes | None:
    """Return the head of a file and what follows the states that were read; None if it was written anew."""
    if Path(name).stat().st_ino != read_part.inode:
        return None
    with Path(name).open("rb") as stream:
        stream.seek(read_part.end - len(read_part.last_state))
        if stream.read(len(read_part.last_state)) != read_part.last_state:
            return None
        return read_part.head + stream.read()
