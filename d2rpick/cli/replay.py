"""The command ``replay``."""

from __future__ import annotations

from typing import Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output

MOST_STATES = 10_000_000  # their text takes some gigabytes
FORMATS = ("csv", "hdf5", "glstat", "matsum")  # of d2rpick.report.writers, which --help does without

EXAMPLES = """\b
Examples:
  d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.01 --dt 0.001
  d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --tr 0.006 --td 0.08 \\
      --t-end 0.15 --dt 1e-4 -o switched.csv
"""


@click.command("replay", epilog=EXAMPLES)
@shared.oscillator_options(required=True)
@click.option("--tr", type=shared.NOT_NEGATIVE, metavar="T", help="Switch to rigid at this time; needs --td.")
@click.option("--td", type=shared.NOT_NEGATIVE, metavar="T", help="Switch back to deformable at this time; needs --tr.")
@click.option("--t-end", type=shared.POSITIVE, required=True, metavar="T", help="End time.")
@click.option("--dt", type=shared.POSITIVE, required=True, metavar="T", help="Output interval.")
@click.option(
    "--write-as",
    type=click.Choice(FORMATS),
    help="Format of the result.  [default: by the name of -o, else csv]",
)
@click.option(
    "--plot", metavar="FILE", type=shared.FILE, help="Draw displacements and energies to FILE (png, svg, pdf)."
)
@shared.file_options
def command(
    tr: float | None, td: float | None, t_end: float, dt: float, write_as: str | None, plot: str | None, **options: Any
) -> None:
    """Compute the floating oscillator in closed form, with or without switching.

    The frame starts with velocity v0 and everything else at rest.  Columns: time, displacement and velocity of frame
    (z) and suspended mass (y), internal and kinetic energy; the row at tr holds the state after the switch.
    """
    from d2rpick.report import writers
    from d2rpick.vibration.oscillator import State
    from d2rpick.vibration.replay import Replay, trajectory

    oscillator = shared.oscillator(options)
    assert oscillator is not None  # its options are required
    if (tr is None) != (td is None):
        raise click.UsageError("--tr and --td need each other")
    if tr is not None and td is not None and not tr < td:
        raise click.UsageError(f"--tr {tr:g} is not before --td {td:g}")
    if t_end / dt > MOST_STATES:
        raise click.UsageError(f"--t-end {t_end:g} holds more than {MOST_STATES} intervals of --dt {dt:g}")
    form = write_as or writers.format_of(options["output_file"], FORMATS)
    output = Output.of({**options, "plot": plot})
    start = State.of(0.0, 0.0, options["v0"], 0.0)
    switched = None if tr is None or td is None else Replay(oscillator, start, 0.0, tr, td)
    motion = trajectory(oscillator, start, t_end, dt, switched)
    if plot:
        from d2rpick.report import figures

        output.write(plot, figures.render(figures.draw_replay(motion, switched), plot))
    if options["output_file"] or not plot:
        output.content(writers.TRAJECTORY_WRITERS[form](motion, oscillator))
