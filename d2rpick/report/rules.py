"""The rules of ``check`` as text: a list of all, and one with its examples."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from d2rpick.rules import RULES, Example

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.rules import Rule

_WIDTH = 100


def as_list() -> str:
    """Id, severity and summary of every rule."""
    return "\n".join(f"{rule.id}  {rule.severity:<7}  {rule.summary}" for rule in RULES.values())


def as_text(rule: Rule) -> str:
    """One rule: what it finds, why that matters, and decks that pass and fail."""
    lines = [f"{rule.id} ({rule.severity}): {rule.summary}", "", *textwrap.wrap(rule.explanation, _WIDTH)]
    for title, examples in (("Passes", rule.passing), ("Fails", rule.failing)):
        for example in examples:
            lines += ["", *_example(title, example)]
    return "\n".join(lines)


def _example(title: str, example: Example) -> Iterator[str]:
    """A deck as it stands in its file, with what it includes and what it is checked against."""
    if example.history:
        yield f"{title}, with the history of"
        yield f"  d2rpick replay {example.history} -o energy.csv"
        yield f"checked by d2rpick check {example.name} --history energy.csv {example.options}".rstrip() + ":"
    elif example.stdin:
        yield f"{title}, read by d2rpick check -:"
    elif example.name != Example.name:
        yield f"{title}, as {example.name}:"
    else:
        yield f"{title}:"
    yield ""
    yield from _indented(example.deck)
    for name, text in example.files.items():
        yield from ("", f"with {name}:", "")
        yield from _indented(text)


def _indented(text: str) -> Iterator[str]:
    return (f"    {line}".rstrip() for line in text.rstrip("\n").split("\n"))
