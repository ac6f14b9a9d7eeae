"""Write the findings of ``check`` as a table, JSON, GitHub annotations, JUnit XML and SARIF, and explain its rules."""

from __future__ import annotations

import os
import re
from collections import Counter
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base import __version__
from d2rpick.base.errors import Caution, make_printable, name_units
from d2rpick.base.files import STDIN
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.grades import POOR
from d2rpick.deck.beside import find_history_beside
from d2rpick.report import keys, tables
from d2rpick.report.fields import (
    Document,
    Field,
    get_kind,
    many,
    maybe,
    one_of,
    row,
    write_csv,
)
from d2rpick.rules import RULES, Checked, CheckedWindow, find_rules
from d2rpick.rules.base import Finding, Severity, Unreadable, group_values
from d2rpick.rules.rule import MAIN_DECK, Example, Rule

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.choice.pair.decision import Decision
    from d2rpick.report.formats import DisplayOptions


SARIF_SCHEMA: Final = "https://json.schemastore.org/sarif-2.1.0.json"
_GITHUB: Final = {
    Severity.ERROR: "error",
    Severity.WARNING: "warning",
    Severity.INFO: "notice",
}
_SARIF: Final = {
    Severity.ERROR: "error",
    Severity.WARNING: "warning",
    Severity.INFO: "note",
}
_NOUNS: Final = (
    "error",
    "warning",
    "info message",
)  # Nouns for the severities error, warning and info.
# This pattern is compiled at its first use, to keep start-up fast.
# Name of the switched run in a command if the user has to give it.
_SOME_RUN: Final = "SWITCHED_RUN"
# Name of the history in a command if the user has to give it.
_SOME_HISTORY: Final = "HISTORY"
# Rule that reports switches without a time, and the end of its message if nothing else gives their time.
_UNTIMED_RULE: Final = "D2R302"
_NOT_JUDGED: Final = "not judged by time"
_NOT_XML: Final = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"

_LINE: Final = get_kind("integer", minimum=1)
_COUNTS: Final = ("errors", "warnings", "infos", "decks")
FINDING: Final = row(
    Field("rule", get_kind("text", pattern="^D2R[0-9]{3}$")),
    Field(
        "severity",
        one_of(*map(str, Severity)),
        get=lambda finding: str(finding.severity),
    ),
    Field("message", "text"),
    Field("file", "text"),
    Field("line", _LINE),
    Field("column", _LINE),
    Field("deck", "text"),
)
_WINDOW: Final = row(
    *(Field(key, "integer?") for key in ("part", "part_set", "node")),
    Field("tr", "number"),
    Field("td", "number?"),
    Field("file", "text"),
    Field("line", _LINE),
    Field("deck", "text"),
    Field("verdict", maybe(keys.VERDICT), "what to do with the pair; null if no history is given to judge it",
          later=True),
    Field("verdict_reason", "text?", "reason for the verdict, as text", later=True),
    Field("cure", "text?", "how to improve the pair, as text; empty for a good pair", later=True),
)  # fmt: skip


@dataclass(frozen=True)
class Checks:
    """The findings in several decks; paths below ``root`` are shown relative to it.

    ``failed`` lists the decks that could not be read.  ``history`` lists the files from which the windows were judged;
    None if there is none.  Findings less severe than ``fail_on`` are not failures.  ``history_has_parts`` is True if
    the windows were judged by the energies of their parts.
    """

    results: Sequence[Checked]
    root: str = field(default_factory=os.getcwd)
    failed: Sequence[Unreadable] = ()
    cautions: Sequence[Caution] = ()
    history: Sequence[str] | None = None
    fail_on: Severity = Severity.ERROR
    history_has_parts: bool = False


