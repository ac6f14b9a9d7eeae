"""What the deck of a run tells of its flights: gravity, supports and imposed motion, and which parts hang together."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.choice.deck_doubts import of_another_model
from d2rpick.deck.pieces import supports_of
from d2rpick.histories.surroundings import Support, Surroundings

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.model import Gravity, Hold, Inventory
    from d2rpick.histories.run import Run


def in_deck(run: Run, inventory: Inventory | None) -> Run:
    """Give a run with what its deck tells; as it is without one, or with that of another model."""
    if inventory is None or of_another_model(run, inventory):
        return run
    return run.within(_surroundings(inventory))


def _surroundings(inventory: Inventory) -> Surroundings:
    by_part, whole = supports_of(inventory)
    supports: dict[int | None, tuple[Support, ...]] = {part: _named(holds) for part, holds in by_part.items()}
    supports[None] = _named(whole)
    gravity: dict[int | None, tuple[float, ...]] = dict(_gravity(inventory))
    on_free = {gravity.get(part) for part in inventory.nodes_by_part.keys() - by_part.keys()}
    if len(on_free) == 1 and (common := on_free.pop()) is not None:
        gravity[None] = common
    return Surroundings(gravity, supports, partial(_bodies, inventory))


def _bodies(inventory: Inventory) -> tuple[tuple[int, ...], ...]:
    """Parts that hang together; none where some may be missing, or ties that are not followed may join them."""
    known = inventory.complete and not inventory.ties
    return inventory.bodies(inventory.nodes_by_part.keys()) if known else ()


def _named(holds: tuple[Hold, ...]) -> tuple[Support, ...]:
    return tuple(dict.fromkeys(Support(one.name, one.start, one.end) for one in holds))


def _gravity(inventory: Inventory) -> Iterator[tuple[int, tuple[float, ...]]]:
    """Accelerations that gravity may have for each part of which they are known."""
    loads = inventory.boundary.gravity
    for part, nodes in inventory.nodes_by_part.items() if loads is not None else ():
        acting = [(one, _acts(one, part, nodes)) for one in loads or ()]
        if all(acts is not None for _, acts in acting):
            together = _together([one for one, acts in acting if acts])
            if together is not None:
                yield part, together


def _acts(load: Gravity, part: int, nodes: np.ndarray) -> bool | None:
    """Whether gravity acts on a part with these nodes; None where on some of them."""
    if load.nodes is None or part in load.parts:
        return True
    inside = np.isin(nodes, load.nodes)
    return bool(inside.any()) if inside.all() or not inside.any() else None


def _together(loads: list[Gravity]) -> tuple[float, ...] | None:
    """Sizes of several loads together; None where their sum is not known."""
    if len(loads) < 2:
        return tuple(sorted({abs(value) for one in loads for value in one.values} or {0.0}))
    if any(one.axis is None or len(one.values) > 1 for one in loads):
        return None
    along = [sum(one.values[0] for one in loads if one.axis == axis) for axis in range(3)]
    return (float(np.linalg.norm(along)),)
