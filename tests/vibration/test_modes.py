"""Closed form of a single-mode energy history."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.histories.history import Samples
from d2rpick.vibration.modes import Mode, compute_deformations
from tests import paper
from tests.records import MODE

MODES = st.builds(
    Mode,
    omega=st.floats(0.5, 50),
    alpha=st.floats(0, 5),
    cosine=st.floats(0.1, 2),
    sine=st.floats(-2, 2),
    origin=st.floats(-1, 1),
    energy_plastic=st.floats(0, 3),
    preload=st.floats(-3, 3),
)
T = np.linspace(-0.5, 2.0, 101)


def test_energies_of_the_paper_at_64_ms() -> None:
    assert float(MODE.energy(paper.TD)) == pytest.approx(paper.ENERGY_TD, rel=1e-11)
    assert float(MODE.kinetic_energy(paper.TD)) == pytest.approx(
        paper.KINETIC_TD, rel=1e-11
    )
    share = float(MODE.kinetic_energy(paper.TD) / MODE.vibration_energy(paper.TD))
    assert share == pytest.approx(paper.KINETIC_SHARE, rel=1e-11)


@pytest.mark.parametrize("sign", [1, -1])
def test_crossings_of_the_paper_with_their_signs(sign: int) -> None:
    expected = np.array([time for time, same in paper.CROSSINGS if same == (sign > 0)])
    crossings = np.array(
        MODE.crossings(sign * float(MODE.deformation(paper.TD)), 0.0, paper.TD)
    )
    np.testing.assert_allclose(crossings * 1e3, expected, rtol=1e-11)


def test_peaks_of_the_paper() -> None:
    times, energies = np.array(paper.PEAKS).T
    peaks = np.array(MODE.peaks(0.0, 0.09))
    np.testing.assert_allclose(peaks * 1e3, times, rtol=1e-11)
    np.testing.assert_allclose(MODE.energy(peaks), energies, rtol=1e-11)


def test_the_level_of_a_peak_is_crossed_before_it_but_not_at_it() -> None:
    peak = MODE.peaks(0.0, 0.09)[5]
    crossings = MODE.crossings(float(MODE.deformation(peak)), 0.0, 0.09)
    assert crossings[0] == pytest.approx(paper.BETTER_TR, rel=1e-11)
    assert max(crossings) < peak - 1e-3


def estimate_slope(
    function: Callable[[Samples], Samples], mode: Mode
) -> tuple[Samples, float]:
    """Return the central difference of ``function`` at T, and its accuracy for energies of the mode."""
    rate = mode.omega + mode.alpha
    h = 1e-5 / rate
    return (function(T + h) - function(T - h)) / (2 * h), 1e-6 * rate * float(
        np.max(mode.energy(T)) + 1e-9
    )


@given(MODES)
def test_velocity_is_the_slope_of_the_deformation(mode: Mode) -> None:
    numeric_slope, _ = estimate_slope(mode.deformation, mode)
    np.testing.assert_allclose(
        numeric_slope, mode.velocity(T), atol=1e-7 * np.max(np.abs(mode.velocity(T)))
    )
    np.testing.assert_array_equal(
        mode.energy(T), mode.energy_plastic + mode.deformation(T) ** 2
    )


@given(MODES)
def test_energies_are_elastic_and_kinetic_and_damping_takes_them(mode: Mode) -> None:
    numeric_slope, room = estimate_slope(mode.energy, mode)
    np.testing.assert_allclose(numeric_slope, mode.energy_slopes(T)[0], atol=room)
    elastic, kinetic = (
        np.sum((mode.amplitudes(T) - mode.preload) ** 2, axis=0),
        mode.kinetic_energy(T),
    )
    np.testing.assert_allclose(
        mode.vibration_energy(T), elastic + kinetic, rtol=1e-9, atol=1e-12
    )
    numeric_slope, _ = estimate_slope(mode.vibration_energy, mode)
    scale = (mode.omega + mode.alpha) * np.max(mode.vibration_energy(T))
    np.testing.assert_allclose(
        numeric_slope, -2 * mode.alpha * kinetic, atol=1e-6 * scale
    )


@given(MODES)
def test_the_second_slope_of_an_energy_is_that_of_its_first(mode: Mode) -> None:
    numeric_slope, room = estimate_slope(lambda t: mode.energy_slopes(t)[0], mode)
    np.testing.assert_allclose(
        numeric_slope,
        mode.energy_slopes(T)[1],
        atol=10 * room * (mode.omega + mode.alpha),
    )


@given(MODES)
def test_at_extrema_the_deformation_stands_still_and_between_them_it_does_not(
    mode: Mode,
) -> None:
    extrema = np.array(mode.extrema(-0.5, 2.0))
    assert abs(extrema.size - 2.5 * mode.omega / np.pi) <= 1.0
    scale = np.max(np.abs(mode.velocity(T)))
    np.testing.assert_allclose(
        mode.velocity(extrema), 0.0, atol=1e-12 * scale * mode.omega
    )
    middles = (extrema[1:] + extrema[:-1]) / 2
    assert np.all(mode.velocity(middles[1:]) * mode.velocity(middles[:-1]) < 0)


@given(MODES)
def test_peaks_are_higher_than_their_neighbourhood(mode: Mode) -> None:
    peaks = np.array(mode.peaks(-0.5, 2.0))
    h = 1e-3 / mode.omega
    # a peak next to zero lies between two zeros that may be equally close
    high = peaks[mode.deformation(peaks) ** 2 > 1e-4 * np.max(mode.deformation(T) ** 2)]
    for side in (-h, h):
        assert np.all(mode.energy(high) > mode.energy(high + side))


@given(
    MODES, st.floats(-0.999, 0.999)
)  # rounding decides whether a touched level is crossed
def test_crossings_are_all_sign_changes_on_a_fine_grid(
    mode: Mode, share: float
) -> None:
    level = mode.preload + share * mode.cosine
    fine = np.linspace(-0.5, 2.0, 20001)
    above = mode.deformation(fine) > level
    crossings = mode.crossings(level, -0.5, 2.0)
    np.testing.assert_allclose(
        mode.deformation(np.array(crossings)),
        level,
        atol=1e-13 * (10 + abs(level)) * (1 + mode.omega),
    )
    # every crossing on the grid was found; two crossings inside one grid cell show only as a pair
    assert len(crossings) >= np.count_nonzero(above[1:] != above[:-1])
    assert (len(crossings) - np.count_nonzero(above[1:] != above[:-1])) % 2 == 0


@given(st.lists(MODES, min_size=1, max_size=9), st.integers(1, 70))
def test_deformations_of_all_modes_at_once_are_those_of_each_mode(
    modes: list[Mode], count: int
) -> None:
    moved = [replace(mode, origin=modes[0].origin) for mode in modes]
    times = np.linspace(-1.0, 2.0, count)
    expected = [mode.deformation(times) for mode in moved]
    np.testing.assert_array_equal(compute_deformations(moved, times), expected)


def test_an_extremum_that_touches_the_level_is_no_crossing_and_both_ends_are_outside() -> (
    None
):
    mode = Mode(omega=np.pi, alpha=0.0, cosine=0.0, sine=2.0, origin=0.0)
    assert (mode.crossings(2.0, 0.0, 10.0), mode.crossings(2.1, 0.0, 10.0)) == ((), ())
    assert (mode.crossings(0.0, 0.0, 2.0), mode.extrema(0.5, 2.5)) == ((1.0,), (1.5,))
