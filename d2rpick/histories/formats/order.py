"""Whether the times of one table are those of one run: increasing, or those of a run that was restarted once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# A restarted run goes on with its output interval; another curve or an unsorted table has another one.
_ALIKE = 2.0


def not_a_restart(time: Samples) -> int | None:
    """Find the first state at which times (n,) step back as those of one run do not; None where they never do.

    One step back is a restart: it does not go back to the start, and the interval behind it, as the median of all
    behind it, is half to twice the median of those before.

    Examples
    --------
    >>> not_a_restart(np.array([0.0, 1.0, 2.0, 3.0, 1.5, 2.5])), not_a_restart(np.array([0.0, 1.0, 0.0, 1.0]))
    (None, 2)
    """
    back = np.flatnonzero(np.diff(time) < 0) + 1
    if back.size == 0:
        return None
    first = int(back[0])
    if back.size > 1 or time[first] <= time[0]:
        return first
    before, behind = (np.diff(one) for one in np.split(time, [first]))
    ratios = [_median(steps) / _median(before) for steps in (behind, behind[:1])]
    return first if any(ratio < 1 / _ALIKE or ratio > _ALIKE for ratio in ratios) else None


def _median(steps: Samples) -> float:
    steps = steps[steps > 0]  # equal printed times are no interval
    return float(np.median(steps)) if steps.size else np.nan  # which is neither too small nor too large
