"""The oscillator identified from an energy history: bounds on its parameters, and reasons to refuse it."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.optimize import least_squares

from d2rpick.histories.history import Samples
from d2rpick.vibration.fitting import compute_covariance
from d2rpick.vibration.identify import Identification, identify
from d2rpick.vibration.modes import Mode
from tests.command import ROLLOVER
from tests.computed import locate_stored, read_columns
from tests.records import ENERGY, MODE, TIME, add_noise, make_mode, round_as_printed

RAMP = np.linspace(0.0, 1.0, 201)


def identify_accepted(time: Samples, energy: Samples) -> tuple[Identification, Mode]:
    fitted = identify(time, energy)
    assert fitted.describes_record, fitted.reason
    assert fitted.reason is None
    assert isinstance(fitted.mode, Mode)
    return fitted, fitted.mode


def identify_refused(time: Samples, energy: Samples) -> str:
    fitted = identify(time, energy)
    assert not fitted.describes_record
    assert fitted.reason is not None
    return fitted.reason


def list_parameters(mode: Mode) -> Samples:
    return np.array(
        [
            mode.omega,
            mode.alpha,
            mode.cosine,
            mode.sine,
            mode.energy_plastic,
            mode.preload,
        ]
    )


def draw_record(seed: int, second: float = 0.0) -> tuple[Samples, Samples, Mode]:
    """Return a valid record of 2 to 20 periods; ``second`` adds a mode with that share of the first one's energy."""
    rng = np.random.default_rng(seed)
    periods, density = (
        np.exp(rng.uniform(np.log(2), np.log(20))),
        np.exp(rng.uniform(np.log(12), np.log(60))),
    )
    omega = np.exp(rng.uniform(-3, 8))
    span, size = periods * 2 * np.pi / omega, int(2 * periods * density) + 1
    alpha = min(rng.choice([0.0, rng.uniform(0, 0.3)]) * omega, 12 / span)
    start, swing, phase = (
        rng.uniform(0, 2) * span,
        np.exp(rng.uniform(-5, 5)),
        rng.uniform(0, 2 * np.pi),
    )
    plastic = rng.choice([0.0, rng.uniform(0.05, 0.5)]) * swing**2 * (second == 0)
    preload = rng.choice([0.0, rng.uniform(0.05, 0.5)]) * swing * (second == 0)
    time = start + np.linspace(0, span, size)
    time[1:-1] += (
        rng.choice([0.0, 0.2]) * rng.uniform(-1, 1, size - 2) * span / (size - 1)
    )
    mode = Mode(
        omega,
        alpha,
        swing * np.cos(phase),
        swing * np.sin(phase),
        start,
        plastic,
        preload,
    )
    energy = mode.energy(time)
    if second:
        second_omega, turn = (
            omega * np.exp(rng.uniform(np.log(0.25), np.log(4))),
            rng.uniform(0, 2 * np.pi),
        )
        root = swing * second**0.5
        energy = energy + Mode(
            second_omega, alpha, root * np.cos(turn), root * np.sin(turn), start
        ).energy(time)
    return time, add_noise(energy, rng.choice([0.0, rng.uniform(0, 0.02)]), seed), mode


def test_a_clean_record_gives_all_parameters() -> None:
    fitted, mode = identify_accepted(TIME, ENERGY)
    np.testing.assert_allclose(
        np.abs(list_parameters(mode)),
        np.abs(list_parameters(MODE)),
        rtol=1e-10,
        atol=1e-10,
    )
    assert (fitted.start, fitted.end) == (0.0, 0.15)
    assert fitted.misfit == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("record", "bound"),
    [
        # a different factor for each seed, so that different digits are lost
        (lambda seed: ENERGY * (1 + seed / 100), 1e-10),
        (lambda seed: round_as_printed(ENERGY * (1 + seed / 100)), 1e-7),
        (lambda seed: add_noise(ENERGY, 0.01, seed), 1e-3),
    ],
    ids=["clean", "6 digits", "1 % noise"],
)
def test_95_percent_of_the_seeds_find_omega_within_the_bound(
    record: Callable[[int], Samples], bound: float
) -> None:
    errors = [
        abs(identify_accepted(TIME, record(seed))[1].omega / MODE.omega - 1)
        for seed in range(40)
    ]
    assert np.percentile(errors, 95) < bound


