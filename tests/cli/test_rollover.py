"""The command ``rollover``: its files are read back, scans in every format, figures, refusals."""

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.lines import Line2D

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import BoxWindow, Outcome, make_history, simulate
from d2rpick.report import figures_models
from d2rpick.report.formats import DisplayOptions, write
from d2rpick.report.rollover import Scan
from tests.command import list_warning_codes, run
from tests.json_schemas import check_by_schema

SMALL = ("--mesh", "4", "--dt", "5e-4")
SHORT = (*SMALL, "--t-end", "0.12")
SCAN = (
    "rollover",
    "--scan",
    "--jobs",
    "1",
    "--mesh",
    "4",
    "--dt",
    "1e-3",
    "--t-end",
    "0.11",
)
COLUMNS = (
    "time,x,z,roll,vx,vz,omega,internal_energy,kinetic_energy,momentum_x,momentum_z,step_internal_energy,"
    "step_kinetic_energy,contact_energy,frictional_contact_energy,stonewall_energy,damping_energy,external_work,"
    "total_energy,energy_ratio"
)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["run.csv", "run.h5", "run.glstat", "run.matsum"])
def test_every_format_is_read_back_with_the_energies_of_the_run(
    name: str, tmp_path: Path
) -> None:
    table = np.genfromtxt(
        io.StringIO(run("rollover", *SHORT).stdout), delimiter=",", names=True
    )
    assert ",".join(table.dtype.names or ()) == COLUMNS
    file = tmp_path / name
    assert run("rollover", *SHORT, "-o", str(file)).exit_code == 0
    part = ("--part", "box") if name.endswith("matsum") else ()
    table_read = np.genfromtxt(
        io.StringIO(run("extract", *part, str(file)).stdout), delimiter=",", names=True
    )
    np.testing.assert_allclose(table_read["time"], table["time"], rtol=1e-4)
    step = (
        10.0 if name.endswith("glstat") else 1e-3
    )  # the glstat includes the energy of the step
    np.testing.assert_allclose(
        table_read["internal_energy"], table["internal_energy"], rtol=1e-3, atol=step
    )


@pytest.mark.slow
def test_a_switched_run_is_rigid_in_between_and_differs_after_it(
    tmp_path: Path,
) -> None:
    texts = [
        run("rollover", *SMALL, *window).stdout
        for window in ((), ("--tr", "0.1", "--td", "0.2"))
    ]
    whole, switched = (
        np.genfromtxt(io.StringIO(text), delimiter=",", names=True) for text in texts
    )
    time = whole["time"]
    before_tr = time < 0.1 - 1e-6
    np.testing.assert_array_equal(switched[before_tr], whole[before_tr])
    rigid = (time > 0.101) & (time < 0.199)
    assert np.ptp(switched["internal_energy"][rigid]) < 1e-9
    assert np.ptp(switched["internal_energy"][time > 0.2]) > 0.1
    plot = tmp_path / "motion.svg"
    assert (
        run(
            "rollover", *SMALL, "--tr", "0.1", "--td", "0.2", "--plot", str(plot)
        ).stdout
        == ""
    )
    assert b"<svg" in plot.read_bytes()


def test_a_box_that_falls_is_switched_in_several_windows(tmp_path: Path) -> None:
    file = tmp_path / "tumbling.csv"
    windows = ("--tr", "0", "--td", "0.28", "--tr", "0.42", "--td", "0.5")
    assert (
        run(
            "rollover",
            *SMALL,
            "--drop",
            "0.4",
            "--tilt",
            "40",
            *windows,
            "-o",
            str(file),
        ).stderr
        == ""
    )
    table = np.genfromtxt(file, delimiter=",", names=True)
    time, energy = table["time"], table["internal_energy"]
    assert time[-1] == pytest.approx(1.2)
    for tr, td in ((0, 0.28), (0.42, 0.5)):
        assert np.ptp(energy[(time > tr + 1e-3) & (time < td - 1e-3)]) < 1e-9
    assert energy[(time > 0.29) & (time < 0.42)].max() > 1
    total = (
        table["internal_energy"]
        + table["kinetic_energy"]
        + table["step_internal_energy"]
    )
    total += (
        table["step_kinetic_energy"]
        + table["contact_energy"]
        + table["stonewall_energy"]
    )
    np.testing.assert_allclose(
        total + table["damping_energy"], table["total_energy"], atol=1e-6
    )


