"""The commands ``replay``, ``rollover`` and ``reproduce``: runs that are computed here."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import click

from d2rpick.api.request import NOT_NEGATIVE, OPTIONS, POSITIVE, TIME, UNLIMITED, Request, dashed, option
from d2rpick.base.errors import D2RPickError
from d2rpick.cli import options
from d2rpick.cli.options import FILES, RESULT
from d2rpick.cli.progress import counting
from d2rpick.report.formats import FORMATS, PLAIN, write

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.warnings import Caution
    from d2rpick.cli.output import Output
    from d2rpick.models.box_model import Parameters
    from d2rpick.models.box_run import Record
    from d2rpick.vibration.oscillator import State


MOST_REPLAYED = 10_000_000  # their text takes some gigabytes
HISTORIES = ("csv", "hdf5", "glstat", "matsum")  # of d2rpick.models.files, which --help does without


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
    write_as: str | None = option("Format of the result.  [default: by the name of -o, else csv]", HISTORIES)

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


@options.command
@options.takes_all(
    *(Motion, "motion"), stiffness=_NEEDED, mass=_NEEDED, alpha={"default": 0.0}, t_end=_NEEDED, dt=_NEEDED
)
@options.takes("plot", *FILES, plot="Draw displacements and energies to FILE (png, svg, pdf).")
def replay(motion: Motion, output: Output) -> None:
    r"""Compute the floating oscillator in closed form, with or without switching.

    It starts from any displacements and velocities of both masses; what is not given is 0.  Columns: time,
    displacement and velocity of frame (z) and suspended mass (y), internal and kinetic energy; at tr itself the state
    after the switch.

    Examples
    --------
    d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.01 --dt 0.001
    d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --tr 0.006 --td 0.08 \
        --t-end 0.15 --dt 1e-4 -o switched.csv
    d2rpick replay --stiffness 660e3 --mass 31.4 --beta 2 --y0 0.02 --vy0 -1.5 --t-end 0.01 --dt 0.001
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
    if motion.t_end / motion.dt > MOST_REPLAYED:
        raise click.UsageError(
            f"--t-end {motion.t_end:g} holds more than {MOST_REPLAYED} intervals of --dt {motion.dt:g}"
        )
    form = motion.write_as or format_of(output.output_file, HISTORIES)
    output = output.beside()
    switched = None if tr is None or td is None else Replay(oscillator, start, 0.0, tr, td)
    found = trajectory(oscillator, start, motion.t_end, motion.dt, switched)
    if output.plot:
        from d2rpick.report import figures, figures_models

        output.write(output.plot, figures.render(figures_models.draw_replay(found, switched), output.plot))
    if output.output_file or not output.plot:
        output.content(files.OSCILLATOR_WRITERS[form](found, oscillator))


MOST_STATES = 1_000_000
PARAMETERS = ("speed", "stiffness", "yield_strain", "damping", "mesh", "drop", "tilt", "ground_stiffness")
TD = 0.37  # of the published study, 10 ms before the ground comes
TILT = 30.0  # of a box that falls: on an edge, so that it tumbles
T_END = {False: 0.42, True: 1.2}  # with a drop: some bounces
BALANCED = 0.01  # so well the energy of a run must be balanced [-]


