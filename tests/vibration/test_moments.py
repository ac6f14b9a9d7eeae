"""Times that may serve as tr: minima of the lock-in error, and intervals that hold the true time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.choice.answers import suggest
from d2rpick.choice.question import Settings
from d2rpick.histories.history import Precision
from d2rpick.histories.samples import find_crossings
from d2rpick.vibration import measures
from d2rpick.vibration.identify import identify
from d2rpick.vibration.measures import Profile
from d2rpick.vibration.model import Evidence, find_energy_at
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.moments import (
    Moments,
    compute_fitted_reach,
    compute_reach,
    compute_sampled_reach,
    estimate_curvature,
)
from d2rpick.vibration.span import Span
from tests.energies import sure
from tests.records import energy_of, level_crossings, printed, table

MODE = Mode(omega=2 * np.pi, alpha=0.2, cosine=0.0, sine=1.0, origin=0.0)
TD = 5.1
PROFILE = Profile.of(MODE, np.arange(0, 6, 1 / 64), TD)


def test_it_ends_before_td() -> None:
    assert PROFILE.time[-1] < TD
    np.testing.assert_allclose(
        PROFILE.error, measures.lock_in_error(MODE, PROFILE.time, TD)
    )


def test_minima_are_where_the_deformation_is_that_at_td() -> None:
    crossings = np.array(MODE.crossings(float(MODE.deformation(TD)), 0.0, TD - 0.1))
    found = np.array(PROFILE.minima())
    assert max(np.abs(found - t).min() for t in crossings) < 2e-3


def test_three_times_are_needed_for_a_minimum() -> None:
    assert Profile(np.array([0.0, 1.0]), np.array([1.0, 0.0])).minima() == ()


def tolerance(profile: Profile, tr: float, error: float) -> float:
    return float(profile.tolerances(np.array([tr]), np.array([error]))[0])


@pytest.mark.parametrize("tr", [0.3, 1.11, 2.75, 4.0])
def test_the_tolerance_is_that_of_the_closed_form(tr: float) -> None:
    error = float(measures.lock_in_error(MODE, tr, TD))
    expected = float(measures.timing_tolerance(MODE, np.array([tr]), TD)[0])
    assert tolerance(PROFILE, tr, error) == pytest.approx(expected, abs=1e-3)


def test_the_tolerance_is_all_of_the_time_where_the_error_never_grows() -> None:
    flat = Profile(np.linspace(0, 2, 5), np.full(5, 0.1))
    assert tolerance(flat, 1.0, 0.1) == 2.0


def test_an_error_that_grows_at_once_leaves_the_way_to_the_next_time() -> None:
    steep = Profile(np.linspace(0, 4, 5), np.array([1.0, 1.0, 0.0, 1.0, 1.0]))
    assert tolerance(steep, 2.0, 0.0) == pytest.approx(0.05)
    assert tolerance(steep, 0.5, 0.2) == pytest.approx(0.5)


def test_a_td_at_which_a_mode_sets_in_has_nothing_before_it_to_compare() -> None:
    mode = Mode(8.0, 0.05, 1.0, 0.4, 0.0)
    time = np.linspace(0.0, 6.0, 1201)
    history = table(time, np.asarray(mode.energy(time)))
    vibration = find_energy_at(
        history, 2.0, Evidence(identify(time, history.energy), Span(2.0, 6.0))
    )
    crossings = vibration.moments(0.2)
    assert vibration.basis == "oscillator"
    assert crossings.are("crossing").all()
    assert (crossings.tr < 2.0).all()
    assert np.isfinite(vibration.reach(crossings)).all()
    assert not measures.compared(vibration.measured(crossings.tr)).any()


def test_crossings_of_a_level_come_before_the_other_moments() -> None:
    others = (
        Moments.of("extremum", [2.0]),
        Moments.of("match", ()),
        Moments.of("given", np.array([0.5])),
    )
    found = Moments.of_level(np.array([1.0, 3.0]), np.array([True, False]), *others)
    each = [found[i] for i in range(len(found))]
    assert each == [
        (1.0, "crossing", True),
        (3.0, "crossing", False),
        (2.0, "extremum", None),
        (0.5, "given", None),
    ]
    assert found.are("extremum").tolist() == [False, False, True, False]
    assert found.at(np.array([3, 0]))[1] == found.at(slice(1))[0] == each[0]
    assert found.at(found.are("given"))[0] == each[3]


def random_mode(rng: np.random.Generator) -> Mode:
    return Mode(
        2 * np.pi, rng.uniform(0, 0.5), rng.normal(), rng.normal(), 0.0
    )  # period 1


def covered(
    samples_per_period: int, digits: int, *, jitter: float, runs: int
) -> tuple[float, float]:
    """Share of the crossings that the samples show whose interval holds the true one; median width over step."""
    rng = np.random.default_rng(20261)
    inside, widths = [], []
    for _ in range(runs):
        mode, step = random_mode(rng), 1 / samples_per_period
        time = step * (
            np.arange(6 * samples_per_period)
            + jitter * rng.uniform(-0.5, 0.5, 6 * samples_per_period)
        )
        td = float(rng.uniform(4, 5))
        true = [
            t
            for level in (1, -1)
            for t in mode.crossings(
                level * float(mode.deformation(td)), time[0], td - step
            )
        ]
        history = replace(
            table(printed(time, digits), printed(mode.energy(time), digits)),
            time_precision=Precision(digits), energy_precision=Precision(digits),
        )  # fmt: skip
        times, rises = find_crossings(
            history.time, history.energy, history.energy_at(td)
        )
        times = times[times < td - step]
        if not times.size:
            continue
        rising = np.array(
            [float(mode.deformation(t) * mode.velocity(t)) > 0 for t in true]
        )
        half = compute_sampled_reach(history, times, td, history.energy_at(td))
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
def test_intervals_from_samples_hold_the_true_crossing(
    samples_per_period: int, digits: int, jitter: float
) -> None:
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
            times = np.array(
                fit.mode.crossings(sign * float(fit.mode.deformation(td)), 0.45, 3.05)
            )
            if times.size:
                half = compute_fitted_reach(history, fit, fit.mode, times, td)
                inside += [bool(np.any(np.abs(times - t) <= half)) for t in true]
    assert len(inside) > 200
    assert np.mean(inside) >= 0.99


@pytest.mark.parametrize(("samples_per_period", "runs"), [(40, 10), (200, 5)])
def test_intervals_hold_the_true_crossing_where_a_fit_misses_a_small_mode(
    samples_per_period: int, runs: int
) -> None:
    rng = np.random.default_rng(11)
    inside = []
    for _ in range(runs):
        main = random_mode(rng)
        other = Mode(
            2 * np.pi * rng.uniform(1.6, 2.7),
            main.alpha,
            0.04 * rng.normal(),
            0.04 * rng.normal(),
            0.0,
        )
        both = (main, other)
        time = np.arange(0, 6, 1 / samples_per_period)
        history = table(time, energy_of(both, time))
        found = suggest(history, 4.3, Settings(after=0.0))
        true = level_crossings(both, 4.3, 0.0)
        sharp = [
            c
            for c in found.candidates
            if c.kind == "crossing" and (c.timing_tolerance or 0) < 0.02
        ]
        for one in sharp:
            low, high = sure(one.tr_low), sure(one.tr_high)
            if (
                np.abs(true - one.tr).min() < 0.25 / 2
            ):  # the level is passed, not only nearly touched
                inside.append(bool(np.any((low <= true) & (true <= high))))
    assert len(inside) > 5 * runs
    assert np.mean(inside) >= 0.99


def test_an_interval_from_samples_grows_by_what_the_level_is_off_them() -> None:
    time = np.linspace(0, 1, 101)
    history = table(time, 3 * time)
    (exact,), (off,) = (
        compute_sampled_reach(history, np.array([0.3]), 0.755, 2.265 + error)
        for error in (0.0, 0.009)
    )
    assert off - exact == pytest.approx(0.009 / 3)


# zero, or of a size whose squares still are numbers
sizes = st.one_of(st.just(0.0), st.floats(1e-100, 1e3))


@given(sizes, sizes, sizes)
def test_reach_uses_up_the_error(slope: float, bend: float, error: float) -> None:
    x = float(compute_reach(slope, bend, error))
    assert x >= 0
    if np.isfinite(x):
        assert slope * x + bend * x**2 / 2 >= error * (1 - 1e-9)


def test_curvature_of_a_parabola_is_exact_on_uneven_times() -> None:
    time = np.array([0.0, 0.1, 0.35, 0.4, 0.8, 1.0])
    np.testing.assert_allclose(
        estimate_curvature(time, 3 * time**2, np.array([0.0, 0.5, 1.0])),
        6.0,
        rtol=1e-12,
    )
