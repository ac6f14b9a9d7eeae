"""The command ``calibrate``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.cli import options
from d2rpick.cli.options import RESULT
from d2rpick.cli.values import click_type
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick calibrate sample_data/flying_box
  d2rpick calibrate -f toml -o site.toml sample_data/flying_box
"""


@options.command("calibrate", EXAMPLES)
@click.argument("folders", metavar="RUN...", nargs=-1, required=True, type=click_type("file"))
@options.takes(*RESULT, forms=FORMATS["calibration"])
def calibrate(folders: tuple[str, ...], output: Output) -> None:
    """Fit the cost of elements to what runs of a site took, for --weights.

    Each RUN is the folder of one run, with its deck and what its solver printed: listings of Radioss (NAME_0001.out,
    with /MON/ON), d3hsp or glstat of LS-DYNA.  Give runs with and without switching of the same model: what they do
    not tell apart keeps the ratio that was measured.  A run that is named twice counts once.
    """
    from d2rpick.api.costs import fitted

    output = output.beside()
    answer = fitted(folders)
    output.notes((), answer.cautions)
    output.answer(answer)
