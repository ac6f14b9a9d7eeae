"""A text by its lines, whatever its encoding and line ends."""

from __future__ import annotations

from functools import cached_property
from itertools import chain, islice
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import FormatError
from d2rpick.base.files import beyond, long_line
from d2rpick.histories.content import Content, OnDisk, line_at

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.source import Source

UTF16: Final = (b"\xff\xfe", b"\xfe\xff")
_UTF8: Final = b"\xef\xbb\xbf"

# What these lines do not tell about the form of a text, the others will not.
HEAD: Final = 10_000


class Portions(NamedTuple):
    """How much of a text is looked at together."""

    head: int = HEAD  # lines that tell its form
    piece: int = 1 << 17  # bytes: their cells stay in the processor's cache
    short: int = 1 << 16  # a text of no more bytes is looked at as a whole to judge the printed format
    sample: int = 100  # of others so many lines from the start, the end and between
    large: int = 1 << 21  # bytes of a large text: each call of pandas takes a millisecond


_PORTIONS: Final = Portions()


class Text:
    """Lines of a file, line ends as line feeds; ``unended`` is the last one when it has no end, else empty.

    A big file in plain ASCII stays on its disk.  FormatError for binary data, and for a line beyond the bound.
    """

    def __init__(self, source: Source, portions: Portions = _PORTIONS) -> None:
        self.name, self._portions = source.name, portions
        self._data, self._encoding = _plain(source, portions.piece)
        self._check_lines()
        self._end = self._data.rfind(b"\n", 0, len(self._data)) + 1  # behind the last line that counts
        self.unended = self._text(self._data[self._end :])

    @property
    def head(self) -> list[str]:
        """The first lines that have an end, as many as tell its form."""
        return self._first[: self._portions.head]

    @property
    def is_short(self) -> bool:
        """Whether ``head`` holds all lines but the last one without end."""
        return len(self._first) <= self._portions.head

    @cached_property
    def _first(self) -> list[str]:
        return list(islice(self.lines(0), self._portions.head + 1))

    def place(self, line: int) -> int:
        """Where a line begins, counted from 0 [byte]; the end of the lines where there are fewer."""
        at = 0
        for _ in range(line):
            at = self._data.find(b"\n", at) + 1 or self._end
        return at

    def take_rest(self) -> None:
        """Count the last line, which has no end, as whole."""
        self._end = len(self._data)

    @property
    def is_large(self) -> bool:
        """Whether it stayed on its disk, and so is plain ASCII."""
        return isinstance(self._data, OnDisk)

    def pieces(self, begin: int, *, large: bool = False) -> Iterator[bytes]:
        """Whole lines from byte ``begin`` on, some or many at a time, each with its end.

        FormatError behind the last of them where the file was written anew meanwhile.
        """
        size = self._portions.large if large else self._portions.piece
        while begin < self._end:
            piece = self._data[begin : min(begin + size, self._end)]
            end = piece.rfind(b"\n") + 1
            if not end and begin + size < self._end:
                size *= 2  # for the sake of a long line
                continue
            yield piece[:end] or piece + b"\n"
            begin += end or len(piece)
        self._data.check()

    def lines(self, begin: int) -> Iterator[str]:
        """Lines from byte ``begin`` on, without their ends."""
        for piece in self.pieces(begin):
            yield from self.rows(piece)

    def rows(self, piece: bytes) -> list[str]:
        """Lines of a piece, without their ends."""
        return self._text(piece[:-1]).split("\n")

    def sample(self, begin: int) -> list[str]:
        """Lines behind byte ``begin`` from the start, the end and evenly between; all of a short text."""
        data, end, count = self._data, self._end, self._portions.sample
        if end - begin <= self._portions.short:
            return [] if begin >= end else self._text(data[begin:end]).removesuffix("\n").split("\n")
        starts, first, last = [], begin, end
        for _ in range(count):
            starts.append(first)
            first = data.find(b"\n", first) + 1 or end
        for _ in range(count):
            last = data.rfind(b"\n", 0, max(last - 1, 0)) + 1
            starts.append(last)
        between = ((first * (count - i) + last * i) // count for i in range(count))
        # each is read as soon as its place is known: what lies behind that is then at hand
        every = chain(starts, (data.find(b"\n", at) + 1 for at in between))
        spans = ((at, data.find(b"\n", at)) for at in every if begin <= at < end)
        lines = [self._text(data[at : to if to >= 0 else end]) for at, to in spans]
        data.check()
        return lines

    def _check_lines(self) -> None:
        at = long_line(self._data)
        if at >= 0:
            raise FormatError(f"{self.name}:{line_at(self._data, at)}: the line has {beyond('LINE')}")

    def _text(self, data: bytes) -> str:
        return data.decode(self._encoding)


def _plain(source: Source, piece: int) -> tuple[Content, str]:
    """Text with line feeds alone and no mark before it, and its encoding."""
    data = source.data
    if not isinstance(data, bytes):
        pieces = (data[at : at + piece] for at in range(0, len(data), piece))
        if all(one.isascii() and b"\r" not in one and b"\0" not in one for one in pieces):
            return data, "latin-1"  # of which ASCII is a part
    data = bytes(data)
    if data.startswith(UTF16):
        data = data.decode("utf-16", errors="replace").encode()
    elif b"\0" in data:
        raise FormatError(f"{source.name}: binary data, a text table was expected; export the history as CSV")
    data = data.removeprefix(_UTF8)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return Content(data), _encoding(data)


def _encoding(data: bytes) -> str:
    """UTF-8 where it fits, as for plain ASCII; else latin-1, which takes any bytes."""
    if data.isascii():
        return "ascii"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"