def as_table(checks: Checks, display: DisplayOptions) -> str:
    """Return one line per finding and per window of each deck, the numbers of findings and decks, and the next step.

    Below a plan with which the deck was written, the plan gives the next step.
    """
    lines: list[str] = []
    for result in checks.results:
        lines.append(_format_path(result.deck, checks.root))
        if _switches_at_unknown_times(result):
            lines.append(
                "  switches itself by forces or sensors of the run; its times are not judged"
            )
        elif not result.cards and not result.windows:
            lines.append("  no switching cards")
        elif not result.windows and not result.findings:
            lines.append("  switching cards that switch nothing")
        lines += [f"  {line}" for line in _format_windows(result.windows, checks.root)]
        lines += [
            f"  {_format_finding(finding)}"
            for finding in _list_findings(checks, result)
        ]
    step = [] if display.written_deck else [f"next  {_name_next_step(checks)}"]
    return "\n".join(
        [*map(make_printable, lines), "", *step, _summarize_findings(checks)]
    )


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
        for finding in _list_findings(checks, result)
        if finding.severity is not Severity.INFO
    ]
    if serious:
        worst = min(serious, key=lambda finding: finding.severity.rank)
        explain = tables.quote_shell_line(("d2rpick", "rule", worst.rule))
        return f"correct the deck where a line above says so; {explain} explains the worst of them"
    decks = tables.make_positional([result.deck for result in checks.results])
    itself = next(filter(_switches_at_unknown_times, checks.results), None)
    if itself:
        folder = tables.make_positional([os.path.dirname(itself.deck) or os.curdir])  # noqa: PTH120  a name with a NUL byte has no folder
        follow = tables.quote_shell_line(("d2rpick", "follow", *folder))
        return (
            f"run the deck; {follow} shows meanwhile when the parts fly and are rigid"
        )
    if not any(result.cards for result in checks.results):
        history, hint = _name_history(checks)
        plan = tables.quote_shell_line(("d2rpick", "plan", *history))
        return f"if the run is to be switched, choose the times with {plan}{hint}, and add the cards to the deck"
    if all(map(_has_only_untimed_cards, checks.results)):
        explain = tables.quote_shell_line(("d2rpick", "rule", _UNTIMED_RULE))
        return f"no card has a time that a history can judge; {explain} says how to have such switches judged"
    if checks.history is None:
        # The history next to a deck that switches may be that of the switched run.
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
    parts = _name_judged_parts(checks)
    line = tables.quote_shell_line(
        ("d2rpick", "verify", "--switched", *switched, *parts, *history)
    )
    return f"run the deck, and compare the run with {line}"


def _name_history(checks: Checks) -> tuple[tuple[str, ...], str]:
    """Return the history next to the only deck or, if there is none, a placeholder, and a hint to replace it."""
    decks = [result.deck for result in checks.results]
    history = find_history_beside(decks[0]) if len(decks) == 1 else None
    if history:
        return tables.make_positional([history]), ""
    return (
        _SOME_HISTORY,
    ), f" (history of the reference run instead of {_SOME_HISTORY})"


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


def as_ndjson(checks: Checks, display: DisplayOptions) -> str:
    """Return a line of JSON per deck, each with the schema of a complete result."""
    deck_checks = (replace(checks, results=[result]) for result in checks.results)
    return "\n".join(
        DOCUMENT.as_json(deck_check, display.command, None)
        for deck_check in deck_checks
    )


def as_csv(checks: Checks, _: DisplayOptions) -> str:
    """Return CSV with a row per verdict and per finding, and a column per key of ``findings`` in the JSON output.

    The row of a verdict has no rule.
    """
    verdicts = [
        Finding(
            "",
            Severity.INFO,
            judged.sentence,
            judged.deck,
            judged.file,
            judged.line,
            judged.column,
        )
        for judged in _list_judged_windows(checks)
    ]
    rows = (*verdicts, *_list_findings(checks))
    return write_csv(FINDING.keys, map(FINDING.plain, rows))


def as_markdown(checks: Checks, _: DisplayOptions) -> str:
    """Return the verdicts as a list, the findings as a Markdown table, and their number."""
    rows = [list(FINDING.plain(finding).values()) for finding in _list_findings(checks)]
    verdicts = [
        f"* {tables.escape_markdown(judged.sentence)}"
        for judged in _list_judged_windows(checks)
    ]
    return "\n\n".join(
        [
            *(["\n".join(verdicts)] if verdicts else []),
            *([tables.as_markdown(FINDING.keys, rows)] if rows else []),
            _summarize_findings(checks),
        ]
    )


def as_github(checks: Checks, _: DisplayOptions) -> str:
    """Return workflow commands by which GitHub Actions shows verdicts and findings next to the lines of the deck."""
    verdicts = [
        f"::notice file={_escape_for_github(judged.file, ',:')},line={judged.line},col={judged.column},"
        f"title={judged.verdict}::{_escape_for_github(judged.sentence)}"
        for judged in _list_judged_windows(checks)
    ]
    annotations = [
        f"::{_GITHUB[f.severity]} file={_escape_for_github(f.file, ',:')},line={f.line},col={f.column},"
        f"title={f.rule}::{_escape_for_github(f.message)}"
        for f in _list_findings(checks)
    ]
    failed = (
        (_format_path(failed_deck.deck, checks.root), failed_deck.reason)
        for failed_deck in checks.failed
    )
    return "\n".join(
        [
            *verdicts,
            *annotations,
            *(
                f"::error file={_escape_for_github(deck, ',:')}::{_escape_for_github(reason)}"
                for deck, reason in failed
            ),
        ]
    )


