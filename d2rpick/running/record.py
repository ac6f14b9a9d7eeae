"""The record of a run that is being computed, joined from the states that each look at it has added."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, Final, Generic, TypeVar

import numpy as np

from d2rpick.base.errors import HistoryError
from d2rpick.histories.history import Balance, Given, History, Momenta

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

_Kind = TypeVar("_Kind", History, Momenta, Balance)
_FEWEST_ROWS: Final = 64


class Column:
    """An array that grows by rows without being copied each time."""

    def __init__(self) -> None:
        self._held: NDArray[Any] | None = None
        self.size = 0

    def add(self, rows: NDArray[Any]) -> None:
        """Append ``rows`` of shape (k, ...)."""
        size = self.size + len(rows)
        if self._held is None or size > len(self._held):
            longer = np.empty((max(2 * size, _FEWEST_ROWS), *rows.shape[1:]), rows.dtype)
            if self._held is not None:
                longer[: self.size] = self._held[: self.size]
            self._held = longer
        self._held[self.size : size] = rows
        self.size = size

    @property
    def rows(self) -> NDArray[Any]:
        """All rows so far, a view."""
        return np.empty(0) if self._held is None else self._held[: self.size]


class _Joined(Generic[_Kind]):
    """One of the tables of a record, of which each look has added some rows."""

    def __init__(self, first: _Kind) -> None:
        self._latest: _Kind = first
        self._columns = {name: Column() for name in self._arrays(first)}
        self.add(first)

    @staticmethod
    def _arrays(table: _Kind) -> dict[str, Samples]:
        """Give those arrays that have a row for each time."""
        values = {one.name: getattr(table, one.name) for one in fields(table) if one.init and one.name != "masses"}
        size = table.time.size
        return {name: one for name, one in values.items() if isinstance(one, np.ndarray) and len(one) == size}

    def add(self, table: _Kind) -> None:
        arrays = self._arrays(table)
        if arrays.keys() != self._columns.keys():
            raise HistoryError("the states that were added hold other quantities than those before them")
        for name, column in self._columns.items():
            column.add(arrays[name])
        self._latest = table

    def whole(self) -> _Kind:
        """Give the table with all its rows."""
        rows: dict[str, Any] = {name: column.rows for name, column in self._columns.items()}
        return replace(self._latest, **rows)


class GrowingRecord:
    """All states of a run so far."""

    def __init__(self) -> None:
        self._history: _Joined[History] | None = None
        self._balance: _Joined[Balance] | None = None
        self._momenta: list[_Joined[Momenta]] = []
        self._whole: History | None = None

    def add(self, states: History) -> None:
        """Append states that follow those so far; HistoryError where they hold other quantities."""
        self._whole = None
        bare = replace(states, part_energies=None, part_names=())  # many numbers, of which none is needed
        balance, momenta = states.balance, states.momenta
        if self._history is None:
            self._history = _Joined(bare)
            self._balance = _Joined(balance) if balance else None
            self._momenta = [_Joined(one) for one in momenta]
            return
        if len(momenta) != len(self._momenta) or (balance is None) != (self._balance is None):
            raise HistoryError("the states that were added hold other quantities than those before them")
        self._history.add(bare)
        if self._balance is not None and balance is not None:
            self._balance.add(balance)
        for joined, one in zip(self._momenta, momenta, strict=True):
            joined.add(one)

    @property
    def history(self) -> History:
        """All states as one history; there are some."""
        if self._whole is None:
            self._whole = self._join()
        return self._whole

    def _join(self) -> History:
        assert self._history is not None
        given = Given(
            tuple(one.whole() for one in self._momenta),
            self._balance.whole() if self._balance else None,
            next((one.whole().masses for one in self._momenta if one.whole().parts is not None), None),
        )
        return replace(self._history.whole(), evidence=given)
