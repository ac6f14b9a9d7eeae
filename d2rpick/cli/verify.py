"""The command ``verify``."""

from __future__ import annotations

from typing import Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output, finish

EXAMPLES = """\b
Examples:
  d2rpick verify --tr 0.0135867 --td 0.0687534 sample_data/energy.csv
  d2rpick verify --tr 0.1 --td 0.37 --energy boxIE_J -f json sample_data/rollover.csv
"""


@click.command("verify", epilog=EXAMPLES)
@click.option("--tr", type=shared.TIME, required=True, metavar="T", help="Switch to rigid at this time.")
@click.option("--td", type=shared.TIME, required=True, metavar="T", help="Switch back to deformable at this time.")
@shared.history_options
@shared.choosing_options
@shared.output_options("table", "json", "csv", "markdown")
@click.pass_context
def command(ctx: click.Context, /, tr: float, td: float, output_format: str, exit_zero: bool, **options: Any) -> None:
    """Judge one pair of switch times against the HISTORY of a run without switching."""
    from d2rpick.choice import verify
    from d2rpick.report import verdict as report

    output = Output.of(options, options["history"])
    history = shared.read(options)
    answer = verify(history, tr, td, shared.settings(options))
    output.notes(history.notes, answer.cautions)
    if options["plot"]:
        from d2rpick import plots

        output.write(options["plot"], plots.render(plots.draw_verdict(answer), options["plot"]))
    texts = {
        "table": lambda: report.as_table(answer),
        "markdown": lambda: report.as_markdown(answer),
        "csv": lambda: report.as_csv(answer),
        "json": lambda: report.as_json(answer, ctx.meta["d2rpick.command"]),
    }
    output.result(texts[output_format]())
    finish(ctx, objection=not answer.verified, exit_zero=exit_zero)
