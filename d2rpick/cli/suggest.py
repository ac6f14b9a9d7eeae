"""The command ``suggest``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output, finish
from d2rpick.cli.progress import reading

if TYPE_CHECKING:
    from d2rpick.choice import Suggestion

EXAMPLES = """\b
Examples:
  d2rpick suggest --td 0.064 sample_data/energy.csv
  d2rpick suggest --td 0.37 --energy boxIE_J sample_data/rollover.csv
  d2rpick suggest --td 0.064 -f json sample_data/energy.glstat
  d2rpick suggest --td 0.37 --part box -f card sample_data/rolloverT01.gz
"""


@click.command("suggest", epilog=EXAMPLES)
@click.option("--td", type=shared.TIME, required=True, metavar="T", help="Switch back to deformable at this time.")
@click.option(
    "--limit",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    help="Rows of the table; json and csv hold all.",
)
@shared.history_options
@shared.choosing_options
@shared.output_options("table", "json", "csv", "markdown", "value", "card")
@click.pass_context
def command(ctx: click.Context, /, td: float, limit: int, output_format: str, exit_zero: bool, **options: Any) -> None:
    """Rank the times tr at which the parts of HISTORY can be made rigid until td.

    A candidate is a time before td at which the internal energy had the level it has at td.  Each is verified by
    replaying the floating oscillator behind the record; the best one, and a better td, are named.
    """
    from d2rpick.choice import suggest
    from d2rpick.report import suggestion as report

    if output_format == "card" and not options["part"]:
        raise click.UsageError("-f card needs --part, the parts that are switched")
    with reading(options["history"], quiet=options["quiet"]):
        run = shared.open_run(options)
        output = Output.of(options, *run.sources)
        history = run.history(shared.selection(options), with_momenta=True)
    answer = suggest(history, td, shared.settings(options))
    output.notes(history.notes, answer.cautions)
    if options["plot"]:
        from d2rpick import plots

        output.write(options["plot"], plots.render(plots.draw_suggestion(answer), options["plot"]))
    if output_format == "card":
        written = _card(answer, output)
        finish(ctx, objection=not written, exit_zero=exit_zero)
        return
    texts = {
        "table": lambda: report.as_table(answer, limit),
        "markdown": lambda: report.as_markdown(answer, limit),
        "csv": lambda: report.as_csv(answer),
        "json": lambda: report.as_json(answer, ctx.meta["d2rpick.command"]),
        "value": lambda: report.as_value(answer),
    }
    output.result(texts[output_format]())
    finish(ctx, objection=answer.recommended is None, exit_zero=exit_zero)


def _card(answer: Suggestion, output: Output) -> bool:
    """Print the card of the recommended pair, judged as it is printed; False where there is none or it fails."""
    from d2rpick.cards import ls_dyna
    from d2rpick.cli.card import all_cautions
    from d2rpick.judged_card import judged

    pair, history = answer.recommended, answer.situation.history
    if pair is None:
        output.content(b"")
        return False
    ids = [part.id for part in history.parts or ()]
    card, verdict = judged(
        lambda remarks: ls_dyna(pair.tr, pair.td, ids, remarks=remarks), history, answer.situation.settings
    )
    said = set(answer.cautions)
    output.notes(card.notes, [caution for caution in all_cautions(verdict) if caution not in said])
    output.content(card.text.encode())
    return verdict.verified
