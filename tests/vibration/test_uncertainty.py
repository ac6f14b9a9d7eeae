"""Intervals of tr must hold the true crossing, and be no wider than they need."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.choice.answers import suggest
from d2rpick.choice.question import Settings
from d2rpick.histories.history import Precision
from d2rpick.histories.samples import find_crossings
from d2rpick.vibration.identify import identify
from d2rpick.vibration.modes import Mode, Modes
from d2rpick.vibration.moments import curvature, fitted_reach, reach, sampled_reach
from d2rpick.vibration.span import residual_bound, resolved
from tests.benchmarks.identification import small_second_modes
from tests.energies import sure
from tests.records import ENERGY, TIME, noisy, printed, replayed_residual, table


def random_mode(rng: np.random.Generator) -> Mode:
    return Mode(2 * np.pi, rng.uniform(0, 0.5), rng.normal(), rng.normal(), 0.0)  # period 1


def covered(samples_per_period: int, digits: int, *, jitter: float, runs: int) -> tuple[float, float]:
    """Share of the crossings that the samples show whose interval holds the true one; median width over step."""
    rng = np.random.default_rng(20261)
    inside, widths = [], []
    for _ in range(runs):
        mode, step = random_mode(rng), 1 / samples_per_period
        time = step * (np.arange(6 * samples_per_period) + jitter * rng.uniform(-0.5, 0.5, 6 * samples_per_period))
        td = float(rng.uniform(4, 5))
        true = [t for level in (1, -1) for t in mode.crossings(level * float(mode.deformation(td)), time[0], td - step)]
        history = replace(
            table(printed(time, digits), printed(mode.energy(time), digits)),
            time_precision=Precision(digits), energy_precision=Precision(digits),
        )  # fmt: skip
        times, rises = find_crossings(history.time, history.energy, history.energy_at(td))
        times = times[times < td - step]
        if not times.size:
            continue
        rising = np.array([float(mode.deformation(t) * mode.velocity(t)) > 0 for t in true])
        half = sampled_reach(history, times, td, history.energy_at(td))
        for one, rises_there, width in zip(times, rises, half, strict=False):
            distance = np.abs(np.array(true)[rising == rises_there] - one).min()
            if distance < 0.25 / 2:  # a true crossing that the samples show
                inside.append(distance <= width)
        widths += (2 * half / step).tolist()
    return float(np.mean(inside)), float(np.median(widths))


# of tr_high - tr_low over the output interval, by samples per vibration period; with 8 they may be as wide as they need
WIDEST = {8: np.inf, 12: 1.2, 20: 0.66, 50: 0.204, 200: 0.042}


@pytest.mark.slow
@pytest.mark.parametrize(("digits", "jitter"), [(5, 0.0), (6, 0.4)])
@pytest.mark.parametrize("samples_per_period", WIDEST)
def test_intervals_from_samples_hold_the_true_crossing(samples_per_period: int, digits: int, jitter: float) -> None:
    share, width = covered(samples_per_period, digits, jitter=jitter, runs=40)
    assert share >= 0.99
    assert width <= WIDEST[samples_per_period]


def test_intervals_of_a_fit_hold_the_true_crossing() -> None:
    rng = np.random.default_rng(7)
    inside = []
    for _ in range(60):
        mode = random_mode(rng)
        time = np.arange(0, 6, 1 / 40)
        noise = 0.01 * float(np.max(mode.energy(time))) * rng.normal(size=time.size)
        history = table(time, mode.energy(time) + noise)
        fit = identify(history.time, history.energy)
        if not fit.describes_record or not isinstance(fit.mode, Mode):
            continue
        td = 3.3
        for sign in (1, -1):
            true = mode.crossings(sign * float(mode.deformation(td)), 0.5, 3.0)
            times = np.array(fit.mode.crossings(sign * float(fit.mode.deformation(td)), 0.45, 3.05))
            if times.size:
                half = fitted_reach(history, fit, fit.mode, times, td)
                inside += [bool(np.any(np.abs(times - t) <= half)) for t in true]
    assert len(inside) > 200
    assert np.mean(inside) >= 0.99


@pytest.mark.parametrize(("samples_per_period", "runs"), [(40, 10), (200, 5)])
def test_intervals_hold_the_true_crossing_where_a_fit_misses_a_small_mode(samples_per_period: int, runs: int) -> None:
    rng = np.random.default_rng(11)
    inside = []
    for _ in range(runs):
        main = random_mode(rng)
        other = Mode(2 * np.pi * rng.uniform(1.6, 2.7), main.alpha, 0.04 * rng.normal(), 0.04 * rng.normal(), 0.0)
        both = Modes((main, other))
        time = np.arange(0, 6, 1 / samples_per_period)
        history = table(time, both.energy(time))
        found = suggest(history, 4.3, Settings(after=0.0))
        true = np.array(both.level_crossings(4.3, 0.0))
        sharp = [c for c in found.candidates if c.kind == "crossing" and (c.timing_tolerance or 0) < 0.02]
        for one in sharp:
            low, high = sure(one.tr_low), sure(one.tr_high)
            if np.abs(true - one.tr).min() < 0.25 / 2:  # the level is passed, not only nearly touched
                inside.append(bool(np.any((low <= true) & (true <= high))))
    assert len(inside) > 5 * runs
    assert np.mean(inside) >= 0.99


def test_an_interval_from_samples_grows_by_what_the_level_is_off_them() -> None:
    time = np.linspace(0, 1, 101)
    history = table(time, 3 * time)
    (exact,), (off,) = (sampled_reach(history, np.array([0.3]), 0.755, 2.265 + error) for error in (0.0, 0.009))
    assert off - exact == pytest.approx(0.009 / 3)


# zero, or of a size whose squares still are numbers
sizes = st.one_of(st.just(0.0), st.floats(1e-100, 1e3))


@given(sizes, sizes, sizes)
def test_reach_uses_up_the_error(slope: float, bend: float, error: float) -> None:
    x = float(reach(slope, bend, error))
    assert x >= 0
    if np.isfinite(x):
        assert slope * x + bend * x**2 / 2 >= error * (1 - 1e-9)


def test_curvature_of_a_parabola_is_exact_on_uneven_times() -> None:
    time = np.array([0.0, 0.1, 0.35, 0.4, 0.8, 1.0])
    np.testing.assert_allclose(curvature(time, 3 * time**2, np.array([0.0, 0.5, 1.0])), 6.0, rtol=1e-12)


MAIN = Mode(2 * np.pi, 0.2, 0.3, 0.9, 0.0)
TIMES = np.arange(0, 7, 1 / 40)


def beside(share: float, rate: float = 2.3) -> Modes:
    """The main mode and one with that share of its energy."""
    root = float(np.sqrt(share * MAIN.vibration_energy(0.0)))
    return Modes((MAIN, Mode(rate * 2 * np.pi, 0.2, root * np.cos(1.0), root * np.sin(1.0) * 0.97, 0.0)))


@pytest.mark.parametrize("rate", [0.6, 1.8, 3.1])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("share", [0.003, 0.01])
def test_a_small_second_mode_is_told_from_one(share: float, noise: float, rate: float) -> None:
    truth = beside(share, rate)
    energy = noisy(truth.energy(TIMES), noise, seed=1)
    one = identify(TIMES, energy)
    assert one.describes_record
    assert isinstance(one.mode, Mode)  # its rest is too small to refuse it
    two = resolved(TIMES, energy, one)
    tr, td = np.array([0.3, 1.1, 2.6]), 5.3
    assert two.mode is not None
    assert replayed_residual(two.mode, tr, td) == pytest.approx(replayed_residual(truth, tr, td), abs=0.02 + 2 * noise)
    # with 6 samples per period of its energy the second mode may be the alias of another
    assert (two.hidden_share < share / 2) == (rate < 2)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("noise", [1e-4, 0.03])
def test_white_noise_is_no_second_mode(noise: float, seed: int) -> None:
    energy = noisy(MAIN.energy(TIMES), noise, seed)
    one = identify(TIMES, energy)
    found = resolved(TIMES, energy, one)
    assert found.mode is one.mode
    assert 0 < found.hidden_share < 3 * noise


def test_a_clean_or_printed_record_hides_nothing() -> None:
    for energy, most in ((ENERGY, 1e-12), (printed(ENERGY), 1e-5)):
        assert resolved(TIME, energy, identify(TIME, energy)).hidden_share < most


def test_the_bound_holds_for_a_mode_that_drowns_in_noise() -> None:
    tr, td = np.array([0.3, 1.1, 2.6]), 5.3
    for seed in range(0, 20, 3):
        truth = beside(0.005, rate=1.5 + seed / 10)
        energy = noisy(truth.energy(TIMES), 0.03, seed)
        found = resolved(TIMES, energy, identify(TIMES, energy))
        assert found.mode is not None
        true, told = replayed_residual(truth, tr, td), replayed_residual(found.mode, tr, td)
        assert np.all(residual_bound(found, told, tr, td) > true - 0.05)


def test_candidates_state_how_large_their_residual_may_be() -> None:
    energy = noisy(MAIN.energy(TIMES), 0.03, seed=3)
    found = suggest(table(TIMES, energy), 5.3, Settings(after=0.0))
    assert found.candidates
    for one in found.candidates:
        assert sure(one.residual_high) >= sure(one.residual)
        noted = any("if the record hides a further mode" in note for note in one.notes)
        assert noted == (sure(one.residual_high) > sure(one.residual) + 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["one", "small", "large"])
def test_of_random_records_95_percent_are_within_their_bounds(kind: str) -> None:
    found = small_second_modes(kind, range(3))
    assert len(found) >= 2
    off = [max(one.stated - one.true, one.true - one.highest, 0.0) for one in found]
    assert np.percentile(off, 95) <= 0.05
