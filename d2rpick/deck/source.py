"""A deck file: where its keywords stand, found without a look at each line of its mesh, and the lines between two."""

from __future__ import annotations

import _thread
import re
from bisect import bisect_right
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice, zip_longest
from typing import TYPE_CHECKING, Final

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import DeckError
from d2rpick.base.files import beyond, bound, long_line
from d2rpick.deck.stored import HELD_UP_TO, Held, stored

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, MutableSequence, Sequence

    from d2rpick.deck.stored import OnDisk


_SEARCHED: Final = (
    3 << 18
)  # bytes looked at together: they stay in the cache, always in the same place
_HELPERS: Final = 1  # threads beside the first: the system copies bytes for all at once, but one at a time searches
_ALONE: Final = 4  # pieces that one thread searches before another one would have begun
_LOOKBACK: Final = 32  # bytes in front of a piece, where blanks before its first mark stand, or a head that it cuts
_PGP: Final = b"-----BEGIN PGP MESSAGE"
_ANCHOR: Final = _PGP.index(
    b"G"
)  # a letter that mesh data never holds: looking for it alone costs nothing
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"  # of UTF-8


def find_marks(
    file: Held | OnDisk,
    piece: int = _SEARCHED,
    *,
    alone: int = _ALONE,
    helpers: int = _HELPERS,
) -> Sequence[int]:
    """Offsets of the ``*`` that begin a line (blanks before it allowed) and of encrypted blocks, ascending.

    A file of more than ``alone`` pieces of so many bytes is searched by ``helpers`` threads beside this one.
    """
    search = _Search(file, piece)
    try:
        for _ in range(helpers if len(search.pieces) > alone else 0):
            search.call_for_help()
        search.go_on()
    finally:
        search.stop()
    return search.result()


class _Search:
    """A search of a file by several threads, each of which takes the next piece that waits."""

    def __init__(self, file: Held | OnDisk, piece: int) -> None:
        self._file, self._piece = file, piece
        self._first = (
            len(BYTE_ORDER_MARK)
            if file.read(0, len(BYTE_ORDER_MARK)) == BYTE_ORDER_MARK
            else 0
        )
        self.pieces = range(self._first, file.size, piece)
        self._room: Callable[[Iterable[int]], MutableSequence[int]] = (
            list if len(self.pieces) == 1 else _compact
        )
        self._waiting: Iterator[int] = iter(self.pieces)
        self._found: dict[int, Sequence[int]] = {}
        self._helping: list[
            _thread.LockType
        ] = []  # each is released by its thread in the end

    def call_for_help(self) -> None:
        """Have a thread begin beside this one, which does not wait until it runs."""
        helping = _thread.allocate_lock()
        helping.acquire()
        with suppress(
            RuntimeError
        ):  # there may be no more threads: then there is no help
            _thread.start_new_thread(self._help, (helping,))
            self._helping.append(helping)

    def _help(self, helping: _thread.LockType) -> None:
        """Search beside others; the pieces of a thread with which something goes wrong are left to `result`."""
        try:
            with suppress(DeckError, OSError, MemoryError):
                self.go_on()
        finally:
            helping.release()

    def go_on(self) -> None:
        """Search what waits, all of it in one buffer: fresh memory costs more than what is put into it."""
        found: dict[int, Sequence[int]] = {}
        piece = bytearray(_LOOKBACK + min(self._piece, self._file.size))
        with self._file.opened() as fill:
            while (begin := next(self._waiting, None)) is not None:
                low = max(self._first, begin - _LOOKBACK)
                size = fill(piece, low, min(begin + self._piece, self._file.size))
                places = _starred(piece, begin - low, size) + _encrypted(
                    piece, begin - low, size
                )
                found[begin] = (
                    self._room([low + place for place in sorted(places)])
                    if places
                    else ()
                )
        self._found |= (
            found  # not before: only now it is sure that the file did not change
        )

    def stop(self) -> None:
        """Let nothing wait, so that no other thread goes on where this one was interrupted, and wait for those."""
        self._waiting = iter(())
        for helping in self._helping:
            helping.acquire()

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
    from array import (
        array,
    )  # not above: most files are small, and a list of few is as good

    return array("q", places)


def _starred(piece: bytearray, first: int, end: int) -> list[int]:
    found, at = [], piece.find(b"*", first, end)
    while at >= 0:
        before = piece[max(0, at - _LOOKBACK) : at].rstrip(b" ")
        if before.endswith(b"\n") or (not before and at < _LOOKBACK):
            found.append(at)
        at = _below(piece, b"*", at, end)
    return found


def _below(piece: bytearray, letter: bytes, at: int, end: int) -> int:
    """Place of the next such letter below the line of ``at``: one line may have many, and begins once."""
    line = piece.find(b"\n", at, end)
    return piece.find(letter, line, end) if line >= 0 else -1


