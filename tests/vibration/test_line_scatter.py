"""The effect of noise on residuals, compared with the scatter in many noisy records."""

from __future__ import annotations

import numpy as np
import pytest

from d2rpick.vibration.modal import identify_modal
from tests.energies import require
from tests.vibration.linear_structure import LinearStructure

TIME = np.linspace(0.0, 9.0, 901)
EVEN = np.linspace(0.0, 9.0, 12)
PAIRS = np.array([(tr, td) for tr in EVEN for td in EVEN if tr < td]).T
RECORDS = 20


@pytest.mark.parametrize(("seed", "noise"), [(3, 0.01), (8, 0.02)])
def test_the_deviation_is_that_of_many_noisy_records(seed: int, noise: float) -> None:
    structure = LinearStructure.draw(seed, 2)
    energy = structure.elastic_energy(TIME)
    random = np.random.default_rng(seed)
    tr, td = PAIRS
    true = structure.residual(tr, td) ** 2
    errors, deviations = [], []
    for _ in range(RECORDS):
        scatter = noise * np.ptp(energy) * random.standard_normal(TIME.size)
        modal = require(identify_modal(TIME, energy + scatter))
        squared = modal.reading.residual_squared(tr, td)
        errors.append(squared - true)
        deviations.append(modal.scatter.compute_deviation(tr, td, squared))
    measured = np.sqrt(np.mean(np.square(errors)))
    expected = np.sqrt(np.mean(np.square(deviations)))
    assert 0.5 < expected / measured < 2.0


def test_a_record_without_scatter_has_no_deviation() -> None:
    structure = LinearStructure.draw(5, 3)
    modal = require(identify_modal(TIME, structure.elastic_energy(TIME)))
    tr, td = PAIRS
    squared = modal.reading.residual_squared(tr, td)
    assert modal.scatter.compute_deviation(tr, td, squared).max() < 1e-4


def test_a_later_td_is_known_less_where_the_vibration_decays() -> None:
    structure = LinearStructure.draw(5, 1)._replace(damping=np.array([0.25]))
    energy = structure.elastic_energy(TIME)
    scatter = 0.01 * np.ptp(energy) * np.random.default_rng(0).standard_normal(901)
    modal = require(identify_modal(TIME, energy + scatter))
    td = np.array([2.0, 8.0])
    squared = modal.reading.residual_squared(0.5, td)
    early, late = modal.scatter.compute_deviation(0.5, td, squared)
    assert late > 2 * early
