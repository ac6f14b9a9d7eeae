"""Windows around a time in which a record obeys a law of free flight, as long as they can be and no longer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.histories.names import Part
    from d2rpick.histories.surroundings import Surroundings


# Misfit that free flight may leave at first, as a share of the range over the record: contact shows at once.
TOLERANCE = 1e-3
# Any smooth motion obeys a law for a moment; what is left of it there grows with the cube of time or faster.  At a
# tenth of the tolerance such a moment shrinks by the cube root, free flight hardly does: the limit lies halfway.  A
# load that fades smoothly shrinks the window too, but no more once the limit lies below what is left of it.  So the
# limit is lowered, tenth by tenth, down to what the numbers resolve, as long as the window that was found stays.
_TIGHTER, _STAYS, _STANDS = 0.1, 0.95, 0.02
# What rings in a window has this share of its misfit in the middle half, at least.
_RINGS = 1 / 3
# No window is shorter than this share of the record, or holds fewer states.
SHORTEST, FEWEST = 0.05, 12
# The misfit of the middle of a window, without this share at each end, is that of free flight itself.  The window may
# leave so many times as much of what printed digits leave open, which has a bound, and of the rest, which has none: its
# largest deviation is looked for among more states and over a longer time.
_ENDS, _REACH_OF_DIGITS, _REACH = 0.1, 1.5, 3.0
# Nothing is known more exactly than this share of its range: solvers add up in single precision.
ROUND_OFF = 1e-7
# Every so many moments there is one from which a long flight is looked for.
_FAR: Final = 5
# Each time the window shrinks its middle is clearer of the contacts; it soon stays.
_MOST_SHRINKS = 8


class FreeFlight(NamedTuple):
    """Window [time] in which ``parts`` fly freely together; None for parts: the whole model.

    ``end_seen`` is False where the record ends while it still flies.  ``damping`` is alpha, by which the momentum
    decays there [1/time]; ``gravity`` the acceleration that was taken for gravity, 0 where there is none, NaN where
    nothing but its constancy shows it, infinite where energies grow under a load of unknown size [length/time^2].
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
        """Give the flight from the first to the last of some states of a record."""
        first, last = states
        return cls(
            float(time[first]),
            float(time[last]),
            parts,
            last < time.size - 1,
            damping,
            gravity,
        )


class Law:
    """What free flight obeys over ``time`` (n,), and how far a record is off.

    It is held against no window twice: from one time to the next the same ones come up again.
    """

    def __init__(self, time: Samples) -> None:
        self.time = time
        self._misfits: dict[tuple[int, int], float] = {}

    def misfit(self, first: int, last: int) -> float:
        """Largest deviation of the states ``first`` to ``last``, in any order, from the law that suits them best."""
        window = min(first, last), max(first, last)
        if window not in self._misfits:
            self._misfits[window] = self._misfit(*window)
        return self._misfits[window]

    def _misfit(self, first: int, last: int) -> float:
        """The same of states in order."""
        raise NotImplementedError


class Constant(Law):
    """Quantities (n, k) that do not change; the misfit is half the largest range [unit of the values]."""

    def __init__(self, time: Samples, values: Samples) -> None:
        super().__init__(time)
        self.values = np.asfortranarray(values)  # columns lie whole: windows are long

    def _misfit(self, first: int, last: int) -> float:
        return float(np.ptp(self.values[first : last + 1], axis=0).max()) / 2


