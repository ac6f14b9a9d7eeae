"""Which rigid bodies the parts to be switched become, by a deck."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.flight.bodies import RigidBody

if TYPE_CHECKING:
    from collections.abc import Collection

    from d2rpick.deck.inventory.model import Inventory


def bodies_of(inventory: Inventory, parts: Collection[int]) -> tuple[RigidBody, ...] | None:
    """Give the rigid bodies that these parts become; None where not all elements, or ties between bodies, are known.

    A part whose elements do not hang together is one body all the same in LS-DYNA, which switches parts; in Radioss,
    where a body is a set of nodes, each piece may have a body of its own.
    """
    if not inventory.complete:
        return None
    bodies = inventory.bodies(parts)
    if len(bodies) > 1 and inventory.ties:
        return None
    return tuple(RigidBody(body, _whole(inventory, body)) for body in bodies)


def _whole(inventory: Inventory, body: tuple[int, ...]) -> bool:
    if not inventory.counts.keys() >= set(body):
        return False
    return len(body) > 1 or inventory.solver == "radioss" or inventory.pieces(body[0]) == 1
