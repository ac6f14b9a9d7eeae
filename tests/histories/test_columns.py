"""Columns that a history derives for many times at once are those of single times."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.histories.history import History, Precision
from d2rpick.histories.samples import find_extrema


def _history(time: np.ndarray, energy: np.ndarray) -> History:
    return History(time, energy, source=("made",), format="made", channel="E")


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=30), st.lists(st.floats(0, 1), min_size=1, max_size=20))
def test_many_energies_are_those_of_single_times(energy: list[float], shares: list[float]) -> None:
    history = _history(np.arange(len(energy)) * 0.5, np.array(energy))
    times = np.array([*shares, 0.0, 1.0]) * history.time[-1]
    assert history.energies_at(times).tolist() == pytest.approx([history.energy_at(t) for t in times.tolist()])


@given(st.lists(st.integers(-2, 2), min_size=2, max_size=20))
def test_turns_and_peaks_are_the_extrema(energy: list[int]) -> None:
    history = _history(np.arange(len(energy), dtype=float), np.array(energy, dtype=float))
    found = find_extrema(history.time, history.energy)
    assert history.turns.tolist() == [one.time for one in found]
    assert history.peaks.tolist() == [one.time for one in found if one.peak]


@pytest.mark.parametrize("precision", [Precision(6), Precision(decimals=4), Precision()])
def test_quanta_are_the_quantum_of_each(precision: Precision) -> None:
    values = np.array([0.0, 1.0, -1.0, 0.0640123, 999999.0, 1e-30, -7.5e12])
    assert precision.quanta(values).tolist() == pytest.approx(
        [precision.quantum(v) for v in values.tolist()], rel=1e-12
    )
