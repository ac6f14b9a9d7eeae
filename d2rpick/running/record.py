"""Keep the record of a run that is being computed; each read appends states to the record."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.histories.history import (
    Given,
    History,
    Momenta,
    list_columns,
    select_states,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance

    Table = History | Momenta | Balance

# Smallest time difference between two states, in units of the last printed digit [-].
_APART: Final = 1.5
# Tolerance for a value that is read twice, relative to the largest value [-], because sums over parts are rounded.
_SAME: Final = 1e-9


class GrowingColumn:
    """An array to which ``rows`` can be appended. It is copied only when its capacity is doubled."""

    def __init__(self) -> None:
        self.rows: NDArray[Any] = np.empty(0)
        self._room = self.rows

    def add(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Append ``rows`` of shape (k, ...), and return all rows so far as a view."""
        first = len(self.rows)
        size = first + len(rows)
        shape = rows.shape[1:]
        if size > len(self._room):
            self._room = np.empty((2 * size, *shape), rows.dtype)
            self._room[:first] = self.rows.reshape(first, *shape)
        self._room[first:size] = rows
        self.rows = self._room[:size]
        return self.rows


class RunningMaximum:
    """The largest of all values so far. Limits based on it at a state do not depend on later states."""

    def __init__(self) -> None:
        self._last: NDArray[Any] | None = None

    def add(self, values: NDArray[Any]) -> NDArray[Any]:
        """Append values (k, ...), and return the largest value so far at each of them."""
        if self._last is None:
            maxima = np.maximum.accumulate(values, axis=0)
        else:
            all_values = np.concatenate([self._last, values])
            maxima = np.maximum.accumulate(all_values, axis=0)[1:]
        if len(values):
            self._last = maxima[-1:]
        return maxima


class GrowingRecord:
    """All states of a run so far, as columns of three kinds of tables: history, momenta and balance."""

    def __init__(self) -> None:
        # Columns, keyed by table number and column name.
        self._columns: dict[tuple[int, str], GrowingColumn] = {}
        self.history: History | None = None

    def extend(self, states: History) -> History | None:
        """Append those ``states`` that follow the last known state, and return them; None if that state is missing."""
        tables = _list_tables(states)
        known_tables: list[Any] = [None] * len(tables)
        if self.history:
            known_tables = _list_tables(self.history)
        if len(tables) != len(known_tables):
            return None
        selected_tables = map(_select_new_states, tables, known_tables)
        new_tables = [table for table in selected_tables if table is not None]
        if len(new_tables) < len(tables):
            return None
        whole_tables = []
        for number, table in enumerate(new_tables):
            columns: dict[str, Any] = {}
            for name, rows in list_columns(table).items():
                column = self._columns.setdefault((number, name), GrowingColumn())
                columns[name] = column.add(rows)
            whole_tables.append(replace(table, **columns))
        self.history = _join_tables(whole_tables)
        return _join_tables(new_tables)


def _list_tables(history: History) -> list[Table]:
    """Return the history itself, each of its momenta, and its energy balance if it has one."""
    tables: list[Table] = [history, *history.momenta]
    if history.balance:
        tables.append(history.balance)
    return tables


def _join_tables(tables: Sequence[Any]) -> History:
    """Build a history from its tables, which are in the order of `_list_tables`."""
    history, *momenta = tables
    balance = momenta.pop() if history.balance else None
    written = Given(tuple(momenta), balance, history.masses)
    joined: History = replace(history, evidence=written)
    return joined


def _select_new_states(table: Table, known_table: Table | None) -> Table | None:
    """Return the states of a table after the last known one; None if the table lacks that state or has changed it.

    The last state is omitted if a later state with the same printed time may still replace it.
    """
    new_states = slice(0, table.time.size - _is_unsettled(table))
    if known_table is None or not known_table.time.size:
        return select_states(table, new_states)
    count = int(np.searchsorted(table.time, known_table.time[-1], side="right"))
    columns = list_columns(table)
    known_columns = list_columns(known_table)
    if count == 0 or columns.keys() != known_columns.keys():
        return None
    for name, rows in columns.items():
        tolerance = _SAME * float(np.nanmax(np.abs(rows), initial=0.0))
        change = np.abs(rows[count - 1] - known_columns[name][-1])
        if np.any(change > tolerance):
            return None
    selected = select_states(table, slice(count, new_states.stop))
    if isinstance(selected, Momenta) and isinstance(known_table, Momenta):
        # A mass that is not written is a lower bound determined from the states that were read.
        masses = [selected.masses, known_table.masses]
        known_masses = [values for values in masses if values is not None]
        if known_masses:
            return replace(selected, masses=np.fmax.reduce(known_masses))
    return selected


def _is_unsettled(table: Table) -> bool:
    """Return True if the last two times of a table are as close together as printed times can be."""
    if isinstance(table, History):
        precision = table.time_precision
    else:
        precision = table.precision
    last_step = np.diff(table.time[-2:])
    last_digit = precision.quanta(table.time[-1:])
    return any(last_step <= _APART * last_digit)
