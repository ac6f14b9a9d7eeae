"""What a curve tells: which samples count, its integral, where it passes a level or turns, its outline, its roots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Samples = NDArray[np.float64]


def window(time: Samples, start: float, end: float) -> slice:
    """Slice of ascending times from ``start`` to ``end``, both included [time].

    Examples
    --------
    >>> window(np.array([0.0, 1.0, 2.0, 3.0]), 1.0, 2.0)
    slice(1, 3, None)
    """
    first, last = np.searchsorted(time, [start, np.nextafter(end, np.inf)]).tolist()
    return slice(first, last)


def integral(time: Samples, values: Samples) -> Samples:
    """Integral of values (n,) or (n, k) from the first time on, by trapezia, of their shape.

    Examples
    --------
    >>> integral(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 2.0])).tolist()
    [0.0, 1.0, 5.0]
    """
    areas = (values[1:] + values[:-1]).T
    areas *= np.diff(time)
    areas /= 2
    return np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(areas.T, axis=0, out=areas.T)]
    )


def median(values: Samples) -> Samples:
    """Median of values (n,) or (n, k) over the first axis; that of numpy, which imports masked arrays to look for NaN.

    Examples
    --------
    >>> median(np.array([[3.0, 1.0], [1.0, 1.0], [2.0, 5.0], [4.0, 2.0]])).tolist()
    [2.5, 1.5]
    """
    ends = [(len(values) - 1) // 2, len(values) // 2]
    return np.asarray(np.partition(values, ends, axis=0)[ends].sum(axis=0) / 2)


def bent(time: Samples, values: Samples) -> Samples:
    """Give what is left of each column of values (n, k) beside a straight line.

    Examples
    --------
    >>> bent(np.array([0.0, 1.0, 2.0]), np.array([[1.0, 0.0], [2.0, 3.0], [3.0, 0.0]])).round(12).tolist()
    [[0.0, -1.0], [0.0, 2.0], [0.0, -1.0]]
    """
    t = time - time.sum() / time.size  # as mean(), which is slow for few
    centred = values - values.sum(axis=0) / time.size
    columns = centred.T
    columns -= np.multiply.outer(t @ centred / (t @ t), t)
    return np.asarray(centred)


def newest_states(time: Samples) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """Which states of a file count, and what to say of the others.

    A state gives way to any later one at or before its time: of equal printed times the last counts, and
    where a restarted run steps back its newer leg wins.

    Parameters
    ----------
    time : array of shape (n,)
        Times in the order of the file [unit of the run].

    Returns
    -------
    keep : array of bool, shape (n,)
        ``time[keep]`` increases strictly.
    notes : tuple of str
        A sentence for each kind of state left out.

    Examples
    --------
    >>> keep, notes = newest_states(np.array([0.0, 1.0, 2.0, 1.5, 2.5, 2.5]))
    >>> keep.tolist()
    [True, True, False, True, False, True]
    """
    if np.all(time[1:] > time[:-1]):  # as nearly always
        return np.ones(time.size, dtype=bool), ()
    step = np.diff(time)
    equal, back = int(np.count_nonzero(step == 0)), int(np.count_nonzero(step < 0))
    later = np.minimum.accumulate(time[::-1])[::-1]
    keep = np.append(time[:-1] < later[1:], np.ones(min(1, time.size), dtype=bool))
    notes = []
    if equal:
        same = "1 state has" if equal == 1 else f"{equal} states have"
        notes.append(
            f"{same} the same printed time as the next one; the last of equal times counts"
        )
    if back:
        steps = "once" if back == 1 else f"{back} times"
        lost = int(np.count_nonzero(~keep)) - equal
        dropped = "1 older state was" if lost == 1 else f"{lost} older states were"
        notes.append(
            f"time steps back {steps} (restart); where legs overlap the newer one counts, {dropped} dropped"
        )
    return keep, tuple(notes)


# At least this share of the states has the time of the state before, if each time stands in two rows or more.
_REPEATED: Final = 0.49
FEWEST_TIMES: Final = 3  # below, rows of one time may be chance


def count_rows_per_time(time: Samples) -> int:
    """Return in how many rows each of the times (n,) stands, in the median; 1 if most times stand alone.

    Examples
    --------
    >>> count_rows_per_time(np.array([0.0, 0.0, 0.1, 0.1, 0.2, 0.2])), count_rows_per_time(np.array([0.0, 0.1, 0.1]))
    (2, 1)
    """
    if (
        time.size < 2 * FEWEST_TIMES
        or np.count_nonzero(time[1:] == time[:-1]) < _REPEATED * time.size
    ):
        return 1
    first_rows = np.flatnonzero(np.append(True, time[1:] != time[:-1]))
    rows = np.diff(np.append(first_rows, time.size))
    return int(np.sort(rows)[rows.size // 2])


# A restarted run goes on with its output interval; another curve or an unsorted table has another one.
_ALIKE = 2.0


def of_one_run(time: Samples, place: Callable[[int], str]) -> Samples:
    """Give times (n,) back; FormatError, with the place of the state, where they are not those of one run."""
    state = _not_a_restart(time)
    if state is None:
        return time
    found = (
        f"{place(state)}: time steps back from {time[state - 1]:g} to {time[state]:g}"
    )
    if time[state] <= time[0]:
        cure = "another curve or part begins here: put each into its own file"
    else:
        cure = "sort the rows, or put each curve into its own file"
    raise FormatError(f"{found}, increasing times or one restart were expected; {cure}")


def _not_a_restart(time: Samples) -> int | None:
    """Find the first state at which times (n,) step back as those of one run do not; None where they never do.

    One step back is a restart: it does not go back to the start, and the interval behind it, as the median of all
    behind it, is half to twice the median of those before.

    Examples
    --------
    >>> _not_a_restart(np.array([0.0, 1.0, 2.0, 3.0, 1.5, 2.5])), _not_a_restart(np.array([0.0, 1.0, 0.0, 1.0]))
    (None, 2)
    """
    back = np.flatnonzero(time[1:] < time[:-1]) + 1
    if back.size == 0:
        return None
    first = int(back[0])
    if back.size > 1 or time[first] <= time[0]:
        return first
    before, behind = (np.diff(one) for one in np.split(time, [first]))
    ratios = [_median(steps) / _median(before) for steps in (behind, behind[:1])]
    return (
        first if any(ratio < 1 / _ALIKE or ratio > _ALIKE for ratio in ratios) else None
    )


def _median(steps: Samples) -> float:
    steps = steps[steps > 0]  # equal printed times are no interval
    return (
        float(median(steps)) if steps.size else np.nan
    )  # which is neither too small nor too large


def find_crossings(
    time: Samples, energy: Samples, level: float
) -> tuple[Samples, NDArray[np.bool_]]:
    """Times of all passages of ``energy`` through ``level``, ascending, and which of them rise, both of shape (k,).

    Between samples the energy is taken as linear: on piecewise linear data the answer is exact to rounding.

    What counts is that the energy lies on different sides before and after:

    * a sample exactly on the level is passed once, at that sample; a plateau on the level once, at its first;
    * touching the level and turning back is no crossing (``find_turns`` gives such points);
    * a record that begins on the level has a crossing at its first sample, one that ends on it has one where
      it arrives; ``rising`` then tells the one side there is.  A record that stays on the level has none.

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
    side = _sides(energy, level)
    off = np.flatnonzero(side)
    if not off.size:
        return np.zeros(0), np.zeros(0, dtype=bool)
    turn = np.flatnonzero(np.diff(side[off]))
    before, after = off[turn], off[turn + 1]
    # with samples on the level in between, the first of them: a share of 1
    share = np.where(
        after == before + 1,
        (level - energy[before]) / (energy[before + 1] - energy[before]),
        1.0,
    )
    at = time[before] + share * (time[before + 1] - time[before])
    rising = side[after] > 0
    if off[0] > 0:
        at, rising = np.append(time[0], at), np.append(side[off[0]] > 0, rising)
    if off[-1] < side.size - 1:
        at, rising = (
            np.append(at, time[off[-1] + 1]),
            np.append(rising, side[off[-1]] < 0),
        )
    return at, rising


