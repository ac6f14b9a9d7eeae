"""The runs that the pictures show; each is computed once, with the command in the documentation."""

from __future__ import annotations

import io
import shlex
from functools import cache

import pandas as pd

import d2rpick as d2
from tests.command import ENERGY, ROOT, run

# The box of the tutorial: it falls, bounces, and bounces again.
FALL = "rollover --drop 0.2 --tilt 25 --mesh 4"
FALL_WINDOWS = ((0.0, 0.197104), (0.33052, 0.671457))
FALL_FLIGHTS = ((0.0, 0.2032), (0.2991, 0.7042), (0.7728, 0.9271), (1.02, 1.1706))
# The oscillator of the samples.
OSCILLATOR = "replay --stiffness 660e3 --mass 31.4 --beta 2 --alpha 50 --v0 6 --t-end 0.15 --dt 1e-4"


@cache
def computed(command: str) -> pd.DataFrame:
    """Compute a run with a command of d2rpick, and return its table with the time as index."""
    printed = run(*shlex.split(command)).stdout
    return pd.read_csv(io.StringIO(printed)).set_index("time")


def fall(*windows: tuple[float, float]) -> pd.DataFrame:
    """Return the falling box of the tutorial, which is rigid together with its step in these windows."""
    times = "".join(f" --tr {tr} --td {td}" for tr, td in windows)
    return computed(FALL + times + (" --with-step" if windows else ""))


def oscillator(tr: float | None = None, td: float | None = None) -> pd.DataFrame:
    """Return the oscillator of the samples, rigid from tr to td."""
    times = "" if tr is None else f" --tr {tr} --td {td}"
    return computed(OSCILLATOR + times)


def deformation(table: pd.DataFrame) -> pd.Series[float]:
    """Return the elongation of the oscillator's spring [mm]."""
    return (table["z"] - table["y"]) * 1e3


@cache
def sample_oscillator() -> d2.Run:
    """Read the oscillator of the samples."""
    return d2.read(ENERGY)


@cache
def sample_rollover() -> pd.DataFrame:
    """Read the rollover of the samples, with its motion."""
    return pd.read_csv(ROOT / "sample_data" / "rollover_box.csv").set_index("time")


@cache
def validated(name: str) -> pd.DataFrame:
    """Read a table of results of the validation."""
    return pd.read_csv(ROOT / "validation" / "results" / f"{name}.csv")
