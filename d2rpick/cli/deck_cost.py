"""``--deck`` and ``--weights``: what the elements of the switched parts cost, taken from the deck of the run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared

if TYPE_CHECKING:
    from d2rpick.choice.cost import CostModel
    from d2rpick.choice.settings import Settings
    from d2rpick.choice.warnings import Caution
    from d2rpick.histories.history import History
    from d2rpick.histories.opening import Run

DECK = click.option(
    "--deck", metavar="DECK", type=shared.FILE,
    help="Main deck of the run (LS-DYNA, or a starter or engine file of Radioss): gives the cost of the parts.",
)  # fmt: skip
WEIGHTS = click.option(
    "--weights", metavar="FILE", type=shared.FILE,
    help="Cost of an element by formulation, as d2rpick calibrate writes it.  [default: measured with OpenRadioss]",
)  # fmt: skip


def cost_options(function: shared.Decorated) -> shared.Decorated:
    """``--deck`` and ``--weights``; collected by ``with_deck``."""
    return DECK(WEIGHTS(function))


def model_of(options: dict[str, Any]) -> CostModel | None:
    """Read the deck and the weights; None without a deck, UsageError where weights stand alone."""
    if options["deck"] is None:
        if options["weights"]:
            raise click.UsageError("--weights needs --deck, the deck whose elements are weighted")
        return None
    from d2rpick.choice.cost import CostModel
    from d2rpick.choice.weights_file import read_weights
    from d2rpick.deck.inventory import read_inventory

    weights = read_weights(options["weights"]) if options["weights"] else None
    return CostModel(read_inventory(options["deck"]), weights)


def with_recommended(run: Run, options: dict[str, Any], settings: Settings, model: CostModel | None) -> dict[str, Any]:
    """Replace ``--part recommended`` by the numbers of the set that ``parts`` recommends; UsageError without a deck."""
    titles = {part.title.strip().casefold() for part in run.parts}
    words = [text.strip().casefold() for text in options["part"]]
    if "recommended" not in words or "recommended" in titles:
        return options
    if len(words) > 1:
        raise click.UsageError("--part recommended stands for a whole set; leave the other --part out")
    if model is None:
        raise click.UsageError("--part recommended needs --deck, the main deck of the run")
    from d2rpick.choice.part_sets import recommended_parts

    return {**options, "part": tuple(map(str, recommended_parts(run, settings, model)))}


def with_springs(run: Run, options: dict[str, Any], model: CostModel | None) -> dict[str, Any]:
    """Add the numbers of the parts that the deck, or their energies, show to be springs: their energy is no level."""
    if model is None:
        return options
    from d2rpick.deck.inventory.model import DISCRETE

    counts = model.inventory.counts
    springs = {part.id for part in run.springs} | {part for part, kinds in counts.items() if {*kinds} <= DISCRETE}
    return {**options, "springs": tuple(map(str, sorted(springs)))}


def with_cost(settings: Settings, history: History, model: CostModel | None) -> tuple[Settings, tuple[Caution, ...]]:
    """Take the cost share of the parts of a history from the deck, and say so where it stays unknown."""
    if model is None or settings.cost_share is not None:
        return settings, ()
    from d2rpick.choice.part_sets import with_cost_of
    from d2rpick.choice.warnings import Caution

    if not history.parts:
        why = "no parts are named whose elements are saved; give them with `parts`"
        return settings, (Caution("cost-unknown", f"the run time stays open: {why}"),)
    found, share = with_cost_of(settings, model, [part.id for part in history.parts])
    told = f"the run time stays open: {share.reason}"
    return found, () if share.reason is None else (Caution("cost-unknown", told),)
