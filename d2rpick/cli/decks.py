"""The commands ``card``, ``check`` and ``rule``: what stands in decks about the switches."""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

import click

from d2rpick.api.cards import SETTINGS, Cards, all_cautions, card_of
from d2rpick.base.errors import INTERNAL_ERROR, ConfigurationError, D2RPickError, DeckError
from d2rpick.cli import options
from d2rpick.cli.options import FILES, REFERENCE, RESULT
from d2rpick.cli.output import Output, explained, in_words, tell, text_bytes
from d2rpick.cli.values import CARDS, click_type
from d2rpick.report.formats import FORMATS, write

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.api.request import Request
    from d2rpick.choice.switched_run import Times
    from d2rpick.choice.warnings import Caution
    from d2rpick.rules import Checked, Configuration
    from d2rpick.rules.base import Unreadable
    from d2rpick.rules.judgement import HistoryJudge


@options.command
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

    Examples
    --------
    d2rpick card --tr 0.0135867 --td 0.0687534 --part 11,12 --merge 11
    d2rpick card --tr 0.0135867 --td 0.0687534 --part 1 --history sample_data/energy.csv
    d2rpick card --tr 0.02 --td 0.09 --tr 0.2 --td 0.3 --part 11
    d2rpick card --solver radioss --tr 0.0135867 --td 0.0687534 --node 1001 --end 0.15
    """
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


@options.command
@click.argument("deck", metavar="DECK...", nargs=-1, required=True, type=click_type("file"))
@options.takes(*REFERENCE)
@click.option(
    "--select", metavar="IDS", multiple=True, type=click_type("rules"),
    help="Check only these rules, by id or its beginning: D2R101,D2R2.  [default: by d2rpick.toml or pyproject.toml]",
)  # fmt: skip
@click.option(
    "--ignore", metavar="IDS", multiple=True, type=click_type("rules"), help="Skip these rules; overrules --select."
)
@click.option(
    "--fail-on", type=click.Choice(["error", "warning"]), default="error", show_default=True,
    help="Least severe finding that sets exit code 1.",
)  # fmt: skip
@options.takes(*RESULT, forms=FORMATS["findings"])
def check(
    deck: tuple[str, ...],
    select: tuple[str, ...],
    ignore: tuple[str, ...],
    fail_on: str,
    request: Request,
    output: Output,
) -> None:
    """Find the switching cards of LS-DYNA decks and Radioss runs, and check them against deck and history.

    Each DECK is read with its includes; a folder stands for its main decks, `-` for standard input.  The starter deck
    and the engine files of a Radioss run are one DECK, whichever is named.  `d2rpick rule` lists the rules; a comment
    line `$ d2rpick: ignore D2R104` before a card (Radioss: `#`) silences one for it.

    Examples
    --------
    d2rpick check sample_data/switching.k
    d2rpick check sample_data/switching.k --history sample_data/energy.glstat
    d2rpick check -f json --select D2R0,D2R1 --fail-on warning sample_data/switching.k
    """
    from d2rpick.report.findings import Checks
    from d2rpick.rules import Configuration
    from d2rpick.rules.base import Severity

    judge = _judge(request)
    output = output.beside(*deck, *(judge.run.sources if judge else ()))
    results, failed, inputs = _checked(deck, judge, Configuration(_ids(select), _ids(ignore)))
    output.spare(inputs)
    cautions = _cautions(results, judge)
    output.notes(judge.notes if judge else (), cautions)
    for one in failed:
        tell(f"d2rpick: {one.reason}")
    limit, form = Severity(fail_on), output.output_format
    if results or form != "table":
        history = judge.run.sources if judge else None
        checks = Checks(results, failed=failed, cautions=cautions, fail_on=limit, history=history)
        output.result(in_words(write("findings", form, checks, output.shown()), form, output.columns))
    if not results or any(one.code == INTERNAL_ERROR for one in failed):
        click.get_current_context().exit(2)
    heavy = any(finding.severity.rank <= limit.rank for result in results for finding in result.findings)
    output.finish(objection=heavy or bool(failed))


def _judge(request: Request) -> HistoryJudge | None:
    run = options.judging_run(request)
    if run is None:
        return None
    from d2rpick.rules.judgement import HistoryJudge

    return HistoryJudge(run.files, request.selection(), request.settings)


def _checked(
    decks: Sequence[str], judge: HistoryJudge | None, asked: Configuration
) -> tuple[list[Checked], list[Unreadable], list[str]]:
    """Check each deck by the configuration nearest to it, and give all files that were read.

    A deck that cannot be read, or whose configuration cannot, does not hide the others; nor does an internal error.
    """
    from d2rpick.deck.source import STDIN
    from d2rpick.rules import RULES, check_deck, configuration_for
    from d2rpick.rules.base import Unreadable

    asked.verify(RULES)
    results, inputs = [], []
    named, failed = _main_decks(decks)
    for name in _apart(named):
        try:
            configuration = configuration_for(name, asked, SETTINGS)
            inputs.append(configuration.source)
            content = sys.stdin.buffer.read() if name == STDIN else None
            if judge and content is None:
                judge.beside(name)
            results.append(check_deck(name, configuration, judge, content))
            inputs += results[-1].files
        except (ConfigurationError, DeckError, OSError, MemoryError) as error:
            failed.append(Unreadable(name, explained(error)))
        except D2RPickError:
            raise  # about the history, by which all are judged
        except Exception as error:  # noqa: BLE001  the others are answered, whatever it is
            failed.append(Unreadable(name, explained(error, [name]), INTERNAL_ERROR))
    return results, failed, inputs


def _main_decks(named: Sequence[str]) -> tuple[list[str], list[Unreadable]]:
    """Replace folders by their main decks; those without any are told."""
    from d2rpick.deck import main_decks
    from d2rpick.rules.base import Unreadable

    decks: list[str] = []
    failed: list[Unreadable] = []
    for name in named:
        try:
            decks += main_decks(name) if os.path.isdir(name) else [name]  # noqa: PTH112  Path raises on odd names
        except DeckError as error:
            failed.append(Unreadable(name, str(error)))
    return decks, failed


def _apart(names: Sequence[str]) -> Iterator[str]:
    """Each deck once: by one of its spellings, and a Radioss run by the first of its files."""
    from d2rpick.deck.radioss_run import run_files

    seen: set[str] = set()
    for name in names:
        real = os.path.realpath(name)
        if real not in seen:
            seen.update([real, *map(os.path.realpath, run_files(name))])
            yield name


def _cautions(results: Sequence[Checked], judge: HistoryJudge | None) -> list[Caution]:
    from d2rpick.choice.warnings import Caution

    remarks = dict.fromkeys(remark for result in results for remark in result.remarks)
    return [*(judge.cautions if judge else ()), *(Caution("unknown-rule", remark) for remark in remarks)]


def _ids(texts: Sequence[str]) -> tuple[str, ...]:
    return tuple(name.strip().upper() for text in texts for name in text.split(",") if name.strip())


@options.command
@click.argument("id", metavar="[ID]...", nargs=-1, type=click_type("rules"))
@options.takes(*FILES)
def rule(id: tuple[str, ...], output: Output) -> None:  # noqa: A002  the name is that of the argument in usage
    """Explain a rule of `d2rpick check`, with decks that pass and fail; without ID, list all rules.

    Examples
    --------
    d2rpick rule
    d2rpick rule D2R105
    """
    from d2rpick.report import findings as report
    from d2rpick.rules import find_rules

    output = output.beside()
    rules = [rule for name in id for rule in find_rules(name)]
    text = "\n\n\n".join(report.as_text(rule, output.shown().width) for rule in rules)
    output.result(text or in_words(report.as_list(), "table", output.columns))
