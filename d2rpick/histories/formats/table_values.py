"""The numbers of a table in text: whole columns at once where all rows are alike, else line by line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.histories.formats.layout import as_number, is_skipped, split
from d2rpick.histories.names import is_time

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.formats.layout import Layout
    from d2rpick.histories.formats.text import Text
    from d2rpick.histories.history import Samples


def plain_values(text: Text, begin: int, layout: Layout, used: Sequence[int]) -> list[Samples] | None:
    """Columns ``used`` of the rows from byte ``begin`` on, each of shape (rows,).

    None unless each row has its number of cells and no line stands between them.
    """
    tables = []
    for piece in text.pieces(begin):
        values = _plain_piece(piece, layout, used)
        if values is None:
            return None
        tables.append(values)
    return [np.concatenate([table[:, place] for table in tables]) for place in range(len(used))] if tables else None


def _plain_piece(piece: bytes, layout: Layout, used: Sequence[int]) -> Samples | None:
    if layout.decimal == ",":
        if b"." in piece:
            return None
        piece = piece.replace(b",", b".")
    if piece.isspace() or b'"' in piece:
        return None  # numpy warns of the one, and a separator in quotes is none
    whole = piece.decode("latin-1")  # no other character than those of latin-1 belongs to a number
    taken, chosen = [*range(layout.columns)], None
    first = whole[: whole.index("\n")]
    if layout.separator and not (sorted(used) == taken and not first.endswith(layout.separator)):
        # otherwise numpy sees to it that each row has its cells
        rows = _separators(piece, layout)
        if rows is None:
            return None
        starts, marks = rows
        closed = marks.shape[1] == layout.columns
        taken = sorted({0, *used})  # a comment would show in the first column
        chosen = taken if closed or len(taken) < layout.columns else None
    if taken[-1] < layout.columns - 1:  # what follows is not taken apart
        lines = [whole[start:cut] for start, cut in zip(starts.tolist(), marks[:, taken[-1]].tolist(), strict=True)]
    else:
        lines = whole.split("\n")[:-1]
    try:
        table = np.loadtxt(lines, delimiter=layout.separator, comments=None, ndmin=2, usecols=chosen)
    except ValueError:
        return None
    if table.shape != (len(lines), len(taken)):
        return None  # it passes over blank lines
    return table if taken == [*used] else table[:, np.searchsorted(taken, used)]


def _separators(piece: bytes, layout: Layout) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Places of the rows (n,) and of their separators (n, k); None unless all rows have their number of cells."""
    assert layout.separator
    signs = np.frombuffer(piece, np.uint8)
    ends = signs == ord("\n")
    closed = piece.startswith(layout.separator.encode("latin-1"), piece.index(b"\n") - 1)  # rows end with a separator
    each, rows = layout.columns + closed, np.count_nonzero(ends)
    marks = np.flatnonzero(ends | (signs == ord(layout.separator)))
    if marks.size != rows * each:
        return None
    table = marks.reshape(rows, each)
    whole = np.all(ends[table[:, -1]]) and (not closed or np.all(np.diff(table[:, -2:]) == 1))
    return (np.append(0, table[:-1, -1] + 1), table[:, :-1]) if whole else None


def checked_values(text: Text, begin: int, layout: Layout, used: Sequence[int]) -> Samples:
    """Values line by line, with comments and blank lines between, shape (rows, len(used)).

    Where all cells are empty the curve has ended: another one beside it goes on.  FormatError with the line that is
    wrong.
    """
    from array import array  # not above: most tables are read in columns

    values = array("d")
    for _, state in _states(text, begin, layout, used):
        values.extend(state)
    return np.array(values).reshape(-1, len(used))


def line_of(text: Text, begin: int, layout: Layout, time: int, state: int) -> int:
    """Give the number of the line in which a state stands, counted from 0."""
    return next(number for i, (number, _) in enumerate(_states(text, begin, layout, [time])) if i == state)


def _states(text: Text, begin: int, layout: Layout, used: Sequence[int]) -> Iterator[tuple[int, list[float]]]:
    before: float | None = None
    gap = ended = False
    for number, row in enumerate(text.lines(begin), layout.start + 1):
        if is_skipped(row):
            gap = True
            continue
        cells = _cells(f"{text.name}:{number}", row, layout)
        if not any(cells[column] for column in used) and before is not None:
            ended = True
            continue
        state = [_value(f"{text.name}:{number}", layout, column, cells[column]) for column in used]
        if ended or (gap and before is not None and state[0] <= before):
            found = "a curve continues after empty cells" if ended else "the time starts again after a gap"
            raise FormatError(
                f"{text.name}:{number}: {found}, one curve was expected; repair it or put each curve into its own file"
            )
        gap, before = False, state[0]
        yield number, state


def _cells(where: str, row: str, layout: Layout) -> list[str]:
    cells = split(row, layout.separator)
    if len(cells) == layout.columns + 1 and not cells[-1]:
        cells.pop()
    if layout.names and is_time(cells[0]) and is_time(layout.names[0]):
        raise FormatError(f"{where}: a second header, another curve begins here; put each curve into its own file")
    if len(cells) != layout.columns:
        raise FormatError(
            f"{where}: {len(cells)} values, {layout.columns} were expected as in the other rows; repair the line"
        )
    return cells


def _value(where: str, layout: Layout, column: int, cell: str) -> float:
    value = as_number(cell, layout.decimal)
    if value is None or not np.isfinite(value):
        raise FormatError(
            f"{where}: {layout.name(column)!r} is {cell[:60]!r}, a number was expected; repair or delete the line"
        )
    return value
