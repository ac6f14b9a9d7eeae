"""The command ``calibrate``."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output
from d2rpick.report.formats import FORMATS, Shown, write

EXAMPLES = """\b
Examples:
  d2rpick calibrate sample_data/flying_box
  d2rpick calibrate -f toml -o site.toml sample_data/flying_box
"""


@click.command("calibrate", epilog=EXAMPLES)
@click.argument("folders", metavar="RUN...", nargs=-1, required=True, type=shared.FILE)
@shared.output_options(*FORMATS["calibration"])
@click.pass_context
def command(
    ctx: click.Context,
    /,
    folders: tuple[str, ...],
    output_format: str,
    exit_zero: bool,  # noqa: ARG001
    **options: Any,
) -> None:
    """Fit the cost of elements to what runs of a site took, for --weights.

    Each RUN is the folder of one run, with its deck and what its solver printed: listings of Radioss (NAME_0001.out,
    with /MON/ON), d3hsp or glstat of LS-DYNA.  Give runs with and without switching of the same model: what they do
    not tell apart keeps the ratio that was measured.  A run that is named twice counts once.
    """
    from d2rpick.choice.calibration import calibrate, observations_of_runs

    output = Output.of(options)
    observations, cautions = observations_of_runs(folders)
    found = replace(calibrate(observations), cautions=cautions)
    output.notes((), found.cautions)
    output.result(write("calibration", output_format, found, Shown(ctx.meta["d2rpick.command"])))
