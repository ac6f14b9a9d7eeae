"""Every warning has an explanation: what it means for the decision, and what to do."""

import re

import pytest

from d2rpick.report.warning_texts import EXPLANATIONS
from tests.command import ROOT, run, unwrapped


def codes() -> set[str]:
    """Codes of all warnings in the source: what stands first in a Caution, or names one."""
    found: set[str] = set()
    for path in (ROOT / "d2rpick").rglob("*.py"):
        text = path.read_text()
        found.update(re.findall(r'Caution\(\s*"([a-z-]+)"', text))
        found.update(re.findall(r'^\s+\("([a-z-]+)", lambda h', text, re.MULTILINE))
    return found


def test_every_warning_is_explained() -> None:
    assert len(codes()) > 50
    assert codes() - {*EXPLANATIONS} == set()


@pytest.mark.parametrize("code", EXPLANATIONS)
def test_an_explanation_has_short_sentences(code: str) -> None:
    for text in EXPLANATIONS[code]:
        assert text.endswith(".")
        assert all(len(sentence.split()) <= 35 for sentence in text.split(". "))


def test_the_command_explains_a_warning_by_its_code() -> None:
    shown = unwrapped(run("rule", "poor-td").stdout)
    assert shown.startswith("poor-td (warning): More than half of the vibration energy")
    assert " Fix: Choose the td that is named as better" in shown
    refused = run("rule", "no-such-code")
    assert refused.exit_code == 2
