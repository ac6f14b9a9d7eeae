"""The command ``info``."""

from __future__ import annotations

from typing import Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.deck_cost import deck_option
from d2rpick.cli.output import Output
from d2rpick.cli.progress import reading
from d2rpick.cli.wording import in_words
from d2rpick.report.formats import FORMATS, Shown, write

EXAMPLES = """\b
Examples:
  d2rpick info sample_data/energy.glstat
  d2rpick info -f json sample_data/rollover.csv
"""


@click.command("info", epilog=EXAMPLES)
@deck_option("Main deck of the run: tells gravity, supports and imposed motion, without which flights are found.")
@shared.history_options
@shared.output_options(*FORMATS["overview"])
@click.pass_context
def command(ctx: click.Context, /, output_format: str, exit_zero: bool, **options: Any) -> None:  # noqa: ARG001
    """Show what is in the HISTORY of a run: format, states, sampling, channels, parts, flights, health."""
    from d2rpick.choice.overview import survey

    asked = shared.Reading.of(options)
    with reading(asked.names, quiet=asked.quiet):
        run = asked.open()
        output = Output.of(options, *run.sources)
        overview = survey(run, asked.selection, options["deck"])
    output.notes((), overview.cautions)
    text = write("overview", output_format, overview, Shown(ctx.meta["d2rpick.command"]))
    output.result(in_words(text, output_format))
