"""Plans of the falling box compared with the runs switched accordingly: ``python -m tests.test_drops``.

Twenty sets of parameters were fixed before any of them was run: drop height and tilt on a grid, and in turn the
horizontal speed, the stiffness of the ground and the stiffness of the bars.  Each supported window must end before the
landing of the switched run.
"""

import tempfile
from itertools import product
from pathlib import Path
from typing import NamedTuple

import pytest

from d2rpick.choice.question import Settings, read_reference
from d2rpick.choice.td.plan import plan_run
from d2rpick.histories.opening import Selection
from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import BoxWindow, simulate
from tests.drops import write_run_files

SETS = tuple(
    Parameters(
        drop=height, tilt=tilt, speed=(0.0, 1.0, 2.0)[i % 3], ground_stiffness=(5e5, 2e5)[i % 2],
        stiffness=(4.5e6, 2.5e6)[i // 2 % 2], mesh=8,
    )
    for i, (height, tilt) in enumerate(product((0.2, 0.3, 0.4, 0.6), (10.0, 20.0, 30.0, 35.0, 44.0)))
)  # fmt: skip
T_END, INTERVAL = 1.2, 2e-4
BOX = Selection(parts=("box",))


class DropOutcome(NamedTuple):
    """Supported windows, and the next contact of the switched run after each [s]; None if there is none."""

    windows: tuple[tuple[float, float], ...]
    landings: tuple[float | None, ...]

    @property
    def kept(self) -> bool:
        """True if each window ends before the landing."""
        return all(
            landing is None or td < landing
            for (_, td), landing in zip(self.windows, self.landings, strict=True)
        )


def compute_outcome(parameters: Parameters, interval: float = INTERVAL) -> DropOutcome:
    """Plan a run with these parameters, and compute it switched in the supported windows."""
    with tempfile.TemporaryDirectory() as folder:
        files = write_run_files(
            simulate(parameters, T_END, interval=interval), Path(folder)
        )
        windows = plan_run(read_reference(files, BOX), Settings()).windows
    switched = simulate(
        parameters,
        T_END,
        *(BoxWindow(*window) for window in windows),
        interval=interval,
    )
    contacts = switched.landings
    next_contacts = tuple(
        next((start for start, _ in contacts if start > tr), None) for tr, _ in windows
    )
    return DropOutcome(windows, next_contacts)


@pytest.mark.slow
def test_supported_windows_end_before_the_landing_of_the_switched_run() -> None:
    drop_outcome = compute_outcome(
        SETS[12], interval=3e-4
    )  # at most two time steps of the model per state
    assert drop_outcome.windows
    assert drop_outcome.kept, drop_outcome


if __name__ == "__main__":
    for number, parameters in enumerate(SETS, start=1):
        found = compute_outcome(parameters)
        pairs = zip(found.windows, found.landings, strict=True)
        told = "; ".join(
            f"{tr:.4f} to {td:.4f}, contact {at if at is None else round(at, 4)}"
            for (tr, td), at in pairs
        )
        print(f"{number:2d} {'kept' if found.kept else 'NOT KEPT'}  {told}", flush=True)
