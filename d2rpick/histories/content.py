"""The bytes of one file as they were when it was opened, whatever becomes of the file meanwhile.

A running solver appends to its files, and one that is started again cuts them and writes them anew.  Bytes behind the
size seen at opening do not count; a file that was cut or written anew while it was read is an error.  Files are not
mapped into memory: where a mapped page is cut off, the system ends the process.
"""

from __future__ import annotations

import os
import time
from functools import cache
from io import FileIO
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.errors import ChangedError, FormatError
from d2rpick.file_state import COARSE, FileState, is_endless, is_regular, pause, snapshot

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Bytes = NDArray[np.uint8]
    Addresses = NDArray[np.int64]

_HELD: Final = 1 << 24  # a file up to this size is held in memory
_WORDS: Final = 1 << 13  # summed up at a time: their weights stay in the cache
_MIX: Final = 0x9E3779B97F4A7C15


class Portions(NamedTuple):
    """How many bytes of a file are read at a time."""

    block: int = 1 << 19  # where many are wanted, a power of 2: they stay in the cache meanwhile
    gap: int = 1 << 13  # between two that are read together: a call of the system costs more than these
    window: int = 1 << 16  # where few are wanted: more will be, mostly behind them


_PORTIONS: Final = Portions()


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

    def check(self) -> None:
        """Nothing to be done: what is held does not change."""


def content_of(data: bytes | Content) -> Content:
    """Content of bytes, whether they are held in memory or not."""
    return Content(data) if isinstance(data, bytes) else data


class OnDisk(Content):
    """Bytes of a file that are read when they are asked for.

    What was read is remembered by sums: where the file has changed since or a moment before, all of it is read again
    after a pause and compared, so that no numbers of two different states of the file come together.

    Parameters
    ----------
    name : str
        Name of the file, for messages.
    file : int
        Its descriptor, which is closed with this object.
    portions : Portions
    """

    def __init__(self, name: str, file: int, portions: Portions = _PORTIONS) -> None:
        from array import array  # not above: most files are small
        from threading import Lock, local

        self._name, self._number = name, file
        self._block, self._gap, self._window = portions
        self._file = FileIO(file, closefd=False)
        self._seen = FileState.of(self._file)
        self._size = self._seen.size
        self._views = array("Q")  # begin, end and sum of what was looked at
        self._fields: list[tuple[Addresses, int, int]] = []  # addresses, width and sum of what was taken
        self._lock, self._own = Lock(), local()  # of each thread: its buffer and its window
        self._digest = ""
        self._awaited: tuple[int, ...] = ()  # times of the file for which a pause was made

    def __del__(self) -> None:
        os.close(self._number)

    def __len__(self) -> int:
        return self._size

    def __bytes__(self) -> bytes:
        with self._lock:
            self._file.seek(0)
            data = self._file.readall()[: self._size]
        if len(data) < self._size:
            raise self._shortened()
        self._views.extend((0, self._size, _sum(np.frombuffer(data, np.uint8))))
        self.check()
        return data

    def __getitem__(self, where: slice) -> bytes:
        begin, end, _ = where.indices(self._size)
        window, first = getattr(self._own, "window", (b"", 0))
        if begin < end and (begin < first or end > first + len(window)):
            if end - begin > self._window:
                return self.view(begin, end).tobytes()
            window, first = self.view(begin, min(begin + self._window, self._size)).tobytes(), begin
            self._own.window = window, first
        return bytes(window[begin - first : end - first]) if begin < end else b""

    def find(self, wanted: bytes, begin: int = 0) -> int:
        """Address of the first ``wanted`` from ``begin`` on, -1 where there is none."""
        for at in range(begin, self._size, self._gap):
            found = self[at : at + self._gap + len(wanted) - 1].find(wanted)
            if found >= 0:
                return at + found
        return -1

    def rfind(self, wanted: bytes, begin: int, end: int) -> int:
        """Address of the last byte ``wanted`` from ``begin`` on and before ``end``, -1 where there is none."""
        for stop in range(end, begin, -self._window):
            first = max(begin, stop - self._window)
            found = self[first:stop].rfind(wanted)
            if found >= 0:
                return first + found
        return -1

    def view(self, begin: int, end: int) -> Bytes:
        """Bytes from one address to another, shape (end - begin,); valid up to the next call in this thread."""
        data = self._near(begin, end)
        self._views.extend((begin, end, _sum(data)))
        return data

    def glance(self, begin: int, end: int) -> bytes:
        """Bytes from one address to another, of which nothing is remembered: for what will be read again."""
        return self._near(begin, min(end, self._size)).tobytes()

    def fields(self, addresses: Addresses, width: int) -> Bytes:
        """Bytes at many addresses, ``width`` of each, shape (n, width); to be trusted after a `check`."""
        if np.any(addresses[1:] < addresses[:-1]):
            order = np.argsort(addresses, kind="stable")
            found = np.empty((addresses.size, width), np.uint8)
            found[order] = self.fields(addresses[order], width)
            return found
        found = self._in_order(addresses, width)
        self._fields.append((addresses, width, _sum(found.ravel())))
        return found

    def _near(self, begin: int, end: int) -> Bytes:
        data = self._room(end - begin)
        self._fill(data.data, begin)
        return data

    def _room(self, size: int) -> Bytes:
        """Room for so many bytes, that of few used again and again: fresh memory costs more than reading."""
        if size > 2 * self._block:
            return np.empty(size, np.uint8)
        if not hasattr(self._own, "buffer"):
            self._own.buffer = np.empty(2 * self._block, np.uint8)
        buffer: Bytes = self._own.buffer
        return buffer[:size]

    def _in_order(self, addresses: Addresses, width: int) -> Bytes:
        """Read what lies close together in one piece, and what lies alone by itself."""
        found = np.empty((addresses.size, width), np.uint8)
        apart = (np.diff(addresses) > self._gap) | (np.diff(addresses & -self._block) > 0)
        firsts = np.flatnonzero(np.append(True, apart)) if addresses.size else np.empty(0, np.int64)
        ends = np.append(firsts[1:], addresses.size)
        several = ends - firsts > 1
        for first, end in zip(firsts[several].tolist(), ends[several].tolist(), strict=True):
            low = int(addresses[first])
            near = self._near(low, int(addresses[end - 1]) + width)
            found[first:end] = _gathered(near, addresses[first:end] - low, width)
        alone, room = firsts[~several], found.reshape(-1).data
        for place, address in zip((alone * width).tolist(), addresses[alone].tolist(), strict=True):
            self._fill(room[place : place + width], address)
        return found

    def sha256(self) -> str:
        """SHA-256 of the bytes, of which those that were used are the same as then; ChangedError where they are not."""
        if not self._digest:
            import hashlib

            digest = hashlib.sha256()
            for begin in range(0, self._size, self._block):
                digest.update(self.view(begin, min(begin + self._block, self._size)).data)
            self.check(at_rest_for=COARSE)
            self._digest = digest.hexdigest()
        return self._digest

    def _fill(self, room: memoryview, begin: int) -> None:
        """Read as many bytes as there is room."""
        with self._lock:
            self._file.seek(begin)
            done = self._file.readinto(room)
            while done < len(room):  # a single call gives 2 GB at most
                more = self._file.readinto(room[done:])
                if not more:
                    raise self._shortened()
                done += more

    def _shortened(self) -> ChangedError:
        return ChangedError(
            f"{self._name}: the file was {self._size} bytes long and became shorter while it was read; "
            "is a solver writing it anew? Read it again when it has"
        )

    def check(self, at_rest_for: int = 0) -> None:
        """Make sure that what was read so far is all of one state of the file; ChangedError where it is not.

        ``at_rest_for``: read it again if the last change is more recent, whether or not one was seen [ns].
        """
        now = FileState.of(self._file)
        if now == self._seen and now.settled and time.time_ns() - now.changed >= at_rest_for:
            return
        if not now.settled and now[:-1] != self._awaited:  # else a pause was made since the last write began
            pause()
            self._awaited = now[:-1]
            now = FileState.of(self._file)
        if now.size < self._size or not self._is_as_before():
            raise ChangedError(
                f"{self._name}: the file was rewritten while it was read; read it again when it is complete"
            )
        self._seen = now

    def _is_as_before(self) -> bool:
        """Whether everything that was read is still the same."""
        known_views = self._views[:]  # another thread may look at more meanwhile
        views = zip(*(known_views[part::3] for part in range(3)), strict=True)
        return all(_sum(self._near(begin, end)) == known for begin, end, known in views) and all(
            _sum(self._in_order(addresses, width).ravel()) == known for addresses, width, known in self._fields
        )


