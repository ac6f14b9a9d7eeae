"""The command ``info``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.api.request import READING
from d2rpick.cli import options
from d2rpick.cli.options import HISTORY, RESULT
from d2rpick.cli.output import in_words
from d2rpick.cli.progress import opened
from d2rpick.report.formats import FORMATS, write

if TYPE_CHECKING:
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick info sample_data/energy.glstat
  d2rpick info -f json sample_data/rollover.csv
"""


@options.command("info", EXAMPLES)
@options.takes(
    *("deck", HISTORY, *READING, *RESULT),
    deck="Main deck of the run: tells gravity, supports and imposed motion, without which flights are found.",
    forms=FORMATS["overview"],
)
def command(request: Request, output: Output) -> None:
    """Show what is in the HISTORY of a run: format, states, sampling, channels, parts, flights, health."""
    from d2rpick.choice.overview import survey

    selection = request.selection()
    with opened(request, output) as (run, output):
        overview = survey(run.files, selection, request.deck)
    output.notes((), overview.cautions)
    form = output.output_format
    output.result(in_words(write("overview", form, overview, output.shown()), form))
