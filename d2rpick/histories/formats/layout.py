"""Find the layout of a table in a text file: separator, decimal sign, first row, names and units."""

from __future__ import annotations

import re
from collections import Counter
from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.cells import (
    find_thousands,
    has_number,
    is_missing,
    is_skipped,
    is_word,
    parse_cell,
    split_cells,
    split_columns_of_numbers,
)
from d2rpick.histories.formats.header import Header, quote_start, read_header
from d2rpick.histories.formats.text import HEAD, Text
from d2rpick.histories.names import find_unit

if TYPE_CHECKING:
    from collections.abc import Sequence


# Text at the start of the LS-DYNA listings d3hsp and messag.
_LISTING_OF_LS_DYNA: Final = "Livermore Software"
# Several words between separators, as in a line of headings.
_SEPARATED_WORDS: Final = r"[^\W\d][^,;\t]*([,;\t][^,;\t]+)+"
# Pairs of a separator (None: spaces) and a decimal sign, in the order in which they are tried.
# If the separator and the decimal sign are both commas, a row is readable only if its numbers are quoted.
_FORMS = (
    *((sign, decimal) for sign in (";", "\t", "|") for decimal in ".,"),
    *((",", "."), (",", ","), (None, "."), (None, ",")),
)

# Pattern of the line ``sep=;`` that spreadsheets write above a table; a separator cannot be part of a number.
_SEP_LINE = re.compile(r'(?i:sep=)(?![\w.+"-])([!-~])')
_DIGIT = re.compile(r"\d", re.ASCII)
_DECIMAL_PART = re.compile(r"[+-]?0\d+")

# Number of lines that the first attempt searches for the first row.
_LOOK_AT = 60
_LINES_SEARCHED = (_LOOK_AT, 600, HEAD)


