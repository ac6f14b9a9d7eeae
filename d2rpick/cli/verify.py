"""The command ``verify``."""

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
    from d2rpick.choice.verify import Verdict
    from d2rpick.histories.opening import Run

EXAMPLES = """\b
Examples:
  d2rpick verify --tr 0.0135867 --td 0.0687534 sample_data/energy.csv
  d2rpick verify --tr 0.1 --td 0.37 --energy boxIE_J -f json sample_data/rollover.csv
  d2rpick verify --tr 0.0135867 --td 0.0687534 --report report.html sample_data/energy.csv
"""


class _Verify(click.Command):
    """Lets ``--switched`` take all file names that follow it, as a shell's glob gives them."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        spread: list[str] = []
        taking = False
        for arg in args:
            option = arg.startswith("-") and arg != "-"
            if taking and not option and spread[-1] != "--switched":
                spread.append("--switched")
            taking = arg == "--switched" if option else taking
            spread.append(arg)
        return super().parse_args(ctx, spread)


@click.command("verify", cls=_Verify, epilog=EXAMPLES)
@click.option("--tr", type=shared.TIME, required=True, metavar="T", help="Switch to rigid at this time.")
@click.option("--td", type=shared.TIME, required=True, metavar="T", help="Switch back to deformable at this time.")
@click.option(
    "--switched",
    metavar="FILE",
    multiple=True,
    type=shared.FILE,
    help="Compare a finished switched run with the reference; takes all names up to the next option.",
)
@deck_cost.cost_options
@shared.history_options
@shared.choosing_options
@card_options
@shared.MIN_QUALITY
@shared.output_options(*FORMATS["verdict"])
@click.pass_context
def command(
    ctx: click.Context, /, tr: float, td: float, switched: tuple[str, ...], min_quality: str | None, output_format: str,
    exit_zero: bool, **options: Any,
) -> None:  # fmt: skip
    """Judge one pair of switch times against the HISTORY of a run without switching."""
    from d2rpick.choice.of_run import Reference, compare_with, verify_of

    prints = prints_card(options, output_format)
    asked, settings = shared.Reading.of({**options, "part": ()}), shared.settings(options)
    extras = shared.Extras.of(options)
    with reading(asked.names, quiet=asked.quiet):
        run = asked.open()
        model = deck_cost.model_of(options)
        run, options = deck_cost.with_deck(run, options, settings, model)
        finished = shared.Reading.of(options)._replace(names=switched) if switched else None
        other = finished.open() if finished else None
        output = Output.of(options, *run.sources, *(other.sources if other else ()))
        reference = Reference(run, energy_of(run, options, prints=prints))
        settings, unknown = deck_cost.with_cost(settings, reference, model, options["merge"])
    answer = verify_of(reference, tr, td, settings)
    if other and finished:
        with reading(finished.names, quiet=asked.quiet):
            answer = compare_with(answer, reference, reference.like(other, finished.selection))
    answer = replace(answer, cautions=(*answer.cautions, *unknown))
    output.notes(reference.history.notes, answer.cautions)
    if extras.plot:
        from d2rpick.report import figures, figures_choice

        output.write(extras.plot, figures.render(figures_choice.draw_verdict(answer), extras.plot))
    if extras.report:
        output.write(extras.report, text_bytes(with_options(_page(answer, reference, other, options))))
    text = write("verdict", output_format, answer, Shown(ctx.meta["d2rpick.command"]))
    output.result(in_words(text, output_format))
    poor = not answer.verified or shared.falls_short(answer.quality, min_quality)
    finish(ctx, objection=poor, exit_zero=exit_zero)


def _page(answer: Verdict, reference: Reference, switched: Run | None, options: dict[str, Any]) -> str:
    """Draw the figure, explore the flight, and write the page around it."""
    from d2rpick.choice.explored import explored_around
    from d2rpick.choice.judged_card import input_for
    from d2rpick.report.page import PageContext
    from d2rpick.report.pages import verdict_page

    run = reference.run
    request = card_request(run, options, answer.situation.history)
    card = input_for(reference, answer.situation, answer.candidate.tr, request) if answer.verified else None
    explorer = explorer_of([explored_around(reference, answer.situation)])
    judging = typed.judging(options)
    return verdict_page(answer, PageContext(run, typed.repeat(), judging, card, switched, explorer))
