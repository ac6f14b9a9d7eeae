"""Read a deck file: find its keywords without reading each mesh line, and return the lines between keywords."""

from __future__ import annotations

import _thread
import re
from bisect import bisect_right
from contextlib import suppress
from itertools import islice, zip_longest
from typing import TYPE_CHECKING, Final

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import DeckError
from d2rpick.base.files import bound, describe_excess, find_long_line
from d2rpick.deck.not_decks import (
    refuse_binary_history,
    refuse_packed,
    refuse_text_history,
)
from d2rpick.deck.stored import HELD_UP_TO, HeldInMemory, open_stored

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, MutableSequence, Sequence

    from d2rpick.deck.stored import DeckOnDisk


# Number of bytes that are searched at a time, so that they fit into the processor cache.
_SEARCHED: Final = 3 << 18
# Number of additional threads, which copy bytes in parallel although only one thread can search at a time.
_HELPERS: Final = 1
# Number of blocks that one thread searches before a second thread starts.
_ALONE: Final = 4
# Number of bytes before a block that are searched again, because a mark may extend across the block's start.
_LOOKBACK: Final = 32
_PGP: Final = b"-----BEGIN PGP MESSAGE"
# Offset of a letter of the mark that does not occur in mesh data, so that the search for this letter is fast.
_ANCHOR: Final = _PGP.index(b"G")
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"  # Byte order mark of UTF-8.

# Number of bytes whose complete lines are processed at a time.
_PIECE: Final = 4 << 20
# Line endings of a block are counted in this number of sections, so that each section fits into the processor cache.
_COUNTED: Final = 16
_FIRST: Final = 1 << 16  # Number of bytes that should contain a line ending.
_HEAD: Final = 1024  # Largest number of bytes that are read of a keyword line.
# Number of bytes before a keyword in which comments on it are expected.
_BEFORE: Final = 4096
# This pattern is compiled on first use to keep start-up fast.
_SILENCE: Final = r"[$#]\s*d2rpick:\s*ignore\b[\s:]*((?:D2R\w*[\s,]*)+|\S*)"


