"""Energy histories that several tests use, and helpers to choose times in them and read the warnings."""

from dataclasses import replace
from types import SimpleNamespace
from typing import TypeVar, cast

import numpy as np

from d2rpick.choice.answers import PairSuggestion, suggest_in_run
from d2rpick.choice.question import Reference, Settings
from d2rpick.histories.history import History
from d2rpick.histories.run import OpenedRun
from tests.command import ROLLOVER

T = TypeVar("T")


def require(value: T | None) -> T:
    """Return ``value``, which must not be None."""
    assert value is not None
    return value


def list_codes(answer: PairSuggestion) -> set[str]:
    return {caution.code for caution in answer.cautions}


def make_energy_history(energy: np.ndarray, time: np.ndarray) -> History:
    return History(time, energy, source=("test",), format="csv", channel="E")


def read_rollover() -> History:
    table = np.genfromtxt(ROLLOVER, delimiter=",", names=True)
    return make_energy_history(table["boxIE_J"], table["time_s"])


def make_vibration_energy(step: float = 0.01, decay: float = 0.0) -> History:
    """Return the energy of one mode whose deformation has period 1, undamped by default."""
    time = np.arange(0, 4, step)
    return make_energy_history(
        np.exp(-decay * time) * np.sin(2 * np.pi * time) ** 2, time
    )


def make_reference(history: History) -> Reference:
    """Wrap a history made in memory as a reference run without databases."""
    bare = SimpleNamespace(databases=(), parts=(), sources=("made",))
    return Reference(cast(OpenedRun, bare), history)


def suggest_in_window(
    history: History,
    window: tuple[float, float] | None,
    settings: Settings,
) -> PairSuggestion:
    """Choose tr and td in a history made in memory."""
    return suggest_in_run(make_reference(history), window, settings)


def forget(history: History) -> History:
    """Return the same record without what was computed for it."""
    return replace(history)


def count_fits(history: History) -> int:
    """Return the number of fits that were computed for a record rather than taken from its memory."""
    functions = (function for function, *_ in history.memory.results)
    return sum(
        function.__module__.startswith("d2rpick.vibration") for function in functions
    )
