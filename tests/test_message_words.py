"""Messages follow the glossary and the style guide: every text in the code except docstrings is checked."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.command import ROOT
from tests.test_words import BANNED, SYNONYMS

MODULES = sorted((ROOT / "d2rpick").rglob("*.py"))
FEWEST_WORDS = 3  # shorter texts are keys, names and headings
# Names used only in messages for things that have another name in the glossary.
NAMES = SYNONYMS | {
    "CPU time": r"processor time",
    "kinetic fraction": r"kinetic share",
    "admissible": r"\bacceptable\b",
    "frozen-deformation error": r"lock(?:ed)?-in error",
    "Pareto-optimal": r"\bunbeaten\b",
    "unstable": r"\bblew up\b",
    "deactivate, activate": r"\bputs? off\b",
    "connected": r"\bnothing joins\b",
    "merged into lead part": r"\bled by part\b",
}


def list_texts(tree: ast.AST) -> Iterator[str]:
    """Yield each text of a module that is not a docstring, with ``...`` for inserted values."""
    statements = (node for node in ast.walk(tree) if isinstance(node, ast.Expr))
    docstrings = {id(statement.value) for statement in statements}
    formatted = [node for node in ast.walk(tree) if isinstance(node, ast.JoinedStr)]
    pieces = {id(piece) for node in formatted for piece in node.values}
    for joined in formatted:
        yield "".join(
            str(piece.value) if isinstance(piece, ast.Constant) else "..."
            for piece in joined.values
        )
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str):
            continue
        if id(node) not in docstrings | pieces:
            yield node.value


def find_other_names(text: str) -> list[str]:
    """Return the banned words of a text, and those for which the glossary has another name."""
    patterns = [BANNED.pattern, *NAMES.values()]
    return [
        match[0]
        for pattern in patterns
        for match in re.finditer(pattern, text, re.IGNORECASE)
    ]


@pytest.mark.parametrize(
    "module", MODULES, ids=lambda module: str(module.relative_to(ROOT))
)
def test_messages_use_the_names_of_the_glossary(module: Path) -> None:
    messages = (
        text
        for text in list_texts(ast.parse(module.read_text("utf-8")))
        if len(text.split()) >= FEWEST_WORDS
    )
    assert not {
        message: names for message in messages if (names := find_other_names(message))
    }


def test_the_walk_sees_messages_and_no_docstrings() -> None:
    tree = ast.parse(
        'def f(x):\n    "The kinetic share of it."\n'
        '    raise ValueError(f"{x} of the kinetic " "share")\n'
    )
    assert [*list_texts(tree)] == ["... of the kinetic share"]
    assert find_other_names("... of the kinetic share") == ["kinetic share"]
    assert find_other_names("the kinetic fraction of a restart segment") == []
