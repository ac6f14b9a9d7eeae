"""Every format of every result can be written, and the commands offer exactly these formats."""

import click
import pytest

from d2rpick.cli import d2rpick
from d2rpick.report.formats import FORMATS
from tests.command import ENERGY, run

COMMANDS = {
    "suggestion": ("suggest", "--td", "0.064", ENERGY),
    "verdict": ("verify", "--tr", "0.0135867", "--td", "0.0687534", ENERGY),
    "overview": ("info", ENERGY),
    "study": ("study", "--td", "0.064", ENERGY),
    "plan": ("plan", ENERGY),
    "trade_off": ("explore", "--steps", "5", ENERGY),
    "parts": (
        "parts",
        "--deck",
        "sample_data/rollover_box.k",
        "sample_data/rollover_box.matsum",
    ),
    "calibration": ("calibrate", "sample_data/flying_box"),
    "rollover": ("rollover", "--scan"),
    "drive": ("drive",),
    "findings": (
        "check",
        "--exit-zero",
        "sample_data/switching.k",
        "--history",
        "sample_data/energy.glstat",
    ),
}


pytestmark = pytest.mark.usefixtures("by_level")  # only the form matters here

# A scan takes seconds, and a driven run needs a solver, so their own tests write all their formats.
QUICK = [
    (result, form)
    for result in FORMATS
    for form in FORMATS[result]
    if result not in ("rollover", "drive")
]


@pytest.mark.parametrize(("result", "form"), QUICK)
def test_every_form_is_written(result: str, form: str) -> None:
    written = run(*COMMANDS[result], "-f", form)
    # By the level alone, no set of parts can be used.
    assert written.exit_code == (1 if result == "parts" else 0), written.stderr
    assert written.stdout.strip()


@pytest.mark.parametrize("result", FORMATS)
def test_commands_offer_the_forms_of_their_result(result: str) -> None:
    command = d2rpick.get_command(click.Context(d2rpick), COMMANDS[result][0])
    assert command is not None
    (kind,) = (
        option.type for option in command.params if option.name == "output_format"
    )
    assert isinstance(kind, click.Choice)
    choice = list(kind.choices)
    assert [form for form in choice if form != "card"] == list(FORMATS[result])
    assert choice[0] == "table"
