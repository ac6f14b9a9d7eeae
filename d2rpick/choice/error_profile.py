"""The error of every acceptable tr of one run, in so few points that many runs can be kept beside each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.choice.acceptable_windows import monotone_grid

if TYPE_CHECKING:
    from d2rpick.choice.candidates import Candidates
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# What a straight line between two points may be off by [-]: half of the last digit that is shown.
_EXACT: Final = 5e-4
# Halvings of an interval in which the error is no straight line: the root of an energy that falls to zero is one to a
# four-thousandth then, a parabola much sooner.
_HALVINGS: Final = 20


def error_profile(situation: Situation, candidates: Candidates, windows: Samples) -> Samples:
    """Give the error of a tr in windows as points between which it is a straight line, to within 0.0005.

    Parameters
    ----------
    situation : Situation
    candidates : Candidates
        All of them: at a crossing the level error has a kink.
    windows : array of shape (n, 2)
        Of acceptable tr, ascending [time].

    Returns
    -------
    array of shape (2, m)
        Times, ascending, and errors: the residual R, on the energy alone the level error, as `Candidate.error` [-].
        Between two windows they say nothing.
    """
    if not windows.size:
        return np.zeros((2, 0))
    inner = monotone_grid(situation, candidates)
    times = np.union1d(inner[_inside(inner, windows)], windows)
    for _ in range(_HALVINGS):
        middles = (times[1:] + times[:-1]) / 2
        middles = middles[_inside(middles, windows)]
        bent = np.abs(_errors(situation, middles) - np.interp(middles, times, _errors(situation, times))) > _EXACT / 2
        if not bent.any():
            break
        times = np.union1d(times, middles[bent])
    return _thinned(times, _errors(situation, times), windows)


def error_at(profile: Samples, time: float) -> float:
    """Error at a time in one of the windows of a profile [-]."""
    return float(np.interp(time, *profile))


def _errors(situation: Situation, times: Samples) -> Samples:
    """Residuals, or level errors on the energy alone, of the shape of ``times`` [-]."""
    return np.asarray(np.sqrt(situation.errors(times) ** 2 + (situation.kinetic_share or 0.0)))


def _inside(times: Samples, windows: Samples) -> Samples:
    """Whether each time lies in a window."""
    window = np.searchsorted(windows[:, 0], times, side="right") - 1
    return np.asarray((window >= 0) & (times <= windows[window, 1]))


def _thinned(times: Samples, errors: Samples, windows: Samples) -> Samples:
    """Leave out what lies on a line: the ends of the windows stay, then the worst point between any two that stay."""
    kept = np.flatnonzero(np.isin(times, windows))
    while True:
        off = np.abs(errors - np.interp(times, times[kept], errors[kept]))
        worst = np.repeat(np.maximum.reduceat(off, kept), np.diff(kept, append=times.size))
        new = np.flatnonzero((off == worst) & (off > _EXACT / 2))
        if not new.size:
            return np.stack([times[kept], errors[kept]])
        kept = np.union1d(kept, new)
