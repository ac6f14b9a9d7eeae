"""Provide the bytes of a file as they were when the file was opened, even if the file changes later.

A running solver appends to its files, and a restarted solver truncates them and writes them anew. Bytes beyond the size
at opening are ignored. If a file is truncated or rewritten while it is read, its size and modification time show this,
and an error is raised. Files are not mapped into memory, because the system kills a process whose mapped page is
truncated.
"""

from __future__ import annotations

import os
from io import FileIO
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import ChangedError, FormatError
from d2rpick.base.files import (
    FileState,
    read_at_rest,
    read_into,
    wait_for_settled_state,
    wait_for_settled_states,
)

if TYPE_CHECKING:
    from collections.abc import Sequence
    from threading import local

    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]
    Addresses = NDArray[np.int64]

_HELD: Final = 1 << 24  # Largest size of a file that is read into memory [bytes].
_LINES: Final = 1 << 16  # Line endings are counted in blocks of this size [bytes].
# Number of bytes at each end of a file that are compared to check that a file has only grown.
_END: Final = 1 << 12


class Content:
    """The bytes of a file in memory."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def __len__(self) -> int:
        return len(self._data)

    def __bytes__(self) -> bytes:
        return self._data

    def __getitem__(self, where: slice) -> bytes:
        return self._data[where]

    def find(self, wanted: bytes, begin: int = 0) -> int:
        """Return the offset of the first occurrence of ``wanted`` at or after ``begin``, or -1."""
        return self._data.find(wanted, begin)

    def rfind(self, wanted: bytes, begin: int, end: int) -> int:
        """Return the offset of the last occurrence of ``wanted`` between ``begin`` and ``end``, or -1."""
        return self._data.rfind(wanted, begin, end)

    def view(self, begin: int, end: int) -> Bytes:
        """Return the bytes between two offsets, shape (end - begin,)."""
        return np.frombuffer(self._data, np.uint8)[begin:end]

    def fields(self, addresses: Addresses, width: int) -> Bytes:
        """Return ``width`` bytes at each of n offsets, shape (n, width)."""
        return _gather_fields(self.view(0, len(self)), addresses, width)

    def fill_rows(self, room: Bytes, begin: int, stride: int, size_after: int) -> bytes:
        """Fill the rows of ``room`` (n, width) with the bytes at ``begin`` and after each further ``stride`` bytes.

        Return the ``rest`` bytes after the last stride, or fewer if the file ends earlier.
        """
        end = begin + len(room) * stride
        if len(room):
            room[:] = self.fields(
                np.arange(begin, end, stride, dtype=np.int64), room.shape[1]
            )
        return self[end : end + size_after]

    def check(self) -> None:
        """Do nothing, because bytes in memory do not change."""


def make_content(data: bytes | Content) -> Content:
    """Return the content of the given bytes, which may be in memory or on disk."""
    return Content(data) if isinstance(data, bytes) else data


class OnDisk(Content):
    """The bytes of a file, read from disk at each request.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    file : int
        Descriptor of the file, which is closed with this object.
    state : FileState
        State of the file at a time at which no write was in progress.
    """

    # Number of bytes that are read at a time if a request is large.
    # The number is a power of two that fits into the processor cache.
    block = 1 << 19
    # Largest gap between two fields that are read together [bytes]; for a larger gap, a second system call is faster.
    gap = 1 << 13
    # Smallest number of bytes that are read at a time, because the next request is usually for the bytes that follow.
    window = 1 << 16

    def __init__(self, name: str, file: int, state: FileState) -> None:
        from threading import Lock, local  # Imported here to keep start-up fast.

        self._name, self._number = name, file
        self._file = FileIO(file, closefd=False)
        self._lock = Lock()
        self._own = local()  # Each thread has its own buffer and window.
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
            # A backward search needs the bytes before the current window.
            first = begin if begin >= first else max(0, end - self.window)
            window = self.view(first, min(first + self.window, self._size)).tobytes()
            self._own.window = window, first
        return bytes(window[begin - first : end - first]) if begin < end else b""

    def find(self, wanted: bytes, begin: int = 0) -> int:
        """Return the offset of the first occurrence of ``wanted`` at or after ``begin``, or -1."""
        for start in range(begin, self._size, self.gap):
            piece = self[start : start + self.gap + len(wanted) - 1]
            index = piece.find(wanted)
            if index >= 0:
                return start + index
        return -1

    def rfind(self, wanted: bytes, begin: int, end: int) -> int:
        """Return the offset of the last occurrence of ``wanted`` between ``begin`` and ``end``, or -1."""
        for stop in range(end, begin, -self.gap):
            first = max(begin, stop - self.gap)
            index = self[first:stop].rfind(wanted)
            if index >= 0:
                return first + index
        return -1

    def view(self, begin: int, end: int) -> Bytes:
        """Return the bytes between two offsets, shape (end - begin,). The next call in this thread overwrites them."""
        data = self._room(end - begin)
        self._fill(data.data, begin)
        return data

    def fields(self, addresses: Addresses, width: int) -> Bytes:
        """Return ``width`` bytes at each of n offsets, shape (n, width). They are valid only after a `check`."""
        if np.any(addresses[1:] < addresses[:-1]):
            order = np.argsort(addresses, kind="stable")
            fields = np.empty((addresses.size, width), np.uint8)
            fields[order] = self.fields(addresses[order], width)
            return fields
        return self._in_order(addresses, width)

    def _room(self, size: int) -> Bytes:
        """Return an array of ``size`` bytes.

        Small arrays share a buffer, because allocation would take longer than reading.
        """
        if size > 2 * self.block:
            return np.empty(size, np.uint8)
        if not hasattr(self._own, "buffer"):
            self._own.buffer = np.empty(2 * self.block, np.uint8)
        buffer: Bytes = self._own.buffer
        return buffer[:size]

    def _in_order(self, addresses: Addresses, width: int) -> Bytes:
        """Read fields at ascending offsets; fields that lie close together are read in one call."""
        fields = np.empty((addresses.size, width), np.uint8)
        if not addresses.size:
            return fields
        apart = (np.diff(addresses) > self.gap) | (np.diff(addresses & -self.block) > 0)
        firsts = np.flatnonzero(np.append(True, apart))
        ends = np.append(firsts[1:], addresses.size)
        several = ends - firsts > 1
        for first, end in zip(
            firsts[several].tolist(), ends[several].tolist(), strict=True
        ):
            low = int(addresses[first])
            near = self.view(low, int(addresses[end - 1]) + width)
            fields[first:end] = _gather_fields(near, addresses[first:end] - low, width)
        alone = firsts[~several]
        room = fields.reshape(-1).data
        for start, address in zip(
            (alone * width).tolist(), addresses[alone].tolist(), strict=True
        ):
            self._fill(room[start : start + width], address)
        return fields

    def sha256(self) -> str:
        """Return the SHA-256 of the bytes; raise ChangedError if they differ from the bytes read before."""
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
        """Fill ``room`` with the bytes that start at ``begin``."""
        with self._lock:
            self._fill_from(self._file, room, begin)

    def _fill_from(self, file: FileIO, room: memoryview, begin: int) -> None:
        """Fill ``room`` with the bytes of an open file that start at ``begin``."""
        if read_into(file, room, begin) < len(room):
            raise self._shortened()

    def _shortened(self) -> ChangedError:
        """Return the error for a file that has shrunk."""
        problem = f"{self._name}: the file was {self._size} bytes long and became shorter while it was read"
        return ChangedError(
            f"{problem}; is a solver writing it anew? Read it again when it has"
        )

    def check(self) -> None:
        """Raise ChangedError unless all bytes were read from the same version of the file."""
        now = FileState.of(self._file)
        if now.is_as(self._state):
            return
        if now.size == self._size and now.modified != self._state.modified:
            # A write may still be in progress, because it changes the modification time first and the file size last.
            wait_for_settled_state(self._file, may_grow=True)
            now = FileState.of(self._file)
        if now.size < self._size:
            raise self._shortened()
        # True if the file has grown or was renamed; its earlier bytes may then be unchanged.
        untouched = now.size > self._size or now.modified == self._state.modified
        if not untouched or self._read_ends() != self._ends:
            problem = f"{self._name}: the file was rewritten while it was read"
            raise ChangedError(f"{problem}; read it again when it is complete")

    def check_ends(self, ends: tuple[bytes, bytes]) -> None:
        """Raise ChangedError unless the file still has the given first and last bytes."""
        self._ends = ends
        self.check()

    def _read_ends(self) -> tuple[bytes, bytes]:
        """Return the first and last bytes of the content."""
        length = min(_END, self._size)
        first = self.view(0, length).tobytes()
        last = self.view(self._size - length, self._size).tobytes()
        return first, last


class Scattered(OnDisk):
    """The content of a file that is read at a few distant offsets.

    The file is opened for each request, because a run may have written more such files than a process may open at a
    time.
    """

    window = 1 << 12

    def __init__(self, name: str, state: FileState) -> None:
        self._name, self._state, self._size = name, state, state.size
        self._digest = ""

    @cached_property
    def _own(self) -> local:  # type: ignore[override]  # a property overrides an attribute
        """The view of the file that this thread uses, which is created on first use because most files need none."""
        from threading import local

        return local()

    def __del__(self) -> None:
        """Do nothing, because no file is open."""

    def __bytes__(self) -> bytes:
        data = self.view(0, self._size).tobytes()
        self.check()
        return data

    def check(self) -> None:
        """Raise ChangedError unless the file is unchanged or has only grown."""
        try:
            now = FileState.of_stat(os.stat(self._name))  # noqa: PTH116  os.stat is faster for many files
        except OSError:
            raise self._shortened() from None
        if not now.continues(self._state):
            raise ChangedError(
                f"{self._name}: the file was rewritten while it was read; read it again"
            )

    def _fill(self, room: memoryview, begin: int) -> None:
        with FileIO(self._name) as file:
            self._fill_from(file, room, begin)

    def fill_rows(self, room: Bytes, begin: int, stride: int, size_after: int) -> bytes:
        """Fill the rows as `Content.fill_rows` does, but open the file only once for all rows."""
        end = begin + len(room) * stride
        with FileIO(self._name) as file:
            for row, address in zip(room, range(begin, end, stride), strict=True):
                self._fill_from(file, row.data, address)
            file.seek(end)
            return file.read(max(0, min(size_after, self._size - end)))


def open_scattered(names: Sequence[str]) -> list[Scattered]:
    """Wait until no file is being written, then return contents that are read from disk at a few offsets.

    Raises
    ------
    FormatError
        If a file keeps changing.
    """
    states = wait_for_settled_states(names, FormatError)
    return [Scattered(name, state) for name, state in zip(names, states, strict=True)]


def open_content(name: str) -> bytes | OnDisk:
    """Return the content of a file. A small file, or anything other than a regular file, is read into memory.

    Raises
    ------
    FormatError
        If the file keeps changing, or is a device.
    """
    with open(name, "rb", buffering=0) as file:  # noqa: PTH123  pathlib would slow down start-up
        state = read_at_rest(name, file, FormatError, may_grow=True)
        if isinstance(state, bytes):
            return state
        on_disk = OnDisk(name, os.dup(file.fileno()), state)
    return bytes(on_disk) if len(on_disk) <= _HELD else on_disk


def _reopen(name: str, state: FileState, ends: tuple[bytes, bytes]) -> OnDisk:
    """Open a file again, to give another process a copy of its content.

    Raises
    ------
    FormatError
        If the file no longer exists.
    ChangedError
        If the file was written anew since then.
    """
    try:
        with open(name, "rb", buffering=0) as file:  # noqa: PTH123  pathlib would slow down start-up
            on_disk = OnDisk(name, os.dup(file.fileno()), state)
    except OSError as error:
        reason = error.strerror or error
        raise FormatError(
            f"{name}: the run cannot be copied: its file cannot be read ({reason})"
        ) from None
    on_disk.check_ends(ends)
    return on_disk


def count_line_number(data: Content, address: int) -> int:
    """Return the number of the line that contains an offset, counted from 1."""
    pieces = (data[at : min(at + _LINES, address)] for at in range(0, address, _LINES))
    return 1 + sum(piece.count(b"\n") for piece in pieces)


def _gather_fields(data: Bytes, addresses: Addresses, width: int) -> Bytes:
    """Return ``width`` bytes at each offset, shape (n, width)."""
    # The view has a possibly overlapping field at every offset, so that fields can be selected by index.
    fields = np.ndarray(
        (max(0, data.size - width + 1),), f"V{width}", data, strides=(1,)
    )
    return fields[addresses].view(np.uint8).reshape(-1, width)
