"""A deck file on disk: where its keywords stand, and the lines between two of them."""

from __future__ import annotations

import io
import os
import re
import stat
from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from d2rpick.errors import DeckError

if TYPE_CHECKING:
    from collections.abc import Iterator

STDIN = "-"  # name of what was read from standard input
_CHUNK = 256 * 1024
_LOOKBACK = 32  # bytes of the chunk before, so that what stands in front of a hit is always at hand
_PGP = b"-----BEGIN PGP MESSAGE"
_ANCHOR = _PGP.index(b"G")  # a letter that mesh data never holds: looking for it alone costs nothing
_MARK = b"\xef\xbb\xbf"  # byte order mark of UTF-8
_GZIP = b"\x1f\x8b\x08"
_HEAD = 1024  # longest keyword line that is looked at
_BEFORE = 4096  # how far back comments belonging to a keyword are looked for
_SILENCE = re.compile(r"[$#]\s*d2rpick:\s*ignore\b[\s:]*((?:D2R\w*[\s,]*)+|\S*)", re.IGNORECASE)


class SourceFile:
    """One deck file, read as bytes and shown as Latin-1; nothing that lies in a file is kept in memory.

    ``name`` is the path as messages show it; ``content`` is given for what does not lie in a file.  Line
    numbers are counted when they are asked for: in a large deck counting costs more than finding the keywords.
    """

    def __init__(self, name: str, content: bytes | None = None) -> None:
        self.name = name
        self._content = content
        self._counted = [(0, 1)]  # (offset, number of the line that holds it), ascending

    def blocks(self) -> Iterator[Block]:
        """Keyword blocks and encrypted blocks in the order of the file, up to ``*END``."""
        previous: tuple[int, str] | None = None
        for offset, head in self._marks():
            if previous is not None:
                yield Block(self, previous[0], offset, previous[1])
            previous = offset, head
            if head.upper().startswith("*END") and not head[4:5].strip():
                return
        if previous is not None:
            yield Block(self, previous[0], None, previous[1])

    def read(self, start: int, end: int) -> bytes:
        """Read the bytes from ``start`` to ``end``, less where the file ends before."""
        with self._open() as stream:
            stream.seek(start)
            return stream.read(end - start)

    def lines_from(self, start: int) -> Iterator[bytes]:
        """Lines from the byte at ``start`` on, with their ends."""
        with self._open() as stream:
            stream.seek(start)
            yield from stream

    def ends_with_line(self) -> bool:
        """Whether the last line has its line end; an empty file has."""
        with self._open() as stream:
            size = stream.seek(0, io.SEEK_END)
            stream.seek(max(0, size - 1))
            return stream.read() in (b"", b"\n")

    def line_at(self, offset: int) -> int:
        """Return the number of the line, from 1, that holds the byte at ``offset``."""
        known = bisect_right(self._counted, (offset, 1 << 62)) - 1
        position, line = self._counted[known]
        buffer = bytearray(min(_CHUNK, max(0, offset - position)))
        with self._open() as stream:
            stream.seek(position)
            while position < offset and (count := stream.readinto(buffer)):
                count = min(count, offset - position)
                line += buffer.count(b"\n", 0, count)
                position += count
        if known == len(self._counted) - 1 and position > self._counted[-1][0]:
            self._counted.append((position, line))
        return line

    def _marks(self) -> Iterator[tuple[int, str]]:
        """Find lines that start with ``*`` (blanks before it allowed) and heads of encrypted blocks."""
        buffer = bytearray(b"\n" * _LOOKBACK + bytes(_CHUNK))
        base = -_LOOKBACK
        with self._open() as stream:
            while count := stream.readinto(memoryview(buffer)[_LOOKBACK:]):
                end = _LOOKBACK + count
                if base < 0:
                    self._start(buffer, end)
                for at in sorted([*_starred(buffer, end), *_encrypted(buffer, end)]):
                    cut = at + _HEAD > end
                    piece = self.read(base + at, base + at + _HEAD) if cut else bytes(buffer[at : at + _HEAD])
                    yield base + at, piece.partition(b"\n")[0].rstrip(b"\r").decode("latin-1")
                buffer[:_LOOKBACK] = buffer[end - _LOOKBACK : end]
                base += count

    def _start(self, buffer: bytearray, end: int) -> None:
        """Pass over a byte order mark; refuse what no reader of decks would see: compressed files, ends in CR alone."""
        if buffer.startswith(_GZIP, _LOOKBACK):
            raise DeckError(f"{self.name}: compressed with gzip, a deck as its solver reads it was expected; unpack it")
        if buffer.startswith(_MARK, _LOOKBACK):
            buffer[_LOOKBACK : _LOOKBACK + len(_MARK)] = b"\n" * len(_MARK)
        if buffer.find(b"\r", _LOOKBACK, end) >= 0 > buffer.find(b"\n", _LOOKBACK, end):
            raise DeckError(f"{self.name}: lines end in CR alone, line ends LF or CR LF were expected")

    def _open(self) -> io.BufferedReader | io.BytesIO:
        if self._content is not None:
            return io.BytesIO(self._content)
        try:
            stream = Path(self.name).open("rb")  # noqa: SIM115  it is given back
        except FileNotFoundError:
            raise DeckError(f"{self.name}: no such file; check the name and the folder") from None
        except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
            reason = getattr(error, "strerror", None) or error
            raise DeckError(f"{self.name}: cannot be read ({reason}); check the name and the permissions") from None
        if stat.S_ISCHR(os.fstat(stream.fileno()).st_mode) and not stream.isatty():  # /dev/zero never ends
            stream.close()
            raise DeckError(f"{self.name}: this is a device, a readable deck was expected")
        return stream


