"""The command ``explore``."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import deck_cost, typed
from d2rpick.cli import options as shared
from d2rpick.cli.card_options import card_options, card_request, energy_of, prints_card
from d2rpick.cli.explorer import explorer_of
from d2rpick.cli.output import Output, finish, text_bytes
from d2rpick.cli.progress import reading
from d2rpick.cli.wording import in_words, with_options
from d2rpick.report.formats import FORMATS, Shown, write

if TYPE_CHECKING:
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.trade_off import TradeOff

EXAMPLES = """\b
Examples:
  d2rpick explore --td-window 0.06 0.07 sample_data/energy.csv
  d2rpick explore --td 0.064 --td-window 0.06 0.07 sample_data/energy.csv
  d2rpick explore --part box -f csv sample_data/rollover_box.matsum
  d2rpick explore --part recommended --deck sample_data/rollover_box.k sample_data/rollover_box.matsum
  d2rpick explore --part box --plot explore.png --report explore.html sample_data/rollover_box.matsum
"""


@click.command("explore", epilog=EXAMPLES)
@click.option("--td", type=shared.TIME, metavar="T", help="A time to switch back that others are compared with.")
@click.option(
    "--td-window", type=(shared.TIME, shared.TIME), metavar="LO HI",
    help="Explore the times to switch back within this window.  [default: the longest flight]",
)  # fmt: skip
@click.option(
    "--steps", type=click.IntRange(1, 100_000), default=200, show_default=True,
    help="Number of evenly spaced td; peaks of the energy come on top.",
)  # fmt: skip
@click.option(
    "--limit", type=click.IntRange(min=1), default=10, show_default=True,
    help="Number of rows in the table, of the pairs that nothing beats; json and csv have all.",
)  # fmt: skip
@deck_cost.cost_options
@shared.history_options
@shared.choosing_options
@card_options
@shared.MIN_QUALITY
@shared.output_options(*FORMATS["trade_off"])
@click.pass_context
def command(
    ctx: click.Context,
    /,
    td: float | None,
    td_window: tuple[float, float] | None,
    steps: int,
    limit: int,
    min_quality: str | None,
    output_format: str,
    exit_zero: bool,
    **options: Any,
) -> None:
    """Show what each time td to switch back costs: the best tr for it, its error, and what it saves.

    A grid of td over --td-window or the longest flight, and every peak of the energy, each as `suggest --td` answers
    it.  Named are those that no other beats in both error and rigid time, and the nearest td with half the error.
    """
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.trade_off import explore_of

    if td_window and not td_window[0] < td_window[1]:
        raise click.UsageError(f"--td-window {td_window[0]:g} {td_window[1]:g} is empty; give the lower time first")
    prints = prints_card(options, output_format)
    asked, settings = shared.Reading.of({**options, "part": ()}), shared.settings(options)
    extras = shared.Extras.of(options)
    with reading(asked.names, quiet=asked.quiet):
        run = asked.open()
        output = Output.of(options, *run.sources)
        model = deck_cost.model_of(options)
        run, options = deck_cost.with_deck(run, options, settings, model)
        reference = Reference(run, energy_of(run, options, prints=prints))
        settings, unknown = deck_cost.with_cost(settings, reference, model, options["merge"])
    found = explore_of(reference, settings, td_window, td=td, steps=steps)
    found = replace(found, cautions=(*found.cautions, *unknown))
    output.notes(reference.history.notes, found.cautions)
    if extras.plot:
        from d2rpick.report import figures
        from d2rpick.report.figures_choice import draw_trade_off

        output.write(extras.plot, figures.render(draw_trade_off(found), extras.plot))
    if extras.report:
        output.write(extras.report, text_bytes(with_options(_page(found, reference, options))))
    text = write("trade_off", output_format, found, Shown(ctx.meta["d2rpick.command"], limit))
    output.result(in_words(text, output_format))
    chosen = found.recommended
    poor = chosen is None or shared.falls_short(chosen.quality, min_quality)
    return finish(ctx, objection=poor, exit_zero=exit_zero)


def _page(found: TradeOff, reference: Reference, options: dict[str, Any]) -> str:
    """Write the page."""
    from d2rpick.choice.judged_card import input_for
    from d2rpick.report.page import PageContext
    from d2rpick.report.pages import trade_off_page

    request = card_request(reference.run, options, found.situation.history)
    pair, judging = found.suggestion.recommended, typed.judging(options)
    card = input_for(reference, found.suggestion.situation, pair.tr, request) if pair else None
    shown = PageContext(reference.run, typed.repeat(), judging, card, explorer=explorer_of([found]))
    return trade_off_page(found, shown)
