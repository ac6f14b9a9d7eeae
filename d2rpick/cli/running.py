"""Define the commands ``drive``, ``follow`` and ``first``, for runs in which parts are switched while they run."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from d2rpick.base.errors import make_printable
from d2rpick.base.options import NOT_NEGATIVE, POSITIVE, UNLIMITED, Option
from d2rpick.cli import options
from d2rpick.cli.missing import list_needs_of_drive, list_needs_of_first
from d2rpick.cli.output import Output, encode_text, name_options_and_wrap, tell
from d2rpick.cli.progress import show_progress
from d2rpick.cli.values import SECONDS, choose_click_type
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.api.drives import Driving
    from d2rpick.api.request import Request
    from d2rpick.report.follow import Event


CMD = ("program", "CMD")


@options.make_command_with_needs(list_needs_of_drive)
@click.argument("deck", type=choose_click_type("file"))
@click.option(
    "-o", "folder", metavar="RUNDIR", required=True, type=choose_click_type("output"),
    help="Folder of the run; created if missing.",
)  # fmt: skip
@options.make_click_option(
    "part",
    Option(
        "Parts to switch.  [default: parts of the rigid bodies that the deck deactivates]",
        "text",
        "IDS",
        many=True,
    ),
)
@options.make_click_option("wait", Option(
    "Time without force after which the parts are treated as flying.  [default: half of the "
    "longest vibration period found so far]",
    *(POSITIVE, "T"),
))  # fmt: skip
@options.make_click_option(
    "margin",
    Option(
        "Time from td to the next contact.  [default: 2 ms, or 3% of the flight if longer]",
        POSITIVE,
        "T",
    ),
)
@options.make_click_option(
    "starter",
    Option(
        "Command that runs the starter on {deck}.  [default: starter in OPENRADIOSS_PATH]",
        *CMD,
    ),
)
@options.make_click_option(
    "engine",
    Option(
        "Command that runs the engine on {deck}.  [default: engine in OPENRADIOSS_PATH]",
        *CMD,
    ),
)
@click.option(
    "--threads", type=choose_click_type(range(1, UNLIMITED)), default=1, show_default=True, metavar="N",
    help="Threads of the solver; {threads} in a command.",
)  # fmt: skip
@click.option("--resume", is_flag=True, help="Resume a run that was started in RUNDIR.")
@click.option(
    "--dry-run",
    is_flag=True,
    help="Print the commands of the run without starting them.",
)
@options.add_options(
    "report",
    "output_format",
    "overwrite",
    "quiet",
    report="Write windows, energy and evidence to one HTML page.",
    forms=FORMATS["drive"],
)
def drive(
    deck: str,
    folder: str,
    resume: bool,
    dry_run: bool,
    output: Output,
    **driving_options: Any,
) -> None:
    r"""Run a Radioss model without a reference run; d2rpick chooses the switching times as the run proceeds.

    DECK, a starter deck with one engine file, is copied into RUNDIR.  When no force has acted on the parts for the time
    of --wait, they are treated as flying.  A rigid probe run then finds the next contact.  The parts become deformable
    at the time --margin before this contact.  The result is reproducible: the same command gives the same run.
    --resume continues an interrupted run.

    Examples
    --------
    d2rpick drive sample_data/falling_plate/plate_0000.rad --part 1 --wait 0.02 -o driven --dry-run \
        --starter 'starter -i {deck} -np 4' --engine 'mpirun -np 4 engine -i {deck}'
    """
    import signal
    from functools import partial
    from pathlib import Path

    from d2rpick.api.drives import Driving
    from d2rpick.report.drive import describe_progress

    output = output.beside(deck)
    report = (lambda _: None) if output.quiet else tell
    driving = Driving(deck, Path(folder), report, **driving_options)
    output.notes(driving.deck.notes, driving.cautions)
    if dry_run:
        driving.refuse_other_files()
        click.echo("\n".join(_plan(driving)))
        return output.finish(objection=bool(driving.commands.missing()))
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with (
        driving.driver(resume=resume) as driver,
        show_progress(partial(describe_progress, driver), quiet=output.quiet),
    ):
        driver.prepare()
        driver.run()
        answer = driving.answer(
            driver, click.get_current_context().meta["d2rpick.command"]
        )
    output.beside_answer(answer, lambda: answer.page(options.repeat_command()))
    return output.answer(answer)


def _plan(driving: Driving) -> list[str]:
    import shlex

    from d2rpick.report.parts import format_count
    from d2rpick.report.tables import quote_shell_line

    deck = driving.deck
    commands = driving.commands
    bodies = ", ".join(map(str, deck.nodes))
    typed = click.get_current_context().meta["d2rpick.command"]
    again = quote_shell_line(
        ["d2rpick", *(word for word in typed if word != "--dry-run")]
    )
    missing = commands.missing()
    correct = (
        f"correct --starter or --engine, because there is no program {missing!r}, then "
    )
    return [
        f"next      {correct * bool(missing)}start the run with {again}",
        f"copies    {', '.join(deck.files)} to {driving.folder}",
        f"starts    {shlex.join(commands.words('starter', f'{deck.name}_0000.rad'))}",
        f"          {shlex.join(commands.words('engine', f'{deck.name}_0001.rad'))}, and further engine runs",
        f"switches  {format_count(len(deck.parts), 'part')} by main node {bodies}",
        f"ends      at {deck.end:g}",
    ]


@options.make_command
@click.argument("run", metavar="RUN", type=choose_click_type("file"))
@options.make_click_option("wait", Option(
    "Time without force after which the parts are treated as flying.  [default: half of the "
    "longest vibration period found]",
    *(POSITIVE, "T"),
))  # fmt: skip
@click.option(
    "--once",
    is_flag=True,
    cls=options.Either,
    instead_of=("lasting",),
    help="Report the present state, and exit.",
)
@click.option(
    "--for", "lasting", type=choose_click_type(NOT_NEGATIVE), metavar=SECONDS, cls=options.Either, instead_of=("once",),
    help="Stop watching after this number of seconds.  [default: when the run has ended]",
)  # fmt: skip
@options.add_options(
    *("part", "deck", "output_format", "exit_zero", "quiet"),
    deck="Main deck of the run, which defines gravity, supports, bodies, and the vibration period of parts on springs.",
    forms=("table", "ndjson"),
)
def follow(
    run: str,
    wait: float | None,
    once: bool,
    lasting: float | None,
    request: Request,
    output: Output,
) -> None:
    """Watch RUN (a file or a folder) while the solver computes it, and report when the parts fly and when to switch.

    d2rpick prints a line for each event: load, flight with its evidence, recommended switch, contact, restart, no
    output, end.  RUN need not have started.  d2rpick does not start, stop or change anything.

    With --once or --for, the exit code is 0 if the parts fly at the last state.  It is 1 if they do not fly but the run
    may continue.  It is 2 if the run has ended without flying parts, or if RUN does not exist.

    Examples
    --------
    d2rpick follow --once --part box sample_data/rollover_box.matsum
    d2rpick follow --for 2 -f ndjson sample_data/rollover_box.matsum
    """
    from d2rpick.api.running import follow as events

    if once and lasting is not None:
        raise click.UsageError("--once and --for exclude each other")
    seconds = 0.0 if once else lasting
    last: Event | None = None
    ending = ""
    for event in events(
        run, parts=request.part or None, wait=wait, deck=request.deck, lasting=seconds
    ):
        last = event
        if event.event in ("ended", "failed", "restart"):
            ending = event.event
        if output.output_format == "ndjson":
            text = json.dumps(event._asdict(), allow_nan=False)
        else:
            seen_text = "-" if event.seen is None else f"{event.seen:.6g}"
            text = f"{seen_text:>10}  {event.event:<10}  {event.message}"
        click.echo(
            encode_text(
                f"{name_options_and_wrap(text, output.output_format, output.columns)}\n"
            ),
            nl=False,
        )
    if seconds is None:
        output.finish(objection=ending == "failed")
    else:
        assert last is not None
        _finish_look(run, last, ending, output)


def _finish_look(run: str, last: Event, ending: str, output: Output) -> None:
    """Exit with 0 if the parts fly at the last state, 2 if they never will, and otherwise 1.

    A script that waits for a flight needs the difference between 1 and 2. ``ending`` is the last event that ends or
    restarts the run.
    """
    if last.seen is None and not _exists(run):
        tell("d2rpick: exit code 2: there is no such file or folder")
        click.get_current_context().exit(2)
    code, reason = 0, ""
    if ending == "failed":
        code, reason = 2, "the run has ended with an error"
    elif last.time is None and ending == "ended":
        code, reason = 2, "the run has ended, and the parts do not fly"
    elif last.time is None:
        code, reason = 1, "the parts do not fly at the last state"
    if code and not output.exit_zero:
        tell(f"d2rpick: exit code {code}: {reason}")
        click.get_current_context().exit(code)


def _exists(run: str) -> bool:
    """Return True if a name is that of a file or folder, or a pattern that matches one."""
    from glob import glob
    from pathlib import Path

    return Path(run).exists() or bool(glob(run, recursive=True))  # noqa: PTH207  Path.glob needs the folder


@options.make_command_with_needs(list_needs_of_first)
@click.argument("deck", type=choose_click_type("file"))
@options.make_click_option(
    "part",
    Option(
        "Parts to switch, by number (3,7) or range (10-19).  [default: for Radioss, parts of the rigid bodies that "
        "the deck deactivates]",
        *("names", "IDS"), many=True,
    ),
)  # fmt: skip
@options.make_click_option(
    "wait",
    Option(
        "Time without force after which the parts are treated as flying.  [default: derived from the deck]",
        POSITIVE,
        "T",
    ),
)
@options.make_click_option(
    "after", Option("Time before which nothing becomes rigid.", NOT_NEGATIVE, "T")
)
@options.make_click_option(
    "output_dir",
    Option("Folder for the copy; created if missing.", "output", "DIR", short=("-o",)),
    required=True,
)
@options.add_options("overwrite", "quiet")
def first(
    deck: str,
    part: tuple[str, ...],
    wait: float | None,
    after: float | None,
    output_dir: str,
    output: Output,
) -> None:
    """Write a copy of DECK that switches the parts in its first run, so that no reference run is needed.

    Radioss makes the parts rigid when no contact force has acted for the time of --wait, and deformable at the next
    force.  The copy contains the missing rigid bodies, and engine files with sensors that end the engine runs.

    LS-DYNA makes the parts rigid as soon as no force acts, and deformable at the next force.  They then stay deformable
    for at least the time of --wait.  The copy contains switches with contact codes.

    Examples
    --------
    d2rpick first --part 1 --wait 0.02 sample_data/falling_plate/plate_0000.rad -o first/
    d2rpick first --part 1 --wait 0.02 --after 0.05 sample_data/falling_plate/plate_0000.rad -o later/
    """
    from d2rpick.api.running import first as write
    from d2rpick.report.next_step import name_step_after_first

    written_files = write(
        deck,
        output_dir,
        parts=part or None,
        wait=wait,
        after=after,
        overwrite=output.overwrite,
    )
    output.notes(written_files.notes, ())
    click.echo(f"next     {make_printable(name_step_after_first(output_dir))}")
    click.echo(
        "\n".join(f"written  {make_printable(name)}" for name in written_files.files)
    )
