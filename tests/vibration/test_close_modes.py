"""Two modes so close that the record shows one line are known by the mean energy, and are in the band."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.histories.history import Samples
from d2rpick.vibration.modal import ModalVibration, identify_modal
from tests.energies import require
from tests.vibration.linear_structure import LinearStructure
from tests.vibration.test_modal import PAIRS, compute_residuals

TIME = np.linspace(0.0, 9.0, 901)
PERIODS = 8.0


def make_close(
    cycles_apart: float, phase: float, *, damping: float = 0.004
) -> LinearStructure:
    """Make two modes whose energies differ by ``cycles_apart`` over the record, and a third one."""
    span = TIME[-1]
    rate = np.pi / span * np.array([2 * PERIODS, 2 * PERIODS + cycles_apart, 37.0])
    return LinearStructure(
        np.sqrt([0.6, 0.4, 0.1]),
        damping * np.ones(3),
        rate,
        np.array([0.3, 0.3 + phase, 1.0]),
    )


def identify_in_noise(
    structure: LinearStructure, noise: float = 0.005, static: Samples | float = 0.0
) -> ModalVibration:
    """Identify the modes of a structure from its energy with noise and a static part."""
    energy = structure.elastic_energy(TIME)
    normal = np.random.default_rng(7).standard_normal(TIME.size)
    return require(
        identify_modal(TIME, energy + static + noise * np.ptp(energy) * normal)
    )


@pytest.mark.parametrize(
    ("cycles_apart", "phase"), [(0.08, 0.2), (0.06, 0.3), (0.1, 0.1)]
)
def test_modes_that_get_out_of_phase_are_in_the_band(
    cycles_apart: float, phase: float
) -> None:
    structure = make_close(cycles_apart, phase)
    modal = identify_in_noise(structure)
    close_modes = require(modal.with_close_modes)
    true = structure.residual(*PAIRS)
    squared = close_modes.residual_squared(*PAIRS)
    assert np.sqrt(np.mean((squared - true**2) ** 2)) < 0.05
    as_one_line = modal.reading.residual_squared(*PAIRS)
    assert np.mean((as_one_line - true**2) ** 2) > 2 * np.mean((squared - true**2) ** 2)
    stated, low, high = modal.residual_band(compute_residuals(modal, *PAIRS), *PAIRS)
    assert np.mean((true > low - 1e-3) & (true < high + 1e-3)) > 0.95
    assert np.all(stated >= np.sqrt(squared) - 1e-9)
    assert np.all(stated <= high)
    # Even if one line hides how far the modes are out of phase, no small residual is stated for a large one.
    assert not np.any((stated < 0.25) & (true > 0.3))


@pytest.mark.parametrize("static", [0.0, 0.05, 0.3, 3.0])
def test_static_energy_that_stays_is_no_beat(static: float) -> None:
    structure = LinearStructure.draw(21, 3)
    assert identify_in_noise(structure, static=static).with_close_modes is None


@pytest.mark.parametrize(("least", "rise"), [(0.5, 0.04), (3.0, 0.05)])
def test_static_energy_that_hardly_rises_while_a_line_decays_is_no_beat(
    least: float, rise: float
) -> None:
    """Both are relative to the energy of the lines at the start of the record."""
    structure = make_close(0.0, 0.0, damping=0.02)
    level = np.sum(structure.amplitude**2) / 2
    heat = level * (least + rise * TIME / TIME[-1])
    assert identify_in_noise(structure, 0.01, static=heat).with_close_modes is None


def test_lines_without_noise_tell_close_modes_by_themselves() -> None:
    modal = identify_in_noise(make_close(0.3, 0.3), noise=0.0)
    assert modal.with_close_modes is None
    assert modal.reading.modes.poles.size == 3


def test_heat_that_looks_like_a_beat_leaves_what_is_stated_and_widens_the_band() -> (
    None
):
    structure = make_close(0.0, 0.0, damping=0.02)
    level = np.sum(structure.amplitude**2) / 2
    heat = level * (0.05 + 0.05 * TIME / TIME[-1])
    modal = identify_in_noise(structure, 0.01, static=heat)
    assert modal.with_close_modes is not None
    true = structure.residual(*PAIRS)
    squared = modal.reading.residual_squared(*PAIRS)
    assert np.sqrt(np.mean((squared - true**2) ** 2)) < 0.02
    _, low, high = modal.residual_band(compute_residuals(modal, *PAIRS), *PAIRS)
    assert np.mean((true > low - 1e-3) & (true < high + 1e-3)) > 0.95
