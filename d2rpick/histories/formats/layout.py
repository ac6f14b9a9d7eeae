"""How a table in a text is laid out: separator, decimal sign, first row, names and units."""

from __future__ import annotations

import re
from collections import Counter
from itertools import islice
from operator import itemgetter
from typing import TYPE_CHECKING

from d2rpick.base.errors import FormatError, listing
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.text import HEAD, Text
from d2rpick.histories.meaning import is_time
from d2rpick.histories.names import is_unit, unit_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


_COMMENTS = ("#", "$", "%", "//")

# Separator (None: blanks) and decimal sign, in the order they are tried.  Comma and decimal comma together
# cannot be read for sure.
_FORMS = (
    *((sign, decimal) for sign in (";", "\t", "|") for decimal in ".,"),
    *((",", "."), (None, "."), (None, ",")),
)

# What was taken is not given back: the time grows with the length of a cell, not with its square.
_NUMBER = {
    "." : re.compile(r"[+-]?(?:\d++\.?+\d*+|\.\d++)(?:[eEdD][+-]?\d++)?", re.ASCII),
    ",": re.compile(r"[+-]?(?:\d++,?+\d*+|,\d++)(?:[eEdD][+-]?\d++)?", re.ASCII),
}  # fmt: skip
_MISSING = frozenset({"", "nan", "+nan", "-nan", "inf", "+inf", "-inf", "infinity", "-infinity", "na", "n/a", "null"})
# What a spreadsheet writes above a table, and anybody may, for a separator that belongs to no number.
_SEP_LINE = re.compile(r'(?i:sep=)(?![\w.+"-])([!-~])')
_DECIMAL_PART = re.compile(r"[+-]?0\d+")

# Rows looked at to find the layout: more than any header has lines.
_LOOK_AT = 60
_SHORT = 60


class Layout(NamedTuple):
    """Form of a table whose rows begin at line index ``start`` and have ``columns`` values each.

    ``names`` and ``units`` are empty where the file has none.  Where there are more names than columns, only
    the first two may be used.  ``title`` is what the file calls the curve, apart from its column's name.
    """

    separator: str | None
    decimal: str
    start: int
    columns: int
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    title: str = ""

    @property
    def trusted(self) -> int:
        """How many columns, from the first, may be used."""
        return self.columns if len(self.names) <= self.columns else 2

    def name(self, column: int) -> str:
        """Name of a column in the file, or its number."""
        name = self.names[column] if column < len(self.names) else ""
        return name or f"column {column + 1}"

    def channel(self, column: int) -> str:
        """Name of a column and, where it has one, of its curve."""
        return f"{self.name(column)}: {self.title}" if self.title else self.name(column)

    def unit(self, column: int) -> str:
        """Return the unit of a column as the file names it, or nothing."""
        if self.units:
            return self.units[column].strip("()[]")
        return unit_of(self.names[column]) if self.names else ""


def split(line: str, separator: str | None) -> list[str]:
    """Cells of a line, without blanks and quotes around them; a separator inside quotes does not count.

    Examples
    --------
    >>> split('"part 3, left", 1.5 ,', ",")
    ['part 3, left', '1.5', '']
    """
    if '"' not in line:
        return line.split() if separator is None else [cell.strip() for cell in line.split(separator)]
    sign = separator or " "
    cells: list[str] = []
    inside = False
    for piece in (line if separator else " ".join(line.split())).split(sign):
        if inside:
            cells[-1] += sign + piece
        else:
            cells.append(piece)
        inside ^= piece.count('"') % 2 == 1
    return [cell.strip().removeprefix('"').removesuffix('"').strip() for cell in cells]


def unique(names: Sequence[str], what: str) -> list[str]:
    """Let names that several of ``what`` have be told apart by number.

    Examples
    --------
    >>> unique(["time", "IE", "IE"], "column")
    ['time', 'IE (column 2)', 'IE (column 3)']
    """
    bearers = Counter(names)
    return [name if bearers[name] == 1 else f"{name} ({what} {number})" for number, name in enumerate(names, 1)]


def is_skipped(line: str) -> bool:
    """Whether a line is blank or a comment."""
    line = line.lstrip()
    return not line or line.startswith(_COMMENTS)


def as_number(cell: str, decimal: str) -> float | None:
    """Return the number in a cell, or None; words and underscores are none, though Python takes them."""
    if not _NUMBER[decimal].fullmatch(cell):
        return None
    return float(cell.replace(",", ".").replace("D", "E").replace("d", "e"))


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
    bare = _find_rows(lines, first, separator) or _find_rows(every, first, separator)
    if bare is None:
        number, line = next(((n, line) for n, line in enumerate(every, 1) if not is_skipped(line)), (1, ""))
        below = "below" if text.is_short else f"in the first {HEAD} lines"
        found = f"{text.name}:{number}: {_short(line)} and no rows of at least two numbers {below}"
        cure = "check that this is the right file, or name its separator in a first line, as sep=:"
        raise FormatError(f"{found}; expected a table of time and energy; {cure}")
    _refuse_odd_rows(text.name, lines, first, bare)
    _refuse_decimal_commas(text.name, lines, bare)
    return _with_header(text.name, lines[first : bare.start], bare)


