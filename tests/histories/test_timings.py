"""What runs took, and their smallest steps, as solvers print them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from d2rpick.errors import FormatError
from d2rpick.histories.opening import open_run
from d2rpick.histories.printed_steps import printed_steps
from d2rpick.histories.timings import read_timing, read_zone_times
from tests.command import GLSTAT
from tests.shared import shared

if TYPE_CHECKING:
    from pathlib import Path

HISTORIES = "real/histories/"


def test_a_real_d3hsp_is_read_by_the_clock_where_processor_times_are_rounded_to_nothing() -> None:
    found = read_timing(str(shared(f"{HISTORIES}lasso-python__sph_models-R12_2_1-d3hsp")))
    assert (found.cycles, found.elements) == (640, 0.035)
    assert found.total == pytest.approx(1.298 - 0.011 - 1.216)


@pytest.mark.parametrize("name", ["lasso-python__sph_models-R12_2_1-d3hsp", "lasso-python__sph_models-R7_1_2-d3hsp"])
def test_smallest_steps_of_a_real_d3hsp_are_found_beside_the_history(tmp_path: Path, name: str) -> None:
    (tmp_path / "d3hsp").write_bytes(shared(HISTORIES + name).read_bytes())
    expected = 5.4722e-5 if "R12" in name else 6.0802e-5
    assert printed_steps(open_run([GLSTAT]), str(tmp_path / "main.k"))[101] == (expected, "d3hsp")


def test_the_part_that_controls_the_step_is_found_in_a_real_glstat() -> None:
    run = open_run([str(shared(f"{HISTORIES}PILLARS-LSDyna__Bolt_B_Explicit-glstat"))])
    steps = printed_steps(run)
    assert {part: source for part, (_, source) in steps.items()} == {10: "glstat"}
    assert steps[10][0] == pytest.approx(1.97875e-4)


def test_times_per_zone_cycle_of_a_real_glstat() -> None:
    found = read_zone_times(str(shared(f"{HISTORIES}Masters-Project__Steel_Explicit-glstat.head16000")))
    assert found.time[0] == pytest.approx(5e-4, rel=1e-3)
    assert found.per_zone[0] == pytest.approx(5134e-9)


def test_files_that_say_nothing_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no times of elements"):
        read_timing(GLSTAT)
    with pytest.raises(FormatError, match="no time per zone cycle"):
        read_zone_times(GLSTAT)
    with pytest.raises(FormatError, match="cannot be read"):
        read_timing(str(tmp_path / "absent"))
