"""The perturbation floor of each model: how much two runs differ if only the time step differs.

``python -m validation.floor FOLDER [MODEL ...] > validation/results/floor.csv`` computes the reference of each model,
and five perturbed references with a smaller step, and compares them from td on.  Needs OPENRADIOSS_PATH.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.opening import Selection, open_run
from validation.models import MODELS
from validation.vibration import CASES, compute

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Samples
    from validation.models import Model

# Shares of the stable step; the reference takes 0.9.
SCALES: Final = (0.89, 0.88, 0.87, 0.86, 0.85)
# The td at which each model is judged in the validation [s].
TD: Final = {
    "OSC": 0.068753,
    "CAR": 0.1464,
    "DROP2": 0.277,
    "ROLL": 0.371906,
    "FRAME": 0.10025,
}
_AXES: Final = ("x", "y", "z")


class RunMotion(NamedTuple):
    """Momentum vector (n, 3) and internal energy (n,) of a model over time (n,)."""

    time: Samples
    momentum: Samples
    energy: Samples


class Floor(NamedTuple):
    """Differences of a perturbed reference from the reference after td, relative to the peak of the reference there."""

    model: str
    scale: float
    momentum_peak: float
    momentum_rms: float
    energy_peak: float
    energy_rms: float


def read_motion(names: Sequence[str]) -> RunMotion:
    """Read the motion of a run from its time histories."""
    (database,) = open_run(names, Selection()).databases
    momentum = [database.channel(f"{axis}_momentum") for axis in _AXES]
    energy = database.channel("internal_energy")
    return RunMotion(database.time, np.column_stack(momentum), energy)


def compare_motions(
    name: str, scale: float, reference: RunMotion, perturbed: RunMotion
) -> Floor:
    """Compare two motions at the states of the reference after td."""
    later = reference.time > TD[name]
    time = reference.time[later]
    columns = [
        np.interp(time, perturbed.time, column) for column in perturbed.momentum.T
    ]
    wanted = reference.momentum[later]
    distance = np.linalg.norm(np.column_stack(columns) - wanted, axis=1)
    size = np.linalg.norm(wanted, axis=1).max()
    energy = reference.energy[later]
    difference = np.interp(time, perturbed.time, perturbed.energy) - energy
    return Floor(
        name,
        scale,
        float(distance.max() / size),
        float(np.sqrt(np.mean(distance**2)) / size),
        float(np.abs(difference).max() / energy.max()),
        float(np.sqrt(np.mean(difference**2)) / energy.max()),
    )


def find_model(name: str) -> Model:
    """Return the model of this name; `FRAME` has no stored deck and is a case of the vibration."""
    if name in MODELS:
        return MODELS[name]
    return CASES[name].model


def study_floor(name: str, folder: Path, solver: Path) -> Iterator[Floor]:
    """Compute the runs of a model that a folder lacks; yield a row for each perturbed reference."""
    model = find_model(name)
    legs = compute(model, folder / name / "reference", [], solver)
    reference = read_motion([str(leg) for leg in legs])
    for scale in SCALES:
        perturbed = replace(model, scale=scale)
        legs = compute(perturbed, folder / name / f"scale_{scale:g}", [], solver)
        yield compare_motions(
            name, scale, reference, read_motion([str(leg) for leg in legs])
        )


def main() -> None:
    """Print a table with a row for each perturbed reference."""
    parser = argparse.ArgumentParser(
        prog="python -m validation.floor", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "model", nargs="*", metavar="MODEL", help=f"of {', '.join(TD)}; by default all"
    )
    given = parser.parse_args()
    unknown = {*given.model} - {*TD}
    if unknown:
        parser.error(f"no model {', '.join(sorted(unknown))}; choose {', '.join(TD)}")
    solver = os.environ.get("OPENRADIOSS_PATH")
    if not solver:
        sys.exit("OPENRADIOSS_PATH is not set; it names the folder of OpenRadioss")
    print(*Floor._fields, sep=",")
    for name in given.model or TD:
        for row in study_floor(name, given.folder, Path(solver)):
            print(
                row.model, *(f"{value:.4g}" for value in row[1:]), sep=",", flush=True
            )


if __name__ == "__main__":
    main()
