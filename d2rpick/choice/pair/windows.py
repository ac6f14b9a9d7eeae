"""Find the time windows of acceptable tr, for one run and for many."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.choice.pair.candidates import Candidate, Candidates, judge_times
from d2rpick.choice.pair.warnings import find_largest_energy
from d2rpick.histories.samples import find_crossings, halve_brackets, merge_times
from d2rpick.vibration.measures import TOLERATED_GROWTH

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from d2rpick.choice.pair.situation import Situation
    from d2rpick.histories.history import Samples

    # A function that tests times and returns True for each time that passes.
    Keeps = Callable[[Samples], NDArray[np.bool_]]

# Largest number of halvings of a sampling interval, which locate the end of a window to 1e-6 of the interval.
_HALVINGS: Final = 20
# A level is placed below the highest energy by this fraction, so that rounding does not hide the crossing [-].
_BELOW: Final = 1e-12

# Largest deviation of the error from its polyline [-], which is half a unit of the last printed digit.
_EXACT: Final = 5e-4


def find_acceptable_windows(
    situation: Situation, candidates: Candidates, recommended: float | None
) -> Samples:
    """Find the time windows of acceptable tr.

    The criteria of ``verify`` are applied to both ends and the middle of each window; the ends are acceptable, too. The
    verdict cannot change between them, because the energy is linear, or the deformation monotone, between neighbouring
    grid points.

    Parameters
    ----------
    situation : Situation
    candidates : Candidates
        All candidates.
    recommended : float or None
        The recommended tr [time]. Shortly before td, on the same half cycle, the error always stays within the
        tolerance, but hardly anything is saved. This last window is kept only if the recommended tr lies in it.

    Returns
    -------
    array of shape (n, 2)
        First and last time of each window, ascending [time].
    """
    grid = make_monotone_grid(situation, candidates)
    widest = _find_windows(grid, _make_rule(situation))
    judged = judge_times(
        situation,
        np.append(widest, widest.mean(axis=1, keepdims=True), axis=1).ravel().tolist(),
    )
    acceptable = widest[judged.recommendable.reshape(-1, 3).all(axis=1)]
    if situation.at_rest:
        return acceptable
    if (
        acceptable.size
        and acceptable[-1, 1] >= grid[-1]
        and not (recommended is not None and acceptable[-1, 0] <= recommended)
    ):
        acceptable = acceptable[:-1]
    return acceptable


def cut_before_td(situation: Situation, windows: Samples) -> Samples:
    """End the windows one output interval before td, because a later tr saves nothing."""
    time = situation.history.time
    state = int(np.searchsorted(time, situation.td))
    end = situation.td - float(time[state] - time[state - 1])
    early = windows[windows[:, 0] < end]
    return np.stack([early[:, 0], np.minimum(early[:, 1], end)], axis=1)


def find_alike_windows(
    situation: Situation, candidates: Candidates, chosen: Candidate, acceptable: Samples
) -> Samples:
    """Find the acceptable windows in which the error of a tr exceeds that of the chosen tr by at most 0.05.

    The timing tolerance of a candidate is the time by which it may be wrong before its frozen-deformation error grows
    by 0.05. If only the energy is known, the level error replaces this error.

    Parameters
    ----------
    situation : Situation
    candidates : Candidates
        All candidates.
    chosen : Candidate
    acceptable : array of shape (n, 2)
        The result of ``find_acceptable_windows``.

    Returns
    -------
    array of shape (k, 2)
        First and last time of each window, ascending [time].
    """
    level = float(situation.errors(np.array([chosen.tr]))[0]) + TOLERATED_GROWTH
    return find_common_windows(
        [
            acceptable,
            _find_windows(
                make_monotone_grid(situation, candidates),
                _make_limit_on_error(situation, level),
            ),
        ]
    )


def count_coverage(
    runs: Sequence[Samples],
) -> tuple[Samples, np.ndarray[tuple[int], np.dtype[np.intp]]]:
    """For each time, count the runs that have a window containing it.

    Parameters
    ----------
    runs : sequence of array of shape (n, 2)
        Windows of each run, ends included, ascending and disjoint [time].

    Returns
    -------
    stretches : array of shape (k, 2)
        Intervals of constant count above 0, ascending; a single time if windows only touch [time].
    counts : array of shape (k,)

    Examples
    --------
    >>> stretches, counts = count_coverage([np.array([[0.0, 2.0]]), np.array([[1.0, 3.0]])])
    >>> stretches.tolist(), counts.tolist()
    ([[0.0, 1.0], [1.0, 2.0], [2.0, 3.0]], [1, 2, 1])
    """
    ends = np.concatenate([np.zeros((0, 2)), *runs])
    times = ends.T.ravel()
    steps = np.repeat([1, -1], len(ends))
    # At equal times, starts are sorted before ends, because windows include their ends.
    order = np.lexsort((-steps, times))
    counts = np.cumsum(steps[order])[:-1]
    stretches = np.stack([times[order][:-1], times[order][1:]], axis=1)
    # Two windows have no gap between them if one starts at the time at which the other ends.
    ordered = steps[order]
    touching = (ordered[:-1] > 0) & (ordered[1:] < 0)
    lasting = (stretches[:, 0] < stretches[:, 1]) | touching
    is_counted = lasting & (counts > 0)
    return stretches[is_counted], counts[is_counted]


def find_common_windows(runs: Sequence[Samples]) -> Samples:
    """Return the windows that all runs share, shape (k, 2) [time].

    Examples
    --------
    >>> find_common_windows([np.array([[0.0, 2.0], [4.0, 5.0]]), np.array([[1.0, 4.5]])]).tolist()
    [[1.0, 2.0], [4.0, 4.5]]
    """
    stretches, counts = count_coverage(runs)
    return np.asarray(stretches[counts == len(runs)])


def make_monotone_grid(situation: Situation, candidates: Candidates) -> Samples:
    """Return times in the flight before td [time]. Between two of them, the verdict on tr changes at most once."""
    history = situation.history
    td = situation.td
    start = situation.earliest_tr
    if start is None or start >= td:
        return np.zeros(0)
    ends = [start, np.nextafter(td, -np.inf)]
    # Times at which the energy is just below its limit are included, because it may exceed the limit between samples.
    highest_crossings = find_crossings(
        history.time, history.energy, (1 - _BELOW) * find_largest_energy(situation)
    )[0]
    times = np.concatenate(
        [
            history.time,
            candidates.tr,
            highest_crossings,
            situation.vibration.knots(),
            ends,
        ]
    )
    return merge_times(times[(times >= max(start, history.start)) & (times < td)])


def _make_limit_on_error(situation: Situation, level: float) -> Keeps:
    """Return a predicate that accepts a tr if its error is at most ``level`` and its energy at most a given limit."""
    highest = find_largest_energy(situation)

    def has_small_error(times: Samples) -> NDArray[np.bool_]:
        is_small = situation.errors(times) <= level
        if highest < np.inf:
            is_small &= situation.vibration.whole.energies(times) <= highest
        return np.asarray(is_small)

    return has_small_error


def _make_rule(situation: Situation) -> Keeps:
    """Return a test of times for tr that requires an acceptable error and all limits of the settings."""
    has_small_error = _make_limit_on_error(situation, situation.most_error)
    has_limits = any(True for _ in situation.settings.limits)

    def keeps_rule(times: Samples) -> NDArray[np.bool_]:
        # If nothing vibrates, every tr before td is acceptable unless td itself is not.
        keeps = (
            np.ones(times.shape, np.bool_)
            if situation.at_rest
            else has_small_error(times)
        )
        if has_limits:
            keeps &= judge_times(situation, times.tolist()).judged.within_limits
        return keeps

    return keeps_rule


def _find_windows(grid: Samples, keeps: Keeps) -> Samples:
    """Return the windows in which the times of a grid pass a test, shape (n, 2) [time]."""
    inside = np.pad(keeps(grid), 1)
    first = np.flatnonzero(inside[1:-1] & ~inside[:-2])
    last = np.flatnonzero(inside[1:-1] & ~inside[2:])
    inner = grid[np.stack([first, last], axis=1)]
    if not inner.size:
        return inner
    beyond = grid[np.clip([first - 1, last + 1], 0, grid.size - 1).T]
    return halve_brackets(
        lambda t: keeps(t.ravel()).reshape(t.shape), inner, beyond, _HALVINGS
    )


def make_error_profile(
    situation: Situation, candidates: Candidates, windows: Samples
) -> Samples:
    """Return the error of tr in the windows as the points of a polyline with an accuracy of 0.0005.

    Parameters
    ----------
    situation : Situation
    candidates : Candidates
        All candidates; they are needed because the level error has a kink at each crossing.
    windows : array of shape (n, 2)
        Windows of acceptable tr, ascending [time].

    Returns
    -------
    array of shape (2, m)
        Ascending times [time], and the errors as in `Candidate.error` [-]: the residual R or, if only the energy is
        known, the level error. Between two windows the polyline has no meaning.
    """
    if not windows.size:
        return np.zeros((2, 0))
    inner = make_monotone_grid(situation, candidates)
    times = merge_times(inner[_is_inside(inner, windows)], windows)
    errors = _compute_errors(situation, times)
    for _ in range(_HALVINGS):
        middles = (times[1:] + times[:-1]) / 2
        is_between = (times[:-1] < middles) & (middles < times[1:])
        middles = middles[is_between & _is_inside(middles, windows)]
        errors_between = _compute_errors(situation, middles)
        deviations = errors_between - np.interp(middles, times, errors)
        bent = np.abs(deviations) > _EXACT / 2
        if not bent.any():
            break
        times = np.append(times, middles[bent])
        errors = np.append(errors, errors_between[bent])
        order = np.argsort(times)
        times, errors = times[order], errors[order]
    return _thin_out(times, errors, windows)


def interpolate_error(profile: Samples, time: float) -> float:
    """Return the error at a time in one of the windows of an error profile [-]."""
    return float(np.interp(time, *profile))


def _compute_errors(situation: Situation, times: Samples) -> Samples:
    """Return the residuals or, where they are unknown, the level errors of the energy, in the shape of ``times`` [-].

    A residual includes the error band of the model, so it may exceed the error that is compared with the tolerance.
    """
    if situation.at_rest or not times.size:
        return np.zeros(times.shape)
    errors = situation.vibration.compute_residuals(times)
    is_unknown = np.isnan(errors)
    if is_unknown.any():
        kinetic_share = situation.kinetic_share or 0.0
        compared = np.sqrt(situation.errors(times) ** 2 + kinetic_share)
        errors[is_unknown] = compared[is_unknown]
    return errors


def _is_inside(times: Samples, windows: Samples) -> NDArray[np.bool_]:
    """Return an array that is True for each time that lies in one of the windows."""
    window = np.searchsorted(windows[:, 0], times, side="right") - 1
    return np.asarray((window >= 0) & (times <= windows[window, 1]))


def _thin_out(times: Samples, errors: Samples, windows: Samples) -> Samples:
    """Thin out a curve: keep the ends of windows and, between them, the points farthest from straight lines."""
    is_kept = np.zeros(times.shape, np.bool_)
    is_kept[np.searchsorted(times, windows)] = True
    while True:
        points = np.flatnonzero(is_kept)
        deviations = np.abs(errors - np.interp(times, times[points], errors[points]))
        worst = np.repeat(
            np.maximum.reduceat(deviations, points), np.diff(points, append=times.size)
        )
        new = np.flatnonzero((deviations == worst) & (deviations > _EXACT / 2))
        if not new.size:
            return np.stack([times[points], errors[points]])
        is_kept[new] = True
