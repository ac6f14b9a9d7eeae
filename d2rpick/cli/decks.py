"""Define the commands ``check`` and ``rule`` for the switching cards in decks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from d2rpick.base.errors import INTERNAL_ERROR
from d2rpick.cli import options
from d2rpick.cli.options import FILES, REFERENCE, RESULT
from d2rpick.cli.output import (
    Output,
    explain_error,
    name_options_and_wrap,
    tell,
)
from d2rpick.cli.values import choose_click_type
from d2rpick.report.formats import FORMATS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.api.request import Request


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
