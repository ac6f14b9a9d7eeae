"""Export the names that ``import d2rpick`` provides and the commands use: questions about runs, and their answers.

A name is imported when it is first used.  Type checkers and editors find the names in the stub
``d2rpick/__init__.pyi``.
"""

from __future__ import annotations

TYPE_CHECKING = False  # Importing typing would slow down start-up.
if TYPE_CHECKING:
    from typing import Any

_NAMES = {
    "base.errors": "ChangedError ConfigurationError D2RPickError DeckError FormatError HistoryError RangeError",
    "api.suggestions": "Suggestion Verdict suggest verify",
    "api.judged_cards": "JudgedCard card",
    "api.costs": "Calibration PartTable calibrate parts",
    "api.checking": "Findings check",
    "api.plans": "Exploration Plan explore plan",
    "api.running": "FirstRun first follow",
    "api.runs": "Run from_frame read",
    "api.studies": "Study study",
    "report.follow": "Event",
    "vibration.oscillator": "Oscillator",
    "choice.parts.cost": "Weights",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

names = ["__version__", *sorted(_HOME)]


def __getattr__(name: str) -> Any:
    """Import an exported name when it is first used."""
    if name not in _HOME:
        raise AttributeError(f"module 'd2rpick' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"d2rpick.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return names
