"""A curve with fewer points looks the same."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.histories.samples import outline


@given(st.integers(3, 3000), st.integers(0, 100), st.integers(1, 200))
def test_an_outline_keeps_ends_and_extremes_and_stays_small(states: int, seed: int, stretches: int) -> None:
    energy = np.random.default_rng(seed).standard_normal(states)
    time, drawn = outline(np.arange(states, dtype=float), energy, stretches)
    assert time.size <= min(states, 2 * stretches + 2)
    assert (drawn.min(), drawn.max()) == (energy.min(), energy.max())
    assert (time[0], time[-1]) == (0, states - 1)
    assert np.all(np.diff(time) > 0)
    assert np.all(energy[time.astype(int)] == drawn)


@given(st.integers(10, 3000), st.integers(0, 100))
def test_of_each_stretch_the_extremes_stay(states: int, seed: int) -> None:
    energy = np.random.default_rng(seed).standard_normal(states)
    time, _ = outline(np.arange(states, dtype=float), energy, 4)
    for piece in np.array_split(np.arange(states), 4):
        assert {piece[0] + energy[piece].argmin(), piece[0] + energy[piece].argmax()} <= {*time.astype(int).tolist()}
