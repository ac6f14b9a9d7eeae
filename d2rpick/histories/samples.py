"""Compute with sampled curves: valid states, integrals, level crossings, turning points, outlines and roots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Samples = NDArray[np.float64]

# A table has a row for each part and time if at least this fraction of its states repeat the previous time [-].
_REPEATED: Final = 0.49
# A note on times that step back begins with these words.
STEPS_BACK: Final = "time steps back"
# Smallest number of times that are examined, because equal times in fewer rows may be a coincidence.
FEWEST_TIMES: Final = 3
# Largest ratio of the output intervals before and after a restart [-]; unsorted tables and curves exceed it.
_ALIKE = 2.0
# An interval without states exceeds this multiple of the median interval and of the intervals beside it [-].
_LONG: Final = 30.0
# Smallest number of states among which an interval without states is recognised.
_FEWEST_AROUND_HOLE: Final = 4
# Number of states whose time steps are compared at a time, so that these states fit into the processor cache.
_PIECE: Final = 1 << 15
# Smallest number of changes from state to state that can be told from noise.
_FEWEST_OF_NOISE: Final = 40
# _STRONGEST: fraction of the spectral lines that are treated as the strongest [-].
# _POWER_OF_LINES: smallest fraction of the power in these lines if a vibration causes it [-]; white noise has 0.4.
_STRONGEST, _POWER_OF_LINES = 0.1, 0.6
# Number of adjacent windows that form one window on the next level of the search table.
_TOGETHER: Final = 8
# A root has converged if its time changes by at most this fraction [-], which is about the rounding error.
_STILL: Final = 8 * float(np.finfo(np.float64).eps)
# Number of halvings of a root bracket that are evaluated in one call if there are at most _FEW brackets.
_HALVED_TOGETHER: Final = 5
_FEW: Final = 100  # Above this number of brackets, evaluating several halvings at once costs more than it saves.
# Number of bisections that narrow a bracket to the rounding error.
HALVINGS: Final = 50


def find_window(time: Samples, start: float, end: float) -> slice:
    """Return the slice of ascending times from ``start`` to ``end``, both included [time].

    Examples
    --------
    >>> find_window(np.array([0.0, 1.0, 2.0, 3.0]), 1.0, 2.0)
    slice(1, 3, None)
    """
    first, last = np.searchsorted(time, [start, np.nextafter(end, np.inf)]).tolist()
    return slice(first, last)


def get_ends(time: Samples) -> tuple[float, ...]:
    """Return the first and last of the times (n,), which identify a window of a record; empty without times."""
    return (*time[:1].tolist(), *time[-1:].tolist())


def integrate_by_trapezia(time: Samples, values: Samples) -> Samples:
    """Return the cumulative trapezoidal integral of values (n,) or (n, k), starting at the first time.

    Examples
    --------
    >>> integrate_by_trapezia(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 2.0])).tolist()
    [0.0, 1.0, 5.0]
    """
    areas = (values[1:] + values[:-1]).T
    areas *= np.diff(time)
    areas /= 2
    return np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(areas.T, axis=0, out=areas.T)]
    )


def compute_median(values: Samples) -> Samples:
    """Return the median of values (n,) or (n, k) over the first axis without importing numpy.ma, which is slow.

    Examples
    --------
    >>> compute_median(np.array([[3.0, 1.0], [1.0, 1.0], [2.0, 5.0], [4.0, 2.0]])).tolist()
    [2.5, 1.5]
    """
    ends = [(len(values) - 1) // 2, len(values) // 2]
    return np.asarray(np.partition(values, ends, axis=0)[ends].sum(axis=0) / 2)


def remove_line(time: Samples, values: Samples) -> Samples:
    """Return the residual of each column of values (n, k) after a linear fit over time.

    Examples
    --------
    >>> remove_line(np.array([0.0, 1.0, 2.0]), np.array([[1.0, 0.0], [2.0, 3.0], [3.0, 0.0]])).round(12).tolist()
    [[0.0, -1.0], [0.0, 2.0], [0.0, -1.0]]
    """
    # The sum is used instead of mean(), which is slow for only a few values.
    t = time - time.sum() / time.size
    centred = values - values.sum(axis=0) / time.size
    columns = centred.T
    columns -= np.multiply.outer(t @ centred / (t @ t), t)
    return np.asarray(centred)


def find_holes(time: Samples) -> tuple[tuple[float, float], ...]:
    """Return the intervals without states, such as those of a missing restart segment, in ascending order [time].

    Such an interval is much longer than the usual ones and than those beside it: if a run is written less often for a
    while, the intervals beside each other are alike.

    Examples
    --------
    >>> find_holes(np.array([*range(50), *range(100, 150)], dtype=float))
    ((49.0, 100.0),)
    >>> find_holes(np.array([*range(50), *range(100, 1000, 50)], dtype=float))
    ()
    """
    if time.size < _FEWEST_AROUND_HOLE:
        return ()
    pieces = (
        np.diff(time[first : first + _PIECE + 1])
        for first in range(0, time.size - 1, _PIECE)
    )
    shortest, longest = zip(
        *((piece.min(), piece.max()) for piece in pieces), strict=True
    )
    # Output intervals are usually regular, so that there are no holes to search for.
    if max(longest) <= _LONG * min(shortest):
        return ()
    steps = np.diff(time)
    beside = np.maximum(np.append(0.0, steps[:-1]), np.append(steps[1:], 0.0))
    usual = float(np.sort(steps)[steps.size // 2])
    holes = np.flatnonzero(steps > _LONG * np.maximum(beside, usual))
    return tuple((float(time[hole]), float(time[hole + 1])) for hole in holes)


def find_hole_around(
    holes: Sequence[tuple[float, float]], moment: float
) -> tuple[float, float] | None:
    """Return the interval without states that contains a time [time]; None if a state is written near it."""
    return next(((start, end) for start, end in holes if start < moment < end), None)


def find_newest_states(time: Samples) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Return a mask of the valid states of a file, and notes on the invalid states.

    A state is replaced by any later state with an equal or earlier time: of several equal printed times, the last one
    is valid, and after a restart that goes back in time, the newer restart segment is valid.

    Parameters
    ----------
    time : array of shape (n,)
        Times in the order of the file [time].

    Returns
    -------
    keep : array of bool, shape (n,)
        ``time[keep]`` increases strictly.
    notes : tuple of str
        A sentence for each kind of omitted state.

    Examples
    --------
    >>> keep, notes = find_newest_states(np.array([0.0, 1.0, 2.0, 1.5, 2.5, 2.5]))
    >>> keep.tolist()
    [True, True, False, True, False, True]
    """
    if np.all(time[1:] > time[:-1]):  # Usually, all times are ascending.
        return np.ones(time.size, dtype=bool), ()
    step = np.diff(time)
    equal = int(np.count_nonzero(step == 0))
    back = int(np.count_nonzero(step < 0))
    later = np.minimum.accumulate(time[::-1])[::-1]
    keep = np.append(time[:-1] < later[1:], np.ones(min(1, time.size), dtype=bool))
    notes = []
    if equal:
        states = "1 state has" if equal == 1 else f"{equal} states have"
        notes.append(
            f"{states} the same printed time as the next one; the last of equal times is used"
        )
    if back:
        steps = "once" if back == 1 else f"{back} times"
        first = int(np.flatnonzero(step < 0)[0])
        place = f"{'' if back == 1 else 'first '}from {time[first]:.6g} to {time[first + 1]:.6g}"
        lost = int(np.count_nonzero(~keep)) - equal
        dropped = "1 older state was" if lost == 1 else f"{lost} older states were"
        notes.append(
            f"{STEPS_BACK} {steps}, {place} (restart); the newer restart segment is used where they "
            f"overlap, and {dropped} dropped; if the run was not restarted, sort the rows by time"
        )
    return keep, tuple(notes)


