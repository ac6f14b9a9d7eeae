"""Validation of residuals by the motion of all nodes: decks, measures, and the results shown in the docs."""

import gzip
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

import d2rpick
from d2rpick.deck import read_inventory
from d2rpick.vibration.midpoint import Reading
from tests.command import ROOT
from validation import vibration
from validation.figures import RESULTS, find_absorbing_parts, read_results
from validation.frame_deck import PARTS, Landing, mesh_frame, write_deck
from validation.landing import Course, compare_landings
from validation.nodes import (
    Motion,
    Nodes,
    compare_vibration,
    compute_vibration_energy,
    read_nodes,
    remove_rigid_motion,
)

NODES = Nodes(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [1, 1, 1]]),
    np.array([1.0, 2, 3, 4, 5]),
)
TIMES = np.linspace(0.0, 1.0, 7)
VECTORS = arrays(float, 3, elements=st.floats(-5, 5, allow_nan=False))
SWITCHED = read_results("vibration")[~np.isnan(read_results("vibration")["tr_s"])]
TOTALS = SWITCHED[SWITCHED["energy"] == "total"]
PARTS_OF_LANDING = find_absorbing_parts(SWITCHED)
DOCS = (ROOT / "docs/explanation/validation-vibration.md").read_text("utf-8")


def move_nodes(velocities: np.ndarray) -> Motion:
    """Return nodes at their positions with constant velocities."""
    return Motion(
        TIMES,
        *(
            np.broadcast_to(values, (TIMES.size, *values.shape))
            for values in (NODES.places, velocities)
        ),
    )


@given(VECTORS, VECTORS)
def test_a_rigid_motion_has_no_vibration(
    translation: np.ndarray, spin: np.ndarray
) -> None:
    velocities = translation + np.cross(spin, NODES.places)
    np.testing.assert_allclose(
        remove_rigid_motion(move_nodes(velocities), NODES), 0.0, atol=1e-12
    )


@given(arrays(float, (5, 3), elements=st.floats(-5, 5)), VECTORS, VECTORS)
def test_what_is_left_has_no_momentum_and_does_not_depend_on_the_rigid_motion(
    velocities: np.ndarray, translation: np.ndarray, spin: np.ndarray
) -> None:
    vibration_velocities = remove_rigid_motion(move_nodes(velocities), NODES)
    np.testing.assert_allclose(
        np.einsum("n,tnx->tx", NODES.masses, vibration_velocities), 0.0, atol=1e-10
    )
    angular = np.einsum(
        "n,tnx->tx", NODES.masses, np.cross(NODES.places, vibration_velocities)
    )
    np.testing.assert_allclose(angular, 0.0, atol=1e-10)
    faster = move_nodes(velocities + translation + np.cross(spin, NODES.places))
    np.testing.assert_allclose(
        remove_rigid_motion(faster, NODES), vibration_velocities, atol=1e-10
    )


@pytest.mark.parametrize(
    ("factor", "residual", "correlation"),
    [(1.0, 0.0, 1.0), (-1.0, 2.0, -1.0), (0.5, 0.5, 1.0)],
)
def test_a_scaled_vibration_has_the_residual_of_its_factor(
    factor: float, residual: float, correlation: float
) -> None:
    velocities = np.random.default_rng(47).normal(size=(5, 3))
    comparison = compare_vibration(
        move_nodes(velocities), move_nodes(factor * velocities + (1.0, 2.0, 3.0)), NODES
    )
    assert comparison == pytest.approx((residual, correlation), abs=1e-12)


def test_the_vibration_energy_is_twice_the_kinetic_energy_without_the_rigid_motion() -> (
    None
):
    stretching = np.zeros((5, 3))
    stretching[1], stretching[0] = (
        (1.0, 0.0, 0.0),
        (-2.0, 0.0, 0.0),
    )  # on one line, with no momentum
    assert compute_vibration_energy(
        move_nodes(stretching + np.array([0.0, 0.0, 7.0])), NODES
    ) == pytest.approx(1 * 4 + 2 * 1)


def test_a_landing_compared_with_itself_differs_in_nothing_and_one_with_more_energy_does() -> (
    None
):
    energies = np.linspace([0.0, 0.0], [10.0, 20.0], 50)
    course = Course(0.1, energies, np.zeros(2), np.array([0.0, 0.0, 3.0]), NODES.places)
    same = compare_landings(course, course, ["parts"], NODES)
    assert same[1:] == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-5)
    assert all(
        difference[:3] == (0.0, 0.0, 0.0) for difference in same.energies.values()
    )
    harder = course._replace(
        landing=0.2,
        energies=1.1 * energies,
        impulse=2 * course.impulse,
        places=NODES.places + 1,
    )
    comparison = compare_landings(course, harder, ["parts"], NODES)
    assert comparison[1:] == pytest.approx((0.1, 1.0, 3**0.5, 0.0), abs=1e-5)
    assert comparison.energies["parts"] == pytest.approx(
        (0.058, 0.1, 0.09, 10.0), abs=1e-3
    )


