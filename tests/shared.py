"""Files computed by a real solver, which are not part of the repository."""

from __future__ import annotations

import gzip
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

SHARED = Path(os.environ.get("D2RPICK_SHARED", Path(__file__).resolve().parents[2] / "shared"))


def shared(relative: str) -> Path:
    """Path of a shared file; skips the test where it is absent."""
    path = SHARED / relative
    if not path.exists():
        pytest.skip(f"{path} is absent; D2RPICK_SHARED names the folder that holds {relative}")
    return path


def shared_bytes(relative: str) -> bytes:
    """Content of a shared file, unpacked."""
    path = shared(relative)
    return gzip.decompress(path.read_bytes()) if path.suffix == ".gz" else path.read_bytes()


def columns(relative: str, energy: str) -> tuple[Samples, Samples]:
    """Columns ``time_s`` and ``energy`` of a shared CSV file."""
    table = np.genfromtxt(shared(relative), delimiter=",", names=True)
    return table["time_s"], table[energy]