def test_the_figure_of_a_motion_superposes_the_outlines_of_both_runs() -> None:
    window = BoxWindow(0.05, 0.2)
    reference, switched = (
        simulate(Parameters(mesh=4), 0.25, *rigid, interval=5e-4)
        for rigid in ((), (window,))
    )
    figure = figures_models.draw_rollover(
        Parameters(mesh=4), reference, switched, (window,)
    )
    outlines, roll, roll_off, height, height_off = figure.axes
    drawn = [list_points(line) for line in outlines.lines]
    assert set(drawn[0][:, 1]) == {-Parameters().ground}
    boxes = [outline for outline in drawn if len(outline) > 2]
    assert len(boxes) == 16
    np.testing.assert_array_equal(boxes[8][0], boxes[8][-1])
    assert len(outlines.patches) == 4  # ground and curb, at the start and at the end
    assert [text.get_text() for text in outlines.texts][0::7] == ["0", "250"]
    for axes in (roll, height):
        labels = axes.get_legend_handles_labels()[1]
        assert labels == ["without switching", "switched", "rigid", "sled pushed last"]
    differences = (
        np.degrees(switched.roll - reference.roll),
        1e3 * (switched.centre - reference.centre).imag,
    )
    wanted = (np.degrees(switched.roll), reference.centre.imag, *differences)
    for line, values in zip(
        (roll.lines[1], height.lines[0], roll_off.lines[0], height_off.lines[0]),
        wanted,
        strict=True,
    ):
        np.testing.assert_allclose(list_points(line)[:, 1], values)


def list_points(line: Line2D) -> np.ndarray:
    """Return the points of a drawn line."""
    return np.asarray(line.get_xydata(), dtype=np.float64)


@pytest.mark.slow
def test_a_scan_gives_one_answer_in_every_form(tmp_path: Path) -> None:
    plot = tmp_path / "scan.png"
    document = json.loads(
        run(*SCAN, "--td", "0.1", "-q", "-f", "json", "--plot", str(plot)).stdout
    )
    check_by_schema(document)
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert document["recommended"] in [one_run["tr"] for one_run in document["runs"]]
    reference = simulate(Parameters(mesh=4), 0.11, interval=1e-3)
    chosen = suggest_in_history(make_history(reference), 0.1, Settings())
    scanned = Scan(
        reference,
        [Outcome(**one_run) for one_run in document["runs"]],
        chosen,
        chosen.cautions,
    )
    assert (
        json.loads(write("rollover", "json", scanned, DisplayOptions()))["runs"]
        == document["runs"]
    )
    rows = csv.DictReader(
        io.StringIO(write("rollover", "csv", scanned, DisplayOptions()))
    )
    assert [
        {name: float(cell) for name, cell in row.items()} for row in rows
    ] == document["runs"]
    assert write("rollover", "markdown", scanned, DisplayOptions()).startswith("| tr |")
    text = write("rollover", "table", scanned, DisplayOptions())
    assert "next contact: none before the end of the run\n" in text
    assert "\n* " in text
    assert f"recommended  tr = {document['recommended']:.6g}" in text


@pytest.mark.slow
def test_a_scan_whose_td_lies_in_the_load_says_so() -> None:
    result = run(*SCAN, "--td", "0.06", "-f", "json")
    messages = {line.split(": ")[1] for line in result.stderr.splitlines()}
    assert "no-free-flight" in messages
    assert list_warning_codes(json.loads(result.stdout)) == messages


@pytest.mark.slow
def test_a_scan_at_whose_td_nothing_can_be_recommended_says_so() -> None:
    arguments = (*SCAN, "--td", "0.04")
    table, plain = run(*arguments, "-q", "--exit-zero"), run(*arguments, "-f", "json")
    assert table.stdout.endswith("\n\nrecommended  none\n")
    assert (table.exit_code, plain.exit_code) == (0, 1)
    document = json.loads(plain.stdout)
    assert document["recommended"] is None
    assert "no-candidate" in list_warning_codes(document)


def test_a_run_that_does_not_balance_its_energy_says_so() -> None:
    assert (
        "warning: energy-balance:" in run("rollover", *SHORT, "--damping", "300").stderr
    )
    assert run("rollover", *SHORT).stderr == ""
