"""The command ``follow``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final

import click

from d2rpick.api.request import NOT_NEGATIVE, POSITIVE
from d2rpick.cli import options
from d2rpick.cli.output import text_bytes, with_options
from d2rpick.cli.values import click_type

if TYPE_CHECKING:
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output

EXAMPLES: Final = """\b
Examples:
  d2rpick follow --once --part box sample_data/rolloverT01.gz
  d2rpick follow --for 2 -f ndjson sample_data/rolloverT01.gz
"""


@options.command("follow", EXAMPLES)
@click.argument("run", metavar="RUN", type=click_type("file"))
@click.option(
    "--wait", type=click_type(POSITIVE), metavar="T",
    help="Time without a force that counts as flight.  [default: half of the longest inner period that is known]",
)  # fmt: skip
@click.option(
    "--once", is_flag=True, cls=options.Either, instead_of=("lasting",), help="Tell what there is now, and end."
)
@click.option(
    "--for", "lasting", type=click_type(NOT_NEGATIVE), metavar="T", cls=options.Either, instead_of=("once",),
    help="End after so many seconds.  [default: when the run has ended]",
)  # fmt: skip
@options.takes(
    *("part", "deck", "output_format", "exit_zero", "quiet"),
    deck="Main deck of the run: tells gravity, supports, bodies, and the period of parts on springs.",
    forms=("table", "ndjson"),
)
def follow(run: str, wait: float | None, once: bool, lasting: float | None, request: Request, output: Output) -> None:
    """Watch RUN, files or a folder, while it is computed: say when it flies, and when to switch.

    A line for each event: load, flight with its evidence, a switch advised, contact, restart, silence, end.  RUN need
    not have begun.  Nothing is started, stopped or changed.
    """
    from d2rpick.api.following import follow as events

    if once and lasting is not None:
        raise click.UsageError("--once and --for exclude each other")
    seconds = 0.0 if once else lasting
    failed, since = False, None
    try:
        for one in events(run, parts=request.part or None, wait=wait, deck=request.deck, lasting=seconds):
            failed, since = failed or one.event == "failed", one.time
            if output.output_format == "ndjson":
                text = json.dumps(one._asdict(), allow_nan=False)
            else:
                seen = "-" if one.seen is None else f"{one.seen:.6g}"
                text = f"{seen:>10}  {one.event:<10}  {with_options(one.message)}"
            click.echo(text_bytes(f"{text}\n"), nl=False)
    except KeyboardInterrupt:
        return
    output.finish(objection=failed or (seconds is not None and since is None))
