"""The command ``verify``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.cli import options
from d2rpick.cli.options import ANSWER, DECK_OF_PARTS, ONE_RUN
from d2rpick.cli.progress import opened, reading
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    import click

    from d2rpick.api.cards import Cards
    from d2rpick.api.request import Request
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick verify --tr 0.0135867 --td 0.0687534 sample_data/energy.csv
  d2rpick verify --tr 0.1 --td 0.37 --energy boxIE_J -f json sample_data/rollover.csv
  d2rpick verify --tr 0.0135867 --td 0.0687534 --report report.html sample_data/energy.csv
"""


class _Verify(options.Command):
    """Lets ``--switched`` take all file names that follow it, as a shell's glob gives them."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        spread: list[str] = []
        taking = False
        for arg in args:
            option = arg.startswith("-") and arg != "-"
            if taking and not option and spread[-1] != "--switched":
                spread.append("--switched")
            taking = arg == "--switched" if option else taking
            spread.append(arg)
        return super().parse_args(ctx, spread)


@options.command("verify", EXAMPLES, _Verify)
@options.time("--tr", "Switch to rigid at this time.", required=True)
@options.time("--td", "Switch back to deformable at this time.", required=True)
@options.files(
    "--switched", "Compare a finished switched run with the reference; takes all names up to the next option.", "FILE"
)
@options.takes(*ONE_RUN, *ANSWER, deck=DECK_OF_PARTS, forms=FORMATS["verdict"])
def command(tr: float, td: float, switched: tuple[str, ...], request: Request, cards: Cards, output: Output) -> None:
    """Judge one pair of switch times against the HISTORY of a run without switching."""
    from d2rpick.api.asked import ask, open_run
    from d2rpick.api.choices import judged

    prints = output.prints(cards, request)
    with opened(request, output) as (run, output):
        asked = ask(run, request, prints=prints, merge=cards.merge)
    other = None
    if switched:
        with reading(switched, quiet=output.quiet):
            other = open_run(request, switched)
        output.spare(other.sources)
    answer = judged(asked, tr, td, other)
    output.notes(asked.reference.history.notes, answer.cautions)
    output.beside_answer(answer, lambda: answer.page(options.repeat(), request.judging(), cards))
    output.answer(answer)
    output.finish(objection=not answer.verified, quality=answer.quality)
