"""The command ``card``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import click

from d2rpick.base.errors import ArgumentError
from d2rpick.cli import options
from d2rpick.cli.options import FILES, REFERENCE
from d2rpick.cli.output import text_bytes
from d2rpick.cli.settings import CARDS
from d2rpick.cli.values import click_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.api.cards import Cards
    from d2rpick.api.request import Request
    from d2rpick.api.runs import Run
    from d2rpick.choice.switched_run import Times
    from d2rpick.cli.output import Output
    from d2rpick.deck.printed_card import PrintedCard, Printing

EXAMPLES = """\b
Examples:
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 11,12 --merge 11
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 1 --history sample_data/energy.csv
  d2rpick card --tr 0.02 --td 0.09 --tr 0.2 --td 0.3 --part 11
  d2rpick card --solver radioss --tr 0.0135867 --td 0.0687534 --node 1001 --end 0.15
"""

_ONLY_JUDGED: Final = "--part chooses by whose energy a card for {} is judged; give a --history with parts"


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
    from d2rpick.deck.printing import DEFAULT
    from d2rpick.deck.printing import cards as print_cards

    if cards.solver:
        cards.check_solver(cards.solver)
    times = _windows(tr, td, windows)
    run = options.judging_run(request)
    output = output.beside(windows, *(run.sources if run else ()))
    if run is None:
        solver = cards.solver or DEFAULT
        card, verified = print_cards(times, _alone(request, cards, solver), solver), True
    else:
        card, verified = _judged(times, run, request, cards, output)
    output.notes(card.notes, ())
    output.content(text_bytes(card.text))
    output.finish(objection=not verified)


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


def _alone(request: Request, cards: Cards, solver: str) -> Printing:
    """Say what the card needs where no history says anything; ArgumentError where something is missing."""
    from d2rpick.api.cards import needed, numbers
    from d2rpick.deck.printing import SOLVERS

    cards.check_solver(solver)
    module = SOLVERS[solver]
    if not {"part": request.part, "node": cards.node}[module.switches]:
        raise ArgumentError(needed(module))
    if request.part and module.switches != "part":
        raise ArgumentError(_ONLY_JUDGED.format(module.title))
    if "end" in module.takes and cards.end is None:
        raise ArgumentError(f"a card for {module.title} needs --end, the end of the run, or a --history")
    return cards.printing(numbers("--part", request.part))


def _judged(
    windows: Sequence[Times], run: Run, request: Request, cards: Cards, output: Output
) -> tuple[PrintedCard, bool]:
    """Write the card with the verdict of the history in its comments, and tell it on stderr too."""
    from d2rpick.api.asked import ask
    from d2rpick.api.cards import all_cautions, judged
    from d2rpick.deck.printing import SOLVERS

    asked = ask(run, request, card_alone=True)
    history, wanted = asked.reference.history, cards.request(asked)
    module = SOLVERS[wanted.of(history)[0]]
    if wanted.printing.part and module.switches != "part":
        raise ArgumentError(_ONLY_JUDGED.format(module.title))
    found = judged(asked, cards, windows)
    output.notes(history.notes, all_cautions(found.verdicts))
    return found.card, found.verified
