"""What a study keeps of one run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# A run has one of these; the first two were judged.
OK, NONE, UNREADABLE, OUT_OF_RANGE, FAILED = "ok", "none", "unreadable", "out-of-range", "failed"


class Stamp(NamedTuple):
    """A file as it was when its run was read: size in bytes, modification time in nanoseconds."""

    name: str
    size: int
    mtime_ns: int


@dataclass(frozen=True, eq=False)
class StudyRow:
    """Answer for one run; times in the unit of its history, None for what is not known.

    ``status``: "ok"; "none", nothing can be recommended; "unreadable"; "out-of-range", the record does not reach td or
    is too short to choose; "failed", its process died; "internal-error", the program failed on it.  ``message`` says
    why it is not "ok"; ``warnings`` are codes.  ``td`` is that of the run; ``acceptable`` are its windows of
    acceptable tr, shape (n, 2), ``alike`` those in which the error is at most 0.05 above that of its tr, ``profile``
    the errors, shape (2, m).  ``files`` is what was read; ``curve`` an outline of the energy, shape (2, k), where one
    was asked for.
    """

    source: str
    status: str
    message: str | None = None
    tr: float | None = None
    tr_low: float | None = None
    tr_high: float | None = None
    energy_td: float | None = None
    residual: float | None = None
    basis: str | None = None
    time_unit: str = ""
    warnings: tuple[str, ...] = ()
    td: float | None = None
    acceptable: Samples = field(default_factory=lambda: np.zeros((0, 2)))
    alike: Samples = field(default_factory=lambda: np.zeros((0, 2)))
    profile: Samples | None = None
    files: tuple[Stamp, ...] = ()
    curve: Samples | None = None

    @property
    def judged(self) -> bool:
        """Whether the run could be read and judged."""
        return self.status in (OK, NONE)
