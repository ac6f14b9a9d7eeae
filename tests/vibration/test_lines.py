"""Spectral lines of an energy, and reasons why they cannot be found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.vibration.doubts import MOST_MISSED
from d2rpick.vibration.lines import (
    Exponentials,
    fit_spectrum,
    is_unpredictable,
    make_even_grid,
    predict,
)
from tests.energies import require
from tests.vibration.linear_structure import LinearStructure

TIME = np.linspace(0.0, 8.0, 1201)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 6))
def test_each_mode_has_a_line_at_twice_its_rate_and_decay(
    seed: int, count: int
) -> None:
    structure = LinearStructure.draw(seed, count)
    predicted_lines = require(
        predict(make_even_grid(TIME, structure.elastic_energy(TIME)))
    )
    lines = predicted_lines.spectrum.lines
    for rate, damping, amplitude in zip(
        structure.rate, structure.damping, structure.amplitude, strict=True
    ):
        nearest = int(np.argmin(np.abs(lines.poles - (-2 * damping + 2j * rate))))
        assert lines.poles[nearest].imag == pytest.approx(2 * rate, rel=1e-3)
        assert abs(lines.weights[nearest]) == pytest.approx(amplitude**2 / 2, rel=0.02)
    assert predicted_lines.missed < 0.05


def test_the_mean_over_a_block_of_a_wave_is_the_wave_with_a_gain() -> None:
    time = np.linspace(0.0, 40.0, 20001)
    wave = Exponentials(np.array([-0.05 + 3.0j]), np.array([2.0 - 1.0j]), 0.0)
    grid = make_even_grid(time, wave.at(time))
    assert grid.size > 10
    expected = wave._replace(weights=wave.weights * grid.gain(wave.poles)).at(grid.time)
    np.testing.assert_allclose(grid.energy, expected, atol=1e-12)
    spectrum = fit_spectrum(grid, wave.poles, grid.span)
    np.testing.assert_allclose(spectrum.at(time), wave.at(time), atol=1e-9)
    assert spectrum.error < 1e-9


def test_a_growing_pole_is_held_level_and_a_fast_decay_is_no_line() -> None:
    grid = make_even_grid(TIME, np.cos(20.0 * TIME))
    spectrum = fit_spectrum(grid, np.array([3.0 + 20.0j, -15.0 + 30.0j]), grid.span)
    assert spectrum.lines.poles.size == 1
    assert spectrum.lines.poles.real[0] == pytest.approx(0.2 / grid.span)


@pytest.mark.parametrize(
    "energy", [np.zeros(TIME.size), np.ones(10)], ids=["nothing", "short"]
)
def test_an_energy_without_a_swing_has_no_lines(energy: np.ndarray) -> None:
    assert predict(make_even_grid(TIME[: energy.size], energy)) is None


def test_uneven_states_show_the_same_lines() -> None:
    structure = LinearStructure.draw(3, 2)
    random = np.random.default_rng(1)
    time = np.sort(random.uniform(0.0, 8.0, 1500))
    lines = require(predict(make_even_grid(time, structure.elastic_energy(time))))
    strongest = np.sort(
        lines.spectrum.lines.poles.imag[
            np.argsort(-np.abs(lines.spectrum.lines.weights))[:2]
        ]
    )
    np.testing.assert_allclose(strongest, 2 * structure.rate, rtol=1e-3)


def test_the_first_part_does_not_predict_what_a_later_push_does() -> None:
    structure, pushed = LinearStructure.draw(5, 2), LinearStructure.draw(6, 2)
    energy = np.where(
        TIME < 6.5, structure.elastic_energy(TIME), 3 * pushed.elastic_energy(TIME)
    )
    assert require(predict(make_even_grid(TIME, energy))).missed > 0.3


@pytest.mark.parametrize("damping", [0.0, 2.0], ids=["weak", "soon gone"])
def test_a_fast_line_does_not_pass_for_a_slower_one(damping: float) -> None:
    """Means over blocks of states would show it at a frequency below its own."""
    height = 0.01 if damping == 0 else 0.5
    rates = np.array([20.0, 131.0])
    fast = height * np.exp(-damping * TIME) * np.cos(rates[1] * TIME + 0.4)
    energy = 2.0 + np.cos(rates[0] * TIME) + fast
    lines = require(predict(make_even_grid(TIME, energy))).spectrum.lines
    heights = np.abs(lines.weights)
    strongest = np.argsort(-heights)[:2]
    np.testing.assert_allclose(np.sort(lines.poles.imag[strongest]), rates, rtol=1e-6)
    np.testing.assert_allclose(np.sort(heights[strongest])[0], height, rtol=1e-4)


def test_a_line_that_stands_out_of_the_noise_is_found() -> None:
    """The prediction hardly improves with it, because noise is most of the remaining misfit."""
    noise = 0.05 * np.random.default_rng(4).standard_normal(TIME.size)
    energy = 2.0 + np.cos(20.0 * TIME) + 0.03 * np.cos(31.0 * TIME) + noise
    lines = require(predict(make_even_grid(TIME, energy))).spectrum.lines
    assert np.abs(lines.poles.imag - 31.0).min() < 0.2


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.0, 0.02, 0.1]))
def test_no_energy_that_lines_predict_is_called_unpredictable(
    seed: int, noise: float
) -> None:
    energy = LinearStructure.draw(seed, 8).elastic_energy(TIME)
    scatter = (
        noise * np.std(energy) * np.random.default_rng(seed).normal(size=TIME.size)
    )
    grid = make_even_grid(TIME, energy + scatter)
    if require(predict(grid)).missed < MOST_MISSED / 2:
        assert not is_unpredictable(grid, MOST_MISSED)


@pytest.mark.parametrize("seed", range(8))
def test_a_random_walk_is_unpredictable(seed: int) -> None:
    walk = np.cumsum(np.random.default_rng(seed).normal(size=3000))
    grid = make_even_grid(np.linspace(0.0, 1.0, walk.size), walk)
    assert is_unpredictable(grid, MOST_MISSED)
    assert require(predict(grid)).missed > MOST_MISSED


def test_the_quick_test_needs_a_fine_grid_whose_swing_it_can_see() -> None:
    walk = np.cumsum(np.random.default_rng(1).normal(size=500))
    assert not is_unpredictable(make_even_grid(TIME[:500], walk), MOST_MISSED)
    burst = np.where(TIME > 5.0, np.cos(600.0 * TIME), 0.0)
    grid = make_even_grid(TIME, burst)
    assert require(predict(grid)).missed > MOST_MISSED
    assert not is_unpredictable(grid, MOST_MISSED)