@dataclass(frozen=True)
class Box:
    """What is computed, in SI units: the box, its windows and the scan."""

    tr: tuple[float, ...] = option(
        "Switch the box to rigid at this time; with --td, as pairs in order where there are several windows.",
        *(NOT_NEGATIVE, "T"), many=True,
    )  # fmt: skip
    td: tuple[float, ...] = option("Switch it back.  [with --scan: 0.37]", NOT_NEGATIVE, "T", many=True)
    drop: float | None = option(
        "Let the box fall on the ground from this height of its lowest point, m, instead of tripping it on the sled.",
        *(NOT_NEGATIVE, "HEIGHT"),
    )
    tilt: float | None = option("Of the box that falls.  [default: 30]", NOT_NEGATIVE, "DEG")
    ground_stiffness: float | None = option("Of the ground at a point, N/m.  [default: 5e5]", POSITIVE)
    scan: bool = option("Compute many tr, and hold each run against the one without switching.", "flag", default=False)
    jobs: int | None = option("Processes of a scan.  [default: one for each core]", range(1, UNLIMITED))
    t_end: float | None = option("Last time.  [default: 0.42, with --drop 1.2]", POSITIVE, "T")
    dt: float = option("Output interval.", POSITIVE, "T", default=1e-4)
    speed: float | None = option(
        "Of the sled at the start, m/s; of a box that falls, along x.  [default: 7, with --drop 0]", NOT_NEGATIVE
    )
    stiffness: float | None = option("Of the bars of the box, E A in N.  [default: 4.5e6]", POSITIVE)
    yield_strain: float | None = option("Of the bars of the box.  [default: 4.5e-3]", POSITIVE)
    damping: float | None = option("Rate of the mass damping, 1/s.  [default: 0.2]", NOT_NEGATIVE)
    mesh: int | None = option("Cells along each side of the box.  [default: 16]", range(4, 201))
    write_as: str | None = option("Format of a history.  [default: by the name of -o, else csv]", HISTORIES)

    @property
    def end(self) -> float:
        """Last time [s]."""
        return self.t_end or T_END[self.drop is not None]

    @property
    def parameters(self) -> Parameters:
        """The model that is meant."""
        from d2rpick.models.box_model import Parameters

        given = {name: getattr(self, name) for name in PARAMETERS if getattr(self, name) is not None}
        return Parameters(**({"speed": 0.0, "tilt": TILT, **given} if self.drop is not None else given))


@options.command
@options.takes_all(Box, "box")
@options.takes(
    *("output_format", "plot", *FILES, "exit_zero"),
    output_format={
        "type": click.Choice(list(FORMATS["rollover"])),
        "default": None,
        "help": "Form of a scan.  [default: table]",
    },
    plot="Draw the motion of the box, or the scan, to FILE (png, svg, pdf).",
)
def rollover(box: Box, output: Output) -> None:
    """Compute a planar box that trips over the curb of a braking sled and rolls, or falls and bounces.  SI units.

    It is deformable throughout, or rigid from each tr to its td; the step that meets the curb stays deformable.
    Columns: time, place, roll and velocities of the box, its energies, the momentum of box and step, and the energy
    balance of the model.  glstat holds the energies of both, matsum those of each.

    Examples
    --------
    d2rpick rollover --t-end 0.05 -o rollover.matsum
    d2rpick rollover --mesh 8 --tr 0.09 --td 0.37 -o switched.csv --plot switched.png
    d2rpick rollover --scan --mesh 4 --td 0.15 --t-end 0.16 --plot scan.png
    d2rpick rollover --drop 0.4 --tilt 30 --mesh 4 --tr 0 --td 0.27 --tr 0.4 --td 0.5 -o tumbling.matsum
    """
    _check(box, output)
    (_scan if box.scan else _run)(box, output)


def _check(box: Box, output: Output) -> None:
    """UsageError where options contradict each other."""
    if box.scan:
        lost = [name for name in ("tr", "write_as") if getattr(box, name)] + ["drop"] * (box.drop is not None)
        if lost:
            raise click.UsageError(f"--scan and --{dashed(lost[0])} exclude each other")
        if len(box.td) > 1:
            raise click.UsageError("--scan takes one --td")
    elif output.output_format or box.jobs:
        raise click.UsageError(f"--{'output-format' if output.output_format else 'jobs'} needs --scan")
    else:
        _check_windows(box.tr, box.td, box.end)
    if box.tilt is not None and box.drop is None:
        raise click.UsageError("--tilt belongs to --drop; the floor of the sled keeps its own")
    if box.end / box.dt > MOST_STATES:
        raise click.UsageError(f"--t-end {box.end:g} holds more than {MOST_STATES} intervals of --dt {box.dt:g}")


def _check_windows(starts: Sequence[float], ends: Sequence[float], t_end: float) -> None:
    """UsageError unless the times are pairs in order, within the run."""
    if len(starts) != len(ends):
        raise click.UsageError("--tr and --td need each other, as many of the one as of the other")
    before = None
    for tr, td in zip(starts, ends, strict=True):
        if not tr < td:
            raise click.UsageError(f"--tr {tr:g} is not before --td {td:g}")
        if before is not None and not before < tr:
            raise click.UsageError(f"--tr {tr:g} is not after --td {before:g} of the window before it")
        if td > t_end:
            raise click.UsageError(f"--td {td:g} lies after the end of the run, --t-end {t_end:g}")
        before = td


