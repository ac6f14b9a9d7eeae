"""What may be wrong with what a deck says: of another model, not followed as a whole, weights taken over."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.choice.warnings import Caution

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from d2rpick.choice.cost import CostModel
    from d2rpick.deck.inventory.model import Inventory
    from d2rpick.histories.history import Part


def doubts_of(parts: Iterable[Part], inventory: Inventory) -> Iterator[Caution]:
    """Say so where parts of a history have other titles in the deck: what it says may be of another model."""
    other = [part for part in parts if part.id in inventory.parts and _differ(part.title, _title(part, inventory))]
    if other:
        first, more = other[0], f", and {len(other) - 1} more" if len(other) > 1 else ""
        named = f"part {first.id} is {first.title!r} in the history and {_title(first, inventory)!r} in the deck{more}"
        yield Caution("deck-of-another-model", f"{named}: is this the deck of the run?")


def doubts_of_bodies(parts: Collection[int], inventory: Inventory) -> Iterator[Caution]:
    """Say so where ties that are not followed may join the rigid bodies that parts become."""
    if inventory.ties and len(inventory.groups(parts)) > 1:
        more = f" and {len(inventory.ties) - 1} more ties" if len(inventory.ties) > 1 else ""
        found = f"{inventory.ties[0]}{more} may join parts that share no nodes, which is not followed"
        yield Caution("ties-not-followed", f"{found}; parts that are tied belong in one rigid body")


def doubts_of_cost(model: CostModel, *, used: bool = True) -> Iterator[Caution]:
    """Say what was not followed of a deck and, where its cost is ``used``, which weights were not measured."""
    for note in model.inventory.notes:
        yield Caution("deck-not-followed", note)
    if used and model.assumed:
        taken = f"the cost of {', '.join(model.assumed)} was not measured; that of a formulation alike was taken"
        yield Caution("weights-by-analogy", taken)


def _title(part: Part, inventory: Inventory) -> str:
    return inventory.parts[part.id].title


def _differ(one: str, other: str) -> bool:
    """Whether two titles are there and differ, but for blanks, capitals, and where a format cuts them."""
    first, second = (" ".join(title.split()).casefold() for title in (one, other))
    shorter = min(len(first), len(second))
    return first[:shorter] != second[:shorter]
