"""The end of the load, found from the oscillator that describes the later energy or from the energy alone."""

import math
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings
from d2rpick.flight.flight import Flight
from d2rpick.flight.internal_energy import find_end_of_load
from d2rpick.histories.history import History
from d2rpick.vibration.oscillator import to_mode
from d2rpick.vibration.span import Span, SpanSearch, find_described_span
from tests import paper
from tests.computed import locate_stored, read_columns
from tests.energies import require
from tests.records import add_noise, make_table

PERIOD = 2 * np.pi / paper.OMEGA_2


def integrate_oscillator(
    force: Callable[[float], float], end: float, *, alpha: float
) -> History:
    """Return the paper's oscillator, from rest, under a force on its frame, with one state each 0.1 ms."""

    def equations_of_motion(t: float, u: np.ndarray) -> list[float]:
        z, y, vz, vy = u
        return [
            vz,
            vy,
            (660e3 * (y - z) + force(t)) / 15.7 - alpha * vz,
            -660e3 * (y - z) / 31.4 - alpha * vy,
        ]

    time = np.linspace(0, end, round(end / 1e-4) + 1)
    solution = solve_ivp(
        equations_of_motion,
        (0, end),
        [0.0] * 4,
        "DOP853",
        time,
        rtol=1e-10,
        atol=1e-13,
        max_step=5e-4,
    )
    return make_table(time, 330e3 * (solution.y[1] - solution.y[0]) ** 2)


@cache
def push_oscillator(alpha: float, contact: float) -> History:
    """Push the oscillator with a half-sine of 20 ms, and with another one from ``contact`` on."""

    def force(t: float) -> float:
        if t > contact:
            return 5000.0 * math.sin(np.pi * min(t - contact, 0.02) / 0.02)
        return 2000.0 * math.sin(np.pi * t / 0.02) if t < 0.02 else 0.0

    return integrate_oscillator(force, 0.15, alpha=alpha)


def push_with_noise(
    *, alpha: float = 50.0, noise: float = 0.0, seed: int = 0, contact: float = np.inf
) -> History:
    """Push the oscillator as `push_oscillator` does, and add white noise to its energy."""
    history = push_oscillator(alpha, contact)
    return make_table(history.time, add_noise(history.energy, noise, seed))


def begins_after_load(flight: Flight) -> bool:
    """Return True if an oscillator shows a flight that begins within 1/10 of a period of 20 ms + 1/4 period.

    A load that ends while the spring passes zero moves it without a trace in the energy; no tr may be in it.
    """
    start = flight.start or 0.0
    return (
        flight.source == "oscillator"
        and start >= 0.02
        and abs(start - 0.02 - PERIOD / 4) < PERIOD / 10
    )


@pytest.mark.parametrize("alpha", [5.0, 50.0])
@pytest.mark.parametrize("td", [0.03, 0.064, 0.1])
def test_a_flight_begins_a_quarter_of_a_period_after_a_half_sine_load(
    alpha: float, td: float
) -> None:
    flight = examine_td(push_with_noise(alpha=alpha), td, Settings()).flight
    assert begins_after_load(flight)
    assert flight.end is None


@pytest.mark.parametrize("seed", range(2))
def test_the_end_of_the_load_is_found_under_noise(seed: int) -> None:
    assert begins_after_load(
        examine_td(push_with_noise(noise=0.01, seed=seed), 0.064, Settings()).flight
    )


@pytest.mark.parametrize("td", [0.05, 0.075, 0.085])
def test_the_next_contact_ends_the_flight(td: float) -> None:
    flight = examine_td(push_with_noise(alpha=5.0, contact=0.09), td, Settings()).flight
    assert begins_after_load(flight)
    assert flight.end == pytest.approx(0.09, abs=PERIOD / 10)


