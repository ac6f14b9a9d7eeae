"""Define the command ``card``, which prints switching cards."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.cli import options
from d2rpick.cli.missing import list_needs_of_card
from d2rpick.cli.options import FILES, REFERENCE
from d2rpick.cli.values import CARDS, choose_click_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.api.cards import Cards
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output


@options.make_command_with_needs(list_needs_of_card)
@options.make_time_option(
    "--tr", "Switch to rigid at this time; repeatable.", many=True
)
@options.make_time_option(
    "--td", "Switch back at this time, one for each --tr.", many=True
)
@options.make_file_option(
    "--windows", "File with lines 'tr td', instead of --tr and --td."
)
@options.add_options(
    *("part", *CARDS, "deck", "no_deck", *REFERENCE, *FILES, "exit_zero"),
    deck="Main deck of the run, which defines the parts that become one rigid body; it is checked with the card.",
    part={
        "help": "Parts to switch: number (3,7) or range (10-19); with --history also title, "
        '"flying", "all" or, with --deck too, "recommended".',
        "type": choose_click_type("names"),
        "instead_of": (),
    },
)
def card(
    tr: tuple[float, ...],
    td: tuple[float, ...],
    windows: str | None,
    request: Request,
    cards: Cards,
    output: Output,
) -> None:
    """Print solver input for rigid windows, ready to be pasted.

    With a history, d2rpick judges the times as printed and adds the verdict as a comment.  With the deck of the run,
    it merges parts that share nodes, and checks the deck with the card in it.  --deck also works without --history.

    Examples
    --------
    d2rpick card --tr 0.0135867 --td 0.0687534 --part 11,12 --merge 11
    d2rpick card --tr 0.0135867 --td 0.0687534 --part 1 --history sample_data/energy.csv
    d2rpick card --tr 0.02 --td 0.09 --tr 0.2 --td 0.3 --part 11
    d2rpick card --solver radioss --tr 0.0135867 --td 0.0687534 --node 1001 --end 0.15
    """
    # Imported here to keep the start of the other commands fast.
    from d2rpick.api.judged_cards import collect_cautions, print_card

    if cards.solver:
        cards.check_solver(cards.solver)
    times = _read_windows(tr, td, windows)
    run = options.open_judging_run(request)
    output = output.beside(windows, *(run.sources if run else ()))
    judged_card = print_card(times, run, request, cards, windows or "")
    question = request.repeat()
    if judged_card.verdicts:
        history = judged_card.verdicts[0].situation.history
        output.notes(history.notes, ())
        if not history.parts:
            # Only the parts of the card are used.
            question = question._replace(parts=())
    output.card(judged_card, collect_cautions(judged_card), question, request.deck)
    if judged_card.worst:
        settings = judged_card.verdicts[0].situation.settings
        output.finish_by_verdict(judged_card.worst, settings.min_quality)
    output.finish(objection=judged_card.has_errors)


def _read_windows(
    tr: Sequence[float], td: Sequence[float], file: str | None
) -> Sequence[tuple[float, float]]:
    """Return the windows from pairs of times or from a file; raise UsageError if the pairs are incomplete."""
    if file is not None:
        if tr or td:
            raise click.UsageError("--windows excludes --tr and --td")
        return options.read_windows_in(file)
    if len(tr) != len(td):
        raise click.UsageError(
            f"{len(tr)} --tr and {len(td)} --td were given, but a --td for each --tr was expected"
        )
    return list(zip(tr, td, strict=True))
