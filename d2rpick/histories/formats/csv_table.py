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

from d2rpick.errors import FormatError, listing
from d2rpick.histories.formats import printed
from d2rpick.histories.formats.columns import internal_energy, labelled, named_column, own_times, time_column
from d2rpick.histories.formats.curves import Curves, find_curves
from d2rpick.histories.formats.layout import Layout, find_layout, is_skipped, split
from d2rpick.histories.formats.order import not_a_restart
from d2rpick.histories.formats.table_values import checked_values, line_of, plain_values
from d2rpick.histories.formats.text import UTF16, Text
from d2rpick.histories.names import quantity_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.history import Part, Precision, Samples
    from d2rpick.histories.selection import Selection
    from d2rpick.histories.source import Source


def recognises(head: bytes) -> bool:
    """Whether this is text: what it says is seen when it is read."""
    return head.startswith(UTF16) or b"\0" not in head


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Table | Curves]:
    """Open tables; the selection tells their time column, and which values must be whole in a last line."""
    return [find_curves(text, selection) or Table(text, selection) for text in map(Text, sources)]


class Table:
    """One table; a `Database` without parts.

    FormatError when it is no table, or a column that was selected is not there.
    """

    format = "csv"
    version = title = ""
    parts: tuple[Part, ...] = ()

    def __init__(self, text: Text, selection: Selection) -> None:
        self.source, self._text = text.name, text
        self._layout = layout = find_layout(text)
        self._own_times = own_times(layout)
        self._time, notes = time_column(text.name, layout, selection.time, selection.energy)
        self._columns = labelled(layout, self._time)
        self._begin = text.place(layout.start)
        self._needed = self._asked(selection)
        self._read: dict[int, Samples] = {}
        self._plain = True  # until a line shows otherwise
        self.complete = True
        if not is_skipped(text.unended):
            self.complete = _is_whole(text.unended, self._sample(), layout, self._needed)
            if self.complete:
                text.take_rest()
            else:
                notes.append("the last line has no line end and may be cut; it was left out")
        self.notes = tuple(notes)

    @cached_property
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
        column = internal_energy(self.source, self._layout, [self._time, *self._own_times])
        return next(label for label, own in self._columns.items() if own == column)

    def find(self, wanted: str) -> str:
        """Name of a column that is meant by its name or 1-based number; FormatError with what there is."""
        if wanted in self._columns and wanted not in self._layout.names:
            return wanted
        column = named_column(self.source, self._layout, wanted)
        if column == self._time:
            raise FormatError(f"{self.source}: {wanted!r} is the time column; choose another one as energy")
        return next(label for label, own in self._columns.items() if own == column)

    @cached_property
    def time(self) -> Samples:
        """Times as they stand in the file, shape (n,) [time]; FormatError where they are not those of one run."""
        time = self._values(self._time)
        state = not_a_restart(time)
        if state is None:
            return time
        line = line_of(self._text, self._begin, self._layout, self._time, state)
        raise FormatError(
            f"{self.source}:{line}: time steps back from {time[state - 1]:g} to {time[state]:g}, increasing times or "
            "one restart were expected; sort the rows, or put each curve into its own file"
        )

    @property
    def part_time(self) -> Samples:
        """Refused: a table has no parts."""
        raise self._no_parts()

    def channel(self, name: str) -> Samples:
        """One column, shape (n,); FormatError with the line of a value that is no number."""
        if name not in self._columns:
            raise FormatError(f"{self.source}: no column {name!r}, only {listing(self.channels)}")
        column = self._columns[name]
        own = column - 1 if column - 1 in self._own_times else self._time
        if own == self._time:
            return self._values(column)
        curve = checked_values(self._text, self._begin, self._layout, (own, column))
        if not np.array_equal(curve[:, 0], self.time):
            raise FormatError(f"{self.source}: {name!r} has other times than the first curve that is asked for")
        return np.ascontiguousarray(curve[:, 1])

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:  # noqa: ARG002  as a Database
        """Refused: a table has no parts."""
        raise self._no_parts()

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """How finely the times and these columns were printed."""
        times = [row[self._time] for row in self._printed]
        energies = [row[self._columns[name]] for row in self._printed for name in names]
        return printed.precisions(times, energies, self.time)

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
        if column not in self._read and self._plain:
            # first what was asked for, and what tells of the flight; who wants more mostly wants all the others
            others = {*range(self._layout.columns)} - self._read.keys()
            telling = [own for name, own in self._columns.items() if quantity_of(name)]
            wanted = sorted(others if self._read else {*self._needed, *telling, column})
            columns = plain_values(self._text, self._begin, self._layout, wanted)
            self._plain = columns is not None
            found = zip(wanted, columns or (), strict=self._plain)
            self._read |= {one: _kept(values) for one, values in found if np.isfinite(values).all()}
        if column not in self._read:
            values = checked_values(self._text, self._begin, self._layout, (self._time, column))
            self._read |= {self._time: values[:, 0].copy(), column: values[:, 1].copy()}
        return self._read[column]

    def _no_parts(self) -> FormatError:
        return FormatError(
            f"{self.source}: a table has no parts; choose its columns with `energy`, "
            "or give the matsum, binout or T01 of the run"
        )


def _kept(values: Samples) -> Samples:
    """Make values read-only, so that nobody needs a copy of his own."""
    values.flags.writeable = False
    return values


def _is_whole(line: str, sample: Sequence[Sequence[str]], layout: Layout, used: Sequence[int]) -> bool:
    """Whether a line without end has all values, and its last is unused or of a constant printed length."""
    cells = split(line, layout.separator)
    last = len(cells) - 1
    if len(cells) < layout.columns or last not in used:
        return len(cells) >= layout.columns
    return printed.is_whole(cells[last].replace(layout.decimal, "."), [row[last] for row in sample])


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
