"""How a table in a text is laid out: separator, decimal sign, first row, names and units."""

from __future__ import annotations

import re
from collections import Counter
from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.cells import (
    as_number,
    find_thousands,
    is_missing,
    is_number,
    is_skipped,
    is_word,
    split,
)
from d2rpick.histories.formats.header import Header, read_header, shorten
from d2rpick.histories.formats.text import HEAD, Text
from d2rpick.histories.names import unit_of

if TYPE_CHECKING:
    from collections.abc import Sequence


# Separator (None: blanks) and decimal sign, in the order they are tried.  Comma and decimal comma together can be read
# only if the numbers are in quotes.
_FORMS = (
    *((sign, decimal) for sign in (";", "\t", "|") for decimal in ".,"),
    *((",", "."), (",", ","), (None, "."), (None, ",")),
)

# What a spreadsheet writes above a table, and anybody may, for a separator that belongs to no number.
_SEP_LINE = re.compile(r'(?i:sep=)(?![\w.+"-])([!-~])')
_DECIMAL_PART = re.compile(r"[+-]?0\d+")

# Lines in which the rows are searched, first among few: more than most headers have, then more than any has.
_LOOK_AT = 60
_LINES_SEARCHED = (_LOOK_AT, 600, HEAD)


class Layout(NamedTuple):
    """Form of a table whose rows begin at line index ``start`` and have ``columns`` values each.

    ``names`` and ``units`` are empty where the file has none.  Where there are more or fewer names than columns, only
    the first ``sure`` columns may be used.  ``title`` is what the file calls the curve, apart from its column's name.
    ``thousands`` is the sign between groups of three digits, if there is one.
    """

    separator: str | None
    decimal: str
    start: int
    columns: int
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    title: str = ""
    thousands: str = ""
    sure: int | None = None

    @property
    def trusted(self) -> int:
        """How many columns, from the first, may be used."""
        return self.columns if self.sure is None else self.sure

    def number(self, cell: str) -> float | None:
        """Return the number in a cell, or None."""
        return as_number(cell, self.decimal, self.thousands)

    def plain(self, cell: str) -> str:
        """Return a number as it is printed, with a decimal point and without thousands."""
        plain = cell.replace(self.thousands, "") if self.thousands else cell
        return plain.replace(self.decimal, ".")

    def name(self, column: int) -> str:
        """Name of a column in the file, or its number."""
        name = self.names[column] if column < min(len(self.names), self.trusted) else ""
        return name or f"column {column + 1}"

    def channel(self, column: int) -> str:
        """Name of a column and, where it has one, of its curve."""
        return f"{self.name(column)}: {self.title}" if self.title else self.name(column)

    def unit(self, column: int) -> str:
        """Return the unit of a column as the file names it, or nothing."""
        if self.units:
            return self.units[column].strip("()[]")
        return unit_of(self.names[column]) if self.names else ""


def unique(names: Sequence[str], what: str) -> list[str]:
    """Let names that several of ``what`` have be told apart by number.

    Examples
    --------
    >>> unique(["time", "IE", "IE"], "column")
    ['time', 'IE (column 2)', 'IE (column 3)']
    """
    bearers = Counter(names)
    return [
        name if bearers[name] == 1 else f"{name} ({what} {number})"
        for number, name in enumerate(names, 1)
    ]


def find_layout(text: Text) -> Layout:
    """Find the layout of a table by its first lines; a last line without end counts if there is no other row.

    Raises
    ------
    FormatError
        If the lines are no table, or one whose columns cannot be told for sure.
    """
    lines, every = text.head, [*text.head, *([text.unended] if text.is_short else [])]
    told = _SEP_LINE.fullmatch(lines[0].strip()) if lines else None
    first, separator = (1, told[1]) if told else (0, "")
    table = _search_rows(lines, first, separator) or _search_rows(
        every, first, separator
    )
    if table is None:
        raise _no_table(text, every)
    _refuse_odd_rows(text.name, lines, first, table)
    _refuse_decimal_commas(text.name, lines, table)
    header = read_header(
        f"{text.name}:{table.start + 1}",
        lines[first : table.start],
        table.separator,
        table.columns,
    )
    return _with_header(table, header)


def _with_header(table: Layout, header: Header) -> Layout:
    return table._replace(
        names=header.names, units=header.units, title=header.title, sure=header.sure
    )


def with_thousands(table: Layout, rows: Sequence[Sequence[str]]) -> Layout:
    """Add the sign between groups of three digits that cells of ``rows`` show, if they are no numbers without one."""
    odd = [
        cell
        for row in rows
        for cell in row
        if not is_number(cell, table.decimal, table.thousands) and not is_missing(cell)
    ]
    return (
        table._replace(thousands=find_thousands(odd, table.decimal)) if odd else table
    )


