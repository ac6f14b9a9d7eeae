"""The command ``drive``."""

from __future__ import annotations

import shlex
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import click

from d2rpick.api.request import POSITIVE, Option
from d2rpick.cli import options
from d2rpick.cli.output import tell
from d2rpick.cli.progress import telling
from d2rpick.cli.values import click_type
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from d2rpick.api.drives import Driving
    from d2rpick.cli.output import Output
    from d2rpick.running.drive import Driver

CMD = ("text", "CMD")
EXAMPLES = """\b
Examples:
  d2rpick drive sample_data/flying_box/BOX_0000.rad --wait 0.002 -o driven --dry-run \\
      --starter 'starter -i {deck} -np 4' --engine 'mpirun -np 4 engine -i {deck}'
"""


@options.command("drive", EXAMPLES)
@click.argument("deck", type=click_type("file"))
@click.option(
    "-o", "folder", metavar="RUNDIR", required=True, type=click_type("file"), help="Folder of the run; made if missing."
)
@options.option(
    "part", Option("Parts to switch.  [default: those of the bodies that the deck puts off]", "text", "IDS", many=True)
)
@options.option(
    "wait",
    Option("Time without force that counts as flight.  [default: half of the longest inner period known so far]",
           POSITIVE, "T"),
)  # fmt: skip
@options.option(
    "margin", Option("From td to the contact.  [default: 2 ms, or 3% of the flight if that is more]", POSITIVE, "T")
)
@options.option(
    "starter", Option("Command that runs the starter on {deck}.  [default: that of OPENRADIOSS_PATH]", *CMD)
)
@options.option("engine", Option("Command that runs the engine on {deck}.  [default: that of OPENRADIOSS_PATH]", *CMD))
@click.option(
    "--threads", type=click.IntRange(min=1), default=1, show_default=True, metavar="N",
    help="Threads of the solver; {threads} in a command.",
)  # fmt: skip
@click.option("--resume", is_flag=True, help="Go on with a run that has begun in RUNDIR.")
@click.option("--dry-run", is_flag=True, help="Print what would be started, and start nothing.")
@options.takes(
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
    part: tuple[str, ...],
    wait: float | None,
    margin: float | None,
    starter: str | None,
    engine: str | None,
    threads: int,
    resume: bool,
    dry_run: bool,
    output: Output,
) -> None:
    """Compute a Radioss run that switches itself: no reference is needed.

    DECK, a starter deck with one engine file, is copied into RUNDIR.  Each flight begins when no force has acted for
    the wait; tr is the highest energy within one more.  A rigid probe finds the next contact and is thrown away.  Then
    the run is rigid to the margin before it, and goes on deformable.  What is interrupted goes on with --resume.
    """
    from d2rpick.api.drives import Asked, Driving
    from d2rpick.running.drive import Commands

    asked = Asked(
        deck=deck, folder=Path(folder), part=part, wait=wait, margin=margin,
        commands=Commands(starter, engine, threads),
    )  # fmt: skip
    output = output.beside(deck)
    driving = Driving(asked, (lambda _: None) if output.quiet else tell)
    output.notes(driving.deck.notes, driving.cautions)
    if dry_run:
        return click.echo("\n".join(_plan(driving)))
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with (
        driving.driver(resume=resume) as driver,
        telling(lambda seconds: _progress(driver, seconds), quiet=output.quiet),
    ):
        driver.prepare()
        driver.run()
        answer = driving.answer(driver, click.get_current_context().meta["d2rpick.command"])
    output.beside_answer(answer, lambda: answer.page(options.repeat()))
    return output.answer(answer)


def _plan(driving: Driving) -> list[str]:
    deck, commands = driving.deck, driving.asked.commands
    bodies = ", ".join(map(str, deck.nodes))
    return [
        f"copies    {', '.join(deck.files)} to {driving.asked.folder}",
        f"starts    {shlex.join(commands.words('starter', f'{deck.name}_0000.rad'))}",
        f"          {shlex.join(commands.words('engine', f'{deck.name}_0001.rad'))}, and further legs",
        f"switches  {len(deck.parts)} parts by main node {bodies}, to the end at {deck.end:g}",
    ]


def _progress(driver: Driver, seconds: float) -> str:
    if driver.at is None:
        return f"starting ... {seconds:.0f} s"
    order, time = driver.at
    return f"leg {order.number}, {order.kind}: {time:.6g} of {driver.limits.end:g}"
