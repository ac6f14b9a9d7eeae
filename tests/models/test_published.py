"""The published oscillator results: numbers, integration, exhibits, and the command that writes them."""

from __future__ import annotations

import json
from dataclasses import fields
from importlib.resources import files
from typing import TYPE_CHECKING

import jsonschema
import numpy as np
import pytest

from d2rpick.models import published
from d2rpick.models.published import MISPRINTS, Row, table
from d2rpick.models.published_figures import Exhibit, exhibits
from d2rpick.vibration.integration import integrated
from d2rpick.vibration.oscillator import Oscillator, State
from d2rpick.vibration.replay import Replay
from tests import paper
from tests.command import ENERGY, ROOT, answer, run

if TYPE_CHECKING:
    from pathlib import Path

SOLVER = str(ROOT / "sample_data" / "oscillator_solver.csv")
ALL = {exhibit.name: exhibit for exhibit in exhibits()}


def test_the_oscillator_is_that_of_the_paper() -> None:
    assert published.OSCILLATOR == paper.OSCILLATOR
    assert paper.START == published.START


def test_every_independent_number_is_met_and_the_plot_was_read_roughly() -> None:
    rows = table()
    assert {row.agrees for row in rows} == {True, None}
    assert sum(row.agrees is True for row in rows) >= 20
    (read_off,) = [row for row in rows if "plot" in row.source]
    assert (read_off.published, round(read_off.here, 3), round(read_off.difference, 3)) == (13.0, 12.885, -0.115)


def test_what_a_solver_found_is_near() -> None:
    solver = [row for row in table() if "OpenRadioss" in row.source]
    assert [abs(row.difference) < 0.006 for row in solver] == [True, True]


def test_a_wrong_number_does_not_agree() -> None:
    exact = next(row for row in table() if row.agrees)
    assert Row(exact.what, exact.unit, exact.published * (1 + 1e-8), exact.here, exact.source).agrees is False


def test_the_better_pair_has_no_residual() -> None:
    assert published.better_pair() == pytest.approx((paper.BETTER_TR, paper.BETTER_TD), rel=1e-12)
    assert published.residual(published.better_pair()) < 1e-12
    assert published.residual(published.PUBLISHED) == pytest.approx(0.963, abs=1e-3)


@pytest.mark.parametrize("known", [paper.SWITCHED_6_80, paper.SWITCHED_13_64])
def test_integration_gives_the_states_that_were_computed_with_40_digits(known: tuple[tuple[float, ...], ...]) -> None:
    tr, td = (0.006, 0.08) if known is paper.SWITCHED_6_80 else (0.013, 0.064)
    rows = np.array([row for row in known if row[0] not in (tr, td)])
    found = integrated(Replay(paper.OSCILLATOR, paper.START, 0.0, tr, td), rows[:, 0])
    np.testing.assert_allclose(np.stack(found, axis=1), rows[:, 1:5], rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("alpha", [0.0, 7.0, 900.0])
def test_integration_and_closed_form_agree_for_any_damping_and_start(alpha: float) -> None:
    oscillator = Oscillator(stiffness=3e5, mass=20.0, frame_mass=50.0, alpha=alpha)
    replay = Replay(oscillator, State.of(0.01, -0.02, 1.0, -3.0), 0.0, 0.02, 0.05)
    time = np.linspace(0.0, 0.1, 77)
    np.testing.assert_allclose(integrated(replay, time)[:2], replay.motion(time)[:2], rtol=0, atol=1e-9)


def test_integration_of_times_before_the_switch_only() -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, 0.05, 0.06)
    time = np.array([0.0, 0.01])
    np.testing.assert_allclose(integrated(replay, time).z, replay.reference(time).z, atol=1e-11)


def test_the_exhibits_are_those_of_the_paper_and_their_columns_hold_all_they_show() -> None:
    assert list(ALL) == ["displacement", "integration", "choice"]
    for exhibit in ALL.values():
        assert {values.shape for values in exhibit.columns.values()} == {published.TIME.shape}
        drawn = {curve.column for row in exhibit.panels for panel in row for curve in panel.curves}
        assert drawn <= {*exhibit.columns}
    assert np.abs(ALL["integration"].columns["z_difference_m"]).max() < 1e-11


