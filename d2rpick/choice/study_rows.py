"""What a study keeps of each run, one tr for all of them, and which of them stand out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import listing
from d2rpick.choice.acceptable_windows import common_windows, coverage, error_at
from d2rpick.choice.ranking import EQUALLY_GOOD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Samples

# A run has one of these; the first two were judged.
OK, NONE, UNREADABLE, OUT_OF_RANGE, FAILED = "ok", "none", "unreadable", "out-of-range", "failed"
# Keys of a row in JSON results that are its plain values, in the order of the output.
PLAIN: Final = (
    *("source", "tr", "tr_low", "tr_high", "energy_td", "residual", "status", "message", "basis", "warnings"),
    *("time_unit", "td"),
)
# Tukey's fences: so many times the distance of the quartiles beyond them.
_FENCE: Final = 1.5
# Runs that a sentence names.
NAMED: Final = 3
# Share of the rigid time that may be given up for a number of few digits.
_ROUNDED: Final = 0.001


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

    @property
    def plain(self) -> dict[str, Any]:
        """Its values by their keys in JSON results."""
        return {name: getattr(self, name) for name in PLAIN}


class Common(NamedTuple):
    """One tr for all judged runs and the window around it that they share [time]; None with the reason.

    ``keeps_tolerance``: whether it lies within the timing tolerance of every run, so that the error of none exceeds
    that at its own tr by more than 0.05.  ``errors`` are those of the runs at it, in their order: residuals, on the
    energy alone level errors [-]; None of a run not judged.
    """

    tr: float | None
    window: tuple[float, float] | None
    reason: str | None
    keeps_tolerance: bool | None = None
    errors: tuple[float | None, ...] = ()


def common_tr(rows: Sequence[StudyRow]) -> Common:
    """Choose one tr for all runs that were judged: the earliest that keeps the timing tolerance of every run.

    Where none does, the earliest of those acceptable in all runs at which the run that loses most by it loses hardly
    more than it must.  It has few digits, for at most a thousandth of the rigid time.
    """
    judged = [row for row in rows if row.judged]
    if not judged:
        return Common(None, None, "no run could be judged")
    shared = common_windows([row.acceptable for row in judged])
    if not shared.size:
        return Common(None, None, _why_none(judged))
    keeping = common_windows([row.alike for row in judged])
    low, high = keeping[0] if keeping.size else _least_loss(judged, shared)
    td = min(row.td for row in judged if row.td is not None)
    tr = fewest_digits(low, min(high, low + _ROUNDED * (td - low)))
    (window,) = shared[(shared[:, 0] <= tr) & (tr <= shared[:, 1])].tolist()
    errors = tuple(None if row.profile is None else error_at(row.profile, tr) for row in rows)
    return Common(tr, tuple(window), None, bool(keeping.size), errors)


def _least_loss(judged: Sequence[StudyRow], shared: Samples) -> tuple[float, float]:
    """Give the first stretch of the shared windows in which no run loses more than 0.02 above what one must lose."""
    profiles = [row.profile for row in judged if row.profile is not None]
    times = np.unique(np.concatenate([shared.ravel(), *(profile[0] for profile in profiles)]))
    times = times[(np.searchsorted(shared[:, 0], times, "right") - np.searchsorted(shared[:, 1], times)) > 0]
    worst = np.full(times.size, -np.inf)
    for row, profile in zip(judged, profiles, strict=True):
        worst = np.maximum(worst, np.interp(times, *profile) - _own_error(row, profile))
    first = int(np.argmax(worst <= worst.min() + EQUALLY_GOOD))
    holder = shared[np.searchsorted(shared[:, 0], times[first], "right") - 1]
    following = times[min(first + 1, times.size - 1)]
    return float(times[first]), float(min(following, holder[1]))


def _own_error(row: StudyRow, profile: Samples) -> float:
    return 0.0 if row.tr is None else error_at(profile, row.tr)


def fewest_digits(low: float, high: float) -> float:
    """Give a number of the fewest digits between ``low`` and ``high``: 0, or the nearest to their middle.

    Examples
    --------
    >>> fewest_digits(0.0128717, 0.0128989), fewest_digits(0.0, 0.00027)
    (0.01289, 0.0)
    """
    if low <= 0.0 <= high:
        return 0.0
    middle = (low + high) / 2
    rounded = (float(f"{middle:.{digits}g}") for digits in range(1, 18))
    return float(next((number for number in rounded if low <= number <= high), low))


def runs_of(number: int) -> str:
    """Write a number of runs."""
    return "1 run" if number == 1 else f"{number} runs"


def _why_none(judged: Sequence[StudyRow]) -> str:
    """Say which tr suits most runs, and which runs it does not suit."""
    stretches, counts = coverage([row.acceptable for row in judged])
    if not counts.size:
        which = f"any of {runs_of(len(judged))}" if len(judged) > 1 else "the run that was judged"
        return f"no tr is acceptable in {which}"
    tr = fewest_digits(*stretches[np.argmax(counts)])
    left = [row.source for row in judged if not _holds(row.acceptable, tr)]
    return (
        f"no tr is acceptable in all of {runs_of(len(judged))}; tr = {tr:.6g} is in {len(judged) - len(left)}, "
        f"not in {listing(left, most=NAMED)}"
    )


def _holds(windows: Samples, time: float) -> bool:
    return bool(np.any((windows[:, 0] <= time) & (time <= windows[:, 1])))


def outliers(rows: Sequence[StudyRow]) -> tuple[StudyRow, ...]:
    """Give the judged runs that stand out: those without a tr, then those whose tr lies beyond Tukey's fences.

    The farthest from the median come first.
    """
    without = [row for row in rows if row.judged and row.tr is None]
    chosen = [(row, row.tr) for row in rows if row.tr is not None]
    if not chosen:
        return tuple(without)
    low, middle, high = np.quantile([tr for _, tr in chosen], [0.25, 0.5, 0.75]).tolist()
    reach = _FENCE * (high - low)
    far = [(row, abs(tr - middle)) for row, tr in chosen if not low - reach <= tr <= high + reach]
    return (*without, *(row for row, _ in sorted(far, key=lambda one: -one[1])))


def short_names(sources: Sequence[str]) -> tuple[str, ...]:
    """Give of each name what tells it from the others: folders and file names that all share are left out.

    Examples
    --------
    >>> short_names(["runs/soft/glstat", "runs/hard/glstat"])
    ('soft', 'hard')
    >>> short_names(["runs/a.csv", "runs/b.csv"])
    ('a.csv', 'b.csv')
    """
    paths = [PurePath(source).parts for source in sources]
    depth = min(map(len, paths), default=0)
    first = next((i for i in range(depth) if len({path[i] for path in paths}) > 1), max(depth - 1, 0))
    last = next((i for i in range(1, depth + 1) if len({path[-i] for path in paths}) > 1), 1)
    kept = (path[first : len(path) - last + 1] or path[-1:] for path in paths)
    return tuple("/".join(part.strip("/") for part in one) or source for one, source in zip(kept, sources, strict=True))
