"""Read the lines of a text file with any encoding and line endings, and determine the precision of its numbers."""

from __future__ import annotations

import re
from itertools import chain, islice
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError
from d2rpick.base.files import describe_excess, find_long_line
from d2rpick.histories.content import Content, OnDisk, count_line_number
from d2rpick.histories.history import EXACT, Precision, Samples

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.histories.source import Source

UTF16: Final = (b"\xff\xfe", b"\xfe\xff")
_UTF8: Final = b"\xef\xbb\xbf"

# Number of lines from which the encoding, separator and header of a text are determined.
HEAD: Final = 10_000

# Pattern of a number, with groups for the digits before and after the decimal point, and for the exponent.
_PARTS = re.compile(r"[+-]?(\d*+)\.?+(\d*+)(?:[eEdD]([+-]?\d++))?")
# Number of significant digits that preserve every double.
_LONGEST = 17
_PLAIN = r"[+-]?(?:0|[1-9]\d+)\.\d+"
# Table that replaces each digit other than 0 by 9.
_SHAPE_OF_DIGITS = str.maketrans("12345678", "99999999")
# A format with at least this many digits is treated as lossless, because 15 digits survive conversion to a double.
_FULL = 15


class Text:
    """The lines of a file, each with a line feed at its end; ``unended`` is an unterminated last line, or empty.

    A large file in plain ASCII stays on disk. Raises FormatError for binary data and for a line that is too long.
    """

    # The constants of this class limit how many lines and bytes are read in one step.
    # Number of lines from which the encoding, separator and header of the text are determined.
    top = HEAD
    # Number of bytes that are read at a time, so that their cells fit into the processor cache.
    piece = 1 << 17
    # In a text of at most this size [bytes], the printed precision is determined from all fields.
    short = 1 << 16
    # Number of lines that are sampled at the start, at the end and in between if a text is longer.
    some = 100
    # Number of bytes of a large text that are read at a time; it is large, because each pandas call takes milliseconds.
    large = 1 << 22

    def __init__(self, source: Source) -> None:
        self.name = source.name
        self._data, self._encoding = _read_plain_text(source, self.piece)
        self._check_lines()
        # Offset after the last complete line [bytes].
        self._end = self._data.rfind(b"\n", 0, len(self._data)) + 1
        self.unended = self._text(self._data[self._end :])

    @property
    def head(self) -> list[str]:
        """The first complete lines, from which the layout of the text is determined."""
        return self._first[: self.top]

    @property
    def is_short(self) -> bool:
        """True if ``head`` contains all lines, apart from an unterminated last line."""
        return len(self._first) <= self.top

    @cached_property
    def _first(self) -> list[str]:
        lines = chain.from_iterable(map(self.rows, self.pieces(0)))
        return list(islice(lines, self.top + 1))

    def place(self, line: int) -> int:
        """Return the offset of a line, counted from 0 [bytes]; the end of the last line if there are fewer lines."""
        address = 0
        for _ in range(line):
            address = self._data.find(b"\n", address) + 1 or self._end
        return address

    def take_rest(self) -> None:
        """Treat the unterminated last line as a complete line."""
        self._end = len(self._data)

    @property
    def is_large(self) -> bool:
        """True if the file stays on disk while it is read, which is possible only for plain ASCII files."""
        return isinstance(self._data, OnDisk)

    def pieces(self, begin: int, *, large: bool = False) -> Iterator[bytes]:
        """Yield the complete lines after byte ``begin``, in blocks of many lines; ``large`` selects larger blocks.

        Raises FormatError after the last block if the file was rewritten in the meantime.
        """
        size = self.large if large else self.piece
        while begin < self._end:
            piece = self._data[begin : min(begin + size, self._end)]
            end = piece.rfind(b"\n") + 1
            if not end and begin + size < self._end:
                size *= 2  # This line is longer than a block.
                continue
            yield piece[:end] or piece + b"\n"
            begin += end or len(piece)
        self._data.check()

    def lines(self, begin: int) -> Iterator[str]:
        """Yield the lines that start at or after byte ``begin``, without their line endings."""
        for piece in self.pieces(begin):
            yield from self.rows(piece)

    def rows(self, piece: bytes) -> list[str]:
        """Return the lines of a block of text, without their line endings."""
        return self._text(piece[:-1]).split("\n")

    def sample(self, begin: int) -> list[str]:
        """Return lines after byte ``begin``: all lines of a short text, or samples of lines of a long text."""
        data = self._data
        end = self._end
        count = self.some
        if begin >= end:
            return []
        if end - begin <= self.short:
            return self._text(data[begin:end]).removesuffix("\n").split("\n")
        starts, first, last = [], begin, end
        for _ in range(count):
            starts.append(first)
            first = data.find(b"\n", first) + 1 or end
        for _ in range(count):
            last = data.rfind(b"\n", 0, max(last - 1, 0)) + 1
            starts.append(last)
        between = ((first * (count - i) + last * i) // count for i in range(count))
        # Each line is read as soon as its offset is known, while this part of the file is still in memory.
        addresses = chain(
            starts, (data.find(b"\n", position) + 1 for position in between)
        )
        lines = []
        for address in addresses:
            if begin <= address < end:
                line_end = data.find(b"\n", address)
                lines.append(
                    self._text(data[address : line_end if line_end >= 0 else end])
                )
        data.check()
        return lines

    def _check_lines(self) -> None:
        """Raise FormatError with the number of a line that is too long."""
        at = find_long_line(self._data)
        if at >= 0:
            raise FormatError(
                f"{self.name}:{count_line_number(self._data, at)}: the line has {describe_excess('LINE')}"
            )

    def _text(self, data: bytes) -> str:
        return data.decode(self._encoding)


def _read_plain_text(source: Source, piece: int) -> tuple[Content, str]:
    """Return the text with line feeds only and without a byte order mark, and the encoding of the file."""
    data = source.data
    if not isinstance(data, bytes):
        pieces = (
            data[address : address + piece] for address in range(0, len(data), piece)
        )
        if all(map(_is_plain, pieces)):
            return data, "latin-1"  # ASCII is a subset of Latin-1.
    data = bytes(data)
    if data.startswith(UTF16):
        data = data.decode("utf-16", errors="replace").encode()
    elif b"\0" in data:
        raise FormatError(
            f"{source.name}: binary data, but a text table was expected; export the history as CSV"
        )
    data = data.removeprefix(_UTF8)
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return Content(data), _detect_encoding(data)


def _is_plain(data: bytes) -> bool:
    """Return True if data are ASCII text without carriage returns or null characters."""
    return data.isascii() and b"\r" not in data and b"\0" not in data


def _detect_encoding(data: bytes) -> str:
    """Return "ascii" or "utf-8" if the data are valid in this encoding, else "latin-1", which accepts any bytes."""
    if data.isascii():
        return "ascii"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def find_precisions(
    time: Sequence[str], energy: Sequence[str], moments: Samples
) -> tuple[Precision, Precision]:
    """Return the precision with which times and energies were printed, from a sample of their fields.

    A program is assumed to write all columns in the same format, so the largest number of significant digits in any
    field applies to both columns (formats like ``%g`` omit trailing zeros); 15 or more digits mean that nothing was
    lost. A column without exponents whose fields all have the same number of decimals is assumed to have fixed
    decimals. Times on an exactly uniform grid with more decimals than the grid needs are exact multiples of a time step
    and get the digits of the energy; otherwise, they may have been rounded to the grid.

    Parameters
    ----------
    time, energy : sequences of str
        Fields with a decimal point, at least one each.
    moments : array of shape (n,)
        The times of the whole record as numbers [time].

    Examples
    --------
    >>> find_precisions(["0.001", "0.0025", "0.0041"], ["1.25000e+01"], np.array([0.001, 0.0025, 0.0041]))
    (Precision(digits=6, decimals=None), Precision(digits=6, decimals=None))
    """
    shapes_of_time, shapes_of_energy = _find_shapes(time), _find_shapes(energy)
    digits = 0
    for shape in shapes_of_time | shapes_of_energy:
        if _count_at_most(shape) > digits:
            digits = max(digits, _count_significant_digits(shape))
        if digits >= _FULL:
            return EXACT, EXACT
    general = Precision(digits=max(digits, 1))
    time_decimals = _find_fixed_decimals(shapes_of_time)
    energy_decimals = _find_fixed_decimals(shapes_of_energy)
    time_fixed = time_decimals and not _is_finer_than_its_grid(time_decimals, moments)
    time_precision = energy_precision = general
    if time_fixed:
        time_precision = Precision(digits=general.digits, decimals=time_decimals)
    if energy_decimals:
        energy_precision = Precision(digits=general.digits, decimals=energy_decimals)
    return time_precision, energy_precision


def is_whole_field(field: str, above: Sequence[str]) -> bool:
    """Return True if the last field of a truncated file is complete, judging by the fields above it.

    The field is complete if the column has a format of constant length, i.e. always the same number of decimals (two or
    more) and of digits in the exponent, and at least one trailing zero, which shortest formats (``%g``) never write. An
    exponent that could be the beginning of a longer one (``e-10`` of ``e-100``) is not treated as complete. The field
    is also complete if it has the 17 digits that restore every double, no field above has more digits, and no exponent
    can follow, because an exponent follows only a mantissa with one digit before the point.

    Examples
    --------
    >>> is_whole_field("1.25", ["0.50", "0.75"]), is_whole_field("1.2", ["0.50", "0.75"])
    (True, False)
    >>> is_whole_field("1.25", ["0.55"])
    False
    >>> is_whole_field("0.30000000000000004", ["0.1"]), is_whole_field("3.0000000000000004", ["0.1"])
    (True, False)
    """
    longest_above = (
        max(_LONGEST, *map(_count_significant_digits, above)) if above else 0
    )
    if _count_significant_digits(field) == _LONGEST == longest_above:
        return re.fullmatch(_PLAIN, field, re.ASCII) is not None
    parts = [_PARTS.fullmatch(text) for text in (field, *above)]
    shapes = {
        (len(part[2]), len((part[3] or "").lstrip("+-"))) for part in parts if part
    }
    if None in parts or len(shapes) != 1:
        return False
    decimals, width = shapes.pop()
    padded = any(part[2].endswith("0") for part in parts[1:] if part)
    # A two-digit exponent of at most 32 may be the beginning of 324, the largest exponent of a double.
    longest_start = 32
    exponent = parts[0][3] if parts[0] else None
    doubtful = (
        width == 2
        and exponent is not None
        and 10 <= abs(int(exponent)) <= longest_start
    )
    return decimals > 1 and padded and not doubtful


def _count_at_most(field: str) -> int:
    """Return an upper limit of the number of significant digits of a field, which costs less than the number."""
    written = field.lstrip("+-0.")
    if not written[:1].isdigit():
        written = field  # The zeros of 0.00000E+00 are treated as significant digits.
    return len(written) - ("." in written)


def _find_shapes(fields: Sequence[str]) -> set[str]:
    """Return the distinct fields after each digit other than 0 has been replaced by 9.

    Only the digits and zeros of a field decide its precision, and a column has far fewer such shapes than fields.
    """
    return {*"\n".join(fields).translate(_SHAPE_OF_DIGITS).split("\n")}


def _count_significant_digits(field: str) -> int:
    """Return the number of significant digits of a field; 0 if the field is not a number."""
    parts = _PARTS.fullmatch(field)
    if not parts:
        return 0
    digits = parts[1] + parts[2]
    if not digits.lstrip("0") and parts[3]:
        return len(digits)  # The number 0.00000E+00 has six significant digits.
    return len(digits.lstrip("0"))


def _find_fixed_decimals(shapes: Iterable[str]) -> int | None:
    """Return the number of decimals that all shapes have in common; None if they differ or have an exponent."""
    lengths = {shape.replace("0", "9") for shape in shapes}
    numbers_of_decimals = {*map(_decimals, lengths)}
    if len(numbers_of_decimals) != 1:
        return None
    return numbers_of_decimals.pop() or None


def _decimals(field: str) -> int:
    """Return the number of decimals of a number without an exponent; 0 for any other field."""
    parts = _PARTS.fullmatch(field)
    return len(parts[2]) if parts and parts[3] is None else 0


def _is_finer_than_its_grid(decimals: int, moments: Samples) -> bool:
    """Return True if the times are equally spaced and their interval needs fewer decimals than ``decimals``."""
    if moments.size < 3:
        return False
    steps = np.diff(moments)
    coarser = float(steps[0]) * 10.0 ** (decimals - 1)
    is_uniform = bool(np.ptp(steps) <= 1e-9 * abs(steps[0]))
    return is_uniform and abs(coarser - round(coarser)) <= 1e-6 * abs(coarser)
