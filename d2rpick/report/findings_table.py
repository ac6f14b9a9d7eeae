"""Write the findings of ``check`` as a table, with the texts that its other output formats share.

This module is apart from the other formats, because a small deck is checked in the time that their imports take.
"""

from __future__ import annotations

import os
from collections import Counter
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import list_names, make_printable, name_units
from d2rpick.base.files import STDIN
from d2rpick.choice.pair.grades import POOR
from d2rpick.deck.beside import find_history_beside
from d2rpick.report import tables
from d2rpick.rules.base import Severity, group_values

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any, ClassVar, Protocol

    from d2rpick.base.errors import Caution
    from d2rpick.report.formats import DisplayOptions
    from d2rpick.rules import Checked, CheckedWindow
    from d2rpick.rules.base import Finding, Unreadable

    class Checks(Protocol):
        """Findings in several decks, with the attributes that the output formats use."""

        # Mark of a dataclass, of which `dataclasses.replace` makes changed copies.
        __dataclass_fields__: ClassVar[dict[str, Any]]

        @property
        def results(self) -> Sequence[Checked]:
            """Results of the decks that could be read."""

        @property
        def root(self) -> str:
            """Folder below which paths are shown relative to it."""

        @property
        def failed(self) -> Sequence[Unreadable]:
            """Decks that could not be read."""

        @property
        def cautions(self) -> Sequence[Caution]:
            """Warnings about the input."""

        @property
        def history(self) -> Sequence[str] | None:
            """Files from which the windows were judged; None if there are none."""

        @property
        def fail_on(self) -> Severity:
            """Least severe finding that counts as a failure."""

        @property
        def history_has_parts(self) -> bool:
            """True if the windows were judged by the energies of their parts."""


# Largest number of rules that are named above the findings in several decks, and of decks without findings below them.
_MOST_RULES: Final = 3
_MOST_SILENT: Final = 8
# Nouns for the severities error, warning and info.
_NOUNS: Final = ("error", "warning", "info message")
# Name of the switched run in a command if the user has to give it.
_SOME_RUN: Final = "SWITCHED_RUN"
# Name of the history in a command if the user has to give it.
_SOME_HISTORY: Final = "HISTORY"
# Rule that reports switches without a time, and the end of its message if nothing else gives their time.
_UNTIMED_RULE: Final = "D2R302"
_NOT_JUDGED: Final = "not judged by time"


def as_table(checks: Checks, display: DisplayOptions) -> str:
    """Return the decision, one line per finding and per window of each deck, the next step, and the counts.

    Several decks begin with the decision and the next step, followed by the decks from the worst to the best; decks
    without windows and findings are only listed. Below a plan with which the deck was written, the plan gives the
    decision and the next step.
    """
    if len(checks.results) > 1:
        return _format_many_decks(checks)
    lines = [line for result in checks.results for line in _format_deck(checks, result)]
    decision, step = [], []
    if checks.results and not display.written_deck:
        decision = tables.format_in_line(
            [*_list_failed(checks), *_decide_on_deck(checks)]
        )
        step = [f"next  {_name_next_step(checks)}"]
    return "\n".join(
        [*decision, *map(make_printable, lines), "", *step, summarize_findings(checks)]
    )


def _format_many_decks(checks: Checks) -> str:
    """Return the decision on several decks and the next step, the decks from the worst to the best, and a summary."""
    head = [
        *_list_failed(checks),
        *_list_decision(checks),
        ("next", _name_next_step(checks)),
    ]
    silent = [
        format_path(result.deck, checks.root)
        for result in checks.results
        if not result.windows and not result.findings
    ]
    lines = [
        line
        for result in sorted(checks.results, key=_rank_worst_finding)
        if result.windows or result.findings
        for line in _format_deck(checks, result)
    ]
    if silent:
        decks = f"{len(silent)} deck{'s' * (len(silent) > 1)}"
        names = list_names(silent, most=_MOST_SILENT)
        lines += ["", f"no findings in {decks} without rigid windows: {names}"]
    return "\n".join(
        [
            *tables.format_in_line(head),
            "",
            *map(make_printable, lines),
            "",
            summarize_findings(checks),
        ]
    )


