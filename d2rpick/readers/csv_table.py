"""Tables of numbers in text: CSV and its relatives, with or without names above the columns.

Taken as they come: columns parted by commas, semicolons, tabs or blanks; decimal commas (not between
commas); UTF-8, UTF-16 with its mark, latin-1; comment lines; quotes; names with units or a row of units below
them; LS-PrePost's title line, 3DEXPERIENCE's third name, and th_to_csv, whose names are trusted for two
columns only where they outnumber the values.  `layout` finds out about that; here the values are read.

A last line without line end may be cut, and a cut number is often a number.  It counts only when all its
values are there and the last of them is not used, or is certainly whole (`printed.is_whole`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.history import History
from d2rpick.readers import printed
from d2rpick.readers.layout import Layout, as_number, find_layout, is_skipped, split
from d2rpick.readers.names import (
    is_internal_energy,
    is_some_internal_energy,
    is_time,
    listing,
    near_miss,
    normalised,
    quantity_note,
)
from d2rpick.readers.source import Selection, Source, states_that_count

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.history import Samples

_UTF16 = (b"\xff\xfe", b"\xfe\xff")
_UTF8 = b"\xef\xbb\xbf"

# How many rows from the start, the end and between are looked at to judge the printed format.
_SAMPLE = 100


def recognises(head: bytes) -> bool:
    """Whether this is text: what it says is seen when it is read."""
    return head.startswith(_UTF16) or b"\0" not in head


def read(source: Source, selection: Selection) -> History:
    """Read the columns asked for, by default the time and the internal energy."""
    lines = _text(source).split("\n")
    unended = lines.pop()  # empty when the last line has its end
    layout = find_layout(source.name, lines, unended)
    time, energies, notes = _columns(source.name, layout, selection)
    used = (time, *energies)

    rows = lines[layout.start :]
    complete = True
    if not is_skipped(unended):
        if _is_whole(unended, rows, layout, used):
            rows.append(unended)
        else:
            complete = False
            notes.append("the last line has no line end and may be cut; it was left out")
    values = _fast_values(rows, layout, used)
    if values is None:
        values = _checked_values(source.name, rows, layout, used)
    keep, order_notes = states_that_count(source.name, values[:, 0])
    channel = " + ".join(layout.channel(column) for column in energies)
    fields = _sample(rows, layout)
    time_precision, energy_precision = printed.precisions(
        [row[time] for row in fields], [row[column] for row in fields for column in energies], values[:, 0]
    )
    return History(
        time=values[keep, 0],
        energy=values[keep, 1:].sum(axis=1),
        source=(source.name,),
        format="csv",
        channel=channel,
        time_unit=layout.unit(time),
        time_precision=time_precision,
        energy_precision=energy_precision,
        complete=complete,
        notes=(*notes, *order_notes, *quantity_note(channel)),
    )


def _text(source: Source) -> str:
    data = source.data
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


def _columns(name: str, layout: Layout, selection: Selection) -> tuple[int, list[int], list[str]]:
    """Columns of the time and the energies, and what had to be assumed."""
    notes = []
    if selection.time is not None:
        time = _named_column(name, layout, selection.time)
    else:
        times = [i for i, column in enumerate(layout.names[: layout.trusted]) if is_time(column)]
        if len(times) > 1:
            raise FormatError(
                f"{name}: {len(times)} columns are named like a time; choose with --time: {_menu(layout, times)}"
            )
        time = times[0] if times else 0
        if layout.names and not times:
            notes.append(f"no column is named like a time; {layout.name(0)!r}, the first, was taken for it")
    if selection.energy:
        energies = [_named_column(name, layout, wanted) for wanted in selection.energy]
    else:
        energies = [_internal_energy(name, layout, time)]
    if time in energies or len(set(energies)) < len(energies):
        raise FormatError(f"{name}: a column is asked for twice; name the time and each energy once")
    return time, energies, notes


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


def _fast_values(rows: Sequence[str], layout: Layout, used: Sequence[int]) -> Samples | None:
    """Values of a table without a flaw, all numbers and no blank lines; None for any other."""
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
    # Lines it passed over, or words it took for numbers, are looked at one by one.
    if table.shape != (len(rows), layout.columns) or not np.isfinite(table[:, used]).all():
        return None
    return table[:, used]


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
