"""Masses by the deck and smallest stable steps of parts: from the deck, else from what the solver printed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from d2rpick.deck.geometry import masses_and_steps

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from d2rpick.deck.model import Inventory


@dataclass(frozen=True)
class Steps:
    """Masses and steps of the parts by the deck, and steps that the solver printed [mass, time].

    ``printed`` are the smallest steps of those parts that controlled the step, by number, with the name of the source.
    """

    masses: Mapping[int, float] = field(default_factory=dict)
    computed: Mapping[int, float] = field(default_factory=dict)
    printed: Mapping[int, tuple[float, str]] = field(default_factory=dict)

    def of(self, part: int) -> tuple[float | None, str | None]:
        """Smallest stable step of a part and where it is from; (None, None) where it is not known."""
        if part in self.computed:
            return self.computed[part], "deck"
        return self.printed.get(part, (None, None))

    def growth(self, switched: Collection[int], computed: Collection[int]) -> float | None:
        """How much the step may at least grow while some parts are rigid, from 1 on [-].

        ``computed`` are all parts that keep the step while they are deformable.  None where the step of one that stays
        deformable is not known; infinite where none of them does.
        """
        steps = [step for step in (self.of(part)[0] for part in computed) if step is not None]
        left = [self.of(part)[0] for part in computed if part not in switched]
        known = [step for step in left if step is not None]
        if len(known) < len(left) or not steps:
            return None
        return min(known) / min(steps) if known else float("inf")


def steps_of(inventory: Inventory | None, printed: Mapping[int, tuple[float, str]]) -> Steps:
    """Collect what deck and solver say about masses and steps."""
    if inventory is None:
        return Steps(printed=printed)
    found = masses_and_steps(inventory)
    return Steps(
        {part: mass for part, (mass, _) in found.items() if mass is not None},
        {part: step for part, (_, step) in found.items() if step is not None},
        printed,
    )
