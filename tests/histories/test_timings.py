"""What runs took, and their smallest steps, as solvers print them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from d2rpick.errors import FormatError
from d2rpick.histories.listings import printed_steps, read_timing, read_zone_times
from d2rpick.histories.opening import open_run
from tests.command import GLSTAT
from tests.text_files import glstat_text

if TYPE_CHECKING:
    from pathlib import Path


D3HSP = """
  25 smallest timesteps
 ------------------------------------------------
 element       number                part    timestep
 shell             12                   7  5.0000E-05
 shell             13                   7  6.0000E-05
 solid              4                 101  8.0000E-05

 T i m i n g   i n f o r m a t i o n
                        CPU(seconds)   %CPU  Clock(seconds) %Clock
  ----------------------------------------------------------------
  Keyword Processing ... 0.0000E+00    0.00     1.0000E-02    1.00
  Initialization ....... 1.0000E+00  100.00     5.0000E-01   50.00
  Element processing ... {}    0.00     3.0000E-01   30.00
  ----------------------------------------------------------------
  T o t a l s            {}  100.00     1.0000E+00  100.00

 Problem cycle      =       640
"""


@pytest.mark.parametrize(
    ("elements", "total", "found"), [("0.0000E+00", "1.0000E+00", (0.49, 0.3)), ("4.0000E+00", "6.0000E+00", (5, 4))]
)
def test_a_d3hsp_is_read_by_the_clock_where_processor_times_are_rounded_to_nothing(
    tmp_path: Path, elements: str, total: str, found: tuple[float, float]
) -> None:
    """What came before the run does not count."""
    (tmp_path / "d3hsp").write_text(D3HSP.format(elements, total))
    timing = read_timing(str(tmp_path / "d3hsp"))
    assert timing.cycles == 640
    assert (timing.total, timing.elements) == pytest.approx(found)


def test_smallest_steps_of_a_d3hsp_are_found_beside_the_deck(tmp_path: Path) -> None:
    (tmp_path / "d3hsp").write_text(D3HSP)
    found = printed_steps(open_run([GLSTAT]), str(tmp_path / "main.k"))
    assert (found[7], found[101]) == ((5e-5, "d3hsp"), (8e-5, "d3hsp"))


def test_the_part_that_controls_the_step_is_found_in_a_glstat(tmp_path: Path) -> None:
    (tmp_path / "glstat").write_bytes(glstat_text([0.0, 0.5], [1.0, 2.0]).replace(b"0.00000E+00", b"2.50000E-06"))
    assert printed_steps(open_run([str(tmp_path / "glstat")])) == {10: (2.5e-6, "glstat")}


def test_times_per_zone_cycle_of_a_glstat(tmp_path: Path) -> None:
    text = glstat_text([0.0, 0.5], [1.0, 2.0]).replace(b"(nanosec)..             0", b"(nanosec)..          5134")
    (tmp_path / "glstat").write_bytes(text)
    found = read_zone_times(str(tmp_path / "glstat"))
    assert found.time.tolist() == [0.0, 0.5]
    assert found.per_zone == pytest.approx(5134e-9)


def test_files_that_say_nothing_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no times of elements"):
        read_timing(GLSTAT)
    with pytest.raises(FormatError, match="no time per zone cycle"):
        read_zone_times(GLSTAT)
    with pytest.raises(FormatError, match="cannot be read"):
        read_timing(str(tmp_path / "absent"))