def as_junit(checks: Checks, _: DisplayOptions) -> str:
    """Return a JUnit suite per deck and a case per finding. Findings below ``fail_on`` pass with a message.

    The output of the suite is the verdicts.
    """
    from xml.etree import ElementTree as ET  # Imported here to keep start-up fast.

    suites = ET.Element("testsuites", name="d2rpick check")

    def begin(deck: str, **counts: int) -> tuple[ET.Element, str]:
        name = _escape_for_xml(_format_path(deck, checks.root))
        about = {"name": name, **{key: str(count) for key, count in counts.items()}}
        return ET.SubElement(suites, "testsuite", about), name

    for failed in checks.failed:
        suite, name = begin(failed.deck, tests=1, failures=0, errors=1)
        case = ET.SubElement(suite, "testcase", name="d2rpick check", classname=name)
        ET.SubElement(
            case, "error", type=failed.code, message=_escape_for_xml(failed.reason)
        )
    for result in checks.results:
        failing = [
            finding.severity.rank <= checks.fail_on.rank for finding in result.findings
        ]
        suite, name = begin(
            result.deck, tests=max(1, len(failing)), failures=sum(failing), errors=0
        )
        if not failing:
            ET.SubElement(suite, "testcase", name="d2rpick check", classname=name)
        for finding, fails in zip(_list_findings(checks, result), failing, strict=True):
            case = ET.SubElement(
                suite,
                "testcase",
                name=_escape_for_xml(f"{finding.rule} {_format_location(finding)}"),
                classname=name,
            )
            about = (
                {"type": finding.rule, "message": _escape_for_xml(finding.message)}
                if fails
                else {}
            )
            ET.SubElement(
                case, "failure" if fails else "system-out", about
            ).text = _escape_for_xml(_format_finding(finding))
        verdicts = [
            _escape_for_xml(judged.sentence)
            for judged in _list_judged_windows(checks, result)
        ]
        if verdicts:
            ET.SubElement(suite, "system-out").text = "\n".join(verdicts)
    ET.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(
        suites, encoding="unicode"
    )


def _make_sarif_help(rule: Rule) -> dict[str, str]:
    """Return the remedy for the findings of a rule, and the place in the documentation that explains the rule.

    SARIF requires an absolute address as ``helpUri``.  The documentation has none, so the text names its page and
    anchor.
    """
    page = f"docs/reference/rules.md#{rule.id.lower()}"
    command = f"d2rpick rule {rule.id}"
    return {
        "text": f"Fix: {rule.fix}\n\nSee {page} in the documentation of d2rpick, or run: {command}",
        "markdown": f"**Fix.** {rule.fix}\n\nSee `{page}` in the documentation of d2rpick, or run `{command}`.",
    }


def as_sarif(checks: Checks, _: DisplayOptions) -> str:
    """Return SARIF 2.1.0 with all rules; their ids are stable."""
    ids = list(RULES)
    rules = [
        {
            "id": rule.id,
            "shortDescription": {"text": rule.summary},
            "fullDescription": {"text": rule.explanation},
            "help": _make_sarif_help(rule),
            "defaultConfiguration": {"level": _SARIF[rule.severity]},
        }
        for rule in RULES.values()
    ]
    results = [
        {
            "ruleId": f.rule,
            "ruleIndex": ids.index(f.rule),
            "level": _SARIF[f.severity],
            "message": {"text": f.message},
            "locations": _make_sarif_locations(
                f.file, region={"startLine": f.line, "startColumn": f.column}
            ),
        }
        for f in _list_findings(checks)
    ]
    messages = [
        {
            "level": "error",
            "message": {"text": failed_deck.reason},
            "locations": _make_sarif_locations(
                _format_path(failed_deck.deck, checks.root)
            ),
        }
        for failed_deck in checks.failed
    ]
    run = {
        "tool": {"driver": {"name": "d2rpick", "version": __version__, "rules": rules}},
        "columnKind": "unicodeCodePoints",
        "invocations": [
            {
                "executionSuccessful": not checks.failed,
                "toolExecutionNotifications": messages,
            }
        ],
        "results": results,
        "properties": {"windows": list(_list_window_objects(checks))},
    }
    return tables.as_json({"$schema": SARIF_SCHEMA, "version": "2.1.0", "runs": [run]})


def _format_location(finding: Finding) -> str:
    return f"{finding.file}:{finding.line}:{finding.column}"


def _format_finding(finding: Finding) -> str:
    return f"{_format_location(finding)}: {finding.severity} {finding.rule} {finding.message}"


