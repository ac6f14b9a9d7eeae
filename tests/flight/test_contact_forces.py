"""Flights found from contact and rigid-wall forces, which are the only evidence if momenta are missing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, strategies as st

from d2rpick.flight.contact_forces import Touches, is_deformed
from d2rpick.flight.flight import find_all_seen, find_seen_flight
from d2rpick.flight.window import FreeFlight
from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.history import Balance, Given, History, Momenta, Precision
from d2rpick.histories.names import Selection
from d2rpick.histories.opening import open_run
from tests.command import ROOT, list_warning_codes, put, run_json
from tests.energies import require
from tests.records import make_table

if TYPE_CHECKING:
    from pathlib import Path

    from d2rpick.histories.history import Samples

COMPUTED = str(ROOT / "sample_data" / "rolloverT01.gz")
TIME = np.linspace(0, 1, 401)
STEP = float(TIME[1])


def make_contact(
    *acts: tuple[float, float], time: Samples = TIME, name: str = "contact"
) -> ContactForce:
    """Return a contact whose force acts during these times."""
    forces = np.zeros((time.size, 3))
    for start, end in acts:
        forces[(time >= start) & (time <= end), 2] = 5.0
    return ContactForce.of_forces(name, time, forces)


def find_flight_around(td: float, *forces: ContactForce) -> FreeFlight | None:
    touches = Touches.of(forces)
    return touches and touches.flight_around(td)


def drop_momenta(history: History) -> History:
    """Return the same record with energies and forces only."""
    evidence = history.evidence
    return replace(history, evidence=Given((), evidence.balance, None, evidence.forces))


@given(
    st.floats(0.05, 0.3),
    st.floats(0.45, 0.7),
    st.floats(0.75, 0.95),
    st.sampled_from([0.35, 0.4, 0.44]),
)
def test_the_ends_of_a_flight_are_known_to_one_output_interval(
    load: float, landing: float, end: float, td: float
) -> None:
    flight = require(
        find_flight_around(
            td, make_contact((0.0, load)), make_contact((landing, end), name="ground")
        )
    )
    assert load <= flight.start <= load + STEP * 1.001
    assert landing - STEP * 1.001 <= flight.end <= landing
    assert flight.end_seen
    assert np.isnan(flight.gravity)  # no force gives the gravity


@pytest.mark.parametrize("td", [0.1, 0.2, 0.55, 1.5])
def test_there_is_none_where_something_touches_or_nothing_is_written(td: float) -> None:
    assert find_flight_around(td, make_contact((0.05, 0.2), (0.5, 0.6))) is None


def test_a_gap_between_two_pushes_is_too_short_for_a_flight() -> None:
    assert find_flight_around(0.31, make_contact((0.1, 0.3), (0.32, 0.6))) is None


def test_what_always_or_never_acts_says_nothing_of_a_flight() -> None:
    """A tied contact holds parts together; a contact without a force may belong to other parts."""
    tied, idle = make_contact((0.0, 1.0), name="tied"), make_contact(name="idle")
    assert find_flight_around(0.5, tied, idle) is None
    flight = require(
        find_flight_around(0.5, tied, idle, make_contact((0.0, 0.2), (0.8, 1.0)))
    )
    assert flight.start == pytest.approx(0.2, abs=1.1 * STEP)
    assert flight.end == pytest.approx(0.8, abs=1.1 * STEP)


def test_files_that_are_written_at_different_times_are_put_together() -> None:
    coarse = np.linspace(0, 0.9, 31)
    flight = require(
        find_flight_around(
            0.5,
            make_contact((0.0, 0.2)),
            make_contact((0.7, 0.9), time=coarse, name="wall"),
        )
    )
    assert flight.start == pytest.approx(0.2, abs=1.1 * STEP)
    assert 0.7 - 0.031 <= flight.end <= 0.7
    assert (
        find_flight_around(
            0.95,
            make_contact((0.0, 0.2)),
            make_contact((0.7, 0.8), time=coarse, name="wall"),
        )
        is None
    )


def test_forces_find_the_flights_of_a_computed_run_that_its_momenta_find() -> None:
    history = open_run([COMPUTED]).history(Selection())
    by_momenta, by_forces = (
        find_all_seen(history),
        find_all_seen(drop_momenta(history)),
    )
    assert {source for source, _ in by_momenta} == {"momentum"}
    assert {source for source, _ in by_forces} == {"contact-force"}
    for (_, flight_of_momenta), (_, flight_of_forces) in zip(
        by_momenta, by_forces, strict=True
    ):
        assert flight_of_momenta.start == pytest.approx(
            flight_of_forces.start, abs=3 * history.step
        )  # momenta show the end of the last push slightly later
        assert flight_of_momenta.end == pytest.approx(
            flight_of_forces.end, abs=1.01 * history.step
        )


def test_momenta_of_parts_come_first_since_a_contact_may_be_of_others() -> None:
    history = open_run([COMPUTED]).history(Selection())
    rattle = make_contact((0.2, 0.21), time=history.time, name="loose things")
    evidence = history.evidence
    of_others = Given(
        evidence.momenta, evidence.balance, evidence.masses, (*evidence.forces, rattle)
    )
    evidence_of_td = find_seen_flight(replace(history, evidence=of_others), 0.205)
    assert evidence_of_td.source == "momentum"
    assert evidence_of_td.doubts == ()
    alone = find_seen_flight(
        replace(history, evidence=Given((), None, None, (*evidence.forces, rattle))),
        0.205,
    )
    assert alone.flight is None or alone.refusal


def compute_crash_energy(time: Samples) -> Samples:
    """Return the energy of vibrating parts that hit a wall of unwritten force at 0.6 and continue to vibrate."""
    level = np.where(time < 0.6, 1.0, np.minimum(6.0, 1 + 50 * (time - 0.6)))
    return np.asarray(level + 0.2 * np.sin(300 * time))


def make_history_with_forces(energy: Samples, *forces: ContactForce) -> History:
    return replace(make_table(TIME, energy), evidence=Given((), None, None, forces))


def test_a_crash_into_a_wall_whose_force_is_not_written_is_no_flight() -> None:
    history = make_history_with_forces(
        compute_crash_energy(TIME), make_contact((0.05, 0.3))
    )
    flight = require(find_flight_around(0.5, *history.evidence.forces))
    assert is_deformed(history, flight)
    evidence = find_seen_flight(history, 0.5)
    assert evidence.flight is None or evidence.refusal or evidence.flight.start > 0.6
    calm = make_history_with_forces(
        1 + 0.2 * np.sin(300 * TIME), make_contact((0.05, 0.3))
    )
    assert not is_deformed(calm, flight)
    assert require(find_seen_flight(calm, 0.5).flight).start == pytest.approx(
        0.3, abs=1.1 * STEP
    )


def test_before_any_contact_has_ended_forces_alone_show_no_flight() -> None:
    """A load of another kind may act from the start on, which only the external work shows."""
    history = make_history_with_forces(
        0.4 + 0.2 * np.sin(300 * TIME), make_contact((0.8, 0.85))
    )
    assert require(find_seen_flight(history, 0.6).refusal).startswith(
        "the contact force shows no free flight at td = 0.6"
    )
    work = Balance(TIME, internal=history.energy, external_work=np.zeros_like(TIME))
    forces_alone = replace(
        history, evidence=Given((), work, None, history.evidence.forces)
    )
    assert require(find_seen_flight(forces_alone, 0.6).flight).start == 0


def test_a_table_with_a_column_of_forces_is_judged_by_it(tmp_path: Path) -> None:
    acts = (TIME < 0.2) | ((TIME > 0.8) & (TIME < 0.9))
    energy = (
        5
        + np.where(TIME < 0.2, 40 * TIME, 8.0)
        + np.sin(400 * TIME)
        + 0.7 * np.sin(173 * TIME)
    )
    rows = "".join(
        f"{t:.6f},{e:.6f},{7.5 * a:.3f}\n"
        for t, e, a in zip(TIME, energy, acts, strict=True)
    )
    file = put(
        tmp_path / "run.csv", f"time,internal energy,contact force\n{rows}".encode()
    )
    suggestion = run_json("suggest", "--td", "0.6", str(file))
    assert suggestion["flight"]["source"] == "contact-force"
    assert suggestion["flight"]["start"] == pytest.approx(0.2, abs=1.1 * STEP)
    assert suggestion["flight"]["end"] == pytest.approx(0.8, abs=1.1 * STEP)
    assert not suggestion["flight"]["certain"]
    assert "flight-uncertain" in list_warning_codes(suggestion)
    listed = run_json("info", str(file))["flights"][0]
    assert (listed["source"], listed["start"]) == (
        "contact-force",
        suggestion["flight"]["start"],
    )
    in_load = run_json("suggest", "--td", "0.1", "--exit-zero", str(file))
    assert "the contact force shows no free flight at td = 0.1" in str(
        in_load["warnings"]
    )


def make_pushed_momenta(*forces: ContactForce, velocity: bool = False) -> Momenta:
    """Return the momentum of a model of 2 kg under these forces and gravity."""
    momentum = sum(np.cumsum(force.impulses, axis=0) for force in forces) + np.outer(
        TIME, [0.0, 0.0, -19.62]
    )
    values = momentum[:, np.newaxis] / (2.0 if velocity else 1.0)
    return Momenta(TIME, values, None, Precision(7), (0,), velocity=velocity)


@pytest.mark.parametrize("velocity", [False, True])
@pytest.mark.parametrize("side", [1, -1])
def test_contacts_of_a_body_with_itself_do_not_end_its_flight(
    velocity: bool, side: int
) -> None:
    """Such contacts are written with the force on one side, although no external force acts."""
    ground, inner = (
        make_contact((0.0, 0.2), (0.8, 0.9)),
        make_contact((0.1, 0.6), name="with itself"),
    )
    ground_with_contact = ground._replace(impulses=side * ground.impulses)
    touches = require(
        Touches.of(
            (ground_with_contact, inner), make_pushed_momenta(ground, velocity=velocity)
        )
    )
    flight = require(touches.flight_around(0.5))
    assert flight.start == pytest.approx(0.2, abs=1.1 * STEP)
    assert flight.end == pytest.approx(0.8, abs=1.1 * STEP)
    counted = require(
        Touches.of((ground_with_contact, inner))
    )  # the momentum is unknown
    assert counted.flight_around(0.5) is None
