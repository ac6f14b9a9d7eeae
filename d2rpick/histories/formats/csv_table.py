"""Tables of numbers in text: CSV and its relatives, with or without names above the columns.

Taken as they come: columns parted by commas, semicolons, tabs or blanks; decimal commas (not between
commas); UTF-8, UTF-16 with its mark, latin-1; comment lines; quotes; names with units or a row of units below
them; LS-PrePost's title line, 3DEXPERIENCE's third name, and th_to_csv, whose names are trusted for two
columns only where they outnumber the values.  `layout` finds out about that; here the values are read.

A last line without line end may be cut, and a cut number is often a number.  It counts only when all its
values are there and the last of them is not used, or is certainly whole (`printed.is_whole`).
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.histories.formats import printed
from d2rpick.histories.formats.columns import internal_energy, labelled, named_column, own_times, time_column
from d2rpick.histories.formats.curves import Curves, find_curves
from d2rpick.histories.formats.layout import Layout, as_number, find_layout, is_skipped, split
from d2rpick.histories.names import listing

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.history import Part, Precision, Samples
    from d2rpick.histories.selection import Selection
    from d2rpick.histories.source import Source

_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_UTF8 = b"\xef\xbb\xbf"

# How many rows from the start, the end and between are looked at to judge the printed format.
_SAMPLE = 100


def recognises(head: bytes) -> bool:
    """Whether this is text: what it says is seen when it is read."""
    return head.startswith(_UTF16) or b"\0" not in head


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Table | Curves]:
    """Open tables; the selection tells their time column, and which values must be whole in a last line."""
    return [_opened(source, selection) for source in sources]


def _opened(source: Source, selection: Selection) -> Table | Curves:
    lines = _text(source).split("\n")
    unended = lines.pop()  # empty when the last line has its end
    return find_curves(source.name, lines, unended, selection) or Table(source.name, lines, unended, selection)


class Table:
    """One table; a `Database` without parts.

    FormatError when it is no table, or a column that was selected is not there.
    """

    format = "csv"
    version = title = ""
    parts: tuple[Part, ...] = ()

    def __init__(self, source: str, lines: list[str], unended: str, selection: Selection) -> None:
        self.source = source
        self._layout = layout = find_layout(source, lines, unended)
        self._time, notes = time_column(source, layout, selection.time, selection.energy)
        self._rows = lines[layout.start :]
        self._columns = labelled(layout, self._time)
        self.complete = True
        if not is_skipped(unended):
            self.complete = _is_whole(unended, self._rows, layout, self._needed(selection))
            if self.complete:
                self._rows.append(unended)
            else:
                notes.append("the last line has no line end and may be cut; it was left out")
        self.notes = tuple(notes)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of all columns but the time, as far as they are sure."""
        return tuple(self._columns)

    @property
    def time_unit(self) -> str:
        """Unit that the name of the time column, or the row below it, gives."""
        return self._layout.unit(self._time)

    @property
    def energy_channel(self) -> str:
        """The column named like an internal energy, or the only one beside the time; else FormatError."""
        column = internal_energy(self.source, self._layout, [self._time, *own_times(self._layout)])
        return next(label for label, own in self._columns.items() if own == column)

    def find(self, wanted: str) -> str:
        """Name of a column that is meant by its name or 1-based number; FormatError with what there is."""
        if wanted in self._columns and wanted not in self._layout.names:
            return wanted
        column = named_column(self.source, self._layout, wanted)
        if column == self._time:
            raise FormatError(f"{self.source}: {wanted!r} is the time column, not to be used twice; name an energy")
        return next(label for label, own in self._columns.items() if own == column)

    @property
    def time(self) -> Samples:
        """Times as they stand in the file, shape (n,) [time]."""
        return self._values(self._time)

    @property
    def part_time(self) -> Samples:
        """Refused: a table has no parts."""
        raise self._no_parts()

    def channel(self, name: str) -> Samples:
        """One column, shape (n,); FormatError with the line of a value that is no number."""
        if name not in self._columns:
            raise FormatError(f"{self.source}: no column {name!r}, only {listing(self.channels)}")
        column = self._columns[name]
        own = column - 1 if column - 1 in own_times(self._layout) else self._time
        if own == self._time:
            return self._values(column)
        curve = _checked_values(self.source, self._rows, self._layout, (own, column))
        if not np.array_equal(curve[:, 0], self.time):
            raise FormatError(f"{self.source}: {name!r} has other times than the first curve that is asked for")
        return np.ascontiguousarray(curve[:, 1])

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:  # noqa: ARG002  as a Database
        """Refused: a table has no parts."""
        raise self._no_parts()

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """How finely the times and these columns were printed."""
        fields = [row for row in _sample(self._rows, self._layout) if row[self._time]]  # not behind a curve's end
        times = [row[self._time] for row in fields]
        energies = [row[self._columns[name]] for row in fields for name in names]
        return printed.precisions(times, energies, self.time)

    def _needed(self, selection: Selection) -> list[int]:
        """Columns that must be whole in a last line without end: those asked for, or what is taken by default."""
        try:
            names = [self.find(wanted) for wanted in selection.energy] or [self.energy_channel]
        except FormatError:
            if selection.energy:
                raise
            return [self._time, *self._columns.values()]
        return [self._time, *(self._columns[name] for name in names)]

    def _values(self, column: int) -> Samples:
        if self._whole is not None and np.isfinite(self._whole[:, column]).all():
            return np.ascontiguousarray(self._whole[:, column])
        return self._checked[column] if column in self._checked else self._check(column)

    @cached_property
    def _whole(self) -> Samples | None:
        """All values of a table without a flaw in its form; None for any other."""
        return _fast_values(self._rows, self._layout)

    def _check(self, column: int) -> Samples:
        checked = _checked_values(self.source, self._rows, self._layout, (self._time, column))
        self._checked.update({self._time: checked[:, 0], column: checked[:, 1]})
        return self._checked[column]

    @cached_property
    def _checked(self) -> dict[int, Samples]:
        return {}

    def _no_parts(self) -> FormatError:
        return FormatError(f"{self.source}: a table has no parts; choose its columns with --energy")


