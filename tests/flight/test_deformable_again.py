"""Parts of a switched run in its flights, for a computed box that was rigid in three windows."""

from functools import cache

import numpy as np
import pytest

from d2rpick.choice.parts.margins import find_drift_of_bodies, find_margin
from d2rpick.choice.question import Settings, read_reference
from d2rpick.choice.switched.switched_run import prepare_switched_history
from d2rpick.choice.td.flights import find_flights
from d2rpick.flight.deformable_again import restore_parts
from d2rpick.flight.flight import Flight
from d2rpick.flight.margin import compute_margin
from d2rpick.histories.history import History
from d2rpick.histories.names import Selection
from tests.computed import locate_stored
from tests.energies import require

# Masses of the parts of the box, in addition to the ground of 314 kg.
BOX_MASS = 58.7


@cache
def read_switched_box() -> tuple[History, tuple[Flight, ...], tuple[Flight, ...]]:
    """Return the record, its flights with a rigid window, and the others."""
    legs = [locate_stored(f"drop2_w123_T0{leg}.gz") for leg in range(1, 7)]
    reference = read_reference(legs, Selection(parts=("1-5",)))
    history, windows, _ = prepare_switched_history(reference, ())
    flights = find_flights(history, Settings())
    with_window = tuple(
        flight
        for flight in flights
        if any(
            flight.within(history.time)[0] < td and tr < flight.within(history.time)[1]
            for tr, td in windows
        )
    )
    others = tuple(flight for flight in flights if flight not in with_window)
    return history, with_window, others


def test_where_the_parts_deform_they_show_how_far_the_box_is_out_of_place() -> None:
    history, _, others = read_switched_box()
    longer = 0
    for flight in others:
        restored, with_parts = restore_parts(history, flight)
        assert [part.id for part in require(with_parts.parts)] == [1, 2, 3, 4, 5]
        (of_parts, whole) = restored.momenta
        assert of_parts.mass(range(6)) == pytest.approx(BOX_MASS, rel=0.01)
        inside = np.isin(whole.time, of_parts.time)
        sums = of_parts.of(range(6))
        assert np.abs(sums - whole.values[inside, 0]).max() < 0.01 * np.abs(sums).max()
        bodies = require(find_drift_of_bodies(history, flight, Settings()))
        end = require(flight.end)
        errors = bodies.errors(np.linspace(require(flight.start), end, 9)[:-1], end)
        margin = find_margin(history, flight, Settings())
        if np.isfinite(errors).all():
            longer += margin.time > compute_margin(history, flight).time
    assert longer > 0


def test_where_the_box_was_rigid_its_parts_stay_unknown() -> None:
    history, with_window, _ = read_switched_box()
    assert len(with_window) == 3
    for flight in with_window:
        assert restore_parts(history, flight) == (history, flight)
        assert find_drift_of_bodies(history, flight, Settings()) is None


def test_a_flight_of_parts_and_a_record_without_a_switch_are_left_as_they_are() -> None:
    history, _, others = read_switched_box()
    of_parts = others[0]._replace(parts=history.parts)
    assert restore_parts(history, of_parts) == (history, of_parts)
    reference = read_reference(
        [locate_stored("drop2T01.gz")], Selection(parts=("1-5",))
    )
    whole = others[0]._replace(parts=None)
    assert restore_parts(reference.history, whole) == (reference.history, whole)