def _run(box: Box, output: Output) -> None:
    """One run; for a plot also the one without switching."""
    from d2rpick.histories.opening import format_of
    from d2rpick.models import files
    from d2rpick.models.box_run import RigidWindow, simulate

    form = box.write_as or format_of(output.output_file, HISTORIES)
    output = output.beside()
    parameters, plot = box.parameters, output.plot
    windows = tuple(map(RigidWindow, box.tr, box.td))

    def simulated(*rigid: RigidWindow) -> Record:
        return simulate(parameters, box.end, *rigid, interval=box.dt)

    record = simulated(*windows)
    output.notes((), _unbalanced(record))
    if plot:
        from d2rpick.report import figures, figures_models

        reference, switched = (simulated(), record) if windows else (record, None)
        output.write(plot, figures.render(figures_models.draw_rollover(parameters, reference, switched, windows), plot))
    if output.output_file or not plot:
        output.content(files.BOX_WRITERS[form](record))


def _scan(box: Box, output: Output) -> None:
    """Many switched runs, the tr that the tool recommends among them."""
    from d2rpick.base.workers import begin, cores

    begin(box.jobs or cores(), "d2rpick.models.box_run")
    from d2rpick.choice.answers import suggest
    from d2rpick.choice.question import Settings
    from d2rpick.models.box_run import comparison_end, history_of, scan, scan_times, simulate
    from d2rpick.report.rollover import Scan

    output = output.beside()
    parameters, td, plot = box.parameters, next(iter(box.td), TD), output.plot
    reference = simulate(parameters, box.end, interval=box.dt)
    comparison_end(reference, td)
    times = scan_times(reference.released or td / 3, td)
    answer = suggest(history_of(reference), td, Settings())
    cautions = (*_unbalanced(reference), *answer.cautions)
    output.notes((), cautions)
    if answer.recommended:
        times = sorted({*times, answer.recommended.tr})
    outcomes = []
    with counting(len(times), quiet=output.quiet) as count:
        for outcome in scan(parameters, reference, times, td, box.jobs):
            outcomes.append(outcome)
            count.done += 1
    if plot:
        from d2rpick.report import figures, figures_models

        output.write(plot, figures.render(figures_models.draw_scan(reference, outcomes, answer), plot))
    found = Scan(reference, outcomes, answer, cautions)
    output.result(write("rollover", output.output_format or "table", found, output.shown()))
    output.finish(objection=answer.recommended is None)


def _unbalanced(record: Record) -> tuple[Caution, ...]:
    """Object to a run whose energy is not balanced, as with damping that is over within some steps."""
    from d2rpick.choice.warnings import Caution

    off = float(abs(record.imbalance).max())
    if off <= BALANCED:
        return ()
    found = f"the energy is balanced within {off:.2g} of the largest total, {BALANCED} was expected"
    return (Caution("energy-balance", f"{found}; these parameters are beyond what the model can do"),)


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


@options.command
@options.file("--output-dir", "Folder for figures and tables; created if missing.", "DIR", required=True)
@click.option(
    "--section", type=click.Choice(SECTIONS), multiple=True,
    help="Only the figures of this section of the paper; repeatable.  1: the setting, early switches of the box; 2: "
    "the oscillator; 3: finite elements; 4: the choice, the revised pair, variants; 5: what is saved.",
)  # fmt: skip
@options.file(
    "--solver",
    "A solver's runs of the same oscillator to draw for comparison: a table of time_s and "
    f"{', or '.join(', '.join(columns) for columns in SOLVER.values())}; repeatable.",
    many=True,
)
@options.takes("report", *RESULT, report="Write all of it to one HTML page.", forms=PLAIN)
def reproduce(output_dir: str, section: Sequence[str], solver: Sequence[str], output: Output) -> None:
    """Reproduce the published results as figures (svg, png) and tables (csv), section by section.

    Each figure stands with what the paper shows there, what is found here, and whether the two agree; the table puts
    published numbers and reference values beside those found here.  The figures of the box (sections 1 and 4) take
    about half a minute.  It runs from a clone of the repository, whose folder validation holds the study.

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