def count_rows_per_time(time: Samples) -> int:
    """Return the median number of rows per time (n,); 1 if most times occur in only one row.

    Examples
    --------
    >>> count_rows_per_time(np.array([0.0, 0.0, 0.1, 0.1, 0.2, 0.2])), count_rows_per_time(np.array([0.0, 0.1, 0.1]))
    (2, 1)
    """
    repeated = np.count_nonzero(time[1:] == time[:-1])
    if time.size < 2 * FEWEST_TIMES or repeated < _REPEATED * time.size:
        return 1
    first_rows = np.flatnonzero(np.append(True, time[1:] != time[:-1]))
    rows = np.diff(np.append(first_rows, time.size))
    return int(np.sort(rows)[rows.size // 2])


def check_one_run(time: Samples, place: Callable[[int], str]) -> Samples:
    """Return times (n,) unchanged; if they belong to several runs, raise a FormatError with the place of the state."""
    state = _find_wrong_step_back(time)
    if state is None:
        return time
    problem = (
        f"{place(state)}: time steps back from {time[state - 1]:g} to {time[state]:g}"
    )
    if time[state] <= time[0]:
        cure = "another curve or part begins here: put each into its own file"
    else:
        cure = "sort the rows, or put each curve into its own file"
    raise FormatError(
        f"{problem}, but increasing times or one restart were expected; {cure}"
    )


def _find_wrong_step_back(time: Samples) -> int | None:
    """Return the first state at which times (n,) decrease although no restart explains it; None if there is none.

    A single decrease is a restart if the time does not return to the start, and if the first and the median interval
    after it are half to twice the median interval before it.

    Examples
    --------
    >>> _find_wrong_step_back(np.array([0.0, 1.0, 2.0, 3.0, 1.5, 2.5]))
    >>> _find_wrong_step_back(np.array([0.0, 1.0, 0.0, 1.0]))
    2
    """
    back = np.flatnonzero(time[1:] < time[:-1]) + 1
    if back.size == 0:
        return None
    first = int(back[0])
    if back.size > 1 or time[first] <= time[0]:
        return first
    before_restart, after_restart = (np.diff(leg) for leg in np.split(time, [first]))
    for steps in (after_restart, after_restart[:1]):
        ratio = _compute_median_step(steps) / _compute_median_step(before_restart)
        if ratio < 1 / _ALIKE or ratio > _ALIKE:
            return first
    return None


def _compute_median_step(steps: Samples) -> float:
    """Return the median time step, ignoring steps between equal printed times; NaN if no other steps exist."""
    steps = steps[steps > 0]
    return float(compute_median(steps)) if steps.size else np.nan


def find_crossings(
    time: Samples, energy: Samples, level: float
) -> tuple[Samples, NDArray[np.bool_]]:
    """Return the times (k,) at which ``energy`` crosses ``level``, ascending, and a mask (k,) of rising crossings.

    The energy is assumed to be linear between samples; for piecewise linear data, the result is exact except for
    rounding. The energy crosses the level if it is on different sides before and after:

    * a sample exactly on the level is one crossing, at that sample; a plateau on the level is one, at its first sample;
    * touching the level and turning back is no crossing (``find_turns`` gives such points);
    * a record that begins on the level has a crossing at its first sample, one that ends on it has one where it reaches
      the level; ``rising`` then follows from the only side there is.  A record that stays on the level has no crossing.

    Parameters
    ----------
    time, energy : array of shape (n,)
        Increasing times [time] and energies [energy].
    level : float
        [energy]

    Examples
    --------
    >>> find_crossings(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 4.0, 1.0, 2.0]), 1.0)
    (array([0.25]), array([ True]))
    """
    side = _compare_sides(energy, level)
    off_level = np.flatnonzero(side)
    if not off_level.size:
        return np.zeros(0), np.zeros(0, dtype=bool)
    turn = np.flatnonzero(np.diff(side[off_level]))
    index_before = off_level[turn]
    index_after = off_level[turn + 1]
    # If several samples lie on the level, the first of them is the crossing.
    share = np.where(
        index_after == index_before + 1,
        (level - energy[index_before])
        / (energy[index_before + 1] - energy[index_before]),
        1.0,
    )
    at = time[index_before] + share * (time[index_before + 1] - time[index_before])
    rising = side[index_after] > 0
    if off_level[0] > 0:
        at = np.append(time[0], at)
        rising = np.append(side[off_level[0]] > 0, rising)
    if off_level[-1] < side.size - 1:
        at = np.append(at, time[off_level[-1] + 1])
        rising = np.append(rising, side[off_level[-1]] < 0)
    return at, rising


def find_turns(energy: Samples) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the indices (k,) of the extrema of the energy (n,), and a mask (k,) of the maxima.

    A flat top or bottom is a single extremum at its first sample; the ends are not extrema.

    Examples
    --------
    >>> find_turns(np.array([0.0, 4.0, 4.0, 2.0]))
    (array([1]), array([ True]))
    """
    slope = _compare_sides(energy[1:], energy[:-1])
    moving = np.flatnonzero(slope)
    turn = np.flatnonzero(np.diff(slope[moving]))
    return moving[turn] + 1, slope[moving[turn]] > 0


def changes_at_random(energy: Samples) -> bool:
    """Return True if the changes of an energy from state to state are noise rather than a fast vibration.

    A vibration has its power in few spectral lines. Noise has it in all lines, so that its strongest lines hold little
    of it. ``energy`` has shape (n,).

    Examples
    --------
    >>> states = np.arange(1000)
    >>> changes_at_random(np.cos(2.1 * states)), changes_at_random(np.random.default_rng(1).random(1000))
    (False, True)
    """
    changes = np.diff(energy)
    if changes.size < _FEWEST_OF_NOISE:
        return False
    window = np.hanning(changes.size)
    power = np.abs(np.fft.rfft((changes - changes.mean()) * window)) ** 2
    strongest = np.sort(power)[-round(_STRONGEST * power.size) :]
    return float(strongest.sum()) < _POWER_OF_LINES * float(power.sum())


def _compare_sides(values: Samples, limits: Samples | float) -> NDArray[np.int8]:
    """Return 1 where values (n,) exceed the limits, -1 where they are below, and 0 elsewhere, as 1-byte integers."""
    return np.asarray((values > limits).view(np.int8) - (values < limits).view(np.int8))


def find_stretches(states: NDArray[np.bool_], fewest: int = 1) -> tuple[slice, ...]:
    """Return the slices of at least ``fewest`` consecutive ``states`` (n,) that are True.

    Examples
    --------
    >>> find_stretches(np.array([True, False, True, True]), 2)
    (slice(2, 4, None),)
    """
    edges = np.flatnonzero(
        np.diff(np.concatenate([[0], states.astype(np.int8), [0]]))
    ).reshape(-1, 2)
    return tuple(
        slice(first, last) for first, last in edges.tolist() if last - first >= fewest
    )


def find_first_above(
    values: Samples, start: NDArray[np.intp], limit: Samples
) -> NDArray[np.intp]:
    """Return, for each ``start``, the index (m,) of the first later value (n,) that exceeds its ``limit``.

    The index is n if there is none. The search takes O((n + m) log n).

    Examples
    --------
    >>> find_first_above(np.array([5.0, 1.0, 2.0, 3.0]), np.array([1, 1, 3]), np.array([1.5, 9.0, 0.0])).tolist()
    [2, 4, 3]
    """
    # ``tops[i][k]`` is the largest of the ``_TOGETHER**i`` values from index k on.
    tops = [np.append(values, np.inf)]
    width = 1
    indices = np.arange(values.size + 1)
    while width < values.size:
        later = (
            np.minimum(indices + width * step, values.size) for step in range(_TOGETHER)
        )
        tops.append(np.fmax.reduce([tops[-1][shifted] for shifted in later]))
        width *= _TOGETHER
    first = start
    for top in reversed(tops):
        for _ in range(_TOGETHER):
            skipped = np.minimum(first + width, values.size)
            first = np.where(top[first] > limit, first, skipped)
        width //= _TOGETHER
    return first


def merge_times(*times: Samples) -> Samples:
    """Return the distinct times in ascending order without numpy.unique, which imports numpy.ma.

    Examples
    --------
    >>> merge_times(np.array([1.0, 3.0]), np.array([[2.0, 3.0]])).tolist()
    [1.0, 2.0, 3.0]
    """
    ascending = np.sort(np.concatenate([array.ravel() for array in times]))
    return np.asarray(ascending[np.diff(ascending, prepend=-np.inf) > 0])


def draw_outline(time: Samples, values: Samples, stretches: int) -> Samples:
    """Return times and values for drawing the curve, shape (2, m): all samples, or the extremes in many intervals.

    Parameters
    ----------
    time, values : array of shape (n,)
    stretches : int
        Number of intervals with equal numbers of samples. The first and last samples are also kept, so m is at most
        twice ``stretches`` plus 2.

    Examples
    --------
    >>> draw_outline(np.arange(8.0), np.array([0.0, 9.0, 0.0, 1.0, 2.0, -7.0, 1.0, 0.0]), 2).tolist()
    [[0.0, 1.0, 4.0, 5.0, 7.0], [0.0, 9.0, 2.0, -7.0, 0.0]]
    """
    if time.size <= 2 * stretches:
        return np.stack([time, values])
    pieces = np.array_split(np.arange(time.size), stretches)
    extremes = [0, time.size - 1]
    for piece in pieces:
        extremes.append(piece[0] + values[piece].argmin())
        extremes.append(piece[0] + values[piece].argmax())
    at = np.unique(extremes)
    return np.stack([time[at], values[at]])


def halve_brackets(
    passes: Callable[[Samples], NDArray[np.bool_]],
    within: Samples,
    beyond: Samples,
    halvings: int,
) -> Samples:
    """Halve the brackets around the times at which a test changes its result; return their ends ``within``.

    For a few brackets, several halvings are tested at once, because testing a few times takes as long as testing one.
    The result equals that of single halvings.

    Parameters
    ----------
    passes : callable
        Test that is True at ``within`` and False at ``beyond``; it accepts arrays of their shape with an additional
        first axis.
    within, beyond : array
        Ends of the brackets, in either order.
    halvings : int
        Number of halvings.

    Examples
    --------
    >>> float(halve_brackets(lambda t: t <= 0.7, np.array(0.0), np.array(1.0), 3))
    0.625
    """
    shape = within.shape
    brackets = np.arange(within.size)
    while halvings:
        together = min(halvings, _HALVED_TOGETHER if within.size <= _FEW else 1)
        times = np.stack([within, beyond])
        for _ in range(together):
            times = _insert_middles(times)
        # All brackets are on one axis, because indexing is then several times faster than numpy.take_along_axis.
        passed = passes(times).reshape(-1, brackets.size)
        times = times.reshape(-1, brackets.size)
        end = np.zeros(brackets.size, np.intp)
        for level in reversed(range(together)):
            middle = end + 2**level
            end = np.where(passed[middle, brackets], middle, end)
        within = times[end, brackets].reshape(shape)
        beyond = times[end + 1, brackets].reshape(shape)
        halvings -= together
    return within


def _insert_middles(times: Samples) -> Samples:
    """Insert the middle between neighbours along the first axis, shape (n, ...) to (2 n - 1, ...)."""
    denser = np.empty((2 * len(times) - 1, *times.shape[1:]))
    denser[::2] = times
    denser[1::2] = (times[1:] + times[:-1]) / 2
    return denser


class Roots(NamedTuple):
    """Narrow brackets around roots: end ``within`` on the positive side, other end ``beyond``, and root ``at``."""

    within: Samples
    beyond: Samples
    at: Samples


def narrow_brackets(
    inside: Callable[[Samples], tuple[Samples, Samples]],
    within: Samples,
    beyond: Samples,
    steps: int = HALVINGS,
) -> Roots:
    """Narrow the brackets around the roots at which ``inside`` changes from positive to non-positive.

    Parameters
    ----------
    inside : callable
        Function that returns the values and slopes at an array of times; the values are positive at ``within`` and not
        positive at ``beyond``. Newton steps are used if they stay within their bracket. A root no longer changes once
        it has converged, so it does not depend on the roots that are searched for at the same time.
    within, beyond : array
        Ends of the brackets, in either order.
    steps : int
        Largest number of steps.

    Examples
    --------
    >>> found = narrow_brackets(lambda t: (2 - t**2, -2 * t), np.array([0.0]), np.array([2.0]))
    >>> f"{found.at[0]:.12f}"
    '1.414213562373'
    """
    at = (within + beyond) / 2
    still = np.zeros(np.shape(within), dtype=bool)
    for _ in range(steps):
        value, slope = inside(at)
        good = value > 0
        within = np.where(good, at, within)
        beyond = np.where(good, beyond, at)
        following = (within + beyond) / 2
        newton = at - value / np.where(slope == 0, np.inf, slope)
        inner = (newton >= np.minimum(within, beyond)) & (
            newton <= np.maximum(within, beyond)
        )
        following = np.where(inner, newton, following)
        following = np.where(still, at, following)
        still |= np.abs(following - at) <= _STILL * np.abs(at)
        at = following
        if still.all():
            break
    return Roots(within, beyond, at)
