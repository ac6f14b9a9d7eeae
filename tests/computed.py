"""Runs computed by a solver: small copies in tests/data, and the tables of results of the validation."""

import gzip
from pathlib import Path

import numpy as np

from d2rpick.histories.history import Samples
from tests.command import ROOT

DATA = ROOT / "tests" / "data"


def locate_stored(name: str) -> str:
    """Return the path of a file in tests/data."""
    return str(DATA / name)


def locate_results(name: str) -> Path:
    """Return the path of the table with the results of the switched runs."""
    return ROOT / "validation" / "results" / name


def read_starter(model: str) -> bytes:
    """Return the content of the starter deck of a model."""
    return read_unpacked(str(ROOT / "validation" / "decks" / f"{model}_0000.rad.gz"))


def read_unpacked(name: str) -> bytes:
    """Return the content of a gzip file."""
    return gzip.decompress(Path(name).read_bytes())


def read_columns(name: str, energy: str) -> tuple[Samples, Samples]:
    """Read the columns ``time_s`` and ``energy`` of a table."""
    table = np.genfromtxt(name, delimiter=",", names=True)
    return table["time_s"], table[energy]
