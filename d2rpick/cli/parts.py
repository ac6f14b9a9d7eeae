"""The command ``parts``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli import typed
from d2rpick.cli.deck_cost import model_of, model_options
from d2rpick.cli.output import Output, finish, text_bytes
from d2rpick.cli.progress import reading
from d2rpick.cli.wording import in_words, with_options
from d2rpick.report.formats import FORMATS, Shown, write

if TYPE_CHECKING:
    from d2rpick.choice.switched_run import Times

EXAMPLES = """\b
Examples:
  d2rpick parts sample_data/rollover_box.matsum
  d2rpick parts --deck sample_data/rollover_box.k sample_data/rollover_box.matsum
  d2rpick parts --deck sample_data/rollover_box.k -f json sample_data/rollover_box.matsum
  d2rpick parts --deck sample_data/rollover_box.k --report parts.html sample_data/rollover_box.matsum
"""


@click.command("parts", epilog=EXAMPLES)
@model_options
@click.option("--tr", type=shared.TIME, metavar="T", help="With --td: compare the sets in this window.")
@click.option(
    "--td", type=shared.TIME, metavar="T",
    help="Compare the sets in a window that ends here.  [default: at the end of the longest flight]",
)  # fmt: skip
@shared.history_options
@shared.judging_options
@click.option(
    "--step-ratio", type=shared.STEP_RATIO, metavar="N", help="Time step while rigid over that before, 1 or more."
)
@click.option("--report", metavar="FILE", type=shared.FILE, help="Write everything to one HTML page to read and sign.")
@shared.output_options(*FORMATS["parts"])
@click.pass_context
def command(
    ctx: click.Context,
    /,
    tr: float | None,
    td: float | None,
    output_format: str,
    exit_zero: bool,
    **options: Any,
) -> None:
    """Say which parts of a run may be switched, and what sets of them save.

    Each part with its elements, material, mass and energy, and a verdict with its reasons; then sets of parts with the
    run time that they save, and the one to take.  A set that --part names is compared too.
    """
    from d2rpick.choice.sets_of_parts import given_parts, parts_of

    times = _times(tr, td)
    asked, settings = shared.Reading.of({**options, "part": ()}), shared.settings(options)
    if asked.selection.energy:
        raise click.UsageError("--energy names one energy for the whole model; parts compares those of its parts")
    with reading(asked.names, quiet=asked.quiet):
        run = asked.open()
        output = Output.of(options, *run.sources)
        model = model_of(options)
    beside = [options["deck"]] if options["deck"] else []
    given = given_parts(run, options["part"])
    found = parts_of(run, settings, model, given=given, times=times, beside=beside)
    output.notes(run.notes, found.cautions)
    if options["report"]:
        from d2rpick.report.pages import parts_page

        output.write(options["report"], text_bytes(with_options(parts_page(found, typed.repeat()))))
    text = write("parts", output_format, found, Shown(ctx.meta["d2rpick.command"]))
    output.result(in_words(text, output_format))
    return finish(ctx, objection=found.recommended is None, exit_zero=exit_zero)


def _times(tr: float | None, td: float | None) -> Times | float | None:
    if tr is not None and td is None:
        raise click.UsageError("--tr needs --td, the end of the window")
    if tr is not None and td is not None and not tr < td:
        raise click.UsageError(f"--tr {tr:g} --td {td:g}: tr must lie before td")
    return td if tr is None or td is None else (tr, td)
