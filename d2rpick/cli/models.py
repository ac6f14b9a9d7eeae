"""Define the commands ``replay``, ``rollover`` and ``reproduce``, which compute sample runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import click

from d2rpick.api.models import HISTORIES, Box, Motion, Scanning, warn_if_unbalanced
from d2rpick.base.errors import ArgumentError, D2RPickError
from d2rpick.base.options import list_options
from d2rpick.cli import options
from d2rpick.cli.missing import list_needs_of_motion
from d2rpick.cli.options import FILES, RESULT
from d2rpick.cli.progress import show_counting
from d2rpick.report.formats import FORMATS, PLAIN, write

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.cli.output import Output


_NEEDED: Final = {"required": True}

# Columns of the solver tables, by type of table; each table also has the column time_s.
SOLVER = {
    "pairs": ("reference_m", "published_m", "better_m"),
    "run": ("z_m", "y_m", "vz_mps", "vy_mps"),
}
_SOLVER_COLUMNS: Final = ", or ".join(
    f"{', '.join(columns[:-1])} and {columns[-1]}" for columns in SOLVER.values()
)
SECTIONS = ("1", "2", "3", "4", "5")
_ABSENT = (
    "reproduce needs the folder validation of the repository, which is not installed with the package; clone the "
    "repository and call d2rpick from there: pip install -e ."
)


@options.make_command_with_needs(list_needs_of_motion)
@options.add_options(
    *list_options(Motion), of=[Motion],
    stiffness=_NEEDED, mass=_NEEDED, alpha={"default": 0.0}, t_end=_NEEDED, dt=_NEEDED,
)  # fmt: skip
@options.add_options(
    "plot",
    *FILES,
    plot="Plot displacements and energies, and write the figure to FILE (png, svg, pdf).",
)
def replay(motion: Motion, output: Output) -> None:
    r"""Compute the floating oscillator in closed form, with or without switching.

    Give the displacements and velocities of both masses at the start; the default is 0.  The columns are time,
    displacement and velocity of frame (z) and suspended mass (y), internal energy and kinetic energy.  The row at tr is
    the state after the switch.

    Examples
    --------
    d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.01 --dt 0.001
    d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --tr 0.006 --td 0.08 \
        --t-end 0.15 --dt 1e-4 -o switched.csv
    d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --y0 0.02 --vy0 -1.5 --t-end 0.01 --dt 0.001
    """
    from d2rpick.report.history_files import OSCILLATOR_WRITERS, choose_history_format

    form = choose_history_format(output.output_file, HISTORIES, motion.write_as)
    output = output.beside()
    trajectory, switched = motion.computed()
    if output.plot:
        from d2rpick.report import figures, figures_models

        output.write(
            output.plot,
            figures.render(
                figures_models.draw_replay(trajectory, switched), output.plot
            ),
        )
    if output.output_file or not output.plot:
        output.content(OSCILLATOR_WRITERS[form](trajectory, motion.oscillator))


@options.make_command
@options.add_options(*list_options(Box), of=[Box])
@options.add_options(
    *("output_format", "plot", *FILES, "exit_zero"),
    output_format={
        "type": click.Choice(list(FORMATS["rollover"])),
        "default": None,
        "help": "Format of the scan result.  [default: table]",
    },
    plot="Plot the motion of the box, or the scan, and write the figure to FILE (png, svg, pdf).",
)
def rollover(box: Box, output: Output) -> None:
    """Simulate a planar box (SI units) that trips over the curb of a braking sled and rolls, or that falls and bounces.

    The box is deformable throughout, or rigid from each tr to its td.  The step that meets the curb stays deformable
    or is switched together with the box (--with-step). The columns are time, position, roll, velocities and energies of
    the box, the momentum of box and step, and the energy balance of the model.  A glstat contains the energies of the
    model, and a matsum contains the energies of each part.

    Examples
    --------
    d2rpick rollover --t-end 0.05 -o rollover.matsum
    d2rpick rollover --mesh 8 --tr 0.09 --td 0.37 -o switched.csv --plot switched.png
    d2rpick rollover --scan --mesh 4 --td 0.15 --t-end 0.16 --plot scan.png
    d2rpick rollover --drop 0.4 --tilt 30 --mesh 4 --tr 0 --td 0.27 --tr 0.4 --td 0.5 -o tumbling.matsum
    """
    if output.output_format and not box.scan:
        raise ArgumentError("--output-format needs --scan")
    (_scan if box.scan else _run)(box, output)


def _run(box: Box, output: Output) -> None:
    """Compute one run and, for a plot, the reference run."""
    from d2rpick.report.history_files import BOX_WRITERS, choose_history_format

    form = choose_history_format(output.output_file, HISTORIES, box.write_as)
    output = output.beside()
    windows = box.windows
    plot = output.plot
    record = box.simulated(*windows)
    output.notes((), warn_if_unbalanced(record))
    if plot:
        from d2rpick.report import figures, figures_models

        reference, switched = (box.simulated(), record) if windows else (record, None)
        drawn = figures_models.draw_rollover(
            box.parameters, reference, switched, windows
        )
        output.write(plot, figures.render(drawn, plot))
    if output.output_file or not plot:
        output.content(BOX_WRITERS[form](record))


def _scan(box: Box, output: Output) -> None:
    """Compute many switched runs, one of them with the recommended tr."""
    output = output.beside()
    scanning = Scanning(box)
    plot = output.plot
    output.notes((), scanning.cautions)
    with show_counting(len(scanning.times), quiet=output.quiet) as count:
        scan = scanning.run(count.tell)
    if plot:
        from d2rpick.report import figures, figures_models

        output.write(plot, figures.render(figures_models.draw_scan(*scan[:3]), plot))
    output.result(
        write("rollover", output.output_format or "table", scan, output.shown())
    )
    output.finish(objection=scan.answer.recommended is None)


@options.make_command
@options.make_file_option(
    "--output-dir",
    "Folder for figures and tables; created if missing.",
    "DIR",
    kind="output",
    required=True,
)
@click.option(
    "--section", type=click.Choice(SECTIONS), multiple=True,
    help="Section of the paper to reproduce; repeatable.  1: the problem, and early switches of the box; 2: "
    "the oscillator; 3: finite elements; 4: the choice, the revised pair, variants; 5: the saving.",
)  # fmt: skip
@options.make_file_option(
    "--solver",
    f"Table of solver runs of the same oscillator, for comparison.  The columns are time_s, and either "
    f"{_SOLVER_COLUMNS}.  Repeatable.",
    many=True,
)
@options.add_options(
    "report", *RESULT, report="Write everything to one HTML page.", forms=PLAIN
)
def reproduce(
    output_dir: str, section: Sequence[str], solver: Sequence[str], output: Output
) -> None:
    """Reproduce the published results as figures (svg, png) and tables (csv), section by section.

    For each figure, in the order of the paper, d2rpick prints what the paper shows, what d2rpick computes, and whether
    the two agree: yes, in part or no.  Published numbers and reference values follow next to the computed values.  The
    figures of the box (sections 1 and 4) take about a minute.  The command works only in a clone of the repository,
    because it needs the folder validation.

    Examples
    --------
    d2rpick reproduce --output-dir paper --section 2
    d2rpick reproduce --output-dir paper --overwrite --section 3 --solver sample_data/oscillator_solver_6_80.csv
    d2rpick reproduce --output-dir paper --overwrite --section 5 --report paper.html -f markdown
    """
    try:
        from validation.published import command
    except ModuleNotFoundError as error:
        if not str(error.name).startswith("validation"):
            raise
        raise D2RPickError(_ABSENT) from error
    command.reproduce(output_dir, section, solver, SOLVER, output)
