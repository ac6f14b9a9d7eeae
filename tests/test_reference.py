"""The reference pages are those generated from the code, and every warning has its place."""

import ast
import re
from collections.abc import Iterator

import pytest

from d2rpick.rules import RULES
from tests.command import ROOT
from tests.examples import read_page
from tests.reference import PAGES, PLACE
from tests.test_docs import list_anchors

SOURCES = [*(ROOT / "d2rpick").rglob("*.py")]
WARNINGS = ROOT / "docs" / "reference" / "warnings.md"


@pytest.mark.parametrize("name", PAGES)
def test_a_page_of_the_reference_is_current(name: str) -> None:
    """Write them with ``python -m tests.reference``."""
    assert (PLACE / f"{name}.md").read_text("utf-8") == PAGES[name]()


def test_every_key_of_json_has_a_meaning() -> None:
    """Meanings are given where the fields are defined, so that the schemas contain them too."""
    rows = re.findall(r"^\| (`.*`) \| .* \| (.*) \|$", PAGES["json"](), re.MULTILINE)
    assert len(rows) > 700
    assert not [key for key, meaning in rows if not meaning.strip()]


def test_every_rule_has_an_anchor() -> None:
    assert {rule.lower() for rule in RULES} <= list_anchors(PLACE / "rules.md")


def codes(tree: ast.Module) -> Iterator[str]:
    """Codes of the warnings that a module issues, as far as they are written where they are issued."""
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Call)
            and ast.unparse(node.func) == "Caution"
            and node.args
            and isinstance(node.args[0], ast.Constant)
        ):
            yield str(node.args[0].value)


def test_every_warning_is_explained() -> None:
    headings = {
        *re.findall(r"^### ([a-z-]+)$", WARNINGS.read_text("utf-8"), re.MULTILINE)
    }
    texts = [path.read_text("utf-8") for path in SOURCES]
    issuing = [ast.parse(text) for text in texts if "Caution(" in text]
    issued = {code for tree in issuing for code in codes(tree)}
    assert len(issued) > 50
    assert issued <= headings
    assert not {
        code for code in headings if not any(f'"{code}"' in text for text in texts)
    }


def test_pages_that_the_code_names_exist() -> None:
    named = {
        name
        for path in SOURCES
        for name in re.findall(r"docs/[\w/-]+\.md", path.read_text("utf-8"))
    }
    assert named
    assert not {name for name in named if not (ROOT / name).exists()}


def test_the_glossary_has_each_term_once() -> None:
    terms = re.findall(
        r"^\| ([^|]+) \| ", read_page("docs/reference/glossary.md"), re.MULTILINE
    )
    names = [term for term in terms if term not in ("term", "---")]
    assert len(names) == len({*names}) > 50
