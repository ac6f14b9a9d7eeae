"""The command ``rollover``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output, finish
from d2rpick.cli.progress import counting
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.warnings import Caution
    from d2rpick.models.box_model import Parameters
    from d2rpick.models.box_run import Record

MOST_STATES = 1_000_000
HISTORIES = ("csv", "hdf5", "glstat", "matsum")  # of d2rpick.models.files, which --help does without
PARAMETERS = ("speed", "stiffness", "yield_strain", "damping", "mesh", "drop", "tilt", "ground_stiffness")
TD = 0.37  # of the published study, 10 ms before the ground comes
TILT = 30.0  # of a box that falls: on an edge, so that it tumbles
T_END = {False: 0.42, True: 1.2}  # with a drop: some bounces
BALANCED = 0.01  # so well the energy of a run must be balanced [-]

EXAMPLES = """\b
Examples:
  d2rpick rollover --t-end 0.05 -o rollover.matsum
  d2rpick rollover --mesh 8 --tr 0.09 --td 0.37 -o switched.csv --plot switched.png
  d2rpick rollover --scan --mesh 4 --td 0.15 --t-end 0.16 --plot scan.png
  d2rpick rollover --drop 0.4 --tilt 30 --mesh 4 --tr 0 --td 0.27 --tr 0.4 --td 0.5 -o tumbling.matsum