def find_turns(energy: Samples) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Places of the samples (n,) where the energy turns, and which of them are peaks, both of shape (k,).

    A flat top or bottom counts once, at its first sample, the ends never.

    Examples
    --------
    >>> find_turns(np.array([0.0, 4.0, 4.0, 2.0]))
    (array([1]), array([ True]))
    """
    slope = _sides(energy[1:], energy[:-1])
    moving = np.flatnonzero(slope)
    turn = np.flatnonzero(np.diff(slope[moving]))
    return moving[turn] + 1, slope[moving[turn]] > 0


def _sides(values: Samples, others: Samples | float) -> NDArray[np.int8]:
    """1 where values (n,) are above the others, -1 where below, else 0: in a byte each, of many samples."""
    return np.asarray((values > others).view(np.int8) - (values < others).view(np.int8))


# So many windows side by side are looked at as one: with eight the table of them is small, and is walked quickly.
_TOGETHER: Final = 8


def stretches(states: NDArray[np.bool_], fewest: int = 1) -> tuple[slice, ...]:
    """Give the stretches of neighbouring ``states`` (n,) that hold, of those with at least so many.

    Examples
    --------
    >>> stretches(np.array([True, False, True, True]), 2)
    (slice(2, 4, None),)
    """
    edges = np.flatnonzero(
        np.diff(np.concatenate([[0], states.astype(np.int8), [0]]))
    ).reshape(-1, 2)
    return tuple(
        slice(first, last) for first, last in edges.tolist() if last - first >= fewest
    )


def first_above(
    values: Samples, start: NDArray[np.intp], limit: Samples
) -> NDArray[np.intp]:
    """Place of the first of values (n,) from each ``start`` on that is above its ``limit``, of their shape (m,).

    n where none is.  It takes O((n + m) log n).

    Examples
    --------
    >>> first_above(np.array([5.0, 1.0, 2.0, 3.0]), np.array([1, 1, 3]), np.array([1.5, 9.0, 0.0])).tolist()
    [2, 4, 3]
    """
    tops, width, places = (
        [np.append(values, np.inf)],
        1,
        np.arange(values.size + 1),
    )  # largest of so many from each on
    while width < values.size:
        later = (
            np.minimum(places + width * step, values.size) for step in range(_TOGETHER)
        )
        tops.append(np.fmax.reduce([tops[-1][one] for one in later]))
        width *= _TOGETHER
    found = start
    for top in reversed(tops):
        for _ in range(_TOGETHER):
            found = np.where(
                top[found] > limit, found, np.minimum(found + width, values.size)
            )
        width //= _TOGETHER
    return found


def union(*times: Samples) -> Samples:
    """Times of all, each once, ascending; what numpy has for that imports all of numpy.ma, which costs start-up.

    Examples
    --------
    >>> union(np.array([1.0, 3.0]), np.array([[2.0, 3.0]])).tolist()
    [1.0, 2.0, 3.0]
    """
    every = np.sort(np.concatenate([one.ravel() for one in times]))
    return np.asarray(every[np.diff(every, prepend=-np.inf) > 0])


def outline(time: Samples, values: Samples, stretches: int) -> Samples:
    """Give times and values that draw the curve, shape (2, m): all, or the extremes of each of many stretches.

    Parameters
    ----------
    time, values : array of shape (n,)
    stretches : int
        Stretches of equally many samples; the first and the last sample stay, too, and m is at most
        ``2 * stretches + 2``.

    Examples
    --------
    >>> outline(np.arange(8.0), np.array([0.0, 9.0, 0.0, 1.0, 2.0, -7.0, 1.0, 0.0]), 2).tolist()
    [[0.0, 1.0, 4.0, 5.0, 7.0], [0.0, 9.0, 2.0, -7.0, 0.0]]
    """
    if time.size <= 2 * stretches:
        return np.stack([time, values])
    pieces = np.array_split(np.arange(time.size), stretches)
    kept = [
        piece[0] + place
        for piece in pieces
        for place in (values[piece].argmin(), values[piece].argmax())
    ]
    at = np.unique([0, *kept, time.size - 1])
    return np.stack([time[at], values[at]])


# Of a time: a place that moves by less has been found, but for rounding.
_STILL: Final = 8 * float(np.finfo(np.float64).eps)
HALVINGS: Final = 50  # to rounding


class Roots(NamedTuple):
    """What is left of the brackets: ``within`` on the side that was asked about, ``beyond`` on the other, ``at``."""

    within: Samples
    beyond: Samples
    at: Samples


def narrow(
    inside: Callable[[Samples], Samples | NDArray[np.bool_]],
    within: Samples,
    beyond: Samples,
    *,
    slope: Callable[[Samples], Samples] | None = None,
    steps: int = HALVINGS,
) -> Roots:
    """Narrow brackets about the places where ``inside`` turns from positive to not.

    Parameters
    ----------
    inside : callable
        Positive at ``within`` and not at ``beyond``, an array for an array; true and false serve too.
    within, beyond : array
        Ends of the brackets, in either order.
    slope : callable, optional
        Derivative of ``inside``, which is then a smooth function: Newton's steps are taken where they stay inside of
        their bracket, and each place stays once it hardly moves, whatever other places are looked for beside it.
    steps : int
        At most.

    Examples
    --------
    >>> found = narrow(lambda t: 2 - t**2, np.array([0.0]), np.array([2.0]), slope=lambda t: -2 * t)
    >>> f"{found.at[0]:.12f}"
    '1.414213562373'
    """
    at, still = (within + beyond) / 2, np.zeros(np.shape(within), dtype=bool)
    for _ in range(steps):
        value = inside(at)
        good = value > 0
        within, beyond = np.where(good, at, within), np.where(good, beyond, at)
        following = (within + beyond) / 2
        if slope is not None:
            rise = slope(at)
            newton = at - value / np.where(rise == 0, np.inf, rise)
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
