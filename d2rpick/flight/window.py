"""Find the longest window around a time in which a record obeys a law of free flight."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import find_hole_around

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.histories.history import Samples
    from d2rpick.histories.names import Part
    from d2rpick.histories.surroundings import Surroundings


# Initial tolerance for deviations from free flight, relative to the range over the record [-].
# During a contact, the deviation exceeds this tolerance immediately.
TOLERANCE = 1e-3
# _TIGHTER: factor by which the tolerance is repeatedly reduced, as long as the window length hardly changes [-].
# With a smaller tolerance, windows of other smooth motions shrink to less than half, but windows of flights do not.
# _STAYS: a window that retains at least this fraction of its length is treated as unchanged [-].
# _STANDS: if a window shrinks at one end only, its other end moves by at most this fraction of the window [-].
_TIGHTER, _STAYS, _STANDS = 0.1, 0.95, 0.02
# A vibration has at least this fraction of its misfit in the middle half of a window [-].
# For a smooth load, the misfit in the middle half of a window is 1/8 of that in the whole window.
_RINGS = 1 / 3
# SHORTEST: smallest duration of a flight, as a fraction of the record [-].
# FEWEST: smallest number of states in a flight.
SHORTEST, FEWEST = 0.05, 12
# Smallest number of states from which a load, gravity and damping can be separated; twice the number of unknowns.
FEWEST_STATES_OF_WORK: Final = 6
# _ENDS: fraction of a window that is excluded at each end when the misfit inside the flight is determined [-].
# The misfit of the whole window may exceed the misfit without its ends by the following factors [-].
# _REACH_OF_DIGITS: factor for the part of the misfit that is due to the rounding of printed numbers.
# _REACH: factor for the rest of the misfit.
_ENDS, _REACH_OF_DIGITS, _REACH = 0.1, 1.5, 3.0
# Relative resolution of all quantities [-], because solvers sum in single precision.
ROUND_OFF = 1e-7
# Relative changes of a written value up to this are treated as rounding [-], because files have six to seven digits.
LAST_DIGIT: Final = 1e-6
# Motion or work is visible if a momentum, an energy or its change exceeds this multiple of its rounding error [-].
VISIBLE: Final = 100
# Step in the list of start times for the search for all flights, if only long flights have to be found.
_FAR: Final = 5
# Largest number of times that the ends of a window are cut off.
_MOST_SHRINKS = 8


class FreeFlight(NamedTuple):
    """A window in which ``parts`` fly freely together [time]; None stands for the whole model.

    ``end_seen`` is False if the record ends during the flight. ``damping`` is alpha, the decay rate of the momentum
    [1/time]. ``gravity`` is the acceleration that is assumed to be gravity [length/time^2]: 0 if there is none, NaN if
    its only evidence is a constant force, and infinite if energies grow under a load of unknown size.
    """

    start: float
    end: float
    parts: tuple[Part, ...] | None
    end_seen: bool
    damping: float = 0.0
    gravity: float = 0.0

    @classmethod
    def of(
        cls, time: Samples, states: tuple[int, int], parts: tuple[Part, ...] | None = None, *,
        damping: float = 0.0, gravity: float = 0.0,
    ) -> FreeFlight:  # fmt: skip
        """Make the flight from the first to the last of the given states of a record."""
        first, last = states
        return cls(
            float(time[first]),
            float(time[last]),
            parts,
            last < time.size - 1,
            damping,
            gravity,
        )

    @property
    def duration(self) -> float:
        """Return the length of the window [time]."""
        return self.end - self.start


class Law:
    """A law of free flight over ``time`` (n,), and the deviation of a record from this law.

    The misfit of each window is kept, because searches from neighbouring times need the same windows.
    """

    def __init__(self, time: Samples) -> None:
        self.time = time
        self._misfits: dict[tuple[int, int], float] = {}

    def misfit(self, first: int, last: int) -> float:
        """Return the largest deviation of states ``first`` to ``last`` (in any order) from the best fit of the law."""
        window = (first, last) if first < last else (last, first)
        misfit = self._misfits.get(window)
        if misfit is None:
            misfit = self._misfits[window] = self._misfit(*window)
        return misfit

    def _misfit(self, first: int, last: int) -> float:
        """Compute the misfit of states in ascending order."""
        raise NotImplementedError


class Constant(Law):
    """Quantities (n, k) that do not change; the misfit is half of the largest range [unit of the values]."""

    def __init__(self, time: Samples, values: Samples) -> None:
        super().__init__(time)
        # Columns that are contiguous in memory can be processed faster.
        self.values = np.asfortranarray(values)

    def _misfit(self, first: int, last: int) -> float:
        return float(np.ptp(self.values[first : last + 1], axis=0).max()) / 2


def find_lasting_window(
    law: Law,
    td: float,
    extent: float,
    noise: float,
    *,
    fades: bool = False,
    enough: float = 0.0,
    rings: bool = False,
) -> tuple[int, int] | None:
    """Find the states around ``td`` that obey the law, and still obey it with a tighter tolerance.

    Parameters
    ----------
    law : Law
    td : float
        [time]
    extent, noise : float
        Range of the quantity over the record, and the error of its printed digits [unit of the misfit].
    fades : bool
        Continue to stricter tolerances, because only they reveal a smoothly fading load.
    enough : float
        Largest misfit of a window that still shrinks at one end, as a fraction of the range [-].
    rings : bool
        Accept a window whose misfit is about as large in its middle as in all of it, like that of a vibration.

    Returns
    -------
    (int, int) or None
        First and last state; None if no window is long enough, or if the window does not contain td after its ends are
        cut off.
    """
    time = law.time
    at = min(int(np.searchsorted(time, td)), time.size - 1)
    limit = max(TOLERANCE, enough) * extent
    rounding = max(noise, ROUND_OFF * extent)
    states = _find_converged_window(
        law,
        at,
        limit,
        rounding if fades else limit,
        noise,
        enough * extent,
        rings=rings,
    )
    if states is None:
        return None
    window, room, from_start = states
    first, last = _tighten_window(law, window, rounding, room)
    if first == 1 and from_start:
        first = 0  # The solver may write the first state before the first step, with earlier velocities.
    if time[first] <= td <= time[last] and _is_long_enough(time, (first, last)):
        return (first, last)
    return None


def _find_converged_window(
    law: Law,
    at: int,
    limit: float,
    finest: float,
    noise: float,
    enough: float,
    *,
    rings: bool,
) -> tuple[tuple[int, int], float, bool] | None:
    """Find the window around state ``at`` that hardly shrinks at a tenth of the tolerance, if there is one.

    The tolerance ``limit`` is reduced down to ``finest``; once it is at most ``enough``, a window may shrink at one
    end. The other returned values are the largest misfit of the window, and True if the first window began with the
    record.
    """
    time = law.time
    room = limit + noise
    lasting = None
    window = find_longest_window(law, at, room)
    from_start = window[0] == 0
    last_result = None
    while _is_long_enough(time, window):
        strict = _TIGHTER * limit + noise
        finer = find_longest_window(law, at, strict)
        if enough:  # If a load fades, only one end of the window moves.
            ends = (find_longest_window(law, end, strict) for end in window)
            finer = max(finer, *ends, key=lambda states: _measure_length(time, states))
        length = _measure_length(time, window)
        share = _measure_length(time, finer) / length
        if lasting and share < _STAYS:
            break
        lasts = share >= (1 + np.cbrt(strict / room)) / 2
        if rings and not lasts:
            lasts = _is_ringing(law, window)
        if not _TIGHTER * limit >= finest:
            return (window, room, from_start) if lasts else lasting or last_result
        if limit <= enough and _is_fading(window, finer):
            if last_result is None:
                is_long = True
            else:
                is_long = 2 * length >= _measure_length(time, last_result[0])
            if is_long:
                last_result = window, room, from_start
        window = finer
        limit = _TIGHTER * limit
        room = strict
        at = (finer[0] + finer[1]) // 2
        lasting = (window, room, from_start) if lasts else None
    return lasting or last_result


def _is_ringing(law: Law, window: tuple[int, int]) -> bool:
    """Return True if the middle half of a window has nearly the misfit of the whole window, as for a vibration."""
    first, last = window
    quarter = (last - first) // 4
    misfit_of_middle = law.misfit(first + quarter, last - quarter)
    return misfit_of_middle >= _RINGS * law.misfit(first, last)


def _is_fading(window: tuple[int, int], finer: tuple[int, int]) -> bool:
    """Return True if a window shrinks only at the end at which a load fades, and the other end is a contact."""
    first, last = window
    finer_first, finer_last = finer
    least_move = min(abs(finer_first - first), abs(finer_last - last))
    return least_move <= _STANDS * (last - first)


def find_longest_window(law: Law, at: int, room: float) -> tuple[int, int]:
    """Return the first and last state of the longest window around a state with a misfit of at most ``room``.

    If the state is near an end of the flight, a window may extend slightly beyond the flight. The window depends on
    which end is moved first, so both orders are tried.
    """
    last_state = law.time.size - 1
    first = find_farthest(at, 0, lambda i: law.misfit(i, at) <= room)
    end = find_farthest(at, last_state, lambda j: law.misfit(first, j) <= room)
    last = find_farthest(at, last_state, lambda j: law.misfit(at, j) <= room)
    begin = find_farthest(at, 0, lambda i: law.misfit(i, last) <= room)
    windows = (first, end), (begin, last)
    return max(windows, key=lambda window: _measure_length(law.time, window))


def list_moments(time: Samples) -> Iterator[float]:
    """Yield times that are so close together that each sufficiently long flight contains one of them."""
    yield from np.linspace(time[0], time[-1], round(1 / SHORTEST) + 1).tolist()


def list_marks(time: Samples, td: float) -> Iterator[float]:
    """Yield the times at which the search for the flight around ``td`` starts; many values of td share them.

    The first is the nearest of the widely spaced times, because a long flight around it may contain td. The two times
    nearest to td follow.
    """

    def measure_distance(moment: float) -> float:
        return abs(moment - td)

    moments = tuple(list_moments(time))
    widely_spaced = moments[::_FAR]
    yield min(widely_spaced, key=measure_distance)
    yield from sorted(moments, key=measure_distance)[:2]


def find_all_windows(
    time: Samples, around: Callable[[float], FreeFlight | None]
) -> tuple[FreeFlight, ...]:
    """Find all flights of a record in ascending order; ``around`` returns the flight around a time."""
    flights: list[FreeFlight] = []
    for moment in list_moments(time):
        if flights and moment <= flights[-1].end:
            continue
        flight = around(moment)
        if flight is None:
            continue
        if flights:
            # Flights may overlap by a few states because of the tolerance.
            start = max(flight.start, flights[-1].end)
            flight = flight._replace(start=start)
        flights.append(flight)
    return tuple(flights)


def limit_to_written_states(
    flight: FreeFlight, holes: Sequence[Times], moment: float
) -> FreeFlight | None:
    """Return the piece of a flight around a time that no interval without states interrupts; None in such an interval.

    The parts may have touched something in an interval without states (``holes``), so a flight ends before it.
    """
    if find_hole_around(holes, moment):
        return None
    start = max((hole_end for _, hole_end in holes if hole_end <= moment), default=-inf)
    end = min(
        (hole_start for hole_start, _ in holes if hole_start >= moment), default=inf
    )
    return flight._replace(
        start=max(flight.start, start),
        end=min(flight.end, end),
        end_seen=flight.end_seen or end < flight.end,
    )


def explain_hole(hole: Times, td: float) -> str:
    """Return why td cannot be judged in an interval without states [time]."""
    start, end = hole
    return f"there are no states from {start:.6g} to {end:.6g}, around td = {td:.6g}: a restart segment may be missing"


def _tighten_window(
    law: Law, window: tuple[int, int], noise: float, loose: float
) -> tuple[int, int]:
    """Shrink a window until its ends deviate no more than its middle, to cut off the rest of a load.

    The tolerance hides the last, weak forces of a load. The middle of the flight shows how exactly the run obeys the
    law, which is limited by printed digits, round-off or errors of the solver. The resulting tolerance may be stricter
    than ``loose``, with which the window was found. The window may then still become longer at one end, if ``loose``
    admitted a state of a contact that stopped the search at the other end.
    """
    room = 0.0
    for _ in range(_MOST_SHRINKS):
        first, last = window
        inset = round(_ENDS * (last - first))
        inner_misfit = law.misfit(first + inset, last - inset)
        room = _REACH_OF_DIGITS * noise + _REACH * max(0.0, inner_misfit - noise)
        tight = find_longest_window(law, (first + last) // 2, room)
        if room <= loose:
            tighter = tight
        else:
            tighter = (max(first, tight[0]), min(last, tight[1]))
        if tighter == window:
            break
        window = tighter
    return _cut_off_hidden_push(law, window, room)


def _cut_off_hidden_push(
    law: Law, window: tuple[int, int], room: float
) -> tuple[int, int]:
    """Cut off the ends of a window if the tolerance ``room`` may hide a fading force in them.

    The deviation due to a smoothly fading force is proportional to the square of its remaining time. Therefore it falls
    from 4 times the tolerance to the tolerance in the same time as from the tolerance to zero. Differences of one state
    are ignored, because they cannot be resolved.
    """
    first, last = window
    wide_first, wide_last = find_longest_window(law, (first + last) // 2, 4 * room)
    most_states = round(_ENDS * (last - first))
    # A window that reaches an end of the record shows no force there.
    if wide_first > 0:
        gained_states = max(0, first - wide_first - 1)
        first += min(most_states, gained_states)
    if wide_last < law.time.size - 1:
        gained_states = max(0, wide_last - last - 1)
        last -= min(most_states, gained_states)
    return first, last


def _is_long_enough(time: Samples, window: tuple[int, int]) -> bool:
    """Return True if a window is long enough to be a flight."""
    shortest = SHORTEST * float(time[-1] - time[0])
    return (
        window[1] - window[0] + 1 >= FEWEST
        and _measure_length(time, window) >= shortest
    )


def _measure_length(time: Samples, window: tuple[int, int]) -> float:
    """Return the duration of a window [time]."""
    return float(time[window[1]] - time[window[0]])


def find_farthest(start: int, limit: int, fits: Callable[[int], bool]) -> int:
    """Find the farthest index from ``start`` towards ``limit`` that fits, by doubling and then halving the step."""
    sign = 1 if limit > start else -1
    farthest = abs(limit - start)
    good = 0  # distance from the start
    step = 1
    while good < farthest:
        ahead = min(good + step, farthest)
        if not fits(start + sign * ahead):
            break
        good = ahead
        step *= 2
    while step > 1:
        step //= 2
        ahead = min(good + step, farthest)
        if ahead != good and fits(start + sign * ahead):
            good = ahead
    return start + sign * good


def limit_to_unheld(
    surroundings: Surroundings,
    flight: FreeFlight | None,
    parts: Sequence[Part] | None,
    td: float,
) -> FreeFlight | None:
    """Return the part of a flight around ``td`` in which no support holds the parts or the model [time]."""
    between = surroundings.free(parts, td)
    if between is None or flight is None:
        return None
    start = max(flight.start, between[0])
    end = min(flight.end, between[1])
    return flight._replace(
        start=start, end=end, end_seen=flight.end_seen or end < flight.end
    )
