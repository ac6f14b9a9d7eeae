"""One tr for many runs: the earliest that is good in all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.choice.acceptable_windows import common_windows, coverage
from d2rpick.choice.error_profile import error_at
from d2rpick.choice.ranking import EQUALLY_GOOD
from d2rpick.errors import listing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.studies.row import StudyRow

# Runs that a sentence names.
NAMED: Final = 3
# Share of the rigid time that may be given up for a number of few digits.
_ROUNDED: Final = 0.001


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