def _text(source: Source) -> str:
    data = bytes(source.data)
    if data.startswith(_UTF16):
        text = data.decode("utf-16", errors="replace")
    elif b"\0" in data:
        raise FormatError(f"{source.name}: binary data, a table in text was expected; export the history as CSV")
    else:
        try:
            text = data.removeprefix(_UTF8).decode("utf-8")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _is_whole(line: str, rows: Sequence[str], layout: Layout, used: Sequence[int]) -> bool:
    """Whether a line without end has all values, and its last is unused or of a constant printed length."""
    cells = split(line, layout.separator)
    last = len(cells) - 1
    if len(cells) < layout.columns or last not in used:
        return len(cells) >= layout.columns
    above = [row[last] for row in _sample(rows, layout)]
    return printed.is_whole(cells[last].replace(layout.decimal, "."), above)


def _sample(rows: Sequence[str], layout: Layout) -> list[list[str]]:
    """Cells, with decimal points, of rows at the start, at the end and evenly between."""
    between = rows[_SAMPLE : -_SAMPLE : max(1, len(rows) // _SAMPLE)] if len(rows) > 2 * _SAMPLE else ()
    lines = [*rows[:_SAMPLE], *between, *rows[max(_SAMPLE, len(rows) - _SAMPLE) :]]
    cells = [split(line.replace(layout.decimal, "."), layout.separator) for line in lines if not is_skipped(line)]
    return [row for row in cells if len(row) >= layout.columns]


def _fast_values(rows: Sequence[str], layout: Layout) -> Samples | None:
    """All values of a table with a number in each cell and no other lines between; None for any other."""
    separator = layout.separator
    if layout.decimal == ",":
        if any("." in row for row in rows):
            return None
        rows = [row.replace(",", ".") for row in rows]
    if separator and rows and rows[0].endswith(separator):
        rows = [row.removesuffix(separator) for row in rows]
    if not rows:
        return None  # numpy warns of it
    try:
        table = np.loadtxt(rows, delimiter=separator, comments=None, ndmin=2)
    except ValueError:
        return None
    return table if table.shape == (len(rows), layout.columns) else None  # it passes over blank lines


def _checked_values(name: str, rows: Sequence[str], layout: Layout, used: Sequence[int]) -> Samples:
    """Values line by line, with comments and blank lines between, or the line that is wrong.

    Where all cells are empty the curve has ended: another one beside it goes on.
    """
    values: list[list[float]] = []
    gap = ended = False
    for number, row in enumerate(rows, layout.start + 1):
        if is_skipped(row):
            gap = True
            continue
        cells = split(row, layout.separator)
        if len(cells) == layout.columns + 1 and not cells[-1]:
            cells.pop()
        if len(cells) != layout.columns:
            raise FormatError(
                f"{name}:{number}: {len(cells)} values, {layout.columns} were expected as in the other rows; "
                "repair the line"
            )
        if not any(cells[column] for column in used) and values:
            ended = True
            continue
        state = [_value(f"{name}:{number}", layout, column, cells[column]) for column in used]
        if ended or (gap and values and state[0] <= values[-1][0]):
            found = "a curve goes on behind empty cells" if ended else "the time starts again behind a gap"
            raise FormatError(
                f"{name}:{number}: {found}, one curve was expected; repair it or put each curve into its own file"
            )
        gap = False
        values.append(state)
    return np.array(values).reshape(-1, len(used))


def _value(where: str, layout: Layout, column: int, cell: str) -> float:
    value = as_number(cell, layout.decimal)
    if value is None or not np.isfinite(value):
        raise FormatError(
            f"{where}: {layout.name(column)!r} is {cell!r}, a number was expected; repair or delete the line"
        )
    return value


def write(columns: Mapping[str, Samples]) -> bytes:
    r"""Columns (n,) side by side under their names, each number in the shortest digits that read back to it.

    Examples
    --------
    >>> write({"time": np.array([0.0, 0.1]), "part 1, IE": np.array([1e-20, 2.5])})
    b'time,"part 1, IE"\n0.0,1e-20\n0.1,2.5\n'
    """
    import csv
    import io

    head = io.StringIO()
    csv.writer(head, lineterminator="\n").writerow(columns)
    rows = zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True)
    return "\n".join([head.getvalue().removesuffix("\n"), *map(",".join, rows), ""]).encode()