@pytest.mark.parametrize("seed", range(5))
def test_least_squares_of_scipy_from_the_truth_ends_at_the_same_mode(seed: int) -> None:
    energy = add_noise(ENERGY, 0.01, seed)
    fitted, mode = identify_accepted(TIME, energy)
    truth = list_parameters(MODE)[:4]
    best = least_squares(
        lambda p: make_mode(p).energy(TIME) - energy, truth, x_scale=[1, 1, 0.1, 0.1]
    )
    sign = np.sign(mode.sine * best.x[3])  # q and -q give the same energy
    ours = list_parameters(mode)[:4] * [1, 1, sign, sign]
    np.testing.assert_allclose(
        ours, best.x, atol=1e-3 * np.sqrt(np.diag(fitted.covariance)).max(), rtol=1e-5
    )
    assert fitted.rms**2 * TIME.size <= 2 * best.cost * (1 + 1e-9)


def test_random_valid_records_are_accepted_with_the_right_parameters() -> None:
    for seed in range(40):
        time, energy, truth = draw_record(seed)
        fitted, mode = identify_accepted(time, energy)
        # six standard deviations of the fit, or the shift due to a plastic work or preload too small to be noticed
        margin = 6 * fitted.covariance[0, 0] ** 0.5 + 1e-3 * truth.omega
        assert abs(mode.omega - truth.omega) < margin, seed


@pytest.mark.slow
def test_two_modes_are_taken_for_one_in_at_most_5_percent() -> None:
    records = (draw_record(seed, second=0.2)[:2] for seed in range(40))
    assert sum(identify(*record).describes_record for record in records) <= 2


@given(
    st.floats(-1e3, 1e3),
    st.floats(-6, 6).map(lambda power: 10**power),
    st.floats(-6, 6).map(lambda power: 10**power),
)
def test_shifting_and_scaling_the_record_shifts_and_scales_the_mode(
    shift: float, slower: float, larger: float
) -> None:
    time = (TIME[:600] + shift / 1e3) * slower
    fitted, mode = identify_accepted(time, larger * ENERGY[:600])
    assert mode.omega * slower == pytest.approx(MODE.omega, rel=1e-8)
    assert mode.alpha * slower == pytest.approx(MODE.alpha, rel=1e-6)
    np.testing.assert_allclose(mode.energy(time) / larger, ENERGY[:600], atol=1e-6)
    assert fitted.rms < 1e-6 * larger


@pytest.mark.parametrize("periods", [1.3, 2.0, 2.5, 3.0])
def test_the_last_periods_of_a_printed_record_are_enough(periods: float) -> None:
    start = TIME[-1] - periods * 2 * np.pi / MODE.omega
    tail = start <= TIME
    _, mode = identify_accepted(TIME[tail], round_as_printed(ENERGY)[tail])
    assert mode.omega == pytest.approx(MODE.omega, rel=2e-7)


def test_jittered_times_are_used_as_they_are() -> None:
    jitter = 0.05 * 1e-4 * np.random.default_rng(0).standard_normal(TIME.size)
    _, mode = identify_accepted(
        TIME + jitter, round_as_printed(MODE.energy(TIME + jitter))
    )
    assert mode.omega == pytest.approx(MODE.omega, rel=1e-7)


def test_plastic_work_and_preload_are_told_from_each_other() -> None:
    time = np.linspace(0.0, 2.0, 801)
    truth = Mode(
        omega=20.0,
        alpha=1.5,
        cosine=0.4,
        sine=2.0,
        origin=0.0,
        energy_plastic=0.7,
        preload=0.6,
    )
    _, mode = identify_accepted(time, truth.energy(time))
    np.testing.assert_allclose(list_parameters(mode), list_parameters(truth), rtol=1e-8)