def lasting_window(
    law: Law,
    td: float,
    extent: float,
    noise: float,
    *,
    fades: bool = False,
    enough: float = 0.0,
    rings: bool = False,
) -> tuple[int, int] | None:
    """Find the states around ``td`` that obey the law and go on doing so when it is taken strictly.

    Parameters
    ----------
    law : Law
    td : float
        [time]
    extent, noise : float
        Range over the record, and what printed digits leave open, in the unit of the misfit.
    fades : bool
        Go on to finer limits: a load that fades smoothly shows at these only.
    enough : float
        Share of the range that a window may leave although it goes on to shrink.
    rings : bool
        Take a window in which the misfit is as large in its middle: a vibration, which no law of free flight describes.

    Returns
    -------
    (int, int) or None
        First and last state; None where no window is long enough, or a strict one does not hold td.
    """
    time = law.time
    at = min(int(np.searchsorted(time, td)), time.size - 1)
    limit, own = max(TOLERANCE, enough) * extent, max(noise, ROUND_OFF * extent)
    found = _converged(
        law, at, limit, own if fades else limit, noise, enough * extent, rings=rings
    )
    if found is None:
        return None
    window, room, from_start = found
    first, last = _tightened(law, window, own, room)
    if first == 1 and from_start:
        first = 0  # a solver may write the first state before its first step, with what belongs half a step earlier
    return (
        (first, last)
        if time[first] <= td <= time[last] and _long_enough(time, (first, last))
        else None
    )


def _converged(
    law: Law,
    at: int,
    limit: float,
    finest: float,
    noise: float,
    enough: float,
    *,
    rings: bool,
) -> tuple[tuple[int, int], float, bool] | None:
    """Find the window around the state ``at`` that hardly shrinks at a tenth of the limit; None where it does.

    The limit is lowered as long as it is above ``finest``; from ``enough`` on a window may shrink on one side.  With it
    come the room that it leaves, and whether it began with the record at first.
    """
    time, room, found = law.time, limit + noise, None
    window = longest_window(law, at, room)
    from_start, kept = window[0] == 0, None
    while _long_enough(time, window):
        strict = _TIGHTER * limit + noise
        finer = longest_window(law, at, strict)
        if enough:  # what fades is steady at one end
            ends = (longest_window(law, end, strict) for end in window)
            finer = max(finer, *ends, key=lambda one: _length(time, one))
        share = _length(time, finer) / _length(time, window)
        if found and share < _STAYS:
            break
        lasts = share >= (1 + np.cbrt(strict / room)) / 2 or (
            rings and _rings(law, window)
        )
        if not _TIGHTER * limit >= finest:
            return (window, room, from_start) if lasts else found or kept
        if (
            limit <= enough
            and _fading(window, finer)
            and (kept is None or 2 * _length(time, window) >= _length(time, kept[0]))
        ):
            kept = window, room, from_start
        window, limit, room, at = (
            finer,
            _TIGHTER * limit,
            strict,
            (finer[0] + finer[1]) // 2,
        )
        found = (window, room, from_start) if lasts else None
    return found or kept


def _rings(law: Law, window: tuple[int, int]) -> bool:
    """Whether a law is missed in the middle half of a window as in the whole; by what is smooth it is by an eighth."""
    quarter = (window[1] - window[0]) // 4
    return law.misfit(window[0] + quarter, window[1] - quarter) >= _RINGS * law.misfit(
        *window
    )


def _fading(window: tuple[int, int], finer: tuple[int, int]) -> bool:
    """Whether a window shrinks on one side only, as where a load fades there and a contact or the record ends it."""
    moved = min(abs(finer[0] - window[0]), abs(finer[1] - window[1]))
    return moved <= _STANDS * (window[1] - window[0])


def longest_window(law: Law, at: int, room: float) -> tuple[int, int]:
    """First and last state of the longest window around the state ``at`` with a misfit below ``room``.

    Near an end of the flight a short window may reach across it: the side that is grown first decides, so both
    orders are tried.
    """
    last_state = law.time.size - 1
    first = farthest(at, 0, lambda i: law.misfit(i, at) <= room)
    one = first, farthest(at, last_state, lambda j: law.misfit(first, j) <= room)
    last = farthest(at, last_state, lambda j: law.misfit(at, j) <= room)
    other = farthest(at, 0, lambda i: law.misfit(i, last) <= room), last
    return max(one, other, key=lambda window: _length(law.time, window))


def moments(time: Samples) -> Iterator[float]:
    """Give times so close together that each flight that is long enough holds one."""
    yield from np.linspace(time[0], time[-1], round(1 / SHORTEST) + 1).tolist()