def stored(name: str) -> bytes | OnDisk:
    """Content of a file: as bytes where it is small or no regular file.

    Raises
    ------
    FormatError
        If a small file changes all the time, or it is a device.
    """
    with open(name, "rb", buffering=0) as file:  # noqa: PTH123
        if is_endless(file):
            raise FormatError(f"{name}: this is a device; a file, a pipe or a terminal was expected")
        if not is_regular(file):
            return file.read()
        if os.fstat(file.fileno()).st_size > _HELD:
            return OnDisk(name, os.dup(file.fileno()))
        data = snapshot(file)
    if data is None:
        raise FormatError(f"{name}: the file keeps changing while it is read; read it again when it is complete")
    return data


def _sum(data: Bytes) -> int:
    """Sum of the 64-bit words, each by a weight of its place: words that change places change the sum."""
    end, whole = data.size - data.size % 8, data.size - data.size % (8 * _WORDS)
    rows, rest = data[:whole].view(np.uint64).reshape(-1, _WORDS), data[whole:end].view(np.uint64)
    total, weights = data.size, _weights()
    for one in (*np.einsum("ij,j->i", rows, weights).tolist(), int(rest @ weights[: rest.size])):
        total = (total * _MIX + one) % 2**64
    return (total * _MIX + int.from_bytes(data[end:].tobytes())) % 2**64


@cache
def _weights() -> NDArray[np.uint64]:
    """Odd numbers without a pattern (splitmix64), shape (_WORDS,)."""
    weights = np.arange(1, _WORDS + 1, dtype=np.uint64) * np.uint64(_MIX)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB), (31, 1)):
        weights = (weights ^ weights >> np.uint64(shift)) * np.uint64(factor)
    return weights | np.uint64(1)


def _gathered(data: Bytes, addresses: Addresses, width: int) -> Bytes:
    # every address seen as the start of a field: fetching is then plain indexing
    fields = np.ndarray((max(0, data.size - width + 1),), f"V{width}", data, strides=(1,))
    return fields[addresses].view(np.uint8).reshape(-1, width)
