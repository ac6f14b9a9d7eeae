"""Read the numbers in the rows of a table. Uniform rows are read in large blocks, other rows line by line."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.errors import DamageError, FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.formats.cells import is_missing, is_skipped, split_cells
from d2rpick.histories.formats.header import quote_start
from d2rpick.histories.formats.plain_rows import read_plain_rows
from d2rpick.histories.meaning import is_time

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.formats.layout import Layout
    from d2rpick.histories.formats.text import Text
    from d2rpick.histories.history import Samples


class ReadColumns(NamedTuple):
    """Columns (rows,) of a table in the requested order, and notes on lines below the table that were ignored."""

    columns: list[Samples]
    notes: tuple[str, ...]


def read_columns(
    text: Text, begin: int, layout: Layout, used: Sequence[int]
) -> ReadColumns:
    """Read the columns ``used`` of the rows from byte ``begin`` on; the first of these columns is the time.

    There may be comments and blank lines between the rows, and below them words (such as a total) and the same table
    again. A row whose used cells are all empty ends the curve, although a longer curve beside it may continue.

    Raises
    ------
    FormatError
        If a line is wrong; the message names the line.
    """
    curve = _Curve(text.name, layout, used)
    tables = [table for _, table in _read_tables(text, begin, curve)] or [
        np.empty((0, len(used)))
    ]
    return ReadColumns(
        [
            np.concatenate([table[:, column] for table in tables])
            for column in range(len(used))
        ],
        curve.notes,
    )


def find_line(
    text: Text, begin: int, layout: Layout, time_column: int, state: int
) -> int:
    """Return the line number of a state. States are counted from 0, lines from 1."""
    for numbers, _ in _read_tables(
        text, begin, _Curve(text.name, layout, [time_column])
    ):
        if state < len(numbers):
            return numbers[state]
        state -= len(numbers)
    raise AssertionError("the table has this state")


def _read_tables(
    text: Text, begin: int, curve: _Curve
) -> Iterator[tuple[Sequence[int], Samples]]:
    """Yield the line numbers and values (rows, used) of each block of rows; irregular rows are read line by line."""
    number = curve.layout.start + 1
    for piece in text.pieces(begin, large=text.is_large):
        table = read_plain_rows(piece, curve.layout, curve.used, is_large=text.is_large)
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
    """The first line below the table that is not a row: its number, its text, and the error to raise if rows follow."""

    line: int
    text: str
    error: FormatError


class _Curve:
    """State of the table reader: the states and the lines below the table that have been read."""

    def __init__(self, name: str, layout: Layout, used: Sequence[int]) -> None:
        self.layout, self.used = layout, used
        self._name = name
        self._before: float | None = None  # Time of the last state [time].
        self._gap = self._ended = False
        # States of the earlier blocks of rows, one array per block.
        self._read: list[Samples] = []
        # States read so far from the current block of rows.
        self._current: list[list[float]] = []
        self._below: _Below | None = None
        # Number of states of the table that are repeated below it.
        self._repeated = 0
        # Line number of the first state that is repeated below the table.
        self._repeated_from = 0

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on lines below the table that were ignored."""
        if self._below is None:
            return ()
        start = quote_start(self._below.text)
        omitted = f"line {self._below.line} ({start}) and the lines after it are below the table"
        if self._repeated:
            repeated = f"the same table is repeated from line {self._repeated_from} on"
            return (f"{omitted}; {repeated}; they were left out",)
        return (f"{omitted} and were left out",)

    def add(self, table: Samples) -> None:
        """Store the states (rows, used) of a block of rows that was read in one step."""
        self._read.append(table)
        self._gap, self._before = False, float(table[-1, 0])

    def keep_piece(self) -> None:
        """Store the states of a block of rows that was read line by line."""
        if self._current:
            self._read.append(np.array(self._current))
            self._current.clear()

    def stops_before(self, time: float) -> bool:
        """Return True if the state at this time belongs to another curve or lies below the table."""
        starts_again = self._gap and self._before is not None and time <= self._before
        return self._ended or starts_again or self._below is not None

    def states(
        self, rows: Sequence[str], first: int
    ) -> Iterator[tuple[int, list[float]]]:
        """Yield the line number and values of each state in ``rows``; ``first`` is the line number of the first row."""
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
        """Return the values of the used columns in a row; None if they are all empty and the row is not the first."""
        where = f"{self._name}:{number}"
        cells = _split_row(where, row, self.layout)
        if not any(cells[column] for column in self.used) and self._before is not None:
            return None
        return [
            _parse_value(where, self.layout, column, cells[column])
            for column in self.used
        ]

    def _is_below(self, row: str) -> bool:
        """Return True if a line is not a row, begins with a word and has no time, like the lines below a table."""
        cells = split_cells(row, self.layout.separator)
        time = cells[self.used[0]] if len(cells) > self.used[0] else ""
        return (
            self._before is not None
            and cells[0][:1].isalpha()
            and self.layout.number(time) is None
        )

    def _check_goes_on(self, number: int, time: float) -> None:
        """Raise FormatError if the state at this time does not continue the curve."""
        if self.stops_before(time):
            interruption = "the time starts again after a gap"
            if self._ended:
                interruption = "a curve continues after empty cells"
            problem = (
                f"{self._name}:{number}: {interruption}, but one curve was expected"
            )
            raise FormatError(
                f"{problem}; repair the line or put each curve into its own file"
            )

    def _check_repeated(self, number: int, state: Sequence[float]) -> None:
        """Raise FormatError unless the rows below a table repeat rows of the table in the same order."""
        self.keep_piece()
        if len(self._read) > 1:
            self._read = [np.concatenate(self._read)]
        table = self._read[0]
        below = self._below
        assert below is not None  # A line below the table precedes this row.
        is_first = np.array_equal(table[0], state)
        position = 0 if is_first else self._repeated
        is_started = position > 0 or is_first
        if (
            is_started
            and position < len(table)
            and np.array_equal(table[position], state)
        ):
            self._repeated_from = self._repeated_from or number
            self._repeated = position + 1
            return
        is_header = is_time(split_cells(below.text, self.layout.separator)[0])
        continues = state[0] > float(table[-1, 0])
        # The table continues, so the line in between is damaged.
        if is_header or continues:
            raise below.error
        problem = (
            f"{self._name}:{number}: another table begins here, after line {below.line} "
            f"({quote_start(below.text)}); one table was expected"
        )
        raise FormatError(f"{problem}; put each table into its own file")


def _split_row(where: str, row: str, layout: Layout) -> list[str]:
    """Split a row into its cells; raise FormatError for a second header or a wrong number of cells."""
    cells = split_cells(row, layout.separator)
    if len(cells) == layout.columns + 1 and not cells[-1]:
        cells.pop()
    if layout.names and is_time(cells[0]) and is_time(layout.names[0]):
        raise FormatError(
            f"{where}: a second header, another curve begins here; put each curve into its own file"
        )
    if len(cells) != layout.columns:
        count = "1 value" if len(cells) == 1 else f"{len(cells)} values"
        raise FormatError(
            f"{where}: {count}, but {layout.columns} were expected as in the other rows; repair the line"
        )
    return cells


def _parse_value(where: str, layout: Layout, column: int, cell: str) -> float:
    """Return the finite number in a cell; raise FormatError for a missing number, DamageError for other content."""
    value = layout.number(cell)
    if value is None or not np.isfinite(value):
        problem = f"{where}: {layout.name(column)!r} is {cell[:60]!r}, but a number was expected"
        kind = FormatError if is_missing(cell) else DamageError
        raise kind(f"{problem}; repair or delete the line")
    return value
