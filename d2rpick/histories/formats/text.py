"""A text by its lines, whatever its encoding and line ends, and what the printed form of its numbers tells."""

from __future__ import annotations

import re
from itertools import chain, islice
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError
from d2rpick.base.files import beyond, long_line
from d2rpick.histories.content import Content, OnDisk, line_at
from d2rpick.histories.history import EXACT, Precision, Samples

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.source import Source

UTF16: Final = (b"\xff\xfe", b"\xfe\xff")
_UTF8: Final = b"\xef\xbb\xbf"

# What these lines do not tell about the form of a text, the others will not.
HEAD: Final = 10_000


class Text:
    """Lines of a file, line ends as line feeds; ``unended`` is the last one when it has no end, else empty.

    A big file in plain ASCII stays on its disk.  FormatError for binary data, and for a line beyond the bound.
    """

    # How much is looked at together.
    top = HEAD  # lines that tell its form
    piece = 1 << 17  # bytes: their cells stay in the processor's cache
    short = (
        1 << 16
    )  # a text of no more bytes is looked at as a whole to judge the printed format
    some = 100  # of others so many lines from the start, the end and between
    large = (
        1 << 22
    )  # bytes of a large text: each call of pandas or scipy takes milliseconds

    def __init__(self, source: Source) -> None:
        self.name = source.name
        self._data, self._encoding = _plain(source, self.piece)
        self._check_lines()
        self._end = (
            self._data.rfind(b"\n", 0, len(self._data)) + 1
        )  # behind the last line that counts
        self.unended = self._text(self._data[self._end :])

    @property
    def head(self) -> list[str]:
        """The first lines that have an end, as many as tell its form."""
        return self._first[: self.top]

    @property
    def is_short(self) -> bool:
        """Whether ``head`` holds all lines but the last one without end."""
        return len(self._first) <= self.top

    @cached_property
    def _first(self) -> list[str]:
        return list(islice(self.lines(0), self.top + 1))

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
        size = self.large if large else self.piece
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
        data, end, count = self._data, self._end, self.some
        if end - begin <= self.short:
            return (
                []
                if begin >= end
                else self._text(data[begin:end]).removesuffix("\n").split("\n")
            )
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
            raise FormatError(
                f"{self.name}:{line_at(self._data, at)}: the line has {beyond('LINE')}"
            )

    def _text(self, data: bytes) -> str:
        return data.decode(self._encoding)


def _plain(source: Source, piece: int) -> tuple[Content, str]:
    """Text with line feeds alone and no mark before it, and its encoding."""
    data = source.data
    if not isinstance(data, bytes):
        pieces = (data[at : at + piece] for at in range(0, len(data), piece))
        if all(
            one.isascii() and b"\r" not in one and b"\0" not in one for one in pieces
        ):
            return data, "latin-1"  # of which ASCII is a part
    data = bytes(data)
    if data.startswith(UTF16):
        data = data.decode("utf-16", errors="replace").encode()
    elif b"\0" in data:
        raise FormatError(
            f"{source.name}: binary data, a text table was expected; export the history as CSV"
        )
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


_PARTS = re.compile(r"[+-]?(\d*+)\.?+(\d*+)(?:[eEdD]([+-]?\d++))?")

# Digits that restore every double, and numbers that are not written with an exponent.
_LONGEST = 17
_PLAIN = r"[+-]?(?:0|[1-9]\d+)\.\d+"  # compiled where it is needed

# 15 significant digits are what every double keeps; a writer that shows so many meant to lose nothing.
_FULL = 15


