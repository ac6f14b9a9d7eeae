"""What a look at the files of a run adds to the looks before: of a Radioss history the states that are new alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.choice.deck_of_run import in_deck
from d2rpick.choice.question import Reference
from d2rpick.histories.formats.radioss_th import TimeHistory, recognises
from d2rpick.histories.opening import Source, open_run, open_sources

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History
    from d2rpick.histories.names import Selection
    from d2rpick.histories.run import Run

_HEAD: Final = 8192  # bytes by which a Radioss history is recognised


class _Taken(NamedTuple):
    """What was taken of a file: its head, the last state, where that ends [bytes], and the number of the file."""

    head: bytes
    last: bytes
    end: int
    inode: int


class Looks:
    """Looks at the same run again and again, with the same ``selection`` and what its deck tells."""

    def __init__(
        self, selection: Selection, inventory: Inventory | None = None
    ) -> None:
        self._selection, self._inventory = selection, inventory
        self._taken: dict[str, _Taken] = {}
        self._time = float("-inf")

    @property
    def grow(self) -> bool:
        """Whether the files are of a format of which what is new can be read alone."""
        return bool(self._taken)

    def new_states(self, names: Sequence[str]) -> tuple[History | None, bool]:
        """Read what is new, None where nothing is, and say whether it follows what was read before.

        Where it does not the history is whole: files were written anew, or they are of another format.

        Raises
        ------
        FormatError, HistoryError
            If the files cannot be read, or hold no history.
        OSError
            If one is not there any more.
        """
        added = self._added(names)
        history = None if added is None else self._history_of(added)
        follows = (
            history is None
            or not history.time.size
            or float(history.time[0]) > self._time
        )
        if added is None or not follows:
            self._taken.clear()
            follows, history = False, self.whole(names)
        if history is not None and history.time.size:
            self._time = float(history.time[-1])
        return history, follows and self._time > float("-inf")

    def whole(self, names: Sequence[str]) -> History:
        """Read all states of the files; errors as of `new_states`."""
        history = self._read_open(open_run(names, self._selection))
        for name in names:
            with Path(name).open("rb") as stream:
                if recognises(stream.read(_HEAD)):
                    stream.seek(0)
                    self._note(name, stream.read(), 0)
        return history

    def _added(self, names: Sequence[str]) -> list[Source] | None:
        """Give what the files have more than before, each behind its head; None where that cannot be told."""
        if not self._taken or not {*self._taken} <= {*names}:
            return None
        found = []
        for name in names:
            taken = self._taken.get(name)
            with Path(name).open("rb") as stream:
                inode = Path(name).stat().st_ino
                if taken is None:
                    data = stream.read()
                    if not recognises(data[:_HEAD]):
                        return None
                else:
                    stream.seek(taken.end - len(taken.last))
                    if (
                        inode != taken.inode
                        or stream.read(len(taken.last)) != taken.last
                    ):
                        return None
                    data = taken.head + stream.read()
            if self._note(name, data, taken.end - len(taken.head) if taken else 0):
                found.append(Source(name, data))
        return found

    def _note(self, name: str, data: bytes, before: int) -> bool:
        """Remember how far a file was read, with so many bytes ``before``; say whether there is a whole state."""
        history = TimeHistory(data, name)
        begin, end = history.size_until(float("-inf")), history.size_until(float("inf"))
        if end > begin:
            size = (end - begin) // history.time.size
            last = data[end - size : end]
            self._taken[name] = _Taken(
                data[:begin], last, before + end, Path(name).stat().st_ino
            )
        return end > begin

    def _history_of(self, sources: Sequence[Source]) -> History | None:
        return (
            self._read_open(open_sources(sources, self._selection)) if sources else None
        )

    def _read_open(self, run: Run) -> History:
        return Reference.of(in_deck(run, self._inventory), self._selection).history
