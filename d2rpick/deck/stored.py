"""Provide the bytes of a deck file as one consistent snapshot, either held in memory or read on request.

An editor or a pre-processor may save a deck again before all of its rows have been read. A small file is kept in
memory. A large file is opened for each read, so that many includes do not exceed the number of files that a process may
open; an error is raised if the file has changed. Files are not mapped into memory, because the system kills a process
whose mapped page disappears.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import DeckError
from d2rpick.base.files import FileState, read_at_rest, read_into

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from io import FileIO

    # A function that copies the bytes between two offsets into a buffer, and returns their number.
    Filling = Callable[[bytearray, int, int], int]


# Largest file that is kept in memory [bytes]; a deck may have thousands of include files.
HELD_UP_TO: Final = 1 << 18
# Smallest number of bytes that are read at a time, because the next request is usually for nearby bytes.
_WINDOW: Final = 1 << 16
# Number of blocks of a file that are cached, because the ends of large blocks are read repeatedly.
_KEPT: Final = 8
# Endings of the names of main decks; engine files of Radioss have other numbers.
_DECKS: Final = (".k", ".key", ".dyn", "_0000.rad")


class HeldInMemory:
    """The bytes of a file in memory."""

    def __init__(self, data: bytes) -> None:
        self._data, self.size = data, len(data)

    def read(self, begin: int, end: int) -> bytes:
        """Return the bytes from ``begin`` to ``end``, or up to the end of the file."""
        return self._data[begin:end]

    @contextmanager
    def opened(self) -> Iterator[Filling]:
        """Provide a function that copies bytes into a buffer."""
        yield self._fill

    def _fill(self, room: bytearray, begin: int, end: int) -> int:
        data = self._data[begin:end]
        room[: len(data)] = data
        return len(data)


class DeckOnDisk:
    """The bytes of a file on disk, read on request; a DeckError is raised if the file has changed.

    At least ``window`` bytes are read at a time.
    """

    def __init__(self, name: str, state: FileState, window: int = _WINDOW) -> None:
        self.size = state.size
        self._name, self._state, self._window = name, state, window
        # Blocks of the file by offset, from oldest to newest.
        self._windows: dict[int, bytes] = {}

    def read(self, begin: int, end: int) -> bytes:
        """Return the bytes from ``begin`` to ``end``, or up to the end of the file."""
        end = min(end, self.size)
        if begin >= end:
            return b""
        if end - begin > self._window:
            return self._read(begin, end)
        low = begin // self._window * self._window
        if end > low + len(window := self._windows.get(low, b"")):
            window = self._read(
                low, min(-(-end // self._window) * self._window, self.size)
            )
            self._windows[low] = window
            if len(self._windows) > _KEPT:
                del self._windows[next(iter(self._windows))]
        return window[begin - low : end - low]

    @contextmanager
    def opened(self) -> Iterator[Filling]:
        """Provide a function that copies bytes into a buffer.

        On leaving the context, an error is raised if the file has changed.
        """
        with _open_file(self._name) as file:
            yield lambda room, begin, end: self._fill(file, room, begin, end)
            if not FileState.of(file).is_as(self._state):
                raise self._changed()

    def _read(self, begin: int, end: int) -> bytes:
        room = bytearray(end - begin)
        with self.opened() as fill:
            fill(room, begin, end)
        return bytes(room)

    def _fill(self, file: FileIO, room: bytearray, begin: int, end: int) -> int:
        size = end - begin
        if read_into(file, memoryview(room)[:size], begin) < size:
            raise self._changed()
        return size

    def _changed(self) -> DeckError:
        problem = f"{self._name}: the file was rewritten or replaced while it was read"
        return DeckError(f"{problem}; read it again when it is complete")


def open_stored(name: str) -> HeldInMemory | DeckOnDisk:
    """Return the bytes of a file; a small file, or anything other than a regular file, is held in memory.

    Raises
    ------
    DeckError
        If the file cannot be opened, is a device, or changes repeatedly.
    """
    with _open_file(name) as file:
        state = read_at_rest(name, file, DeckError)
    if isinstance(state, bytes):
        return HeldInMemory(state)
    on_disk = DeckOnDisk(name, state)
    return (
        HeldInMemory(on_disk.read(0, state.size))
        if state.size <= HELD_UP_TO
        else on_disk
    )


def _name_deck_in(folder: str) -> str:
    """Return the name of the only main deck in a folder, as an example; empty if there is none or more than one."""
    decks = [
        name
        for name in os.listdir(folder)  # noqa: PTH208  pathlib would slow down start-up
        if name.lower().endswith(_DECKS)
    ]
    return f", {os.path.join(folder, decks[0])}" if len(decks) == 1 else ""  # noqa: PTH118  as above


def _open_file(name: str) -> FileIO:
    """Open a file; raise DeckError if that fails."""
    try:
        return open(name, "rb", buffering=0)  # noqa: PTH123  pathlib would slow down start-up
    except FileNotFoundError:
        raise DeckError(
            f"{name}: no such file; check the name and the folder"
        ) from None
    except IsADirectoryError:
        raise DeckError(
            f"{name}: this is a folder; give the main deck in it{_name_deck_in(name)}"
        ) from None
    except (OSError, ValueError) as error:
        # ValueError is raised for a NUL byte in the name.
        reason = getattr(error, "strerror", None) or error
        raise DeckError(
            f"{name}: cannot be read ({reason}); check the name and the permissions"
        ) from None
