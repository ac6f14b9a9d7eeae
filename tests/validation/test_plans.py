"""Plans of falling boxes that are computed window by window: the loop, the landings, and the stored results."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from d2rpick.flight.margin import Margin
from tests.command import ROOT
from validation import plans
from validation.compare import Run
from validation.figures import read_results

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

TIME = np.linspace(0.0, 1.0, 1001)


def make_run(*landings: float) -> Run:
    """Return a run whose contact energy rises at some times."""
    contact = np.sum([np.clip(TIME - time, 0, 0.01) for time in landings], axis=0)
    return Run(TIME, 0 * TIME, contact)


def make_flight(
    window: tuple[float, float], end: float, status: str = "supported"
) -> Any:
    """Return a planned flight with a margin of 10 ms."""
    margin = Margin(0.01, "landing")
    return SimpleNamespace(window=window, end=end, margin=margin, status=status)


class Solver:
    """A solver that writes stored runs, of which each has one more plan; ``windows`` are those of the runs so far."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.windows: list[list[tuple[float, float]]] = []

    def simulate(self, windows: Sequence[tuple[float, float]]) -> list[Path]:
        """Write the contact energy of the run with these windows."""
        landings = {0: (0.25, 0.45, 0.75), 2: (0.25, 0.44, 0.76), 3: (0.25, 0.44, 0.71)}
        run = make_run(*landings[len(windows)])
        self.windows.append([*windows])
        path = self.folder / f"run{len(windows)}.csv"
        columns = np.column_stack([run.time, run.internal, run.contact])
        head = "time,internal_energy,contact_energy"
        np.savetxt(path, columns, delimiter=",", header=head, comments="")
        return [path]


def plan_two_and_one(
    way: plans.Way, legs: Sequence[Path], done: Sequence[tuple[float, float]]
) -> tuple[Any, ...]:
    """Plan two windows by the reference, and one by the run with these."""
    assert legs[0].name == f"run{len(done)}.csv"
    first, second = make_flight((0.0, 0.2), 0.25), make_flight((0.3, 0.4), 0.45)
    flights = {
        0: [first, second, make_flight((0.6, 0.7), 0.75, "re-plan")],
        2: [make_flight((0.62, 0.72), 0.76)],
        3: [],
    }
    return tuple(
        flight for flight in flights[len(done)] if flight.status in way.statuses
    )


def study(folder: Path, way: plans.Way) -> tuple[Solver, list[plans.LandedWindow]]:
    """Return the solver and the rows of a study of a box."""
    solver = Solver(folder)
    plan = partial(plan_two_and_one, way)
    return solver, list(plans.study_box("BOX", plan, solver.simulate, way))


def test_each_run_has_the_windows_before_it_and_those_that_its_predecessor_supports(
    tmp_path: Path,
) -> None:
    solver, rows = study(tmp_path, plans.Way())
    first, second, third = (0.0, 0.2), (0.3, 0.4), (0.62, 0.72)
    assert solver.windows == [[], [first, second], [first, second, third]]
    assert [(row.number, row.run) for row in rows] == [(1, 0), (2, 0), (3, 1)]
    assert [(row.tr, row.td) for row in rows] == [first, second, third]
    planned = [0.251, 0.451, 0.761]
    landed = [0.251, 0.441, 0.711]
    assert [row.planned_landing for row in rows] == pytest.approx(planned, abs=1e-9)
    assert [row.landing for row in rows] == pytest.approx(landed, abs=1e-9)
    assert [row.is_in_time for row in rows] == [True, True, False]


def test_all_windows_at_once_are_run_once_and_the_unsupported_are_listed(
    tmp_path: Path,
) -> None:
    solver, (row,) = study(tmp_path, plans.Way(at_once=True))
    windows = [(0.0, 0.2), (0.3, 0.4), (0.6, 0.7)]
    # The stored run with three windows lands at 0.71.
    assert solver.windows == [[], windows]
    assert (row.number, row.tr, row.td) == (3, 0.6, 0.7)
    assert row.landing == pytest.approx(0.711, abs=1e-9)


def test_the_latest_td_keeps_the_margin_before_the_end_of_the_flight() -> None:
    flight = make_flight((0.3, 0.4), 0.45)
    assert plans.choose_window(flight, plans.Way()) == (0.3, 0.4)
    assert plans.choose_window(flight, plans.Way(latest=True)) == pytest.approx(
        (0.3, 0.44)
    )


def test_a_landing_is_the_first_state_after_tr_with_another_contact_energy() -> None:
    run = make_run(0.25, 0.45)
    assert plans.find_first_contact(run, 0.1) == pytest.approx(0.251)
    assert plans.find_first_contact(run, 0.3) == pytest.approx(0.451)
    assert np.isnan(plans.find_first_contact(run, 0.5))
    assert np.isnan(plans.find_first_contact(make_run(2.0), 0.0))


def test_the_margins_hold_in_every_window_that_was_planned_from_the_run_before() -> (
    None
):
    rows = read_results("drop_plans")
    assert {*rows["model"]} == {*plans.BOXES}
    for name in plans.BOXES:
        of_box = rows[rows["model"] == name]
        assert of_box["window"].tolist() == [*range(1, len(of_box) + 1)]
    assert np.all(rows["landing_s"] > rows["td_s"])
    # The latest td that the margin allows would be in time, too.
    assert np.all(rows["landing_s"] > rows["landing_planned_s"] - rows["margin_s"])


def test_most_later_windows_that_are_planned_at_once_are_too_late_as_the_docs_say() -> (
    None
):
    rows = read_results("drop_plans_at_once")
    late = rows["td_s"] - rows["landing_s"]
    page = (ROOT / "docs/explanation/validation-motion.md").read_text("utf-8")
    words = dict(enumerate(("four", "five", "six"), start=4))
    assert len(rows) == 9
    assert f"In {words[int((late > 0).sum())]} of the nine windows, the box is" in page
    assert f"is up to {1e3 * late.max():.0f} ms too late" in page
