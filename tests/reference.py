"""The reference pages that follow from the code: commands, rules of ``check``, warnings, and keys of JSON.

``python -m tests.reference`` writes them to docs/reference; a test holds them current.
"""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any, Final

import click

from d2rpick.cli import COMMANDS, d2rpick
from d2rpick.report.warning_texts import EXPLANATIONS_BY_TOPIC
from d2rpick.rules import RULES
from tests.command import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

PLACE: Final = ROOT / "docs" / "reference"
SCHEMAS: Final = ROOT / "d2rpick" / "schemas"


_RULES_INTRODUCTION: Final = (
    "This page explains what each rule of `d2rpick check` finds, and how to fix the problem. `d2rpick rule D2R105` "
    "prints the same text, and `d2rpick rule -v D2R105` adds example decks that pass and fail. [Check "
    "decks](../how-to/check-decks.md) explains how to select and silence rules, and how to change their severity."
)
_WARNINGS_INTRODUCTION: Final = (
    "This page explains each warning: what happened, what it means for the result, and what to do. "
    "`d2rpick rule margin-kept` prints the same text. Each warning has a stable code. JSON lists the warnings of an "
    "answer under `warnings`."
)
# Text of a warning topic before its first warning.
_WARNINGS_TOPIC_INTRODUCTIONS: Final = {
    "Health of the run": "[Checks](checks.md#health-of-the-reference-run) lists the limits and their sources."
}
_JSON_INTRODUCTION: Final = (
    "This page lists the keys that `-f json` and `-f ndjson` print. The folder `d2rpick/schemas` of the package "
    "contains the schemas. As long as the schema number is the same, keys are added but never removed. `null` means "
    "unknown. A name with dots is a key within a key, and `[]` stands for each item of a list."
)
_COMMANDS_INTRODUCTION: Final = (
    "This page lists every command with all its options, as `d2rpick COMMAND --help` prints them. HISTORY is a file, a "
    "folder or a quoted pattern for the files of one run ([histories](histories.md)). DECK is a main deck."
)

_OPTION: Final = r"--[a-z][a-z-]*[a-z]"
# What a text for the terminal names without marks: commands with their options, options, keywords and Radioss cards.
_CODE: Final = re.compile(
    "|".join(
        (
            r"d2rpick card \.\.\. \| d2rpick check -",
            rf"\bd2rpick (?:{'|'.join(COMMANDS)})\b(?: ID\b| {_OPTION})*",
            rf"(?<![\w-]){_OPTION}(?: (?:good|poor)\b)?",
            r"(?<![\w*])\*[A-Z][A-Z0-9_]+(?:/_[A-Z]+)*(?:\.\.\.(?:_[A-Z]+)?)?",
            r"(?<![\w/])//?[A-Z][A-Z0-9]+(?:/[A-Z0-9]+)*",
            r"#include\b",
        )
    )
)

_SOLVERS: Final = {"ls-dyna": "LS-DYNA", "radioss": "Radioss"}


def cell(text: str) -> str:
    """Write a text in a form that fits a cell of a table."""
    one_line = " ".join(text.split())
    return re.sub(r"(?<!\\)\|", r"\|", one_line).replace("<", "&lt;")


