"""The record of a run that is being computed, joined from the states that each look at it has added."""

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

_FEWEST_ROWS: Final = 64


class Column:
    """An array that grows by rows without being copied each time."""

    def __init__(self) -> None:
        self._held: NDArray[Any] = np.empty(0)
        self.size = 0

    def add(self, rows: NDArray[Any]) -> None:
        """Append ``rows`` of shape (k, ...)."""
        size = self.size + len(rows)
        if size > len(self._held):
            longer = np.empty(
                (max(2 * size, _FEWEST_ROWS), *rows.shape[1:]), rows.dtype
            )
            longer[: self.size] = self.rows if self.size else 0
            self._held = longer
        self._held[self.size : size] = rows
        self.size = size

    @property
    def rows(self) -> NDArray[Any]:
        """All rows so far, a view."""
        return self._held[: self.size]


class GrowingRecord:
    """All states of a run so far: energy, momenta and balance, each a table of which every look has added some rows."""

    def __init__(self) -> None:
        self._latest: list[Table] = []
        self._columns: list[dict[str, Column]] = []
        self._history: History | None = None

    def add(self, states: History) -> None:
        """Append states that follow those so far; HistoryError where they hold other quantities."""
        bare = replace(
            states, part_energies=None, part_names=()
        )  # many numbers, of which none is needed
        self._latest = [
            bare,
            *states.momenta,
            *([states.balance] if states.balance else []),
        ]
        arrays = [_arrays(table) for table in self._latest]
        if not self._columns:
            self._columns = [{name: Column() for name in one} for one in arrays]
        if [one.keys() for one in arrays] != [one.keys() for one in self._columns]:
            raise HistoryError(
                "the states that were added hold other quantities than those before them"
            )
        for columns, one in zip(self._columns, arrays, strict=True):
            for name, rows in one.items():
                columns[name].add(rows)
        self._history = None

    @property
    def history(self) -> History:
        """All states as one history; there are some."""
        if self._history is None:
            tables: list[Any] = []
            for table, columns in zip(self._latest, self._columns, strict=True):
                rows: dict[str, Any] = {
                    name: column.rows for name, column in columns.items()
                }
                tables.append(replace(table, **rows))
            history, *others = tables
            count = len(history.momenta)
            given = Given(
                tuple(others[:count]), next(iter(others[count:]), None), history.masses
            )
            self._history = replace(history, evidence=given)
        return self._history


def _arrays(table: Table) -> dict[str, NDArray[Any]]:
    """Give those arrays of a table that have a row for each of its times."""
    values = {
        one.name: getattr(table, one.name)
        for one in fields(table)
        if one.init and one.name != "masses"
    }
    size = table.time.size
    return {
        name: one
        for name, one in values.items()
        if isinstance(one, np.ndarray) and len(one) == size
    }
