"""The command ``replay``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output

if TYPE_CHECKING:
    from d2rpick.vibration.oscillator import State

MOST_STATES = 10_000_000  # their text takes some gigabytes
FORMATS = ("csv", "hdf5", "glstat", "matsum")  # of d2rpick.models.files, which --help does without

EXAMPLES = """\b
Examples:
  d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.01 --dt 0.001
  d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --tr 0.006 --td 0.08 \\
      --t-end 0.15 --dt 1e-4 -o switched.csv
  d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --y0 0.02 --vy0 -1.5 --t-end 0.01 --dt 0.001
"""


@click.command("replay", epilog=EXAMPLES)
@shared.oscillator_options(required=True)
@click.option("--z0", type=shared.TIME, help="Displacement of the frame at time 0.  [default: 0]")
@click.option("--y0", type=shared.TIME, help="Displacement of the suspended mass at time 0.  [default: 0]")
@click.option(
    "--vz0", type=shared.TIME, cls=shared.Either, instead_of=("v0",),
    help="Velocity of the frame at time 0; the same as --v0.  [default: 0]",
)  # fmt: skip
@click.option("--vy0", type=shared.TIME, help="Velocity of the suspended mass at time 0.  [default: 0]")
@click.option("--tr", type=shared.NOT_NEGATIVE, metavar="T", help="Switch to rigid at this time; with --td.")
@click.option("--td", type=shared.NOT_NEGATIVE, metavar="T", help="Switch back to deformable at this time.")
@click.option("--t-end", type=shared.POSITIVE, required=True, metavar="T", help="Last time.")
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

    It starts from any displacements and velocities of both masses; what is not given is 0.  Columns: time,
    displacement and velocity of frame (z) and suspended mass (y), internal and kinetic energy; at tr itself the state
    after the switch.
    """
    from d2rpick.histories.opening import format_of
    from d2rpick.models import files
    from d2rpick.vibration.oscillator import Replay, trajectory

    start = _start(**options)
    oscillator = shared.oscillator({**options, "v0": float(start.vz)})
    assert oscillator is not None  # its options are required
    if (tr is None) != (td is None):
        raise click.UsageError("--tr and --td need each other")
    if tr is not None and td is not None and not tr < td:
        raise click.UsageError(f"--tr {tr:g} is not before --td {td:g}")
    if t_end / dt > MOST_STATES:
        raise click.UsageError(f"--t-end {t_end:g} holds more than {MOST_STATES} intervals of --dt {dt:g}")
    form = write_as or format_of(options["output_file"], FORMATS)
    output = Output.of({**options, "plot": plot})
    switched = None if tr is None or td is None else Replay(oscillator, start, 0.0, tr, td)
    motion = trajectory(oscillator, start, t_end, dt, switched)
    if plot:
        from d2rpick.report import figures, figures_models

        output.write(plot, figures.render(figures_models.draw_replay(motion, switched), plot))
    if options["output_file"] or not plot:
        output.content(files.OSCILLATOR_WRITERS[form](motion, oscillator))


def _start(
    *, v0: float | None, z0: float | None, y0: float | None, vz0: float | None, vy0: float | None, **_: Any
) -> State:
    """Collect the state at time 0; UsageError when nothing or the velocity of the frame twice is given."""
    from d2rpick.vibration.oscillator import State

    if v0 is not None and vz0 is not None:
        raise click.UsageError("--v0 and --vz0 exclude each other: both are the velocity of the frame at time 0")
    given = (z0, y0, v0 if vz0 is None else vz0, vy0)
    if given == (None,) * 4:
        raise click.UsageError("the motion needs a start: --v0, or some of --z0, --y0, --vz0 and --vy0")
    return State.of(*(value or 0.0 for value in given))
