"""Plan the falling boxes window by window, and find the landing after each td: ``python -m validation.plans FOLDER``.

A box is planned from its reference, run with the windows that the reference supports, and planned again from that run,
until no window is left.  Every window is planned, whatever its vibration is worth: the question is whether the parts
are deformable again before they touch the ground.  Missing runs in FOLDER are computed, which needs OPENRADIOSS_PATH.
The table is printed as csv; the exit code is 1 if a body is rigid in a contact.

``--latest`` moves every td to the end of its flight less the margin, the latest time that the margin allows.
``--at-once`` runs all windows as planned from the reference, and lists those that need a run with the first ones.
``--no-deck`` plans from the time histories alone.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

import d2rpick
from d2rpick.choice.td.flights import compute_last_td
from validation.compare import read
from validation.models import MODELS
from validation.vibration import compute

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.choice.td.plan import PlannedFlight
    from validation.compare import Run
    from validation.models import Model

    Window = tuple[float, float]

BOXES: Final = ("DROP2", "DROP3", "DROP4")
# Shorter windows are left out [s].
_SHORTEST: Final = 0.02
# Changes of the contact energy below this share of its range are round-off of the time history [-].
_ROUNDING: Final = 1e-6


class Way(NamedTuple):
    """How the windows are planned: with the deck, with the latest td instead of the recommended one, all at once."""

    with_deck: bool = True
    latest: bool = False
    at_once: bool = False

    @property
    def statuses(self) -> tuple[str, ...]:
        """Status of the planned windows with which the next run is made."""
        return ("supported", "re-plan") if self.at_once else ("supported",)


class LandedWindow(NamedTuple):
    """A window of a switched run, and the landing after it [s].

    ``run`` is the number of the run that it was planned from, 0 for the reference.  The first contact after tr is the
    ``planned_landing`` in that run, and the ``landing`` in the switched run; NaN if there is none.
    """

    model: str
    number: int
    run: int
    tr: float
    td: float
    margin: float
    planned_landing: float
    landing: float

    @property
    def is_in_time(self) -> bool:
        """Return True if the parts are deformable before the landing, or if nothing lands."""
        return not self.landing <= self.td


def find_first_contact(run: Run, start: float) -> float:
    """Return the first state after a time at which the contact energy changes [s]; NaN if there is none."""
    size = float(np.ptp(run.contact))
    has_changed = np.abs(np.diff(run.contact)) > _ROUNDING * size
    later_states = run.time[1:][has_changed & (run.time[:-1] >= start)]
    return float(later_states[0]) if later_states.size else float("nan")


def choose_window(flight: PlannedFlight, way: Way) -> Window:
    """Return the window (tr, td) in which the parts are made rigid in a planned flight [s]."""
    window = flight.window
    assert window is not None
    tr, td = window
    if not way.latest:
        return tr, td
    return tr, max(td, compute_last_td(flight.end, flight.margin.time))


def plan_windows(
    model: Model, way: Way, legs: Sequence[Path], done: Sequence[Window]
) -> tuple[PlannedFlight, ...]:
    """Return the flights whose windows the next run has; in the windows ``done`` this run was switched."""
    deck = str(legs[0].parent / f"{model.name}_0000.rad") if way.with_deck else None
    plan = d2rpick.plan(
        d2rpick.read([str(leg) for leg in legs]),
        parts="all",
        deck=deck,
        done=done,
        min_rigid=_SHORTEST,
        min_quality="poor",
    )
    return tuple(
        flight
        for flight in plan.flights
        if flight.window and flight.status in way.statuses
    )


def compute_run(
    model: Model, folder: Path, solver: Path, windows: Sequence[Window]
) -> list[Path]:
    """Compute the run that is rigid in these windows, unless a folder contains it; return its time histories."""
    if not windows:
        return compute(model, folder / "reference", [], solver)
    name = "rigid_" + "_".join(f"{tr:.6f}_{td:.6f}" for tr, td in windows)
    return compute(model, folder / name, [*windows], solver)


def study_box(
    name: str,
    plan: Callable[[Sequence[Path], Sequence[Window]], Sequence[PlannedFlight]],
    simulate: Callable[[Sequence[Window]], Sequence[Path]],
    way: Way,
) -> Iterator[LandedWindow]:
    """Yield each window of a box with the landing after it.

    Parameters
    ----------
    name : str
        Model of the box.
    plan : function
        Returns the flights with the new windows, from the time histories of a run and the windows that it has.
    simulate : function
        Returns the time histories of the run that is rigid in given windows.
    way : Way
    """
    legs = simulate([])
    done: list[Window] = []
    run_number = 0
    while flights := plan(legs, done):
        windows = [*done, *(choose_window(flight, way) for flight in flights)]
        before = read([str(leg) for leg in legs])
        legs = simulate(windows)
        switched = read([str(leg) for leg in legs])
        first_number = len(done) + 1
        for number, flight in enumerate(flights, start=first_number):
            tr, td = windows[number - 1]
            if way.at_once and flight.status == "supported":
                continue
            yield LandedWindow(
                model=name,
                number=number,
                run=run_number,
                tr=tr,
                td=td,
                margin=flight.margin.time,
                planned_landing=find_first_contact(before, tr),
                landing=find_first_contact(switched, tr),
            )
        if way.at_once:
            return
        done = windows
        run_number += 1


def main() -> int:
    """Print a row for each window; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.plans", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "model",
        nargs="*",
        metavar="MODEL",
        help=f"of {', '.join(BOXES)}; by default all",
    )
    parser.add_argument(
        "--latest",
        action="store_true",
        help="move td to the latest time that the margin allows",
    )
    parser.add_argument(
        "--at-once",
        action="store_true",
        help="run all windows as planned from the reference",
    )
    parser.add_argument(
        "--no-deck", action="store_true", help="plan from the time histories alone"
    )
    given = parser.parse_args()
    unknown = {*given.model} - {*BOXES}
    if unknown:
        parser.error(
            f"no model {', '.join(sorted(unknown))}; choose {', '.join(BOXES)}"
        )
    solver = os.environ.get("OPENRADIOSS_PATH")
    if not solver:
        sys.exit("OPENRADIOSS_PATH is not set; it names the folder of OpenRadioss")
    way = Way(not given.no_deck, latest=given.latest, at_once=given.at_once)
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(
        [
            *("model", "window", "planned_from", "tr_s", "td_s", "margin_s"),
            *("landing_planned_s", "landing_s"),
        ]
    )
    all_in_time = True
    for name in given.model or BOXES:
        model = MODELS[name]
        simulate = partial(compute_run, model, given.folder / name, Path(solver))
        for window in study_box(name, partial(plan_windows, model, way), simulate, way):
            times = (window.tr, window.td, window.margin)
            landings = (window.planned_landing, window.landing)
            table.writerow(
                [
                    *(window.model, window.number, window.run),
                    *(f"{time:.6f}" for time in times),
                    *(f"{time:.4f}" for time in landings),
                ]
            )
            sys.stdout.flush()
            all_in_time = all_in_time and window.is_in_time
    return 0 if all_in_time else 1


if __name__ == "__main__":
    sys.exit(main())
