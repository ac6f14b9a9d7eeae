"""The command ``extract``."""

from __future__ import annotations

from typing import Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output
from d2rpick.cli.progress import reading

EXAMPLES = """\b
Examples:
  d2rpick extract sample_data/energy.glstat
  d2rpick extract --energy boxIE_J sample_data/rollover.csv -o box.h5
"""


@click.command("extract", epilog=EXAMPLES)
@shared.history_options
@click.option(
    "--write-as",
    type=click.Choice(["csv", "hdf5"]),
    help="Format of the result.  [default: by the name of -o, else csv]",
)
@shared.file_options
def command(write_as: str | None, **options: Any) -> None:
    """Write the chosen energy of HISTORY as columns time and internal_energy.

    With more than one part a column part_<id> for each follows.
    """
    from d2rpick.report import writers

    form = write_as or writers.format_of(options["output_file"], list(writers.TABLE_WRITERS))
    asked = shared.Reading.of(options)
    with reading(asked.names, quiet=asked.quiet):
        run = asked.open()
        output = Output.of(options, *run.sources)
        history = run.history(asked.selection)
        table = {"time": history.time, "internal_energy": history.energy}
        if history.parts and len(history.parts) > 1:
            energies = run.part_energies(history.parts)
            table |= {f"part_{part.id}": column for part, column in zip(history.parts, energies.T, strict=True)}
    output.notes(history.notes, ())
    output.content(writers.TABLE_WRITERS[form](table))
