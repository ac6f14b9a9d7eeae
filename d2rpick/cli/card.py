"""The command ``card``."""

from __future__ import annotations

import re
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import click

from d2rpick.cli import options as shared
from d2rpick.cli.output import Output, finish

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.choice.settings import Settings
    from d2rpick.choice.verify import Verdict
    from d2rpick.choice.warnings import Caution
    from d2rpick.deck.printing.cards import PrintedCard
    from d2rpick.histories.opening import Run

    Writer = Callable[[Sequence[str]], PrintedCard]

EXAMPLES = """\b
Examples:
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 11,12 --merge 11
  d2rpick card --tr 0.0135867 --td 0.0687534 --part 1 --history sample_data/energy.csv
  d2rpick card --solver radioss --tr 0.0135867 --td 0.0687534 --node 1001 --end 0.15
"""

_RANGE: Final = re.compile(r"(\d{1,10})(?:\s*-\s*(\d{1,10}))?", re.ASCII)
_MOST_IDS: Final = 100_000
_OF_SOLVER: Final = {"ls-dyna": ("merge", "swset"), "radioss": ("node", "end", "name")}


@click.command("card", epilog=EXAMPLES)
@click.option(
    "--solver",
    type=click.Choice(list(_OF_SOLVER)),
    default="ls-dyna",
    show_default=True,
    help="Whose input is printed.",
)
@click.option("--tr", type=shared.TIME, required=True, metavar="T", help="Switch to rigid at this time.")
@click.option("--td", type=shared.TIME, required=True, metavar="T", help="Switch back to deformable at this time.")
@click.option(
    "--part",
    metavar="IDS",
    multiple=True,
    help="Parts to be switched, by number (3,7) or range (10-19); with --history by title too.",
)
@click.option(
    "--merge", type=click.IntRange(min=1), metavar="ID", help="Lead part that all others are merged into (LRB)."
)
@click.option("--swset", type=click.IntRange(min=1), nargs=2, metavar="ID ID", help="Switch sets.  [default: 901 902]")
@click.option("--step-cap", type=shared.POSITIVE, metavar="DT", help="Largest time step while rigid (DTMAX, /DTIX).")
@click.option("--node", metavar="IDS", multiple=True, help="Radioss: main nodes of the rigid bodies.")
@click.option(
    "--end", type=shared.TIME, metavar="T", help="Radioss: end of the run.  [default: the end of the history]"
)
@click.option("--name", metavar="NAME", help="Radioss: name of the run.  [default: Root]")
@shared.reference_options
@shared.file_options
@shared.EXIT_ZERO
@click.pass_context
def command(ctx: click.Context, /, solver: str, exit_zero: bool, **options: Any) -> None:
    """Print solver input for one switch window, ready to be pasted.

    With a history the times are judged once more as they are printed, and the verdict stands in the comments.
    """
    for other, names in _OF_SOLVER.items():
        strange = [name for name in names if options[name] not in (None, ()) and other != solver]
        if strange:
            raise click.UsageError(f"--{strange[0]} is an option of --solver {other}")
    reference = shared.reference(options)
    run = reference[0] if reference else None
    output = Output.of(options, *(run.sources if run else ()))
    write = _radioss(options, run) if solver == "radioss" else _ls_dyna(options, run)
    if reference is None:
        card, verified = write(()), True
    else:
        card, verified = _judged(write, reference, options, output)
    output.notes(card.notes, ())
    output.content(card.text.encode())
    finish(ctx, objection=not verified, exit_zero=exit_zero)


def _judged(
    write: Writer, reference: tuple[Run, Settings], options: dict[str, Any], output: Output
) -> tuple[PrintedCard, bool]:
    """Write the card with the verdict of the history in its comments, and tell it on stderr too."""
    from d2rpick.choice.judged_card import judged

    run, settings = reference
    parts = () if options["energy"] or not run.parts else options["part"]
    history = run.history(shared.selection({**options, "part": ()})._replace(parts=parts))
    card, verdict = judged(write, history, settings)
    output.notes(history.notes, all_cautions(verdict))
    return card, verdict.verified


def all_cautions(verdict: Verdict) -> tuple[Caution, ...]:
    """Cautions of a verdict, and the verdict itself where it is an objection."""
    from d2rpick.choice.warnings import Caution

    if verdict.verified:
        return verdict.cautions
    return (*verdict.cautions, Caution("not-verified", f"the times as printed: {'; '.join(verdict.reasons)}"))


def _ls_dyna(options: dict[str, Any], run: Run | None) -> Writer:
    from d2rpick.deck.printing.cards import ls_dyna

    known = run.parts if run and not options["energy"] else ()
    if known:
        from d2rpick.histories.selection import select_parts

        ids = [part.id for part in select_parts(options["part"], known, run.name if run else "")]
    else:
        ids = _numbers("--part", options["part"])
    if not ids:
        raise click.UsageError("--solver ls-dyna needs --part, the parts to be switched")
    write = partial(ls_dyna, options["tr"], options["td"], ids, merge=options["merge"])
    write = partial(write, step_cap=options["step_cap"] or 0.0)
    if options["swset"]:
        write = partial(write, sets=options["swset"])
    return lambda remarks: write(remarks=remarks)


def _radioss(options: dict[str, Any], run: Run | None) -> Writer:
    from d2rpick.deck.printing.cards import radioss

    nodes = _numbers("--node", options["node"])
    if not nodes:
        raise click.UsageError("--solver radioss needs --node, the main nodes of the rigid bodies")
    if options["part"] and (run is None or not run.parts or options["energy"]):
        raise click.UsageError("--part chooses by whose energy --solver radioss is judged; give a --history with parts")
    end = options["end"]
    if end is None and run is not None:
        end = max(float(database.time[-1]) for database in run.databases)
    if end is None:
        raise click.UsageError("--solver radioss needs --end, the end of the run, or a --history")
    write = partial(radioss, options["tr"], options["td"], end, nodes, step_cap=options["step_cap"])
    if options["name"] is not None:
        write = partial(write, name=options["name"])
    return lambda remarks: write(remarks=remarks)


def _numbers(option: str, texts: Sequence[str]) -> list[int]:
    """Numbers and ranges as they are typed; without a history nobody knows which of a range exist."""
    ids: list[int] = []
    for piece in (piece.strip() for text in texts for piece in text.split(",")):
        found = _RANGE.fullmatch(piece)
        if not found:
            hint = "; titles need a --history that has parts" if option == "--part" else ""
            raise click.UsageError(f"{option}: {piece!r} is no number (7) or range (10-19){hint}")
        low, high = int(found[1]), int(found[2] or found[1])
        if not low <= high < low + _MOST_IDS:
            raise click.UsageError(f"{option}: {piece!r} is no range of 1 to {_MOST_IDS} numbers")
        ids += range(low, high + 1)
    return ids
