"""Cache results that are computed from a record, so that every td reuses them."""

from __future__ import annotations

from functools import wraps
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable

    class Remembering(Protocol):
        """A record of a run that stores the results computed from it."""

        @property
        def memory(self) -> Memory:
            """Results that were computed from this record."""


_Function = TypeVar("_Function", bound="Callable[..., Any]")


class Memory:
    """Results of the cached functions for one record, keyed by function and arguments.

    The memory lives as long as the record, which is read anew for each question.  A copy in another process starts
    empty.
    """

    def __init__(self) -> None:
        self.results: dict[tuple[Any, ...], Any] = {}

    def __reduce__(self) -> tuple[type[Memory], tuple[()]]:
        return type(self), ()


def remember(function: _Function) -> _Function:
    """Decorate a function so that it computes each result only once per record.

    The record is the first argument.  The results are kept by the other positional arguments, which must be hashable;
    what is given by keyword must follow from these, or be without influence on the result.
    """

    @wraps(function)
    def recall(record: Remembering, *arguments: Hashable, **others: Any) -> Any:
        key = (function, *arguments)
        results = record.memory.results
        if key not in results:
            results[key] = function(record, *arguments, **others)
        return results[key]

    return cast("_Function", recall)
