"""Runs that a solver computed: small copies of them in tests/data, and what the validation keeps."""

import gzip
from pathlib import Path

import numpy as np

from d2rpick.histories.history import Samples
from tests.command import ROOT

DATA = ROOT / "tests" / "data"


def stored(name: str) -> str:
    """Name of a file in tests/data."""
    return str(DATA / name)


def results(name: str) -> Path:
    """Path of a table in which switched runs were evaluated when they were computed."""
    return ROOT / "validation" / "results" / name


def starter(model: str) -> bytes:
    """Starter deck of a model."""
    return unpacked(str(ROOT / "validation" / "decks" / f"{model}_0000.rad.gz"))


def unpacked(name: str) -> bytes:
    """Content of a packed file."""
    return gzip.decompress(Path(name).read_bytes())


def columns(name: str, energy: str) -> tuple[Samples, Samples]:
    """Columns ``time_s`` and ``energy`` of a table."""
    table = np.genfromtxt(name, delimiter=",", names=True)
    return table["time_s"], table[energy]
