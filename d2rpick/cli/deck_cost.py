"""``--deck`` and ``--weights``: what the elements of the switched parts cost, taken from the deck of the run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.errors import listing, name_units

if TYPE_CHECKING:
    from collections.abc import Callable

    from d2rpick.choice.cost import CostModel
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.settings import Settings
    from d2rpick.choice.warnings import Caution
    from d2rpick.histories.opening import Run

_DECK = (
    "Main deck of the run (LS-DYNA, or a starter or engine file of Radioss): gives the cost of the parts, "
    "and which of them become one rigid body"
)
_WEIGHTS = click.option(
    "--weights", metavar="FILE", type=shared.FILE,
    help="Cost of an element by formulation, as d2rpick calibrate writes it.  [default: measured with OpenRadioss]",
)  # fmt: skip


def cost_options(function: shared.Decorated) -> shared.Decorated:
    """``--deck`` and ``--weights``; collected by ``with_deck``."""
    return deck_option(f"{_DECK}; `--part recommended` stands for the set that d2rpick parts recommends.")(
        _WEIGHTS(function)
    )


def model_options(function: shared.Decorated) -> shared.Decorated:
    """``--deck`` and ``--weights`` of the command that recommends a set; collected by ``model_of``."""
    return deck_option(f"{_DECK}.")(_WEIGHTS(function))


def deck_option(text: str) -> Callable[[shared.Decorated], shared.Decorated]:
    """``--deck``, for what the text says."""
    return click.option("--deck", metavar="DECK", type=shared.FILE, help=text)


def model_of(options: dict[str, Any]) -> CostModel | None:
    """Read the deck and the weights; None without a deck, UsageError where weights stand alone."""
    if options["deck"] is None:
        if options["weights"]:
            raise click.UsageError("--weights needs --deck, the deck whose elements are weighted")
        return None
    from d2rpick.choice.by_deck import read_model

    return read_model(options["deck"], options["weights"])


def with_deck(
    run: Run, options: dict[str, Any], settings: Settings, model: CostModel | None
) -> tuple[Run, dict[str, Any]]:
    """Let the deck tell what acts on the run, replace ``--part recommended`` by the numbers of that set, add springs.

    UsageError where that set is asked for without a deck.  The energy of springs is no level: they are the parts that
    the deck, or their energies, show to be springs.
    """
    if model is None and not options["part"]:
        return run, options
    from d2rpick.flight.flying_parts import asks_for_recommended

    if asks_for_recommended(options["part"], run):
        if len(options["part"]) > 1:
            raise click.UsageError("--part recommended stands for a whole set; leave the other --part out")
        if model is None:
            raise click.UsageError("--part recommended needs --deck, the main deck of the run")
    if model is None:
        return run, options
    from d2rpick.choice.by_deck import selected
    from d2rpick.choice.deck_of_run import in_deck
    from d2rpick.histories.names import Selection

    run = in_deck(run, model.inventory)
    found = selected(run, Selection(parts=options["part"]), settings, model)
    return run, {**options, "part": found.parts, "springs": found.springs}


def with_cost(
    settings: Settings, reference: Reference, model: CostModel | None, merge: int | None
) -> tuple[Settings, tuple[Caution, ...]]:
    """Let a deck tell what the parts of a history cost, and which bodies they become; all one where ``--merge`` is."""
    cautions: tuple[Caution, ...] = ()
    if model is not None:
        from d2rpick.choice import by_deck

        settings, cautions = by_deck.with_deck(settings, reference, model)
    parts = reference.history.parts
    if merge is not None and parts:
        from d2rpick.choice.warnings import Caution
        from d2rpick.flight.bodies import RigidBody

        bodies = [name_units(body.parts) for body in settings.bodies or ()]
        if len(bodies) > 1:
            found = f"--merge {merge} makes one rigid body of what nothing joins: {listing(bodies, between='; ')}"
            cautions = (*cautions, Caution("merged-apart", f"{found}; leave it out to keep them apart"))
        merged = tuple(sorted({part.id for part in parts} | {merge}))
        told = any(body.whole for body in settings.bodies or ())  # a part alone may be of pieces
        settings = replace(settings, bodies=(RigidBody(merged, whole=len(merged) > 1 or told),))
    return settings, cautions