def test_the_frame_is_read_with_the_mass_of_its_cards_and_all_its_nodes(
    tmp_path: Path,
) -> None:
    deck = tmp_path / "FRAME_0000.rad"
    deck.write_text(write_deck(Landing(2.5, 0.1)))
    inventory = read_inventory(str(deck))
    assert [part.title for part in inventory.parts.values()] == [*PARTS, "ground"]
    nodes = read_nodes(deck)
    assert len(nodes.places) == len(mesh_frame().places)
    beams = 4 * (0.66 + 0.38 + 0.50) * 3.25e-4 * 7850
    plates = 0.05**2 * 8e4 * (7 * 0.010 + 0.022)
    feet = 4 * 4 * 0.05 * 0.075 * 0.0012 * 7850
    assert nodes.masses.sum() == pytest.approx(beams + plates + feet, rel=1e-6)
    assert (nodes.masses > 0).all()
    ground = inventory.coordinates[inventory.nodes_by_part[5]]
    assert nodes.places[:, 2].min() - ground[:, 2].max() == pytest.approx(
        2.5 * 0.1 + 1e-3
    )


def test_the_rollover_is_switched_whole_and_writes_all_its_nodes(
    tmp_path: Path,
) -> None:
    deck = tmp_path / "ROLL_0000.rad"
    deck.write_bytes(vibration.CASES["ROLL"].model.deck())
    plain = tmp_path / "plain" / "ROLL_0000.rad"
    plain.parent.mkdir()
    plain.write_bytes(
        gzip.decompress(
            (ROOT / "validation" / "decks" / "ROLL_0000.rad.gz").read_bytes()
        )
    )
    whole, box = (read_inventory(str(path)) for path in (deck, plain))
    assert [body for body in box.ready if body] == [{1}, {3}]
    assert [body for body in whole.ready if body] == [{1, 2}, {3}]
    nodes_of_parts = np.union1d(whole.nodes_by_part[1], whole.nodes_by_part[2])
    np.testing.assert_array_equal(np.sort(whole.watched), nodes_of_parts)


@pytest.mark.parametrize(
    ("name", "group", "mass"), [("CAR", 4, 856.32075), ("ROLL", 2, 409.77001)]
)
def test_the_nodes_have_the_mass_that_the_solver_gives_the_switched_parts(
    tmp_path: Path, name: str, group: int, mass: float
) -> None:
    deck = tmp_path / f"{name}_0000.rad"
    deck.write_bytes(vibration.watch_all_nodes(name, group, 1e-4).deck())
    nodes = read_nodes(deck)
    assert nodes.masses.sum() == pytest.approx(mass, rel=1e-6)
    assert (nodes.masses > 0).all()


def test_without_the_solver_the_study_is_skipped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("OPENRADIOSS_PATH", raising=False)
    monkeypatch.setattr(sys, "argv", ["vibration", "nowhere"])
    vibration.main()
    assert capsys.readouterr().out == "skipped: OPENRADIOSS_PATH is not set\n"


def test_every_residual_of_the_nodes_is_near_the_predicted_one() -> None:
    differences = np.abs(TOTALS["R_predicted"] - TOTALS["R_nodes"])
    assert differences[np.char.startswith(TOTALS["case"], "FRAME")].max() < 0.0125
    assert differences[TOTALS["case"] == "ROLL"].max() < 0.045


@pytest.mark.parametrize(
    ("case", "best", "accuracy"),
    [("FRAME", 0.3, 0.022), pytest.param("ROLL", 0.65, 0.073, marks=pytest.mark.slow)],
)
def test_the_histories_of_the_references_give_the_residuals_of_the_nodes(
    case: str, best: float, accuracy: float
) -> None:
    """The accuracy is that on the validation page; no residual from the nodes exceeds the upper bound."""
    reference = d2rpick.read(RESULTS / f"{case.lower()}_reference.csv")
    rows = TOTALS[TOTALS["case"] == case]
    for row in rows:
        verdict = d2rpick.verify(
            reference, tr=float(row["tr_s"]), td=float(row["td_s"])
        ).to_dict()
        assert verdict["basis"] == "modal"
        assert verdict["residual"] == pytest.approx(row["R_nodes"], abs=accuracy)
        assert row["R_nodes"] <= verdict["residual_high"]
    chosen = d2rpick.suggest(reference).recommended
    assert chosen is not None
    assert chosen.residual is not None
    assert chosen.residual < best


def predict_residual_of_nodes(
    reading: Reading, tr: float, td: float, end: float
) -> float:
    """Return R of the velocities of all nodes from ``td`` to ``end`` [time], as predicted by the lines of the energy.

    Each line gives the energy of its mode and the phase, but for the sign of the mode, which both runs share.
    """
    modes = reading.modes
    lines_at_td = modes.weights * modes.waves(td)
    size, phase = np.sqrt(2 * np.abs(lines_at_td)), np.angle(lines_at_td) / 2
    rate, decay = modes.poles.imag / 2, -modes.poles.real / 2
    at_tr = size * np.exp(decay * (td - tr)) * np.cos(phase - rate * (td - tr))
    lost_deformation, lost_velocity = at_tr - size * np.cos(phase), size * np.sin(phase)
    after = np.linspace(0.0, end - td, 400)[:, np.newaxis]
    kept = np.exp(-decay * after)
    error = lost_velocity * np.cos(rate * after) - lost_deformation * np.sin(
        rate * after
    )
    reference = size * np.sin(phase + rate * after)
    energies = [np.sum((kept * speed) ** 2) for speed in (error, reference)]
    return float(np.sqrt(energies[0] / energies[1]))


