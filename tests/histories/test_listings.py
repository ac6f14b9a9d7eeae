"""What a listing of Radioss' engine tells of the engine: only what is certain, and only of restarts that switch."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from d2rpick.histories.listings import wrong_energies

if TYPE_CHECKING:
    from pathlib import Path

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


def listing(owner: str = "2026 Siemens", tag: str = "", ran: str = "2026/11/22") -> str:
    return HEAD.format(bar=BAR, tag=tag and f"CommitID: {tag}", owner=owner) + TAIL.format(ran=ran)


def told(folder: Path, text: str, leg: int = 2, history: str = "") -> list[str]:
    (folder / f"CAR_{leg:04d}.out").write_text(text)
    return list(wrong_energies([str(folder / (history or f"CART{leg:02d}"))]))


BEFORE, FIX, AFTER = "6068aa23d", "2b7ab50b747de97049f2a80bc36558eec5c0c764", "780156a9a0b8906458ebd7a6eee35dbb5ef54f1a"


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (listing("1986-2025 Altair Engineering, Inc."), "built in 2025"),
        (listing("1986-2022 Altair Engineering, Inc.", "440deeba848d606665f88afb8302e85b1ecf72bf"), "built in 2022"),
        (listing("1986-2026 Altair Engineering, Inc.", BEFORE), "commit 6068aa23d"),
        (listing(tag=FIX), "commit 2b7ab50b7"),  # with the regression of the fix
        (listing(ran="2026/01/12"), "run on 2026-01-12"),
        (listing(ran="2026/01/13"), ""),
        (listing(tag=AFTER), ""),
        (listing(tag="bd4557ba7"), ""),
        (listing(), ""),  # a build of 2026 that names no commit
        (listing("1986-2025 Altair Engineering, Inc.").replace("OpenRadioss", "Radioss"), ""),  # not known of others
        (listing("1986-2025 Altair Engineering, Inc.").replace("SET ON", "LOCAL SKEW"), ""),
        ("", ""),
    ],
)
def test_an_engine_from_before_the_fix_is_told(tmp_path: Path, text: str, why: str) -> None:
    assert told(tmp_path, text) == ([f"{tmp_path / 'CAR_0002.out'}: {why}"] if why else [])


def test_the_first_leg_is_no_restart(tmp_path: Path) -> None:
    assert told(tmp_path, listing("1986-2025 Altair Engineering, Inc."), leg=1) == []


@pytest.mark.parametrize("name", ["CART02.gz", "CART02.csv", "CART02"])
def test_the_listing_lies_beside_the_history(tmp_path: Path, name: str) -> None:
    assert told(tmp_path, listing("1986-2025 Altair Engineering, Inc."), history=name)


@pytest.mark.parametrize("name", ["glstat", "energy.csv", "CART2", "other/CART02", "T02", "\0T02"])
def test_a_history_without_a_listing_tells_nothing(tmp_path: Path, name: str) -> None:
    assert told(tmp_path, listing("1986-2025 Altair Engineering, Inc."), history=name) == []


def test_the_middle_of_a_long_listing_is_not_read(tmp_path: Path) -> None:
    head, tail = listing(ran="2025/06/01").split("\n EXECUTION", 1)
    assert told(tmp_path, f"{head}\n{' ' * 3_000_000}\n EXECUTION{tail}") == [
        f"{tmp_path / 'CAR_0002.out'}: run on 2025-06-01"
    ]
