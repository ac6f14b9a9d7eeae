"""The keyword arguments of Python for the choice options, generated from the table of these options.

A type checker and an editor read types from the text of a module, so the module is written: ``python -m
tests.generated_arguments``.
"""

import re
from dataclasses import fields
from textwrap import fill

from d2rpick.api.request import Request
from d2rpick.base.options import list_options
from d2rpick.choice.options import ChoiceOptions, list_uses
from tests.command import ROOT

MODULE = ROOT / "d2rpick" / "api" / "choosing.py"
HEAD = '''"""Define the keyword arguments that determine how pairs are chosen and judged.

They follow from `d2rpick.choice.options.ChoiceOptions`: ``python -m tests.generated_arguments`` writes this module.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypedDict

if TYPE_CHECKING:
    from d2rpick.vibration.oscillator import Oscillator
'''
# Arguments of Python that stand for several options of the command line, with their types.
OF_PYTHON = {
    "oscillator": (
        "Oscillator | None",
        "given instead of identified, with ``v0``",
    ),
    "v0": ("float | None", "velocity of the frame of ``oscillator`` at time 0"),
    "replay": (
        "bool | None",
        "False: judge by the energy level alone, without an oscillator (default: True)",
    ),
}


def describe_argument(name: str) -> str:
    """Return the meaning of an argument from the help of its option."""
    meaning = list_options(ChoiceOptions)[name].help.rstrip(".")
    meaning = re.sub(r"\.\s+\[(default: .*)\]$", r" (\1)", meaning)
    default = getattr(Request, name)
    if default is not None and "default: " not in meaning:
        meaning += f" (default: {default})"
    meaning = re.sub(r"`(\w+)`", r"``\1``", meaning)
    return meaning[0].lower() + meaning[1:]


def list_arguments(names: tuple[str, ...]) -> dict[str, tuple[str, str]]:
    """Return the type and the meaning of options as arguments, by name; None stands for the default of each."""
    types = {field.name: str(field.type) for field in fields(ChoiceOptions)}
    optional = {name: types[name].removesuffix(" | None") for name in names}
    for name in names:
        if list_options(ChoiceOptions)[name].is_time:
            optional[name] = optional[name].replace("float", "float | str")
    return {
        name: (f"{optional[name]} | None", describe_argument(name)) for name in names
    }


def write_class(
    head: str, summary: str, arguments: dict[str, tuple[str, str]]
) -> list[str]:
    """Return the lines of a typed dictionary."""
    meanings = [f"``{name}``: {meaning}." for name, (_, meaning) in arguments.items()]
    text = fill(
        "  ".join(meanings), 119, initial_indent=" " * 4, subsequent_indent=" " * 4
    )
    return [
        f"\n\nclass {head}:",
        f'    """{summary}',
        "",
        text,
        '    """',
        "",
        *(f"    {name}: {kind}" for name, (kind, _) in arguments.items()),
    ]


def write_module() -> str:
    """Return the text of the module."""
    of_cards = tuple(name for name, use in list_uses().items() if use.of_cards)
    others = tuple(name for name in list_uses() if name not in of_cards)
    judging = write_class(
        "JudgingOptions(TypedDict, total=False)",
        "Options that determine how a pair is judged.  None stands for the default.\n\n"
        '    Times have the unit of the history, or are strings with a unit, such as ``"64ms"``.',
        list_arguments(of_cards),
    )
    choosing = write_class(
        "Choosing(JudgingOptions, total=False)",
        "Options that determine how pairs are chosen and judged, as in ``d2rpick suggest``.  "
        "None stands for the default.",
        list_arguments(others) | OF_PYTHON,
    )
    return "\n".join([HEAD.rstrip("\n"), *judging, *choosing, ""])


if __name__ == "__main__":
    MODULE.write_text(write_module(), "utf-8")
