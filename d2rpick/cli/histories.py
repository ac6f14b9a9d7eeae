"""The commands ``info`` and ``extract``: what is in a history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import click

from d2rpick.api.request import READING
from d2rpick.cli import options
from d2rpick.cli.options import FILES, HISTORY, RESULT
from d2rpick.cli.output import in_words, opened
from d2rpick.report.formats import FORMATS, write

if TYPE_CHECKING:
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output

INFO: Final = """\b
Examples:
  d2rpick info sample_data/energy.glstat
  d2rpick info -f json sample_data/rollover.csv
"""


@options.command("info", INFO)
@options.takes(
    *("deck", HISTORY, *READING, *RESULT),
    deck="Main deck of the run: tells gravity, supports and imposed motion, without which flights are found.",
    forms=FORMATS["overview"],
)
def info(request: Request, output: Output) -> None:
    """Show what is in the HISTORY of a run: format, states, sampling, channels, parts, flights, health."""
    from d2rpick.choice.overview import survey

    selection = request.selection()
    with opened(request, output) as (run, output):
        overview = survey(run.files, selection, request.deck)
    output.notes((), overview.cautions)
    form = output.output_format
    shown = output.shown()
    output.result(in_words(write("overview", form, overview, shown), form, shown.width))


EXTRACT: Final = """\b
Examples:
  d2rpick extract sample_data/energy.glstat
  d2rpick extract --energy boxIE_J sample_data/rollover.csv -o box.h5
"""


@options.command("extract", EXTRACT)
@options.takes(HISTORY, *READING)
@click.option(
    "--write-as",
    type=click.Choice(["csv", "hdf5"]),
    help="Format of the result.  [default: by the name of -o, else csv]",
)
@options.takes(*FILES)
def extract(write_as: str | None, request: Request, output: Output) -> None:
    """Write the chosen energy of HISTORY as columns time and internal_energy.

    With more than one part a column part_<id> for each follows, then what else is known at these times of the whole
    model: total internal energy, kinetic energy, external work, contact energy, momentum, ... Where the files have the
    momenta of parts, those that fly together with the chosen ones count.
    """
    from d2rpick.api.runs import extracted
    from d2rpick.histories.opening import TABLES, format_of, write_table

    form = write_as or format_of(output.output_file, TABLES)
    selection = request.selection()
    with opened(request, output) as (run, output):
        table, notes = extracted(run.files, selection)
    output.notes(notes, ())
    output.content(write_table(form, table))
