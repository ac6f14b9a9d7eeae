"""Every form of every result can be written, and the commands offer just these."""

from __future__ import annotations

import importlib

import pytest

from d2rpick.report.formats import FORMATS
from tests.command import ENERGY, run

COMMANDS = {
    "suggestion": ("suggest", "--td", "0.064"),
    "verdict": ("verify", "--tr", "0.0135867", "--td", "0.0687534"),
    "overview": ("info",),
    "study": ("study", "--td", "0.064"),
    "plan": ("plan",),
    "trade_off": ("explore", "--steps", "5"),
}


@pytest.mark.parametrize(("result", "form"), [(result, form) for result in FORMATS for form in FORMATS[result]])
def test_every_form_is_written(result: str, form: str) -> None:
    written = run(*COMMANDS[result], "-f", form, ENERGY)
    assert written.exit_code == 0, written.stderr
    assert written.stdout.strip()


@pytest.mark.parametrize("result", FORMATS)
def test_commands_offer_the_forms_of_their_result(result: str) -> None:
    command = importlib.import_module(f"d2rpick.cli.{COMMANDS[result][0]}").command
    (choice,) = (option.type.choices for option in command.params if option.name == "output_format")
    assert [form for form in choice if form != "card"] == list(FORMATS[result])
    assert choice[0] == "table"
