"""Define the commands ``drive``, ``follow`` and ``first``: runs that switch themselves, and runs that are watched."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import click

from d2rpick.api.request import NOT_NEGATIVE, POSITIVE, Option, Request
from d2rpick.base.errors import make_printable
from d2rpick.cli import options
from d2rpick.cli.output import Output, encode_text, replace_arguments_for_people, tell
from d2rpick.cli.progress import show_progress
from d2rpick.cli.values import choose_click_type
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.api.drives import Driving


CMD = ("program", "CMD")


@options.make_command
@click.argument("deck", type=choose_click_type("file"))
@click.option(
    "-o", "folder", metavar="RUNDIR", required=True, type=choose_click_type("output"),
    help="Folder of the run; made if missing.",
)  # fmt: skip
@options.make_click_option(
    "part",
    Option(
        "Parts to switch.  [default: those of the bodies that the deck puts off]",
        "text",
        "IDS",
        many=True,
    ),
)
@options.make_click_option("wait", Option(
    "Time without force that counts as flight.  [default: half of the longest inner period known so far]",
    *(POSITIVE, "T"),
))  # fmt: skip
@options.make_click_option(
    "margin",
    Option(
        "From td to the contact.  [default: 2 ms, or 3% of the flight if that is more]",
        POSITIVE,
        "T",
    ),
)
@options.make_click_option(
    "starter",
    Option(
        "Command that runs the starter on {deck}.  [default: that of OPENRADIOSS_PATH]",
        *CMD,
    ),
)
@options.make_click_option(
    "engine",
    Option(
        "Command that runs the engine on {deck}.  [default: that of OPENRADIOSS_PATH]",
        *CMD,
    ),
)
@click.option(
    "--threads", type=click.IntRange(min=1), default=1, show_default=True, metavar="N",
    help="Threads of the solver; {threads} in a command.",
)  # fmt: skip
@click.option(
    "--resume", is_flag=True, help="Go on with a run that has begun in RUNDIR."
)
@click.option(
    "--dry-run", is_flag=True, help="Print what would be started, and start nothing."
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
    r"""Compute a Radioss run that switches itself: no reference is needed.

    DECK, a starter deck with one engine file, is copied into RUNDIR.  It flies when no force has acted for the wait.
    Then a rigid probe finds the next contact, and the run goes on deformable from the margin before it.  The same
    command computes the same run.  What is interrupted goes on with --resume.

    Examples
    --------
    d2rpick drive sample_data/falling_plate/plate_0000.rad --part 1 --wait 0.02 -o driven --dry-run \
        --starter 'starter -i {deck} -np 4' --engine 'mpirun -np 4 engine -i {deck}'
    """
    import signal
    from pathlib import Path

    from d2rpick.api.drives import Driving

    output = output.beside(deck)
    report = (lambda _: None) if output.quiet else tell
    driving = Driving(deck, Path(folder), report, **driving_options)
    output.notes(driving.deck.notes, driving.cautions)
    if dry_run:
        return click.echo("\n".join(_plan(driving)))
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with (
        driving.driver(resume=resume) as driver,
        show_progress(driver.progress, quiet=output.quiet),
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

    deck = driving.deck
    commands = driving.commands
    bodies = ", ".join(map(str, deck.nodes))
    return [
        f"copies    {', '.join(deck.files)} to {driving.folder}",
        f"starts    {shlex.join(commands.words('starter', f'{deck.name}_0000.rad'))}",
        f"          {shlex.join(commands.words('engine', f'{deck.name}_0001.rad'))}, and further legs",
        *(
            [f"missing   {missing}: no such program"]
            if (missing := commands.missing())
            else []
        ),
        f"switches  {len(deck.parts)} parts by main node {bodies}, to the end at {deck.end:g}",
    ]


@options.make_command
@click.argument("run", metavar="RUN", type=choose_click_type("file"))
@options.make_click_option("wait", Option(
    "Time without a force that counts as flight.  [default: half of the longest inner period that is known]",
    *(POSITIVE, "T"),
))  # fmt: skip
@click.option(
    "--once",
    is_flag=True,
    cls=options.Either,
    instead_of=("lasting",),
    help="Tell what there is now, and end.",
)
@click.option(
    "--for", "lasting", type=choose_click_type(NOT_NEGATIVE), metavar="T", cls=options.Either, instead_of=("once",),
    help="End after so many seconds.  [default: when the run has ended]",
)  # fmt: skip
@options.add_options(
    *("part", "deck", "output_format", "exit_zero", "quiet"),
    deck="Main deck of the run: tells gravity, supports, bodies, and the period of parts on springs.",
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
    """Watch RUN, files or a folder, while it is computed: say when it flies, and when to switch.

    A line for each event: load, flight with its evidence, a switch advised, contact, restart, silence, end.  RUN need
    not have begun.  Nothing is started, stopped or changed.

    Examples
    --------
    d2rpick follow --once --part box sample_data/rolloverT01.gz
    d2rpick follow --for 2 -f ndjson sample_data/rolloverT01.gz
    """
    from d2rpick.api.running import follow as events

    if once and lasting is not None:
        raise click.UsageError("--once and --for exclude each other")
    seconds = 0.0 if once else lasting
    failed, since = False, None
    for event in events(
        run, parts=request.part or None, wait=wait, deck=request.deck, lasting=seconds
    ):
        failed = failed or event.event == "failed"
        since = event.time
        if output.output_format == "ndjson":
            text = json.dumps(event._asdict(), allow_nan=False)
        else:
            seen_text = "-" if event.seen is None else f"{event.seen:.6g}"
            text = f"{seen_text:>10}  {event.event:<10}  {event.message}"
        click.echo(
            encode_text(
                f"{replace_arguments_for_people(text, output.output_format, output.columns)}\n"
            ),
            nl=False,
        )
    output.finish(objection=failed or (seconds is not None and since is None))


@options.make_command
@click.argument("deck", type=choose_click_type("file"))
@options.make_click_option(
    "part",
    Option(
        "Parts to switch, by number (3,7) or range (10-19).  [default: Radioss, those of bodies that are put off]",
        *("names", "IDS"), many=True,
    ),
)  # fmt: skip
@options.make_click_option(
    "wait",
    Option(
        "Time without force that counts as flight.  [default: by the deck]",
        POSITIVE,
        "T",
    ),
)
@options.make_click_option(
    "after", Option("Nothing becomes rigid before.", NOT_NEGATIVE, "T")
)
@options.make_click_option(
    "output_dir",
    Option(
        "Folder for the copy, made where there is none.", "output", "DIR", short=("-o",)
    ),
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
    """Write a copy of DECK whose first run switches itself: no reference run is needed.

    The solver makes the parts rigid when no contact has had a force for the wait, and deformable with the next force.
    Radioss: legs that sensors end, and the rigid bodies that the deck lacks.  LS-DYNA: switches with contact codes.

    Examples
    --------
    d2rpick first --part 1 --wait 0.02 sample_data/falling_plate/plate_0000.rad -o first/
    d2rpick first --part 1 --wait 0.02 --after 0.05 sample_data/falling_plate/plate_0000.rad -o later/
    """
    from d2rpick.api.running import first as write

    written_files = write(
        deck,
        output_dir,
        parts=part or None,
        wait=wait,
        after=after,
        overwrite=output.overwrite,
    )
    output.notes(written_files.notes, ())
    click.echo(
        "\n".join(f"written  {make_printable(name)}" for name in written_files.files)
    )
