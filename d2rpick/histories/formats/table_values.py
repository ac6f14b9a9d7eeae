"""Numbers in the rows of a table: all at once where they are alike, line by line where they are not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.histories.formats.layout import Layout, as_number, is_skipped, split
from d2rpick.histories.names import is_time

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.formats.text import Text
    from d2rpick.histories.history import Samples

    Cuts = tuple[NDArray[np.intp], NDArray[np.intp]]  # from where to where rows are looked at


def _plain_piece(text: Text, piece: bytes, layout: Layout, used: Sequence[int]) -> Samples | None:
    """Columns of a piece, shape (rows, len(used)); None unless all rows have all cells and no line is between them."""
    if layout.decimal == ",":
        if b"." in piece:
            return None
        piece = piece.replace(b",", b".")
    if b'"' in piece:
        return None  # a separator in quotes is none
    taken, chosen, cuts = [*range(layout.columns)], None, None
    closed = piece[: piece.index(b"\n")].endswith((layout.separator or "\n").encode("latin-1"))
    if layout.separator and (closed or sorted(used) != taken):
        # otherwise the parser sees to it that each row has its cells
        rows = _separators(piece, layout)
        if rows is None:
            return None
        starts, marks = rows
        taken = sorted({0, *used})  # a comment would show in the first column
        chosen = taken if closed or len(taken) < layout.columns else None
        if taken[-1] < layout.columns - 1:  # what follows is not taken apart
            cuts = starts, marks[:, taken[-1]]
    try:
        # to import pandas pays in large texts alone
        table = _by_pandas(piece, layout, chosen) if text.is_large else _by_numpy(piece, layout, chosen, cuts)
    except ValueError:
        return None
    lines = np.count_nonzero(np.frombuffer(piece, np.uint8) == ord("\n"))  # count() is slow where they are short
    if table.shape != (lines, len(taken)):
        return None  # blank lines were passed over
    return table if taken == [*used] else table[:, np.searchsorted(taken, used)]


def _by_numpy(piece: bytes, layout: Layout, columns: Sequence[int] | None, cuts: Cuts | None) -> Samples:
    """Columns of rows of numbers, all unless some are chosen; ValueError where there is something else."""
    whole = piece.decode("latin-1")  # no other character than those of latin-1 belongs to a number
    if cuts:
        lines = [whole[start:cut] for start, cut in zip(*(places.tolist() for places in cuts), strict=True)]
    else:
        lines = whole.split("\n")[:-1]
    if not lines[0].strip():
        raise ValueError  # numpy passes over it, and warns where there is no other
    return np.loadtxt(lines, delimiter=layout.separator, comments=None, ndmin=2, usecols=columns)


def _by_pandas(piece: bytes, layout: Layout, columns: Sequence[int] | None) -> Samples:
    """The same, five times as fast."""
    from csv import QUOTE_NONE
    from io import BytesIO

    import pandas as pd

    options: dict[str, Any] = {"header": None, "usecols": columns, "dtype": np.float64, "quoting": QUOTE_NONE}
    options |= {"low_memory": False, "skip_blank_lines": False, "na_filter": False}
    if [*map(int, pd.__version__.split(".")[:2])] < [3, 1]:  # from there on always exact, as `float` is
        options["float_precision"] = "round_trip"
    table: Samples = pd.read_csv(BytesIO(piece), sep=layout.separator or r"\s+", **options).to_numpy()
    return table


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
        table = _plain_piece(text, piece, layout, used)
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
