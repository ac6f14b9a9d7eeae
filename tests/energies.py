"""Histories that several tests choose from, and what is warned of in an answer."""

from typing import TypeVar

import numpy as np

from d2rpick.choice.answers import Suggestion
from d2rpick.histories.history import History
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