def _format_windows(windows: Sequence[CheckedWindow], root: str) -> Iterator[str]:
    """Return a line per window, with its verdict, reason and cure if it was judged."""
    for group in _group_alike(windows):
        first = group[0]
        location = f"{_format_path(first.place.file, root)}:{first.place.line}"
        yield f"{_describe_windows(group)} ({location})"
        if decision := first.decision:
            yield f"  why         {decision.reason}"
            if decision.cure:
                yield f"  to improve  {decision.cure}"


def _group_alike(windows: Sequence[CheckedWindow]) -> Iterator[list[CheckedWindow]]:
    """Yield the windows in groups with the same cards, times and verdict."""
    alike = (
        (
            (window.cards, window.unit.kind, window.tr, window.td, window.decision),
            window,
        )
        for window in windows
    )
    yield from group_values(alike).values()


def _describe_windows(group: Sequence[CheckedWindow]) -> str:
    """Describe similar windows: their verdict if they were judged, their parts and their times."""
    first = group[0]
    until = "the end" if first.td is None else f"{first.td:g}"
    names = name_units((window.unit.id for window in group), first.unit.kind)
    verdict = f"{first.decision.verdict}: " if first.decision else ""
    return f"{verdict}{names}: rigid from {first.tr:g} to {until}"


class _JudgedWindow(NamedTuple):
    """Verdict on similar windows as text, and the location of the card that makes the parts rigid."""

    verdict: str
    sentence: str
    deck: str
    file: str
    line: int
    column: int


def _list_judged_windows(checks: Checks, *results: Checked) -> Iterator[_JudgedWindow]:
    """Yield the verdicts on the windows of all decks, or of given ``results``, with paths for display."""
    for result in results or checks.results:
        for group in _group_alike(result.windows):
            place = group[0].place
            if decision := group[0].decision:
                cure = f". To improve: {decision.cure}" if decision.cure else ""
                yield _JudgedWindow(
                    decision.verdict,
                    f"{_describe_windows(group)}. Reason: {decision.reason}{cure}",
                    _format_path(result.deck, checks.root),
                    _format_path(place.file, checks.root),
                    place.line,
                    place.column,
                )


def _list_window_objects(checks: Checks) -> Iterator[dict[str, Any]]:
    for result in checks.results:
        for window in result.windows:
            location = window.place
            unit = window.unit
            yield {
                "part": window.part,
                "part_set": unit.id if unit.is_set else None,
                "node": unit.id if unit.is_body else None,
                "tr": window.tr,
                "td": window.td,
                "file": _format_path(location.file, checks.root),
                "line": location.line,
                "deck": _format_path(result.deck, checks.root),
                **_list_decision_values(window.decision),
            }


def _list_decision_values(decision: Decision | None) -> dict[str, str | None]:
    """Return the verdict on a pair with its reason and cure, keyed like the JSON output; None if it was not judged."""
    return {
        "verdict": decision and decision.verdict,
        "verdict_reason": decision and decision.reason,
        "cure": decision and decision.cure,
    }


def _list_findings(checks: Checks, *results: Checked) -> Iterator[Finding]:
    """Return the findings in all decks, or in given ``results``, with paths for display."""
    for finding in (
        finding for result in results or checks.results for finding in result.findings
    ):
        yield finding._replace(
            file=_format_path(finding.file, checks.root),
            deck=_format_path(finding.deck, checks.root),
        )


def _list_warnings(checks: Checks) -> list[Caution]:
    """Return all warnings, including a warning for each deck that could not be read."""
    return [
        *checks.cautions,
        *(
            Caution(failed_deck.code, failed_deck.reason)
            for failed_deck in checks.failed
        ),
    ]


DOCUMENT: Final = Document(
    "d2rpick/check/1",
    "Answer of d2rpick check; times in the unit of the deck, lines and columns from 1.",
    row(
        keys.WARNINGS._replace(get=_list_warnings),
        Field(
            "decks",
            "texts",
            get=lambda checks: [
                _format_path(result.deck, checks.root) for result in checks.results
            ],
        ),
        Field(
            "history",
            "texts?",
            get=lambda checks: (
                checks.history
                and [_format_path(name, checks.root) for name in checks.history]
            ),
        ),
        Field("windows", many(_WINDOW), get=_list_window_objects),
        Field("findings", many(FINDING), get=_list_findings),
        Field(
            "summary",
            row(*(Field(key, get_kind("integer", minimum=0)) for key in _COUNTS)),
            get=lambda checks: {
                **_count_severities(checks.results),
                "decks": len(checks.results),
            },
        ),
    ),
)


