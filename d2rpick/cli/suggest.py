"""The command ``suggest``."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import deck_cost, typed
from d2rpick.cli import options as shared
from d2rpick.cli.card_options import all_cautions, card_options, card_request, energy_of, need_ids, prints_card
from d2rpick.cli.output import Output, finish, text_bytes
from d2rpick.cli.progress import reading
from d2rpick.cli.wording import in_words, with_options
from d2rpick.report.formats import FORMATS, Shown, write

if TYPE_CHECKING:
    from d2rpick.choice.of_run import Reference
    from d2rpick.choice.suggest import Suggestion

EXAMPLES = """\b
Examples:
  d2rpick suggest --part box sample_data/rolloverT01.gz
  d2rpick suggest --td 0.064 sample_data/energy.csv
  d2rpick suggest --td-window 0.06 0.07 sample_data/energy.csv
  d2rpick suggest --td 0.37 --energy boxIE_J sample_data/rollover.csv
  d2rpick suggest --td 0.064 -f json sample_data/energy.glstat
  d2rpick suggest --td 0.37 --part box -f card --node 1001 sample_data/rolloverT01.gz
  d2rpick suggest --td 0.064 --report report.html sample_data/energy.csv
"""


@click.command("suggest", epilog=EXAMPLES)
@click.option(
    "--td", type=shared.TIME, metavar="T", cls=shared.Either, instead_of=("td_window",),
    help="Switch back to deformable at this time.",
)  # fmt: skip
@click.option(
    "--td-window",
    type=(shared.TIME, shared.TIME),
    metavar="LO HI",
    cls=shared.Either,
    instead_of=("td",),
    help="Choose the time to switch back within this window.",
)
@click.option(
    "--limit",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    help="Number of rows in the table; json and csv have all.",
)
@deck_cost.cost_options
@shared.history_options
@shared.choosing_options
@card_options
@shared.MIN_QUALITY
@shared.output_options(*FORMATS["suggestion"], "card")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    td: float | None,
    td_window: tuple[float, float] | None,
    limit: int,
    min_quality: str | None,
    output_format: str,
    exit_zero: bool,
    **options: Any,
) -> None:
    """Rank the times tr at which the parts of HISTORY can be made rigid until td, or choose both times.

    Without --td both are chosen, in --td-window or in the longest flight.

    A candidate is a time before td at which the internal energy had the level it has at td.  Each is verified by
    replaying the floating oscillator behind the record; the best one, and a better td, are named.
    """
    from d2rpick.choice.of_run import Reference, suggest_of

    _check_usage(td, td_window, card=output_format == "card", ids=(*options["part"], *options["node"]))
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
    answer = suggest_of(reference, td_window if td is None else td, settings)
    answer = replace(answer, cautions=(*answer.cautions, *unknown))
    output.notes(reference.history.notes, answer.cautions)
    if extras.plot:
        from d2rpick.report import figures, figures_choice

        output.write(extras.plot, figures.render(figures_choice.draw_suggestion(answer), extras.plot))
    if extras.report:
        output.write(extras.report, text_bytes(with_options(_page(answer, reference, options))))
    poor = shared.falls_short(answer.quality, min_quality)
    if output_format == "card":
        passed = _card(answer, reference, options, output)
        return finish(ctx, objection=not passed or poor, exit_zero=exit_zero)
    text = write("suggestion", output_format, answer, Shown(ctx.meta["d2rpick.command"], limit))
    output.result(in_words(text, output_format))
    return finish(ctx, objection=answer.recommended is None or poor, exit_zero=exit_zero)


def _check_usage(td: float | None, window: tuple[float, float] | None, *, card: bool, ids: tuple[str, ...]) -> None:
    """Raise UsageError where what is asked for makes no sense, before a file is opened."""
    if td is not None and window:
        raise click.UsageError("--td and --td-window exclude each other")
    if window and not window[0] < window[1]:
        raise click.UsageError(f"--td-window {window[0]:g} {window[1]:g} is empty; give the lower time first")
    if card and not ids:
        raise click.UsageError("-f card needs --part, the parts to switch (Radioss: --node, their main nodes)")


def _page(answer: Suggestion, reference: Reference, options: dict[str, Any]) -> str:
    """Draw the figure, explore the flight, and write the page around them."""
    from d2rpick.choice.explored import explored_around
    from d2rpick.choice.judged_card import input_for
    from d2rpick.cli.explorer import explorer_of
    from d2rpick.report.page import PageContext
    from d2rpick.report.pages import suggestion_page

    run = reference.run
    request, pair = card_request(run, options, answer.situation.history), answer.recommended
    card = input_for(reference, answer.situation, pair.tr, request) if pair else None
    explorer = explorer_of([explored_around(reference, answer.situation, answer.td_window)])
    judging = typed.judging(options)
    return suggestion_page(answer, PageContext(run, typed.repeat(), judging, card, explorer=explorer))


def _card(answer: Suggestion, reference: Reference, options: dict[str, Any], output: Output) -> bool:
    """Print the card of the recommended pair, judged as it is printed; False where there is none or it fails."""
    from d2rpick.choice.judged_card import judged_card
    from d2rpick.choice.of_run import judge_of

    pair, situation = answer.recommended, answer.situation
    if pair is None:
        output.content(b"")
        return False
    request = card_request(reference.run, options, situation.history).by(situation.settings)
    found = judged_card([(pair.tr, pair.td)], situation.history, partial(judge_of, reference, situation), request)
    if found is None:
        raise click.UsageError(need_ids(request, situation.history))
    card, (verdict,) = found
    said = set(answer.cautions)
    output.notes(card.notes, [caution for caution in all_cautions(verdict) if caution not in said])
    output.content(card.text.encode())
    return verdict.verified
