"""Candidate times for tr: minima of the frozen-deformation error, and intervals that contain the true time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.choice.answers import suggest_in_history
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
from tests.energies import require
from tests.records import (
    find_level_crossings,
    make_table,
    round_as_printed,
    sum_energies,
)

MODE = Mode(omega=2 * np.pi, alpha=0.2, cosine=0.0, sine=1.0, origin=0.0)
TD = 5.1
PROFILE = Profile.of(MODE, np.arange(0, 6, 1 / 64), TD)

# width tr_high - tr_low over the output interval, by samples per vibration period; at 8 it is unlimited
WIDEST = {8: np.inf, 12: 1.2, 20: 0.66, 50: 0.204, 200: 0.042}


def test_it_ends_before_td() -> None:
    assert PROFILE.time[-1] < TD
    np.testing.assert_allclose(
        PROFILE.error, measures.lock_in_error(MODE, PROFILE.time, TD)
    )


def test_minima_are_where_the_deformation_is_that_at_td() -> None:
    crossings = np.array(MODE.crossings(float(MODE.deformation(TD)), 0.0, TD - 0.1))
    minima = np.array(PROFILE.minima())
    assert max(np.abs(minima - t).min() for t in crossings) < 2e-3


def test_three_times_are_needed_for_a_minimum() -> None:
    assert Profile(np.array([0.0, 1.0]), np.array([1.0, 0.0])).minima() == ()


def find_tolerance(profile: Profile, tr: float, error: float) -> float:
    return float(profile.tolerances(np.array([tr]), np.array([error]))[0])


@pytest.mark.parametrize("tr", [0.3, 1.11, 2.75, 4.0])
def test_the_tolerance_is_that_of_the_closed_form(tr: float) -> None:
    error = float(measures.lock_in_error(MODE, tr, TD))
    expected = float(
        measures.timing_tolerance(
            MODE,
            np.array([tr]),
            TD,
            measures.lock_in_error(MODE, np.array([tr]), TD),
        )[0]
    )
    assert find_tolerance(PROFILE, tr, error) == pytest.approx(expected, abs=1e-3)


def test_the_tolerance_is_all_of_the_time_where_the_error_never_grows() -> None:
    flat = Profile(np.linspace(0, 2, 5), np.full(5, 0.1))
    assert find_tolerance(flat, 1.0, 0.1) == 2.0


def test_an_error_that_grows_at_once_is_interpolated_from_tr_on() -> None:
    steep = Profile(np.linspace(0, 4, 5), np.array([1.0, 1.0, 0.0, 1.0, 1.0]))
    assert find_tolerance(steep, 2.0, 0.0) == pytest.approx(0.05)
    # At both neighbours of this tr the error is 1, so it grows by 0.05 in 1/16 of the way to them.
    assert find_tolerance(steep, 0.5, 0.2) == pytest.approx(0.5 / 16)


@given(st.floats(0.2, 0.8), st.floats(0.01, 0.3), st.floats(2, 50))
def test_the_tolerance_of_a_tr_between_two_times_follows_from_the_error_at_it(
    between: float, least: float, steepness: float
) -> None:
    """The error of deformations that pass each other closely is a hyperbola in time, with its vertex at this tr."""
    time = np.arange(-5.0, 6.0) - between
    profile = Profile(time, np.hypot(least, steepness * time))
    tolerance = find_tolerance(profile, 0.0, least)
    exact = np.sqrt((least + measures.TOLERATED_GROWTH) ** 2 - least**2) / steepness
    # A hyperbola is convex, so the straight line from its vertex to the next time lies above it.
    assert tolerance <= exact * (1 + 1e-9)
    neighbours = np.array([between, 1 - between])
    slopes = (np.hypot(least, steepness * neighbours) - least) / neighbours
    assert tolerance == pytest.approx(measures.TOLERATED_GROWTH / slopes.max())


def test_a_td_at_which_a_mode_sets_in_has_nothing_before_it_to_compare() -> None:
    mode = Mode(8.0, 0.05, 1.0, 0.4, 0.0)
    time = np.linspace(0.0, 6.0, 1201)
    history = make_table(time, np.asarray(mode.energy(time)))
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
    other_moments = (
        Moments.of("extremum", [2.0]),
        Moments.of("match", ()),
        Moments.of("given", np.array([0.5])),
    )
    moments = Moments.of_level(
        np.array([1.0, 3.0]), np.array([True, False]), *other_moments
    )
    each_moment = [moments[i] for i in range(len(moments))]
    assert each_moment == [
        (1.0, "crossing", True),
        (3.0, "crossing", False),
        (2.0, "extremum", None),
        (0.5, "given", None),
    ]
    assert moments.are("extremum").tolist() == [False, False, True, False]
    assert moments.at(np.array([3, 0]))[1] == moments.at(slice(1))[0] == each_moment[0]
    assert moments.at(moments.are("given"))[0] == each_moment[3]


def draw_mode(rng: np.random.Generator) -> Mode:
    return Mode(
        2 * np.pi, rng.uniform(0, 0.5), rng.normal(), rng.normal(), 0.0
    )  # period 1


def measure_coverage(
    samples_per_period: int, digits: int, *, jitter: float, runs: int
) -> tuple[float, float]:
    """Return the fraction of visible crossings whose interval contains the true one, and the median width per step."""
    rng = np.random.default_rng(20261)
    inside, widths = [], []
    for _ in range(runs):
        mode, step = draw_mode(rng), 1 / samples_per_period
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
            make_table(round_as_printed(time, digits), round_as_printed(mode.energy(time), digits)),
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
        for crossing, rises_there, width in zip(times, rises, half, strict=False):
            distance = np.abs(np.array(true)[rising == rises_there] - crossing).min()
            if distance < 0.25 / 2:  # a true crossing that the samples show
                inside.append(distance <= width)
        widths += (2 * half / step).tolist()
    return float(np.mean(inside)), float(np.median(widths))


@pytest.mark.slow
@pytest.mark.parametrize(("digits", "jitter"), [(5, 0.0), (6, 0.4)])
@pytest.mark.parametrize("samples_per_period", WIDEST)
def test_intervals_from_samples_hold_the_true_crossing(
    samples_per_period: int, digits: int, jitter: float
) -> None:
    share, width = measure_coverage(samples_per_period, digits, jitter=jitter, runs=40)
    assert share >= 0.99
    assert width <= WIDEST[samples_per_period]


def test_intervals_of_a_fit_hold_the_true_crossing() -> None:
    rng = np.random.default_rng(7)
    inside = []
    for _ in range(60):
        mode = draw_mode(rng)
        time = np.arange(0, 6, 1 / 40)
        noise = 0.01 * float(np.max(mode.energy(time))) * rng.normal(size=time.size)
        history = make_table(time, mode.energy(time) + noise)
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
        main = draw_mode(rng)
        second_mode = Mode(
            2 * np.pi * rng.uniform(1.6, 2.7),
            main.alpha,
            0.04 * rng.normal(),
            0.04 * rng.normal(),
            0.0,
        )
        both_modes = (main, second_mode)
        time = np.arange(0, 6, 1 / samples_per_period)
        history = make_table(time, sum_energies(both_modes, time))
        suggestion = suggest_in_history(history, 4.3, Settings(after=0.0))
        true = find_level_crossings(both_modes, 4.3, 0.0)
        sharp = [
            c
            for c in suggestion.candidates
            if c.kind == "crossing" and (c.timing_tolerance or 0) < 0.02
        ]
        for crossing in sharp:
            low, high = require(crossing.tr_low), require(crossing.tr_high)
            if (
                np.abs(true - crossing.tr).min() < 0.25 / 2
            ):  # the level is passed, not only touched
                inside.append(bool(np.any((low <= true) & (true <= high))))
    assert len(inside) > 5 * runs
    assert np.mean(inside) >= 0.99


def test_an_interval_from_samples_grows_by_what_the_level_is_off_them() -> None:
    time = np.linspace(0, 1, 101)
    history = make_table(time, 3 * time)
    (exact,), (shifted_reach,) = (
        compute_sampled_reach(history, np.array([0.3]), 0.755, 2.265 + error)
        for error in (0.0, 0.009)
    )
    assert shifted_reach - exact == pytest.approx(0.009 / 3)


# zero, or of a size whose squares are still numbers
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
