"""Add the comparison of a finished switched run with its reference run to the verdict on a pair."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.errors import Caution
from d2rpick.choice.health import warn_about_engine
from d2rpick.choice.pair.decision import FINISH_SWITCHED_RUN
from d2rpick.choice.switched.comparison import compare_with_reference
from d2rpick.choice.switched.switch_times import sort_windows

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.choice.answers import PairVerdict
    from d2rpick.choice.question import Reference
    from d2rpick.choice.switched.comparison import Comparison
    from d2rpick.choice.switched.switch_times import SwitchedWindow
    from d2rpick.histories.history import History


def add_comparison(
    verdict: PairVerdict,
    reference: Reference,
    switched: Reference,
    windows: Sequence[SwitchedWindow],
    min_mean: float = 0.0,
    *,
    tr_is_read: bool = False,
) -> PairVerdict:
    """Add the comparison of a finished switched run with the reference run to a verdict.

    Both runs are read in the same way. ``windows`` are those in which the switched run was rigid. ``min_mean`` is the
    smallest expected mean energy after td, relative to that of the reference run [-]. ``tr_is_read`` is True if the tr
    of the verdict was read from the switched run.

    Raises
    ------
    RangeError
        If one of the two runs does not continue after td.
    """
    tr = verdict.candidate.tr
    comparison = compare_with_reference(
        verdict.situation,
        tr,
        reference,
        switched,
        sort_windows(windows, (tr, verdict.td)),
        min_mean,
    )
    reasons = verdict.reasons + comparison.objections
    if comparison.is_of_other_run:
        # Nothing else in the comparison means anything.
        reasons = comparison.objections + verdict.reasons
    interval = _find_output_interval(switched.history, tr) if tr_is_read else None
    return replace(
        verdict,
        switched=comparison,
        # A wrong energy is not drawn over that of the reference run.
        computed=None if comparison.misreported else switched.history,
        tr_interval=interval,
        # If the switched run deviates too much, the pair is inadmissible, whatever the reference run shows.
        admissible=verdict.admissible and not comparison.objections,
        reasons=reasons,
        cautions=(
            *verdict.cautions,
            *warn_about_engine(switched.run.sources),
            *_warn_about_end(comparison),
        ),
    )


def _warn_about_end(comparison: Comparison) -> Iterator[Caution]:
    """Yield a warning if the switched run agrees with the reference run, but ended too early or with an error."""
    if comparison.is_incomplete:
        yield Caution(
            "switched-run-ended",
            f"{comparison.objections[-1]}; the comparison is within its limits up to {comparison.end:.6g}, but shows "
            f"nothing after this time; {FINISH_SWITCHED_RUN}",
        )


def _find_output_interval(history: History, time: float) -> float:
    """Return the length of the output interval of a history that contains a ``time`` [time]."""
    later = int(np.searchsorted(history.time, time, "right"))
    later = min(later, history.time.size - 1)
    return float(history.time[later] - history.time[later - 1])