@pytest.mark.parametrize("offset", [0.0, -0.01])
def test_energies_of_zero_and_below_are_no_obstacle(offset: float) -> None:
    time = np.linspace(0.0, 2.0, 401)
    energy = np.sin(10 * time) ** 2 + offset
    assert np.min(energy) <= 0.0
    assert identify_accepted(time, energy)[1].omega == pytest.approx(10.0, rel=1e-3)


def test_energy_deviation_is_the_scatter_over_many_noises() -> None:
    times = np.array([0.005, 0.0127, 0.03, 0.064])
    fits = [
        identify_accepted(TIME, add_noise(ENERGY, 0.01, seed)) for seed in range(60)
    ]
    scatter = np.std([mode.energy(times) for _, mode in fits], axis=0)
    np.testing.assert_allclose(fits[0][0].energy_deviation(times), scatter, rtol=0.35)


def test_without_a_mode_there_is_no_deviation() -> None:
    fitted = identify(TIME, np.zeros(TIME.size))
    assert fitted.mode is None
    assert fitted.misfit is None
    assert np.all(np.isnan(fitted.energy_deviation(TIME)))


@pytest.mark.parametrize(
    ("energy", "reason"),
    [
        (RAMP[:23], "only 23 states to fit, at least 24"),
        (np.full(201, 3.3), "constant, 3.3"),
        (np.zeros(201), "constant, 0"),
        (np.where(np.arange(201) % 2, 1.0, -1.0), "does not oscillate"),
        (RAMP, "vibration periods, fewer than"),
        (
            (RAMP * np.exp(-5 * RAMP)) ** 2,
            "vibration periods, fewer than",
        ),  # critically damped
        (
            (np.exp(-3 * RAMP) - np.exp(-9 * RAMP)) ** 2,
            "deviates systematically",
        ),  # overdamped
        (np.sin(20 * RAMP) ** 2 + np.sin(31 * RAMP) ** 2, "more than 40%"),
        (
            np.sin(20 * RAMP) ** 2 + 0.2 * np.sin(31 * RAMP) ** 2,
            "deviates systematically",
        ),
        (np.exp(2 * RAMP) * np.sin(20 * RAMP) ** 2, "grows"),
        (np.sin(20 * RAMP) ** 2 - 805, "plastic energy would be -8.1e+02"),
        (np.random.default_rng(0).standard_normal(201), "more than 40%"),
    ],
)
def test_what_no_oscillator_describes_is_refused_with_the_reason(
    energy: Samples, reason: str
) -> None:
    assert reason in identify_refused(np.linspace(0.0, 1.0, energy.size), energy)


@pytest.mark.parametrize("samples_per_period", [2.5, 4.0, 6.0, 9.5])
def test_too_few_samples_per_period_are_refused_and_the_interval_asked_for_is_accepted(
    samples_per_period: float,
) -> None:
    mode = Mode(omega=7.0, alpha=0.1, cosine=0.3, sine=1.0, origin=0.0)
    coarse = np.linspace(0.0, 59 * np.pi / mode.omega / samples_per_period, 60)
    reason = identify_refused(coarse, mode.energy(coarse))
    assert f"{samples_per_period:.2f} samples per period" in reason
    interval = float(reason.split(" or less")[0].split()[-1])
    fine = np.linspace(0.0, coarse[-1], int(coarse[-1] / interval) + 1)
    assert identify_accepted(fine, mode.energy(fine))[1].omega == pytest.approx(
        7.0, rel=1e-10
    )


def test_a_gap_that_could_hide_periods_counts_as_coarse_sampling() -> None:
    mode = Mode(omega=20.0, alpha=0.1, cosine=0.3, sine=1.0, origin=0.0)
    time = np.concatenate((np.linspace(0.0, 1.0, 200), np.linspace(2.0, 3.0, 200)))
    assert "samples per period" in identify_refused(time, mode.energy(time))