def _encrypted(piece: bytearray, first: int, end: int) -> list[int]:
    # a head cut by the end of this piece is found in the next one, where all of it stands before the first byte
    found, at = [], piece.find(b"G", max(0, first - len(_PGP) + _ANCHOR + 1), end)
    while at >= 0:
        start = at - _ANCHOR
        before = bytes(piece[max(0, start - 1) : max(0, start)])
        if start >= 0 and piece.startswith(_PGP, start, end) and before in (b"", b"\n"):
            found.append(start)
        at = _below(piece, b"G", at, end)
    return found


_PIECE: Final = 4 << 20  # bytes of whole lines that are looked at together
_COUNTED: Final = (
    16  # line ends are counted in this part of a piece, which stays in the cache
)
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

    def __init__(
        self,
        name: str,
        content: bytes | Held | OnDisk | None = None,
        piece: int = _PIECE,
    ) -> None:
        self.name, self._piece = name, piece
        self._file = (
            stored(name)
            if content is None
            else Held(content)
            if isinstance(content, bytes)
            else content
        )
        self._counted = [
            (0, 1)
        ]  # (offset, number of the line that holds it), ascending
        self._longest = bound("LINE")

    @cached_property
    def marks(self) -> Sequence[int]:
        """Offsets of all keywords and encrypted blocks; DeckError for a file that no reader of decks would take."""
        first = self.read(0, _FIRST)
        if first.startswith(_GZIP):
            raise DeckError(
                f"{self.name}: compressed with gzip, a deck as its solver reads it was expected; unpack it"
            )
        if b"\r" in first and b"\n" not in first:
            raise DeckError(
                f"{self.name}: lines end in CR alone, line ends LF or CR LF were expected"
            )
        return find_marks(self._file)

    def blocks(self) -> Iterator[Block]:
        """Keyword blocks and encrypted blocks in the order of the file, up to ``*END``."""
        for start, end in zip_longest(self.marks, islice(self.marks, 1, None)):
            head = (
                self.read(start, start + _HEAD)
                .partition(b"\n")[0]
                .rstrip(b"\r")
                .decode("latin-1")
            )
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
            self._refuse_long_line(piece or self.read(start, start + size), start)
            if piece:
                yield piece
                start += len(piece)
            else:
                size *= 2  # this line is longer

    def text(self, start: int, end: int | None) -> str:
        """Read the same at once, as Latin-1."""
        data = self.read(start, end)
        self._refuse_long_line(data, start)
        return data.decode("latin-1")

    def _refuse_long_line(self, data: bytes, start: int) -> None:
        if len(data) > self._longest and (at := long_line(data, self._longest)) >= 0:
            raise DeckError(
                f"{self.name}:{self.line_at(start + at)}: the line has {beyond('LINE')}"
            )

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
        return self._file.size > HELD_UP_TO or b"d2rpick" in self.read(0).lower()

    def line_at(self, offset: int) -> int:
        """Return the number of the line, from 1, that holds the byte at ``offset``."""
        known = bisect_right(self._counted, (offset, 1 << 62)) - 1
        position, line = self._counted[known]
        together = -(-self._piece // _COUNTED)
        room = bytearray(min(together, max(0, offset - position)))
        with self._file.opened() as fill:
            for at in range(position, offset, together):
                line += room.count(b"\n", 0, fill(room, at, min(at + together, offset)))
        if offset > position:
            self._counted.insert(known + 1, (offset, line))
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

    def lines(self) -> list[tuple[int, str]]:
        """Read the data lines, with their distance to the keyword, without comments."""
        comment = self._comment
        *lines, rest = self.source.text(self.start, self.end).split("\n")
        if (
            rest and self.end is None
        ):  # otherwise these are the blanks in front of the next keyword
            lines.append(rest)
        found = enumerate(lines[1:], start=1)
        return [
            (distance, line.rstrip("\r"))
            for distance, line in found
            if not line.startswith(comment)
        ]

    @cached_property
    def silenced(self) -> tuple[str, ...]:
        """Rules, or beginnings of their ids, that ``$ d2rpick: ignore`` names in the comments before the keyword.

        Only what stands directly behind it counts, so that a reason may follow; a word that is no id is given too.
        """
        above = self.source.read(max(0, self.start - _BEFORE), self.start).removeprefix(
            BYTE_ORDER_MARK
        )
        lines = above.decode("latin-1").split("\n")[
            :-1
        ]  # without the blanks in front of the keyword
        rules: list[str] = []
        while lines and (line := lines.pop()).startswith(self._comment):
            if found := re.match(_SILENCE, line, re.IGNORECASE):
                rules += re.split(r"[\s,]+", found[1].strip(" \t\r,").upper())
        return tuple(rules)