def _list_failed(checks: Checks) -> list[tuple[str, str]]:
    """Return how many decks could not be checked, and their names; empty if there are none."""
    if not checks.failed:
        return []
    count = len(checks.failed)
    names = list_names(
        [format_path(failed.deck, checks.root) for failed in checks.failed],
        most=_MOST_SILENT,
    )
    total = count + len(checks.results)
    return [("failed", f"{count} of {total} decks could not be checked: {names}")]


def _decide_on_deck(checks: Checks) -> list[tuple[str, str]]:
    """Return how many errors and warnings a single deck has, and whether a history is missing to judge its times.

    If there are none but the times were judged, the verdicts below are the decision.
    """
    counts = count_severities(checks.results)
    serious = [
        f"{counts[f'{severity}s']} {noun}{'s' * (counts[f'{severity}s'] != 1)}"
        for severity, noun in zip(Severity, _NOUNS, strict=True)
        if severity is not Severity.INFO and counts[f"{severity}s"]
    ]
    missing = ""
    if _lacks_history(checks):
        missing = "; the times were not judged, because no history was given"
    if serious:
        return [("found", f"{' and '.join(serious)}{missing}")]
    if checks.history is not None and any(result.windows for result in checks.results):
        return []
    return [("passed", f"no errors or warnings{missing}")]


def _lacks_history(checks: Checks) -> bool:
    """Return True if the decks have rigid windows but no history was given to judge them."""
    return checks.history is None and any(result.windows for result in checks.results)


def _list_decision(checks: Checks) -> list[tuple[str, str]]:
    """Return how many of several decks have errors or warnings, and which rules report most of them."""
    serious = {
        severity: [
            result
            for result in checks.results
            if any(finding.severity is severity for finding in result.findings)
        ]
        for severity in (Severity.ERROR, Severity.WARNING)
    }
    total = len(checks.results)
    for severity, decks in serious.items():
        if decks:
            rules = Counter(
                finding.rule
                for result in decks
                for finding in result.findings
                if finding.severity is severity
            )
            counted = [
                f"{_summarize(rule)} ({rule}{f', {count} times' if count > 1 else ''})"
                for rule, count in rules.most_common()
            ]
            return [
                (f"{severity}s", f"in {len(decks)} of {total} decks"),
                *(("why", text) for text in counted[:_MOST_RULES]),
            ]
    return [("passed", f"no errors or warnings in {total} decks")]


def _summarize(rule: str) -> str:
    """Return what a rule finds, in a few words."""
    # Imported here, because a single deck is checked in the time that the imports take.
    from d2rpick.rules import RULES

    return RULES[rule].summary


def _rank_worst_finding(result: Checked) -> int:
    """Return the rank of the worst finding in a deck, for sorting; a deck without findings comes last."""
    ranks = [finding.severity.rank for finding in result.findings]
    return min(ranks, default=len(Severity))


def _format_deck(checks: Checks, result: Checked) -> Iterator[str]:
    """Yield the name of a deck, its rigid windows, and its findings, one in a line, the most severe ones first."""
    yield format_path(result.deck, checks.root)
    if _switches_at_unknown_times(result):
        yield "  switches itself by forces or sensors of the run; its times are not judged"
    elif not result.cards and not result.windows:
        yield "  no switching cards"
    elif not result.windows and not result.findings:
        yield "  no part becomes rigid, although the deck has switching cards"
    for line in _format_windows(result.windows, checks.root):
        yield f"  {line}"
    for finding in sorted(
        list_findings(checks, result), key=lambda finding: finding.severity.rank
    ):
        yield f"  {format_finding(finding)}"


def _switches_at_unknown_times(result: Checked) -> bool:
    """Return True if the switching times of a deck depend on the solution and no history shows them."""
    return result.switches_itself and not result.windows


def _has_only_untimed_cards(result: Checked) -> bool:
    """Return True if no switching card of a deck has a time that can be compared with an energy history."""
    untimed = {
        (finding.file, finding.line)
        for finding in result.findings
        if finding.rule == _UNTIMED_RULE and finding.message.endswith(_NOT_JUDGED)
    }
    return len(untimed) >= result.cards


