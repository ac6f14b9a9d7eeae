"""The library speaks of arguments; every argument that a message names has an option."""

from __future__ import annotations

import ast
import re
from typing import TYPE_CHECKING

import pytest

from d2rpick.cli import options
from d2rpick.cli.wording import OPTIONS, with_options
from tests.command import ENERGY, ROOT, run

if TYPE_CHECKING:
    from collections.abc import Iterator

# Layers whose messages name no options.
SPEAKING = ("vibration", "flight", "choice", "study")


def messages(folder: str) -> Iterator[str]:
    """Texts in the code of a folder that are no docstrings."""
    for path in sorted((ROOT / "d2rpick" / folder).rglob("*.py")):
        tree = ast.parse(path.read_text())
        stated = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in stated:
                yield node.value


@pytest.mark.parametrize("folder", SPEAKING)
def test_messages_name_arguments_and_no_options(folder: str) -> None:
    texts = list(messages(folder))
    assert [text for text in texts if re.search(r"(^|\s|\()--[a-z]", text)] == []
    assert {name for text in texts for name in re.findall(r"`(\w+)`", text)} <= set(OPTIONS)


def test_every_argument_has_an_option_that_exists() -> None:
    known = {name for group in (options.judging_options, options.reading_options) for name in given_by(group)}
    assert set(OPTIONS.values()) <= known


def given_by(group: object) -> set[str]:
    """Options that a group of them adds to a command."""

    def command() -> None: ...

    group(command)  # type: ignore[operator]
    return {name for option in command.__click_params__ for name in option.opts}  # type: ignore[attr-defined]


def test_the_command_line_names_the_option_that_cures() -> None:
    assert with_options("`after` and `unknown`") == "--after and `unknown`"
    assert "--after 9 lies outside the record" in run("suggest", "--td", "0.064", "--after", "9", ENERGY).stderr
    assert "; give --td or --td-window" in run("suggest", ENERGY).stderr