class Layout(NamedTuple):
    """The layout of a table whose rows begin at line index ``start`` and have ``columns`` values each.

    ``names`` and ``units`` are empty if the file contains none. If the numbers of names and columns differ, only the
    first ``sure`` columns may be used. ``title`` is the name of the curve in the file, apart from the name of its
    column. ``thousands`` is the thousands separator, if there is one.
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
        """Number of columns that may be used, counted from the first column."""
        return self.columns if self.sure is None else self.sure

    def number(self, cell: str) -> float | None:
        """Return the number in a cell; None if the cell does not contain a number."""
        return parse_cell(cell, self.decimal, self.thousands)

    def plain(self, cell: str) -> str:
        """Return the text of a number with a decimal point and without thousands separators."""
        plain = cell.replace(self.thousands, "") if self.thousands else cell
        return plain.replace(self.decimal, ".")

    def name(self, column: int) -> str:
        """Return the name of a column as given in the file; without a name, return the column number."""
        name = self.names[column] if column < min(len(self.names), self.trusted) else ""
        return name or f"column {column + 1}"

    def channel(self, column: int) -> str:
        """Return the name of a column, preceded by the title of its curve if there is one."""
        return f"{self.name(column)}: {self.title}" if self.title else self.name(column)

    def unit(self, column: int) -> str:
        """Return the unit of a column in the file; empty if the file gives none."""
        if self.units:
            return self.units[column].strip("()[]")
        return find_unit(self.names[column]) if self.names else ""


def number_duplicates(names: Sequence[str], kind: str) -> list[str]:
    """Add the column number to names that occur more than once, as in "IE (column 2)".

    Examples
    --------
    >>> number_duplicates(["time", "IE", "IE"], "column")
    ['time', 'IE (column 2)', 'IE (column 3)']
    """
    bearers = Counter(names)
    return [
        name if bearers[name] == 1 else f"{name} ({kind} {number})"
        for number, name in enumerate(names, 1)
    ]


def find_layout(text: Text) -> Layout:
    """Find the layout of a table from its first lines. An unterminated last line is used only if no other row exists.

    Raises
    ------
    FormatError
        If the lines are not a table, or if the columns of the table are ambiguous.
    """
    lines = text.head
    lines_with_last = [*lines, text.unended] if text.is_short else [*lines]
    sep_line = _SEP_LINE.fullmatch(lines[0].strip()) if lines else None
    first, separator = (1, sep_line[1]) if sep_line else (0, "")
    table = _search_rows(lines, first, separator)
    if not table:
        table = _search_rows(lines_with_last, first, separator)
    if table is None:
        raise _report_no_table(text, lines_with_last)
    _refuse_odd_rows(text.name, lines, first, table)
    _refuse_decimal_commas(text.name, lines, table)
    header = read_header(
        f"{text.name}:{table.start + 1}",
        lines[first : table.start],
        table.separator,
        table.columns,
    )
    return _add_header(table, header)


def _add_header(table: Layout, header: Header) -> Layout:
    """Add the names, units and title in a header to a layout."""
    return table._replace(
        names=header.names, units=header.units, title=header.title, sure=header.sure
    )


def add_thousands(table: Layout, columns: Sequence[Sequence[str]]) -> Layout:
    """Add to the layout the thousands separator that is needed to read some cells of the columns as numbers."""
    odd = [
        cell
        for cells in columns
        for cell in cells
        if not has_number(cell, table.decimal, table.thousands) and not is_missing(cell)
    ]
    if odd:
        return table._replace(thousands=find_thousands(odd, table.decimal))
    return table


def _report_no_table(text: Text, lines: Sequence[str]) -> FormatError:
    """Return the error for a text without a table; it quotes the first likely row or the first line."""
    numbered = [
        (number, line) for number, line in enumerate(lines, 1) if not is_skipped(line)
    ]
    rows = [(number, line) for number, line in numbered if line.lstrip()[0].isdigit()]
    number, line = next(iter(rows or numbered), (1, ""))
    below = "below" if text.is_short else f"in the first {HEAD} lines"
    found = f"{text.name}:{number}: {quote_start(line)} was found"
    problem = f"{found}, and no rows of at least two numbers {below}"
    cure = "check that this is the right file, or name its separator in a first line, as sep=:"
    if rows and has_number(line.strip(), ".", ""):
        problem = (
            f"{text.name}:{number}: only one column, {quote_start(line)}, was found"
        )
        heading = next((line for earlier, line in numbered if earlier < number), "")
        if heading:
            problem = f"{text.name}: only one column, {quote_start(heading)}, was found"
        cure = "add a column with the times"
    elif len(numbered) == 1 and re.match(_SEPARATED_WORDS, line.strip()):
        cure = "write rows of numbers below the headings, or give another file"
    elif _LISTING_OF_LS_DYNA in line:
        problem = f"{text.name}:{number}: this is a listing of LS-DYNA"
        cure = "give the glstat, matsum or binout of the run"
    return FormatError(f"{problem}; a table of time and energy was expected; {cure}")


def _search_rows(lines: Sequence[str], first: int, separator: str) -> Layout | None:
    """Search for the rows in a few lines, then in more lines; the second pass also tries thousands separators."""
    candidates = (
        (number, line)
        for number, line in enumerate(lines)
        if number >= first and not is_skipped(line)
    )
    numbered: list[tuple[int, str]] = []
    for count in _LINES_SEARCHED:
        numbered += islice(candidates, count - len(numbered))
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
    """Return the layout in which most lines are rows, which may contain words; otherwise a layout with only numbers."""
    forms: Sequence[tuple[str | None, str]]
    if separator:
        forms = [(separator, decimal) for decimal in ".," if separator != decimal]
    else:
        forms = _FORMS
    half = len(sample) // 2
    # A row has a number, so a line without a digit is not a row.
    sample = [(i, line) for i, line in sample if _DIGIT.search(line)]
    for only_numbers in (False, True):
        best = None
        best_count = 0 if only_numbers else half
        for sign, decimal in forms:
            if best_count == len(sample):
                break  # No form has more rows.
            if sign and not any(sign in line for _, line in sample):
                continue
            cells = [(i, split_cells(line, sign)) for i, line in sample]
            if sum(len(row) > 1 for _, row in cells) <= best_count:
                continue  # Fewer rows than with an earlier form.
            if with_groups:
                thousands = find_thousands(
                    [cell for _, row in cells for cell in row], decimal
                )
            else:
                thousands = ""
            if with_groups and not thousands:
                continue
            form = Layout(sign, decimal, 0, 0, thousands=thousands)
            kinds = _find_numbers(sample, cells, form, only_numbers)
            counts = Counter(kind for kind in kinds if kind)
            if not counts:
                continue
            common, count = max(counts.items(), key=itemgetter(1))
            rows = zip(cells, kinds, strict=True)
            alike = [row for row, kind in rows if _is_like(kind, common)]
            # If the last cell of every row is empty, every row ends with a separator.
            is_closed = not any(row[-1] for _, row in alike)
            columns = len(common) - is_closed
            if columns > 1 and count > best_count:
                best = form._replace(start=alike[0][0], columns=columns)
                best_count = count
        if best:
            return best
    return None


def _find_numbers(
    sample: Sequence[tuple[int, str]],
    cells: Sequence[tuple[int, list[str]]],
    form: Layout,
    only_numbers: bool,
) -> Sequence[tuple[bool, ...]]:
    """Return the result of `_find_numbers_in_row` for each line; lines of plain numbers are recognised all at once."""
    columns = len(cells[0][1])
    lines = [line for _, line in sample]
    if split_columns_of_numbers(lines, form.separator, form.decimal, columns):
        return [(True,) * columns] * len(cells)
    return [_find_numbers_in_row(row, form, only_numbers) for _, row in cells]


def _find_numbers_in_row(
    cells: list[str], form: Layout, only_numbers: bool
) -> tuple[bool, ...]:
    """Return for each cell of a row whether it is a number or marks a missing value; empty if there is no row."""
    # Most lines have only one cell here, because most of the separators that are tried are wrong.
    if len(cells) < 2:
        return ()
    written = [has_number(cell, form.decimal, form.thousands) for cell in cells]
    numbers = tuple(
        number or is_missing(cell) for cell, number in zip(cells, written, strict=True)
    )
    words = [cell for cell, number in zip(cells, numbers, strict=True) if not number]
    # A line such as "| a title |" is not a row.
    is_row = (
        any(written)
        and sum(numbers) > 1
        and all(is_word(word) and not only_numbers for word in words)
    )
    return numbers if is_row else ()


def _is_like(kind: tuple[bool, ...], common: tuple[bool, ...]) -> bool:
    """Return True if a row has the usual number of cells, with numbers wherever most rows have numbers."""
    return len(kind) == len(common) and all(
        is_number or not is_commonly_number
        for is_number, is_commonly_number in zip(kind, common, strict=True)
    )


def _refuse_odd_rows(
    source: str, lines: Sequence[str], first: int, table: Layout
) -> None:
    """Raise FormatError if a line above the rows begins with a number, which a header line never does."""
    for number, line in enumerate(lines[first : table.start], first + 1):
        cells = [] if is_skipped(line) else split_cells(line, table.separator)
        if cells and table.number(cells[0]) is not None:
            problem = (
                f"{source}:{number}: {quote_start(line)} differs from the rows below"
            )
            raise FormatError(
                f"{problem}, but {table.columns} values were expected; repair or delete the line"
            )


def _refuse_decimal_commas(source: str, lines: Sequence[str], table: Layout) -> None:
    """Raise FormatError for rows such as ``0,05,1,25``, in which integers with leading zeros are decimal places."""
    if table.separator != ",":
        return
    for number, line in enumerate(
        lines[table.start : table.start + _LOOK_AT], table.start + 1
    ):
        cells = split_cells(line, ",")
        if any(map(_DECIMAL_PART.fullmatch, cells)) and not any(
            "." in cell or "," in cell for cell in cells
        ):
            problem = f"{source}:{number}: {quote_start(line)} looks like decimal commas between commas"
            raise FormatError(
                f"{problem}, which cannot be told apart; write the file with semicolons or decimal points"
            )
