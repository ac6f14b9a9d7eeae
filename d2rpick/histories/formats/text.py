"""A text by its lines: the first of them, those at sampled places, or piece by piece; never a list of all."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Final

from d2rpick.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.source import Source

UTF16: Final = (b"\xff\xfe", b"\xfe\xff")
_UTF8: Final = b"\xef\xbb\xbf"

# What these lines do not tell about the form of a text, the others will not.
HEAD: Final = 10_000

# Bytes at a time: their cells stay in the processor's cache.
_PIECE: Final = 1 << 17

# A text of no more bytes is looked at as a whole to judge the printed format.
_SHORT: Final = 1 << 16

# How many lines from the start, the end and between are looked at to judge the printed format.
_SAMPLE: Final = 100


class Text:
    """Lines of a file, line ends as line feeds; ``unended`` is the last one when it has no end, else empty.

    FormatError for binary data.
    """

    def __init__(self, source: Source) -> None:
        self.name = source.name
        data = bytes(source.data)
        if data.startswith(UTF16):
            data = data.decode("utf-16", errors="replace").encode()
        elif b"\0" in data:
            raise FormatError(f"{self.name}: binary data, a text table was expected; export the history as CSV")
        data = data.removeprefix(_UTF8)
        if b"\r" in data:
            data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        self._data = data
        self._end = data.rfind(b"\n") + 1  # behind the last line that counts
        self._encoding = _encoding(data)
        self.unended = self._text(data[self._end :])

    @cached_property
    def head(self) -> list[str]:
        """The first lines that have an end, at most `HEAD` of them."""
        return self._text(self._data[: self._head_end]).split("\n")[:-1]

    @cached_property
    def is_short(self) -> bool:
        """Whether ``head`` holds all lines but the last one without end."""
        return self._head_end == self._data.rfind(b"\n") + 1

    @cached_property
    def _head_end(self) -> int:
        return self.place(HEAD)

    def place(self, line: int) -> int:
        """Where a line begins, counted from 0 [byte]; the end of the lines where there are fewer."""
        at = 0
        for _ in range(line):
            at = self._data.find(b"\n", at, self._end) + 1
            if not at:
                return self._end
        return at

    def take_rest(self) -> None:
        """Count the last line, which has no end, as whole."""
        self._end = len(self._data)

    def pieces(self, begin: int) -> Iterator[bytes]:
        """Whole lines from byte ``begin`` on, some at a time, each with its end."""
        while begin < self._end:
            end = self._data.find(b"\n", begin + _PIECE, self._end) + 1 or self._end
            piece = self._data[begin:end]
            yield piece if piece.endswith(b"\n") else piece + b"\n"
            begin = end

    def lines(self, begin: int) -> Iterator[str]:
        """Lines from byte ``begin`` on, without their ends."""
        for piece in self.pieces(begin):
            yield from self.rows(piece)

    def rows(self, piece: bytes) -> list[str]:
        """Lines of a piece, without their ends."""
        return self._text(piece[:-1]).split("\n")

    def sample(self, begin: int) -> list[str]:
        """Lines behind byte ``begin`` from the start, the end and evenly between; all of a short text."""
        data, end = self._data, self._end
        if end - begin <= _SHORT:
            return [] if begin >= end else self._text(data[begin:end]).removesuffix("\n").split("\n")
        starts, first, last = [], begin, end
        for _ in range(_SAMPLE):
            starts.append(first)
            first = data.find(b"\n", first, end) + 1 or end
            last = data.rfind(b"\n", 0, last - 1) + 1
            starts.append(last)
        between = ((first * (_SAMPLE - i) + last * i) // _SAMPLE for i in range(_SAMPLE))
        starts += (data.find(b"\n", at, end) + 1 for at in between)
        spans = ((at, data.find(b"\n", at, end)) for at in starts if begin <= at < end)
        return [self._text(data[at : to if to >= 0 else end]) for at, to in spans]

    def _text(self, data: bytes) -> str:
        return data.decode(self._encoding)


def _encoding(data: bytes) -> str:
    """UTF-8 where it fits, as for plain ASCII; else latin-1, which takes any bytes."""
    if data.isascii():
        return "ascii"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"
