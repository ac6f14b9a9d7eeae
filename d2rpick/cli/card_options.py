"""Options of every command that prints cards: ``card``, ``suggest -f card``, and the card in a report."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final

import click

from d2rpick.cli import options as shared

if TYPE_CHECKING:
    from collections.abc import Sequence

    from click.shell_completion import CompletionItem

    from d2rpick.choice.judged_card import CardRequest
    from d2rpick.choice.verify import Verdict
    from d2rpick.choice.warnings import Caution
    from d2rpick.deck.printed_card import Printing
    from d2rpick.deck.printed_card import Solver as Module
    from d2rpick.histories.history import History
    from d2rpick.histories.opening import Run

_RANGE: Final = r"(\d{1,10})(?:\s*-\s*(\d{1,10}))?"  # compiled where it is needed
_MOST_IDS: Final = 100_000
_NAMES: Final = ("node", "merge", "swset", "step_cap", "end", "name")


class SolverName(click.types.StringParamType):
    """Name of a solver whose input can be printed; the table of solvers is read when it is asked."""

    name = "solver"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Take a name or fail with those there are."""
        from d2rpick.deck.printing import SOLVERS

        if value not in SOLVERS:
            self.fail(f"{value!r} was found, one of {', '.join(SOLVERS)} was expected", param, ctx)
        return str(value)

    def get_metavar(self, *_: Any, **__: Any) -> str:
        """Show the names in the help."""
        from d2rpick.deck.printing import SOLVERS

        return f"[{'|'.join(SOLVERS)}]"

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002
        """Offer the names that begin so."""
        from click.shell_completion import CompletionItem

        from d2rpick.deck.printing import SOLVERS

        return [CompletionItem(name) for name in SOLVERS if name.startswith(incomplete)]


def card_options(function: shared.Decorated) -> shared.Decorated:
    """How a card is printed; collected by ``card_request``."""
    options = (
        click.option(
            "--solver", type=SolverName(),
            help="Solver whose input is printed.  [default: of the solver that wrote the history, else ls-dyna]",
        ),
        click.option(
            "--merge", type=click.IntRange(min=1), metavar="ID",
            help="LS-DYNA: lead part that all others are merged into (LRB).",
        ),
        click.option(
            "--swset", type=click.IntRange(min=1), nargs=2, metavar="ID ID",
            help="LS-DYNA: switch sets of the first window; the next ids follow.  [default: 901 902]",
        ),
        click.option(
            "--step-cap", type=shared.POSITIVE, metavar="DT", help="Largest time step while rigid (DTMAX, /DTIX)."
        ),
        click.option(
            "--node", metavar="IDS", multiple=True, type=shared.NAMES,
            help="Radioss: main nodes of the rigid bodies.",
        ),
        click.option(
            "--end", type=shared.TIME, metavar="T", help="Radioss: end of the run.  [default: end of the history]"
        ),
        click.option("--name", metavar="NAME", help="Radioss: name of the run.  [default: Root]"),
    )  # fmt: skip
    for option in reversed(options):
        function = option(function)
    return function


def printing(options: dict[str, Any], parts: Sequence[int] = ()) -> Printing:
    """Collect what a card says besides its times and its solver."""
    from d2rpick.deck.printed_card import Printing

    given = {name: options[name] for name in _given(options)}
    if "node" in given:
        given["node"] = tuple(numbers("--node", given["node"]))
    return Printing(part=tuple(parts), **given)


def check_solver(options: dict[str, Any], solver: str) -> None:
    """Raise UsageError where an option says what the input of ``solver`` has no place for."""
    from d2rpick.deck.printing import SOLVERS as MODULES

    takes = {MODULES[solver].switches, *MODULES[solver].takes}
    for name in _given(options):
        if name not in takes:
            owner = next(one for one, module in MODULES.items() if name in {module.switches, *module.takes})
            hint = "" if options["solver"] else f"; without --solver the card is one for {MODULES[solver].title}"
            raise click.UsageError(f"--{name.replace('_', '-')} is an option of --solver {owner}{hint}")


def need_ids(request: CardRequest, history: History) -> str:
    """Say which option names whom the card of the history's solver switches."""
    from d2rpick.deck.printing import SOLVERS as MODULES

    solver, _ = request.of(history)
    return needed(MODULES[solver])


def needed(solver: Module) -> str:
    """Say which option names whom the card of ``solver`` switches."""
    what = {"part": "the parts to switch", "node": "the main nodes of the rigid bodies"}
    return f"a card for {solver.title} needs --{solver.switches}, {what[solver.switches]}"


def prints_card(options: dict[str, Any], output_format: str) -> bool:
    """Whether a card is asked for, by itself or in a report; UsageError where options make no sense together."""
    prints = output_format == "card" or options["report"] is not None
    if not prints:
        shared.selection(options)
    if not prints and (given := _given(options)):
        raise click.UsageError(
            f"--{given[0].replace('_', '-')} is about the card; ask for one with -f card or --report"
        )
    return prints


def energy_of(run: Run, options: dict[str, Any], *, prints: bool) -> History:
    """Take the energy that the options choose; where a card names parts that the history has not, that of the model."""
    chosen = {**options, "part": ()} if prints and _only_printed(run, options) else options
    from d2rpick.choice.of_run import Reference

    return Reference.of(run, shared.selection(chosen)).history


def card_request(run: Run, options: dict[str, Any], history: History) -> CardRequest:
    """Say how a card is printed; UsageError where an option does not suit its solver."""
    from d2rpick.choice.judged_card import CardRequest

    ids = numbers("--part", options["part"]) if _only_printed(run, options) else []
    request = CardRequest(options["solver"], printing(options, ids))
    check_solver(options, request.of(history)[0])
    return request


def _only_printed(run: Run, options: dict[str, Any]) -> bool:
    """Whether parts stand on the card alone: a table knows none, and a named energy judges for all."""
    return bool(options["energy"]) or not run.parts


def numbers(option: str, texts: Sequence[str]) -> list[int]:
    """Numbers and ranges as they are typed; without a history nobody knows which of a range exist."""
    ids: list[int] = []
    for piece in (piece.strip() for text in texts for piece in text.split(",")):
        found = re.fullmatch(_RANGE, piece, re.ASCII)
        if not found:
            hint = "; titles need a --history that has parts" if option == "--part" else ""
            raise click.UsageError(f"{option}: {piece!r} is not a number (7) or range (10-19){hint}")
        low, high = int(found[1]), int(found[2] or found[1])
        if not low <= high < low + _MOST_IDS:
            raise click.UsageError(f"{option}: {piece!r} is not a range of 1 to {_MOST_IDS} numbers")
        ids += range(low, high + 1)
    return ids


def all_cautions(verdict: Verdict) -> tuple[Caution, ...]:
    """Cautions of a verdict, and the verdict itself where it is an objection."""
    from d2rpick.choice.warnings import Caution

    if verdict.verified:
        return verdict.cautions
    return (*verdict.cautions, Caution("not-verified", f"the times as printed: {'; '.join(verdict.reasons)}"))


def _given(options: dict[str, Any]) -> list[str]:
    return [name for name in _NAMES if options[name] not in (None, ())]