def _name_next_step(checks: Checks) -> str:
    """Return what to do after the check, with a command that can be copied."""
    serious = [
        finding
        for result in checks.results
        for finding in list_findings(checks, result)
        if finding.severity is not Severity.INFO
    ]
    if serious:
        worst = min(serious, key=lambda finding: finding.severity.rank)
        explain = tables.quote_shell_line(("d2rpick", "rule", worst.rule))
        return (
            f"correct the findings above; read about the most severe one with {explain}"
        )
    switching = [result for result in checks.results if result.windows]
    itself = next(filter(_switches_at_unknown_times, checks.results), None)
    if itself:
        folder = tables.make_positional([os.path.dirname(itself.deck) or os.curdir])  # noqa: PTH120  a name with a NUL byte has no folder
        follow = tables.quote_shell_line(("d2rpick", "follow", *folder))
        return f"run the deck; meanwhile, see when the parts fly or are rigid with {follow}"
    has_cards = any(result.cards for result in checks.results)
    if not has_cards or not any(
        result.windows or result.findings for result in checks.results
    ):
        found, hint = _name_history(checks)
        plan = tables.quote_shell_line(("d2rpick", "plan", *found))
        return f"if the run is to be switched, add cards to the deck with times that you choose with {plan}{hint}"
    if all(map(_has_only_untimed_cards, checks.results)):
        explain = tables.quote_shell_line(("d2rpick", "rule", _UNTIMED_RULE))
        return f"no card has a time that a history can judge; see how to have such switches judged with {explain}"
    if checks.history is None:
        # The history next to a deck that switches may be that of the switched run.
        decks = tables.make_positional([result.deck for result in switching])
        command = tables.quote_shell_line(("d2rpick", "check", *decks))
        hint = f"(history of the reference run instead of {_SOME_HISTORY})"
        return f"judge the times by the reference run: {command} --history {_SOME_HISTORY} {hint}"
    history = tables.make_positional(checks.history)
    grades = [
        window.decision.grade
        for result in checks.results
        for window in result.windows
        if window.decision
    ]
    if POOR in grades:
        plan = tables.quote_shell_line(("d2rpick", "plan", *history))
        return f"choose other times with {plan}"
    folders = {os.path.dirname(result.deck) for result in checks.results}  # noqa: PTH120  a name with a NUL byte has no folder
    of_history = {os.path.dirname(file) for file in checks.history}  # noqa: PTH120  a name with a NUL byte has no folder
    # The switched run is expected in the folder of the deck, unless this folder already contains the reference run.
    runs = [] if folders & of_history else [folder or os.curdir for folder in folders]
    switched = tables.make_positional(runs[:1] or [_SOME_RUN])
    hint = "" if runs else f" (folder of the switched run instead of {_SOME_RUN})"
    parts = _name_judged_parts(checks)
    times = _name_times_at_rest(checks)
    line = tables.quote_shell_line(
        ("d2rpick", "verify", *times, "--switched", *switched, *parts, *history)
    )
    return f"run the deck, and compare the run with {line}{hint}"


def _name_history(checks: Checks) -> tuple[tuple[str, ...], str]:
    """Return the given history or the one next to the only deck, otherwise a placeholder and a hint to replace it."""
    if checks.history:
        return tables.make_positional(checks.history), ""
    decks = [result.deck for result in checks.results]
    history = find_history_beside(decks[0]) if len(decks) == 1 else None
    if history:
        return tables.make_positional([history]), ""
    hint = f" (history of the reference run instead of {_SOME_HISTORY})"
    return (_SOME_HISTORY,), hint


def _name_times_at_rest(checks: Checks) -> tuple[str, ...]:
    """Return the options with the first judged window, if nothing vibrates in it; otherwise no options.

    The energies of such a run do not show when its parts were rigid.
    """
    windows = (window for result in checks.results for window in result.windows)
    judged = [window for window in windows if window.decision]
    first = min(judged, key=lambda window: window.tr, default=None)
    if first is None or first.td is None:
        return ()
    if first.decision is None or not first.decision.at_rest:
        return ()
    return ("--tr", f"{first.tr:.6g}", "--td", f"{first.td:.6g}")


