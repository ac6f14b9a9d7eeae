"""The bytes of one file as they were when it was opened, whatever becomes of the file meanwhile.

A running solver appends to its files, and one that is started again cuts them and writes them anew.  Bytes behind the
size seen at opening do not count.  A file that was cut or written anew while it was read is an error: its size and
times then and afterwards show that.  Files are not mapped into memory: where a mapped page is cut off, the system ends
the process.
"""

from __future__ import annotations

import os
from io import FileIO
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import ChangedError, FormatError
from d2rpick.base.files import FileState, at_rest, settled_state, settled_states

if TYPE_CHECKING:
    from collections.abc import Sequence
    from threading import local

    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]
    Addresses = NDArray[np.int64]

_HELD: Final = 1 << 24  # a file up to this size is held in memory
_LINES: Final = 1 << 16  # bytes in which line ends are counted at a time
_END: Final = (
    1 << 12
)  # bytes at both ends of what counts, by which a file that has grown is known again


class Content:
    """Bytes held in memory."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def __len__(self) -> int:
        return len(self._data)

    def __bytes__(self) -> bytes:
        return self._data

    def __getitem__(self, where: slice) -> bytes:
        return self._data[where]

    def find(self, wanted: bytes, begin: int = 0) -> int:
        """Address of the first ``wanted`` from ``begin`` on, -1 where there is none."""
        return self._data.find(wanted, begin)

    def rfind(self, wanted: bytes, begin: int, end: int) -> int:
        """Address of the last byte ``wanted`` from ``begin`` on and before ``end``, -1 where there is none."""
        return self._data.rfind(wanted, begin, end)

    def view(self, begin: int, end: int) -> Bytes:
        """Bytes from one address to another, shape (end - begin,)."""
        return np.frombuffer(self._data, np.uint8)[begin:end]

    def fields(self, addresses: Addresses, width: int) -> Bytes:
        """Bytes at many addresses, ``width`` of each, shape (n, width)."""
        return _gathered(self.view(0, len(self)), addresses, width)

    def fill_rows(self, room: Bytes, begin: int, stride: int, rest: int) -> bytes:
        """Fill each row of ``room`` (n, width) with the bytes at every ``stride``; what begins behind the last one.

        ``begin`` is where the first row begins; of the ``rest`` so many bytes are given, less where the file ends.
        """
        end = begin + len(room) * stride
        if len(room):
            room[:] = self.fields(
                np.arange(begin, end, stride, dtype=np.int64), room.shape[1]
            )
        return self[end : end + rest]

    def check(self) -> None:
        """Nothing to be done: what is held does not change."""


def content_of(data: bytes | Content) -> Content:
    """Content of bytes, whether they are held in memory or not."""
    return Content(data) if isinstance(data, bytes) else data


class OnDisk(Content):
    """Bytes of a file that are read when they are asked for.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    file : int
        Its descriptor, which is closed with this object.
    state : FileState
        Its state at rest.
    """

    # How many bytes are read at a time.
    block = (
        1 << 19
    )  # where many are wanted, a power of 2: they stay in the cache meanwhile
    gap = (
        1 << 13
    )  # between two that are read together: a call of the system costs more than these
    window = 1 << 16  # where few are wanted: more will be, mostly behind them

    def __init__(self, name: str, file: int, state: FileState) -> None:
        from threading import Lock, local  # not above: most files are small

        self._name, self._number = name, file
        self._file = FileIO(file, closefd=False)
        self._lock, self._own = (
            Lock(),
            local(),
        )  # of each thread: its buffer and its window
        self._state, self._size = state, state.size
        self._digest, self._ends = "", self._read_ends()

    def __del__(self) -> None:
        os.close(self._number)

    def __reduce__(self) -> tuple[Any, ...]:
        return _reopen, (self._name, self._state, self._ends)

    def __len__(self) -> int:
        return self._size

    def __bytes__(self) -> bytes:
        with self._lock:
            self._file.seek(0)
            data = self._file.readall()[: self._size]
        if len(data) < self._size:
            raise self._shortened()
        self.check()
        return data

    def __getitem__(self, where: slice) -> bytes:
        begin, end, _ = where.indices(self._size)
        window, first = getattr(self._own, "window", (b"", 0))
        if begin < end and (begin < first or end > first + len(window)):
            if end - begin > self.window:
                return self.view(begin, end).tobytes()
            # who goes backwards will want more before it
            first = begin if begin >= first else max(0, end - self.window)
            window = self.view(first, min(first + self.window, self._size)).tobytes()
            self._own.window = window, first
        return bytes(window[begin - first : end - first]) if begin < end else b""

    def find(self, wanted: bytes, begin: int = 0) -> int:
        """Address of the first ``wanted`` from ``begin`` on, -1 where there is none."""
        for at in range(begin, self._size, self.gap):
            found = self[at : at + self.gap + len(wanted) - 1].find(wanted)
            if found >= 0:
                return at + found
        return -1

    def rfind(self, wanted: bytes, begin: int, end: int) -> int:
        """Address of the last byte ``wanted`` from ``begin`` on and before ``end``, -1 where there is none."""
        for stop in range(end, begin, -self.gap):
            first = max(begin, stop - self.gap)
            found = self[first:stop].rfind(wanted)
            if found >= 0:
                return first + found
        return -1

    def view(self, begin: int, end: int) -> Bytes:
        """Bytes from one address to another, shape (end - begin,); valid up to the next call in this thread."""
        data = self._room(end - begin)
        self._fill(data.data, begin)
        return data

    def fields(self, addresses: Addresses, width: int) -> Bytes:
        """Bytes at many addresses, ``width`` of each, shape (n, width); to be trusted after a `check`."""
        if np.any(addresses[1:] < addresses[:-1]):
            order = np.argsort(addresses, kind="stable")
            found = np.empty((addresses.size, width), np.uint8)
            found[order] = self.fields(addresses[order], width)
            return found
        return self._in_order(addresses, width)

    def _room(self, size: int) -> Bytes:
        """Room for so many bytes, that of few used again and again: fresh memory costs more than reading."""
        if size > 2 * self.block:
            return np.empty(size, np.uint8)
        if not hasattr(self._own, "buffer"):
            self._own.buffer = np.empty(2 * self.block, np.uint8)
        buffer: Bytes = self._own.buffer
        return buffer[:size]

    def _in_order(self, addresses: Addresses, width: int) -> Bytes:
        """Read what lies close together in one piece, and what lies alone by itself."""
        found = np.empty((addresses.size, width), np.uint8)
        apart = (np.diff(addresses) > self.gap) | (np.diff(addresses & -self.block) > 0)
        firsts = (
            np.flatnonzero(np.append(True, apart))
            if addresses.size
            else np.empty(0, np.int64)
        )
        ends = np.append(firsts[1:], addresses.size)
        several = ends - firsts > 1
        for first, end in zip(
            firsts[several].tolist(), ends[several].tolist(), strict=True
        ):
            low = int(addresses[first])
            near = self.view(low, int(addresses[end - 1]) + width)
            found[first:end] = _gathered(near, addresses[first:end] - low, width)
        alone, room = firsts[~several], found.reshape(-1).data
        for place, address in zip(
            (alone * width).tolist(), addresses[alone].tolist(), strict=True
        ):
            self._fill(room[place : place + width], address)
        return found

    def sha256(self) -> str:
        """SHA-256 of the bytes, of which those that were used are the same as then; ChangedError where they are not."""
        if not self._digest:
            import hashlib

            digest = hashlib.sha256()
            for begin in range(0, self._size, self.block):
                digest.update(
                    self.view(begin, min(begin + self.block, self._size)).data
                )
            self.check()
            self._digest = digest.hexdigest()
        return self._digest

    def _fill(self, room: memoryview, begin: int) -> None:
        """Read as many bytes as there is room."""
        with self._lock:
            self._fill_from(self._file, room, begin)

    def _fill_from(self, file: FileIO, room: memoryview, begin: int) -> None:
        file.seek(begin)
        done = file.readinto(room)
        while done < len(room):  # a single call gives 2 GB at most
            more = file.readinto(room[done:])
            if not more:
                raise self._shortened()
            done += more

    def _shortened(self) -> ChangedError:
        found = f"{self._name}: the file was {self._size} bytes long and became shorter while it was read"
        return ChangedError(
            f"{found}; is a solver writing it anew? Read it again when it has"
        )

    def check(self) -> None:
        """Make sure that what was read so far is all of one state of the file; ChangedError where it is not."""
        now = FileState.of(self._file)
        if now.is_as(self._state):
            return
        if now.size == self._size and now.modified != self._state.modified:
            # a write gives its time first and its size last: it may be under way
            settled_state(self._file, may_grow=True)
            now = FileState.of(self._file)
        if now.size < self._size:
            raise self._shortened()
        untouched = (
            now.size > self._size or now.modified == self._state.modified
        )  # it has grown, or got another name
        if not untouched or self._read_ends() != self._ends:
            found = f"{self._name}: the file was rewritten while it was read"
            raise ChangedError(f"{found}; read it again when it is complete")

    def check_ends(self, ends: tuple[bytes, bytes]) -> None:
        """Make sure that the file is still the one that had these ends; ChangedError where it is not."""
        self._ends = ends
        self.check()

    def _read_ends(self) -> tuple[bytes, bytes]:
        """First and last bytes of what counts."""
        length = min(_END, self._size)
        return self.view(0, length).tobytes(), self.view(
            self._size - length, self._size
        ).tobytes()


class Scattered(OnDisk):
    """Bytes of a file of which little is read, here and there.

    It is opened for each reading: a run may have written more such files than a process may have open.
    """

    window = 1 << 12

    def __init__(self, name: str, state: FileState) -> None:
        self._name, self._state, self._size = name, state, state.size
        self._digest = ""

    @cached_property
    def _own(self) -> local:  # type: ignore[override]  # few files are read but for the heads of their states
        from threading import local

        return local()

    def __del__(self) -> None:
        """Nothing to be closed."""

    def __bytes__(self) -> bytes:
        data = self.view(0, self._size).tobytes()
        self.check()
        return data

    def check(self) -> None:
        """Make sure that the file has at most grown since; ChangedError where it has not."""
        try:
            now = FileState.of_stat(os.stat(self._name))  # noqa: PTH116  many files
        except OSError:
            raise self._shortened() from None
        if not now.continues(self._state):
            raise ChangedError(
                f"{self._name}: the file was rewritten while it was read; read it again"
            )

    def _fill(self, room: memoryview, begin: int) -> None:
        with FileIO(self._name) as file:
            self._fill_from(file, room, begin)

    def fill_rows(self, room: Bytes, begin: int, stride: int, rest: int) -> bytes:
        """The same, for which the file is opened once."""
        end = begin + len(room) * stride
        with FileIO(self._name) as file:
            for row, place in zip(room, range(begin, end, stride), strict=True):
                self._fill_from(file, row.data, place)
            file.seek(end)
            return file.read(max(0, min(rest, self._size - end)))


def scattered(names: Sequence[str]) -> list[Scattered]:
    """Give the contents of files of which little is read, each at rest.

    Raises
    ------
    FormatError
        If one changes all the time.
    """
    states = settled_states(names, FormatError)
    return [Scattered(name, state) for name, state in zip(names, states, strict=True)]


def stored(name: str) -> bytes | OnDisk:
    """Content of a file: as bytes where it is small or no regular file.

    Raises
    ------
    FormatError
        If it changes all the time, or is a device.
    """
    with open(name, "rb", buffering=0) as file:  # noqa: PTH123
        state = at_rest(name, file, FormatError, may_grow=True)
        if isinstance(state, bytes):
            return state
        on_disk = OnDisk(name, os.dup(file.fileno()), state)
    return bytes(on_disk) if len(on_disk) <= _HELD else on_disk


def _reopen(name: str, state: FileState, ends: tuple[bytes, bytes]) -> OnDisk:
    """Open a file again in a copy of what was read of it.

    Raises
    ------
    FormatError
        If it is gone.
    ChangedError
        If it was written anew since.
    """
    try:
        with open(name, "rb", buffering=0) as file:  # noqa: PTH123
            on_disk = OnDisk(name, os.dup(file.fileno()), state)
    except OSError as error:
        reason = error.strerror or error
        raise FormatError(
            f"{name}: the run cannot be copied: its file cannot be read ({reason})"
        ) from None
    on_disk.check_ends(ends)
    return on_disk


def line_at(data: Content, address: int) -> int:
    """Number of the line at an address, from 1."""
    pieces = (data[at : min(at + _LINES, address)] for at in range(0, address, _LINES))
    return 1 + sum(piece.count(b"\n") for piece in pieces)


def _gathered(data: Bytes, addresses: Addresses, width: int) -> Bytes:
    # every address seen as the start of a field: fetching is then plain indexing
    fields = np.ndarray(
        (max(0, data.size - width + 1),), f"V{width}", data, strides=(1,)
    )
    return fields[addresses].view(np.uint8).reshape(-1, width)
