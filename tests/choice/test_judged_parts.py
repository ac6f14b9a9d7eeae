"""Switched runs of which only some parts were rigid, in several bodies, and energies that a solver reports wrongly."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import pytest

from d2rpick.choice.comparison import rigid_parts
from d2rpick.choice.of_run import Reference, compare_with, read, verify_of
from d2rpick.choice.settings import Settings
from d2rpick.choice.switched_run import switched_history
from d2rpick.histories.opening import Selection, open_run
from tests.computed import stored

if TYPE_CHECKING:
    from d2rpick.choice.verify import Verdict

TR, TD = 0.0496, 0.1464


def legs(run: str) -> list[str]:
    """Legs of a run; until tr all runs are alike."""
    return [stored(name) for name in ("car_all_T01.gz", f"{run}_T02.gz", f"{run}_T03.gz")]


@cache
def reference(*parts: str) -> Reference:
    return read([stored("carT01.gz")], Selection(parts=parts))


def compared(run: str, *parts: str) -> Verdict:
    """Verdict on the car whose engine, battery and four wheels were six rigid bodies, or that was one."""
    asked = reference(*parts)
    verdict = verify_of(asked, TR, TD, Settings())
    return compare_with(verdict, asked, asked.like(open_run(legs(run), Selection()), Selection(parts=parts)))


def test_the_parts_that_were_rigid_are_recognised_in_several_bodies() -> None:
    heavy = open_run(legs("car_heavy"), Selection())
    rigid = rigid_parts(heavy, heavy.parts[:17], heavy.part_time, TR, TD)
    assert rigid is not None
    assert [part.title for part, one in zip(heavy.parts, rigid, strict=False) if one] == ["engine", "battery", "wheels"]
    every = open_run(legs("car_all"), Selection())
    rigid = rigid_parts(every, every.parts[:17], every.part_time, TR, TD)
    assert rigid is not None
    assert rigid.all()
    assert rigid_parts(every, every.parts[:17], every.part_time, TR, TR + 5e-4) is None  # too few states


def test_a_run_of_which_all_parts_were_rigid_is_judged_by_its_energy() -> None:
    """Computed: 0.947 of the mean energy of shells and beams until the landing, all parts without springs here."""
    found = compared("car_all", "1-17").switched
    assert found is not None
    assert found.objections == ()
    assert found.mean_after / found.mean_after_reference == pytest.approx(0.957, abs=0.005)


def test_parts_that_were_not_rigid_are_named() -> None:
    found = compared("car_heavy", "11,12").switched
    assert found is not None
    assert "not rigid from tr 0.0496 to td 0.1464 in the switched run: bows" in found.objections


def test_energies_that_are_reported_wrongly_do_not_enter_the_comparison() -> None:
    """The battery reports 70 400 J for 21; shells and beams keep 1.019 of their mean energy."""
    found = compared("car_heavy", "1-17").switched
    assert found is not None
    assert found.mean_after / found.mean_after_reference == pytest.approx(1.019, abs=0.002)
    assert any(note.startswith("left out of the comparison: engine, battery, wheels,") for note in found.notes)


@pytest.mark.parametrize("parts", [("12-14",), ()])
def test_where_all_energies_are_reported_wrongly_only_the_motion_is_judged(parts: tuple[str, ...]) -> None:
    found = compared("car_heavy", *parts).switched
    assert found is not None
    (objection,) = found.objections
    assert objection.startswith("the energies of engine, battery, wheels are reported wrongly after td")
    assert found.momentum_error is not None
    assert found.momentum_error < 1e-5
    assert (parts == ()) == ("judged by the parts that were rigid: engine, battery, wheels" in found.notes)


def test_plans_go_on_from_a_run_of_which_some_parts_were_rigid() -> None:
    heavy = read(legs("car_heavy"), Selection(parts=("11-14",)))
    history, windows, cautions = switched_history(heavy, [(TR, TD)])
    assert windows == ((TR, TD),)
    (told,) = cautions
    assert told.code == "partly-rigid"
    assert "these parts were not rigid: bows;" in told.message
    assert not [one for one in history.momenta if one.parts is not None]
    assert not switched_history(read(legs("car_heavy"), Selection(parts=("12-14",))), [(TR, TD)])[2]