def _starred(buffer: bytearray, end: int) -> Iterator[int]:
    at = buffer.find(b"*", _LOOKBACK, end)
    while at >= 0:
        before = buffer[at - _LOOKBACK : at].rstrip(b" ")
        if before.endswith(b"\n"):
            yield at
        at = buffer.find(b"*", at + 1, end)


def _encrypted(buffer: bytearray, end: int) -> Iterator[int]:
    # a head cut by the end of this chunk is found in the next one, where all of it stands in the lookback
    tail = len(_PGP) - _ANCHOR
    at = buffer.find(b"G", _LOOKBACK - tail + 1, end)
    while at >= 0:
        start = at - _ANCHOR
        if at + tail <= end and buffer.startswith(_PGP, start) and buffer[start - 1] == ord("\n"):
            yield start
        at = buffer.find(b"G", at + 1, end)


@dataclass(frozen=True, eq=False)
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
    def _comment(self) -> tuple[bytes, ...]:
        """What begins a comment line: ``$`` in LS-DYNA's decks, ``#`` too in those of Radioss."""
        return (b"$", b"#") if self.head.startswith("/") else (b"$",)

    @cached_property
    def line(self) -> int:
        """Number of the keyword line in its file."""
        return self.source.line_at(self.start)

    def lines(self) -> Iterator[tuple[int, str]]:
        """Read the data lines, with their distance to the keyword, without comments."""
        position = self.start
        for distance, raw in enumerate(self.source.lines_from(self.start)):
            position += len(raw)
            if self.end is not None and position > self.end:
                return
            if distance and not raw.startswith(self._comment):
                yield distance, raw.rstrip(b"\r\n").decode("latin-1")

    @cached_property
    def silenced(self) -> tuple[str, ...]:
        """Rules, or beginnings of their ids, that ``$ d2rpick: ignore`` names in the comments before the keyword.

        Only what stands directly behind it counts, so that a reason may follow; a word that is no id is given too.
        """
        before = self.source.read(max(0, self.start - _BEFORE), self.start).removeprefix(_MARK).decode("latin-1")
        rules: list[str] = []
        for line in reversed(before.split("\n")[:-1]):
            if not line.encode("latin-1").startswith(self._comment):
                break
            if found := _SILENCE.match(line):
                rules += re.split(r"[\s,]+", found[1].strip(" \t\r,").upper())
        return tuple(rules)
