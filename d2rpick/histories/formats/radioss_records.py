"""Read the records of Radioss time histories from binary files and from the text files of ``/TFILE/3``.

A binary record consists of its length, its bytes and its length again, all big-endian. A text record begins with a line
``ZZZZZEOR`` that contains the numbers of its integers (I), characters (C) and reals (R). Lines of fixed columns follow:
an integer has ten columns, with 16 integers per line, and a real has 16 columns, with five reals per line. Records of
the header are returned in binary form for both types of files. Only the layout of state records is returned, because
their numbers are read column by column.
"""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.histories.database import DIGITS
from d2rpick.histories.formats.blocks import parse_fortran_numbers

if TYPE_CHECKING:
    from d2rpick.histories.content import Bytes, Content
    from d2rpick.histories.history import Samples

INT: Final = struct.Struct(">i")
# Size of a binary number, and of the length that is written before and after each record [bytes].
WIDTH: Final = 4
# Size of the first record [bytes], which contains a code and a title of 80 bytes.
RUN: Final = 84

_MARK: Final = b"ZZZZZEOR"
_BEGIN: Final = re.compile(rb"([^\r\n]* FORMAT)(\r?\n)ZZZZZEOR    1I   72C\r?\n")
_SHAPE: Final = re.compile(
    rb"ZZZZZEOR(?: *(\d{1,5})I)?(?: *(\d{1,5})C)?(?: *(\d{1,5})([IR]))?"
)
_LONG, _SHORT = 10, 5  # Number of columns of an integer in the two text formats.
# Characters that Fortran prints in place of a number that is too long for its field.
_STARS: Final = b"*" * _SHORT
# Maximum length of a header record, excluding its integers [bytes].
_ROOM: Final = 1024
# Number of characters of the run title in text files (binary files have 80).
_RUN_TITLE: Final = 72
# Number of columns of a real number; the decimal point is in the fourth column.
_REAL: Final = 16
_DECIMALS: Final = 8
_PER_LINE: Final = 5
# Number of times at the end of a file from which the precision is determined.
_JUDGED: Final = 100


def is_binary(head: bytes) -> bool:
    """Return True if a file with these first bytes is a binary time history."""
    return (
        len(head) >= 8
        and INT.unpack_from(head)[0] == RUN
        and 3000 <= INT.unpack_from(head, 4)[0] < 6000
    )


def is_text(head: bytes) -> bool:
    """Return True if these first bytes belong to a time history in any text format."""
    return any(_MARK in line for line in head.split(b"\n", 4)[:4])


def open_records(data: Content, source: str) -> Records:
    """Return the records of a file; raise FormatError for other text formats, such as ``/TFILE/2``."""
    head = data[:_ROOM]
    begin = _BEGIN.match(head)
    if begin:
        return _TextRecords(data, begin[1], begin[2])
    if is_text(head):
        raise FormatError(
            f"{source}: a time history of Radioss as text, but not as /TFILE/3 writes it (coded as by /TFILE/2, or "
            "damaged); let the run write it as plain text (/TFILE/3) or in binary (/TFILE/4)"
        )
    return Records(data)


class Records:
    """The layout of the records in a binary file; ``at`` is the offset of the next header record [bytes]."""

    width = WIDTH  # Size of a number in a state [bytes].

    def __init__(self, data: Content, at: int = 0) -> None:
        self._data, self.at = data, at

    def take(self) -> bytes | None:
        """Return the next header record and advance; None if there is no complete record."""
        begin = self.at + WIDTH
        if begin > len(self._data):
            return None
        (length,) = INT.unpack(self._data[self.at : begin])
        end = begin + length
        if length < 0 or end + WIDTH > len(self._data):
            return None
        if INT.unpack(self._data[end : end + WIDTH])[0] != length:
            return None
        self.at = end + WIDTH
        return self._data[begin:end]

    def size(self, count: int) -> int:
        """Return the number of bytes of a record with ``count`` reals."""
        return (count + 2) * WIDTH

    def place(self, number: int) -> int:
        """Return the offset of a real in its record [bytes]; the reals are counted from 0."""
        return (number + 1) * WIDTH

    def marks(self, count: int) -> list[tuple[int, bytes]]:
        """Return the offset and the bytes of the length marks of every record that contains ``count`` reals."""
        length = INT.pack(count * WIDTH)
        return [(0, length), ((count + 1) * WIDTH, length)]

    def values(self, fields: Bytes) -> Samples:
        """Decode bytes (n, width) as reals (n,); bytes that are not a number give NaN."""
        # A NaN raises an error later, but only if the value is used.
        with np.errstate(invalid="ignore"):
            return fields.view(">f4").ravel().astype(np.float64)

    def digits(self, times: Samples) -> int:  # noqa: ARG002  the subclass uses the argument
        """Return the number of significant decimal digits of the reals."""
        return DIGITS[WIDTH]