def precisions(
    time: Sequence[str], energy: Sequence[str], moments: Samples
) -> tuple[Precision, Precision]:
    """How finely time and energy were written, from a sample of their fields.

    One writer uses one format: the most significant digits seen in any field hold for both columns, since
    formats like ``%g`` drop trailing zeros; 15 or more mean that nothing was lost.  A column without
    exponents whose fields all have the same number of decimals is taken as written in fixed decimals.
    Times on an exactly uniform grid that show more decimals than the grid needs are the multiples of a step
    that was meant, and get the digits of the energy; with no decimal to spare they may be rounded to the grid.

    Parameters
    ----------
    time, energy : sequences of str
        Fields with a decimal point, at least one each.
    moments : array of shape (n,)
        The times as numbers, of the whole record [unit of the run].

    Examples
    --------
    >>> precisions(["0.001", "0.0025", "0.0041"], ["1.25000e+01"], np.array([0.001, 0.0025, 0.0041]))
    (Precision(digits=6, decimals=None), Precision(digits=6, decimals=None))
    """
    digits = 0
    for field in (*energy, *time):
        if len(field) > digits:  # a field has no more digits than signs
            digits = max(digits, _significant(field))
        if digits >= _FULL:
            return EXACT, EXACT
    general = Precision(digits=max(digits, 1))
    time_decimals, energy_decimals = _fixed_decimals(time), _fixed_decimals(energy)
    time_fixed = time_decimals and not _is_finer_than_its_grid(time_decimals, moments)
    return (
        Precision(digits=general.digits, decimals=time_decimals)
        if time_fixed
        else general,
        Precision(digits=general.digits, decimals=energy_decimals)
        if energy_decimals
        else general,
    )


def is_whole(field: str, above: Sequence[str]) -> bool:
    """Whether a field at which a file breaks off is certainly not cut, judged by the fields above it.

    It is when the column has a format of constant length: always the same number of decimals (two or more)
    and of digits in the exponent, with a trailing zero somewhere, which shortest formats (``%g``) never
    write.  An exponent that could be the start of a longer one (``e-10`` of ``e-100``) remains in doubt.  It also is
    when it has the 17 digits that restore every double, as no field above has more, and no exponent can follow: that
    stands behind a mantissa of one digit before the point.

    Examples
    --------
    >>> is_whole("1.25", ["0.50", "0.75"]), is_whole("1.2", ["0.50", "0.75"]), is_whole("1.25", ["0.55"])
    (True, False, False)
    >>> is_whole("0.30000000000000004", ["0.1"]), is_whole("3.0000000000000004", ["0.1"])
    (True, False)
    """
    if above and _significant(field) == _LONGEST == max(
        _LONGEST, *map(_significant, above)
    ):
        return re.fullmatch(_PLAIN, field, re.ASCII) is not None
    parts = [_PARTS.fullmatch(text) for text in (field, *above)]
    shapes = {
        (len(part[2]), len((part[3] or "").lstrip("+-"))) for part in parts if part
    }
    if None in parts or len(shapes) != 1:
        return False
    decimals, width = shapes.pop()
    padded = any(part[2].endswith("0") for part in parts[1:] if part)
    longest_start = 32  # no double has an exponent beyond 324
    exponent = parts[0][3] if parts[0] else None
    doubtful = (
        width == 2
        and exponent is not None
        and 10 <= abs(int(exponent)) <= longest_start
    )
    return decimals > 1 and padded and not doubtful


def _significant(field: str) -> int:
    parts = _PARTS.fullmatch(field)
    if not parts:
        return 0
    digits = parts[1] + parts[2]
    return len(digits.lstrip("0")) or (
        len(digits) if parts[3] else 0
    )  # 0.00000E+00 has six


def _fixed_decimals(fields: Sequence[str]) -> int | None:
    same = _decimals(fields[0]) if fields else 0
    alike = same > 0 and all(_decimals(field) == same for field in fields)
    return same if alike else None


def _decimals(field: str) -> int:
    """Count the decimals of a number without an exponent; 0 for another."""
    parts = _PARTS.fullmatch(field)
    return len(parts[2]) if parts and parts[3] is None else 0


def _is_finer_than_its_grid(decimals: int, moments: Samples) -> bool:
    """Whether times are equidistant and their step could be written with fewer decimals."""
    if moments.size < 3:
        return False
    steps = np.diff(moments)
    coarser = float(steps[0]) * 10.0 ** (decimals - 1)
    return bool(np.ptp(steps) <= 1e-9 * abs(steps[0])) and abs(
        coarser - round(coarser)
    ) <= 1e-6 * abs(coarser)
