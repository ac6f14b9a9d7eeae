"""A deck file: where its keywords stand, found without a look at each line of its mesh, and the lines between two.

All bytes are of one state of the file: a deck is saved by an editor, or written anew by a pre-processor, while its rows
are still to be read.  A small file is held in memory.  A big one is opened whenever some of it is wanted, so that no
number of includes uses up the open files of a process; a file that is not as it was then is an error.  Files are not
mapped into memory: where a mapped page is cut off, the system ends the process.
"""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, zip_longest
from threading import Thread
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import DeckError
from d2rpick.base.files import FileState, at_rest, beyond, bound, long_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, MutableSequence, Sequence
    from io import FileIO

    Filling = Callable[[bytearray, int, int], int]  # puts the bytes from one place to another first, and counts them


_HELD: Final = 1 << 18  # a file up to this size is held in memory: a deck may have thousands of them
_WINDOW: Final = 1 << 16  # bytes read at a time where few are wanted: more will be, close to them
_KEPT: Final = 8  # windows held: the ends of a deck's large blocks are looked at again and again


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
            window = self._read(low, min(-(-end // self._window) * self._window, self.size))
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
    return Held(on_disk.read(0, state.size)) if state.size <= _HELD else on_disk


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
        raise DeckError(f"{name}: no such file; check the name and the folder") from None
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        reason = getattr(error, "strerror", None) or error
        raise DeckError(f"{name}: cannot be read ({reason}); check the name and the permissions") from None


_SEARCHED: Final = 1 << 20  # bytes looked at together: they stay in the cache, always in the same place
_HELPERS: Final = 1  # threads beside the first: the system copies bytes for all at once, but one at a time searches
_ALONE: Final = 4  # pieces that one thread searches before another one would have begun
_LOOKBACK: Final = 32  # bytes in front of a piece, where blanks before its first mark stand, or a head that it cuts
_PGP: Final = b"-----BEGIN PGP MESSAGE"
_ANCHOR: Final = _PGP.index(b"G")  # a letter that mesh data never holds: looking for it alone costs nothing
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"  # of UTF-8


def find_marks(
    file: Held | OnDisk, piece: int = _SEARCHED, *, alone: int = _ALONE, helpers: int = _HELPERS
) -> Sequence[int]:
    """Offsets of the ``*`` that begin a line (blanks before it allowed) and of encrypted blocks, ascending.

    A file of more than ``alone`` pieces of so many bytes is searched by ``helpers`` threads beside this one.
    """
    search = _Search(file, piece)
    threads = [Thread(target=search.help) for _ in range(helpers if len(search.pieces) > alone else 0)]
    for thread in threads:
        thread.start()
    try:
        search.go_on()
    finally:
        search.stop()
        for thread in threads:
            thread.join()
    return search.result()


class _Search:
    """A search of a file by several threads, each of which takes the next piece that waits."""

    def __init__(self, file: Held | OnDisk, piece: int) -> None:
        self._file, self._piece = file, piece
        self._first = len(BYTE_ORDER_MARK) if file.read(0, len(BYTE_ORDER_MARK)) == BYTE_ORDER_MARK else 0
        self.pieces = range(self._first, file.size, piece)
        self._room: Callable[[Iterable[int]], MutableSequence[int]] = list if len(self.pieces) == 1 else _compact
        self._waiting: Iterator[int] = iter(self.pieces)
        self._found: dict[int, Sequence[int]] = {}

    def go_on(self) -> None:
        """Search what waits, all of it in one buffer: fresh memory costs more than what is put into it."""
        found: dict[int, Sequence[int]] = {}
        piece = bytearray(_LOOKBACK + min(self._piece, self._file.size))
        with self._file.opened() as fill:
            while (begin := next(self._waiting, None)) is not None:
                low = max(self._first, begin - _LOOKBACK)
                size = fill(piece, low, min(begin + self._piece, self._file.size))
                places = _starred(piece, begin - low, size) + _encrypted(piece, begin - low, size)
                found[begin] = self._room([low + place for place in sorted(places)]) if places else ()
        self._found |= found  # not before: only now it is sure that the file did not change

    def stop(self) -> None:
        """Let nothing wait: where this thread was interrupted, no other one goes on."""
        self._waiting = iter(())

    def help(self) -> None:
        """Search beside others; the pieces of a thread with which something goes wrong are left to `result`."""
        with suppress(DeckError, OSError):
            self.go_on()

    def result(self) -> Sequence[int]:
        """All that was found; what a helper left is searched here, where an error is heard."""
        if left := [begin for begin in self.pieces if begin not in self._found]:
            self._waiting = iter(left)
            self.go_on()
        marks = self._room(())
        for begin in self.pieces:
            marks.extend(self._found.pop(begin))
        return marks


def _compact(places: Iterable[int]) -> MutableSequence[int]:
    from array import array  # not above: most files are small, and a list of few is as good

    return array("q", places)


def _starred(piece: bytearray, first: int, end: int) -> list[int]:
    found, at = [], piece.find(b"*", first, end)
    while at >= 0:
        before = piece[max(0, at - _LOOKBACK) : at].rstrip(b" ")
        if before.endswith(b"\n") or (not before and at < _LOOKBACK):
            found.append(at)
        at = piece.find(b"*", at + 1, end)
    return found


def _encrypted(piece: bytearray, first: int, end: int) -> list[int]:
    # a head cut by the end of this piece is found in the next one, where all of it stands before the first byte
    found, at = [], piece.find(b"G", max(0, first - len(_PGP) + _ANCHOR + 1), end)
    while at >= 0:
        start = at - _ANCHOR
        before = bytes(piece[max(0, start - 1) : max(0, start)])
        if start >= 0 and piece.startswith(_PGP, start, end) and before in (b"", b"\n"):
            found.append(start)
        at = piece.find(b"G", at + 1, end)
    return found


_PIECE: Final = 4 << 20  # bytes of whole lines that are looked at together
_COUNTED: Final = 16  # line ends are counted in this part of a piece, which stays in the cache
_GZIP: Final = b"\x1f\x8b\x08"
_FIRST: Final = 1 << 16  # bytes in which the first line end is looked for
_HEAD: Final = 1024  # longest keyword line that is looked at
_BEFORE: Final = 4096  # how far back comments belonging to a keyword are looked for
_SILENCE: Final = r"[$#]\s*d2rpick:\s*ignore\b[\s:]*((?:D2R\w*[\s,]*)+|\S*)"  # compiled where it is needed


class SourceFile:
    """One deck file, read as bytes and shown as Latin-1: all that is read of it is of one state of the file.

    ``name`` is the path as messages show it; ``content`` is given for what does not lie in a file, or is open already;
    ``piece`` bytes are looked at together.  Line numbers are counted when they are asked for: in a large deck counting
    costs more than finding the keywords.

    Raises
    ------
    DeckError
        If it cannot be opened; from any method, if the file was rewritten or replaced since then.
    """

    def __init__(self, name: str, content: bytes | OnDisk | None = None, piece: int = _PIECE) -> None:
        self.name, self._piece = name, piece
        self._file = stored(name) if content is None else Held(content) if isinstance(content, bytes) else content
        self._counted = [(0, 1)]  # (offset, number of the line that holds it), ascending
        self._longest = bound("LINE")

    @cached_property
    def marks(self) -> Sequence[int]:
        """Offsets of all keywords and encrypted blocks; DeckError for a file that no reader of decks would take."""
        first = self.read(0, _FIRST)
        if first.startswith(_GZIP):
            raise DeckError(f"{self.name}: compressed with gzip, a deck as its solver reads it was expected; unpack it")
        if b"\r" in first and b"\n" not in first:
            raise DeckError(f"{self.name}: lines end in CR alone, line ends LF or CR LF were expected")
        return find_marks(self._file)

    def blocks(self) -> Iterator[Block]:
        """Keyword blocks and encrypted blocks in the order of the file, up to ``*END``."""
        for start, end in zip_longest(self.marks, islice(self.marks, 1, None)):
            head = self.read(start, start + _HEAD).partition(b"\n")[0].rstrip(b"\r").decode("latin-1")
            if head.upper().startswith("*END") and not head[4:5].strip():
                return
            yield Block(self, start, end, head)

    def read(self, start: int, end: int | None = None) -> bytes:
        """Read the bytes from ``start`` to ``end``, less where the file ends before."""
        return self._file.read(start, self._file.size if end is None else end)

    def pieces(self, start: int, end: int | None = None) -> Iterator[bytes]:
        """Read the bytes from ``start`` to ``end`` or the end of the file in pieces of whole lines."""
        end = min(self._file.size, self._file.size if end is None else end)
        size = self._piece
        while start < end:
            piece = self.read(start, min(start + size, end))
            if start + len(piece) < end:
                piece = piece[: piece.rfind(b"\n") + 1]
            if (at := long_line(piece or self.read(start, start + size), self._longest)) >= 0:
                raise DeckError(f"{self.name}:{self.line_at(start + at)}: the line has {beyond('LINE')}")
            if piece:
                yield piece
                start += len(piece)
            else:
                size *= 2  # this line is longer

    def sha256(self) -> str:
        """SHA-256 of the bytes; DeckError where the file was rewritten since it was read."""
        import hashlib

        digest = hashlib.sha256()
        room = bytearray(min(self._piece, self._file.size))
        with self._file.opened() as fill:
            for at in range(0, self._file.size, self._piece):
                size = fill(room, at, min(at + self._piece, self._file.size))
                digest.update(memoryview(room)[:size])
        return digest.hexdigest()

    def ends_with_line(self) -> bool:
        """Whether the last line has its line end; an empty file has."""
        return self.read(max(0, self._file.size - 1)) in (b"", b"\n")

    @cached_property
    def silences(self) -> bool:
        """Whether comments may silence rules; of a large file, which is not read for that, it is not known."""
        return self._file.size > _HELD or b"d2rpick" in self.read(0).lower()

    def line_at(self, offset: int) -> int:
        """Return the number of the line, from 1, that holds the byte at ``offset``."""
        known = bisect_right(self._counted, (offset, 1 << 62)) - 1
        position, line = self._counted[known]
        together = -(-self._piece // _COUNTED)
        room = bytearray(min(together, max(0, offset - position)))
        with self._file.opened() as fill:
            for at in range(position, offset, together):
                line += room.count(b"\n", 0, fill(room, at, min(at + together, offset)))
        if known == len(self._counted) - 1 and offset > position:
            self._counted.append((offset, line))
        return line


@dataclass(eq=False, repr=False)
class Block:
    """A keyword with all lines up to the next one, or an encrypted block: a place in a file."""

    source: SourceFile
    start: int
    end: int | None
    head: str  # the keyword line

    @property
    def encrypted(self) -> bool:
        """Whether this is the head of an encrypted block and no keyword."""
        return self.head.startswith("-")

    @property
    def _comment(self) -> tuple[str, ...]:
        """What begins a comment line: ``$`` in LS-DYNA's decks, ``#`` too in those of Radioss."""
        return ("$", "#") if self.head.startswith("/") else ("$",)

    @cached_property
    def line(self) -> int:
        """Number of the keyword line in its file."""
        return self.source.line_at(self.start)

    def lines(self) -> Iterator[tuple[int, str]]:
        """Read the data lines, with their distance to the keyword, without comments."""
        distance, comment = -1, self._comment
        for piece in self.source.pieces(self.start, self.end):
            *lines, rest = piece.decode("latin-1").split("\n")
            if rest and self.end is None:  # otherwise these are the blanks in front of the next keyword
                lines.append(rest)
            for line in lines:
                distance += 1
                if distance and not line.startswith(comment):
                    yield distance, line.rstrip("\r")

    @cached_property
    def silenced(self) -> tuple[str, ...]:
        """Rules, or beginnings of their ids, that ``$ d2rpick: ignore`` names in the comments before the keyword.

        Only what stands directly behind it counts, so that a reason may follow; a word that is no id is given too.
        """
        above = self.source.read(max(0, self.start - _BEFORE), self.start).removeprefix(BYTE_ORDER_MARK)
        lines = above.decode("latin-1").split("\n")[:-1]  # without the blanks in front of the keyword
        rules: list[str] = []
        while lines and (line := lines.pop()).startswith(self._comment):
            if found := re.match(_SILENCE, line, re.IGNORECASE):
                rules += re.split(r"[\s,]+", found[1].strip(" \t\r,").upper())
        return tuple(rules)
