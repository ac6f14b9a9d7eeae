"""Each argument named in a message of the library has an option of the same name."""

import ast
import re
from collections.abc import Iterator

import pytest

from d2rpick.api.option_names import ARGUMENTS, find_option, replace_arguments
from d2rpick.cli import COMMANDS
from tests.command import ENERGY, ROLLOVER, ROOT, join_wrapped_lines, run

# Layers whose messages name no options.
SPEAKING = ("histories", "vibration", "flight", "choice", "models")


def find_messages(folder: str) -> Iterator[str]:
    """Yield the strings in the code of a folder that are not docstrings."""
    for path in sorted((ROOT / "d2rpick" / folder).rglob("*.py")):
        nodes = list(ast.walk(ast.parse(path.read_text())))
        stated = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        for node in nodes:
            if (
                isinstance(node, ast.Constant)
                and isinstance(node.value, str)
                and id(node) not in stated
            ):
                yield node.value


@pytest.mark.parametrize("folder", SPEAKING)
def test_messages_name_arguments_and_no_options(folder: str) -> None:
    texts = list(find_messages(folder))
    assert texts
    assert [text for text in texts if re.search(r"(^|\s|\()--[a-z]", text)] == []
    assert [
        name
        for text in texts
        for name in re.findall(r"`(\w+)`", text)
        if not find_option(name)
    ] == []


@pytest.mark.slow
def test_every_argument_has_an_option_that_exists() -> None:
    help_text = "".join(run(command, "--help").stdout for command in COMMANDS)
    assert {
        name for name in ARGUMENTS if f"{find_option(name)} " not in help_text
    } == set()


def test_the_command_line_names_the_option_that_cures() -> None:
    assert replace_arguments("`after` and `unknown`") == "--after and `unknown`"
    assert (
        "--after 9 lies outside the record"
        in run("suggest", "--td", "0.064", "--after", "9", ENERGY).stderr
    )
    assert "choose with --energy: " in run("suggest", "--td", "0.37", ROLLOVER).stderr
    assert "choose with --energy: " in join_wrapped_lines(
        run("study", "--td", "0.37", ROLLOVER).stdout
    )
    assert (
        "choose with --energy: "
        in run("study", "--td", "0.37", "-f", "json", ROLLOVER).stdout
    )
