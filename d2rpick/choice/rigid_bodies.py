"""Which rigid bodies the parts to be switched become, by a deck."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.deck.pieces import pieces_of
from d2rpick.flight.bodies import RigidBody

if TYPE_CHECKING:
    from collections.abc import Collection

    from d2rpick.deck.model import Inventory


def bodies_of(inventory: Inventory, parts: Collection[int]) -> tuple[RigidBody, ...]:
    """Give the rigid bodies that these parts become; none where elements, or ties between bodies, are not known.

    A part in pieces that nothing joins is one body all the same in LS-DYNA, which switches parts; in Radioss, where a
    body is a set of nodes, each piece may have a body of its own.
    """
    if not inventory.complete or not inventory.counts.keys() >= set(parts):
        return ()
    bodies = inventory.bodies(parts)
    if len(bodies) > 1 and inventory.ties:
        return ()
    return tuple(RigidBody(body, _whole(inventory, body)) for body in bodies)


def _whole(inventory: Inventory, body: tuple[int, ...]) -> bool:
    alone = len(body) == 1 and inventory.solver == "radioss"
    return alone or frozenset(body) in inventory.ready or pieces_of(inventory, body) == 1