def _count_severities(results: Sequence[Checked]) -> dict[str, int]:
    counted = Counter(
        finding.severity for result in results for finding in result.findings
    )
    return {f"{severity}s": counted[severity] for severity in Severity}


def _summarize_findings(checks: Checks) -> str:
    """Return the numbers of findings and decks, and the input that was not judged, as a sentence."""
    results = checks.results
    counted = [
        f"{count} {noun}{'s' * (count != 1)}"
        for noun, count in zip(_NOUNS, _count_severities(results).values(), strict=True)
    ]
    decks = "1 deck" if len(results) == 1 else f"{len(results)} decks"
    left_out = f", {len(checks.failed)} not checked" if checks.failed else ""
    unjudged = checks.history is None and any(result.windows for result in results)
    return f"{', '.join(counted)} in {decks}{left_out}{'; times not judged: no `history`' * unjudged}"


def _format_path(path: str, root: str) -> str:
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


def _make_sarif_locations(displayed: str, **keywords: Any) -> list[dict[str, Any]]:
    """Return a location in a file in SARIF format."""
    from urllib.parse import quote

    uri = f"{'file://' * displayed.startswith('/')}{quote(displayed)}"
    return [{"physicalLocation": {"artifactLocation": {"uri": uri}, **keywords}}]


def _escape_for_github(text: str, separators: str = "") -> str:
    for letter in "%\r\n" + separators:
        text = text.replace(letter, f"%{ord(letter):02X}")
    return make_printable(text)


def _escape_for_xml(text: str) -> str:
    """Replace characters that XML 1.0 does not allow or a terminal does not show."""
    return re.sub(_NOT_XML, "?", make_printable(text))


def list_rules() -> str:
    """Return the id, severity and summary of every rule."""
    return "\n".join(
        f"{rule.id}  {rule.severity:<7}  {rule.summary}" for rule in RULES.values()
    )


def explain_rules(
    names: Iterable[str], width: int, *, with_examples: bool = False
) -> str:
    """Explain the rules with these ids or prefixes, and the warnings with these codes.

    ``with_examples``: add decks that pass and decks that fail, which can be hundreds of lines.

    Raises
    ------
    ConfigurationError
        If there is no such rule or warning.
    """
    return "\n\n\n".join(
        text
        for name in names
        for text in _explain_matching_rules(name, width, with_examples=with_examples)
    )


def _explain_matching_rules(
    name: str, width: int, *, with_examples: bool
) -> Iterator[str]:
    """Explain the rules whose id begins with ``name``, or the warning with this code."""
    from d2rpick.report.warning_texts import EXPLANATIONS, explain_warning

    if name in EXPLANATIONS:
        yield tables.wrap_lines(explain_warning(name), width)
        return
    for rule in find_rules(name):
        yield explain_rule(rule, width, with_examples=with_examples)


def explain_rule(rule: Rule, width: int, *, with_examples: bool) -> str:
    """Explain one rule: what it finds, why that matters, and examples of decks that pass or fail it.

    Without the decks the last line says how to print them.
    """
    from textwrap import wrap  # Imported here to keep start-up fast.

    title = f"{rule.id} ({rule.severity}): {rule.summary}"
    explained = wrap(rule.explanation, width, break_on_hyphens=False)
    lines = [tables.wrap_lines(title, width), "", *explained]
    lines += ["", *wrap(f"Fix: {rule.fix}", width, break_on_hyphens=False)]
    if not with_examples:
        count = len(rule.passing) + len(rule.failing)
        return "\n".join(
            [*lines, "", f"Example decks ({count}): d2rpick rule -v {rule.id}"]
        )
    for title, examples in (("Passes", rule.passing), ("Fails", rule.failing)):
        for example in examples:
            lines += ["", *_format_example(title, example, width)]
    return "\n".join(lines)


def _format_example(title: str, example: Example, width: int) -> Iterator[str]:
    """Return the lines of an example deck, of its include files, and of the files with which it is compared."""
    if example.history:
        yield f"{title}, with the history of"
        yield tables.wrap_command(
            f"  d2rpick {example.computed_by} {example.history} -o energy.csv", width
        )
        yield (
            f"checked by d2rpick check {example.name} --history energy.csv {example.options}".rstrip()
            + ":"
        )
    elif example.stdin:
        yield f"{title}, read by d2rpick check -:"
    elif example.name != MAIN_DECK:
        yield f"{title}, as {example.name}:"
    else:
        yield f"{title}:"
    yield ""
    yield example.deck.rstrip("\n")
    for name, text in example.files.items():
        yield from ("", f"with {name}:", "", text.rstrip("\n"))
