"""Read the lines above the rows of a table: column names and units, and the title of a curve."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import FormatError, list_names
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.cells import is_skipped, split_cells
from d2rpick.histories.meaning import is_time
from d2rpick.histories.names import is_unit, normalise_name

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

_SHORT: Final = 60  # Largest number of characters of a line quoted in a message.
# First columns that every version of OpenRadioss' th_to_csv writes.
# In some versions of th_to_csv, the numbers of names and columns differ (OpenRadioss/Tools, issue 98).
_TH_TO_CSV: Final = (
    *(
        "time",
        "internalenergy",
        "kineticenergy",
        "xmomentum",
        "ymomentum",
        "zmomentum",
        "mass",
        "timestep",
    ),
    *(
        "rotationenergy",
        "externalwork",
        "springenergy",
        "contactenergy",
        "hourglassenergy",
    ),
)
# Number of columns that are used (time and first value) if another program writes more names than columns.
_SURE_WITHOUT: Final = 2


class Header(NamedTuple):
    """Column names and units, if the file contains them. Only the first ``sure`` names are certain."""

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    title: str = ""
    sure: int | None = None


def read_header(
    where: str, lines: Sequence[str], separator: str | None, columns: int
) -> Header:
    """Read the lines above the rows of a table that has the given number of ``columns``.

    Parameters
    ----------
    where : str
        File and line of the first row, for messages.
    lines : sequence of str
        All lines above the first row.
    separator : str or None
        Character between the cells; None stands for spaces.
    columns : int
        Number of values in each row.

    Raises
    ------
    FormatError
        If the names do not belong to the columns of the rows.
    """
    rows = list(_split_rows(lines, separator, columns))
    units: tuple[str, ...] = ()
    if len(rows) > 1 and len(rows[-1]) == columns and all(map(is_unit, rows[-1])):
        units = tuple(rows.pop())
    if not rows:
        return Header(_find_commented_names(lines, separator, columns), units)
    if composed := _join_rows_of_names(rows, columns):
        return Header(tuple(composed), units)
    names = rows[-1]
    title = ""
    if len(names) > 1 and not names[-1]:
        names = names[:-1]
        # LS-PrePost writes a line of titles above the line "Time," or "Time,A8874,".
        if len(rows) > 1:
            title = next((cell for cell in reversed(rows[-2]) if cell), "")
    if columns == 2 and len(names) == 1 and is_time(names[0]):
        names = [names[0], title]
        title = ""
    if len(names) == 1:
        return Header(units=units, title=names[0])
    sure = _count_sure(where, names, columns)
    if columns == 2 < len(names):
        # In files from 3DEXPERIENCE, the third name is the curve name.
        title = " ".join(filter(None, names[2:]))
        sure = None
    return Header(tuple(names), units, title, sure)


def quote_start(line: str) -> str:
    """Quote the start of a line for a message."""
    line = line.strip()
    return repr(line if len(line) <= _SHORT else line[:_SHORT] + "...")


def _count_sure(where: str, names: Sequence[str], columns: int) -> int | None:
    """Return how many columns have a certain name (None: all of them); raise FormatError if no name is certain."""
    if len(names) == columns:
        return None
    if tuple(map(normalise_name, names[: len(_TH_TO_CSV)])) == _TH_TO_CSV[:columns]:
        return min(len(_TH_TO_CSV), columns)
    if len(names) < columns or not is_time(names[0]):
        raise FormatError(
            f"{where}: {columns} values below a header of {len(names)} names "
            f"({list_names(names)}), expected as many of both; correct the header or delete it"
        )
    return _SURE_WITHOUT


def _join_rows_of_names(rows: Sequence[Sequence[str]], columns: int) -> list[str]:
    """Join rows of names, from the last row upwards, until all names differ. Return an empty list if one row suffices.

    Examples
    --------
    >>> _join_rows_of_names([["Run 12", ""], ["Time", "Energy", "Energy"], ["", "internal", "kinetic"]], 3)
    ['Time', 'Energy internal', 'Energy kinetic']
    """
    names: list[str] = []
    for level in reversed(rows):
        cells = _fit(level, columns)
        if not cells:
            return []
        upper = _fill_from_left(cells) if names else cells
        names = [
            _join_names(*pair)
            for pair in zip(upper, names or [""] * columns, strict=True)
        ]
        if all(names) and len({*names}) == columns:
            return names if names != cells else []
    return []


def _join_names(upper: str, lower: str) -> str:
    """Join the names of a column from two rows, unless the column is the time."""
    return lower if is_time(lower) else f"{upper} {lower}".strip()


def _fit(cells: Sequence[str], columns: int) -> list[str]:
    """Return one name per column, without trailing empty cells; empty if there are too few or too many names."""
    if len(cells) < columns or any(cells[columns:]) or (columns == 2 and not cells[-1]):
        return []
    return list(cells[:columns])


def _fill_from_left(cells: Sequence[str]) -> list[str]:
    """Copy each name, except that of a time column, into the empty cells that follow it (merged spreadsheet cells)."""
    filled = [cells[0]]
    for cell in cells[1:]:
        filled.append(cell or (filled[-1] if len(filled) > 1 else ""))
    return filled


def _split_rows(
    lines: Sequence[str], separator: str | None, columns: int
) -> Iterator[list[str]]:
    """Yield the cells of each header line; a quoted name may contain a line break."""
    pending = ""
    for line in lines:
        if not pending and is_skipped(line):
            continue
        pending = f"{pending} {line}" if pending else line
        if pending.count('"') % 2 == 0:
            yield _split_header(pending, separator, columns)
            pending = ""
    if pending:
        yield _split_header(pending, separator, columns)


def _split_header(line: str, separator: str | None, columns: int) -> list[str]:
    """Split a header line into names, which may contain single spaces; treat any other line as one title."""
    if separator is not None:
        return split_cells(line, separator)
    wide = [cell.strip('"') for cell in re.split(r"\s{2,}|\t", line.strip())]
    narrow = split_cells(line, None)
    return next(
        (cells for cells in (wide, narrow) if len(cells) == columns), [line.strip()]
    )


def _find_commented_names(
    lines: Sequence[str], separator: str | None, columns: int
) -> tuple[str, ...]:
    """Return the names in the last comment line, as numpy.savetxt writes it, if they name all columns and a time."""
    comments = [line.strip().lstrip("#$%/ ") for line in lines if line.strip()]
    cells = _split_header(comments[-1], separator, columns) if comments else []
    return tuple(cells) if len(cells) == columns and any(map(is_time, cells)) else ()