@pytest.mark.parametrize("scale", [1e-310, 1e-200, 1e150])
def test_no_unit_system_is_too_small_or_too_large(scale: float) -> None:
    time = np.linspace(0.0, 2.0, 401)
    assert identify_accepted(time, scale * np.sin(10 * time) ** 2)[
        1
    ].omega == pytest.approx(10.0, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "omega", "alpha"),
    [
        ("oscillator_ref.csv", MODE.omega, 50.0),
        ("oscillator_S1_ref.csv", 2 * np.pi / 8e-3, 5.0),
        ("oscillator_S2_ref.csv", 2 * np.pi / 15e-3, 120.0),
        ("oscillator_S4_ref.csv", 2 * np.pi / 60e-3, 60.0),
    ],
)
def test_oscillators_of_a_real_solver(name: str, omega: float, alpha: float) -> None:
    _, mode = identify_accepted(*read_columns(locate_stored(name), "IE_J"))
    assert mode.omega == pytest.approx(omega, rel=1e-4)
    assert mode.alpha == pytest.approx(alpha, rel=1e-3)
    assert (mode.energy_plastic, mode.preload) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("name", "end_of_load"),
    [("load_L1_ref.csv.gz", 0.0197), ("load_L3_ref.csv.gz", 0.0235)],
)
def test_a_real_load_is_refused_and_the_flight_after_it_accepted(
    name: str, end_of_load: float
) -> None:
    time, energy = read_columns(locate_stored(name), "IE_J")
    assert "more than" in identify_refused(time, energy)
    flight = time >= end_of_load
    assert identify_accepted(time[flight], energy[flight])[0].misfit == pytest.approx(
        0.0, abs=1e-3
    )


def test_a_real_rollover_is_refused() -> None:
    time, energy = read_columns(ROLLOVER, "boxIE_J")
    flight = (time >= 0.09) & (time <= 0.37)
    assert "misses the energy by 71%" in identify_refused(time[flight], energy[flight])


@pytest.mark.parametrize("channel", ["IE_total_J", "IE_spring1_J", "IE_spring2_J"])
def test_a_real_chain_of_two_modes_is_refused(channel: str) -> None:
    assert "more than" in identify_refused(
        *read_columns(locate_stored("chain_ref.csv.gz"), channel)
    )


def test_a_parameter_that_changes_next_to_nothing_leaves_no_overflow() -> None:
    jacobian = np.stack([np.ones(30), np.linspace(0, 1, 30), np.full(30, 1e-155)])
    assert np.all(
        np.isfinite(compute_covariance(jacobian @ jacobian.T, np.linspace(-1, 1, 30)))
    )


def move_about_preload(
    time: Samples, omega: float, phase: float
) -> tuple[Samples, Samples]:
    """Return a deformation that never passes zero because of a preload, and its velocity over omega."""
    return 1 + 0.2 * np.cos(omega * time + phase), -0.2 * np.sin(omega * time + phase)


def test_a_preload_that_hardly_shows_is_a_vibration_of_half_the_rate_with_room_for_it() -> (
    None
):
    time = np.arange(0.0, 6.7, 1 / 40)
    fitted, mode = identify_accepted(
        time, move_about_preload(time, 2 * np.pi, 3.4484)[0] ** 2
    )
    assert mode.omega == pytest.approx(np.pi, rel=1e-2)
    assert mode.preload == 0.0
    assert fitted.hidden_share >= 0.03


def test_what_has_too_few_samples_is_not_taken_for_a_vibration_of_half_its_rate() -> (
    None
):
    """A fast, aliased vibration about a preload must not be accepted without a check of the number of samples."""
    for rate in np.linspace(4.1, 4.6, 6).tolist():
        time = np.arange(0.0, 6.0, 1 / rate)
        assert not identify(
            time, move_about_preload(time, 2 * np.pi * (1 + rate), 1.0)[0] ** 2
        ).describes_record
