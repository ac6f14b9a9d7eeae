"""Define the commands that show or write what the files of a run contain: ``info``, ``extract``."""

from __future__ import annotations

from dataclasses import replace

import click

from d2rpick.api.request import READING, Request
from d2rpick.cli import options
from d2rpick.cli.options import FILES, HISTORY, RESULT
from d2rpick.cli.output import Output, name_options_and_wrap, open_with_output
from d2rpick.report.formats import FORMATS, write


@options.make_command
@options.add_options(
    *("deck", "no_deck", HISTORY, *READING, *RESULT),
    deck="Main deck of the run, which defines gravity, supports and prescribed motion.",
    forms=FORMATS["overview"],
)
def info(request: Request, output: Output) -> None:
    """Show whether the HISTORY of a run can be used: flights, format, states, sampling, channels, parts, health.

    Examples
    --------
    d2rpick info sample_data/energy.glstat
    d2rpick info -f json sample_data/rollover.csv
    """
    from d2rpick.api.deck_in_folder import name_deck

    selection = request.selection()
    with open_with_output(request, output) as (run, output):
        overview = replace(run, chosen=selection).overview(request.deck or False)
    output.notes((), (*name_deck(request), *overview.cautions))
    form = output.output_format
    display = output.shown()
    output.result(
        name_options_and_wrap(
            write("overview", form, overview, display), form, display.width
        )
    )


@options.make_command
@options.add_options(HISTORY, *READING)
@click.option(
    "--write-as",
    type=click.Choice(["csv", "hdf5"]),
    help="Format of the result.  [default: suffix of -o, else csv]",
)
@options.add_options(*FILES)
def extract(write_as: str | None, request: Request, output: Output) -> None:
    """Write the chosen energy of HISTORY as columns time and internal_energy.

    With several parts, a column part_<id> follows for each.

    Columns not_chosen_part_<id> and not_chosen_spring_<id> follow for the other parts that fly with the chosen parts.

    Other columns are quantities of the whole model, such as kinetic energy, external work and momentum.

    If the files contain part momenta, the momentum is the sum over the parts that fly together with the chosen parts.
    Momenta and kinetic energies of individual parts are not written.  So times and errors that follow from this table
    may differ from the values that follow from the run.

    Examples
    --------
    d2rpick extract sample_data/energy.glstat
    d2rpick extract --energy boxIE_J sample_data/rollover.csv -o box.h5
    """
    from d2rpick.api.runs import extract_columns
    from d2rpick.report.history_files import TABLES, choose_history_format, write_table
    from d2rpick.report.next_step import name_step_after_extract

    form = choose_history_format(output.output_file, TABLES, write_as)
    selection = request.selection()
    with open_with_output(request, output) as (run, output):
        table, notes = extract_columns(run.files, selection)
    output.notes(notes, ())
    output.content(write_table(form, table))
    if output.file:
        output.next_step(name_step_after_extract(output.file))
