"""A record as seen from one td: its contents, its vibration model, and what does not depend on td."""

from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

from d2rpick.choice.answers import suggest_at, suggest_in_history
from d2rpick.choice.pair.situation import examine_td
from d2rpick.choice.question import Settings, read_reference
from d2rpick.flight.position_error import RigidBody
from d2rpick.histories.history import EXACT, History, Momenta
from d2rpick.histories.opening import Selection
from d2rpick.vibration import measures
from d2rpick.vibration.oscillator import to_mode
from tests import chain, paper
from tests.energies import (
    count_fits,
    forget,
    make_energy_history,
    read_rollover,
    require,
)
from tests.reading import read
from tests.records import make_table
from tests.relations import list_columns, make_run, write_csv

PLAIN = Settings()


def test_the_basis_is_the_best_that_can_be_relied_on() -> None:
    assert examine_td(paper.make_history(), paper.TD, PLAIN).basis == "oscillator"
    assert (
        examine_td(paper.make_history(), paper.TD, Settings(replay=False)).basis
        == "energy"
    )
    assert examine_td(chain.read_chain_history(), chain.TD_LATE, PLAIN).basis == "modal"


@pytest.mark.parametrize(
    ("amplitude", "vibrates"), [(0.0, False), (1e-9, False), (1e-3, True)]
)
def test_rounding_errors_of_a_kinetic_energy_are_no_vibration(
    tmp_path: Path, amplitude: float, vibrates: bool
) -> None:
    run = make_run(Random(1))
    kinetic = 0.3 + amplitude * run.kinetic / run.kinetic.max()
    names = write_csv(tmp_path, {**list_columns(run), "kinetic_energy": kinetic})
    history = read_reference(names, Selection()).history
    settings = Settings(after=run.load_end, landing=run.landing)
    together = examine_td(history, run.td, settings).together
    assert (together.kinetic is not None) is vibrates


@pytest.mark.slow
def test_every_model_answers_alike() -> None:
    for situation in (
        examine_td(paper.make_history(), paper.TD, PLAIN),
        examine_td(chain.read_chain_history(), chain.TD_LATE, PLAIN),
        examine_td(read_rollover(), 0.37, PLAIN),
    ):
        vibration = situation.vibration
        moments = vibration.moments(situation.settings.tolerance)
        times = moments.tr
        measured = vibration.measured(times)
        compared = measures.compared(measured)
        assert compared.size == len(moments) == vibration.reach(moments).size > 0
        assert np.all(times < situation.td)
        assert (
            (vibration.kinetic_share is None)
            == (vibration.unknown is not None)
            == (not compared.any())
        )
        # The tolerance limits the frozen-deformation error; with one mode, only if the sign is right.
        is_useful = (measured["sign_match"] > 0) | (situation.basis == "modal")
        wanted = np.where(is_useful, measured["lock_in_error"], np.inf)[compared]
        np.testing.assert_allclose(vibration.errors(times)[compared], wanted)
        assert situation.energy_td == pytest.approx(
            situation.history.energy_at(situation.td), rel=0.05
        )


def test_from_another_td_the_same_evidence_is_seen() -> None:
    situation = examine_td(paper.make_history(), paper.TD, PLAIN)
    situation_there = situation.at(paper.BETTER_TD)
    assert situation_there.evidence is situation.evidence
    assert situation_there.kinetic_share == pytest.approx(0.0, abs=1e-9)
    assert situation.at(paper.TD) is situation


@pytest.mark.parametrize("order", [(0.42, 0.3), (0.3, 0.42)])
def test_how_bodies_drift_is_known_in_the_flight_whatever_td_was_seen_before(
    order: tuple[float, float],
) -> None:
    """At 0.42, after the flight, the nearest flight is the same, but nothing flies."""
    history = read(
        ["sample_data/rollover_box.matsum"], Selection(parts=("all",))
    ).history
    settings = Settings(bodies=(RigidBody((1,)), RigidBody((2,))))
    situations = {td: examine_td(history, td, settings) for td in order}
    assert len({situation.flight[:2] for situation in situations.values()}) == 1
    open_ = {
        td: situation.bodies.unknown
        for td, situation in situations.items()
        if situation.bodies
    }
    assert open_ == {0.42: settings.bodies, 0.3: ()}


