"""The command ``card``."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import click

from d2rpick.cli import options as shared
from d2rpick.cli.card_options import (
    all_cautions,
    card_options,
    card_request,
    check_solver,
    energy_of,
    need_ids,
    needed,
    numbers,
    printing,
)
from d2rpick.cli.output import Output, finish, text_bytes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.settings import Settings
    from d2rpick.deck.printed_card import PrintedCard, Printing, Times
    from d2rpick.histories.opening import Run

EXAMPLES = """\b
Examples:
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 11,12 --merge 11
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 1 --history sample_data/energy.csv
  d2rpick card --tr 0.02 --td 0.09 --tr 0.2 --td 0.3 --part 11
  d2rpick card --solver radioss --tr 0.0135867 --td 0.0687534 --node 1001 --end 0.15
"""

_ONLY_JUDGED = "--part chooses by whose energy a card for {} is judged; give a --history with parts"


@click.command("card", epilog=EXAMPLES)
@click.option("--tr", type=shared.TIME, multiple=True, metavar="T", help="Switch to rigid at this time; repeatable.")
@click.option("--td", type=shared.TIME, multiple=True, metavar="T", help="Switch back at this time, one for each --tr.")
@click.option("--windows", type=shared.FILE, metavar="FILE", help="Instead of both: a file with lines 'tr td'.")
@click.option(
    "--part",
    metavar="IDS",
    multiple=True,
    type=shared.NAMES,
    help="Parts to switch, by number (3,7) or range (10-19), or with --history by title.",
)
@card_options
@shared.reference_options
@shared.file_options
@shared.EXIT_ZERO
@click.pass_context
def command(ctx: click.Context, /, exit_zero: bool, **options: Any) -> None:
    """Print solver input for switching windows, ready to be pasted.

    With a history, the times are judged again as printed, and the verdict is added as a comment.
    """
    from d2rpick.deck.printing import DEFAULT, cards

    if options["solver"]:
        check_solver(options, options["solver"])
    windows = _windows(options)
    reference = shared.reference(options)
    output = Output.of(options, *_inputs(options), *(reference[0].sources if reference else ()))
    if reference is None:
        solver = options["solver"] or DEFAULT
        card, verified = cards(windows, _alone(options, solver), solver), True
    else:
        card, verified = _judged(windows, reference, options, output)
    output.notes(card.notes, ())
    output.content(text_bytes(card.text))
    finish(ctx, objection=not verified, exit_zero=exit_zero)


def _windows(options: dict[str, Any]) -> Sequence[Times]:
    """Pair the times, or read them from the file; UsageError where they do not say windows."""
    tr, td = options["tr"], options["td"]
    if options["windows"] is not None:
        if tr or td:
            raise click.UsageError("--windows excludes --tr and --td")
        from d2rpick.deck.printed_card import read_windows

        with click.open_file(options["windows"], encoding="utf-8", errors="replace") as stream:
            return read_windows(stream.read(), options["windows"])
    if not tr or not td:
        raise click.UsageError(f"a card needs {'--td' if tr else '--tr'}; or --windows, a file with lines 'tr td'")
    if len(tr) != len(td):
        raise click.UsageError(f"{len(tr)} --tr and {len(td)} --td were given, a --td for each --tr was expected")
    return list(zip(tr, td, strict=True))


def _inputs(options: dict[str, Any]) -> tuple[str, ...]:
    return () if options["windows"] in (None, "-") else (options["windows"],)


def _alone(options: dict[str, Any], solver: str) -> Printing:
    """Say what the card needs where no history says anything; UsageError where something is missing."""
    from d2rpick.deck.printing import SOLVERS

    check_solver(options, solver)
    module = SOLVERS[solver]
    if not options[module.switches]:
        raise click.UsageError(needed(module))
    if options["part"] and module.switches != "part":
        raise click.UsageError(_ONLY_JUDGED.format(module.title))
    if "end" in module.takes and options["end"] is None:
        raise click.UsageError(f"a card for {module.title} needs --end, the end of the run, or a --history")
    return printing(options, numbers("--part", options["part"]))


def _judged(
    windows: Sequence[Times], reference: tuple[Run, Settings], options: dict[str, Any], output: Output
) -> tuple[PrintedCard, bool]:
    """Write the card with the verdict of the history in its comments, and tell it on stderr too."""
    from d2rpick.choice.judged_card import judged_card
    from d2rpick.choice.of_run import Reference, verify_of
    from d2rpick.deck.printing import SOLVERS

    run, settings = reference
    history = energy_of(run, options, prints=True)
    request = card_request(run, options, history)
    module = SOLVERS[request.of(history)[0]]
    if request.printing.part and module.switches != "part":
        raise click.UsageError(_ONLY_JUDGED.format(module.title))
    judge = partial(verify_of, Reference(run, history), settings=settings)
    found = judged_card(windows, history, judge, request)
    if found is None:
        raise click.UsageError(need_ids(request, history))
    card, verdicts = found
    output.notes(history.notes, dict.fromkeys(caution for verdict in verdicts for caution in all_cautions(verdict)))
    return card, all(verdict.verified for verdict in verdicts)
