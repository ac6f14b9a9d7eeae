"""Test the least-squares solution against that of the singular value decomposition, for any condition of the model."""

import numpy as np
import pytest

from d2rpick.vibration.least_squares import solve_least_squares


def make_model(condition: float, seed: int) -> np.ndarray:
    """Return a random linear model (40, 6) with this condition number, whose parameters have very different scales."""
    random = np.random.default_rng(seed)
    left = np.linalg.qr(random.normal(size=(40, 6)))[0]
    right = np.linalg.qr(random.normal(size=(6, 6)))[0]
    return np.asarray(left * np.geomspace(1.0, 1 / condition, 6) @ right)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("condition", [1.0, 1e2, 1e4, 1e6, 1e8])
def test_the_solution_is_as_accurate_as_that_of_singular_values(
    condition: float, seed: int
) -> None:
    design = make_model(condition, seed)
    values = np.random.default_rng(100 + seed).normal(size=40)
    solution = solve_least_squares(design, values)
    expected = np.linalg.lstsq(design, values, rcond=None)[0]
    error = np.linalg.norm(solution - expected) / np.linalg.norm(expected)
    assert error < 100 * condition * np.finfo(float).eps


def test_of_equal_effects_each_parameter_gets_the_same_share() -> None:
    wave = np.sin(np.arange(30.0))
    solution = solve_least_squares(np.column_stack([wave, wave]), 3 * wave)
    assert solution == pytest.approx([1.5, 1.5])


def test_a_parameter_without_effect_is_zero() -> None:
    wave = np.sin(np.arange(30.0))
    solution = solve_least_squares(np.column_stack([wave, 0 * wave]), 3 * wave)
    assert solution == pytest.approx([3.0, 0.0])


def test_the_scale_of_a_parameter_does_not_matter() -> None:
    times = np.arange(30.0)
    design = np.column_stack([1e-7 * np.sin(times), np.cos(times)])
    solution = solve_least_squares(design, np.sin(times) - 2 * np.cos(times))
    assert solution == pytest.approx([1e7, -2.0], rel=1e-12)


@pytest.mark.parametrize("size", [1e-10, 1e-14, 0.0])
def test_a_parameter_without_effect_gets_no_value(size: float) -> None:
    """The mean of a wave over a block may vanish; a huge weight of this wave would be an error of the whole model."""
    design = make_model(10.0, 3)
    design[:, 2] *= size
    values = np.random.default_rng(4).normal(size=40)
    solution = solve_least_squares(design, values)
    expected = np.linalg.lstsq(design, values, rcond=1e-9)[0]
    assert np.allclose(solution, expected, rtol=1e-9, atol=1e-12)
    assert np.abs(solution).max() < 1e3
