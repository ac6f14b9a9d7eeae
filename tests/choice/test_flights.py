"""The margin before a contact, against landings that a real solver computed with and without switching."""

import csv
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from d2rpick.choice.of_run import read
from d2rpick.choice.windows import find_flights
from d2rpick.flight.flight import Flight
from d2rpick.flight.margin import SHARE, landing_spread, margin_before_contact
from d2rpick.histories.history import EXACT, Balance, Given, History, Momenta
from tests.computed import results, stored
from tests.energies import sure

positive = st.floats(0.1, 10.0)


def flying_oscillator(
    omega: float, amplitude: float, speed: float, mass: float, periods: int = 20
) -> tuple[History, Flight]:
    """A body that falls with a vibration of the velocity ``amplitude * omega`` in it, and its flight."""
    time = np.linspace(0.0, 2 * np.pi * periods / omega, 4001)
    internal = mass * (omega * amplitude * np.sin(omega * time)) ** 2 / 2
    velocity = speed * (0.5 + 0.5 * time / time[-1])
    kinetic = mass * velocity**2 / 2 + mass * (omega * amplitude) ** 2 / 2 - internal
    momentum = np.stack([0 * time, 0 * time, -mass * velocity], axis=1)[:, np.newaxis]
    balance = Balance(time, internal=internal, kinetic=kinetic)
    evidence = Given((Momenta(time, momentum, None, EXACT, (0,)),), balance)
    history = History(time, internal, source=("test",), format="csv", channel="E", evidence=evidence)
    return history, Flight(0.0, float(time[-1]), "momentum")


@given(positive, st.floats(0.001, 0.01), positive, positive)
def test_the_landing_moves_by_the_amplitude_over_the_speed(
    omega: float, amplitude: float, speed: float, mass: float
) -> None:
    """Half of the vibration energy is kinetic in the mean: the amplitude counts with 1 over the root of 2."""
    history, flight = flying_oscillator(omega, amplitude * speed / omega, speed, mass)
    expected = amplitude * speed / omega / speed / np.sqrt(2)
    assert landing_spread(history, flight) == pytest.approx(expected, rel=0.05)


def test_the_larger_of_share_and_spread_counts() -> None:
    history, flight = flying_oscillator(10.0, 1e-4, 1.0, 2.0)
    assert margin_before_contact(history, flight)[:2] == (SHARE * sure(flight.end), "flight")
    history, flight = flying_oscillator(10.0, 0.1, 1.0, 2.0, periods=2)
    found = margin_before_contact(history, flight)
    assert (found.source, found.time) == ("landing", found.spread)
    assert margin_before_contact(history, flight, 0.25)[:2] == (0.25, "given")


def test_without_a_contact_or_energies_nothing_is_made_up() -> None:
    history, flight = flying_oscillator(10.0, 1.0, 1.0, 2.0)
    assert margin_before_contact(history, flight._replace(end=None)) == (0.0, "no-contact", None)
    bare = History(history.time, history.energy, source=("test",), format="csv", channel="E")
    assert margin_before_contact(bare, flight) == (SHARE * history.time[-1], "flight", None)


def landings(name: str, column: str) -> Iterator[tuple[str, float]]:
    """Name of each computed run, and a number of it."""
    with results(name).open() as file:
        yield from ((row["run"], float(row[column] or "nan")) for row in csv.DictReader(file))


def test_the_landings_of_the_switched_car_lie_within_the_margin() -> None:
    """All that were switched in the flight and back before the contact."""
    history = read([stored("carT01.gz")]).history
    flight = find_flights(history)[-1]
    margin = margin_before_contact(history, flight)
    starts, ends = dict(landings("car_runs.csv", "tr_s")), dict(landings("car_runs.csv", "td_s"))
    kept = [name for name in starts if starts[name] > (flight.start or 0) and ends[name] < 0.15]
    moved = [abs(landing - 0.15041) for name, landing in landings("car_runs.csv", "landing_s") if name in kept]
    assert len(moved) > 15
    assert max(moved) == pytest.approx(1.1e-3, abs=1e-4)
    assert max(moved) < margin.time
    assert margin.spread is not None
    assert margin.spread == pytest.approx(1.25e-3, abs=1e-5)
    assert max(moved) < margin.spread  # by the formula alone, too


@pytest.mark.parametrize(
    ("run", "column", "end"), [("drop2_w2", "dland4_ms", 0.4196), ("drop2_w3", "dland7_ms", 0.5966)]
)
def test_the_landings_of_the_switched_box_lie_within_the_margin(run: str, column: str, end: float) -> None:
    history = read([stored("drop2T01.gz")]).history
    (flight,) = (one for one in find_flights(history) if one.end == pytest.approx(end, abs=1e-3))
    moved = abs(dict(landings("drop2_runs.csv", column))[run]) / 1e3
    assert 1e-3 < moved < margin_before_contact(history, flight).time