def _find_rows(lines: Sequence[str], first: int, separator: str) -> Layout | None:
    """Take the form in which most lines are rows, with words or without, else any with rows of numbers."""
    numbered = ((i, line) for i, line in enumerate(lines) if i >= first and not is_skipped(line))
    sample = list(islice(numbered, _LOOK_AT))
    forms = [(separator, decimal) for decimal in ".," if separator != decimal] if separator else _FORMS
    for only_numbers in (False, True):
        best, most = None, 0 if only_numbers else len(sample) // 2
        for sign, decimal in forms:
            if sign and not any(sign in line for _, line in sample):
                continue
            cells = [(i, split(line, sign)) for i, line in sample]
            kinds = [(i, row, kind) for i, row in cells if (kind := _kind(row, decimal, only_numbers))]
            if not kinds:
                continue
            common, times = max(Counter(kind for _, _, kind in kinds).items(), key=itemgetter(1))
            alike = [(i, row) for i, row, kind in kinds if _is_like(kind, common)]
            closed = not any(row[-1] for _, row in alike)  # every row ends with a separator
            if len(common) - closed > 1 and times > most:
                best, most = Layout(sign, decimal, alike[0][0], len(common) - closed), times
        if best:
            return best
    return None


def _kind(cells: list[str], decimal: str, only_numbers: bool) -> tuple[bool, ...]:
    """Which cells of a row are numbers or empty; nothing for what is no row."""
    if len(cells) < 2:  # as with most separators
        return ()
    numbers = tuple(cell.casefold() in _MISSING or as_number(cell, decimal) is not None for cell in cells)
    words = [cell for cell, number in zip(cells, numbers, strict=True) if not number]
    # "| a title |" is no row.
    written = any(cell and number for cell, number in zip(cells, numbers, strict=True))
    # A word begins with a letter: "5 load 1" is a piece of "0,5 load 1,5", cut at the wrong places.
    is_row = written and sum(numbers) > 1 and all(word[0].isalpha() and not only_numbers for word in words)
    return numbers if is_row else ()


def _is_like(kind: tuple[bool, ...], common: tuple[bool, ...]) -> bool:
    return len(kind) == len(common) and all(here or not there for here, there in zip(kind, common, strict=True))


def _refuse_odd_rows(source: str, lines: Sequence[str], first: int, table: Layout) -> None:
    """Refuse a line above the rows that begins with a number: a row unlike the others, not a header."""
    for number, line in enumerate(lines[first : table.start], first + 1):
        cells = [] if is_skipped(line) else split(line, table.separator)
        if cells and as_number(cells[0], table.decimal) is not None:
            found = f"{source}:{number}: {_short(line)} differs from the rows below"
            raise FormatError(f"{found}, {table.columns} values were expected; repair or delete the line")


def _refuse_decimal_commas(source: str, lines: Sequence[str], table: Layout) -> None:
    """Refuse ``0,05,1,25``: integers throughout, some with leading zeros, are halves of numbers."""
    if table.separator != ",":
        return
    for number, line in enumerate(lines[table.start : table.start + _LOOK_AT], table.start + 1):
        cells = split(line, ",")
        if any(map(_DECIMAL_PART.fullmatch, cells)) and not any("." in cell for cell in cells):
            found = f"{source}:{number}: {_short(line)} looks like decimal commas between commas"
            raise FormatError(f"{found}, which cannot be told apart; write the file with semicolons or decimal points")


def _with_header(source: str, lines: Sequence[str], table: Layout) -> Layout:
    """Add names, units and title from the lines above the rows."""
    rows = list(_header_rows(lines, table))
    units: tuple[str, ...] = ()
    if len(rows) > 1 and len(rows[-1]) == table.columns and all(map(is_unit, rows[-1])):
        units = tuple(rows.pop())
    if not rows:
        return table._replace(names=_commented_names(lines, table), units=units)
    names, title = rows[-1], ""
    if len(names) > 1 and not names[-1]:
        names = names[:-1]
        if len(rows) > 1:  # LS-PrePost: a line of titles, then "Time," or "Time,A8874,"
            title = next((cell for cell in reversed(rows[-2]) if cell), "")
    if table.columns == 2 and len(names) == 1 and is_time(names[0]):
        names, title = [names[0], title], ""
    if len(names) == 1:
        return table._replace(units=units, title=names[0])
    if len(names) < table.columns or (len(names) > table.columns and not is_time(names[0])):
        raise FormatError(
            f"{source}:{table.start + 1}: {table.columns} values below a header of {len(names)} names "
            f"({listing(names)}), expected as many of both; correct the header or delete it"
        )
    if table.columns == 2 < len(names):
        title = " ".join(filter(None, names[2:]))  # 3DEXPERIENCE: the third name is the curve's
    return table._replace(names=tuple(names), units=units, title=title)


def _header_rows(lines: Sequence[str], table: Layout) -> Iterator[list[str]]:
    """Cells of the header lines; a quoted name may go on over a line end."""
    pending = ""
    for line in lines:
        if not pending and is_skipped(line):
            continue
        pending = f"{pending} {line}" if pending else line
        if pending.count('"') % 2 == 0:
            yield _header_cells(pending, table)
            pending = ""
    if pending:
        yield _header_cells(pending, table)


def _header_cells(line: str, table: Layout) -> list[str]:
    """Cells of a header line; between blanks names may hold blanks, and what does not fit is one title."""
    if table.separator is not None:
        return split(line, table.separator)
    wide = [cell.strip('"') for cell in re.split(r"\s{2,}|\t", line.strip())]
    narrow = split(line, None)
    return next((cells for cells in (wide, narrow) if len(cells) == table.columns), [line.strip()])


def _commented_names(lines: Sequence[str], table: Layout) -> tuple[str, ...]:
    """Names in the last comment line, as numpy.savetxt writes them: one per column, among them a time."""
    comments = [line.strip().lstrip("#$%/ ") for line in lines if line.strip()]
    cells = _header_cells(comments[-1], table) if comments else []
    return tuple(cells) if len(cells) == table.columns and any(map(is_time, cells)) else ()


def _short(line: str) -> str:
    """Quote a line in a message, cut to what is readable."""
    line = line.strip()
    return repr(line if len(line) <= _SHORT else line[:_SHORT] + "...")