def test_a_record_that_flies_throughout_flies_from_its_first_state_to_an_unknown_end() -> (
    None
):
    span, fit = find_described_span(
        SpanSearch(paper.make_history(), Span(0.0, 0.15)), paper.TD
    )
    assert span == Span(0.0, 0.15)
    assert examine_td(paper.make_history(), paper.TD, Settings()).flight == Flight(
        0.0, None, "oscillator", described=True
    )
    assert fit.mode is not None
    assert fit.mode.omega == pytest.approx(paper.OMEGA_2, rel=1e-10)


@pytest.mark.parametrize(
    ("name", "end_of_load"), [("load_L1_ref", 0.0200), ("load_L3_ref", 0.0235)]
)
@pytest.mark.parametrize("td", [0.064, 0.08])
def test_loads_computed_by_a_solver(name: str, end_of_load: float, td: float) -> None:
    flight = examine_td(
        make_table(*read_columns(locate_stored(f"{name}.csv.gz"), "IE_J")),
        td,
        Settings(),
    ).flight
    assert flight.source == "oscillator"
    assert flight.start == pytest.approx(end_of_load + PERIOD / 4, abs=PERIOD / 10)


def test_an_energy_that_never_was_above_its_band_shows_no_end_of_a_load() -> None:
    time = np.linspace(0, 1, 101)
    assert find_end_of_load(make_table(time, time**2), 0.8) is None


def test_a_start_that_is_given_replaces_the_start_only() -> None:
    situation = examine_td(
        push_with_noise(alpha=5.0, contact=0.09), 0.075, Settings(after=0.03)
    )
    assert (situation.flight.start, situation.flight.source) == (0.03, "given")
    assert situation.flight.end == pytest.approx(0.09, abs=PERIOD / 10)
    assert situation.basis == "oscillator"


def test_a_given_start_does_not_stretch_what_the_oscillator_describes() -> None:
    situation = examine_td(push_with_noise(), 0.064, Settings(after=0.005))
    assert situation.flight.start == 0.005
    assert require(situation.evidence.span).start == pytest.approx(
        0.020, abs=PERIOD / 10
    )
    assert situation.vibration.whole.energy(0.01) == pytest.approx(
        push_with_noise().energy_at(0.01)
    )


@pytest.mark.parametrize(
    ("push_options", "td", "settings", "why"),
    [
        (
            {"alpha": 5.0, "contact": 0.09},
            0.12,
            Settings(fit_window=(0.03, 0.085)),
            "does not describe the record",
        ),
        ({}, 0.064, Settings(replay=False), "was switched off"),
        ({"noise": 0.01}, 0.1, Settings(), "below the noise of the record"),
    ],
)
def test_where_no_oscillator_tells_the_sign_it_is_said_why(
    push_options: dict[str, float], td: float, settings: Settings, why: str
) -> None:
    situation = examine_td(push_with_noise(**push_options), td, settings)  # type: ignore[arg-type]
    assert situation.basis == "energy"
    assert why in (situation.vibration.unknown or "")
    assert settings.replay or situation.evidence.fit is None


def test_a_fit_window_is_where_the_oscillator_comes_from() -> None:
    situation = examine_td(push_with_noise(), 0.064, Settings(fit_window=(0.03, 0.12)))
    assert (
        require(situation.evidence.fit).start,
        require(situation.evidence.fit).end,
    ) == pytest.approx((0.03, 0.12))
    assert situation.flight.start == pytest.approx(0.020 + PERIOD / 4, abs=PERIOD / 10)


# ---- td early in a flight, and in the next contact


def apply_two_loads(t: float) -> float:
    """Return the force at ``t``: a load until 20 ms, free flight, the next contact from 150 ms on."""
    if t < 0.02:
        return 1e4 * math.sin(math.pi * t / 0.02)
    return 1.3e4 * math.sin(math.pi * (t - 0.15) / 0.03) if 0.15 <= t <= 0.18 else 0.0


@cache
def push_twice() -> History:
    return integrate_oscillator(apply_two_loads, 0.25, alpha=10.0)


