"""Companions: databases of different formats that one run wrote, and whether they can be of one run."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.database import Legs
    from d2rpick.histories.history import Samples

# Output intervals may differ, but a solver writes at its own cycles: unless less than this share of the states of the
# coarser database are at times of the other one, both may be of one run.
_FEWEST = 0.5


def check_companions(databases: Sequence[Legs]) -> None:
    """Refuse databases that have no time in common."""
    for one, other in combinations(databases, 2):
        if one.span and other.span and (one.span[0] > other.span[1] or other.span[0] > one.span[1]):
            raise FormatError(f"{one.source} and {other.source} have no time in common, files of one run were expected")


def doubts(databases: Sequence[Legs]) -> Iterator[str]:
    """Say which databases have hardly a state at the same time, within their printed digits."""
    for one, other in combinations(databases, 2):
        if not (one.span and other.span):
            continue
        times = [_times(database) for database in (one, other)]
        room = sum(d.precisions(())[0].quantum(float(t[-1])) for d, t in zip((one, other), times, strict=True))
        coarse, fine = sorted(_common(*times), key=np.size)
        shared = coinciding(coarse, fine, room / 2)
        if shared < _FEWEST * coarse.size:
            yield (
                f"{one.source} and {other.source} have only {shared} of {coarse.size} states at the same times; "
                "are they of one run?"
            )


def coinciding(times: Samples, others: Samples, room: float) -> int:
    """Count the times that lie within ``room`` [time] of one of the others, which increase.

    Examples
    --------
    >>> coinciding(np.array([0.0, 0.0048730, 0.0099579]), np.array([0.0, 0.00487301, 0.00995]), 5e-7)
    2
    """
    if not others.size:
        return 0
    behind = np.searchsorted(others, times)
    near = [np.abs(others[np.clip(behind - step, 0, others.size - 1)] - times) for step in (0, 1)]
    return int(np.count_nonzero(np.minimum(*near) <= room))


def _times(database: Legs) -> Samples:
    return database.time if database.channels else database.part_time


def _common(one: Samples, other: Samples) -> tuple[Samples, Samples]:
    """What of two increasing records of times lies in the span of both."""
    low, high = max(one[0], other[0]), min(one[-1], other[-1])
    return one[(one >= low) & (one <= high)], other[(other >= low) & (other <= high)]
