"""Write the findings of ``check`` as JSON, CSV, Markdown, GitHub annotations, JUnit XML and SARIF."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from d2rpick.base import __version__
from d2rpick.base.errors import Caution, make_printable
from d2rpick.base.tuples import NamedTuple
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
from d2rpick.report.findings_table import (
    count_severities,
    describe_windows,
    format_finding,
    format_location,
    format_path,
    group_alike,
    list_findings,
    summarize_findings,
)
from d2rpick.rules import RULES
from d2rpick.rules.base import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.choice.pair.decision import Decision
    from d2rpick.report.findings_table import Checks
    from d2rpick.report.formats import DisplayOptions
    from d2rpick.rules import Checked
    from d2rpick.rules.rule import Rule


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
# This pattern is compiled at its first use, to keep start-up fast.
_NOT_XML: Final = "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"

_LINE: Final = get_kind("integer", minimum=1)
# Keys of the summary, with what each of them counts.
_COUNTS: Final = {
    "errors": "errors",
    "warnings": "warnings",
    "infos": "info messages",
    "decks": "decks",
}
FINDING: Final = row(
    Field("rule", get_kind("text", pattern="^D2R[0-9]{3}$"), "id of the rule"),
    Field(
        "severity",
        one_of(*map(str, Severity)),
        "severity of the finding",
        lambda finding: str(finding.severity),
    ),
    Field("message", "text", "what is wrong, and how to correct it"),
    Field("file", "text", "file that contains the problem"),
    Field("line", _LINE, "line of the problem"),
    Field("column", _LINE, "column of the problem"),
    Field("deck", "text", "main file of the deck"),
)
_WINDOW: Final = row(
    Field("part", "integer?", "switched part; null if the card names a part set or a main node"),
    Field("part_set", "integer?", "switched part set of LS-DYNA, otherwise null"),
    Field("node", "integer?", "main node of the switched /RBODY of Radioss, otherwise null"),
    keys.TR,
    keys.TD._replace(kind="number?", meaning="time at which the parts become deformable again; null if never"),
    Field("file", "text", "file that contains the card"),
    Field("line", _LINE, "line of the card"),
    Field("deck", "text", "main file of the deck"),
    Field("verdict", maybe(keys.VERDICT), "what to do with the pair; null if no history is given to judge it",
          later=True),
    Field("verdict_reason", "text?", "reason for the verdict, as text", later=True),
    Field("cure", "text?", "how to improve the pair, as text; empty for a good pair", later=True),
)  # fmt: skip


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
    rows = (*verdicts, *list_findings(checks))
    return write_csv(FINDING.keys, map(FINDING.plain, rows))


def as_markdown(checks: Checks, _: DisplayOptions) -> str:
    """Return the verdicts as a list, the findings as a Markdown table, and their number."""
    rows = [list(FINDING.plain(finding).values()) for finding in list_findings(checks)]
    verdicts = [
        f"* {tables.escape_markdown(judged.sentence)}"
        for judged in _list_judged_windows(checks)
    ]
    return "\n\n".join(
        [
            *(["\n".join(verdicts)] if verdicts else []),
            *([tables.as_markdown(FINDING.keys, rows)] if rows else []),
            summarize_findings(checks),
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
        for f in list_findings(checks)
    ]
    failed = (
        (format_path(failed_deck.deck, checks.root), failed_deck.reason)
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
        name = _escape_for_xml(format_path(deck, checks.root))
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
        for finding, fails in zip(list_findings(checks, result), failing, strict=True):
            case = ET.SubElement(
                suite,
                "testcase",
                name=_escape_for_xml(f"{finding.rule} {format_location(finding)}"),
                classname=name,
            )
            about = (
                {"type": finding.rule, "message": _escape_for_xml(finding.message)}
                if fails
                else {}
            )
            ET.SubElement(
                case, "failure" if fails else "system-out", about
            ).text = _escape_for_xml(format_finding(finding))
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
        for f in list_findings(checks)
    ]
    messages = [
        {
            "level": "error",
            "message": {"text": failed_deck.reason},
            "locations": _make_sarif_locations(
                format_path(failed_deck.deck, checks.root)
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
        for group in group_alike(result.windows):
            place = group[0].place
            if decision := group[0].decision:
                cure = f". To improve: {decision.cure}" if decision.cure else ""
                yield _JudgedWindow(
                    decision.verdict,
                    f"{describe_windows(group)}. Reason: {decision.reason}{cure}",
                    format_path(result.deck, checks.root),
                    format_path(place.file, checks.root),
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
                "file": format_path(location.file, checks.root),
                "line": location.line,
                "deck": format_path(result.deck, checks.root),
                **_list_decision_values(window.decision),
            }


def _list_decision_values(decision: Decision | None) -> dict[str, str | None]:
    """Return the verdict on a pair with its reason and cure, keyed like the JSON output; None if it was not judged."""
    return {
        "verdict": decision and decision.verdict,
        "verdict_reason": decision and decision.reason,
        "cure": decision and decision.cure,
    }


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
            "main files of the decks that were checked",
            lambda checks: [
                format_path(result.deck, checks.root) for result in checks.results
            ],
        ),
        Field(
            "history",
            "texts?",
            "files of the reference run; null without --history",
            lambda checks: (
                checks.history
                and [format_path(name, checks.root) for name in checks.history]
            ),
        ),
        Field(
            "windows",
            many(_WINDOW),
            "rigid windows that the decks define, with their verdicts",
            _list_window_objects,
        ),
        Field("findings", many(FINDING), "problems found", list_findings),
        Field(
            "summary",
            row(
                *(
                    Field(key, get_kind("integer", minimum=0), f"number of {counted}")
                    for key, counted in _COUNTS.items()
                )
            ),
            "numbers of findings and decks",
            lambda checks: {
                **count_severities(checks.results),
                "decks": len(checks.results),
            },
        ),
    ),
)


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