def _name_judged_parts(checks: Checks) -> tuple[str, ...]:
    """Return the option that names the parts of the judged windows; empty if the whole model was judged."""
    parts = {
        window.part
        for result in checks.results
        for window in result.windows
        if window.decision and window.part is not None
    }
    if not checks.history_has_parts or not parts:
        return ()
    return ("--part", ",".join(map(str, sorted(parts))))


def _format_windows(windows: Sequence[CheckedWindow], root: str) -> Iterator[str]:
    """Return a line per window, with its verdict, reason and cure if it was judged."""
    for group in group_alike(windows):
        first = group[0]
        location = f"{format_path(first.place.file, root)}:{first.place.line}"
        yield f"{describe_windows(group)} ({location})"
        if decision := first.decision:
            yield f"  why         {decision.reason}"
            if decision.cure:
                yield f"  to improve  {decision.cure}"


def group_alike(windows: Sequence[CheckedWindow]) -> Iterator[list[CheckedWindow]]:
    """Yield the windows in groups with the same cards, times and verdict."""
    alike = (
        (
            (window.cards, window.unit.kind, window.tr, window.td, window.decision),
            window,
        )
        for window in windows
    )
    yield from group_values(alike).values()


def describe_windows(group: Sequence[CheckedWindow]) -> str:
    """Describe similar windows: their verdict if they were judged, their parts and their times."""
    first = group[0]
    until = "the end" if first.td is None else f"{first.td:g}"
    names = name_units((window.unit.id for window in group), first.unit.kind)
    verdict = f"{first.decision.verdict}: " if first.decision else ""
    return f"{verdict}{names}: rigid from {first.tr:g} to {until}"


def list_findings(checks: Checks, *results: Checked) -> Iterator[Finding]:
    """Return the findings in all decks, or in given ``results``, with paths for display."""
    for finding in (
        finding for result in results or checks.results for finding in result.findings
    ):
        yield finding._replace(
            file=format_path(finding.file, checks.root),
            deck=format_path(finding.deck, checks.root),
        )


def format_finding(finding: Finding) -> str:
    """Return the location, severity, rule and message of a finding in one line."""
    return f"{format_location(finding)}: {finding.severity} {finding.rule} {finding.message}"


def format_location(finding: Finding) -> str:
    """Return file, line and column of a finding."""
    return f"{finding.file}:{finding.line}:{finding.column}"


def count_severities(results: Sequence[Checked]) -> dict[str, int]:
    """Return the number of findings of each severity, by its plural, as in the JSON output."""
    counted = Counter(
        finding.severity for result in results for finding in result.findings
    )
    return {f"{severity}s": counted[severity] for severity in Severity}


def summarize_findings(checks: Checks) -> str:
    """Return the numbers of findings and decks, and the input that was not judged, as a sentence."""
    results = checks.results
    counted = [
        f"{count} {noun}{'s' * (count != 1)}"
        for noun, count in zip(_NOUNS, count_severities(results).values(), strict=True)
    ]
    decks = "1 deck" if len(results) == 1 else f"{len(results)} decks"
    left_out = f", {len(checks.failed)} not checked" if checks.failed else ""
    unjudged = "; times not judged: no `history`" * _lacks_history(checks)
    return f"{', '.join(counted)} in {decks}{left_out}{unjudged}"


def format_path(path: str, root: str) -> str:
    """Return a path for display, with ``/`` and no undecodable bytes; a path inside ``root`` becomes relative to it."""
    if path == STDIN:
        return path
    absolute = os.path.abspath(os.path.join(root, path))  # noqa: PTH100, PTH118  pathlib would slow start-up
    displayed = (
        os.path.relpath(absolute, root)
        if absolute.startswith(os.path.join(root, ""))  # noqa: PTH118  pathlib would slow start-up
        else absolute
    )
    return os.fsencode(displayed).decode("utf-8", "replace").replace(os.sep, "/")
