"""The closed form of a single-mode energy record."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import approx_fprime

from d2rpick.choice.answers import suggest
from d2rpick.choice.question import Settings
from d2rpick.choice.situation import examine
from d2rpick.histories.history import Samples
from d2rpick.vibration.identify import identify, identify_several
from d2rpick.vibration.measures import kinetic_share, lock_in_error, residual
from d2rpick.vibration.modes import Mode, Modes, sum_and_jacobian
from tests import chain, paper
from tests.command import ROLLOVER
from tests.computed import columns
from tests.records import MODE, noisy, printed, replayed_residual, table

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
SEVERAL = st.builds(
    lambda rates, alpha, sine: Modes(tuple(Mode(rate, alpha, 1.0 + i, sine, 0.0) for i, rate in enumerate(rates))),
    st.lists(st.floats(0.5, 50), min_size=2, max_size=3, unique=True), st.floats(0, 5), st.floats(-2, 2),
)  # fmt: skip
T = np.linspace(-0.5, 2.0, 101)


def test_energies_of_the_paper_at_64_ms() -> None:
    assert float(MODE.energy(paper.TD)) == pytest.approx(paper.ENERGY_TD, rel=1e-11)
    assert float(MODE.kinetic_energy(paper.TD)) == pytest.approx(paper.KINETIC_TD, rel=1e-11)
    share = float(MODE.kinetic_energy(paper.TD) / MODE.vibration_energy(paper.TD))
    assert share == pytest.approx(paper.KINETIC_SHARE, rel=1e-11)


@pytest.mark.parametrize("sign", [1, -1])
def test_crossings_of_the_paper_with_their_signs(sign: int) -> None:
    expected = np.array([time for time, same in paper.CROSSINGS if same == (sign > 0)])
    crossings = np.array(MODE.crossings(sign * float(MODE.deformation(paper.TD)), 0.0, paper.TD))
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


def slope(function: Callable[[Samples], Samples], mode: Mode | Modes) -> tuple[Samples, float]:
    """Its central difference at T, and how exact that is for energies of the mode."""
    rate = mode.fastest + mode.alpha
    h = 1e-5 / rate
    return (function(T + h) - function(T - h)) / (2 * h), 1e-6 * rate * float(np.max(mode.energy(T)) + 1e-9)


@given(MODES)
def test_velocity_is_the_slope_of_the_deformation(mode: Mode) -> None:
    found, _ = slope(mode.deformation, mode)
    np.testing.assert_allclose(found, mode.velocity(T), atol=1e-7 * np.max(np.abs(mode.velocity(T))))
    np.testing.assert_array_equal(mode.energy(T), mode.energy_plastic + mode.deformation(T) ** 2)


@given(MODES | SEVERAL)
def test_energies_are_those_of_their_modes_and_damping_takes_them(mode: Mode | Modes) -> None:
    found, room = slope(mode.energy, mode)
    np.testing.assert_allclose(found, mode.energy_slopes(T)[0], atol=room)
    elastic, kinetic = np.sum((mode.amplitudes(T) - mode.preload) ** 2, axis=0), mode.kinetic_energy(T)
    np.testing.assert_allclose(mode.vibration_energy(T), elastic + kinetic, rtol=1e-9, atol=1e-12)
    found, _ = slope(mode.vibration_energy, mode)
    scale = (mode.fastest + mode.alpha) * np.max(mode.vibration_energy(T))
    np.testing.assert_allclose(found, -2 * mode.alpha * kinetic, atol=1e-6 * scale)


@given(MODES | SEVERAL)
def test_the_second_slope_of_an_energy_is_that_of_its_first(mode: Mode | Modes) -> None:
    found, room = slope(lambda t: mode.energy_slopes(t)[0], mode)
    np.testing.assert_allclose(found, mode.energy_slopes(T)[1], atol=10 * room * (mode.fastest + mode.alpha))


@given(MODES)
def test_at_extrema_the_deformation_stands_still_and_between_them_it_does_not(mode: Mode) -> None:
    extrema = np.array(mode.extrema(-0.5, 2.0))
    assert abs(extrema.size - 2.5 * mode.omega / np.pi) <= 1.0
    scale = np.max(np.abs(mode.velocity(T)))
    np.testing.assert_allclose(mode.velocity(extrema), 0.0, atol=1e-12 * scale * mode.omega)
    middles = (extrema[1:] + extrema[:-1]) / 2
    assert np.all(mode.velocity(middles[1:]) * mode.velocity(middles[:-1]) < 0)


@given(MODES)
def test_peaks_are_higher_than_their_neighbourhood(mode: Mode) -> None:
    peaks = np.array(mode.peaks(-0.5, 2.0))
    h = 1e-3 / mode.omega
    # a peak next to zero lies between two zeros that may be as near
    high = peaks[mode.deformation(peaks) ** 2 > 1e-4 * np.max(mode.deformation(T) ** 2)]
    for side in (-h, h):
        assert np.all(mode.energy(high) > mode.energy(high + side))


@given(MODES, st.floats(-0.999, 0.999))  # a level that is touched is met by rounding or not
def test_crossings_are_all_sign_changes_on_a_fine_grid(mode: Mode, share: float) -> None:
    level = mode.preload + share * mode.cosine
    fine = np.linspace(-0.5, 2.0, 20001)
    above = mode.deformation(fine) > level
    crossings = mode.crossings(level, -0.5, 2.0)
    np.testing.assert_allclose(
        mode.deformation(np.array(crossings)), level, atol=1e-13 * (10 + abs(level)) * (1 + mode.omega)
    )
    # what the grid shows was found; two crossings inside one of its cells only show in pairs
    assert len(crossings) >= np.count_nonzero(above[1:] != above[:-1])
    assert (len(crossings) - np.count_nonzero(above[1:] != above[:-1])) % 2 == 0


def test_an_extremum_that_touches_the_level_is_no_crossing_and_both_ends_are_outside() -> None:
    mode = Mode(omega=np.pi, alpha=0.0, cosine=0.0, sine=2.0, origin=0.0)
    assert (mode.crossings(2.0, 0.0, 10.0), mode.crossings(2.1, 0.0, 10.0)) == ((), ())
    assert (mode.crossings(0.0, 0.0, 2.0), mode.extrema(0.5, 2.5)) == ((1.0,), (1.5,))


TIME = np.linspace(0, 6, 1200)


def random_modes(rng: np.random.Generator, count: int) -> Modes:
    """Modes of one damping, the slowest with period 1, the others up to four times as fast."""
    rates = 2 * np.pi * np.sort(1 + np.append(0.0, rng.uniform(0.2, 3, count - 1)))
    alpha = rng.uniform(0, 0.5)
    return Modes(tuple(Mode(float(w), float(alpha), rng.normal(), rng.normal(), 0.0) for w in rates))


TWO = random_modes(np.random.default_rng(5), 2)


def test_crossings_and_extrema_are_where_the_energy_says() -> None:
    td = 4.321
    crossings, turns = np.array(TWO.level_crossings(td, 0.0)), np.array(TWO.extrema(0.0, td))
    np.testing.assert_allclose(TWO.energy(crossings), TWO.energy(td), rtol=1e-9)
    np.testing.assert_allclose(TWO.energy_slopes(turns)[0], 0, atol=1e-9)
    side = TWO.energy(TIME[td > TIME]) > TWO.energy(td)
    assert crossings.size >= np.count_nonzero(side[1:] != side[:-1])
    assert set(TWO.peaks(0.0, td)) < set(turns)


@pytest.mark.parametrize("seed", range(8))
def test_no_window_hides_an_extremum_whichever_are_looked_for_first(seed: int) -> None:
    """Over some hundred periods, in which they are found part by part; before the origin too."""
    rng = np.random.default_rng(seed)
    modes = random_modes(rng, 2 + seed % 2)
    windows = np.sort(rng.uniform(-40, 150, (5, 2)))
    parts = [modes.extrema(*window) for window in windows.tolist()]
    whole = np.array(modes.extrema(-40.0, 150.0))
    for (start, end), part in zip(windows, parts, strict=True):
        assert part == tuple(whole[(whole > start) & (whole < end)])
    fine = modes.energy_slopes(np.arange(-40.0, 150.0, 1 / 32 / 4 / 8))[0]
    assert 0.98 * np.count_nonzero(np.sign(fine[1:]) != np.sign(fine[:-1])) <= whole.size  # all but shallow ones


def test_the_jacobian_is_that_of_the_energy() -> None:
    parameters = np.array([0.3, 5.0, 1.0, -0.4, 8.0, 0.2, 0.7])
    for at in (0.0, 0.4, 1.0):
        s = np.array([at])
        found = sum_and_jacobian(parameters, s)[1][:, 0]
        expected = approx_fprime(parameters, lambda p, s=s: float(sum_and_jacobian(p, s)[0][0]), 1e-7)
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_the_residual_of_the_sum_is_that_of_its_measures() -> None:
    tr, td = np.array([0.4, 1.3, 2.2]), 4.1
    kinetic = kinetic_share(TWO, td)
    expected = [residual(float(error), kinetic) for error in lock_in_error(TWO, tr, td)]
    np.testing.assert_allclose(replayed_residual(TWO, tr, td), expected, rtol=1e-10)


# ---- identification


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize(("noise", "median", "worst"), [(0.0, 1e-6, 1e-5), (0.01, 3e-3, 0.07)])
def test_the_residual_is_predicted_from_the_total_energy(count: int, noise: float, median: float, worst: float) -> None:
    rng = np.random.default_rng(20261)
    errors: list[float] = []
    tried, tr, td = 0, np.array([1.3]), 4.0
    while tried < 12:
        modes = random_modes(rng, count)
        amplitudes = [float(mode.vibration_energy(0.0)) for mode in modes.modes]
        if min(amplitudes) < 0.05 * max(amplitudes) or modes.apart * TIME[-1] < np.pi:
            continue  # a mode that is hardly there, or beside another, is neither found nor missed
        found = identify_several(TIME, noisy(printed(modes.energy(TIME)), noise, seed=tried))
        tried += 1
        assert found.mode is not None
        if found.describes_record:
            errors.append(abs(float((replayed_residual(found.mode, tr, td) - replayed_residual(modes, tr, td))[0])))
    assert len(errors) >= 11
    assert np.median(errors) <= median
    assert max(errors) <= worst


@pytest.mark.parametrize("count", [5, 12])
def test_more_modes_are_refused(count: int) -> None:
    rng = np.random.default_rng(count)
    for _ in range(2):
        energy = random_modes(rng, count).energy(TIME)
        for found in (identify(TIME, energy), identify_several(TIME, energy)):
            assert not found.describes_record
            assert found.reason


def test_the_rollover_is_refused() -> None:
    time, energy = columns(ROLLOVER, "boxIE_J")
    for start, end in ((0.0, 0.45), (0.0884, 0.37), (0.25, 0.37)):
        inside = (time >= start) & (time <= end)
        assert not identify_several(time[inside], energy[inside]).describes_record


def test_energy_of_one_part_in_which_modes_mix_is_refused() -> None:
    one, other = (mode.deformation(TIME) for mode in TWO.modes)
    assert not identify_several(TIME, (one + other) ** 2).describes_record


@pytest.mark.parametrize(
    ("time", "energy", "reason"),
    [
        (TIME[:20], TWO.energy(TIME[:20]), "20 states"),
        (TIME, np.ones(TIME.size), "constant"),
        (TIME, np.exp(-TIME), ""),
    ],
)
def test_records_without_several_modes_say_so(time: np.ndarray, energy: np.ndarray, reason: str) -> None:
    found = identify_several(time, energy)
    assert not found.describes_record
    assert reason in (found.reason or "")


# ---- the choice


@pytest.mark.slow
def test_several_modes_are_chosen_by_and_replayed() -> None:
    answer = suggest(table(TIME, TWO.energy(TIME)), TWO.peaks(4.0, 5.0)[0], Settings(tolerance=0.5))
    situation = answer.situation
    assert (situation.basis, situation.evidence.fit and situation.evidence.fit.describes_record) == ("oscillator", True)
    assert isinstance(situation.vibration.whole.mode, Modes)
    assert {c.kind for c in answer.candidates} == {"crossing", "extremum", "match"}
    tr = np.array([c.tr for c in answer.candidates])
    expected = replayed_residual(TWO, tr, situation.td)
    assert [c.residual for c in answer.candidates] == pytest.approx(expected.tolist(), abs=1e-6)
    assert all(c.rigid_time > 0 for c in answer.candidates)


@pytest.mark.slow
def test_the_total_energy_of_the_chain_tells_its_two_modes() -> None:
    situation = examine(chain.history("IE_total_J"), chain.TD_PEAK, Settings())
    assert isinstance(situation.vibration.whole.mode, Modes)
    periods = sorted(2 * np.pi / mode.omega for mode in situation.vibration.whole.mode.modes)
    assert periods == pytest.approx([0.0285, 0.0491], abs=1e-4)
    assert situation.vibration.whole.mode.alpha == pytest.approx(5, rel=1e-3)
    assert situation.kinetic_share == pytest.approx(0.00065, abs=1e-4)
    errors = []
    for run in chain.scan():
        there = situation.at(run["td_s"])
        assert there.vibration.whole.mode is not None
        told = replayed_residual(there.vibration.whole.mode, np.array([run["tr_s"]]), there.td)
        errors.append(abs(float(told[0]) - run["R_sim"]))
    assert max(errors) < 0.025
