"""Bytes of a deck file, all of one state of it: read when they are asked for, or held in memory.

A deck is saved by an editor, or written anew by a pre-processor, while its rows are still to be read.  A small file is
held in memory.  A big one is opened whenever some of it is wanted, so that no number of includes uses up the open files
of a process; a file that is not as it was then is an error.  Files are not mapped into memory: where a mapped page is
cut off, the system ends the process.
"""

from __future__ import annotations

import os
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import DeckError
from d2rpick.base.files import FileState, at_rest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from io import FileIO

    Filling = Callable[
        [bytearray, int, int], int
    ]  # puts the bytes from one place to another first, and counts them


HELD_UP_TO: Final = (
    1 << 18
)  # a file up to this size is held in memory: a deck may have thousands of them
_WINDOW: Final = (
    1 << 16
)  # bytes read at a time where few are wanted: more will be, close to them
_KEPT: Final = (
    8  # windows held: the ends of a deck's large blocks are looked at again and again
)


class Held:
    """Bytes in memory."""

    def __init__(self, data: bytes) -> None:
        self._data, self.size = data, len(data)

    def read(self, begin: int, end: int) -> bytes:
        """Bytes from ``begin`` to ``end``, less where the file ends before."""
        return self._data[begin:end]

    @contextmanager
    def opened(self) -> Iterator[Filling]:
        """Give a function that puts bytes into a buffer."""
        yield self._fill

    def _fill(self, room: bytearray, begin: int, end: int) -> int:
        data = self._data[begin:end]
        room[: len(data)] = data
        return len(data)


class OnDisk:
    """Bytes of a file that are read when they are asked for; DeckError when it is not as it was at first.

    ``window`` bytes are read at a time where few are wanted.
    """

    def __init__(self, name: str, state: FileState, window: int = _WINDOW) -> None:
        self.size = state.size
        self._name, self._state, self._window = name, state, window
        self._windows: dict[int, bytes] = {}  # by where they begin, the oldest first

    def read(self, begin: int, end: int) -> bytes:
        """Bytes from ``begin`` to ``end``, less where the file ends before."""
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
        """Give a function that puts bytes into a buffer; what it gave is sure when the context is left."""
        with _opened(self._name) as file:
            yield lambda room, begin, end: self._fill(file, room, begin, end)
            if not FileState.of(file).is_as(self._state):
                raise self._changed()

    def _read(self, begin: int, end: int) -> bytes:
        room = bytearray(end - begin)
        with self.opened() as fill:
            fill(room, begin, end)
        return bytes(room)

    def _fill(self, file: FileIO, room: bytearray, begin: int, end: int) -> int:
        done, wanted = 0, memoryview(room)[: end - begin]
        while done < len(wanted):  # a single call may give less
            count = _read_at(file, wanted[done:], begin + done)
            if not count:
                raise self._changed()
            done += count
        return done

    def _changed(self) -> DeckError:
        found = f"{self._name}: the file was rewritten or replaced while it was read"
        return DeckError(f"{found}; read it again when it is complete")


def stored(name: str) -> Held | OnDisk:
    """Bytes of a file: held in memory where it is small or no regular file.

    Raises
    ------
    DeckError
        If it cannot be opened, is a device, or changes all the time.
    """
    with _opened(name) as file:
        state = at_rest(name, file, DeckError)
    if isinstance(state, bytes):
        return Held(state)
    on_disk = OnDisk(name, state)
    return Held(on_disk.read(0, state.size)) if state.size <= HELD_UP_TO else on_disk


def _read_at(file: FileIO, room: memoryview, begin: int) -> int:
    """Put bytes from a place on into ``room``, and count them; in one call where the system has one for that."""
    if hasattr(os, "preadv"):
        return os.preadv(file.fileno(), [room], begin)
    file.seek(begin)
    return file.readinto(room)


def _opened(name: str) -> FileIO:
    try:
        return open(name, "rb", buffering=0)  # noqa: PTH123  start-up; it is given back
    except FileNotFoundError:
        raise DeckError(
            f"{name}: no such file; check the name and the folder"
        ) from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        reason = getattr(error, "strerror", None) or error
        raise DeckError(
            f"{name}: cannot be read ({reason}); check the name and the permissions"
        ) from None
