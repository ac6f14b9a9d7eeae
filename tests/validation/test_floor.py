"""The perturbation floor: what is compared, and whether the page shows the results."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.command import ROOT
from validation.figures import read_results
from validation.floor import SCALES, TD, RunMotion, compare_motions

DOCS = ROOT / "docs/explanation/validation.md"
_MEASURES = ("momentum_peak", "momentum_rms", "energy_peak", "energy_rms")


def motion(shift: float = 0.0, late: float = 0.0) -> RunMotion:
    """Give a motion whose momentum is 10 along x and swings by 1 along z, ``shift`` apart, with a ``late`` energy."""
    time = np.linspace(0.0, 0.2, 2001)
    swing = np.sin(500 * time)
    momentum = np.column_stack((np.full(time.size, 10.0 + shift), 0 * time, swing))
    return RunMotion(time, momentum, 5.0 + np.cos(500 * (time - late)))


def test_equal_motions_do_not_differ() -> None:
    floor = compare_motions("OSC", 0.85, motion(), motion())
    assert floor[2:] == pytest.approx((0.0, 0.0, 0.0, 0.0), abs=1e-12)


def test_a_constant_difference_is_that_share_of_the_peak_at_all_times() -> None:
    floor = compare_motions("OSC", 0.85, motion(), motion(shift=0.1))
    share = 0.1 / np.hypot(10.0, 1.0)
    assert floor.momentum_peak == pytest.approx(share, rel=1e-4)
    assert floor.momentum_rms == pytest.approx(share, rel=1e-4)


def test_a_late_energy_differs_by_its_amplitude_at_most() -> None:
    floor = compare_motions("OSC", 0.85, motion(), motion(late=np.pi / 500))
    assert floor.energy_peak == pytest.approx(2 / 6, rel=1e-3)
    assert floor.energy_rms == pytest.approx(2 / 6 / np.sqrt(2), rel=2e-2)


def test_the_page_shows_the_floor_of_each_model() -> None:
    rows = read_results("floor")
    text = Path(DOCS).read_text("utf-8")
    number = r"([\d.]+) to ([\d.]+)"
    listed = re.findall(
        rf"^\| `(\w+)` \| {' [|] '.join([number] * 4)} \|$", text, re.MULTILINE
    )
    assert {name for name, *_ in listed} == {*TD} == {*rows["model"]}
    for name, *ranges in listed:
        perturbed = rows[rows["model"] == name]
        assert sorted(perturbed["scale"]) == sorted(SCALES)
        wanted = [
            100 * limit
            for measure in _MEASURES
            for limit in (perturbed[measure].min(), perturbed[measure].max())
        ]
        assert [float(limit) for limit in ranges] == pytest.approx(wanted, abs=0.051)
