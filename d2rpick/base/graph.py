"""Search a graph for all nodes that are reachable from the given nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Hashable, Iterable

    Node = TypeVar("Node", bound=Hashable)


def find_reachable(
    starts: Iterable[Node],
    further: Callable[[Node], Iterable[Node]],
    *,
    wide: bool = False,
) -> list[Node]:
    """Return the starts and all nodes that repeated calls of ``further`` reach from them, without duplicates.

    The search is depth first; if ``wide`` it is breadth first, so that the nearest nodes come first.

    Examples
    --------
    >>> below = {1: [2, 3], 2: [4], 3: [1]}
    >>> find_reachable([1], lambda node: below.get(node, ()))
    [1, 3, 2, 4]
    >>> find_reachable([1], lambda node: below.get(node, ()), wide=True)
    [1, 2, 3, 4]
    """
    nodes: dict[Node, None] = {}
    waiting = list(starts)
    while waiting:
        node = waiting.pop(0 if wide else -1)
        if node not in nodes:
            nodes[node] = None
            waiting += further(node)
    return list(nodes)
