"""The end of the load: found by the oscillator that describes the rest, or by the energy alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from d2rpick.choice.settings import Settings
from d2rpick.choice.situation import examine
from d2rpick.choice.suggest import suggest
from d2rpick.flight.flight import Flight
from d2rpick.flight.internal_energy import end_of_load
from d2rpick.histories.history import History
from d2rpick.vibration.oscillator import to_mode
from d2rpick.vibration.span import Span, described_span
from tests import paper
from tests.command import ROLLOVER
from tests.computed import stored

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
    table = np.genfromtxt(ROLLOVER, delimiter=",", names=True)
    return History(table["time_s"], table["boxIE_J"], source=("rollover",), format="csv", channel="boxIE_J")


@pytest.mark.parametrize("alpha", [5.0, 50.0])
@pytest.mark.parametrize("td", [0.03, 0.064, 0.1])
def test_a_flight_begins_a_quarter_of_a_period_after_a_half_sine_load(alpha: float, td: float) -> None:
    """The load that ends while the spring passes zero moves it unseen; no tr may lie in it."""
    flight = examine(loaded(alpha=alpha), td, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start is not None
    assert 0.020 <= flight.start == pytest.approx(0.020 + PERIOD / 4, abs=PERIOD / 10)
    assert flight.end is None


@pytest.mark.parametrize("seed", range(4))
def test_the_end_of_the_load_is_found_under_noise(seed: int) -> None:
    flight = examine(loaded(noise=0.01, seed=seed), 0.064, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start is not None
    assert 0.020 <= flight.start == pytest.approx(0.020 + PERIOD / 4, abs=PERIOD / 10)


@pytest.mark.parametrize("td", [0.05, 0.075, 0.085])
def test_the_next_contact_ends_the_flight(td: float) -> None:
    flight = examine(loaded(alpha=5.0, contact=0.09), td, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start is not None
    assert 0.020 <= flight.start == pytest.approx(0.020 + PERIOD / 4, abs=PERIOD / 10)
    assert flight.end == pytest.approx(0.09, abs=PERIOD / 10)


def test_a_record_that_flies_throughout_flies_from_its_first_state_to_an_unknown_end() -> None:
    span, fit = described_span(paper.history(), paper.TD, Span(0.0, 0.15))
    assert span == Span(0.0, 0.15)
    assert examine(paper.history(), paper.TD, Settings()).flight == Flight(0.0, None, "oscillator", described=True)
    assert fit.mode is not None
    assert fit.mode.omega == pytest.approx(paper.OMEGA_2, rel=1e-10)


@pytest.mark.parametrize(("name", "end_of_load"), [("load_L1_ref", 0.0200), ("load_L3_ref", 0.0235)])
@pytest.mark.parametrize("td", [0.064, 0.08])
def test_loads_computed_by_a_solver(name: str, end_of_load: float, td: float) -> None:
    table = np.genfromtxt(stored(f"{name}.csv.gz"), delimiter=",", names=True)
    history = History(table["time_s"], table["IE_J"], source=(name,), format="csv", channel="IE_J")
    flight = examine(history, td, Settings()).flight
    assert flight.source == "oscillator"
    assert flight.start == pytest.approx(end_of_load + PERIOD / 4, abs=PERIOD / 10)


def test_many_modes_are_no_oscillator_and_the_energy_tells_the_end_of_the_load() -> None:
    situation = examine(rollover(), 0.37, Settings())
    assert (situation.basis, situation.flight.source) == ("energy", "energy")
    assert situation.flight.settled == pytest.approx(0.0850, abs=0.002)
    assert situation.flight.start is not None
    assert 0.0908 < situation.flight.start < 0.182  # by the contact energy the trip ends at 90.8 ms
    assert not situation.flight.certain
    assert situation.kinetic_share is None


def test_an_energy_that_never_was_above_its_band_shows_no_end_of_a_load() -> None:
    time = np.linspace(0, 1, 101)
    rising = History(time, time**2, source=("rising",), format="csv", channel="E")
    assert end_of_load(rising, 0.8) is None


def test_a_start_that_is_given_replaces_the_start_only() -> None:
    situation = examine(loaded(alpha=5.0, contact=0.09), 0.075, Settings(after=0.03))
    assert (situation.flight.start, situation.flight.source) == (0.03, "given")
    assert situation.flight.end == pytest.approx(0.09, abs=PERIOD / 10)
    assert situation.basis == "oscillator"


def test_a_given_start_does_not_stretch_what_the_oscillator_describes() -> None:
    situation = examine(loaded(), 0.064, Settings(after=0.005))
    assert situation.flight.start == 0.005
    assert situation.evidence.span is not None
    assert situation.evidence.span.start == pytest.approx(0.020, abs=PERIOD / 10)
    assert situation.vibration.whole.energy(0.01) == pytest.approx(loaded().energy_at(0.01))


def test_a_fit_window_away_from_td_says_nothing_of_td() -> None:
    history = loaded(alpha=5.0, contact=0.09)
    situation = examine(history, 0.12, Settings(fit_window=(0.03, 0.085)))
    assert situation.basis == "energy"
    assert situation.vibration.unknown is not None
    assert "does not describe the record at td" in situation.vibration.unknown


def test_a_fit_window_is_where_the_oscillator_comes_from() -> None:
    situation = examine(loaded(), 0.064, Settings(fit_window=(0.03, 0.12)))
    assert situation.evidence.fit is not None
    assert (situation.evidence.fit.start, situation.evidence.fit.end) == pytest.approx((0.03, 0.12))
    assert situation.flight.start == pytest.approx(0.020 + PERIOD / 4, abs=PERIOD / 10)


def test_without_replay_no_oscillator_is_looked_for() -> None:
    situation = examine(loaded(), 0.064, Settings(replay=False))
    assert (situation.basis, situation.evidence.fit) == ("energy", None)
    assert situation.vibration.unknown is not None
    assert "was switched off" in situation.vibration.unknown


def test_a_vibration_that_has_sunk_into_noise_has_no_sign() -> None:
    situation = examine(loaded(noise=0.01), 0.1, Settings())
    assert situation.basis == "energy"
    assert situation.vibration.unknown is not None
    assert "below the noise of the record" in situation.vibration.unknown


# ---- td early in a flight, and in the next contact


def struck_twice() -> History:
    """A load to 20 ms, free flight, the next contact from 150 ms on."""

    def force(t: float) -> float:
        if t < 0.02:
            return 1e4 * math.sin(math.pi * t / 0.02)
        return 1.3e4 * math.sin(math.pi * (t - 0.15) / 0.03) if 0.15 <= t <= 0.18 else 0.0

    def equations_of_motion(t: float, u: np.ndarray) -> list[float]:
        z, y, vz, vy = u
        return [vz, vy, (660e3 * (y - z) + force(t)) / 15.7 - 10 * vz, -660e3 * (y - z) / 31.4 - 10 * vy]

    time = np.linspace(0, 0.25, 2501)
    found = solve_ivp(equations_of_motion, (0, 0.25), [0.0] * 4, "DOP853", time, rtol=1e-10, atol=1e-13, max_step=5e-4)
    return History(time, 330e3 * (found.y[1] - found.y[0]) ** 2, source=("struck",), format="csv", channel="E")


STRUCK = struck_twice()


@pytest.mark.parametrize("td", [0.028, 0.030, 0.034, 0.038, 0.044, 0.1, 0.149])
def test_the_whole_flight_is_found_wherever_td_lies_in_it(td: float) -> None:
    situation = examine(STRUCK, td, Settings())
    assert situation.basis == "oscillator"
    assert situation.flight.start == pytest.approx(0.020 + PERIOD / 4, abs=PERIOD / 10)
    assert situation.flight.end == pytest.approx(0.150, abs=PERIOD / 10)


@pytest.mark.parametrize("td", [0.153, 0.157, 0.162, 0.17, 0.178])
@pytest.mark.parametrize("after", [None, 0.03])
def test_td_in_the_next_contact_is_after_the_end_of_the_flight(td: float, after: float | None) -> None:
    answer = suggest(STRUCK, td, Settings(after=after))
    assert answer.recommended is None
    assert answer.situation.flight.end == pytest.approx(0.150, abs=PERIOD / 10)
    assert "td-after-contact" in {caution.code for caution in answer.cautions}


@pytest.mark.parametrize("td", [0.1, 0.149])
def test_a_contact_does_not_creep_into_the_fit(td: float) -> None:
    situation = examine(STRUCK, td, Settings())
    fitted = situation.vibration.whole.mode
    assert fitted is not None
    assert fitted.alpha == pytest.approx(10, abs=0.05)
    assert situation.flight.end == pytest.approx(0.150, abs=PERIOD / 25)


def test_a_rising_energy_shows_no_end_of_a_load() -> None:
    time = np.linspace(0, 1, 1001)
    energy = (
        np.exp(-((time - 0.1) ** 2) / 0.001) + 0.1 * np.sin(300 * time) ** 2 + np.where(time > 0.9, time - 0.9, 0) * 9
    )
    fed = History(time, energy, source=("fed",), format="csv", channel="E")
    assert end_of_load(fed, 0.96) is None
    assert end_of_load(fed, 0.85) == pytest.approx(0.13, abs=0.05)


def test_a_small_second_mode_makes_no_short_flights() -> None:
    mode, time = to_mode(paper.OSCILLATOR, 6.0), paper.history().time
    energy = mode.energy(time) + 0.02 * 140 * np.exp(-30 * time) * np.sin(571 * time + 0.3) ** 2
    history = History(time, energy, source=("two",), format="csv", channel="E")
    for td in np.linspace(0.03, 0.12, 10):
        situation = examine(history, float(td), Settings())
        assert (
            situation.evidence.span is None
            or situation.evidence.span.end - situation.evidence.span.start > 1.25 * PERIOD
        )


# ---- an oscillator that is given, or has sunk into noise


def test_a_given_oscillator_is_held_against_its_flight_only() -> None:
    struck = 330e3 * (np.diff(np.stack(paper.OSCILLATOR.free(paper.START, STRUCK.time))[:2], axis=0)[0]) ** 2
    energy = np.where(STRUCK.time < 0.15, struck, STRUCK.energy)
    history = History(STRUCK.time, energy, source=("given",), format="csv", channel="E")
    situation = examine(history, 0.064, Settings(oscillator=to_mode(paper.OSCILLATOR, 6.0)))
    assert situation.basis == "oscillator"
    assert situation.flight.start == 0.0
    assert situation.flight.end == pytest.approx(0.150, abs=PERIOD / 10)


def test_a_given_oscillator_that_does_not_fit_recommends_nothing() -> None:
    wrong = to_mode(replace(paper.OSCILLATOR, stiffness=1.05 * 660e3), 6.0)
    answer = suggest(paper.history(), paper.TD, Settings(oscillator=wrong))
    assert answer.recommended is None
    assert any("the oscillator that was asked for" in note for c in answer.candidates for note in c.notes)


def test_a_level_that_has_sunk_into_noise_recommends_nothing_but_a_td_where_it_has_not() -> None:
    noise = 0.01 * paper.history().energy.max() * np.random.default_rng(3).normal(size=1501)
    history = History(
        paper.history().time, paper.history().energy + noise, source=("noisy",), format="csv", channel="E"
    )
    answer = suggest(history, 0.1, Settings())
    assert answer.recommended is None
    assert answer.better_pair is not None
    assert float(min(abs(answer.better_pair.td - peak / 1e3) for peak, _ in paper.PEAKS)) < 1e-4
    assert answer.better_pair.residual == pytest.approx(0.0, abs=1e-6)
