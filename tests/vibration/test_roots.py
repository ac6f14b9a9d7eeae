"""The bracketing root finder against roots that are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.vibration.roots import narrow

ROOTS = st.lists(st.floats(0.01, 0.99), min_size=1, max_size=8).map(np.array)


@pytest.mark.parametrize("with_slope", [False, True])
@given(ROOTS)
def test_every_bracket_narrows_on_its_root(with_slope: bool, roots: np.ndarray) -> None:
    found = narrow(
        lambda t: roots**3 - t**3, np.zeros(roots.size), np.ones(roots.size),
        slope=(lambda t: -3 * t**2) if with_slope else None, steps=64,
    )  # fmt: skip
    np.testing.assert_allclose(found.at, roots, rtol=1e-12)
    assert np.all(found.within <= found.at)
    assert np.all(found.at <= found.beyond)


@given(ROOTS)
def test_what_is_within_stays_within_either_way_round(roots: np.ndarray) -> None:
    upwards = narrow(lambda t: t < roots, np.zeros(roots.size), np.ones(roots.size))
    downwards = narrow(lambda t: t >= roots, np.ones(roots.size), np.zeros(roots.size))
    assert np.all(upwards.within < roots)
    assert np.all(downwards.within >= roots)
    np.testing.assert_allclose(upwards.within, downwards.within, atol=1e-12)


@given(ROOTS)
def test_a_root_is_the_same_to_the_last_digit_alone_and_beside_others(roots: np.ndarray) -> None:
    def found(some: np.ndarray) -> list[float]:
        ends = np.zeros(some.size), np.ones(some.size)
        return [*map(float, narrow(lambda t: some**3 - t**3, *ends, slope=lambda t: -3 * t**2).at)]

    assert found(roots) == [found(roots[i : i + 1])[0] for i in range(roots.size)]
