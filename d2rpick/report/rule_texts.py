"""Explain the rules of ``check`` and the warnings, with example decks."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.errors import ConfigurationError
from d2rpick.histories.names import suggest_name
from d2rpick.report import tables
from d2rpick.rules import RULES, find_rules
from d2rpick.rules.example import MAIN_DECK

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from d2rpick.rules.example import Example
    from d2rpick.rules.rule import Rule


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

    code = name.lower().replace("_", "-")
    if code in EXPLANATIONS:
        yield tables.wrap_lines(explain_warning(code), width)
        return
    if "-" in code:
        near = suggest_name(code, tuple(EXPLANATIONS))
        raise ConfigurationError(
            f"no warning {name!r}{near}; d2rpick prints the code of a warning before its text"
        )
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