@pytest.mark.parametrize(
    ("case", "accuracy"),
    [pytest.param("ROLL", 0.028, marks=pytest.mark.slow), ("FRAME", 0.022)],
)
def test_the_residuals_of_the_nodes_up_to_the_landing_follow_from_the_lines(
    case: str, accuracy: float
) -> None:
    """In 9 ms, less than a period of the slowest modes, velocities have another R than the energies have at td."""
    reference = d2rpick.read(RESULTS / f"{case.lower()}_reference.csv")
    for row in TOTALS[TOTALS["case"] == case]:
        tr, td = float(row["tr_s"]), float(row["td_s"])
        situation = d2rpick.verify(reference, tr=tr, td=td).situation
        modal, landing = situation.vibration.modal, situation.flight.end
        assert modal is not None
        assert landing is not None
        predicted = predict_residual_of_nodes(modal.reading, tr, td, landing)
        assert predicted == pytest.approx(row["R_nodes"], abs=accuracy)


def test_energies_after_the_landing_differ_with_the_root_of_the_worth_as_the_docs_say() -> (
    None
):
    root = np.sqrt(TOTALS["worth"])
    assert (TOTALS["rms"] <= 0.31 * root).all()
    assert (np.abs(TOTALS["peak"]) <= 0.52 * root).all()
    parts = SWITCHED[PARTS_OF_LANDING]
    assert (parts["rms"] <= 1.6 * np.sqrt(parts["worth"])).all()
    for limit, rms, peak in ((0.01, 0.0205, 0.04), (0.05, 0.0605, 0.1005)):
        below = TOTALS[TOTALS["worth"] < limit]
        assert (below["rms"].max() < rms, np.abs(below["peak"]).max() < peak) == (
            True,
            True,
        )
    compared_runs = TOTALS[~np.isnan(TOTALS["R_predicted"])]
    assert (compared_runs["R_nodes"] <= compared_runs["R_high"]).all()


def test_the_docs_show_what_differs_after_the_landing_by_the_worth() -> None:
    number = r"([\d.]+) to ([\d.]+)"
    rows = re.findall(
        rf"^\| {number} % \| (\d) \| {' [|] '.join([number] * 5)} \|$",
        DOCS,
        re.MULTILINE,
    )
    assert len(rows) == 5
    for low, high, count, *ranges in rows:
        inside = (100 * TOTALS["worth"] >= float(low)) & (
            100 * TOTALS["worth"] < float(high)
        )
        totals = TOTALS[inside]
        assert int(count) == len(totals)
        worst = [
            SWITCHED["rms"][PARTS_OF_LANDING & (SWITCHED["worth"] == worth)].max()
            for worth in totals["worth"]
        ]
        columns = [
            totals["rms"],
            np.abs(totals["peak"]),
            np.array(worst),
            totals["impulse"],
            10 * totals["place_m"],
        ]
        wanted = [
            100 * limit for column in columns for limit in (column.min(), column.max())
        ]
        assert [float(limit) for limit in ranges] == pytest.approx(wanted, abs=0.051)


def test_the_docs_show_the_residuals_of_the_results() -> None:
    number = r"\**([-+]?[\d.]+)\**"
    rows = re.findall(rf"^\| `(ROLL|FRAME)`.*\| {number}, {number} \| [\d.]+ \| {number} \| {number} \| {number} \|$",
                      DOCS, re.MULTILINE)  # fmt: skip
    assert len(rows) == 9
    for case, *texts in rows:
        tr, td, *values = map(float, texts)
        near = (np.abs(1e3 * TOTALS["tr_s"] - tr) < 1e-3) & (
            np.abs(1e3 * TOTALS["td_s"] - td) < 1e-3
        )
        (row,) = TOTALS[(TOTALS["case"] == case) & near]
        assert values == pytest.approx(
            [row[name] for name in ("R_predicted", "R_nodes", "correlation")], abs=6e-3
        )


def test_the_mean_energies_of_the_frame_lie_in_the_announced_interval() -> None:
    inside = (TOTALS["mean_energy_low"] <= TOTALS["mean_energy"]) & (
        TOTALS["mean_energy"] <= TOTALS["mean_energy_high"]
    )
    assert inside[np.char.startswith(TOTALS["case"], "FRAME")].all()
    box = TOTALS[TOTALS["case"] == "ROLL"]
    too_narrow = np.maximum(
        box["mean_energy_low"] - box["mean_energy"],
        box["mean_energy"] - box["mean_energy_high"],
    )
    assert too_narrow.max() < 0.0035