def _no_table(text: Text, lines: Sequence[str]) -> FormatError:
    """Say that a text is no table, by the first line that might be a row or else by the first of all."""
    numbered = [
        (number, line) for number, line in enumerate(lines, 1) if not is_skipped(line)
    ]
    rows = [(number, line) for number, line in numbered if line.lstrip()[0].isdigit()]
    number, line = next(iter(rows or numbered), (1, ""))
    below = "below" if text.is_short else f"in the first {HEAD} lines"
    found = f"{text.name}:{number}: {shorten(line)} and no rows of at least two numbers {below}"
    cure = "check that this is the right file, or name its separator in a first line, as sep=:"
    return FormatError(f"{found}; expected a table of time and energy; {cure}")


def _search_rows(lines: Sequence[str], first: int, separator: str) -> Layout | None:
    """Find the rows among few lines, then among more, with and without thousands in their numbers."""
    telling = (
        (number, line)
        for number, line in enumerate(lines)
        if number >= first and not is_skipped(line)
    )
    numbered: list[tuple[int, str]] = []
    for count in _LINES_SEARCHED:
        numbered += islice(telling, count - len(numbered))
        for with_groups in (False, True):
            table = _find_rows(numbered, separator, with_groups=with_groups)
            if table:
                return table
        if len(numbered) < count:
            break
    return None


def _find_rows(
    sample: Sequence[tuple[int, str]], separator: str, *, with_groups: bool
) -> Layout | None:
    """Take the form in which most lines are rows, with words or without, else any with rows of numbers."""
    forms = (
        [(separator, decimal) for decimal in ".," if separator != decimal]
        if separator
        else _FORMS
    )
    for only_numbers in (False, True):
        best, most = None, 0 if only_numbers else len(sample) // 2
        for sign, decimal in forms:
            if sign and not any(sign in line for _, line in sample):
                continue
            cells = [(i, split(line, sign)) for i, line in sample]
            thousands = (
                find_thousands([cell for _, row in cells for cell in row], decimal)
                if with_groups
                else ""
            )
            if with_groups and not thousands:
                continue
            form = Layout(sign, decimal, 0, 0, thousands=thousands)
            kinds = [
                (i, row, kind)
                for i, row in cells
                if (kind := _kind(row, form, only_numbers))
            ]
            if not kinds:
                continue
            common, times = max(
                Counter(kind for _, _, kind in kinds).items(), key=itemgetter(1)
            )
            alike = [(i, row) for i, row, kind in kinds if _is_like(kind, common)]
            closed = not any(
                row[-1] for _, row in alike
            )  # every row ends with a separator
            if len(common) - closed > 1 and times > most:
                best, most = (
                    form._replace(start=alike[0][0], columns=len(common) - closed),
                    times,
                )
        if best:
            return best
    return None


def _kind(cells: list[str], form: Layout, only_numbers: bool) -> tuple[bool, ...]:
    """Which cells of a row are numbers or missing; nothing for what is no row."""
    if len(cells) < 2:  # as with most separators
        return ()
    written = [form.number(cell) is not None for cell in cells]
    numbers = tuple(
        number or is_missing(cell) for cell, number in zip(cells, written, strict=True)
    )
    words = [cell for cell, number in zip(cells, numbers, strict=True) if not number]
    # "| a title |" is no row.
    is_row = (
        any(written)
        and sum(numbers) > 1
        and all(is_word(word) and not only_numbers for word in words)
    )
    return numbers if is_row else ()


def _is_like(kind: tuple[bool, ...], common: tuple[bool, ...]) -> bool:
    return len(kind) == len(common) and all(
        here or not there for here, there in zip(kind, common, strict=True)
    )


def _refuse_odd_rows(
    source: str, lines: Sequence[str], first: int, table: Layout
) -> None:
    """Refuse a line above the rows that begins with a number: a row unlike the others, not a header."""
    for number, line in enumerate(lines[first : table.start], first + 1):
        cells = [] if is_skipped(line) else split(line, table.separator)
        if cells and table.number(cells[0]) is not None:
            found = f"{source}:{number}: {shorten(line)} differs from the rows below"
            raise FormatError(
                f"{found}, {table.columns} values were expected; repair or delete the line"
            )


def _refuse_decimal_commas(source: str, lines: Sequence[str], table: Layout) -> None:
    """Refuse ``0,05,1,25``: integers throughout, some with leading zeros, are halves of numbers."""
    if table.separator != ",":
        return
    for number, line in enumerate(
        lines[table.start : table.start + _LOOK_AT], table.start + 1
    ):
        cells = split(line, ",")
        if any(map(_DECIMAL_PART.fullmatch, cells)) and not any(
            "." in cell or "," in cell for cell in cells
        ):
            found = f"{source}:{number}: {shorten(line)} looks like decimal commas between commas"
            raise FormatError(
                f"{found}, which cannot be told apart; write the file with semicolons or decimal points"
            )