"""


@click.command("rollover", epilog=EXAMPLES)
@click.option(
    "--tr",
    type=shared.NOT_NEGATIVE,
    multiple=True,
    metavar="T",
    help="Switch the box to rigid at this time; with --td, as pairs in order where there are several windows.",
)
@click.option("--td", type=shared.NOT_NEGATIVE, multiple=True, metavar="T", help="Switch it back.  [with --scan: 0.37]")
@click.option(
    "--drop",
    type=shared.NOT_NEGATIVE,
    metavar="HEIGHT",
    help="Let the box fall on the ground from this height of its lowest point, m, instead of tripping it on the sled.",
)
@click.option("--tilt", type=shared.NOT_NEGATIVE, metavar="DEG", help="Of the box that falls.  [default: 30]")
@click.option("--ground-stiffness", type=shared.POSITIVE, help="Of the ground at a point, N/m.  [default: 5e5]")
@click.option("--scan", is_flag=True, help="Compute many tr, and hold each run against the one without switching.")
@click.option("--jobs", type=click.IntRange(min=1), help="Processes of a scan.  [default: one for each core]")
@click.option("--t-end", type=shared.POSITIVE, metavar="T", help="Last time.  [default: 0.42, with --drop 1.2]")
@click.option("--dt", type=shared.POSITIVE, default=1e-4, show_default=True, metavar="T", help="Output interval.")
@click.option(
    "--speed",
    type=shared.NOT_NEGATIVE,
    help="Of the sled at the start, m/s; of a box that falls, along x.  [default: 7, with --drop 0]",
)
@click.option("--stiffness", type=shared.POSITIVE, help="Of the bars of the box, E A in N.  [default: 4.5e6]")
@click.option("--yield-strain", type=shared.POSITIVE, help="Of the bars of the box.  [default: 4.5e-3]")
@click.option("--damping", type=shared.NOT_NEGATIVE, help="Rate of the mass damping, 1/s.  [default: 0.2]")
@click.option("--mesh", type=click.IntRange(4, 200), help="Cells along each side of the box.  [default: 16]")
@click.option(
    "--write-as", type=click.Choice(HISTORIES), help="Format of a history.  [default: by the name of -o, else csv]"
)
@click.option(
    "-f", "--output-format", type=click.Choice(list(FORMATS["rollover"])), help="Form of a scan.  "
    "[default: table]",
)  # fmt: skip
@click.option(
    "--plot", metavar="FILE", type=shared.FILE, help="Draw the motion of the box, or the scan, to FILE (png, svg, pdf)."
)
@shared.file_options
@shared.EXIT_ZERO
@click.pass_context
def command(ctx: click.Context, /, scan: bool, **options: Any) -> None:
    """Compute a planar box that trips over the curb of a braking sled and rolls, or falls and bounces.  SI units.

    It is deformable throughout, or rigid from each tr to its td; the step that meets the curb stays deformable.
    Columns: time, place, roll and velocities of the box, its energies, the momentum of box and step, and the energy
    balance of the model.  glstat holds the energies of both, matsum those of each.
    """
    options["t_end"] = options["t_end"] or T_END[options["drop"] is not None]
    _check(scan=scan, **options)
    if scan:
        _scan(ctx, options)
    else:
        _run(options)


def _check(*, scan: bool, t_end: float, dt: float, drop: float | None, tilt: float | None, **options: Any) -> None:
    """UsageError where options contradict each other."""
    if scan:
        lost = [name for name in ("tr", "write_as") if options[name]] + (["drop"] if drop is not None else [])
        if lost:
            raise click.UsageError(f"--scan and --{lost[0].replace('_', '-')} exclude each other")
        if len(options["td"]) > 1:
            raise click.UsageError("--scan takes one --td")
    elif options["output_format"] or options["jobs"]:
        raise click.UsageError(f"--{'output-format' if options['output_format'] else 'jobs'} needs --scan")
    else:
        _check_windows(options["tr"], options["td"], t_end)
    if tilt is not None and drop is None:
        raise click.UsageError("--tilt belongs to --drop; the floor of the sled keeps its own")
    if t_end / dt > MOST_STATES:
        raise click.UsageError(f"--t-end {t_end:g} holds more than {MOST_STATES} intervals of --dt {dt:g}")


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


def _parameters(options: dict[str, Any]) -> Parameters:
    from d2rpick.models.box_model import Parameters

    given = {name: options[name] for name in PARAMETERS if options[name] is not None}
    if options["drop"] is not None:
        given = {"speed": 0.0, "tilt": TILT, **given}
    return Parameters(**given)


def _run(options: dict[str, Any]) -> None:
    """One run; for a plot also the one without switching."""
    from d2rpick.histories.opening import format_of
    from d2rpick.models import files
    from d2rpick.models.box_run import RigidWindow, simulate

    form = options["write_as"] or format_of(options["output_file"], HISTORIES)
    output = Output.of(options)
    parameters, plot = _parameters(options), options["plot"]
    windows = tuple(map(RigidWindow, options["tr"], options["td"]))

    def simulated(*rigid: RigidWindow) -> Record:
        return simulate(parameters, options["t_end"], *rigid, interval=options["dt"])

    record = simulated(*windows)
    output.notes((), _unbalanced(record))
    if plot:
        from d2rpick.report import figures, figures_models

        reference, switched = (simulated(), record) if windows else (record, None)
        output.write(plot, figures.render(figures_models.draw_rollover(parameters, reference, switched, windows), plot))
    if options["output_file"] or not plot:
        output.content(files.BOX_WRITERS[form](record))


def _scan(ctx: click.Context, options: dict[str, Any]) -> None:
    """Many switched runs, the tr that the tool recommends among them."""
    from d2rpick.workers import begin, cores

    begin(options["jobs"] or cores(), "d2rpick.models.box_run")
    from d2rpick.models.box_run import simulate
    from d2rpick.models.box_scan import comparison_end, scan, scan_times, suggestion_for
    from d2rpick.report.formats import Shown, write
    from d2rpick.report.rollover import Scan

    output = Output.of(options)
    parameters, td, plot = _parameters(options), next(iter(options["td"]), TD), options["plot"]
    reference = simulate(parameters, options["t_end"], interval=options["dt"])
    comparison_end(reference, td)
    times = scan_times(reference.released or td / 3, td)
    answer = suggestion_for(reference, td)
    cautions = (*_unbalanced(reference), *answer.cautions)
    output.notes((), cautions)
    if answer.recommended:
        times = sorted({*times, answer.recommended.tr})
    outcomes = []
    with counting(len(times), quiet=options["quiet"]) as count:
        for outcome in scan(parameters, reference, times, td, options["jobs"]):
            outcomes.append(outcome)
            count.done += 1
    if plot:
        from d2rpick.report import figures, figures_models

        output.write(plot, figures.render(figures_models.draw_scan(reference, outcomes, answer), plot))
    found = Scan(reference, outcomes, answer, cautions)
    output.result(write("rollover", options["output_format"] or "table", found, Shown(ctx.meta["d2rpick.command"])))
    finish(ctx, objection=answer.recommended is None, exit_zero=options["exit_zero"])


def _unbalanced(record: Record) -> tuple[Caution, ...]:
    """Object to a run whose energy is not balanced, as with damping that is over within some steps."""
    from d2rpick.choice.warnings import Caution

    off = float(abs(record.imbalance).max())
    if off <= BALANCED:
        return ()
    found = f"the energy is balanced within {off:.2g} of the largest total, {BALANCED} was expected"
    return (Caution("energy-balance", f"{found}; these parameters are beyond what the model can do"),)