class _TextRecords(Records):
    """The layout of the records in a text file of ``/TFILE/3``."""

    width = _REAL

    def __init__(self, data: Content, name: bytes, line_end: bytes) -> None:
        self._name, self._line_end = line_end + name, line_end
        super().__init__(data, len(self._name))

    def take(self) -> bytes | None:
        line, _, _ = self._data[self.at : self.at + _ROOM].partition(self._line_end)
        shape = _SHAPE.fullmatch(line)
        if shape is None:
            return None
        first, characters, last = (int(count or 0) for count in shape.group(1, 2, 3))
        begin = self.at + len(line) + len(self._line_end)
        # The body ends at the next mark, because a title may contain line breaks.
        room = self._data[begin : begin + _ROOM + (_LONG + 1) * first]
        body, mark, _ = room.partition(self._line_end + _MARK)
        if not mark and not body.endswith(self._line_end):
            return None
        body = body.removesuffix(b"" if mark else self._line_end)
        self.at = begin + len(body) + len(self._line_end)
        if shape[4] == b"R":  # The conversion factors of the units are not used.
            return bytes(WIDTH * last)
        return self._packed(body.removesuffix(self._name), first, characters, last)

    def _packed(
        self, body: bytes, first: int, characters: int, last: int
    ) -> bytes | None:
        """Return a record of a text file in binary form; None if its content contradicts its first line."""
        if not characters:
            body = body.replace(self._line_end, b"")
        is_run = characters == _RUN_TITLE
        width = _SHORT if is_run or len(body) == _SHORT else _LONG
        begin = first * width
        end = len(body) - last * _SHORT
        title = body[begin:end].ljust(RUN - WIDTH if is_run else characters)
        try:
            integers_before = _pack_integers(body[:begin], first, width)
            integers_after = _pack_integers(body[end:], last, _SHORT)
        except (ValueError, struct.error):
            return None
        return integers_before + title + integers_after

    def size(self, count: int) -> int:
        lines = -(-count // _PER_LINE)
        return len(self._mark(count)) + count * _REAL + lines * len(self._line_end)

    def place(self, number: int) -> int:
        return (
            len(self._mark(1))
            + number * _REAL
            + number // _PER_LINE * len(self._line_end)
        )

    def marks(self, count: int) -> list[tuple[int, bytes]]:
        return [(0, self._mark(count))]

    def _mark(self, count: int) -> bytes:
        """Return the first line of a record with ``count`` reals."""
        number = b"%5d" % count if count < 10**_SHORT else _STARS
        return _MARK + number + b"R" + self._line_end

    def values(self, fields: Bytes) -> Samples:
        values = parse_fortran_numbers(fields.view(f"S{_REAL}").ravel(), _DECIMALS)
        # A number with shifted or missing characters can often be parsed, so columns 3 and 4 are checked as well.
        values[(fields[:, 2] == ord(" ")) | (fields[:, 3] != ord("."))] = np.nan
        return values

    def digits(self, times: Samples) -> int:
        """Return the number of significant digits of times: that of single precision if it represents all of them."""
        last = times[-_JUDGED:]
        with np.errstate(over="ignore"):
            singles = last.astype(np.float32).tolist()
        alike = (
            f"{a:.{_DECIMALS}e}" == f"{b:.{_DECIMALS}e}"
            for a, b in zip(last.tolist(), singles, strict=True)
        )
        return DIGITS[WIDTH] if all(alike) else 1 + _DECIMALS


def split_integers(record: bytes) -> tuple[int, ...]:
    """Return the integers of a record in binary form."""
    return tuple(
        number for (number,) in INT.iter_unpack(record[: len(record) // WIDTH * WIDTH])
    )


def _pack_integers(text: bytes, count: int, width: int) -> bytes:
    """Pack ``count`` integers of ``width`` columns; asterisks in place of a material or property id become 1."""
    if len(text) != count * width:
        raise ValueError
    fields = (text[at : at + width] for at in range(0, len(text), width))
    return struct.pack(
        f">{count}i", *(1 if field == _STARS else int(field) for field in fields)
    )
