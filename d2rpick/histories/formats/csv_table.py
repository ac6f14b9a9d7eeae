"""Tables: columns meant by name, by number or by what they are called, and the numbers in their rows."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, if_written, listing
from d2rpick.histories.database import Database
from d2rpick.histories.formats.cells import is_number, is_skipped, split
from d2rpick.histories.formats.curves import Curves, find_curves
from d2rpick.histories.formats.layout import Layout, find_layout, unique, with_thousands
from d2rpick.histories.formats.rows import find_line, read_columns
from d2rpick.histories.formats.text import UTF16, Text, is_whole, precisions
from d2rpick.histories.meaning import (
    find_internal_energies,
    find_meaning,
    is_time,
    quantity_of,
    refuse_other_quantity,
)
from d2rpick.histories.names import meant, near_miss
from d2rpick.histories.samples import count_rows_per_time, of_one_run

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.history import Precision, Samples
    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source


def labelled(layout: Layout, time: int) -> dict[str, int]:
    """Columns beside the time by the name they are called by, with their number where a name is not theirs alone."""
    names, times = (
        unique([*map(layout.channel, range(layout.trusted))], "column"),
        {time, *own_times(layout)},
    )
    return {name: column for column, name in enumerate(names) if column not in times}


def own_times(layout: Layout) -> tuple[int, ...]:
    """Time columns of curves side by side, each with times of its own: x, y, x, y; nothing for another table."""
    times = tuple(
        column for column in range(0, layout.trusted, 2) if is_time(layout.name(column))
    )
    others = any(is_time(layout.name(column)) for column in range(1, layout.trusted, 2))
    return (
        times
        if len(times) > 1 and 2 * len(times) == layout.columns and not others
        else ()
    )


def numeric_columns(layout: Layout, sample: Sequence[Sequence[str]]) -> frozenset[int]:
    """Return the columns that hold a number in one of the sampled rows; all of them without a row."""
    columns = range(layout.columns)
    if not sample:
        return frozenset(columns)
    return frozenset(
        column
        for column in columns
        if any(is_number(row[column], ".") for row in sample)
    )


def _sampled_rows(text: Text, begin: int, layout: Layout) -> list[list[str]]:
    """Cells of rows at the start, at the end and evenly between."""
    lines = [line for line in text.sample(begin) if not is_skipped(line)]
    return [
        row
        for line in lines
        if len(row := split(line, layout.separator)) >= layout.columns
    ]


def time_column(
    source: str,
    layout: Layout,
    wanted: str | None,
    energies: Sequence[str],
    numeric: frozenset[int],
) -> tuple[int, list[str]]:
    """Column of the time, and what had to be assumed; of curves side by side the one beside the first energy.

    Without a column that is called a time, it is the first ``numeric`` one that is no quantity, and not called like the
    numbers of the rows.
    """
    if wanted is not None:
        return named_column(source, layout, wanted), []
    times = [
        i for i, column in enumerate(layout.names[: layout.trusted]) if is_time(column)
    ]
    if own_times(layout):
        if energies:
            return named_column(source, layout, energies[0]) // 2 * 2, []
        return internal_energy(source, layout, times, numeric) // 2 * 2, []
    if len(times) > 1:
        found = f"{source}: {len(times)} columns are named like a time"
        raise FormatError(f"{found}; choose with `time`: {_menu(layout, times)}")
    if times:
        return times[0], []
    if not layout.names:
        return min(numeric, default=0), []
    candidates = sorted(
        column for column in numeric if find_meaning(layout.name(column)) is None
    )
    if len(candidates) > 1 and layout.name(candidates[0]).casefold() in _ROW_NUMBERS:
        del candidates[0]
    if not candidates:
        what = f"{source}: no column has the name of a time"
        raise FormatError(
            f"{what}; choose with `time`: {_menu(layout, range(layout.columns))}"
        )
    first = candidates[0]
    return first, [
        f"no column has the name of a time; {layout.name(first)!r}, the first, was taken as the time"
    ]


# What spreadsheets, pandas and others call the numbers of the rows; in front they have no name at all.
_ROW_NUMBERS: Final = frozenset(
    {
        "column 1",
        "unnamed: 0",
        "index",
        "nr",
        "nr.",
        "no",
        "no.",
        "row",
        "id",
        "#",
        "state",
        "increment",
        "inc",
        "step",
    }
)


def internal_energy(
    source: str, layout: Layout, times: Sequence[int], numeric: frozenset[int]
) -> int:
    """Pick the only numeric column beside the times, or else the one named like an internal energy."""
    apart = {*times}
    beside = [
        column
        for column in range(layout.columns)
        if column not in apart and column in numeric
    ]
    if len(beside) == 1:
        refuse_other_quantity(layout.channel(beside[0]), source)
        return beside[0]
    sure = [column for column in beside if column < layout.trusted]
    named = [
        sure[i]
        for i in find_internal_energies([layout.name(column) for column in sure])
    ]
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
        what = (
            f"{source}: {wanted!r} may be any of these columns: {_menu(layout, found)}"
        )
        raise FormatError(f"{what}; choose by another name or number")
    if found[0] >= layout.trusted:
        raise FormatError(
            f"{source}: the header has {len(layout.names)} names for {layout.columns} values (th_to_csv writes "
            f"such files), so the name of column {found[0] + 1} is not sure; "
            f"only these may be used: {_menu(layout, range(layout.trusted))}"
        )
    return found[0]


def _unsure_columns(layout: Layout) -> str:
    found = f"the header has {len(layout.names)} names for {layout.columns} values (th_to_csv writes such files)"
    return f"{found}: only the first {layout.trusted} columns are sure to have their own name and are used"


def _menu(layout: Layout, columns: Sequence[int]) -> str:
    return listing([f"{column + 1} {layout.name(column)!r}" for column in columns])


def recognises(head: bytes) -> bool:
    """Whether this is text: what it says is seen when it is read."""
    return head.startswith(UTF16) or b"\0" not in head


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Table | Curves]:
    """Open tables; the selection tells their time column, and which values must be whole in a last line."""
    return [
        find_curves(text, selection) or Table(text, selection)
        for text in map(Text, sources)
    ]


class Table(Database):
    """One table, a `Database` without parts; FormatError when it is none, or a selected column is not there."""

    format = "csv"
    named_by_people = True

    def __init__(self, text: Text, selection: Selection) -> None:
        self.source, self._text = text.name, text
        layout = find_layout(text)
        self._begin = text.place(layout.start)
        sample = _sampled_rows(text, self._begin, layout)
        self._layout = layout = with_thousands(layout, sample)
        # cells, with decimal points, of rows at the start, at the end and evenly between
        self._sample = (
            sample
            if layout.decimal == "." and not layout.thousands
            else [[layout.plain(cell) for cell in row] for row in sample]
        )
        self._numeric = numeric_columns(layout, self._sample)
        self._own_times = own_times(layout)
        self._time, notes = time_column(
            text.name, layout, selection.time, selection.energy, self._numeric
        )
        self._columns = labelled(layout, self._time)
        self.channels, left_out = self._split_channels()
        self.time_unit = layout.unit(self._time)
        self._failed: dict[int, FormatError] = {}
        self._notes: list[str] = []
        self._needed = self._asked(selection)
        self._read: dict[int, Samples] = {}
        self._together = True  # until a line shows otherwise
        if not is_skipped(text.unended):
            self.complete = _is_whole(text.unended, self._sample, layout, self._needed)
            if self.complete:
                text.take_rest()
            else:
                notes.append(
                    "the last line has no line end and may be cut; it was left out"
                )
        if layout.sure not in (None, layout.columns) and layout.columns > 2:
            notes.append(_unsure_columns(layout))
        self._notes += [*notes, *left_out]

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]
        """What was assumed and left out, known once the columns that matter were read."""
        if_written(lambda: self.time)
        return tuple(self._notes)

    def _split_channels(self) -> tuple[tuple[str, ...], list[str]]:
        """Return the columns that hold numbers, and a note on each named one that holds none."""
        channels, notes = list[str](), list[str]()
        for name, column in self._columns.items():
            if column in self._numeric:
                channels.append(name)
                continue
            words = [row[column] for row in self._sample if row[column]]
            if words:
                notes.append(
                    f"column {column + 1} {name!r} holds no numbers ({words[0]!r}) and was left out"
                )
        return tuple(channels), notes

    @property
    def energy_channel(self) -> str:
        """The column named like an internal energy, or the only one beside the time; else FormatError."""
        column = internal_energy(
            self.source, self._layout, [self._time, *self._own_times], self._numeric
        )
        return next(label for label, own in self._columns.items() if own == column)

    def find(self, wanted: str) -> str:
        """Name of a column that is meant by its name or 1-based number; FormatError with what there is."""
        if wanted in self._columns and wanted not in self._layout.names:
            return wanted
        column = named_column(self.source, self._layout, wanted)
        label = next(
            (label for label, own in self._columns.items() if own == column), None
        )
        if label is None:
            article = "the" if column == self._time else "a"
            raise FormatError(
                f"{self.source}: {wanted!r} is {article} time column; choose another one as energy"
            )
        return label

    @cached_property
    def time(self) -> Samples:
        """Times as they stand in the file, shape (n,) [time]; FormatError where they are not those of one run."""
        place = partial(find_line, self._text, self._begin, self._layout, self._time)
        times = of_one_run(
            self._values(self._time), lambda state: f"{self.source}:{place(state)}"
        )
        if count_rows_per_time(times) > 1:
            self._refuse_rows_of_parts(times)
        return times

    def _refuse_rows_of_parts(self, times: Samples) -> None:
        """Raise FormatError if each time stands in a row for each part."""
        from d2rpick.histories.interleaved import (
            refuse_rows_of_parts,
        )  # not above: hardly a table is one

        for column in self._needed[1:]:
            energy = if_written(partial(self._values, column))
            if energy is not None and energy.size == times.size:
                rows = self._sample[: self._text.some]
                others = {
                    name: [row[place] for row in rows]
                    for name, place in self._columns.items()
                }
                refuse_rows_of_parts(self.source, times, energy, others)

    def channel(self, name: str) -> Samples:
        """One column, shape (n,); FormatError with the line of a value that is no number."""
        if name not in self._columns:
            raise FormatError(
                f"{self.source}: no column {name!r}, only {listing(self.channels)}"
            )
        column = self._columns[name]
        own = column - 1 if column - 1 in self._own_times else self._time
        if own == self._time:
            return self._values(column)
        times, values = read_columns(
            self._text, self._begin, self._layout, (own, column)
        ).columns
        if not np.array_equal(times, self.time):
            raise FormatError(
                f"{self.source}: {name!r} has other times than the first curve that is asked for"
            )
        return values

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """How finely the times and these columns were printed."""
        times = [row[self._time] for row in self._printed]
        energies = [row[self._columns[name]] for row in self._printed for name in names]
        return precisions(times, energies, self.time)

    @cached_property
    def _printed(self) -> list[list[str]]:
        """Sampled rows that show how numbers were printed."""
        # not behind a curve's end, and no words below a table
        return [row for row in self._sample if is_number(row[self._time], ".")]

    def _asked(self, selection: Selection) -> list[int]:
        """Columns that must be whole in a last line without end: those asked for, or what is taken by default."""
        try:
            names = [self.find(wanted) for wanted in selection.energy] or [
                self.energy_channel
            ]
        except FormatError:
            if selection.energy:
                raise
            return [self._time, *self._columns.values()]
        return [self._time, *(self._columns[name] for name in names)]

    def _values(self, column: int) -> Samples:
        if column in self._failed:
            raise self._failed[column]
        if column not in self._read and self._together:
            # first what was asked for, and what tells of the flight; who wants more mostly wants all the others
            telling = [own for name, own in self._columns.items() if quantity_of(name)]
            others = (
                {*range(self._layout.columns)} - self._read.keys()
                if self._read
                else {*self._needed, *telling, column}
            )
            try:
                self._keep([self._time, *(others - {self._time})])
            except FormatError:  # which may be of a column that nobody needs
                self._together = False
                self._read_one_by_one([other for other in telling if other != column])
        if column not in self._read:
            self._keep([self._time, column])
        return self._read[column]

    def _read_one_by_one(self, columns: Sequence[int]) -> None:
        """Read columns of quantities; one that has no number in each row is left out with a note."""
        for column in columns:
            try:
                self._keep([self._time, column])
            except FormatError as error:
                self._failed[column] = error
                if column not in self._needed:
                    reason = (
                        str(error)
                        .removeprefix(f"{self.source}:")
                        .removesuffix("; repair or delete the line")
                    )
                    self._notes.append(
                        f"{self._layout.name(column)!r} was left out: line {reason}"
                    )

    def _keep(self, columns: Sequence[int]) -> None:
        read = read_columns(self._text, self._begin, self._layout, columns)
        self._notes += [note for note in read.notes if note not in self._notes]
        for column, values in zip(columns, read.columns, strict=True):
            values.flags.writeable = False  # so that nobody needs a copy of his own
            self._read[column] = values


def _is_whole(
    line: str, sample: Sequence[Sequence[str]], layout: Layout, used: Sequence[int]
) -> bool:
    """Whether a line without end has all values, and its last is unused or of a constant printed length."""
    cells = split(line, layout.separator)
    last = len(cells) - 1
    if len(cells) < layout.columns or last not in used:
        return len(cells) >= layout.columns
    return is_whole(layout.plain(cells[last]), [row[last] for row in sample])


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
    rows = zip(
        *(map(repr, column.tolist()) for column in columns.values()), strict=True
    )
    return "\n".join(
        [head.getvalue().removesuffix("\n"), *map(",".join, rows), ""]
    ).encode()
