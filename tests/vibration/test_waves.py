"""Sums of waves: signed records made of a few waves are recovered, other records are refused."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.vibration.waves import Waves, fit_waves
from tests.energies import require

MADE = Waves(
    np.array([-0.1 + 5j, -0.1 + 8j, -0.1 + 13j]), np.array([1 + 0.3j, -0.6j, 0.2]), 0.0
)
TIME = np.linspace(0, 9, 700)


@given(
    st.floats(3, 6),
    st.floats(1.2, 2.5),
    st.floats(0, 0.4),
    st.floats(0, 6.3),
    st.booleans(),
)
def test_waves_are_found_again(
    rate: float, ratio: float, damping: float, phase: float, even: bool
) -> None:
    rates = -damping + 1j * rate * np.array([1.0, ratio, 1.6 * ratio])
    true_waves = Waves(rates, np.exp(1j * phase * np.arange(3)), 0.0)
    time = TIME if even else TIME + 0.001 * np.sin(40 * TIME)
    fitted = require(fit_waves(time, true_waves.deformation(time)))
    room = (1e-6 if even else 0.02) * true_waves.vibration_energy(time)
    assert np.all(np.abs(fitted.energy(time) - true_waves.energy(time)) < room + 1e-9)
    assert np.all(
        np.abs(fitted.kinetic_energy(time) - true_waves.kinetic_energy(time))
        < 2 * room + 1e-9
    )


def test_one_wave_is_an_oscillator() -> None:
    single_wave = Waves(MADE.rates[:1], MADE.weights[:1], 0.0)
    velocity = np.gradient(single_wave.deformation(TIME), TIME, edge_order=2)
    assert single_wave.kinetic_energy(TIME) == pytest.approx(
        (velocity / abs(single_wave.rates[0])) ** 2, abs=2e-3
    )
    assert single_wave.alpha == pytest.approx(0.2)
    assert single_wave.vibration_energy(0.3) == pytest.approx(
        single_wave.energy(0.3) + single_wave.kinetic_energy(0.3)
    )


def test_the_fewest_waves_that_do_are_taken() -> None:
    noise = 1e-3 * np.random.default_rng(1).standard_normal(TIME.size)
    fitted = require(fit_waves(TIME, MADE.deformation(TIME) + noise))
    assert np.sort(fitted.rates.imag) == pytest.approx([5, 8, 13], abs=0.01)
    assert np.all(fitted.rates.real <= 0)


def test_far_before_the_record_nothing_overflows() -> None:
    assert np.all(np.isfinite(MADE.energy(np.array([-1e5, 1e5]))))


def test_too_few_states_and_rest_have_no_waves() -> None:
    assert fit_waves(TIME[:20], np.sin(5 * TIME[:20])) is None
    assert fit_waves(TIME, np.zeros(TIME.size)) is None
    assert fit_waves(TIME, np.ones(TIME.size)) is None
