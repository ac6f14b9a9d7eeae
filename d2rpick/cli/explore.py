"""The command ``explore``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.api.request import check_window
from d2rpick.cli import options
from d2rpick.cli.options import ANSWER, DECK_OF_PARTS, ONE_RUN, WINDOW
from d2rpick.cli.progress import opened
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.api.cards import Cards
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick explore --td-window 0.06 0.07 sample_data/energy.csv
  d2rpick explore --td 0.064 --td-window 0.06 0.07 sample_data/energy.csv
  d2rpick explore --part box -f csv sample_data/rollover_box.matsum
  d2rpick explore --part recommended --deck sample_data/rollover_box.k sample_data/rollover_box.matsum
  d2rpick explore --part box --plot explore.png --report explore.html sample_data/rollover_box.matsum
"""


@options.command("explore", EXAMPLES)
@options.time("--td", "A time to switch back that others are compared with.")
@options.time(
    "--td-window", "Explore the times to switch back within this window.  [default: the longest flight]", pair=True
)
@click.option(
    "--steps", type=click.IntRange(1, 100_000), default=200, show_default=True,
    help="Number of evenly spaced td; peaks of the energy come on top.",
)  # fmt: skip
@click.option(
    "--limit", type=click.IntRange(min=1), default=10, show_default=True,
    help="Number of rows in the table, of the pairs that nothing beats; json and csv have all.",
)  # fmt: skip
@options.takes(*ONE_RUN, *ANSWER, deck=DECK_OF_PARTS, forms=FORMATS["trade_off"])
def command(
    td: float | None, td_window: WINDOW, steps: int, limit: int, request: Request, cards: Cards, output: Output
) -> None:
    """Show what each time td to switch back costs: the best tr for it, its error, and what it saves.

    A grid of td over --td-window or the longest flight, and every peak of the energy, each as `suggest --td` answers
    it.  Named are those that no other beats in both error and rigid time, and the nearest td with half the error.
    """
    from d2rpick.api.asked import ask
    from d2rpick.api.flights import explored

    check_window("td_window", td_window)
    prints = output.prints(cards, request)
    with opened(request, output) as (run, output):
        asked = ask(run, request, prints=prints, merge=cards.merge)
    answer = explored(asked, td, td_window, steps)
    output.notes(asked.reference.history.notes, answer.cautions)
    output.beside_answer(answer, lambda: answer.page(options.repeat(), request.judging(), cards))
    output.answer(answer, limit=limit)
    chosen = answer.recommended
    output.finish(objection=chosen is None, quality=chosen.quality if chosen else None)
