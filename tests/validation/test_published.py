"""The published oscillator results: numbers, integration, exhibits, and the command that writes them."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from d2rpick.models.box_model import Parameters
from d2rpick.report.formats import PLAIN, DisplayOptions
from d2rpick.vibration.oscillator import Oscillator, Replay, State
from tests import paper
from tests.command import ENERGY, ROOT, join_wrapped_lines, read_refusal, run, run_json
from tests.json_schemas import check_by_schema
from validation.published import (
    box,
    command,
    exhibits,
    reproduction,
    saving,
    values,
)
from validation.published.drawing import draw_exhibit
from validation.published.values import MISPRINTS, integrate_replay, make_values_table

SOLVER = str(ROOT / "sample_data" / "oscillator_solver.csv")
RUN = str(ROOT / "sample_data" / "oscillator_solver_6_80.csv")
ALL = {
    exhibit.name: exhibit
    for exhibit in (
        *(make() for _, make in exhibits.list_exhibits({})),
        saving.make_saving_exhibit(),
    )
}


def test_the_oscillator_is_that_of_the_paper() -> None:
    assert values.OSCILLATOR == paper.OSCILLATOR
    assert paper.START == values.START


def test_every_number_of_the_paper_and_every_reference_value_is_met() -> None:
    rows = make_values_table()
    assert all(row.agrees for row in rows)
    assert all((row.published is None) != (row.reference is None) for row in rows)
    (read_off,) = [row for row in rows if row.published is not None]
    assert (
        read_off.published,
        round(read_off.here, 3),
        round(read_off.difference, 3),
    ) == (13.0, 12.885, -0.115)
    assert sum("40 digits" in row.source for row in rows) >= 20


def test_what_a_solver_found_is_near() -> None:
    solver = [row for row in make_values_table() if "OpenRadioss" in row.source]
    assert [abs(row.difference) < 0.006 for row in solver] == [True, True]


def test_a_wrong_number_does_not_agree() -> None:
    exact = next(row for row in make_values_table() if row.reference is not None)
    assert exact.reference is not None
    assert replace(exact, reference=exact.reference * (1 + 1e-8)).agrees is False


def test_the_better_pair_has_no_residual() -> None:
    assert values.find_pair_at_peak() == pytest.approx(
        (paper.BETTER_TR, paper.BETTER_TD), rel=1e-12
    )
    assert values.compute_residual(values.find_pair_at_peak()) < 1e-12
    assert values.compute_residual(values.PUBLISHED) == pytest.approx(0.963, abs=1e-3)


@pytest.mark.parametrize("true_states", [paper.SWITCHED_6_80, paper.SWITCHED_13_64])
def test_integration_gives_the_states_that_were_computed_with_40_digits(
    true_states: tuple[tuple[float, ...], ...],
) -> None:
    tr, td = (0.006, 0.08) if true_states is paper.SWITCHED_6_80 else (0.013, 0.064)
    rows = np.array([row for row in true_states if row[0] not in (tr, td)])
    states = integrate_replay(
        Replay(paper.OSCILLATOR, paper.START, 0.0, tr, td), rows[:, 0]
    )
    np.testing.assert_allclose(
        np.stack(states, axis=1), rows[:, 1:5], rtol=1e-9, atol=1e-11
    )


@pytest.mark.parametrize("alpha", [0.0, 7.0, 900.0])
def test_integration_and_closed_form_agree_for_any_damping_and_start(
    alpha: float,
) -> None:
    oscillator = Oscillator(stiffness=3e5, mass=20.0, frame_mass=50.0, alpha=alpha)
    replay = Replay(oscillator, State.of(0.01, -0.02, 1.0, -3.0), 0.0, 0.02, 0.05)
    time = np.linspace(0.0, 0.1, 77)
    np.testing.assert_allclose(
        integrate_replay(replay, time)[:2], replay.motion(time)[:2], rtol=0, atol=1e-9
    )


def test_integration_of_times_before_the_switch_only() -> None:
    replay = Replay(paper.OSCILLATOR, paper.START, 0.0, 0.05, 0.06)
    time = np.array([0.0, 0.01])
    np.testing.assert_allclose(
        integrate_replay(replay, time).z, replay.reference(time).z, atol=1e-11
    )


def test_the_figures_are_those_of_the_paper_and_their_columns_hold_all_they_show() -> (
    None
):
    assert [exhibit.figure for exhibit in ALL.values()] == [
        "3",
        "4",
        "5",
        "6a-d",
        "7a",
        "7b",
        "section 5",
    ]
    for exhibit in ALL.values():
        assert len({values.shape for values in exhibit.columns.values()}) <= 1
        assert exhibit.paper
        assert exhibit.found
        drawn = {
            curve.column
            for row in exhibit.panels
            for panel in row
            for curve in panel.curves
        }
        drawn |= {
            curve.x
            for row in exhibit.panels
            for panel in row
            for curve in panel.curves
            if curve.x
        }
        assert drawn <= {*exhibit.columns}


def test_velocities_and_displacements_meet_those_integrated_numerically() -> None:
    columns = ALL["motion"].columns
    for name, unit in (("z", "m"), ("y", "m"), ("vz", "mps"), ("vy", "mps")):
        away = (
            np.abs(columns["time_ms"] - 6.0) > 1e-6
        )  # at tr itself the states before and after the switch
        error = columns[f"{name}_other_{unit}"] - columns[f"{name}_closed_{unit}"]
        assert np.abs(error[away]).max() < 1e-7


def test_the_crossings_of_the_level_are_all_marked() -> None:
    (panel, near), *_ = ALL["level"].panels
    assert panel.levels[0][1] == pytest.approx(paper.ENERGY_TD)
    times = [time for time, _ in panel.points]
    assert times == pytest.approx(
        [*(time for time, _ in paper.CROSSINGS), 64.0], abs=1e-6
    )
    assert [time for _, time in near.marks] == pytest.approx([12.8852793630525, 13.0])


def test_after_td_the_better_pair_continues_the_motion_and_the_published_one_does_not() -> (
    None
):
    columns = ALL["after-td"].columns
    after_td = columns["time_ms"] > 1e3 * paper.BETTER_TD
    wanted = columns["r_free_m"][after_td]
    np.testing.assert_allclose(columns["r_better_m"][after_td], wanted, atol=1e-12)
    assert (
        np.abs(columns["r_published_m"][after_td] - wanted).max()
        > 0.5 * np.abs(wanted).max()
    )
    assert ALL["after-td"].agrees is False
    assert "92 %" in ALL["after-td"].found


def test_the_saving_is_predicted_beside_what_was_measured() -> None:
    for run_ in saving.RUNS:
        assert run_.by_cost == pytest.approx(run_.measured, abs=0.025)
    assert all(run_.by_count - run_.measured > 0.02 for run_ in saving.RUNS[:3])
    assert sorted(saving.RUNS, key=lambda run_: run_.by_cost) == sorted(
        saving.RUNS, key=lambda run_: run_.measured
    )


@pytest.mark.slow
def test_the_figures_of_the_box_say_what_a_coarse_box_does() -> None:
    coarse = Parameters(mesh=4)
    all_variants = tuple(box.list_variants(coarse))
    some_variants = (
        all_variants[0],
        all_variants[2],
        all_variants[6],
        all_variants[-1],
    )  # two runs that act after td, and two before
    assert [variant.before for variant in some_variants] == [False, False, True, True]
    exhibits_by_name = {
        exhibit.name: exhibit
        for exhibit in (make() for _, make in box.list_box_exhibits(coarse)[1:-1])
    }
    exhibits_by_name["variants"] = box.make_variants_exhibit(
        box.try_variants(some_variants)
    )
    assert [exhibit.figure for exhibit in exhibits_by_name.values()] == [
        "2a, b",
        "2c",
        "8",
        "section 4",
    ]
    assert exhibits_by_name["early"].agrees
    tr = next(
        name
        for name in exhibits_by_name["revised"].columns
        if name.startswith("droll") and "70" not in name
    )
    at_td = np.searchsorted(exhibits_by_name["revised"].columns["time_ms"], 370.0)
    assert abs(exhibits_by_name["revised"].columns[tr][at_td]) < abs(
        exhibits_by_name["revised"].columns["droll_70_deg"][at_td]
    )
    variants = exhibits_by_name["variants"].columns
    assert (
        np.ptp(variants["own_tr_ms"][:2]) < 1e-9
    )  # actions after td leave tr unchanged
    assert np.ptp(variants["own_tr_ms"][2:]) > 0.1
    assert np.ptp(variants["common_tr_ms"]) == 0
    assert exhibits_by_name["variants"].agrees
    assert (
        f"tr = {variants['common_tr_ms'][0]:.1f} ms is still acceptable in all 4"
        in exhibits_by_name["variants"].found
    )
    for exhibit in exhibits_by_name.values():
        figure = draw_exhibit(exhibit)
        assert len(figure.axes) == sum(map(len, exhibit.panels))


@pytest.mark.slow
def test_the_command_writes_figures_and_tables(tmp_path: Path) -> None:
    folder, page = tmp_path / "new" / "paper", tmp_path / "paper.html"
    sections = (
        "--section",
        "2",
        "--section",
        "3",
        "--section",
        "5",
        "--report",
        str(page),
    )
    result = run("reproduce", "--output-dir", str(folder), *sections, "--solver", RUN)
    assert result.exit_code == 0, result.stderr
    names = {path.name for path in folder.iterdir()}
    drawn = ("masses", "response", "elements", "motion", "saving")
    expected = {
        f"{name}.{form}" for name in drawn for form in ("svg", "png", "csv")
    } - {"masses.csv", "elements.csv"}
    assert names == expected | {"README.md", "table.csv"}
    assert all(misprint in join_wrapped_lines(result.stdout) for misprint in MISPRINTS)
    index = (folder / "README.md").read_text("utf-8")
    assert all(f"{name}.svg" in index for name in drawn)
    assert page.read_text("utf-8").count("<figure>") == len(drawn)
    columns = np.genfromtxt(folder / "response.csv", delimiter=",", names=True)
    np.testing.assert_array_equal(
        columns["y_13_64_m"], ALL["response"].columns["y_13_64_m"]
    )


@pytest.mark.slow
def test_a_section_has_its_own_figures_values_and_misprints_alone(
    tmp_path: Path,
) -> None:
    about = ("reproduce", "--output-dir", str(tmp_path), "--section")
    third = run_json(*about, "3")
    assert [figure["figure"] for figure in third["figures"]] == ["5", "6a-d"]
    assert {row["section"] for row in third["rows"]} == {3}
    assert {row["figure"] for row in third["rows"]} == {"6a-d"}
    assert third["misprints"] == []
    text = run(*about, "2", "--overwrite").stdout
    assert "omega_2" in text
    assert "misprints in the paper" in text
    assert "(6, 80) ms at" not in text
    assert "published pair" not in text


def test_each_value_is_printed_with_its_figure_and_once() -> None:
    figures = sorted(ALL.values(), key=lambda exhibit: exhibit.figure, reverse=True)
    made = reproduction.Reproduction(
        make_values_table(), [*figures, replace(ALL["after-td"])]
    )
    rows = [row for exhibit in figures for row in made.list_values(exhibit)]
    assert sorted(row.what for row in rows) == sorted(
        row.what for row in make_values_table()
    )
    text = reproduction.as_table(made, DisplayOptions())
    named = {row.what: text.count(f"\n{row.what} ") for row in rows}
    assert {what for what, count in named.items() if count != 1} == set()


def test_figures_are_in_the_order_of_the_paper() -> None:
    pairs = read_named_columns(SOLVER)
    made = command.make_exhibits(("2", "3", "5"), {"pairs": pairs})
    assert [exhibit.figure for exhibit in made] == ["3", "4", "5", "6a-d", "section 5"]


def test_a_verdict_has_three_kinds_and_one_for_nothing_to_compare() -> None:
    figure = ALL["level"]
    kinds = {(True, False): "yes", (False, True): "in part", (False, False): "no"}
    for (agrees, partly), verdict in kinds.items():
        assert replace(figure, agrees=agrees, partly=partly).verdict == verdict
    assert replace(figure, agrees=None).verdict == "nothing to compare"


def test_without_the_repository_a_line_says_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "validation.published", None)
    assert "reproduce needs the folder validation of the repository" in read_refusal(
        "reproduce", "--output-dir", str(tmp_path / "paper")
    )
    assert not (tmp_path / "paper").exists()


@pytest.mark.parametrize(
    "form", ["table", *(pytest.param(one, marks=pytest.mark.slow) for one in PLAIN[1:])]
)
def test_every_form_is_written(form: str, tmp_path: Path) -> None:
    written = run(
        "reproduce",
        "--section",
        "5",
        "--output-dir",
        str(tmp_path),
        "-f",
        form,
        env={"COLUMNS": "80"},
    )
    assert written.exit_code == 0, written.stderr
    assert written.stdout.strip()
    assert form != "table" or max(map(len, written.stdout.splitlines())) <= 80


@pytest.mark.slow
def test_its_files_are_the_same_every_time_and_replaced_only_when_told(
    tmp_path: Path,
) -> None:
    whole = ("reproduce", "--output-dir", str(tmp_path), "--section", "5")
    first = run_json(*whole)
    check_by_schema(first)
    assert first["better"]["residual"] < 1e-12
    contents_before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert "the file exists" in read_refusal(*whole)
    assert run(*whole, "--overwrite", "-q").exit_code == 0
    assert {
        path.name: path.read_bytes() for path in tmp_path.iterdir()
    } == contents_before
    assert {name.rpartition("/")[2] for name in first["files"]} == {*contents_before}


def test_a_folder_that_cannot_be_made_is_an_error_that_says_what_to_do(
    tmp_path: Path,
) -> None:
    (tmp_path / "file").write_text("mine")
    for path in (tmp_path / "file", tmp_path / "file" / "paper"):
        assert "the folder cannot be created" in read_refusal(
            "reproduce", "--output-dir", str(path)
        )


def test_all_states_that_were_computed_with_40_digits_are_in_the_table() -> None:
    true_values = {f"{name} of ({pair}) ms at {1e3 * row[0]:g} ms": value
             for pair, rows in (("6, 80", paper.SWITCHED_6_80), ("13, 64", paper.SWITCHED_13_64))
             for row in rows for name, value in (("z", row[1]), ("y", row[2]), ("E", row[5]))}  # fmt: skip
    assert {
        row.what: row.reference
        for row in make_values_table()
        if row.what in true_values
    } == true_values


def test_a_solver_s_table_without_its_columns_is_refused(tmp_path: Path) -> None:
    assert "reference_m" in read_refusal(
        "reproduce",
        "--output-dir",
        str(tmp_path / "paper"),
        "--section",
        "3",
        "--solver",
        ENERGY,
    )


def test_the_samples_of_the_solver_are_near_the_closed_form() -> None:
    tables = {
        kind: read_named_columns(name)
        for kind, name in (("pairs", SOLVER), ("run", RUN))
    }
    exhibits_by_name = {
        exhibit.name: exhibit
        for exhibit in (make() for _, make in exhibits.list_exhibits(tables))
    }
    pairs, motion = (
        exhibits_by_name["solver"].columns,
        exhibits_by_name["motion"].columns,
    )
    scale = np.abs(pairs["reference_solver_m"]).max()
    for name in ("published", "better"):
        assert (
            np.abs(pairs[f"{name}_solver_m"] - pairs[f"{name}_m"]).max() < 0.004 * scale
        )
    for name in ("z", "y"):
        assert (
            np.abs(motion[f"{name}_other_m"] - motion[f"{name}_closed_m"]).max()
            < 1e-4 * 0.053
        )
    assert exhibits_by_name["motion"].agrees


def read_named_columns(name: str) -> dict[str, np.ndarray]:
    """Return the columns of a sample by name."""
    rows = np.genfromtxt(name, delimiter=",", names=True)
    return {column: rows[column] for column in rows.dtype.names or ()}
