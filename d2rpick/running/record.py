"""Keep the record of a run that is being computed; each read appends states to the record."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.histories.history import Given, History, list_columns, select_states

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, Momenta

    Table = History | Momenta | Balance

# Number of rows for which a new column reserves memory.
_FEWEST_ROWS: Final = 64
# Smallest time difference of two different states, in units of the last printed digit [-].
_APART: Final = 1.5
# Tolerance for a value that is read twice, as a fraction of the largest value [-]; sums over parts may be rounded.
_SAME: Final = 1e-9


class GrowingColumn:
    """An array to which rows are appended; it is copied only when its capacity is doubled."""

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


class RunningMaximum:
    """The largest of all values so far, used for limits at a state that must not depend on later states."""

    def __init__(self) -> None:
        self._last: NDArray[Any] | None = None

    def add(self, values: NDArray[Any]) -> NDArray[Any]:
        """Append values (k, ...), and return the largest value so far at each of them."""
        before = values[:0] if self._last is None else self._last
        maxima = np.maximum.accumulate(np.concatenate([before, values]), axis=0)
        self._last = maxima[-1:]
        return maxima[len(before) :]


class GrowingRecord:
    """All states of a run so far, as columns of three kinds of tables: history, momenta and balance."""

    def __init__(self) -> None:
        self._latest_tables: list[Table] = []
        # Columns, keyed by the number of their table and by their name.
        self._columns: dict[tuple[int, str], GrowingColumn] = {}
        self._history: History | None = None

    def add(self, states: History) -> None:
        """Append states, which must have the same quantities as the states so far."""
        self._latest_tables = _list_tables(states)
        for number, table in enumerate(self._latest_tables):
            for name, rows in list_columns(table).items():
                self._columns.setdefault((number, name), GrowingColumn()).add(rows)
        self._history = None

    @property
    def history(self) -> History:
        """All states as one history; at least one state must exist."""
        if self._history is None:
            columns: list[dict[str, Any]] = [{} for _ in self._latest_tables]
            for (number, name), column in self._columns.items():
                columns[number][name] = column.rows
            pairs = zip(self._latest_tables, columns, strict=True)
            self._history = _join_tables(
                [replace(table, **rows) for table, rows in pairs]
            )
        return self._history


def _list_tables(history: History) -> list[Table]:
    """Return the history itself, each of its momenta, and its balance if it has one."""
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


def hold_back_states(history: History) -> History:
    """Remove the last state of a history, if a later state with the same printed time may still replace it."""
    return _join_tables([_drop_unsettled(table) for table in _list_tables(history)])


def _drop_unsettled(table: Table) -> Table:
    """Remove the last state of a table if its last two times are as close as printed times can be."""
    if isinstance(table, History):
        precision = table.time_precision
    else:
        precision = table.precision
    last_times = table.time[-2:].tolist()
    quantum = precision.quantum(last_times[-1]) if last_times else 0.0
    if len(last_times) < 2 or last_times[1] - last_times[0] > _APART * quantum:
        return table
    return select_states(table, slice(-1))


def find_last_states(history: History, before: Sequence[Table]) -> list[Table]:
    """Return the last state of each table of a history; for an empty table, the last state of that table ``before``."""
    last_states: list[Table] = []
    tables = _list_tables(history)
    for table, last_state in zip(tables, before or tables, strict=True):
        latest = table if table.time.size else last_state
        last_states.append(select_states(latest, slice(-1, None)))
    return last_states


def skip_states(history: History, last_states: Sequence[Table]) -> History | None:
    """Return the states of a history after the known last states; None if the history does not contain these.

    ``last_states`` are those of `find_last_states`, one for each table; [] if none was known.
    """
    tables = _list_tables(history)
    if len(tables) != len(last_states):
        return None
    new_tables: list[Table] = []
    for table, last_state in zip(tables, last_states, strict=True):
        last_time = last_state.time.max(initial=-np.inf)
        count = int(np.searchsorted(table.time, last_time, side="right"))
        if last_state.time.size and not _contains(table, count - 1, last_state):
            return None
        new_tables.append(select_states(table, slice(count, None)))
    return _join_tables(new_tables)


def _contains(table: Table, state: int, last_state: Table) -> bool:
    """Return True if a state of a table has the values of the last known state; ``state`` may be -1 for no state."""
    columns, last_values = list_columns(table), list_columns(last_state)
    if state < 0 or columns.keys() != last_values.keys():
        return False
    for name, rows in columns.items():
        tolerance = _SAME * float(np.nanmax(np.abs(rows), initial=0.0))
        value, last_value = rows[state], last_values[name][0]
        if not np.allclose(value, last_value, rtol=0, atol=tolerance, equal_nan=True):
            return False
    return True
