"""Tables: columns meant by name, by number or by what they are called, and the numbers in their rows."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, listing
from d2rpick.histories.database import Database
from d2rpick.histories.formats.curves import Curves, find_curves
from d2rpick.histories.formats.layout import Layout, as_number, find_layout, is_skipped, split, unique
from d2rpick.histories.formats.plain_rows import plain_rows
from d2rpick.histories.formats.text import UTF16, Text, is_whole, precisions
from d2rpick.histories.names import internal_energies, is_time, meant, near_miss, quantity_of, refuse_other_quantity
from d2rpick.histories.samples import of_one_run

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from d2rpick.histories.history import Precision, Samples
    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source


def labelled(layout: Layout, time: int) -> dict[str, int]:
    """Columns beside the time by the name they are called by, with their number where a name is not theirs alone."""
    names, times = unique([*map(layout.channel, range(layout.trusted))], "column"), {time, *own_times(layout)}
    return {name: column for column, name in enumerate(names) if column not in times}


def own_times(layout: Layout) -> tuple[int, ...]:
    """Time columns of curves side by side, each with times of its own: x, y, x, y; nothing for another table."""
    times = tuple(column for column in range(0, layout.trusted, 2) if is_time(layout.name(column)))
    others = any(is_time(layout.name(column)) for column in range(1, layout.trusted, 2))
    return times if len(times) > 1 and 2 * len(times) == layout.columns and not others else ()


def time_column(source: str, layout: Layout, wanted: str | None, energies: Sequence[str]) -> tuple[int, list[str]]:
    """Column of the time, and what had to be assumed; of curves side by side the one beside the first energy."""
    if wanted is not None:
        return named_column(source, layout, wanted), []
    times = [i for i, column in enumerate(layout.names[: layout.trusted]) if is_time(column)]
    if own_times(layout):
        if energies:
            return named_column(source, layout, energies[0]) // 2 * 2, []
        return internal_energy(source, layout, times) // 2 * 2, []
    if len(times) > 1:
        found = f"{source}: {len(times)} columns are named like a time"
        raise FormatError(f"{found}; choose with `time`: {_menu(layout, times)}")
    if layout.names and not times:
        return 0, [f"no column has the name of a time; {layout.name(0)!r}, the first, was taken as the time"]
    return (times[0] if times else 0), []


def internal_energy(source: str, layout: Layout, times: Sequence[int]) -> int:
    """Pick the only column beside the times, or else the one named like an internal energy."""
    apart = {*times}
    beside = [column for column in range(layout.columns) if column not in apart]
    if len(beside) == 1:
        refuse_other_quantity(layout.channel(beside[0]), source)
        return beside[0]
    sure = [column for column in beside if column < layout.trusted]
    named = [sure[i] for i in internal_energies([layout.name(column) for column in sure])]
    if len(named) == 1:
        return named[0]
    found = f"{len(named)} columns are" if named else "no column is"
    what = f"{source}: {found} named like an internal energy"
    raise FormatError(f"{what}; choose with `energy`: {_menu(layout, named or beside)}")


def named_column(source: str, layout: Layout, wanted: str) -> int:
    """Find a column by its name, or by its 1-based number."""
    found = meant(wanted, layout.names)
    if wanted.isdecimal() and 0 < int(wanted) <= layout.columns:
        found = [*({*found} | {int(wanted) - 1})]
    if not found:
        what = f"{source}: no column {wanted!r}{near_miss(wanted, layout.names)}"
        raise FormatError(f"{what}; there are: {_menu(layout, range(layout.columns))}")
    if len(found) > 1:
        what = f"{source}: {wanted!r} may be any of these columns: {_menu(layout, found)}"
        raise FormatError(f"{what}; choose by another name or number")
    if found[0] >= layout.trusted:
        raise FormatError(
            f"{source}: the header has {len(layout.names)} names for {layout.columns} values (th_to_csv writes "
            f"such files), so the name of column {found[0] + 1} is not sure; "
            f"only these may be used: {_menu(layout, range(2))}"
        )
    return found[0]


def _menu(layout: Layout, columns: Sequence[int]) -> str:
    return listing([f"{column + 1} {layout.name(column)!r}" for column in columns])


def recognises(head: bytes) -> bool:
    """Whether this is text: what it says is seen when it is read."""
    return head.startswith(UTF16) or b"\0" not in head


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Table | Curves]:
    """Open tables; the selection tells their time column, and which values must be whole in a last line."""
    return [find_curves(text, selection) or Table(text, selection) for text in map(Text, sources)]


class Table(Database):
    """One table, a `Database` without parts; FormatError when it is none, or a selected column is not there."""

    format = "csv"

    def __init__(self, text: Text, selection: Selection) -> None:
        self.source, self._text = text.name, text
        self._layout = layout = find_layout(text)
        self._own_times = own_times(layout)
        self._time, notes = time_column(text.name, layout, selection.time, selection.energy)
        self._columns = labelled(layout, self._time)
        self.channels, self.time_unit = tuple(self._columns), layout.unit(self._time)
        self._begin = text.place(layout.start)
        self._needed = self._asked(selection)
        self._read: dict[int, Samples] = {}
        self._together = True  # until a line shows otherwise
        if not is_skipped(text.unended):
            self.complete = _is_whole(text.unended, self._sample(), layout, self._needed)
            if self.complete:
                text.take_rest()
            else:
                notes.append("the last line has no line end and may be cut; it was left out")
        self.notes = tuple(notes)

    @property
    def energy_channel(self) -> str:
        """The column named like an internal energy, or the only one beside the time; else FormatError."""
        column = internal_energy(self.source, self._layout, [self._time, *self._own_times])
        return next(label for label, own in self._columns.items() if own == column)

    def find(self, wanted: str) -> str:
        """Name of a column that is meant by its name or 1-based number; FormatError with what there is."""
        if wanted in self._columns and wanted not in self._layout.names:
            return wanted
        column = named_column(self.source, self._layout, wanted)
        label = next((label for label, own in self._columns.items() if own == column), None)
        if label is None:
            article = "the" if column == self._time else "a"
            raise FormatError(f"{self.source}: {wanted!r} is {article} time column; choose another one as energy")
        return label

    @cached_property
    def time(self) -> Samples:
        """Times as they stand in the file, shape (n,) [time]; FormatError where they are not those of one run."""
        place = partial(line_of, self._text, self._begin, self._layout, self._time)
        return of_one_run(self._values(self._time), lambda state: f"{self.source}:{place(state)}")

    def channel(self, name: str) -> Samples:
        """One column, shape (n,); FormatError with the line of a value that is no number."""
        if name not in self._columns:
            raise FormatError(f"{self.source}: no column {name!r}, only {listing(self.channels)}")
        column = self._columns[name]
        own = column - 1 if column - 1 in self._own_times else self._time
        if own == self._time:
            return self._values(column)
        times, values = columns_of(self._text, self._begin, self._layout, (own, column))
        if not np.array_equal(times, self.time):
            raise FormatError(f"{self.source}: {name!r} has other times than the first curve that is asked for")
        return values

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """How finely the times and these columns were printed."""
        times = [row[self._time] for row in self._printed]
        energies = [row[self._columns[name]] for row in self._printed for name in names]
        return precisions(times, energies, self.time)

    @cached_property
    def _printed(self) -> list[list[str]]:
        """Sampled rows that show how numbers were printed."""
        return [row for row in self._sample() if row[self._time]]  # not behind a curve's end

    def _asked(self, selection: Selection) -> list[int]:
        """Columns that must be whole in a last line without end: those asked for, or what is taken by default."""
        try:
            names = [self.find(wanted) for wanted in selection.energy] or [self.energy_channel]
        except FormatError:
            if selection.energy:
                raise
            return [self._time, *self._columns.values()]
        return [self._time, *(self._columns[name] for name in names)]

    def _sample(self) -> list[list[str]]:
        """Cells, with decimal points, of rows at the start, at the end and evenly between."""
        layout = self._layout
        lines = (line.replace(layout.decimal, ".") for line in self._text.sample(self._begin) if not is_skipped(line))
        return [row for line in lines if len(row := split(line, layout.separator)) >= layout.columns]

    def _values(self, column: int) -> Samples:
        if column not in self._read and self._together:
            # first what was asked for, and what tells of the flight; who wants more mostly wants all the others
            telling = [own for name, own in self._columns.items() if quantity_of(name)]
            others = (
                {*range(self._layout.columns)} - self._read.keys() if self._read else {*self._needed, *telling, column}
            )
            try:
                self._keep([self._time, *(others - {self._time})])
            except FormatError:  # which may be of a column that nobody needs
                self._together = False
        if column not in self._read:
            self._keep([self._time, column])
        return self._read[column]

    def _keep(self, columns: Sequence[int]) -> None:
        for column, values in zip(columns, columns_of(self._text, self._begin, self._layout, columns), strict=True):
            values.flags.writeable = False  # so that nobody needs a copy of his own
            self._read[column] = values


def _is_whole(line: str, sample: Sequence[Sequence[str]], layout: Layout, used: Sequence[int]) -> bool:
    """Whether a line without end has all values, and its last is unused or of a constant printed length."""
    cells = split(line, layout.separator)
    last = len(cells) - 1
    if len(cells) < layout.columns or last not in used:
        return len(cells) >= layout.columns
    return is_whole(cells[last].replace(layout.decimal, "."), [row[last] for row in sample])


# Numbers in the rows: all at once where they are alike, line by line where they are not.


def columns_of(text: Text, begin: int, layout: Layout, used: Sequence[int]) -> list[Samples]:
    """Columns ``used`` of the rows from byte ``begin`` on, that of the times first, each of shape (rows,).

    Between the rows may be comments and blank lines.  Where all cells are empty the curve has ended: another one beside
    it goes on.  FormatError with the line that is wrong.
    """
    tables = [table for _, table in _tables(text, begin, layout, used)] or [np.empty((0, len(used)))]
    return [np.concatenate([table[:, place] for table in tables]) for place in range(len(used))]


def line_of(text: Text, begin: int, layout: Layout, time: int, state: int) -> int:
    """Give the number of the line in which a state stands, counted from 0."""
    for numbers, _ in _tables(text, begin, layout, [time]):
        if state < len(numbers):
            return numbers[state]
        state -= len(numbers)
    raise AssertionError("there is such a state")


def _tables(text: Text, begin: int, layout: Layout, used: Sequence[int]) -> Iterator[tuple[Sequence[int], Samples]]:
    """Numbers of lines and their values piece by piece: line by line only where they are not all alike."""
    curve = _Curve(text.name, layout, used)
    number = layout.start + 1
    for piece in text.pieces(begin, large=text.is_large):
        table = plain_rows(piece, layout, used, is_large=text.is_large)
        if table is not None and np.isfinite(table).all() and not curve.stops_before(float(table[0, 0])):
            rows = len(table)
            yield range(number, number + rows), table
            curve.before, curve.gap = float(table[-1, 0]), False
        else:
            rows = piece.count(b"\n")
            states = list(curve.states(text.rows(piece), number))
            if states:
                yield [line for line, _ in states], np.array([state for _, state in states])
        number += rows


class _Curve:
    """What of a table was seen so far, where it is taken line by line."""

    def __init__(self, name: str, layout: Layout, used: Sequence[int]) -> None:
        self._name, self._layout, self._used = name, layout, used
        self.before: float | None = None  # time of the last state
        self.gap = self._ended = False

    def stops_before(self, time: float) -> bool:
        """Whether a state of this time is one of another curve."""
        return self._ended or (self.gap and self.before is not None and time <= self.before)

    def states(self, rows: Sequence[str], first: int) -> Iterator[tuple[int, list[float]]]:
        """Give line and values of each state in rows of which ``first`` is the number of the first."""
        layout, used = self._layout, self._used
        for number, row in enumerate(rows, first):
            if is_skipped(row):
                self.gap = True
                continue
            where = f"{self._name}:{number}"
            cells = _cells(where, row, layout)
            if not any(cells[column] for column in used) and self.before is not None:
                self._ended = True
                continue
            state = [_value(where, layout, column, cells[column]) for column in used]
            if self.stops_before(state[0]):
                found = "a curve continues after empty cells" if self._ended else "the time starts again after a gap"
                what = f"{where}: {found}, one curve was expected"
                raise FormatError(f"{what}; repair it or put each curve into its own file")
            self.gap, self.before = False, state[0]
            yield number, state


def _cells(where: str, row: str, layout: Layout) -> list[str]:
    cells = split(row, layout.separator)
    if len(cells) == layout.columns + 1 and not cells[-1]:
        cells.pop()
    if layout.names and is_time(cells[0]) and is_time(layout.names[0]):
        raise FormatError(f"{where}: a second header, another curve begins here; put each curve into its own file")
    if len(cells) != layout.columns:
        found = "1 value" if len(cells) == 1 else f"{len(cells)} values"
        raise FormatError(f"{where}: {found}, {layout.columns} were expected as in the other rows; repair the line")
    return cells


def _value(where: str, layout: Layout, column: int, cell: str) -> float:
    value = as_number(cell, layout.decimal)
    if value is None or not np.isfinite(value):
        found = f"{where}: {layout.name(column)!r} is {cell[:60]!r}, a number was expected"
        raise FormatError(f"{found}; repair or delete the line")
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
