"""Keep the record of a run that is being computed, to which each read appends states."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.histories.history import Given, History

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, Momenta, Precision

    Table = History | Momenta | Balance

# Number of rows for which a new column has room.
_FEWEST_ROWS: Final = 64
# Two states whose times differ by more than this many units of the last printed digit are different.
_APART: Final = 1.5
# Tolerance for values that are read twice, as a share of the largest value. A sum over parts may end in other digits.
# The energy of springs is left out of an energy only if springs have energy in the states that are read together.
_SAME: Final = 1e-9


class GrowingColumn:
    """An array that grows by rows and is copied only when its capacity doubles."""

    def __init__(self) -> None:
        self._room: NDArray[Any] = np.empty(0)
        self.size = 0

    def add(self, rows: NDArray[Any]) -> None:
        """Append ``rows`` of shape (k, ...)."""
        size = self.size + len(rows)
        if size > len(self._room):
            row_count = max(2 * size, _FEWEST_ROWS)
            longer = np.empty((row_count, *rows.shape[1:]), rows.dtype)
            longer[: self.size] = self.rows if self.size else 0
            self._room = longer
        self._room[self.size : size] = rows
        self.size = size

    @property
    def rows(self) -> NDArray[Any]:
        """All rows so far, as a view."""
        return self._room[: self.size]


class GrowingRecord:
    """All states of a run so far, as columns of three kinds of tables: history, momenta and balance."""

    def __init__(self) -> None:
        self._latest_tables: list[Table] = []
        self._columns: list[dict[str, GrowingColumn]] = []
        self._history: History | None = None

    def add(self, states: History) -> None:
        """Append states, which must have the same quantities as the states so far."""
        tables = list_tables(states)
        self._latest_tables = tables
        arrays = [_get_arrays(table) for table in tables]
        if not self._columns:
            self._columns = [
                {name: GrowingColumn() for name in table} for table in arrays
            ]
        for columns, table in zip(self._columns, arrays, strict=True):
            for name, rows in table.items():
                columns[name].add(rows)
        self._history = None

    @property
    def history(self) -> History:
        """All states as one history; at least one state must exist."""
        if self._history is None:
            tables: list[Any] = []
            for table, columns in zip(self._latest_tables, self._columns, strict=True):
                rows: dict[str, Any] = {
                    name: column.rows for name, column in columns.items()
                }
                tables.append(replace(table, **rows))
            self._history = _join_tables(tables)
        return self._history


def list_tables(history: History) -> list[Table]:
    """Return the history itself, each of its momenta, and its balance if there is one.

    The energies of single parts, many numbers that are not needed here, are left out.
    """
    tables: list[Table] = [replace(history, part_energies=None, part_names=())]
    tables += history.momenta
    if history.balance:
        tables.append(history.balance)
    return tables


def _join_tables(tables: Sequence[Any]) -> History:
    """Build a history from its tables, which are in the order of `list_tables`."""
    history, *evidence = tables
    momenta_count = len(history.momenta)
    momenta, balances = evidence[:momenta_count], evidence[momenta_count:]
    balance = balances[0] if balances else None
    written = Given(tuple(momenta), balance, history.masses)
    joined: History = replace(history, evidence=written)
    return joined


def hold_back_states(history: History) -> History:
    """Return a history without its last state, if a later state with the same printed time may still replace it."""
    first, *evidence = list_tables(history)
    settled: list[Any] = [_drop_unsettled(first, history.time_precision)]
    for table in evidence:
        assert not isinstance(table, History)
        settled.append(_drop_unsettled(table, table.precision))
    return _join_tables(settled)


def _drop_unsettled(table: Table, precision: Precision) -> Table:
    """Return a table without its last state if its last two times are as close as printed times can be."""
    quantum = precision.quantum(float(table.time[-1])) if table.time.size else 0.0
    if table.time.size < 2 or table.time[-1] - table.time[-2] > _APART * quantum:
        return table
    return _select_rows(table, slice(-1))


def find_last_states(history: History, before: Sequence[Table]) -> list[Table]:
    """Return the last state of each table of a history; for an empty table, the last state in the tables ``before``."""
    tables = list_tables(history)
    last_states: list[Any] = []
    for number, table in enumerate(tables):
        if table.time.size:
            last_states.append(_select_rows(table, slice(-1, None)))
        else:
            last_states.append(before[number] if before else table)
    return last_states


def skip_states(history: History, last_states: Sequence[Table]) -> History | None:
    """Return the states of a history after the known last states; None if the history does not contain these.

    ``last_states`` are those of `find_last_states`, one for each table; [] if none was known.
    """
    tables = list_tables(history)
    if not last_states or len(tables) != len(last_states):
        return None
    new_tables: list[Any] = []
    for table, last_state in zip(tables, last_states, strict=True):
        count = _count_known_states(table, last_state)
        if count is None:
            return None
        new_tables.append(_select_rows(table, slice(count, None)))
    return _join_tables(new_tables)


def _count_known_states(table: Table, last_state: Table) -> int | None:
    """Count the states of a table up to the last known state; None if the table does not contain that state."""
    arrays, last_values = _get_arrays(table), _get_arrays(last_state)
    if arrays.keys() != last_values.keys():
        return None
    if not last_state.time.size:
        return 0
    count = int(np.searchsorted(table.time, last_state.time[0], side="right"))
    if not count:
        return None
    for name, rows in arrays.items():
        largest = float(np.max(np.nan_to_num(np.abs(rows)), initial=0.0))
        is_same = np.isclose(
            rows[count - 1],
            last_values[name][0],
            rtol=0,
            atol=_SAME * largest,
            equal_nan=True,
        )
        if not np.all(is_same):
            return None
    return count


def find_momenta(history: History, *, of_parts: bool) -> Momenta | None:
    """Return the momenta of the parts, or of the whole model; None if they are not written."""
    for momenta in history.momenta:
        if (momenta.parts is not None) is of_parts:
            return momenta
    return None


def _select_rows(table: Table, rows: slice) -> Table:
    """Return a table with some of its rows."""
    selected: dict[str, Any] = {
        name: values[rows] for name, values in _get_arrays(table).items()
    }
    return replace(table, **selected)


def _get_arrays(table: Table) -> dict[str, NDArray[Any]]:
    """Return the arrays of a table with one row for each of its times, by name."""
    names = [field.name for field in fields(table) if field.init]
    values = {name: getattr(table, name) for name in names if name != "masses"}
    size = table.time.size
    return {
        name: value
        for name, value in values.items()
        if isinstance(value, np.ndarray) and len(value) == size
    }
