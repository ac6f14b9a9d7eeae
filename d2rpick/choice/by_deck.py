"""What the deck of a run adds to a question about it: the recommended parts, which are springs, what they cost."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from d2rpick.base.errors import FormatError
from d2rpick.choice.cost import ByDeck, CostModel, Weights
from d2rpick.choice.deck_of_run import (
    bodies_of,
    doubts_of,
    doubts_of_bodies,
    doubts_of_cost,
    doubts_of_solver,
    left_rigid_in,
    of_another_model,
)
from d2rpick.choice.sets_of_parts import recommended_parts, with_cost_of
from d2rpick.choice.warnings import Caution
from d2rpick.deck import read_inventory
from d2rpick.deck.geometry import Placement
from d2rpick.deck.model import DISCRETE
from d2rpick.deck.radioss_run import RUINS
from d2rpick.flight.flying_parts import asks_for_recommended

if TYPE_CHECKING:
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.settings import Settings
    from d2rpick.histories.names import Selection
    from d2rpick.histories.run import Run


def read_model(deck: str, weights: Weights | str | None = None) -> CostModel:
    """Read a main deck, and the file of weights where one is named.

    Raises
    ------
    DeckError, ConfigurationError
        If one of them cannot be read.
    """
    from d2rpick.choice.cost import read_weights

    return CostModel(read_inventory(deck), read_weights(weights) if isinstance(weights, str) else weights)


def selected(run: Run, selection: Selection, settings: Settings, model: CostModel) -> Selection:
    """Complete a selection: the parts of the recommended set for that word, and the springs of deck and energies.

    Raises
    ------
    FormatError
        If no set can be recommended.
    """
    if foreign := of_another_model(run, model.inventory):
        if asks_for_recommended(selection.parts, run):
            raise FormatError(f"{run.name}: no set of parts can be recommended: {foreign.message}, or the parts")
        return selection
    counts = model.inventory.counts
    springs = {part.id for part in run.springs} | {part for part, kinds in counts.items() if {*kinds} <= DISCRETE}
    parts = selection.parts
    if asks_for_recommended(parts, run):
        parts = tuple(map(str, recommended_parts(run, settings, model)))
    return selection._replace(parts=parts, springs=tuple(map(str, sorted(springs))))


def with_deck(settings: Settings, reference: Reference, model: CostModel) -> tuple[Settings, tuple[Caution, ...]]:
    """Let the deck tell the cost share of the parts of a history, unless it is given, and which bodies they become.

    What stays unknown is in the cautions; the deck of another model tells nothing.
    """
    inventory = model.inventory
    if foreign := of_another_model(reference.run, inventory):
        return replace(settings, bodies=()), (foreign,)
    ids = [part.id for part in reference.history.parts or ()]
    told = (*doubts_of_solver(ids, inventory), *left_rigid_in(reference.run, inventory))
    ruined = tuple(RUINS[code] for code in dict.fromkeys(one.code for one in told) if code in RUINS)
    history, settings = reference.history, replace(settings, kept_off=inventory.kept_off, ruined=ruined)
    if not history.parts:
        why = "no parts are named whose elements are saved; give them with `parts`"
        open_ = [Caution("cost-unknown", f"the run time stays open: {why}")] if settings.cost_share is None else []
        return replace(settings, bodies=()), (*told, *open_)
    found, share = with_cost_of(settings, model, ids)
    source = ByDeck(inventory.files, model.weights if settings.cost_share is None else None)
    placement = Placement(inventory)
    found = replace(found, bodies=bodies_of(inventory, ids), placement=placement, by_deck=source)
    doubts = [
        *doubts_of(history.parts, inventory),
        *doubts_of_cost(model, used=settings.cost_share is None and share.value is not None),
        *doubts_of_bodies(ids, inventory),
        *told,
    ]
    if share.reason:
        doubts.append(Caution("cost-unknown", f"the run time stays open: {share.reason}"))
    return found, tuple(doubts)
