"""Histories that several tests choose from, what is chosen in a window of one, and what is warned of in an answer."""

from types import SimpleNamespace
from typing import TypeVar, cast

import numpy as np

from d2rpick.choice.answers import Suggestion, suggest_of
from d2rpick.choice.question import Reference, Settings
from d2rpick.histories.history import History
from d2rpick.histories.run import Run
from d2rpick.vibration.span import Fits
from tests.command import ROLLOVER

T = TypeVar("T")


def sure(value: T | None) -> T:
    """Give what must be there."""
    assert value is not None
    return value


def codes(answer: Suggestion) -> set[str]:
    return {caution.code for caution in answer.cautions}


def of(energy: np.ndarray, time: np.ndarray) -> History:
    return History(time, energy, source=("test",), format="csv", channel="E")


def rollover() -> History:
    table = np.genfromtxt(ROLLOVER, delimiter=",", names=True)
    return of(table["boxIE_J"], table["time_s"])


def vibration(step: float = 0.01, decay: float = 0.0) -> History:
    """Energy of one mode with period 1 of the deformation, undamped unless told otherwise."""
    time = np.arange(0, 4, step)
    return of(np.exp(-decay * time) * np.sin(2 * np.pi * time) ** 2, time)


def reference(history: History) -> Reference:
    """Give a record that was made in memory as if it had been read: a run without databases."""
    bare = SimpleNamespace(databases=(), parts=(), sources=("made",))
    return Reference(cast("Run", bare), history)


def suggest_in_window(
    history: History,
    window: tuple[float, float] | None,
    settings: Settings,
    fits: Fits | None = None,
) -> Suggestion:
    """Choose both times in a record that was made in memory."""
    return suggest_of(reference(history), window, settings, fits=fits)
