"""Runs that differ slightly, like variants of one model, and the command line that studies them."""

from pathlib import Path

import numpy as np

from d2rpick.vibration.modes import Mode
from tests.paper import OMEGA_2
from tests.records import MODE, TIME

TD = 0.0687534  # a peak of the paper's energy [s]
STUDY = ("study", "--td", str(TD), "--jobs", "1")


def make_variant(rate: float = 1.0, size: float = 1.0) -> Mode:
    """Return the paper's oscillator with another frequency and amplitude."""
    return Mode(
        rate * OMEGA_2, MODE.alpha, size * MODE.cosine, size * MODE.sine, MODE.origin
    )


def write(path: Path, mode: Mode | None = None, end: float = 0.15) -> str:
    """Write the history of an oscillator as a table; return the file name."""
    time = TIME[: int(np.searchsorted(TIME, end, side="right"))]
    table = np.stack([time, (mode or make_variant()).energy(time)], axis=1)
    np.savetxt(
        path,
        table,
        delimiter=",",
        header="time,internal_energy",
        comments="",
        fmt="%.9g",
    )
    return str(path)


def write_variants(
    folder: Path, rates: tuple[float, ...] = (1.0, 1.001, 0.999)
) -> list[str]:
    """Write runs with different frequencies; return the file names."""
    return [
        write(folder / f"run{i}.csv", make_variant(rate))
        for i, rate in enumerate(rates, start=1)
    ]
