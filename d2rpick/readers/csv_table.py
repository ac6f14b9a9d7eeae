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
from d2rpick.readers import printed
from d2rpick.readers.layout import Layout, as_number, find_layout, is_skipped, split
from d2rpick.readers.names import (
    is_internal_energy,
    is_some_internal_energy,
    is_time,
    listing,
    near_miss,
    normalised,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.history import Part, Precision, Samples
    from d2rpick.readers.selection import Selection
    from d2rpick.readers.source import Source

_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_UTF8 = b"\xef\xbb\xbf"

# How many rows from the start, the end and between are looked at to judge the printed format.
_SAMPLE = 100


def recognises(head: bytes) -> bool:
    """Whether this is text: what it says is seen when it is read."""
    return head.startswith(_UTF16) or b"\0" not in head


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Table]:
    """Open tables; the selection tells their time column, and which values must be whole in a last line."""
    return [Table(source, selection) for source in sources]


class Table:
    """One table; a `Database` without parts.

    FormatError when it is no table, or a column that was selected is not there.
    """

    format = "csv"
    version = title = ""
    parts: tuple[Part, ...] = ()

    def __init__(self, source: Source, selection: Selection) -> None:
        self.source = source.name
        lines = _text(source).split("\n")
        unended = lines.pop()  # empty when the last line has its end
        self._layout = layout = find_layout(source.name, lines, unended)
        self._time, notes = _time_column(source.name, layout, selection.time)
        self._rows = lines[layout.start :]
        self._columns = _labelled(layout, self._time)
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
        column = _internal_energy(self.source, self._layout, self._time)
        return next(label for label, own in self._columns.items() if own == column)

    def find(self, wanted: str) -> str:
        """Name of a column that is meant by its name or 1-based number; FormatError with what there is."""
        if wanted in self._columns and wanted not in self._layout.names:
            return wanted
        column = _named_column(self.source, self._layout, wanted)
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
        return self._values(self._columns[name])

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:  # noqa: ARG002  as a Database
        """Refused: a table has no parts."""
        raise self._no_parts()

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """How finely the times and these columns were printed."""
        fields = _sample(self._rows, self._layout)
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


def _labelled(layout: Layout, time: int) -> dict[str, int]:
    """Columns beside the time by the name they are called by, with their number where a name is not theirs alone."""
    names = [layout.channel(column) for column in range(layout.trusted)]
    return {
        name if names.count(name) == 1 else f"{name} (column {column + 1})": column
        for column, name in enumerate(names)
        if column != time
    }


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


def _time_column(name: str, layout: Layout, wanted: str | None) -> tuple[int, list[str]]:
    """Column of the time, and what had to be assumed."""
    if wanted is not None:
        return _named_column(name, layout, wanted), []
    times = [i for i, column in enumerate(layout.names[: layout.trusted]) if is_time(column)]
    if len(times) > 1:
        raise FormatError(
            f"{name}: {len(times)} columns are named like a time; choose with --time: {_menu(layout, times)}"
        )
    if layout.names and not times:
        return 0, [f"no column is named like a time; {layout.name(0)!r}, the first, was taken for it"]
    return (times[0] if times else 0), []


def _internal_energy(name: str, layout: Layout, time: int) -> int:
    """Pick the only column beside the time, or else the one named like an internal energy."""
    beside = [column for column in range(layout.columns) if column != time]
    if len(beside) == 1:
        return beside[0]
    sure = [column for column in beside if column < layout.trusted]
    named = [column for column in sure if is_internal_energy(layout.name(column))]
    named = named or [column for column in sure if is_some_internal_energy(layout.name(column))]
    if len(named) == 1:
        return named[0]
    found = f"{len(named)} columns are" if named else "no column is"
    raise FormatError(
        f"{name}: {found} named like an internal energy; choose with --energy: {_menu(layout, named or beside)}"
    )


def _named_column(name: str, layout: Layout, wanted: str) -> int:
    """Find a column by its name, or by its 1-based number."""
    spellings: tuple[Callable[[str], str], ...] = (
        str.strip,
        lambda text: text.strip().casefold(),
        normalised,
    )
    found = next(
        (same for key in spellings if (same := [i for i, own in enumerate(layout.names) if key(own) == key(wanted)])),
        [],
    )
    if wanted.isdecimal() and 0 < int(wanted) <= layout.columns:
        found = [*({*found} | {int(wanted) - 1})]
    if not found:
        raise FormatError(
            f"{name}: no column {wanted!r}{near_miss(wanted, layout.names)}; "
            f"there are: {_menu(layout, range(layout.columns))}"
        )
    if len(found) > 1:
        raise FormatError(
            f"{name}: {wanted!r} may be any of these columns: {_menu(layout, found)}; choose by another name or number"
        )
    if found[0] >= layout.trusted:
        raise FormatError(
            f"{name}: the header has {len(layout.names)} names for {layout.columns} values (th_to_csv writes "
            f"such files), so the name of column {found[0] + 1} is not sure; "
            f"only these may be used: {_menu(layout, range(2))}"
        )
    return found[0]


def _menu(layout: Layout, columns: Sequence[int]) -> str:
    return listing([f"{column + 1} {layout.name(column)!r}" for column in columns])


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
    """Values line by line, with comments and blank lines between, or the line that is wrong."""
    values: list[list[float]] = []
    gap = False
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
        state = [_value(f"{name}:{number}", layout, column, cells[column]) for column in used]
        if gap and values and state[0] <= values[-1][0]:
            raise FormatError(
                f"{name}:{number}: the time starts again behind a gap, one curve was expected; "
                "put each curve into its own file"
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