def test_the_level_is_that_at_td_and_the_better_pair_continues_the_motion() -> None:
    (energies, _), columns = ALL["choice"].panels, ALL["choice"].columns
    assert [panel.levels[0][1] for panel in energies] == pytest.approx([paper.ENERGY_TD, paper.PEAKS[5][1]])
    after = columns["time_ms"] > 1e3 * paper.BETTER_TD
    wanted = columns["deformation_free_m"][after]
    np.testing.assert_allclose(columns["deformation_better_m"][after], wanted, atol=1e-12)
    assert np.abs(columns["deformation_published_m"][after] - wanted).max() > 0.5 * np.abs(wanted).max()


def test_the_command_writes_figures_and_tables(tmp_path: Path) -> None:
    place = tmp_path / "new" / "paper"
    result = run("reproduce", "--output-dir", str(place), "--solver", SOLVER)
    assert result.exit_code == 0, result.stderr
    names = {path.name for path in place.iterdir()}
    expected = {f"{name}.{form}" for name in (*ALL, "solver") for form in ("svg", "png", "csv")}
    assert names == expected | {"README.md", "table.csv"}
    assert all(misprint in result.stdout for misprint in MISPRINTS)
    index = (place / "README.md").read_text("utf-8")
    assert all(f"{name}.svg" in index for name in (*ALL, "solver"))
    columns = np.genfromtxt(place / "integration.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(columns["z_closed_m"], ALL["integration"].columns["z_closed_m"])


def test_its_files_are_the_same_every_time_and_replaced_only_when_told(tmp_path: Path) -> None:
    first = answer("reproduce", "--output-dir", str(tmp_path))
    jsonschema.validate(first, json.loads(files("d2rpick").joinpath("schemas/reproduce-1.json").read_text("utf-8")))
    assert first["better"]["residual"] < 1e-12
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    refused = run("reproduce", "--output-dir", str(tmp_path))
    assert refused.exit_code == 2
    assert "the file exists" in refused.stderr
    assert run("reproduce", "--output-dir", str(tmp_path), "--overwrite", "-q").exit_code == 0
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert {name.rpartition("/")[2] for name in first["files"]} == {*before}


def test_a_folder_that_cannot_be_made_is_an_error_that_says_what_to_do(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for place in (tmp_path / "file", tmp_path / "file" / "paper"):
        result = run("reproduce", "--output-dir", str(place))
        assert result.exit_code == 2
        assert "the folder cannot be created" in result.stderr


def test_all_states_that_were_computed_with_40_digits_are_in_the_table() -> None:
    known = {f"{name} of ({pair}) ms at {1e3 * row[0]:g} ms": value
             for pair, rows in (("6, 80", paper.SWITCHED_6_80), ("13, 64", paper.SWITCHED_13_64))
             for row in rows for name, value in (("z", row[1]), ("y", row[2]), ("E", row[5]))}  # fmt: skip
    assert {row.what: row.published for row in table() if row.what in known} == known


def test_a_solver_s_table_without_its_columns_is_refused(tmp_path: Path) -> None:
    result = run("reproduce", "--output-dir", str(tmp_path / "paper"), "--solver", ENERGY)
    assert result.exit_code == 2
    assert "reference_m" in result.stderr


def test_the_sample_of_the_solver_is_near_the_closed_form() -> None:
    rows = np.genfromtxt(SOLVER, delimiter=",", names=True)
    shown = exhibits({name: rows[name] for name in rows.dtype.names or ()})[-1]
    assert isinstance(shown, Exhibit)
    assert {field.name for field in fields(shown)} >= {"columns", "panels"}
    scale = np.abs(shown.columns["reference_solver_m"]).max()
    for name in ("published", "better"):
        error = np.abs(shown.columns[f"{name}_solver_m"] - shown.columns[f"{name}_m"]).max()
        assert error < 0.004 * scale