def table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Write a table of Markdown."""
    written = [head, ("---",) * len(head), *rows]
    return [f"| {' | '.join(row)} |" for row in written]


def commands_page() -> str:
    """Write the page of the commands: the options that all share, then each command with its own options."""
    contexts = [*_contexts()]
    options = [dict(_options(context)) for context in contexts]
    common = dict.fromkeys(options[0])
    for rows in options:
        common = {name: None for name in common if rows.get(name) == options[0][name]}
    lines = [
        "# Commands",
        "",
        _COMMANDS_INTRODUCTION,
        "",
        "## Options of all commands",
        "",
    ]
    head = ("option", "meaning")
    lines += table(head, [(name, options[0][name]) for name in common])
    for context, rows in zip(contexts, options, strict=True):
        own = [(name, text) for name, text in rows.items() if name not in common]
        lines += ["", *_described(context), "", *table(head, own)]
        lines += _examples(context.command.epilog or "")
    return "\n".join(lines) + "\n"


def _contexts() -> Iterator[click.Context]:
    """Return the context of each command, in the order of the help."""
    root = click.Context(d2rpick, info_name="d2rpick", **d2rpick.context_settings)
    assert isinstance(d2rpick, click.Group)
    for name in COMMANDS:
        command = d2rpick.get_command(root, name)
        assert command is not None
        yield click.Context(command, root, name)


def _described(context: click.Context) -> Iterator[str]:
    """Return the heading of a command, its usage and its description."""
    usage = " ".join(context.command.collect_usage_pieces(context))
    yield from (
        f"## {context.info_name}",
        "",
        f"`d2rpick {context.info_name} {usage}`",
        "",
    )
    yield mark_code(" ".join((context.command.help or "").split()))


def _options(context: click.Context) -> Iterator[tuple[str, str]]:
    """Return the options of a command as its help shows them: names and value, and meaning."""
    for option in context.command.get_params(context):
        if isinstance(option, click.Option):
            record = option.get_help_record(context)
            if record:
                yield f"`{cell(record[0])}`", cell(mark_code(record[1]))


def _examples(epilog: str) -> Iterator[str]:
    """Return the examples of a command as an indented block."""
    lines = [line.strip() for line in epilog.splitlines()[1:] if line.strip()]
    if lines:
        yield from ("", "Examples:", "", *(f"    {line}" for line in lines))


def rules_page() -> str:
    """Write the page of the rules of check; the anchor of a rule is its id in small letters."""
    lines = ["# Rules of check", "", _RULES_INTRODUCTION, ""]
    rows = [
        (
            f"[{rule.id}](#{rule.id.lower()})",
            rule.severity,
            cell(mark_code(rule.summary)),
        )
        for rule in RULES.values()
    ]
    lines += table(("rule", "severity", "finds"), rows)
    for rule in RULES.values():
        solvers = " and ".join(_SOLVERS[solver] for solver in rule.solvers)
        lines += ["", f"## {rule.id}", ""]
        lines += [f"**{rule.severity}**, {solvers}: {mark_code(rule.summary)}.", ""]
        paragraphs = re.split(r"\n\s*\n", rule.explanation.strip())
        lines += [
            "\n\n".join(mark_code(" ".join(text.split())) for text in paragraphs),
            "",
        ]
        lines += [f"**Fix.** {mark_code(' '.join(rule.fix.split()))}"]
    return "\n".join(lines) + "\n"


def warnings_page() -> str:
    """Write the page of the warnings; the anchor of a warning is its code."""
    lines = ["# Warnings", "", _WARNINGS_INTRODUCTION]
    for topic, explanations in EXPLANATIONS_BY_TOPIC.items():
        lines += ["", f"## {topic}"]
        if topic in _WARNINGS_TOPIC_INTRODUCTIONS:
            lines += ["", _WARNINGS_TOPIC_INTRODUCTIONS[topic]]
        for code, (means, fix) in explanations.items():
            lines += ["", f"### {code}", "", link_rules(mark_code(means))]
            lines += ["", f"**Fix.** {link_rules(mark_code(fix))}"]
    return "\n".join(lines) + "\n"


def link_rules(text: str) -> str:
    """Return the text with a link at each id of a rule of check."""
    return re.sub(
        r"D2R\d{3}", lambda match: f"[{match[0]}](rules.md#{match[0].lower()})", text
    )


def mark_code(text: str) -> str:
    """Return the text with commands, options, keywords and Radioss cards marked as code.

    >>> mark_code("Give --deck, or run d2rpick plan --done (*MAT_RIGID, /RBODY/ON).")
    'Give `--deck`, or run `d2rpick plan --done` (`*MAT_RIGID`, `/RBODY/ON`).'
    """
    pieces = re.split(r"(`[^`]*`)", text)
    pieces[::2] = [_CODE.sub(r"`\g<0>`", piece) for piece in pieces[::2]]
    return "".join(pieces)


def json_page() -> str:
    """Write the page of the keys in JSON, from the schemas that ship."""
    lines = ["# JSON keys", "", _JSON_INTRODUCTION]
    for path in sorted(SCHEMAS.glob("*.json")):
        schema = json.loads(path.read_text("utf-8"))
        lines += ["", f"## {path.stem.rpartition('-')[0]}", ""]
        lines += [f"Schema `{path.stem}`: {cell(schema['description'])}", ""]
        rows = [*_keys(schema, schema.get("$defs", {}), "", ())]
        lines += table(("key", "kind", "meaning"), rows)
    return "\n".join(lines) + "\n"


def _keys(
    schema: Mapping[str, Any],
    defined: Mapping[str, Any],
    prefix: str,
    within: tuple[str, ...],
) -> Iterator[tuple[str, str, str]]:
    """List the keys of an object and of the objects in it; recursive references are not followed again."""
    for key, given in schema.get("properties", {}).items():
        found, names = _resolved(given, defined)
        yield (
            f"`{prefix}{key}`",
            _kind(found),
            cell(given.get("description") or found.get("description", "")),
        )
        items, item_names = _resolved(found.get("items", {}), defined)
        for inner, dots, seen in ((found, ".", names), (items, "[].", item_names)):
            if not {*seen} & {*within}:
                yield from _keys(
                    inner, defined, f"{prefix}{key}{dots}", (*within, *seen)
                )


def _resolved(
    schema: Mapping[str, Any], defined: Mapping[str, Any]
) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """Follow a reference, including that of a choice between a definition and null; return the names on the way."""
    choices = [*schema.get("anyOf", ()), *schema.get("oneOf", ())]
    reference = schema.get("$ref") or next(
        (choice["$ref"] for choice in choices if "$ref" in choice), None
    )
    if reference is None:
        return schema, ()
    name = reference.rpartition("/")[2]
    found, names = _resolved(defined[name], defined)
    return found, (name, *names)


def _kind(schema: Mapping[str, Any]) -> str:
    """Describe the values of a key."""
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    kinds = schema.get("type", "any")
    return kinds if isinstance(kinds, str) else " or ".join(kinds)


PAGES: Final = {
    "commands": commands_page,
    "rules": rules_page,
    "warnings": warnings_page,
    "json": json_page,
}


def write_pages() -> None:
    """Write all pages that follow from the code."""
    for name, page in PAGES.items():
        (PLACE / f"{name}.md").write_text(page(), "utf-8")


if __name__ == "__main__":
    write_pages()
