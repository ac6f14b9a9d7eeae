"""Define the commands ``card``, ``check`` and ``rule`` for the switching cards in decks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.base.errors import INTERNAL_ERROR
from d2rpick.cli import options
from d2rpick.cli.missing import list_needs_of_card
from d2rpick.cli.options import FILES, REFERENCE, RESULT
from d2rpick.cli.output import (
    Output,
    explain_error,
    name_options_and_wrap,
    tell,
)
from d2rpick.cli.values import CARDS, choose_click_type
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.api.cards import Cards
    from d2rpick.api.request import Request


@options.make_command_with_needs(list_needs_of_card)
@options.make_time_option(
    "--tr", "Switch to rigid at this time; repeatable.", many=True
)
@options.make_time_option(
    "--td", "Switch back at this time, one for each --tr.", many=True
)
@options.make_file_option(
    "--windows", "File with lines 'tr td', instead of --tr and --td."
)
@options.add_options(
    *("part", *CARDS, "deck", "no_deck", *REFERENCE, *FILES, "exit_zero"),
    deck="Main deck of the run, which defines the parts that become one rigid body; it is checked with the card.",
    part={
        "help": "Parts to switch: number (3,7) or range (10-19); with --history also title, "
        '"flying", "all" or, with --deck too, "recommended".',
        "type": choose_click_type("names"),
        "instead_of": (),
    },
)
def card(
    tr: tuple[float, ...],
    td: tuple[float, ...],
    windows: str | None,
    request: Request,
    cards: Cards,
    output: Output,
) -> None:
    """Print solver input for rigid windows, ready to be pasted.

    With a history, d2rpick judges the times as printed, and adds the verdict as a comment.  With the deck of the run,
    it merges parts that share nodes, and checks the deck with the card in it.  --deck also works without --history.

    Examples
    --------
    d2rpick card --tr 0.0135867 --td 0.0687534 --part 11,12 --merge 11
    d2rpick card --tr 0.0135867 --td 0.0687534 --part 1 --history sample_data/energy.csv
    d2rpick card --tr 0.02 --td 0.09 --tr 0.2 --td 0.3 --part 11
    d2rpick card --solver radioss --tr 0.0135867 --td 0.0687534 --node 1001 --end 0.15
    """
    # Imported here to keep the start of the other commands fast.
    from d2rpick.api.judged_cards import collect_cautions, print_card

    if cards.solver:
        cards.check_solver(cards.solver)
    times = _read_windows(tr, td, windows)
    run = options.open_judging_run(request)
    output = output.beside(windows, *(run.sources if run else ()))
    judged_card = print_card(times, run, request, cards, windows or "")
    question = request.repeat()
    if judged_card.verdicts:
        history = judged_card.verdicts[0].situation.history
        output.notes(history.notes, ())
        if not history.parts:
            # Only the parts of the card are used.
            question = question._replace(parts=())
    output.card(judged_card, collect_cautions(judged_card), question, request.deck)
    if judged_card.worst:
        settings = judged_card.verdicts[0].situation.settings
        output.finish_by_verdict(judged_card.worst, settings.min_quality)
    output.finish(objection=judged_card.has_errors)


def _read_windows(
    tr: Sequence[float], td: Sequence[float], file: str | None
) -> Sequence[tuple[float, float]]:
    """Return the windows from pairs of times or from a file; raise UsageError if the pairs are incomplete."""
    if file is not None:
        if tr or td:
            raise click.UsageError("--windows excludes --tr and --td")
        return options.read_windows_in(file)
    if len(tr) != len(td):
        raise click.UsageError(
            f"{len(tr)} --tr and {len(td)} --td were given, but a --td for each --tr was expected"
        )
    return list(zip(tr, td, strict=True))


@options.make_command
@click.argument(
    "deck", metavar="DECK...", nargs=-1, required=True, type=choose_click_type("file")
)
@options.add_options(*REFERENCE)
@click.option(
    "--select", metavar="IDS", multiple=True, type=choose_click_type("rules"),
    help="Check only these rules, by id or by the beginning of the id: D2R101,D2R2.  [default: the rules selected in "
    "d2rpick.toml or pyproject.toml, otherwise all]",
)  # fmt: skip
@click.option(
    "--ignore",
    metavar="IDS",
    multiple=True,
    type=choose_click_type("rules"),
    help="Skip these rules; takes precedence over --select.",
)
@click.option(
    "--fail-on", type=click.Choice(["error", "warning"]), default="error", show_default=True,
    help="Exit with 1 for findings of at least this severity.",
)  # fmt: skip
@options.add_options(*RESULT, forms=FORMATS["findings"])
def check(
    deck: tuple[str, ...],
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    fail_on: str,
    request: Request,
    output: Output,
) -> None:
    """Find the switching cards of LS-DYNA decks and Radioss runs, and check them against deck and history.

    Each DECK is read with its includes.  A folder means the main decks in it, and `-` means standard input.  The
    starter deck and the engine files of a Radioss run are one DECK; name any of them.  `d2rpick rule` lists the rules.
    A comment line `$ d2rpick: ignore D2R104` before a card (Radioss: `#`) turns this rule off for the card.

    Examples
    --------
    d2rpick check sample_data/switching.k
    d2rpick check sample_data/switching.k --history sample_data/energy.glstat
    d2rpick check -f json --select D2R0,D2R1 --fail-on warning sample_data/switching.k
    """
    from d2rpick.api.checking import find_findings

    run = options.open_judging_run(request)
    output = output.beside(*deck, *(run.sources if run else ()))
    findings = find_findings(
        deck, run, request, _split_ids(select), _split_ids(ignore), fail_on
    )
    output.spare(
        file
        for results in (findings.results, findings.failed)
        for result in results
        for file in result.files
    )
    notes_before = click.get_current_context().meta["d2rpick.unused"]
    output.notes(
        [note for note in findings.notes if note not in notes_before], findings.cautions
    )
    for result in findings.failed:
        tell(f"d2rpick: {explain_error(result.error, [result.deck])}")
    form = output.output_format
    if findings.results or form != "table":
        output.result(
            name_options_and_wrap(
                findings.text(form, output.shown()), form, output.columns
            )
        )
    if not findings.results or any(
        result.code == INTERNAL_ERROR for result in findings.failed
    ):
        click.get_current_context().exit(2)
    output.finish(objection=not findings.passed)


def _split_ids(texts: Sequence[str]) -> tuple[str, ...]:
    return tuple(
        name.strip().upper()
        for text in texts
        for name in text.split(",")
        if name.strip()
    )


@options.make_command
@click.argument("id", metavar="[ID]...", nargs=-1, type=choose_click_type("rules"))
@options.add_options(*FILES)
def rule(id: tuple[str, ...], output: Output) -> None:  # noqa: A002  the usage line shows the name of the argument
    """Explain a rule of `d2rpick check` or a warning by its code; without ID, list all rules.

    Examples
    --------
    d2rpick rule
    d2rpick rule D2R105
    d2rpick rule -v D2R105
    d2rpick rule poor-td
    """
    from d2rpick.report.rule_texts import explain_rules, list_rules

    output = output.beside()
    display = output.shown()
    text = explain_rules(id, display.width, with_examples=display.verbose)
    output.result(text or name_options_and_wrap(list_rules(), "table", output.columns))
