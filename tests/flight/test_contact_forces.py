"""Flight by the forces of contacts and rigid walls, and by nothing else where momenta are missing."""

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
from tests.command import ROOT, answer, codes, put
from tests.energies import sure
from tests.records import table

if TYPE_CHECKING:
    from pathlib import Path

    from d2rpick.histories.history import Samples

COMPUTED = str(ROOT / "sample_data" / "rolloverT01.gz")
TIME = np.linspace(0, 1, 401)
STEP = float(TIME[1])


def contact(
    *acts: tuple[float, float], time: Samples = TIME, name: str = "contact"
) -> ContactForce:
    """A contact that acts in these times."""
    forces = np.zeros((time.size, 3))
    for start, end in acts:
        forces[(time >= start) & (time <= end), 2] = 5.0
    return ContactForce.of_forces(name, time, forces)


def around(td: float, *forces: ContactForce) -> FreeFlight | None:
    touches = Touches.of(forces)
    return touches and touches.flight_around(td)


def without_momenta(history: History) -> History:
    """The same record, of which only energies and forces are written."""
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
    flight = sure(
        around(td, contact((0.0, load)), contact((landing, end), name="ground"))
    )
    assert load <= flight.start <= load + STEP * 1.001
    assert landing - STEP * 1.001 <= flight.end <= landing
    assert flight.end_seen
    assert np.isnan(flight.gravity)  # no force tells of it


@pytest.mark.parametrize("td", [0.1, 0.2, 0.55, 1.5])
def test_there_is_none_where_something_touches_or_nothing_is_written(td: float) -> None:
    assert around(td, contact((0.05, 0.2), (0.5, 0.6))) is None


def test_a_gap_between_two_pushes_is_too_short_for_a_flight() -> None:
    assert around(0.31, contact((0.1, 0.3), (0.32, 0.6))) is None


def test_what_always_or_never_acts_says_nothing_of_a_flight() -> None:
    """A tied contact holds parts together; a contact without a force may be that of other parts."""
    tied, idle = contact((0.0, 1.0), name="tied"), contact(name="idle")
    assert around(0.5, tied, idle) is None
    flight = sure(around(0.5, tied, idle, contact((0.0, 0.2), (0.8, 1.0))))
    assert flight.start == pytest.approx(0.2, abs=1.1 * STEP)
    assert flight.end == pytest.approx(0.8, abs=1.1 * STEP)


def test_files_that_are_written_at_different_times_are_put_together() -> None:
    coarse = np.linspace(0, 0.9, 31)
    flight = sure(
        around(0.5, contact((0.0, 0.2)), contact((0.7, 0.9), time=coarse, name="wall"))
    )
    assert flight.start == pytest.approx(0.2, abs=1.1 * STEP)
    assert 0.7 - 0.031 <= flight.end <= 0.7
    assert (
        around(0.95, contact((0.0, 0.2)), contact((0.7, 0.8), time=coarse, name="wall"))
        is None
    )


def test_forces_find_the_flights_of_a_computed_run_that_its_momenta_find() -> None:
    history = open_run([COMPUTED]).history(Selection())
    by_momenta, by_forces = (
        find_all_seen(history),
        find_all_seen(without_momenta(history)),
    )
    assert {source for source, _ in by_momenta} == {"momentum"}
    assert {source for source, _ in by_forces} == {"contact-force"}
    for (_, one), (_, other) in zip(by_momenta, by_forces, strict=True):
        assert one.start == pytest.approx(
            other.start, abs=3 * history.step
        )  # momenta leave the last push a moment
        assert one.end == pytest.approx(other.end, abs=1.01 * history.step)


def test_momenta_of_parts_come_first_since_a_contact_may_be_of_others() -> None:
    history = open_run([COMPUTED]).history(Selection())
    rattle = contact((0.2, 0.21), time=history.time, name="loose things")
    evidence = history.evidence
    of_others = Given(
        evidence.momenta, evidence.balance, evidence.masses, (*evidence.forces, rattle)
    )
    seen = find_seen_flight(replace(history, evidence=of_others), 0.205)
    assert seen.source == "momentum"
    assert seen.doubts == ()
    alone = find_seen_flight(
        replace(history, evidence=Given((), None, None, (*evidence.forces, rattle))),
        0.205,
    )
    assert alone.flight is None or alone.refusal


def crash(time: Samples) -> Samples:
    """Energy of parts that vibrate, crash into a wall whose force is not written at 0.6, and vibrate on."""
    level = np.where(time < 0.6, 1.0, np.minimum(6.0, 1 + 50 * (time - 0.6)))
    return np.asarray(level + 0.2 * np.sin(300 * time))


def with_forces(energy: Samples, *forces: ContactForce) -> History:
    return replace(table(TIME, energy), evidence=Given((), None, None, forces))


def test_a_crash_into_a_wall_whose_force_is_not_written_is_no_flight() -> None:
    history = with_forces(crash(TIME), contact((0.05, 0.3)))
    found = sure(around(0.5, *history.evidence.forces))
    assert is_deformed(history, found)
    seen = find_seen_flight(history, 0.5)
    assert seen.flight is None or seen.refusal or seen.flight.start > 0.6
    calm = with_forces(1 + 0.2 * np.sin(300 * TIME), contact((0.05, 0.3)))
    assert not is_deformed(calm, found)
    assert sure(find_seen_flight(calm, 0.5).flight).start == pytest.approx(
        0.3, abs=1.1 * STEP
    )


def test_before_any_contact_has_ended_forces_alone_show_no_flight() -> None:
    """A load of another kind may act from the start on, which only the external work shows."""
    history = with_forces(0.4 + 0.2 * np.sin(300 * TIME), contact((0.8, 0.85)))
    assert sure(find_seen_flight(history, 0.6).refusal).startswith(
        "the contact force shows no free flight at td = 0.6"
    )
    work = Balance(TIME, internal=history.energy, external_work=np.zeros_like(TIME))
    known = replace(history, evidence=Given((), work, None, history.evidence.forces))
    assert sure(find_seen_flight(known, 0.6).flight).start == 0


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
    found = answer("suggest", "--td", "0.6", str(file))
    assert found["flight"]["source"] == "contact-force"
    assert found["flight"]["start"] == pytest.approx(0.2, abs=1.1 * STEP)
    assert found["flight"]["end"] == pytest.approx(0.8, abs=1.1 * STEP)
    assert not found["flight"]["certain"]
    assert "flight-uncertain" in codes(found)
    listed = answer("info", str(file))["flights"][0]
    assert (listed["source"], listed["start"]) == (
        "contact-force",
        found["flight"]["start"],
    )
    in_load = answer("suggest", "--td", "0.1", "--exit-zero", str(file))
    assert "the contact force shows no free flight at td = 0.1" in str(
        in_load["warnings"]
    )


def pushed(*forces: ContactForce, velocity: bool = False) -> Momenta:
    """Momentum of a model of 2 kg on which these forces work, and gravity."""
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
    """They are written with a force of one side, although none acts from outside."""
    ground, inner = (
        contact((0.0, 0.2), (0.8, 0.9)),
        contact((0.1, 0.6), name="with itself"),
    )
    told = ground._replace(impulses=side * ground.impulses)
    touches = sure(Touches.of((told, inner), pushed(ground, velocity=velocity)))
    flight = sure(touches.flight_around(0.5))
    assert flight.start == pytest.approx(0.2, abs=1.1 * STEP)
    assert flight.end == pytest.approx(0.8, abs=1.1 * STEP)
    counted = sure(Touches.of((told, inner)))  # of an unknown momentum
    assert counted.flight_around(0.5) is None
