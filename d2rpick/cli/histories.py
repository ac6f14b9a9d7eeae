"""The commands ``info`` and ``extract``: what is in a history."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import click

from d2rpick.api.request import READING
from d2rpick.cli import options
from d2rpick.cli.options import FILES, HISTORY, RESULT
from d2rpick.cli.output import in_words
from d2rpick.cli.progress import opened
from d2rpick.report.formats import FORMATS, write

if TYPE_CHECKING:
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output
    from d2rpick.histories.history import History, Samples

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
    output.result(in_words(write("overview", form, overview, output.shown()), form))


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
    from d2rpick.choice.of_run import Reference
    from d2rpick.histories.opening import TABLES, format_of, write_table

    form = write_as or format_of(output.output_file, TABLES)
    selection = request.selection()
    with opened(request, output) as (opened_run, output):
        run = opened_run.files
        history = Reference.of(run, selection).history
        table = {"time": history.time, "internal_energy": history.energy}
        if history.parts and len(history.parts) > 1:
            energies = run.part_energies(history.parts)
            table |= {f"part_{part.id}": column for part, column in zip(history.parts, energies.T, strict=True)}
        table |= run.quantities(history.time) | _of_model(history) | _momentum(history)
    output.notes(history.notes, ())
    output.content(write_table(form, table))


def _of_model(history: History) -> dict[str, Samples]:
    """Columns of the whole model as its balance takes them, where they are written at the times of the energy.

    The kinetic energy is that with rotation; the internal one is there where the chosen one is that of some parts.
    """
    import numpy as np

    balance = history.balance
    if balance is None or not np.array_equal(balance.time, history.time):
        return {}
    terms = {"kinetic_energy": balance.kinetic, "total_internal_energy": balance.internal if history.parts else None}
    return {name: term for name, term in terms.items() if term is not None}


def _momentum(history: History) -> dict[str, Samples]:
    """Columns of the momentum by which the flight is seen, with its mass: of what flies longest, or the chosen parts.

    Where only the velocity of the model is known, columns of that; nothing where neither is written at the times of the
    energy.
    """
    import numpy as np

    from d2rpick.flight.momentum import all_flights, to_be_asked

    asked = [one for one in to_be_asked(history.momenta) if np.array_equal(one.time, history.time)]
    if not asked:
        return {}
    momenta = next((one for one in asked if all_flights(one, history.balance)), asked[0])
    flights, members = all_flights(momenta, history.balance), momenta.chosen
    if flights and momenta.parts:
        longest = max(flights, key=lambda flight: flight.end - flight.start)
        members = tuple(momenta.parts.index(part) for part in longest.parts or momenta.parts)
    mass = momenta.mass(members)
    name = "velocity" if momenta.velocity else "momentum"
    columns = {f"{axis}_{name}": column for axis, column in zip("xyz", momenta.of(members).T.copy(), strict=True)}
    return columns | ({"mass": np.full(history.time.shape, mass)} if mass > 0 else {})
