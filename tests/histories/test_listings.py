"""Listings next to the histories: the engine, the CPU time of a run, the smallest time steps."""

from pathlib import Path

import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.listings import (
    find_printed_steps,
    find_wrong_energies,
    read_timing,
    read_zone_times,
)
from d2rpick.histories.opening import open_run
from tests.command import GLSTAT, put
from tests.text_files import make_glstat_text

BAR = "*" * 72
HEAD = """ CAR_0002.out
{bar}
**                         OpenRadioss Engine                         **
** {tag:<66} **
{bar}
** OpenRadioss Software                                               **
** COPYRIGHT (C) {owner:<52} **

 RIGID BODY:   900001 SET ON
"""
TAIL = """
 EXECUTION STARTED .........................:      {ran}  16:50:02
 EXECUTION COMPLETED .......................:      {ran}  16:51:36
"""

BEFORE, FIX, AFTER = (
    "6068aa23d",
    "2b7ab50b747de97049f2a80bc36558eec5c0c764",
    "780156a9a0b8906458ebd7a6eee35dbb5ef54f1a",
)
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


def listing(owner: str = "2026 Siemens", tag: str = "", ran: str = "2026/11/22") -> str:
    return HEAD.format(
        bar=BAR, tag=tag and f"CommitID: {tag}", owner=owner
    ) + TAIL.format(ran=ran)


def find_wrong_listings(
    folder: Path, text: str, leg: int = 2, history: str = ""
) -> list[str]:
    (folder / f"CAR_{leg:04d}.out").write_text(text)
    return list(find_wrong_energies([str(folder / (history or f"CART{leg:02d}"))]))


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (listing("1986-2025 Altair Engineering, Inc."), "built in 2025"),
        (
            listing(
                "1986-2022 Altair Engineering, Inc.",
                "440deeba848d606665f88afb8302e85b1ecf72bf",
            ),
            "built in 2022",
        ),
        (listing("1986-2026 Altair Engineering, Inc.", BEFORE), "commit 6068aa23d"),
        (
            listing(tag=FIX),
            "commit 2b7ab50b7",
        ),  # the first correction, which had its own error
        (listing(ran="2026/01/12"), "run on 2026-01-12"),
        (listing(ran="2026/01/13"), ""),
        (listing(tag=AFTER), ""),
        (listing(tag="bd4557ba7"), ""),
        (listing(), ""),  # a build of 2026 without the name of its commit
        (
            listing("1986-2025 Altair Engineering, Inc.").replace(
                "OpenRadioss", "Radioss"
            ),
            "",
        ),  # other programs, for which nothing is known about this error
        (
            listing("1986-2025 Altair Engineering, Inc.").replace(
                "SET ON", "LOCAL SKEW"
            ),
            "",
        ),
        ("", ""),
    ],
)
def test_an_engine_from_before_the_fix_is_told(
    tmp_path: Path, text: str, why: str
) -> None:
    assert find_wrong_listings(tmp_path, text) == (
        [f"{tmp_path / 'CAR_0002.out'}: {why}"] if why else []
    )


def test_the_first_leg_is_no_restart(tmp_path: Path) -> None:
    assert (
        find_wrong_listings(
            tmp_path, listing("1986-2025 Altair Engineering, Inc."), leg=1
        )
        == []
    )


@pytest.mark.parametrize("name", ["CART02.gz", "CART02.csv", "CART02"])
def test_the_listing_lies_beside_the_history(tmp_path: Path, name: str) -> None:
    assert find_wrong_listings(
        tmp_path, listing("1986-2025 Altair Engineering, Inc."), history=name
    )


@pytest.mark.parametrize(
    "name", ["glstat", "energy.csv", "CART2", "other/CART02", "T02", "\0T02"]
)
def test_a_history_without_a_listing_tells_nothing(tmp_path: Path, name: str) -> None:
    assert (
        find_wrong_listings(
            tmp_path, listing("1986-2025 Altair Engineering, Inc."), history=name
        )
        == []
    )


def test_the_middle_of_a_long_listing_is_not_read(tmp_path: Path) -> None:
    head, tail = listing(ran="2025/06/01").split("\n EXECUTION", 1)
    assert find_wrong_listings(
        tmp_path, f"{head}\n{' ' * 3_000_000}\n EXECUTION{tail}"
    ) == [f"{tmp_path / 'CAR_0002.out'}: run on 2025-06-01"]


@pytest.mark.parametrize(
    ("elements", "total", "found"),
    [("0.0000E+00", "1.0000E+00", (0.49, 0.3)), ("4.0000E+00", "6.0000E+00", (5, 4))],
)
def test_a_d3hsp_is_read_by_the_clock_where_processor_times_are_rounded_to_nothing(
    tmp_path: Path, elements: str, total: str, found: tuple[float, float]
) -> None:
    """Time before the run is not included."""
    timing = read_timing(str(put(tmp_path / "d3hsp", D3HSP.format(elements, total))))
    assert timing.cycles == 640
    assert (timing.total, timing.elements) == pytest.approx(found)


def test_smallest_steps_of_a_d3hsp_are_found_beside_the_deck(tmp_path: Path) -> None:
    (tmp_path / "d3hsp").write_text(D3HSP)
    steps = find_printed_steps(open_run([GLSTAT]), str(tmp_path / "main.k"))
    assert (steps[7], steps[101]) == ((5e-5, "d3hsp"), (8e-5, "d3hsp"))


def test_the_part_that_controls_the_step_is_found_in_a_glstat(tmp_path: Path) -> None:
    (tmp_path / "glstat").write_bytes(
        make_glstat_text([0.0, 0.5], [1.0, 2.0]).replace(b"0.00000E+00", b"2.50000E-06")
    )
    assert find_printed_steps(open_run([str(tmp_path / "glstat")])) == {
        10: (2.5e-6, "glstat")
    }


def test_times_per_zone_cycle_of_a_glstat(tmp_path: Path) -> None:
    text = make_glstat_text([0.0, 0.5], [1.0, 2.0]).replace(
        b"(nanosec)..             0", b"(nanosec)..          5134"
    )
    zone_times = read_zone_times(str(put(tmp_path / "glstat", text)))
    assert zone_times.time.tolist() == [0.0, 0.5]
    assert zone_times.per_zone == pytest.approx(5134e-9)


def test_files_that_say_nothing_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no times of elements"):
        read_timing(GLSTAT)
    with pytest.raises(FormatError, match="no time per zone cycle"):
        read_zone_times(GLSTAT)
    with pytest.raises(FormatError, match="cannot be read"):
        read_timing(str(tmp_path / "absent"))
