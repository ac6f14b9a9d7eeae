"""The numbers in the rows of a table: all at once where they are alike, line by line where they are not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.cells import is_skipped, split
from d2rpick.histories.formats.header import shorten
from d2rpick.histories.formats.plain_rows import plain_rows
from d2rpick.histories.meaning import is_time

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.formats.layout import Layout
    from d2rpick.histories.formats.text import Text
    from d2rpick.histories.history import Samples


class ReadColumns(NamedTuple):
    """Columns (rows,) of a table, in the order they were asked for, and notes on what stands below it."""

    columns: list[Samples]
    notes: tuple[str, ...]


def read_columns(
    text: Text, begin: int, layout: Layout, used: Sequence[int]
) -> ReadColumns:
    """Read the columns ``used`` of the rows from byte ``begin`` on, that of the times first.

    Between the rows may be comments and blank lines, behind them words, such as a total, and the same table again.
    Where all cells are empty the curve has ended: another one beside it goes on.

    Raises
    ------
    FormatError
        With the line that is wrong.
    """
    curve = _Curve(text.name, layout, used)
    tables = [table for _, table in _read_tables(text, begin, curve)] or [
        np.empty((0, len(used)))
    ]
    return ReadColumns(
        [
            np.concatenate([table[:, place] for table in tables])
            for place in range(len(used))
        ],
        curve.notes,
    )


def find_line(text: Text, begin: int, layout: Layout, time: int, state: int) -> int:
    """Return the number of the line in which a state stands, counted from 0."""
    for numbers, _ in _read_tables(text, begin, _Curve(text.name, layout, [time])):
        if state < len(numbers):
            return numbers[state]
        state -= len(numbers)
    raise AssertionError("there is such a state")


def _read_tables(
    text: Text, begin: int, curve: _Curve
) -> Iterator[tuple[Sequence[int], Samples]]:
    """Numbers of lines and their values piece by piece: line by line only where they are not all alike."""
    number = curve.layout.start + 1
    for piece in text.pieces(begin, large=text.is_large):
        table = plain_rows(piece, curve.layout, curve.used, is_large=text.is_large)
        if (
            table is not None
            and np.isfinite(table).all()
            and not curve.stops_before(float(table[0, 0]))
        ):
            rows = len(table)
            yield range(number, number + rows), table
            curve.add(table)
        else:
            rows = piece.count(b"\n")
            states = list(curve.states(text.rows(piece), number))
            if states:
                table = np.array([state for _, state in states])
                yield [line for line, _ in states], table
                curve.keep_piece()
        number += rows


class _Below(NamedTuple):
    """The first line below a table that is no row: its number, and what is wrong with it between rows."""

    line: int
    text: str
    error: FormatError


class _Curve:
    """What of a table was seen so far, where it is taken line by line."""

    def __init__(self, name: str, layout: Layout, used: Sequence[int]) -> None:
        self.layout, self.used = layout, used
        self._name = name
        self._before: float | None = None  # time of the last state
        self._gap = self._ended = False
        self._read: list[Samples] = []  # states of the pieces before
        self._current: list[list[float]] = []  # states of this piece so far
        self._below: _Below | None = None
        self._repeated = 0  # states of the table that stand once more below it
        self._repeated_from = 0  # the line in which the first of them stands

    @property
    def notes(self) -> tuple[str, ...]:
        """What was left out below the table."""
        if self._below is None:
            return ()
        found = f"line {self._below.line} ({shorten(self._below.text)}) and what follows are below the table"
        if self._repeated:
            return (
                f"{found}, with the same table again from line {self._repeated_from} on; they were left out",
            )
        return (f"{found} and were left out",)

    def add(self, table: Samples) -> None:
        """Remember states (rows, used) that were read together."""
        self._read.append(table)
        self._gap, self._before = False, float(table[-1, 0])

    def keep_piece(self) -> None:
        """Remember the states of a piece that was read line by line."""
        if self._current:
            self._read.append(np.array(self._current))
            self._current.clear()

    def stops_before(self, time: float) -> bool:
        """Whether a state of this time is one of another curve, or stands below the table."""
        starts_again = self._gap and self._before is not None and time <= self._before
        return self._ended or starts_again or self._below is not None

    def states(
        self, rows: Sequence[str], first: int
    ) -> Iterator[tuple[int, list[float]]]:
        """Give line and values of each state in rows of which ``first`` is the number of the first."""
        for number, row in enumerate(rows, first):
            if is_skipped(row):
                self._gap = True
                continue
            try:
                state = self._read_state(number, row)
            except FormatError as error:
                if not self._is_below(row):
                    raise
                self._below = self._below or _Below(number, row, error)
                continue
            if state is None:
                self._ended = True
            elif self._below is not None:
                self._check_repeated(number, state)
            else:
                self._check_goes_on(number, state[0])
                self._gap, self._before = False, state[0]
                self._current.append(state)
                yield number, state

    def _read_state(self, number: int, row: str) -> list[float] | None:
        """Return the values of a row; None if all its cells are empty behind other rows."""
        where = f"{self._name}:{number}"
        cells = _cells(where, row, self.layout)
        if not any(cells[column] for column in self.used) and self._before is not None:
            return None
        return [
            _value(where, self.layout, column, cells[column]) for column in self.used
        ]

    def _is_below(self, row: str) -> bool:
        """Return True if a line that is no row may stand below the table: it begins with a word, and has no time."""
        cells = split(row, self.layout.separator)
        time = cells[self.used[0]] if len(cells) > self.used[0] else ""
        return (
            self._before is not None
            and cells[0][:1].isalpha()
            and self.layout.number(time) is None
        )

    def _check_goes_on(self, number: int, time: float) -> None:
        if self.stops_before(time):
            found = (
                "a curve continues after empty cells"
                if self._ended
                else "the time starts again after a gap"
            )
            what = f"{self._name}:{number}: {found}, one curve was expected"
            raise FormatError(f"{what}; repair it or put each curve into its own file")

    def _check_repeated(self, number: int, state: Sequence[float]) -> None:
        """Raise FormatError unless a row below the table is the next one of the same table once more."""
        self.keep_piece()
        if len(self._read) > 1:
            self._read = [np.concatenate(self._read)]
        table, below = self._read[0], self._below
        assert below is not None  # a line below the table comes first
        is_first = np.array_equal(table[0], state)
        place = 0 if is_first else self._repeated
        if (
            place < len(table)
            and (place or is_first)
            and np.array_equal(table[place], state)
        ):
            self._repeated_from = self._repeated_from or number
            self._repeated = place + 1
            return
        is_header = is_time(split(below.text, self.layout.separator)[0])
        if is_header or state[0] > float(
            table[-1, 0]
        ):  # if the table goes on, the line between is damaged
            raise below.error
        found = f"{self._name}:{number}: another table begins here, behind line {below.line} ({shorten(below.text)})"
        raise FormatError(f"{found}; one was expected; put each into its own file")


def _cells(where: str, row: str, layout: Layout) -> list[str]:
    cells = split(row, layout.separator)
    if len(cells) == layout.columns + 1 and not cells[-1]:
        cells.pop()
    if layout.names and is_time(cells[0]) and is_time(layout.names[0]):
        raise FormatError(
            f"{where}: a second header, another curve begins here; put each curve into its own file"
        )
    if len(cells) != layout.columns:
        found = "1 value" if len(cells) == 1 else f"{len(cells)} values"
        raise FormatError(
            f"{where}: {found}, {layout.columns} were expected as in the other rows; repair the line"
        )
    return cells


def _value(where: str, layout: Layout, column: int, cell: str) -> float:
    value = layout.number(cell)
    if value is None or not np.isfinite(value):
        found = (
            f"{where}: {layout.name(column)!r} is {cell[:60]!r}, a number was expected"
        )
        raise FormatError(f"{found}; repair or delete the line")
    return value
