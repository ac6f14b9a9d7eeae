"""The questions that can be asked, and their answers: what ``import d2rpick`` offers and the command line calls.

What is named here is imported when it is first used.
"""

from __future__ import annotations

TYPE_CHECKING = False  # type checkers take it for theirs; importing typing is left to those who need it
if TYPE_CHECKING:
    from typing import Any

    from d2rpick.api.cards import JudgedCard as JudgedCard
    from d2rpick.api.cards import card as card
    from d2rpick.api.checking import Findings as Findings
    from d2rpick.api.checking import check as check
    from d2rpick.api.costs import Calibration as Calibration
    from d2rpick.api.costs import PartTable as PartTable
    from d2rpick.api.costs import calibrate as calibrate
    from d2rpick.api.costs import parts as parts
    from d2rpick.api.plans import Exploration as Exploration
    from d2rpick.api.plans import Plan as Plan
    from d2rpick.api.plans import explore as explore
    from d2rpick.api.plans import plan as plan
    from d2rpick.api.running import FirstRun as FirstRun
    from d2rpick.api.running import first as first
    from d2rpick.api.running import follow as follow
    from d2rpick.api.runs import Run as Run
    from d2rpick.api.runs import from_frame as from_frame
    from d2rpick.api.runs import read as read
    from d2rpick.api.studies import Study as Study
    from d2rpick.api.studies import study as study
    from d2rpick.api.suggestions import Suggestion as Suggestion
    from d2rpick.api.suggestions import Verdict as Verdict
    from d2rpick.api.suggestions import suggest as suggest
    from d2rpick.api.suggestions import verify as verify
    from d2rpick.base.errors import ChangedError as ChangedError
    from d2rpick.base.errors import ConfigurationError as ConfigurationError
    from d2rpick.base.errors import D2RPickError as D2RPickError
    from d2rpick.base.errors import DeckError as DeckError
    from d2rpick.base.errors import FormatError as FormatError
    from d2rpick.base.errors import HistoryError as HistoryError
    from d2rpick.base.errors import RangeError as RangeError
    from d2rpick.choice.cost import Weights as Weights
    from d2rpick.running.watch import Event as Event
    from d2rpick.vibration.oscillator import Oscillator as Oscillator

_NAMES = {
    "base.errors": "ChangedError ConfigurationError D2RPickError DeckError FormatError HistoryError RangeError",
    "api.suggestions": "Suggestion Verdict suggest verify",
    "api.cards": "JudgedCard card",
    "api.costs": "Calibration PartTable calibrate parts",
    "api.checking": "Findings check",
    "api.plans": "Exploration Plan explore plan",
    "api.running": "FirstRun first follow",
    "api.runs": "Run from_frame read",
    "api.studies": "Study study",
    "running.watch": "Event",
    "vibration.oscillator": "Oscillator",
    "choice.cost": "Weights",
}
_HOME = {name: module for module, names in _NAMES.items() for name in names.split()}

names = ["__version__", *sorted(_HOME)]


def __getattr__(name: str) -> Any:
    """Import what is asked for by name."""
    if name not in _HOME:
        raise AttributeError(f"module 'd2rpick' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"d2rpick.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return names
