"""Read tables: find a column by name or number, and read the numbers in the rows."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from itertools import compress
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import (
    EnergyChoiceError,
    FormatError,
    give_if_written,
    list_names,
)
from d2rpick.histories.database import Database
from d2rpick.histories.formats.cells import (
    has_number,
    is_skipped,
    split_cells,
    split_columns_of_numbers,
)
from d2rpick.histories.formats.curves import Curves, find_curves
from d2rpick.histories.formats.layout import (
    Layout,
    add_thousands,
    find_layout,
    number_duplicates,
)
from d2rpick.histories.formats.rows import find_line, read_columns
from d2rpick.histories.formats.text import UTF16, Text, find_precisions, is_whole_field
from d2rpick.histories.meaning import (
    find_internal_energies,
    find_meaning,
    find_quantity,
    is_time,
    may_be_energy,
    refuse_other_quantity,
)
from d2rpick.histories.names import check_energy_unit, match_names, suggest_name
from d2rpick.histories.samples import check_one_run, count_rows_per_time

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from d2rpick.histories.history import Precision, Samples
    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source

# Names that spreadsheets, pandas and other programs give to a column of row numbers.
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


def label_columns(layout: Layout, time: int) -> dict[str, int]:
    """Return the columns other than the time, keyed by name; a repeated name gets the column number."""
    names = number_duplicates([*map(layout.channel, range(layout.trusted))], "column")
    times = {time, *find_own_times(layout)}
    return {name: column for column, name in enumerate(names) if column not in times}


def find_own_times(layout: Layout) -> tuple[int, ...]:
    """Return the time columns of a table that lists curves side by side (x, y, x, y); empty for other tables."""
    times = tuple(
        column for column in range(0, layout.trusted, 2) if is_time(layout.name(column))
    )
    has_other_times = any(
        is_time(layout.name(column)) for column in range(1, layout.trusted, 2)
    )
    if len(times) < 2 or 2 * len(times) != layout.columns or has_other_times:
        return ()
    return times


def find_numeric_columns(sample: Sequence[Sequence[str]]) -> frozenset[int]:
    """Return the columns with a number in at least one sampled cell; all columns if no row was sampled."""
    return frozenset(
        column
        for column, cells in enumerate(sample)
        if not cells or any(has_number(cell, ".") for cell in cells)
    )


def _split_columns(lines: Sequence[str], layout: Layout) -> list[list[str]]:
    """Return the cells of each column in those lines that are rows of the table."""
    rows = [
        split_cells(line, layout.separator) for line in lines if not is_skipped(line)
    ]
    rows = [row for row in rows if len(row) >= layout.columns]
    return [[row[column] for row in rows] for column in range(layout.columns)]


def find_time_column(
    source: str,
    layout: Layout,
    wanted: str | None,
    energies: Sequence[str],
    numeric: frozenset[int],
) -> tuple[int, list[str]]:
    """Return the time column and notes on assumptions. If curves stand side by side, the first energy's time is used.

    If no column has the name of a time, the first ``numeric`` column is returned whose name denotes neither a known
    quantity nor row numbers.
    """
    if wanted is not None:
        column = find_column(source, layout, wanted)
        quantity = _find_quantity_as_time(layout, column)
        if not quantity:
            return column, []
        name = layout.name(column)
        return column, [
            f"{name!r} is by its name not a time ({quantity}); it was used as it is"
        ]
    times = [
        i for i, column in enumerate(layout.names[: layout.trusted]) if is_time(column)
    ]
    if find_own_times(layout):
        if energies:
            return find_column(source, layout, energies[0]) // 2 * 2, []
        return find_internal_energy(source, layout, times, numeric) // 2 * 2, []
    if len(times) > 1:
        problem = f"{source}: {len(times)} columns are named like a time"
        raise FormatError(
            f"{problem}; choose with `time`: {_list_columns(layout, times)}"
        )
    if times:
        return times[0], []
    if not layout.names:
        first = min(numeric, default=0)
        return first, [
            f"the table has no line of headings; column {first + 1} was used as the time"
        ]
    candidates = sorted(
        column for column in numeric if find_meaning(layout.name(column)) is None
    )
    if len(candidates) > 1 and layout.name(candidates[0]).casefold() in _ROW_NUMBERS:
        del candidates[0]
    if not candidates:
        problem = f"{source}: no column has the name of a time"
        raise FormatError(
            f"{problem}; choose with `time`: {_list_columns(layout, range(layout.columns))}"
        )
    first = candidates[0]
    return first, [
        f"no column has the name of a time; {layout.name(first)!r}, the first, was used as the time"
    ]


def _find_quantity_as_time(layout: Layout, column: int) -> str:
    """Return the quantity that the name of a time column denotes; empty if it may be a time."""
    name = layout.name(column)
    meaning = None if is_time(name) else find_meaning(name)
    return meaning.quantity.replace("_", " ") if meaning else ""


def find_internal_energy(
    source: str, layout: Layout, times: Sequence[int], numeric: frozenset[int]
) -> int:
    """Return the only numeric column besides the times, or the only column whose name denotes an internal energy."""
    candidates = [
        column
        for column in range(layout.columns)
        if column not in times and column in numeric
    ]
    if len(candidates) == 1:
        refuse_other_quantity(layout.channel(candidates[0]), source)
        return candidates[0]
    sure = [column for column in candidates if column < layout.trusted]
    energies = [
        sure[i]
        for i in find_internal_energies([layout.name(column) for column in sure])
    ]
    if len(energies) == 1:
        return energies[0]
    if energies:
        count = f"{len(energies)} columns are"
    elif layout.names:
        count = "no column is"
    else:
        count = "the table has no line of headings, so no column is"
    choices = energies or [
        column for column in candidates if may_be_energy(layout.name(column))
    ]
    menu = _list_columns(layout, choices or candidates)
    if not choices:
        raise FormatError(
            f"{source}: none of the columns is an energy by its name or unit: {menu}; write the internal energy too, "
            "or give one of them as `energy` if it is one after all"
        )
    raise EnergyChoiceError(
        f"{source}: {count} named like an internal energy; choose with `energy`: {menu}",
        tuple(str(column + 1) for column in choices),
    )


def find_column(source: str, layout: Layout, wanted: str) -> int:
    """Return the column with this name or 1-based number; raise FormatError if there is none or more than one."""
    columns = match_names(wanted, layout.names)
    if wanted.isdecimal() and 0 < int(wanted) <= layout.columns:
        columns = [*({*columns} | {int(wanted) - 1})]
    if not columns:
        problem = f"{source}: no column {wanted!r}{suggest_name(wanted, layout.names)}"
        menu = _list_columns(layout, range(layout.columns))
        raise FormatError(f"{problem}; there are: {menu}")
    if len(columns) > 1:
        problem = f"{source}: {wanted!r} may be any of these columns: {_list_columns(layout, columns)}"
        raise FormatError(f"{problem}; choose by another name or number")
    if columns[0] >= layout.trusted:
        raise FormatError(
            f"{source}: the header has {len(layout.names)} names for {layout.columns} values (th_to_csv writes "
            f"such files), so the name of column {columns[0] + 1} is not sure; "
            f"only these may be used: {_list_columns(layout, range(layout.trusted))}"
        )
    return columns[0]


def _note_unsure_columns(layout: Layout) -> str:
    """Return the note on a header that has more or fewer names than there are columns."""
    problem = f"the header has {len(layout.names)} names for {layout.columns} values (th_to_csv writes such files)"
    return f"{problem}: only the first {layout.trusted} columns are sure to have their own name and are used"


def _list_columns(layout: Layout, columns: Sequence[int]) -> str:
    """List the columns from which the user can choose, with their numbers and names."""
    return list_names([f"{column + 1} {layout.name(column)!r}" for column in columns])


def recognises(head: bytes) -> bool:
    """Return True if the first bytes of a file are text; whether the text is a table appears only when it is read."""
    return head.startswith(UTF16) or b"\0" not in head


def open_legs(sources: Sequence[Source], selection: Selection) -> list[Table | Curves]:
    """Open text files as tables or curves. An unterminated last line is used only if it has all selected columns."""
    return [
        find_curves(text, selection) or Table(text, selection)
        for text in map(Text, sources)
    ]


class Table(Database):
    """A table as a `Database` without parts; raises FormatError if the text is not a table or lacks a column."""

    format = "csv"
    named_by_people = True

    def __init__(self, text: Text, selection: Selection) -> None:
        self.source, self._text = text.name, text
        layout = find_layout(text)
        self._begin = text.place(layout.start)
        lines = text.sample(self._begin)
        sample = split_columns_of_numbers(
            lines, layout.separator, layout.decimal, layout.columns
        )
        self._are_numbers = sample is not None
        if sample is None:
            sample = _split_columns(lines, layout)
            layout = add_thousands(layout, sample)
        self._layout = layout
        # Cells of each column in the sampled rows, with "." as the decimal sign.
        self._sample = sample
        if layout.decimal != "." or layout.thousands:
            self._sample = [[*map(layout.plain, cells)] for cells in sample]
        self._numeric = find_numeric_columns(self._sample)
        self._own_times = find_own_times(layout)
        self._time, notes = find_time_column(
            text.name, layout, selection.time, selection.energy, self._numeric
        )
        self._columns = label_columns(layout, self._time)
        self.channels, left_out = self._split_channels()
        self.time_unit = layout.unit(self._time)
        self._failed: dict[int, FormatError] = {}
        self._notes: list[str] = []
        self._needed = self._asked(selection)
        self._read: dict[int, Samples] = {}
        # False once a row has shown that the column is not numeric.
        self._together = True
        if not is_skipped(text.unended):
            self.complete = _is_whole_row(
                text.unended, self._sample, layout, self._needed
            )
            if self.complete:
                text.take_rest()
            else:
                notes.append(
                    "the last line has no line end and may be cut; it was left out"
                )
        if layout.sure not in (None, layout.columns) and layout.columns > 2:
            notes.append(_note_unsure_columns(layout))
        self._notes += [*notes, *left_out]

    def find_energy_unit(self, channel: str) -> str:
        """Return the energy unit in the header of a column; empty if the header contains none."""
        return check_energy_unit(self._layout.unit(self._columns[channel]))

    @property
    def notes(self) -> tuple[str, ...]:  # type: ignore[override]  # a property overrides a field
        """Notes on assumptions and omissions, which are complete only after the required columns have been read."""
        with suppress(FormatError):
            _ = self.time
        return tuple(self._notes)

    def _split_channels(self) -> tuple[tuple[str, ...], list[str]]:
        """Return the columns that contain numbers, and a note on each named column that contains none."""
        channels = list[str]()
        notes = list[str]()
        for name, column in self._columns.items():
            if column in self._numeric:
                channels.append(name)
                continue
            words = [cell for cell in self._sample[column] if cell]
            if words:
                notes.append(
                    f"column {column + 1} {name!r} holds no numbers ({words[0]!r}) and was left out"
                )
        return tuple(channels), notes

    @property
    def energy_channel(self) -> str:
        """The column whose name denotes internal energy or, failing that, the only column besides the time."""
        column = find_internal_energy(
            self.source, self._layout, [self._time, *self._own_times], self._numeric
        )
        return next(
            name for name, position in self._columns.items() if position == column
        )

    def find(self, wanted: str) -> str:
        """Return the channel name of a column given by name or 1-based number; raise FormatError if there is none."""
        if wanted in self._columns and wanted not in self._layout.names:
            return wanted
        column = find_column(self.source, self._layout, wanted)
        labels = [
            name for name, position in self._columns.items() if position == column
        ]
        if not labels:
            article = "the" if column == self._time else "a"
            raise FormatError(
                f"{self.source}: {wanted!r} is {article} time column; choose another one"
            )
        return labels[0]

    @cached_property
    def time(self) -> Samples:
        """Times as in the file, shape (n,) [time]; raise FormatError if they are not the times of a single run."""
        find_row = partial(find_line, self._text, self._begin, self._layout, self._time)
        values = self._values(self._time)
        try:
            times = check_one_run(
                values, lambda state: f"{self.source}:{find_row(state)}"
            )
        except FormatError:
            self._refuse_other_quantity_as_time()
            raise
        if count_rows_per_time(times) > 1:
            self._refuse_rows_of_parts(times)
        return times

    def _refuse_other_quantity_as_time(self) -> None:
        """Raise FormatError if the name of the time column denotes another quantity."""
        quantity = _find_quantity_as_time(self._layout, self._time)
        if not quantity:
            return
        titles = enumerate(self._layout.names)
        columns = [i for i, title in titles if is_time(title)]
        menu = _list_columns(self._layout, columns or range(self._layout.columns))
        title = self._layout.name(self._time)
        raise FormatError(
            f"{self.source}: column {self._time + 1} {title!r} is not a time: its name is that of another quantity "
            f"({quantity}), and its values decrease; choose with `time`: {menu}"
        )

    def _refuse_rows_of_parts(self, times: Samples) -> None:
        """Raise FormatError if the table has a row for each part at each time."""
        # Imported here to keep start-up fast.
        from d2rpick.histories.interleaved import refuse_rows_of_parts

        for column in self._needed[1:]:
            energy = give_if_written(partial(self._values, column))
            if energy is not None and energy.size == times.size:
                printed = {
                    name: self._sample[position][: self._text.some]
                    for name, position in self._columns.items()
                }
                refuse_rows_of_parts(self.source, times, energy, printed)

    def channel(self, name: str) -> Samples:
        """Return one column, shape (n,); raise FormatError with the line of a value that is not a number."""
        if name not in self._columns:
            raise FormatError(
                f"{self.source}: no column {name!r}, only {list_names(self.channels)}"
            )
        column = self._columns[name]
        time = column - 1 if column - 1 in self._own_times else self._time
        if time == self._time:
            return self._values(column)
        times, values = read_columns(
            self._text, self._begin, self._layout, (time, column)
        ).columns
        if not np.array_equal(times, self.time):
            raise FormatError(
                f"{self.source}: the times of {name!r} differ from those of the first requested curve"
            )
        return values

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """Return the precision with which the times and these columns were printed."""
        printed = self._printed
        energies = [cell for name in names for cell in printed[self._columns[name]]]
        return find_precisions(printed[self._time], energies, self.time)

    @cached_property
    def _printed(self) -> Sequence[Sequence[str]]:
        """The sampled cells of each column, without rows after the end of a curve or lines below the table."""
        if self._are_numbers:
            return self._sample
        is_row = [has_number(cell, ".") for cell in self._sample[self._time]]
        return [[*compress(cells, is_row)] for cells in self._sample]

    def _asked(self, selection: Selection) -> list[int]:
        """Return the requested or default columns. An unterminated last line is used only if it has all of them."""
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
        """Return a column, shape (n,); raise FormatError if a row has no number in this column."""
        if column in self._failed:
            raise self._failed[column]
        if column not in self._read and self._together:
            # The first pass over the table reads the required columns and the columns that indicate a flight.
            # The second pass reads all other columns, because they are usually requested next.
            quantities = [
                position
                for name, position in self._columns.items()
                if find_quantity(name)
            ]
            wanted = {*self._needed, *quantities, column}
            if self._read:
                wanted = {*range(self._layout.columns)} - self._read.keys()
            try:
                self._keep([self._time, *(wanted - {self._time})])
            except FormatError:  # The error may be in a column that is not required.
                self._together = False
                self._read_one_by_one(
                    [other for other in quantities if other != column]
                )
        if column not in self._read:
            self._keep([self._time, column])
        return self._read[column]

    def _read_one_by_one(self, columns: Sequence[int]) -> None:
        """Read these columns one by one; skip each column that lacks a number in some row, and add a note."""
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
        """Read these columns of the table and store them."""
        table = read_columns(self._text, self._begin, self._layout, columns)
        self._notes += [note for note in table.notes if note not in self._notes]
        for column, values in zip(columns, table.columns, strict=True):
            values.flags.writeable = False  # The array is read-only, so that callers can share it without copies.
            self._read[column] = values


def _is_whole_row(
    line: str, sample: Sequence[Sequence[str]], layout: Layout, used: Sequence[int]
) -> bool:
    """Return True if an unterminated line has all values, the last of which is either unused or certainly complete."""
    cells = split_cells(line, layout.separator)
    last = len(cells) - 1
    if len(cells) < layout.columns or last not in used:
        return len(cells) >= layout.columns
    return is_whole_field(layout.plain(cells[last]), sample[last])


def write(columns: Mapping[str, Samples]) -> bytes:
    r"""Write columns (n,) under their names, with the fewest digits per number that preserve it exactly.

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