def marks(time: Samples, td: float) -> Iterator[float]:
    """Give the moments from which the flight around ``td`` is looked for, so that many td share what is found.

    First the nearest of those far apart, whose long flight may hold td; then the two about td, of which each flight
    that is long enough holds one.
    """
    times = tuple(moments(time))
    yield min(times[::_FAR], key=lambda moment: abs(moment - td))
    yield from sorted(times, key=lambda moment: abs(moment - td))[:2]


def all_windows(
    time: Samples, around: Callable[[float], FreeFlight | None]
) -> tuple[FreeFlight, ...]:
    """Find all flights of a record, ascending in time, where ``around`` gives the one around a time."""
    found: list[FreeFlight] = []
    for moment in moments(time):
        if not found or moment > found[-1].end:
            flight = around(moment)
            if flight:  # the tolerance may let it begin some samples before the last one has ended
                found.append(
                    flight._replace(start=max(flight.start, found[-1].end))
                    if found
                    else flight
                )
    return tuple(found)


def _tightened(
    law: Law, window: tuple[int, int], noise: float, loose: float
) -> tuple[int, int]:
    """Shrink a window until its ends deviate no more than its middle: what is left of a load there is cut off.

    The tolerance hides the last, weak pushes of a load.  The middle of the flight knows how exactly the run obeys
    the law, be that by printed digits, round-off or the solver's own errors.  Where that is more strict than ``loose``,
    by which the window was found, and still reaches farther, a state of a contact at the edge of ``loose`` had stopped
    the search on the other side.
    """
    room = 0.0
    for _ in range(_MOST_SHRINKS):
        first, last = window
        inset = round(_ENDS * (last - first))
        own = law.misfit(first + inset, last - inset)
        room = _REACH_OF_DIGITS * noise + _REACH * max(0.0, own - noise)
        tight = longest_window(law, (first + last) // 2, room)
        tighter = (
            tight if room <= loose else (max(first, tight[0]), min(last, tight[1]))
        )
        if tighter == window:
            break
        window = tighter
    return _without_what_is_hidden(law, window, room)


def _without_what_is_hidden(
    law: Law, window: tuple[int, int], room: float
) -> tuple[int, int]:
    """Cut off what of a push the ``room`` still hides at the ends of a window.

    A push that fades smoothly leaves a deviation that falls with the square of the time that is left of it: from four
    times the room to the room takes as long as from there to its end.  Less than a state cannot be told.
    """
    first, last = window
    wide = longest_window(law, (first + last) // 2, 4 * room)
    most = round(_ENDS * (last - first))
    return (
        first + min(most, max(0, first - wide[0] - 1)) if wide[0] > 0 else first,
        last - min(most, max(0, wide[1] - last - 1))
        if wide[1] < law.time.size - 1
        else last,
    )


def _long_enough(time: Samples, window: tuple[int, int]) -> bool:
    shortest = SHORTEST * float(time[-1] - time[0])
    return window[1] - window[0] + 1 >= FEWEST and _length(time, window) >= shortest


def _length(time: Samples, window: tuple[int, int]) -> float:
    return float(time[window[1]] - time[window[0]])


def farthest(start: int, limit: int, fits: Callable[[int], bool]) -> int:
    """Walk from ``start`` towards ``limit`` in doubling steps while it fits, then halve the last step."""
    sign, good, step = (1 if limit > start else -1), start, 1
    while good != limit:
        ahead = good + sign * min(step, abs(limit - good))
        if not fits(ahead):
            break
        good, step = ahead, 2 * step
    while step > 1:
        step //= 2
        ahead = good + sign * min(step, abs(limit - good))
        if ahead != good and fits(ahead):
            good = ahead
    return good


def unheld(
    surroundings: Surroundings,
    flight: FreeFlight | None,
    parts: Sequence[Part] | None,
    td: float,
) -> FreeFlight | None:
    """Give what of a flight around ``td`` [time] lies between the times in which parts, or the model, are held."""
    between = surroundings.free(parts, td)
    if between is None or flight is None:
        return None
    start, end = max(flight.start, between[0]), min(flight.end, between[1])
    return flight._replace(
        start=start, end=end, end_seen=flight.end_seen or end < flight.end
    )
