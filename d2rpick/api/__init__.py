"""The questions that can be asked, and their answers: what ``import d2rpick`` offers and the command line calls.

What is named here is imported when it is first used.
"""

from __future__ import annotations

TYPE_CHECKING = False  # type checkers take it for theirs; importing typing is left to those who need it
if TYPE_CHECKING:
    from typing import Any

    from d2rpick.api.cards import JudgedCard as JudgedCard, card as card
    from d2rpick.api.checking import Findings as Findings, check as check
    from d2rpick.api.costs import (
        Calibration as Calibration,
        PartTable as PartTable,
        calibrate as calibrate,
        parts as parts,
    )
    from d2rpick.api.plans import Exploration as Exploration, Plan as Plan, explore as explore, plan as plan
    from d2rpick.api.running import FirstRun as FirstRun, first as first, follow as follow
    from d2rpick.api.runs import Run as Run, from_frame as from_frame, read as read
    from d2rpick.api.studies import Study as Study, study as study
    from d2rpick.api.suggestions import (
        Suggestion as Suggestion,
        Verdict as Verdict,
        suggest as suggest,
        verify as verify,
    )
    from d2rpick.base.errors import (
        ChangedError as ChangedError,
        ConfigurationError as ConfigurationError,
        D2RPickError as D2RPickError,
        DeckError as DeckError,
        FormatError as FormatError,
        HistoryError as HistoryError,
        RangeError as RangeError,
    )
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