def find_marks(
    file: HeldInMemory | DeckOnDisk,
    piece: int = _SEARCHED,
    *,
    alone: int = _ALONE,
    helpers: int = _HELPERS,
) -> Sequence[int]:
    """Return the ascending offsets of encrypted blocks, and of each ``*`` that begins a line, possibly after spaces.

    A file of more than ``alone`` pieces of ``piece`` bytes is searched by ``helpers`` additional threads.
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
    """A search of a file by several threads, each of which repeatedly searches the next block."""

    def __init__(self, file: HeldInMemory | DeckOnDisk, piece: int) -> None:
        self._file, self._piece = file, piece
        if file.read(0, len(BYTE_ORDER_MARK)) == BYTE_ORDER_MARK:
            self._first = len(BYTE_ORDER_MARK)
        else:
            self._first = 0
        self.pieces = range(self._first, file.size, piece)
        self._room: Callable[[Iterable[int]], MutableSequence[int]] = (
            list if len(self.pieces) == 1 else _make_compact
        )
        self._waiting: Iterator[int] = iter(self.pieces)
        self._found: dict[int, Sequence[int]] = {}
        # Locks of the additional threads, each of which releases its lock when it has finished.
        self._helping: list[_thread.LockType] = []

    def call_for_help(self) -> None:
        """Start an additional thread, and return at once."""
        helping = _thread.allocate_lock()
        helping.acquire()
        with suppress(
            RuntimeError
        ):  # No further thread is available, so this thread does the whole search.
            _thread.start_new_thread(self._help, (helping,))
            self._helping.append(helping)

    def _help(self, helping: _thread.LockType) -> None:
        """Search in an additional thread; after an error, `result` searches the blocks that remain."""
        try:
            with suppress(DeckError, OSError, MemoryError):
                self.go_on()
        finally:
            helping.release()

    def go_on(self) -> None:
        """Search the remaining blocks in one buffer, because new memory costs more than copying into old memory."""
        marks_by_piece: dict[int, Sequence[int]] = {}
        piece = bytearray(_LOOKBACK + min(self._piece, self._file.size))
        with self._file.opened() as fill:
            while (begin := next(self._waiting, None)) is not None:
                low = max(self._first, begin - _LOOKBACK)
                size = fill(piece, low, min(begin + self._piece, self._file.size))
                offsets = _find_starred(piece, begin - low, size) + _find_encrypted(
                    piece, begin - low, size
                )
                if offsets:
                    marks_by_piece[begin] = self._room(
                        [low + offset for offset in sorted(offsets)]
                    )
                else:
                    marks_by_piece[begin] = ()
        # This check shows whether the file changed during the search.
        self._found |= marks_by_piece

    def stop(self) -> None:
        """Take all remaining blocks away from the other threads, and wait until these threads have finished."""
        self._waiting = iter(())
        for helping in self._helping:
            helping.acquire()

    def result(self) -> Sequence[int]:
        """Return all marks. Pieces that a helper left are searched here, so that errors are raised in this thread."""
        if remaining := [begin for begin in self.pieces if begin not in self._found]:
            self._waiting = iter(remaining)
            self.go_on()
        marks = self._room(())
        for begin in self.pieces:
            marks.extend(self._found.pop(begin))
        return marks


def _make_compact(offsets: Iterable[int]) -> MutableSequence[int]:
    """Return offsets as an array of 64-bit integers."""
    # numpy is not imported at the top of the module, because small files need only a list.
    from array import array

    return array("q", offsets)


def _find_starred(piece: bytearray, first: int, end: int) -> list[int]:
    """Return the offsets of each ``*`` that begins a line."""
    offsets = []
    at = piece.find(b"*", first, end)
    while at >= 0:
        blanks = piece[max(0, at - _LOOKBACK) : at].rstrip(b" ")
        if blanks.endswith(b"\n") or (not blanks and at < _LOOKBACK):
            offsets.append(at)
        at = _find_below(piece, b"*", at, end)
    return offsets


def _find_below(piece: bytearray, letter: bytes, at: int, end: int) -> int:
    """Return the position of the next letter after the line that contains ``at``; -1 if there is none."""
    line = piece.find(b"\n", at, end)
    return piece.find(letter, line, end) if line >= 0 else -1


def _find_encrypted(piece: bytearray, first: int, end: int) -> list[int]:
    # A header that crosses the end of this block is found in the next block, which repeats the end of this one.
    """Return the offsets of the headers of encrypted blocks."""
    offsets = []
    at = piece.find(b"G", max(0, first - len(_PGP) + _ANCHOR + 1), end)
    while at >= 0:
        start = at - _ANCHOR
        preceding = bytes(piece[max(0, start - 1) : max(0, start)])
        if (
            start >= 0
            and piece.startswith(_PGP, start, end)
            and preceding in (b"", b"\n")
        ):
            offsets.append(start)
        at = _find_below(piece, b"G", at, end)
    return offsets


class SourceFile:
    """One deck file, read as bytes and decoded as Latin-1; all reads return bytes of the same snapshot.

    ``name`` is the path for messages. ``content`` is given if the content is not in a file or the file is open already.
    ``piece`` bytes are processed together. Line numbers are counted on request: in a large deck counting takes longer
    than finding the keywords.

    Raises
    ------
    DeckError
        If the file cannot be opened; any method also raises it if the file has been changed since then.
    """

    def __init__(
        self,
        name: str,
        content: bytes | HeldInMemory | DeckOnDisk | None = None,
        piece: int = _PIECE,
    ) -> None:
        self.name, self._piece = name, piece
        if content is None:
            content = open_stored(name)
        elif isinstance(content, bytes):
            content = HeldInMemory(content)
        self._file = content
        # Ascending offsets at which the line number is known, and these line numbers.
        self._counted = [(0, 1)]
        self._longest = bound("LINE")

    @cached_property
    def marks(self) -> Sequence[int]:
        """Return the offsets of all keywords and encrypted blocks; raise DeckError if no solver can read the file."""
        first = self.read(0, _FIRST)
        refuse_packed(self.name, first)
        refuse_binary_history(self.name, first)
        if b"\r" in first and b"\n" not in first:
            raise DeckError(
                f"{self.name}: lines end in CR alone (expected LF or CR LF); convert the line ends"
            )
        return find_marks(self._file)

    def refuse_history(self) -> None:
        """Raise DeckError if the file is a history or compressed."""
        head = self.read(0, _FIRST)
        refuse_packed(self.name, head)
        refuse_binary_history(self.name, head)
        if not self.marks:
            refuse_text_history(self.name, head)

    def describe_lack_of_keywords(self) -> str:
        """Return why a file has no keyword; raise DeckError if it is a history."""
        head = self.read(0, _FIRST)
        refuse_text_history(self.name, head)
        if not head.strip():
            return "the file is empty"
        return "binary data was found" if b"\0" in head else "no keyword was found"

    def blocks(self) -> Iterator[Block]:
        """Yield keyword blocks and encrypted blocks in file order, up to ``*END``."""
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
        """Return the bytes from ``start`` to ``end``, or up to the end of the file."""
        return self._file.read(start, self._file.size if end is None else end)

    def pieces(self, start: int, end: int | None = None) -> Iterator[bytes]:
        """Yield the bytes from ``start`` to ``end`` (default: end of the file) in blocks that end at a line ending."""
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
                size *= 2  # This line is longer than a block.

    def text(self, start: int, end: int | None) -> str:
        """Return the bytes from ``start`` to ``end`` as Latin-1 text."""
        data = self.read(start, end)
        self._refuse_long_line(data, start)
        return data.decode("latin-1")

    def _refuse_long_line(self, data: bytes, start: int) -> None:
        """Raise DeckError if a line is longer than the limit."""
        if (
            len(data) > self._longest
            and (at := find_long_line(data, self._longest)) >= 0
        ):
            raise DeckError(
                f"{self.name}:{self.line_at(start + at)}: the line has {describe_excess('LINE')}"
            )

    def sha256(self) -> str:
        """Return the SHA-256 of the bytes; raise DeckError if the file has changed since it was read."""
        import hashlib

        digest = hashlib.sha256()
        room = bytearray(min(self._piece, self._file.size))
        with self._file.opened() as fill:
            for at in range(0, self._file.size, self._piece):
                size = fill(room, at, min(at + self._piece, self._file.size))
                digest.update(memoryview(room)[:size])
        return digest.hexdigest()

    def ends_with_line(self) -> bool:
        """Return True if the last line has a line ending or the file is empty."""
        return self.read(max(0, self._file.size - 1)) in (b"", b"\n")

    @cached_property
    def silences(self) -> bool:
        """Return True if comments may silence rules; for a large file, this is assumed without a search."""
        return self._file.size > HELD_UP_TO or b"d2rpick" in self.read(0).lower()

    def line_at(self, offset: int) -> int:
        """Return the 1-based number of the line that contains the byte at ``offset``."""
        nearest = bisect_right(self._counted, (offset, 1 << 62)) - 1
        position, line = self._counted[nearest]
        step = -(-self._piece // _COUNTED)
        room = bytearray(min(step, max(0, offset - position)))
        with self._file.opened() as fill:
            for at in range(position, offset, step):
                line += room.count(b"\n", 0, fill(room, at, min(at + step, offset)))
        if offset > position:
            self._counted.insert(nearest + 1, (offset, line))
        return line


class Block:
    """A keyword with all lines up to the next keyword, or an encrypted block, as a byte range of a file."""

    # The initialiser of a data class would take longer, and a deck has many keywords.
    def __init__(
        self, source: SourceFile, start: int, end: int | None, head: str
    ) -> None:
        self.source = source
        self.start = start
        self.end = end
        self.head = head  # Text of the keyword line.

    @property
    def encrypted(self) -> bool:
        """Return True if this is an encrypted block."""
        return self.head.startswith("-")

    @property
    def _comment(self) -> tuple[str, ...]:
        """Return the characters that begin comment lines: ``$`` and, in Radioss files, ``#``."""
        return ("$", "#") if self.head.startswith("/") else ("$",)

    @cached_property
    def line(self) -> int:
        """Return the line number of the keyword line."""
        return self.source.line_at(self.start)

    def lines(self) -> list[tuple[int, str]]:
        """Return the data lines without comments, each with the number of lines from the keyword line to it."""
        comment = self._comment
        *lines, last = self.source.text(self.start, self.end).split("\n")
        # If this line were kept, the block would contain the spaces before the next keyword.
        if last and self.end is None:
            lines.append(last)
        numbered = enumerate(lines[1:], start=1)
        return [
            (distance, line.rstrip("\r"))
            for distance, line in numbered
            if not line.startswith(comment)
        ]

    @cached_property
    def silenced(self) -> tuple[str, ...]:
        """Return the rule ids, or prefixes of ids, in the ``$ d2rpick: ignore`` comments before the keyword.

        Only words directly after the colon are read, so that a reason may follow. A word that is not an id is returned
        too.
        """
        above = self.source.read(max(0, self.start - _BEFORE), self.start).removeprefix(
            BYTE_ORDER_MARK
        )
        # The last element contains only the spaces before the keyword.
        lines = above.decode("latin-1").split("\n")[:-1]
        rules: list[str] = []
        while lines and (line := lines.pop()).startswith(self._comment):
            if match := re.match(_SILENCE, line, re.IGNORECASE):
                rules += re.split(r"[\s,]+", match[1].strip(" \t\r,").upper())
        return tuple(rules)
