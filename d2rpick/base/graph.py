"""What hangs together: everything that can be reached from where one starts."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable

    Node = TypeVar("Node", bound=Hashable)


def reached(
    starts: Iterable[Node],
    further: Callable[[Node], Iterable[Node]],
    *,
    wide: bool = False,
) -> list[Node]:
    """Give the starts and all that ``further`` leads to, directly or not, each once.

    The latest found is followed first; if ``wide`` the earliest, so that the nearest come first.

    Examples
    --------
    >>> below = {1: [2, 3], 2: [4], 3: [1]}
    >>> reached([1], lambda one: below.get(one, ())), reached([1], lambda one: below.get(one, ()), wide=True)
    ([1, 3, 2, 4], [1, 2, 3, 4])
    """
    found: dict[Node, None] = {}
    waiting = list(starts)
    while waiting:
        one = waiting.pop(0 if wide else -1)
        if one not in found:
            found[one] = None
            waiting += further(one)
    return list(found)
