"""Every warning has an explanation with its meaning for the decision, and what to do."""

import re

import pytest

from d2rpick.report.warning_texts import EXPLANATIONS
from tests.command import ROOT, join_wrapped_lines, run


def find_codes() -> set[str]:
    """Return the codes of all warnings in the source: first arguments of Caution, and codes in tables of warnings."""
    codes_found: set[str] = set()
    for path in (ROOT / "d2rpick").rglob("*.py"):
        text = path.read_text()
        codes_found.update(re.findall(r'Caution\(\s*"([a-z-]+)"', text))
        codes_found.update(
            re.findall(r'^\s+\("([a-z-]+)", lambda h', text, re.MULTILINE)
        )
    return codes_found


def test_every_warning_is_explained() -> None:
    assert len(find_codes()) > 50
    assert find_codes() - {*EXPLANATIONS} == set()


@pytest.mark.parametrize("code", EXPLANATIONS)
def test_an_explanation_has_short_sentences(code: str) -> None:
    for text in EXPLANATIONS[code]:
        assert text.endswith(".")
        assert all(len(sentence.split()) <= 35 for sentence in text.split(". "))


def test_the_command_explains_a_warning_by_its_code() -> None:
    text = join_wrapped_lines(run("rule", "poor-td").stdout)
    assert text.startswith("poor-td (warning): More than half of the vibration energy")
    assert " Fix: Choose a td near a peak of the internal energy." in text
    refused = run("rule", "no-such-code")
    assert refused.exit_code == 2
