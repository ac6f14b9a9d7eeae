"""``plan --deck --write-deck``: a copy of the deck with the cards, and what ``check`` says of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.deck_cost import cost_options
from d2rpick.errors import DeckError, printable

if TYPE_CHECKING:
    from d2rpick.choice.cost import CostModel
    from d2rpick.choice.plan import Plan
    from d2rpick.deck.printed_card import PrintedCard
    from d2rpick.histories.opening import Run


def deck_options(function: shared.Decorated) -> shared.Decorated:
    """``--deck``, ``--weights`` and ``--write-deck``."""
    write = click.option(
        "--write-deck", metavar="DIR", type=shared.FILE,
        help="Write a copy of --deck with the cards of the windows into this folder, and check it.",
    )  # fmt: skip
    return cost_options(write(function))


def check_usage(deck: str | None, folder: str | None) -> None:
    """Raise UsageError where there is no deck to be copied."""
    if folder is not None and deck is None:
        raise click.UsageError("--write-deck needs --deck, the deck that is copied with the cards")


def check_model(run: Run, model: CostModel | None, options: dict[str, Any]) -> None:
    """Raise DeckError where the deck that is to be copied is not that of the run."""
    from d2rpick.choice.deck_of_run import of_another_model

    foreign = of_another_model(run, model.inventory) if model and options["write_deck"] else None
    if foreign:
        raise DeckError(f"{options['deck']}: {foreign.message}")


def for_deck(options: dict[str, Any]) -> dict[str, Any]:
    """Let a card take the solver and the name of the run from the deck, unless they are given."""
    if options["deck"] is None:
        return options
    from d2rpick.deck.radioss_run import read_run, run_files

    if not run_files(options["deck"]):
        return {**options, "solver": options["solver"] or "ls-dyna"}
    legs = read_run(options["deck"]).legs
    name = options["name"] or (legs[0].name if legs else None)
    return {**options, "solver": options["solver"] or "radioss", "name": name}


def write_and_check(card: PrintedCard, plan: Plan, run: Run, options: dict[str, Any]) -> tuple[str, bool]:
    """Write the copy, and check it by the history.

    Returns
    -------
    text : str
        The files written, and below them what ``check --history`` prints of the deck.
    passed : bool
        Whether no finding is an error.
    """
    from d2rpick.deck.writing import write_deck
    from d2rpick.report.findings import Checks, as_table
    from d2rpick.rules import Severity, check_deck, configuration_for
    from d2rpick.rules.configuration import Configuration
    from d2rpick.rules.judgement import HistoryJudge

    written = write_deck(options["deck"], card, options["write_deck"], overwrite=options["overwrite"])
    done = card.windows[: len(plan.done)]  # as printed
    judge = HistoryJudge(run, shared.selection({**options, "part": ()}), plan.settings, done)
    checked = check_deck(written[0], configuration_for(written[0], Configuration()), judge)
    listed = [f"written  {printable(name)}" for name in written]
    text = "\n".join([*listed, "", as_table(Checks([checked]))])
    return text, all(one.severity is not Severity.ERROR for one in checked.findings)
