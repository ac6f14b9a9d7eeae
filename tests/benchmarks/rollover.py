"""Print the 21 rehearsals and the savings of switching: ``python -m tests.benchmarks.rollover``.

The exit code is 1 if a recommended tr gives a wrong roll, if the energy after td is not the announced one, or if a run
costs more than 100 calls of ``suggest`` for its history.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from d2rpick.choice.answers import suggest_in_history
from d2rpick.choice.question import Settings
from d2rpick.models.box_model import Parameters
from d2rpick.models.box_run import BoxWindow, make_history, simulate
from tests.rehearsals import SETS, Rehearsal, rehearse

WINDOW = BoxWindow(0.0970, 0.370)  # what suggest recommends for the default
HEAD = (
    " #  stiffness  yield  damping  speed  mesh  released  landed     td       tr  roll error  of worst  "
    "announced   mean     off"
)


def rehearse_set(number: int) -> Rehearsal:
    """Rehearse one set, with a tr every 6 ms in the trip."""
    with TemporaryDirectory() as folder:
        return rehearse(SETS[number], Path(folder), stride=2)


def format_line(number: int, trial: Rehearsal) -> tuple[str, bool]:
    """Return the line about one set, and True if the set passes."""
    p, run = trial.parameters, trial.reference
    good = trial.roll_share < 0.1 and abs(trial.energy_off) < 0.25
    text = (
        f"{number:2d}  {p.stiffness:9.3g}  {p.yield_strain:.5f}  {p.damping:5.2f}  {p.speed:5.2f}  {p.mesh:4d}"
        f"  {(run.released or np.nan) * 1e3:8.1f}  {(run.landed or np.nan) * 1e3:6.1f}  {trial.td:.3f}"
        f"  {trial.tr or np.nan:.5f}  {trial.error:10.4f}  {trial.roll_share:8.4f}"
        f"  {trial.announced:9.3f}  {trial.mean_ratio:.3f}  {trial.energy_off:+.3f}{'' if good else '  FAILED'}"
    )
    return text, good


def measure_saving(mesh: int) -> str:
    """Return a text with bar updates and elapsed time of a switched run over those of the reference run."""
    parameters = Parameters(mesh=mesh)
    pairs = [
        (simulate(parameters, 0.42), simulate(parameters, 0.42, WINDOW))
        for _ in range(3)
    ]
    seconds = [np.median([pair[i].seconds for pair in pairs]) for i in (0, 1)]
    work = pairs[0][1].bar_updates / pairs[0][0].bar_updates
    return f"{mesh:4d}  {pairs[0][0].dt:.2g}  {work:12.2f}  {seconds[1] / seconds[0]:10.2f}  {seconds[0]:8.2f}"


def main() -> int:
    """Print all rehearsals, the saving, and the cost of a run; return 1 if one of them fails."""
    missed = 0
    print(HEAD)
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for number, trial in enumerate(pool.map(rehearse_set, range(len(SETS)))):
            text, good = format_line(number, trial)
            missed += not good
            print(text, flush=True)
    print(
        f"\nrigid from {WINDOW.tr} to {WINDOW.td} of 0.42 s: shares of the run without switching"
    )
    print("mesh  step     bar updates   wall time  seconds")
    for mesh in (8, 16, 32, 64):
        print(measure_saving(mesh), flush=True)
    run = simulate(Parameters(), 0.4)
    start = perf_counter()
    suggest_in_history(make_history(run), 0.37, Settings())
    ratio = run.seconds / (perf_counter() - start)
    print(
        f"\none run of 400 ms costs {ratio:.1f} runs of suggest on its history, at most 100"
    )
    return int(missed > 0 or ratio > 100)


if __name__ == "__main__":
    sys.exit(main())