@pytest.mark.parametrize("td", [0.028, 0.034, 0.044, 0.1])
def test_the_whole_flight_is_found_wherever_td_lies_in_it(td: float) -> None:
    situation = examine_td(push_twice(), td, Settings())
    assert situation.basis == "oscillator"
    assert situation.flight.start == pytest.approx(0.020 + PERIOD / 4, abs=PERIOD / 10)
    assert situation.flight.end == pytest.approx(0.150, abs=PERIOD / 10)


@pytest.mark.slow
@pytest.mark.parametrize("td", [0.153, 0.157, 0.162, 0.17, 0.178])
@pytest.mark.parametrize("load_end", [None, 0.03])
def test_td_in_the_next_contact_is_after_the_end_of_the_flight(
    td: float, load_end: float | None
) -> None:
    answer = suggest_in_history(push_twice(), td, Settings(after=load_end))
    assert answer.recommended is None
    assert answer.situation.flight.end == pytest.approx(0.150, abs=PERIOD / 10)
    assert "td-after-contact" in {caution.code for caution in answer.cautions}


@pytest.mark.parametrize("td", [0.1, 0.149])
def test_a_contact_does_not_creep_into_the_fit(td: float) -> None:
    situation = examine_td(push_twice(), td, Settings())
    fitted = situation.vibration.whole.mode
    assert fitted is not None
    assert fitted.alpha == pytest.approx(10, abs=0.05)
    assert situation.flight.end == pytest.approx(0.150, abs=PERIOD / 25)


def test_a_rising_energy_shows_no_end_of_a_load() -> None:
    time = np.linspace(0, 1, 1001)
    energy = (
        np.exp(-((time - 0.1) ** 2) / 0.001)
        + 0.1 * np.sin(300 * time) ** 2
        + np.where(time > 0.9, time - 0.9, 0) * 9
    )
    fed = make_table(time, energy)
    assert find_end_of_load(fed, 0.96) is None
    assert find_end_of_load(fed, 0.85) == pytest.approx(0.13, abs=0.05)


@pytest.mark.slow
def test_a_small_second_mode_makes_no_short_flights() -> None:
    mode, time = to_mode(paper.OSCILLATOR, 6.0), paper.make_history().time
    energy = (
        mode.energy(time)
        + 0.02 * 140 * np.exp(-30 * time) * np.sin(571 * time + 0.3) ** 2
    )
    for td in np.linspace(0.03, 0.12, 10).tolist():
        span = examine_td(make_table(time, energy), td, Settings()).evidence.span
        assert span is None or span.end - span.start > 1.25 * PERIOD


# ---- an oscillator that is given, or has sunk into noise


def test_a_given_oscillator_is_held_against_its_flight_only() -> None:
    time = push_twice().time
    free = (
        330e3
        * (np.diff(np.stack(paper.OSCILLATOR.free(paper.START, time))[:2], axis=0)[0])
        ** 2
    )
    energy = np.where(time < 0.15, free, push_twice().energy)
    situation = examine_td(
        make_table(time, energy),
        0.064,
        Settings(oscillator=to_mode(paper.OSCILLATOR, 6.0)),
    )
    assert situation.basis == "oscillator"
    assert situation.flight.start == 0.0
    assert situation.flight.end == pytest.approx(0.150, abs=PERIOD / 10)


def test_a_level_that_has_sunk_into_noise_recommends_nothing_but_a_td_where_it_has_not() -> (
    None
):
    record = paper.make_history()
    answer = suggest_in_history(
        make_table(record.time, add_noise(record.energy, 0.01, 3)), 0.1, Settings()
    )
    assert answer.recommended is None
    assert (
        float(
            min(
                abs(require(answer.better_pair).td - peak / 1e3)
                for peak, _ in paper.PEAKS
            )
        )
        < 1e-4
    )
    # With 1 % noise, a peak is not exact; it is in the middle of the range that the noise leaves.
    assert 0 < require(require(answer.better_pair).residual) < 1e-3
