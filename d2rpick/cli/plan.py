"""The command ``plan``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.api.cards import Cards, JudgedCard, all_cautions
from d2rpick.api.request import CHOOSING, NOT_NEGATIVE, READING, Option, Request
from d2rpick.base.errors import ArgumentError, DeckError, printable
from d2rpick.cli import options
from d2rpick.cli.options import DECK_OF_PARTS, HISTORY, RESULT
from d2rpick.cli.output import Output, check_switched, opened
from d2rpick.cli.values import CARDS
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.api.plans import Plan


@options.command
@options.option("min_rigid", Option(
    "Leave shorter windows out.  [default: 5% of the record; one gives way to a later one twice as long]",
    *(NOT_NEGATIVE, "T"),
))  # fmt: skip
@click.option(
    "--all", "every", is_flag=True,
    help="With -f value, -f card and --write-deck: all windows, not only the supported ones.",
)  # fmt: skip
@options.file(
    "--done",
    "Windows in which HISTORY was switched, a line 'tr td' for each, or a journal: plan those after.  -f value, "
    "-f card and --write-deck hold both, as the next run needs them.",
)
@options.file(
    "--before",
    "The run that the windows of --done were planned from: its landings are compared; repeatable.",
    *("HISTORY",), many=True,
)  # fmt: skip
@options.file(
    "--write-deck", "Write a copy of --deck with the cards of the windows into this folder, and check it.", "DIR"
)
@options.takes(
    *("deck", "weights", HISTORY, *READING, *CHOOSING, "plot", "report", *CARDS, *RESULT),
    deck=DECK_OF_PARTS,
    forms=[*FORMATS["plan"], "card"],
)
def plan(
    min_rigid: float | None,
    every: bool,
    done: str | None,
    before: tuple[str, ...],
    write_deck: str | None,
    request: Request,
    cards: Cards,
    output: Output,
) -> None:
    """Plan the rigid windows of a run: each of its flights with tr, td, and whether HISTORY supports it.

    Windows are supported up to and with the first that locks in energy: it moves the landings after it.  Run with
    these, then plan the next from the switched run, with --done.

    Examples
    --------
    d2rpick plan --part box sample_data/rollover_box.matsum
    d2rpick plan --part box -f value sample_data/rollover_box.matsum
    d2rpick plan --part box -f card sample_data/rollover_box.matsum
    d2rpick plan --part box --plot plan.png --report plan.html sample_data/rollover_box.matsum
    """
    from d2rpick.api.asked import ask, open_run
    from d2rpick.api.plans import planned

    form = output.output_format
    if every and form not in ("value", "card") and not write_deck:
        raise click.UsageError("--all belongs to -f value, -f card and --write-deck; other forms hold every window")
    _check_deck(request, cards, form, write_deck)
    cards = cards.by_deck(request.deck) if form == "card" or write_deck else cards
    output.check(cards, by_itself=bool(write_deck))
    with opened(request, output, done, *before) as (run, output):
        asked = ask(run, request, merge=cards.merge)
        if write_deck and (foreign := [one for one in asked.cautions if one.code == "deck-of-another-model"]):
            raise DeckError(f"{request.deck}: {foreign[0].message}")
        cards, added = cards.for_bodies(asked) if form == "card" or write_deck else (cards, ())
        earlier = open_run(request, before) if before else None
    answer = planned(asked, min_rigid, options.windows_in(done) if done else (), earlier)
    output.notes((*answer.history.notes, *added), answer.cautions)
    output.beside_answer(answer, lambda: answer.page(options.repeat(), (), cards))
    found = answer.printed(cards, every=every) if form == "card" or write_deck else None
    checked, passed = _write_and_check(found, answer, write_deck, output) if found and write_deck else ("", True)
    if checked and form != "table":
        click.echo(checked, err=True)
    if form == "card":
        told = [] if found is None else all_cautions(one for one in found.verdicts if not one.verified)
        return output.finish(objection=not (output.card(found, told) and passed))
    output.answer(answer, checked if form == "table" else "", every=every)
    return output.finish(objection=not (answer.supported and passed))


def _check_deck(request: Request, cards: Cards, form: str, folder: str | None) -> None:
    """Refuse to copy no deck, and a card that switches nobody, before a file is opened."""
    if folder is not None and request.deck is None:
        raise ArgumentError("--write-deck needs `deck`, the deck that is copied with the cards")
    if form == "card" or folder:
        check_switched("-f card" if form == "card" else "--write-deck", request, cards)


def _write_and_check(card: JudgedCard, plan: Plan, folder: str, output: Output) -> tuple[str, bool]:
    """Write the copy, and check it by the history.

    Returns
    -------
    text : str
        The files written, and below them what ``check --history`` prints of the deck.
    passed : bool
        Whether no finding is an error.
    """
    from d2rpick.api.plans import written

    names, checked = written(plan, card, folder, overwrite=output.overwrite)
    listed = [f"written  {printable(name)}" for name in names]
    return "\n".join([*listed, "", checked.text("table", output.shown())]), checked.passed
