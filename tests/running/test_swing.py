"""Warnings about parts that still vibrate when a body becomes rigid, from the flight so far and without td."""

from functools import cache

import numpy as np
import pytest

from d2rpick.flight.flight import Flight
from d2rpick.flight.position_error import Drift, find_drift_in_flight
from d2rpick.histories.history import EXACT, History, Momenta
from d2rpick.histories.names import Part
from d2rpick.running.swing import find_swing
from tests.command import ENERGY, ROOT, run
from tests.energies import require
from tests.reading import read_history, read_solved
from tests.records import make_table

CAR = ROOT / "tests" / "data" / "carT01.gz"
FREE, TD = 0.0385, 0.1464


@cache
def read_car_with_drift() -> tuple[History, Drift]:
    """Return a computed run, and the drift of its bodies in the flight."""
    history = read_solved("carT01.gz").history
    (momenta,) = (
        part_momenta
        for part_momenta in history.momenta
        if part_momenta.parts is not None
    )
    moving = tuple(require(momenta.parts)[i] for i in momenta.moving)
    return history, require(
        find_drift_in_flight(history, Flight(FREE, TD, "momentum", moving))
    )


@pytest.mark.parametrize("tr", [0.0605, 0.0676, 0.075, 0.09])
def test_what_a_flight_shows_up_to_tr_is_about_the_error_at_td(tr: float) -> None:
    history, whole = read_car_with_drift()
    error = float(whole.errors(np.array([tr]), float(whole.time[-1]))[0])
    swing = require(find_swing(history, FREE, tr))
    assert swing.name == "engine"
    assert error <= swing.error <= 1.3 * error
    # A flight of that length at the mean speed so far has a path of 100 times the error.
    mean = float(np.interp(tr, whole.time, whole.path)) / (tr - float(whole.time[0]))
    assert swing.flight * mean == pytest.approx(100 * swing.error, rel=0.05)


@pytest.mark.parametrize("swings", [0.0, 0.004])
def test_of_two_parts_the_most_that_the_heavy_one_may_be_off_is_told(
    swings: float,
) -> None:
    """The parts vibrate relative to each other at 25 Hz, fall, and do not rotate; an extremum doubles the error."""
    time, masses = np.linspace(0.0, 0.06, 241), np.array([30.0, 10.0])
    values = np.zeros((time.size, 2, 3))
    values[:, :, 2] = np.outer(-9.81 * time - 1.0, masses)
    swing = 30.0 * swings * 50 * np.pi * np.sin(50 * np.pi * time)
    values[:, 0, 0], values[:, 1, 0] = swing, -swing
    momenta = Momenta(
        time, values, (Part(1, "shell"), Part(2, "block")), EXACT, (0, 1), masses=masses
    )
    first_swing = require(
        find_swing(make_table(time, np.zeros(time.size), momenta), 0.0, 0.06)
    )
    assert first_swing.name == "block"
    assert first_swing.error == pytest.approx(2 * swings, abs=1e-5)
    assert "at most" in first_swing.warning


def test_nothing_is_said_where_no_momenta_of_parts_tell() -> None:
    history = read_history([ENERGY])
    assert find_swing(history, 0.01, 0.03) is None


def test_an_advised_switch_says_it() -> None:
    result = run("follow", "--once", "--exit-zero", "--wait", "0.024", str(CAR)).stdout
    (switch,) = (line for line in result.splitlines() if "  switch  " in line)
    assert "engine still moves relative" in switch
