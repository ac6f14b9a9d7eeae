"""The command ``reproduce``; what it does lies in ``validation/published``, which does not ship."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.base.errors import D2RPickError
from d2rpick.cli import options
from d2rpick.cli.options import RESULT
from d2rpick.cli.values import click_type
from d2rpick.report.formats import PLAIN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick reproduce --output-dir paper --section 2
  d2rpick reproduce --output-dir paper --overwrite --section 3 --solver sample_data/oscillator_solver_6_80.csv
  d2rpick reproduce --output-dir paper --overwrite --section 5 --report paper.html -f markdown
"""
# Columns of a solver's table beside time_s, by what it is.
SOLVER = {
    "pairs": ("reference_m", "published_m", "better_m"),
    "run": ("z_m", "y_m", "vz_mps", "vy_mps"),
}
SECTIONS = ("1", "2", "3", "4", "5")
_ABSENT = (
    "reproduce needs the folder validation of the repository, which is not installed with the package; clone the "
    "repository and call d2rpick from there: pip install -e ."
)


@options.command("reproduce", EXAMPLES)
@click.option(
    "--output-dir",
    metavar="DIR",
    required=True,
    type=click_type("file"),
    help="Folder for figures and tables; created if missing.",
)
@click.option(
    "--section",
    type=click.Choice(SECTIONS),
    multiple=True,
    help="Only the figures of this section of the paper; repeatable.  1: the setting, early switches of the box; 2: "
    "the oscillator; 3: finite elements; 4: the choice, the revised pair, variants; 5: what is saved.",
)
@click.option(
    "--solver",
    metavar="FILE",
    multiple=True,
    type=click_type("file"),
    help="A solver's runs of the same oscillator to draw for comparison: a table of time_s and "
    + ", or ".join(", ".join(columns) for columns in SOLVER.values())
    + "; repeatable.",
)
@options.takes("report", *RESULT, report="Write all of it to one HTML page.", forms=PLAIN)
def reproduce(output_dir: str, section: Sequence[str], solver: Sequence[str], output: Output) -> None:
    """Reproduce the published results as figures (svg, png) and tables (csv), section by section.

    Each figure stands with what the paper shows there, what is found here, and whether the two agree; the table puts
    published numbers and reference values beside those found here.  The figures of the box (sections 1 and 4) take
    about half a minute.  It runs from a clone of the repository, whose folder validation holds the study.
    """
    try:
        from validation.published import command
    except ModuleNotFoundError as error:
        if not str(error.name).startswith("validation"):
            raise
        raise D2RPickError(_ABSENT) from error
    command.reproduce(output_dir, section, solver, output)
