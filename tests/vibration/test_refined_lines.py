"""Spectral lines in noise are those of the smallest misfit, and none is missed that the record shows."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.histories.history import Samples
from d2rpick.vibration.lines import Grid, Prediction, make_even_grid, predict
from d2rpick.vibration.refined_lines import refine_prediction
from tests.energies import require
from tests.vibration.linear_structure import LinearStructure

TIME = np.linspace(0.0, 9.0, 1801)
NOISE = 0.02


def draw_noisy(seed: int, count: int, noise: float) -> tuple[LinearStructure, Samples]:
    """Draw a structure, and its elastic energy with noise relative to the swing of the energy."""
    structure = LinearStructure.draw(seed, count)
    energy = structure.elastic_energy(TIME)
    normal = np.random.default_rng(seed).standard_normal(TIME.size)
    return structure, energy + noise * np.ptp(energy) * normal


def predict_record(energy: Samples) -> tuple[Grid, Prediction]:
    """Return the grid of an energy at `TIME`, and its lines before they are refined."""
    grid = make_even_grid(TIME, energy)
    return grid, require(predict(grid))


def measure_rate_errors(prediction: Prediction, structure: LinearStructure) -> Samples:
    """Return how far the nearest line is from twice the rate of each mode [cycles over the record]."""
    rates = prediction.spectrum.lines.poles.imag
    apart = np.abs(np.subtract.outer(2 * structure.rate, rates)).min(axis=1)
    return np.asarray(apart * (TIME[-1] - TIME[0]) / (2 * np.pi))


@pytest.mark.parametrize("noise", [0.01, 0.02])
def test_a_line_that_dies_early_is_found_although_noise_outlasts_it(
    noise: float,
) -> None:
    structure, energy = draw_noisy(1117, 4, noise)
    grid, prediction = predict_record(energy)
    assert measure_rate_errors(prediction, structure).max() > 1.0
    refined = refine_prediction(grid, prediction)
    assert measure_rate_errors(refined, structure).max() < 0.05


@pytest.mark.parametrize("seed", [0, 5])
def test_a_line_that_dies_within_a_tenth_of_the_record_is_found_if_it_has_many_cycles(
    seed: int,
) -> None:
    # The line of the last mode falls by a factor of e in 12 cycles, and 9 times as long is recorded.
    structure = LinearStructure(
        np.array([0.37, 1.0, 0.4, 0.5]),
        np.array([0.03, 0.18, 0.24, 0.49]),
        np.array([9.06, 21.9, 25.2, 36.2]),
        np.array([0.3, 1.0, 2.0, 0.5]),
    )
    energy = structure.elastic_energy(TIME)
    normal = np.random.default_rng(seed).standard_normal(TIME.size)
    grid, prediction = predict_record(energy + NOISE * np.ptp(energy) * normal)
    assert measure_rate_errors(prediction, structure).max() > 1.0
    refined = refine_prediction(grid, prediction)
    assert measure_rate_errors(refined, structure).max() < 0.2


def test_the_first_part_keeps_two_lines_that_hardly_part_in_it() -> None:
    # The two lines of the energy are half a cycle apart over the record.
    time = TIME[::4]
    rates = np.pi * np.array([80.0, 80.5]) / (time[-1] - time[0])
    amplitudes = np.array([0.7, 1.0])
    structure = LinearStructure(amplitudes, np.zeros(2), rates, np.array([0.4, 1.1]))
    energy = structure.elastic_energy(time)
    before: list[Samples] = []
    after: list[Samples] = []
    for seed in range(6):
        normal = np.random.default_rng(seed).standard_normal(time.size)
        grid = make_even_grid(time, energy + NOISE * np.ptp(energy) * normal)
        prediction = require(predict(grid))
        for predicted, errors in (
            (prediction, before),
            (refine_prediction(grid, prediction), after),
        ):
            heights = 2 * np.abs(predicted.of_first_part.lines.weights)
            errors.append(np.sort(heights) / amplitudes**2 - 1)
    assert np.abs(after).max() < 0.5 < np.abs(before).max()
    assert np.std(after) < 0.5 * np.std(before)


def test_a_line_that_stands_out_of_the_misfit_is_found() -> None:
    time = TIME[::24]
    waves = (
        np.cos(2 * np.pi * time)
        + 0.2 * np.cos(2 * np.pi * 1.4 * time + 1.0)
        + 0.02 * np.cos(2 * np.pi * 2.9 * time + 2.0)
    )
    noise = 0.01 * np.random.default_rng(3).standard_normal(time.size)
    grid = make_even_grid(time, 2.0 + waves + noise)
    refined = refine_prediction(grid, require(predict(grid)))
    cycles = refined.spectrum.lines.poles.imag / (2 * np.pi)
    assert np.abs(cycles - 2.9).min() < 0.02


def test_the_rates_come_nearer_to_those_of_the_structure() -> None:
    before, after = [], []
    for seed in range(1, 13):
        structure, energy = draw_noisy(seed, 3, NOISE)
        grid, prediction = predict_record(energy)
        before.append(measure_rate_errors(prediction, structure))
        refined = refine_prediction(grid, prediction)
        after.append(measure_rate_errors(refined, structure))
    assert np.median(np.square(after)) < 0.8 * np.median(np.square(before))


def test_lines_of_noise_alone_are_neither_added_nor_kept() -> None:
    structure = LinearStructure.draw(3, 2)
    energy = structure.elastic_energy(TIME)
    random = np.random.default_rng(11)
    counts, refined_counts = [], []
    for _ in range(20):
        normal = random.standard_normal(TIME.size)
        grid, prediction = predict_record(energy + NOISE * np.ptp(energy) * normal)
        refined = refine_prediction(grid, prediction)
        counts.append(prediction.spectrum.lines.poles.size)
        refined_counts.append(refined.spectrum.lines.poles.size)
        assert measure_rate_errors(refined, structure).max() < 0.05
    assert max(counts) > 2
    assert max(refined_counts) == 2


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_lines_are_left_as_they_are_without_noise_and_beside_the_end_of_a_load(
    noise: float,
) -> None:
    _, energy = draw_noisy(5, 3, noise)
    loaded = noise * np.ptp(energy) * np.maximum(1 - TIME / 0.5, 0.0) * 1e3
    grid, prediction = predict_record(energy + loaded)
    assert refine_prediction(grid, prediction) is prediction
