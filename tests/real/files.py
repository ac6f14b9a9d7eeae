"""Files from other people, written by real solvers; they are not part of the project, and other tests do not need them.

This is the only place that knows where they lie: D2RPICK_REAL names the folder, else it is ``../shared/real`` beside
the clone.  Where it is absent, the tests in this folder are left out (``tests/alone.py``).
"""

from __future__ import annotations

import csv
import os
from pathlib import Path

REAL = Path(
    os.environ.get("D2RPICK_REAL")
    or Path(__file__).resolve().parents[3] / "shared" / "real"
).absolute()


def real(name: str) -> str:
    """Name of a file or folder below that folder, which must exist."""
    path = REAL / name
    assert path.exists(), f"{path} is absent"
    return str(path)


def content(name: str) -> bytes:
    """Content of a history."""
    return Path(real(f"histories/{name}")).read_bytes()


def rows_of(table: str) -> list[dict[str, str]]:
    """Rows of a table of expected numbers beside this file."""
    return list(
        csv.DictReader(
            Path(__file__).with_name(f"{table}.csv").read_text("utf-8").splitlines()
        )
    )
