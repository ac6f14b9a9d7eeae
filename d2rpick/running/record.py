"""The record of a run that is being computed: every look appends states to it."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.errors import HistoryError
from d2rpick.histories.history import Given

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, History, Momenta

    Table = History | Momenta | Balance

# Rows for which a column has room from the start.
_FEWEST_ROWS: Final = 64


class Column:
    """An array that grows by rows and is copied only when its room doubles."""

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
    """All states of a run so far, as columns of three kinds of tables: the history, its momenta and its balance."""

    def __init__(self) -> None:
        self._latest_tables: list[Table] = []
        self._columns: list[dict[str, Column]] = []
        self._history: History | None = None

    def add(self, states: History) -> None:
        """Append states; HistoryError if they have other quantities than the states so far."""
        # The energies of single parts are many numbers that are not needed here.
        tables: list[Table] = [replace(states, part_energies=None, part_names=())]
        tables += states.momenta
        if states.balance:
            tables.append(states.balance)
        self._latest_tables = tables
        arrays = [_get_arrays(table) for table in tables]
        if not self._columns:
            self._columns = [{name: Column() for name in table} for table in arrays]
        if [table.keys() for table in arrays] != [
            table.keys() for table in self._columns
        ]:
            raise HistoryError(
                "the states that were added hold other quantities than those before them"
            )
        for columns, table in zip(self._columns, arrays, strict=True):
            for name, rows in table.items():
                columns[name].add(rows)
        self._history = None

    @property
    def history(self) -> History:
        """All states as one history; there must be some."""
        if self._history is None:
            tables: list[Any] = []
            for table, columns in zip(self._latest_tables, self._columns, strict=True):
                rows: dict[str, Any] = {
                    name: column.rows for name, column in columns.items()
                }
                tables.append(replace(table, **rows))
            history, *evidence = tables
            momenta_count = len(history.momenta)
            momenta, balances = evidence[:momenta_count], evidence[momenta_count:]
            balance = balances[0] if balances else None
            written = Given(tuple(momenta), balance, history.masses)
            self._history = replace(history, evidence=written)
        return self._history


def find_momenta(history: History, *, of_parts: bool) -> Momenta | None:
    """Return the momenta of the parts, or of the whole model; None if they are not written."""
    for momenta in history.momenta:
        if (momenta.parts is not None) is of_parts:
            return momenta
    return None


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
