"""The command ``rollover``: what it writes is read back, scans in every form, figures, refusals."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from importlib.resources import files
from typing import TYPE_CHECKING

import jsonschema
import numpy as np
import pytest

from d2rpick.models.rollover.model import Parameters
from d2rpick.models.rollover.run import Window, simulate
from d2rpick.report import figures
from tests.command import ROOT, answer, codes, run

if TYPE_CHECKING:
    from pathlib import Path

SMALL = ("--mesh", "4", "--dt", "2e-4")
SHORT = (*SMALL, "--t-end", "0.12")
COLUMNS = "time,x,z,roll,vx,vz,omega,internal_energy,kinetic_energy,momentum_x,momentum_z"


@pytest.mark.parametrize("name", ["run.csv", "run.h5", "run.glstat", "run.matsum"])
def test_every_format_is_read_back_with_the_energies_of_the_run(name: str, tmp_path: Path) -> None:
    table = np.genfromtxt(io.StringIO(run("rollover", *SHORT).stdout), delimiter=",", names=True)
    assert ",".join(table.dtype.names or ()) == COLUMNS
    file = tmp_path / name
    assert run("rollover", *SHORT, "-o", str(file)).exit_code == 0
    part = ("--part", "box") if name.endswith("matsum") else ()
    read = np.genfromtxt(io.StringIO(run("extract", *part, str(file)).stdout), delimiter=",", names=True)
    np.testing.assert_allclose(read["time"], table["time"], rtol=1e-4)
    step = 10.0 if name.endswith("glstat") else 1e-3  # the glstat has the energy of the step as well
    np.testing.assert_allclose(read["internal_energy"], table["internal_energy"], rtol=1e-3, atol=step)


def test_the_parts_of_a_matsum_tell_when_they_fly(tmp_path: Path) -> None:
    file = tmp_path / "run.matsum"
    run("rollover", *SMALL, "-o", str(file))
    (flight,) = answer("info", str(file))["flights"]
    assert [part["title"] for part in flight["parts"]] == ["box", "step"]
    assert flight["start"] == pytest.approx(0.086, abs=0.003)


def test_a_switched_run_is_rigid_in_between_and_differs_after_it(tmp_path: Path) -> None:
    texts = [run("rollover", *SMALL, *window).stdout for window in ((), ("--tr", "0.1", "--td", "0.2"))]
    whole, switched = (np.genfromtxt(io.StringIO(text), delimiter=",", names=True) for text in texts)
    time = whole["time"]
    np.testing.assert_array_equal(switched[time < 0.1], whole[time < 0.1])
    rigid = (time > 0.101) & (time < 0.199)
    assert np.ptp(switched["internal_energy"][rigid]) < 1e-9
    assert np.ptp(switched["internal_energy"][time > 0.2]) > 0.1
    plot = tmp_path / "motion.svg"
    assert run("rollover", *SMALL, "--tr", "0.1", "--td", "0.2", "--plot", str(plot)).stdout == ""
    assert b"<svg" in plot.read_bytes()


def test_the_figure_of_a_motion_superposes_the_outlines_of_both_runs() -> None:
    window = Window(0.05, 0.2)
    reference, switched = (simulate(Parameters(mesh=4), 0.25, rigid, interval=5e-4) for rigid in (None, window))
    outlines, roll, height = figures.draw_rollover(reference, switched, window).axes
    assert len(outlines.lines) == 16
    corners = np.asarray(outlines.lines[8].get_xydata())
    np.testing.assert_array_equal(corners[0], corners[-1])
    for axes in (roll, height):
        assert axes.get_legend_handles_labels()[1] == ["without switching", "switched", "rigid"]
    np.testing.assert_array_equal(roll.lines[1].get_ydata(), np.degrees(switched.roll))
    np.testing.assert_array_equal(height.lines[0].get_ydata(), reference.centre.imag)


def test_a_scan_gives_one_answer_in_every_form(tmp_path: Path) -> None:
    scan = ("rollover", "--scan", "--jobs", "1", "--td", "0.14", "--t-end", "0.15", "-q", *SMALL)
    plot = tmp_path / "scan.png"
    found = json.loads(run(*scan, "-f", "json", "--plot", str(plot)).stdout)
    schema = json.loads((files("d2rpick") / "schemas" / "rollover-1.json").read_text("utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(found, schema, jsonschema.Draft202012Validator)
    assert plot.read_bytes().startswith(b"\x89PNG")
    assert found["recommended"] in [one["tr"] for one in found["runs"]]
    rows = list(csv.DictReader(io.StringIO(run(*scan, "-f", "csv").stdout)))
    assert [{name: float(cell) for name, cell in row.items()} for row in rows] == found["runs"]
    text = run(*scan).stdout
    assert "\n* " in text
    assert f"recommended  tr = {found['recommended']:.6g}" in text


def test_a_scan_whose_td_lies_in_the_load_says_so() -> None:
    scan = ("rollover", "--scan", "--jobs", "1", "--td", "0.06", "--t-end", "0.1", *SMALL)
    result = run(*scan, "-f", "markdown")
    assert result.stdout.startswith("| tr |")
    told = {line.split(": ")[1] for line in result.stderr.splitlines()}
    assert told >= {"energy-only", "no-free-flight"}
    assert codes(answer(*scan)) == told


def test_a_scan_at_whose_td_nothing_can_be_recommended_says_so() -> None:
    scan = ("rollover", "--scan", "--jobs", "1", "--td", "0.04", "--t-end", "0.1", *SMALL)
    assert run(*scan, "-q").stdout.endswith("\n\nrecommended  none\n")
    assert [run(*scan, *extra).exit_code for extra in ((), ("-f", "csv"), ("--exit-zero",))] == [1, 1, 0]
    found = answer(*scan)
    assert found["recommended"] is None
    assert "no-candidate" in codes(found)


def test_a_run_that_does_not_balance_its_energy_says_so() -> None:
    assert "warning: energy-balance:" in run("rollover", *SHORT, "--damping", "300").stderr
    assert run("rollover", *SHORT).stderr == ""


def test_the_progress_of_a_scan_is_told_on_a_terminal_only() -> None:
    pty = pytest.importorskip("pty", reason="terminals are a matter of POSIX")
    scan = ("rollover", "--scan", "--jobs", "1", "--td", "0.1", "--t-end", "0.11", "--mesh", "4", "--dt", "1e-3")
    assert "switched runs" not in run(*scan).stderr
    master, slave = pty.openpty()
    with subprocess.Popen(
        [sys.executable, "-m", "d2rpick", *scan], stdout=subprocess.PIPE, stderr=slave, cwd=ROOT
    ) as process:
        os.close(slave)
        told = b""
        try:
            while piece := os.read(master, 1000):
                told += piece
        except OSError:  # how Linux tells that the other end is closed
            pass
        process.communicate(timeout=30)
    os.close(master)
    assert b"switched runs" in told
    assert b"100%" in told


@pytest.mark.parametrize(
    ("args", "complaint"),
    [
        (("--tr", "0.1"), "--tr and --td go together"),
        (("--tr", "0.2", "--td", "0.1"), "is not before"),
        (("--tr", "0.2", "--td", "0.5"), "after the end of the run"),
        (("--tr", "-1", "--td", "0.1"), "at least 0"),
        (("--scan", "--td", "0", "--mesh", "4"), "no time for tr"),
        (("--stiffness", "1e15"), "take softer bars"),
        (("--mesh", "100000"), "200"),
        (("--scan", "--tr", "0.1"), "exclude each other"),
        (("--scan", "--write-as", "csv"), "exclude each other"),
        (("--jobs", "2"), "belongs to --scan"),
        (("-f", "json"), "belongs to --scan"),
        (("--dt", "1e-9"), "more than"),
        (("--mesh", "3"), "4"),
        (("--scan", "--td", "0.5", "--mesh", "4"), "end of the flight"),
        (("-o", "run.txt"), "--write-as"),
    ],
)
def test_what_cannot_be_run_is_refused_in_one_line(args: tuple[str, ...], complaint: str) -> None:
    result = run("rollover", *args)
    assert result.exit_code == 2
    assert complaint in result.stderr
    assert result.stderr.count("\n") == 1
