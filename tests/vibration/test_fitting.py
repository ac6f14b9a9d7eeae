"""Misfit of a fit: scatter or structure, and when a subset of the samples decides."""

from collections.abc import Callable

import numpy as np
import pytest

from d2rpick.histories.history import Samples
from d2rpick.vibration.fitting import (
    MAX_STRUCTURE,
    VIBRATION,
    WITH_PRELOAD,
    Pencil,
    fit,
    fit_all,
    fit_few,
    has_clear_structure,
    measure_structure,
)
from d2rpick.vibration.identify import HOPELESS, identify
from d2rpick.vibration.modes import (
    compute_energy_and_jacobian,
    prepare_energy_and_jacobian,
)

S = np.linspace(0.0, 1.0, 20_000)


def draw_noise(size: int, seed: int = 14) -> np.ndarray:
    """Return white noise of unit variance."""
    return np.random.default_rng(seed).standard_normal(size)


def test_a_vibration_is_structure_and_white_noise_is_none() -> None:
    wave = np.sin(40 * S)
    assert measure_structure(wave) == pytest.approx(np.sqrt(0.5), rel=0.05)
    assert measure_structure(draw_noise(S.size)) < 0.05
    assert has_clear_structure(0.1 * wave, 1.0)
    assert not has_clear_structure(MAX_STRUCTURE * wave, 1.0)
    assert not any(
        has_clear_structure(draw_noise(2000, seed), 1.0) for seed in range(200)
    )


@pytest.mark.slow
@pytest.mark.parametrize("scatter", [0.0, 0.05, 0.3])
def test_a_part_of_the_samples_refuses_only_what_all_of_them_refuse(
    scatter: float,
) -> None:
    one_mode = np.exp(-S) * np.sin(20 * S) ** 2 + scatter * draw_noise(S.size) / 4
    two = one_mode + 0.7 * np.exp(-S) * np.cos(33 * S) ** 2
    many_modes = (
        two
        + 0.6 * np.exp(-S) * np.sin(57 * S) ** 2
        + 0.5 * np.exp(-S) * np.sin(91 * S) ** 2
    )
    for energy in (one_mode, two, many_modes):
        quick, full = identify(S, energy, quick=True), identify(S, energy)
        assert quick.describes_record == full.describes_record
        if full.describes_record:
            assert (quick.mode, quick.rms) == (full.mode, full.rms)


@pytest.mark.parametrize("scatter", [0.0, 0.1, 0.3])
@pytest.mark.parametrize(
    ("preload", "plastic"), [(0.0, 0.0), (0.0, 2.0), (0.7, 0.3), (4.0, 0.0)]
)
def test_no_single_oscillator_is_hopeless_and_five_modes_are(
    preload: float, plastic: float, scatter: float
) -> None:
    def gives_up(energy: np.ndarray) -> bool:
        noisy = energy / np.ptp(energy) + scatter * float(
            np.std(energy / np.ptp(energy))
        ) * draw_noise(S.size)
        return (
            fit_few(Pencil.of(S, noisy).rates(), S, noisy, WITH_PRELOAD, HOPELESS)
            is None
        )

    assert not any(
        gives_up(plastic + (preload + np.exp(-S / 2) * np.sin(rate * S + phase)) ** 2)
        for rate in (9.0, 40.0, 300.0)
        for phase in (0.0, 2.0)
    )
    rates = 2 * np.pi * np.array([15.5, 28.5, 46.5, 69.5, 106.0])
    assert gives_up(
        np.sum(
            np.sin(rates[:, np.newaxis] * S + np.arange(5)[:, np.newaxis]) ** 2, axis=0
        )
    )


def test_a_fit_that_leaves_another_mode_fails_early() -> None:
    one_mode = np.exp(-S) * np.sin(20 * S) ** 2
    for share, follows in (
        (0.0, True),
        (0.05, False),
        (0.1, False),
    ):  # structure in the last 400 samples is sufficient
        two = one_mode + share * np.exp(-S) * np.sin(33 * S) ** 2
        poles = Pencil.of(S, two).rates()
        quick_fit = fit_few(poles, S, two, VIBRATION, HOPELESS)
        assert (fit(quick_fit, S, two, VIBRATION, HOPELESS) is not None) == follows
        few_fit = fit_few(poles, S, two, VIBRATION, np.inf)
        assert (
            fit(few_fit, S[:1500], two[:1500], VIBRATION) is not None
        )  # asked for its misfit, none is held back


def test_a_fit_that_leaves_far_too_much_is_not_brought_to_its_best_for_all_samples() -> (
    None
):
    decays_tried = []

    def model(parameters: Samples, s: Samples) -> tuple[Samples, Callable[[], Samples]]:
        decays_tried.append(s.size)
        return prepare_energy_and_jacobian(parameters, s, VIBRATION)

    start = np.array([20.0, 1.0, 0.7, 0.7, 0.0, 0.0])
    for energy, all_of_them in (
        (draw_noise(S.size), False),
        (compute_energy_and_jacobian(start, S, VIBRATION)[0], True),
    ):
        decays_tried.clear()
        fit_all(start, model, S, energy, np.inf)
        assert (
            sum(decays_tried) > 10 * S.size / 8 and max(decays_tried) > 2048
        ) == all_of_them


def test_a_drift_is_fitted_to_some_of_the_samples_only() -> None:
    sizes = []

    def model(parameters: Samples, s: Samples) -> tuple[Samples, Callable[[], Samples]]:
        sizes.append(s.size)
        return prepare_energy_and_jacobian(parameters, s, WITH_PRELOAD)

    rate = np.array([0.2, 0.5, 0.7, 0.7, 0.0, 1.0])
    rising = S + 0.05 * np.sin(60 * S) ** 2
    drift = fit_all(rate, model, S, rising, np.inf)
    assert drift is not None
    assert abs(drift[0]) < 2 * np.pi / 10
    assert max(sizes) <= 2048
