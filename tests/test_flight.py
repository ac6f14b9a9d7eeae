"""The end of the load: found by the oscillator that describes the rest, or by the energy alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from d2rpick.flight import Flight, Span, described_span, energy_flight
from d2rpick.history import History
from d2rpick.situation import Settings, examine
from tests import paper
from tests.shared import shared

PERIOD = 2 * np.pi / paper.OMEGA_2


def loaded(*, alpha: float = 50.0, noise: float = 0.0, seed: int = 0, contact: float | None = None) -> History:
    """The paper's oscillator under a half-sine force of 20 ms, and under another one from ``contact`` on."""

    def force(t: float) -> float:
        if contact is not None and t > contact:
            return 5000.0 * math.sin(np.pi * min(t - contact, 0.02) / 0.02)
        return 2000.0 * math.sin(np.pi * t / 0.02) if t < 0.02 else 0.0

    def equations_of_motion(t: float, u: np.ndarray) -> list[float]:
        z, y, vz, vy = u
        return [
            vz,
            vy,
            (660e3 * (y - z) + force(t)) / 15.7 - alpha * vz,
            -660e3 * (y - z) / 31.4 - alpha * vy,
        ]

    time = np.linspace(0, 0.15, 1501)
    found = solve_ivp(equations_of_motion, (0, 0.15), [0.0] * 4, "DOP853", time, rtol=1e-10, atol=1e-13, max_step=1e-3)
    energy = 330e3 * (found.y[1] - found.y[0]) ** 2
    energy += noise * energy.max() * np.random.default_rng(seed).normal(size=time.size)
    return History(time, energy, source=("loaded",), format="csv", channel="E")


def rollover() -> History:
    table = np.genfromtxt(shared("openradioss/rollover_ref.csv"), delimiter=",", names=True)
    return History(table["time_s"], table["boxIE_J"], source=("rollover",), format="csv", channel="boxIE_J")


@pytest.mark.parametrize("alpha", [5.0, 50.0])
@pytest.mark.parametrize("td", [0.03, 0.064, 0.1])
def test_the_end_of_a_half_sine_load_is_found_within_a_tenth_of_a_period(alpha: float, td: float) -> None:
    flight = examine(loaded(alpha=alpha), td, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start == pytest.approx(0.020, abs=PERIOD / 10)
    assert flight.end is None


@pytest.mark.parametrize("seed", range(4))
def test_the_end_of_the_load_is_found_under_noise(seed: int) -> None:
    flight = examine(loaded(noise=0.01, seed=seed), 0.064, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start == pytest.approx(0.020, abs=PERIOD / 10)


@pytest.mark.parametrize("td", [0.05, 0.075, 0.085])
def test_the_next_contact_ends_the_flight(td: float) -> None:
    flight = examine(loaded(alpha=5.0, contact=0.09), td, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start == pytest.approx(0.020, abs=PERIOD / 10)
    assert flight.end == pytest.approx(0.09, abs=PERIOD / 10)


def test_a_record_that_flies_throughout_flies_from_its_first_state_to_an_unknown_end() -> None:
    span, fit = described_span(paper.history(), paper.TD, 0.0, 0.15)
    assert span == Span(0.0, 0.15)
    assert examine(paper.history(), paper.TD, Settings()).flight == Flight(0.0, None, "oscillator")
    assert fit.mode is not None
    assert fit.mode.omega == pytest.approx(paper.OMEGA_2, rel=1e-10)


@pytest.mark.parametrize(("name", "end_of_load"), [("load_L1_ref", 0.0200), ("load_L3_ref", 0.0235)])
@pytest.mark.parametrize("td", [0.064, 0.08])
def test_loads_computed_by_a_solver(name: str, end_of_load: float, td: float) -> None:
    table = np.genfromtxt(shared(f"openradioss/{name}.csv"), delimiter=",", names=True)
    history = History(table["time_s"], table["IE_J"], source=(name,), format="csv", channel="IE_J")
    flight = examine(history, td, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start == pytest.approx(end_of_load, abs=PERIOD / 10)


def test_many_modes_are_no_oscillator_and_the_energy_tells_the_end_of_the_load() -> None:
    situation = examine(rollover(), 0.37, Settings())
    assert (situation.basis, situation.flight.source) == ("energy", "energy")
    assert situation.flight.start == pytest.approx(0.0850, abs=0.0005)
    assert situation.kinetic_share is None


def test_an_energy_that_never_was_above_its_band_shows_no_end_of_a_load() -> None:
    time = np.linspace(0, 1, 101)
    rising = History(time, time**2, source=("rising",), format="csv", channel="E")
    assert energy_flight(rising, 0.8) == Flight(None, None, None)


def test_a_start_that_is_given_replaces_the_start_only() -> None:
    situation = examine(loaded(alpha=5.0, contact=0.09), 0.075, Settings(after=0.03))
    assert (situation.flight.start, situation.flight.source) == (0.03, "given")
    assert situation.flight.end == pytest.approx(0.09, abs=PERIOD / 10)
    assert situation.basis == "oscillator"


def test_a_given_start_does_not_stretch_what_the_oscillator_describes() -> None:
    situation = examine(loaded(), 0.064, Settings(after=0.005))
    assert situation.flight.start == 0.005
    assert situation.span is not None
    assert situation.span.start == pytest.approx(0.020, abs=PERIOD / 10)
    assert situation.energy_at(0.01) == pytest.approx(loaded().energy_at(0.01))


def test_a_fit_window_away_from_td_says_nothing_of_td() -> None:
    history = loaded(alpha=5.0, contact=0.09)
    situation = examine(history, 0.12, Settings(fit_window=(0.03, 0.085)))
    assert situation.basis == "energy"
    assert situation.no_mode is not None
    assert "does not describe the record at td" in situation.no_mode


def test_a_fit_window_is_where_the_oscillator_comes_from() -> None:
    situation = examine(loaded(), 0.064, Settings(fit_window=(0.03, 0.12)))
    assert situation.fit is not None
    assert (situation.fit.start, situation.fit.end) == pytest.approx((0.03, 0.12))
    assert situation.flight.start == pytest.approx(0.020, abs=PERIOD / 10)


def test_without_replay_no_oscillator_is_looked_for() -> None:
    situation = examine(loaded(), 0.064, Settings(replay=False))
    assert (situation.basis, situation.fit) == ("energy", None)
    assert situation.no_mode is not None
    assert "--no-verify" in situation.no_mode


def test_a_vibration_that_has_sunk_into_noise_has_no_sign() -> None:
    situation = examine(loaded(noise=0.01), 0.1, Settings())
    assert situation.basis == "energy"
    assert situation.no_mode is not None
    assert "sunk into the scatter" in situation.no_mode
