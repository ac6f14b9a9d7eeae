"""The command ``replay``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import click

from d2rpick.api.request import NOT_NEGATIVE, OPTIONS, POSITIVE, TIME, Request, option
from d2rpick.cli import options
from d2rpick.cli.options import FILES

if TYPE_CHECKING:
    from d2rpick.cli.output import Output
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


def _same(name: str, **changes: Any) -> Any:
    """Take an option of a request."""
    return field(default=None, metadata={"option": OPTIONS[name]._replace(**changes)})


@dataclass(frozen=True)
class Motion:
    """What is computed: the oscillator, its start, and when it is rigid."""

    stiffness: float = _same("stiffness")
    mass: float = _same("mass")
    frame_mass: float | None = _same("frame_mass")
    beta: float | None = _same("beta")
    alpha: float = _same("alpha")
    v0: float | None = _same("v0", help="Velocity of the frame at time 0.")
    z0: float | None = option("Displacement of the frame at time 0.  [default: 0]", TIME)
    y0: float | None = option("Displacement of the suspended mass at time 0.  [default: 0]", TIME)
    vz0: float | None = option(
        "Velocity of the frame at time 0; the same as --v0.  [default: 0]", TIME, instead_of=("v0",)
    )
    vy0: float | None = option("Velocity of the suspended mass at time 0.  [default: 0]", TIME)
    tr: float | None = option("Switch to rigid at this time; with --td.", NOT_NEGATIVE, "T")
    td: float | None = option("Switch back to deformable at this time.", NOT_NEGATIVE, "T")
    t_end: float = option("Last time.", POSITIVE, "T")
    dt: float = option("Output interval.", POSITIVE, "T")
    write_as: str | None = option("Format of the result.  [default: by the name of -o, else csv]", FORMATS)

    @property
    def start(self) -> State:
        """The state at time 0; UsageError when nothing or the velocity of the frame twice is given."""
        from d2rpick.vibration.oscillator import State

        if self.v0 is not None and self.vz0 is not None:
            raise click.UsageError("--v0 and --vz0 exclude each other: both are the velocity of the frame at time 0")
        given = (self.z0, self.y0, self.v0 if self.vz0 is None else self.vz0, self.vy0)
        if given == (None,) * 4:
            raise click.UsageError("the motion needs a start: --v0, or some of --z0, --y0, --vz0 and --vy0")
        return State.of(*(value or 0.0 for value in given))


_NEEDED: Final = {"required": True}


@options.command("replay", EXAMPLES)
@options.takes_all(
    *(Motion, "motion"), stiffness=_NEEDED, mass=_NEEDED, alpha={"default": 0.0}, t_end=_NEEDED, dt=_NEEDED
)
@options.takes("plot", *FILES, plot="Draw displacements and energies to FILE (png, svg, pdf).")
def replay(motion: Motion, output: Output) -> None:
    """Compute the floating oscillator in closed form, with or without switching.

    It starts from any displacements and velocities of both masses; what is not given is 0.  Columns: time,
    displacement and velocity of frame (z) and suspended mass (y), internal and kinetic energy; at tr itself the state
    after the switch.
    """
    from d2rpick.histories.opening import format_of
    from d2rpick.models import files
    from d2rpick.vibration.oscillator import Replay, trajectory

    start, tr, td = motion.start, motion.tr, motion.td
    of_oscillator = {name: getattr(motion, name) for name in ("stiffness", "mass", "frame_mass", "beta", "alpha")}
    oscillator = Request(**of_oscillator, v0=float(start.vz)).oscillator
    assert oscillator is not None  # its options are required
    if (tr is None) != (td is None):
        raise click.UsageError("--tr and --td need each other")
    if tr is not None and td is not None and not tr < td:
        raise click.UsageError(f"--tr {tr:g} is not before --td {td:g}")
    if motion.t_end / motion.dt > MOST_STATES:
        raise click.UsageError(
            f"--t-end {motion.t_end:g} holds more than {MOST_STATES} intervals of --dt {motion.dt:g}"
        )
    form = motion.write_as or format_of(output.output_file, FORMATS)
    output = output.beside()
    switched = None if tr is None or td is None else Replay(oscillator, start, 0.0, tr, td)
    found = trajectory(oscillator, start, motion.t_end, motion.dt, switched)
    if output.plot:
        from d2rpick.report import figures, figures_models

        output.write(output.plot, figures.render(figures_models.draw_replay(found, switched), output.plot))
    if output.output_file or not output.plot:
        output.content(files.OSCILLATOR_WRITERS[form](found, oscillator))