def test_a_given_oscillator_that_does_not_fit_is_not_believed() -> None:
    wrong_mode = to_mode(replace(paper.OSCILLATOR, stiffness=500e3), 6.0)
    answer = suggest_in_history(
        paper.make_history(), paper.TD, Settings(oscillator=wrong_mode)
    )
    assert answer.situation.basis == "energy"
    assert "the given oscillator does not describe the record" in require(
        answer.situation.vibration.unknown
    )
    assert (
        "the oscillator that was asked for does not describe the record at td"
        in answer.why_none
    )
    assert any(
        "the oscillator that was asked for" in note
        for c in answer.candidates
        for note in c.notes
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("history", "td"),
    [
        (paper.make_history(), paper.TD),
        (chain.read_chain_history(), chain.TD_LATE),
    ],
)
def test_what_was_found_with_another_end_of_the_load_changes_nothing(
    history: History, td: float
) -> None:
    """A plan remembers results for all flights, and only one flight has the given end of the load."""
    fresh = suggest_in_history(forget(history), td, PLAIN).candidates[:]
    history = forget(history)
    other_candidates = suggest_at(
        examine_td(history, td, Settings(after=0.6 * td))
    ).candidates[:]
    assert other_candidates != fresh
    assert suggest_at(examine_td(history, td, PLAIN)).candidates[:] == fresh


@pytest.mark.parametrize(
    ("push", "td", "given"),
    [
        # A force acts in the flight that is given, and the momentum shows another flight, later or earlier.
        ((0.0, 0.5), 0.4, {"after": 0.03}),
        ((0.0, 0.5), 0.4, {"after": 0.03, "landing": 0.45}),
        ((0.3, 1.0), 0.8, {"after": 0.31}),
        ((0.3, 1.0), 0.8, {"after": 0.31, "landing": 0.9}),
        # The flight that the momentum shows ends before td.
        ((0.5, 1.0), 0.8, {"landing": 0.9}),
        ((0.5, 1.0), 0.8, {"after": 0.1, "landing": 0.9}),
    ],
)
def test_the_vibration_in_a_given_flight_does_not_depend_on_the_flight_that_is_shown(
    push: tuple[float, float], td: float, given: dict[str, float]
) -> None:
    time = np.linspace(0.0, 1.0, 1001)
    energy = 5 + 5 * np.exp(-0.5 * time) * np.sin(30 * time) ** 2
    energy += 800 * np.clip(time - (td + 0.05), 0, 0.05)
    momentum = np.zeros((time.size, 1, 3))
    momentum[:, 0, 0] = 500 - 40 * (np.clip(time, *push) - push[0])
    whole = Momenta(time, momentum, None, EXACT, (0,), masses=np.array([10.0]))
    settings = Settings(**given)  # type: ignore[arg-type]
    denied = suggest_in_history(make_table(time, energy, whole), td, settings)
    plain = suggest_in_history(make_table(time, energy), td, settings)
    assert any("used as given" in doubt for doubt in denied.flight.doubts)
    assert denied.basis == plain.basis == "oscillator"
    assert [row.tr for row in denied.candidates] == [row.tr for row in plain.candidates]


def make_one_mode() -> History:
    """Return a load until 0.1, then one mode with white noise."""
    time = np.linspace(0.0, 1.0, 601)
    energy = np.sin(2 * np.pi * 6.3 * time) ** 2
    energy = (
        np.where(time < 0.1, 3 * np.sin(np.pi * time / 0.1) ** 2, 0.0)
        + np.exp(-time) * energy
    )
    return make_energy_history(
        energy + 0.003 * np.random.default_rng(3).standard_normal(time.size), time
    )


@pytest.mark.slow
def test_an_oscillator_that_describes_most_of_a_record_is_not_sought_again_at_another_td() -> (
    None
):
    history = make_one_mode()
    first = examine_td(history, 0.6, PLAIN, quick=True)
    fits_made = count_fits(history)
    quick = examine_td(history, 0.8, PLAIN, quick=True)
    assert count_fits(history) == fits_made
    assert quick.sees_as(first)
    anew = examine_td(forget(history), 0.8, PLAIN)
    assert (quick.basis, quick.flight) == (anew.basis, anew.flight)
    assert quick.kinetic_share == pytest.approx(anew.kinetic_share, rel=1e-9)
    assert (
        examine_td(history, 0.05, PLAIN, quick=True).evidence.span
        != first.evidence.span
    )


def test_a_quick_look_refuses_what_a_full_one_does_without_its_misfit() -> None:
    noise = make_energy_history(
        np.random.default_rng(3).random(200), np.linspace(0.0, 1.0, 200)
    )
    quick, full = (
        examine_td(noise, 0.9, Settings(after=0.5), quick=quick)
        for quick in (True, False)
    )
    assert (quick.basis, quick.flight) == (full.basis, full.flight)
    assert require(full.evidence.fit).misfit
    assert require(quick.evidence.fit).misfit is None
