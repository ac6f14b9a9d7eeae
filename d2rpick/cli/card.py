"""The command ``card``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.cli import options
from d2rpick.cli.options import FILES, REFERENCE
from d2rpick.cli.output import text_bytes
from d2rpick.cli.settings import CARDS
from d2rpick.cli.values import click_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.api.cards import Cards
    from d2rpick.api.request import Request
    from d2rpick.choice.switched_run import Times
    from d2rpick.cli.output import Output

EXAMPLES = """\b
Examples:
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 11,12 --merge 11
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 1 --history sample_data/energy.csv
  d2rpick card --tr 0.02 --td 0.09 --tr 0.2 --td 0.3 --part 11
  d2rpick card --solver radioss --tr 0.0135867 --td 0.0687534 --node 1001 --end 0.15
"""


@options.command("card", EXAMPLES)
@options.time("--tr", "Switch to rigid at this time; repeatable.", many=True)
@options.time("--td", "Switch back at this time, one for each --tr.", many=True)
@options.file("--windows", "Instead of both: a file with lines 'tr td'.")
@options.takes(
    *("part", *CARDS, *REFERENCE, *FILES, "exit_zero"),
    part={
        "help": "Parts to switch, by number (3,7) or range (10-19), or with --history by title.",
        "type": click_type("names"),
        "instead_of": (),
    },
)
def card(
    tr: tuple[float, ...], td: tuple[float, ...], windows: str | None, request: Request, cards: Cards, output: Output
) -> None:
    """Print solver input for switching windows, ready to be pasted.

    With a history, the times are judged again as printed, and the verdict is added as a comment.
    """
    from d2rpick.api.cards import all_cautions, card_of

    if cards.solver:
        cards.check_solver(cards.solver)
    times = _windows(tr, td, windows)
    run = options.judging_run(request)
    output = output.beside(windows, *(run.sources if run else ()))
    found = card_of(times, run, request, cards)
    read = found.verdicts[0].situation.history.notes if found.verdicts else ()
    output.notes(read, all_cautions(found.verdicts))
    output.notes(found.card.notes, ())
    output.content(text_bytes(found.card.text))
    output.finish(objection=not found.verified)


def _windows(tr: Sequence[float], td: Sequence[float], file: str | None) -> Sequence[Times]:
    """Pair the times, or read them from the file; UsageError where they do not say windows."""
    if file is not None:
        if tr or td:
            raise click.UsageError("--windows excludes --tr and --td")
        return options.windows_in(file)
    if not tr or not td:
        raise click.UsageError(f"a card needs {'--td' if tr else '--tr'}; or --windows, a file with lines 'tr td'")
    if len(tr) != len(td):
        raise click.UsageError(f"{len(tr)} --tr and {len(td)} --td were given, a --td for each --tr was expected")
    return list(zip(tr, td, strict=True))
