"""Free flight, seen in the momentum: gravity and damping proportional to mass are all that acts.

What flies together obeys p' = g - alpha p in each component, with constant g and one alpha >= 0, so that
p(t) = p0 + g t - alpha int p dt: linear in p0, g and alpha.  A part alone does not fly freely while another one is
attached to it and vibrates against it, so the set of parts that flies is looked for as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.histories.history import Momenta, Part, Samples

# Misfit that free flight may leave, as a share of the largest component's range over the record: contact shows at once,
# a solver's own error is a tenth of it.
TOLERANCE = 1e-3
# Any smooth motion obeys the law for a moment; what is left of it there grows with the cube of time or faster.  At a
# tenth of the tolerance such a moment shrinks by the cube root, free flight hardly does: the limit lies halfway.
_TIGHTER = 0.1
# No window is shorter than this share of the record, or holds fewer states.
_SHORTEST, _FEWEST = 0.05, 12
# A momentum that changes by less than this share of itself is constant: single precision keeps seven digits.
_CONSTANT = 1e-6
# Where it is constant as far as the printed digits tell, the chosen parts must move this many times what these hide.
_VISIBLE = 100
# A set with more parts is preferred when its window is longer by this factor.  Some samples more prove nothing: parts
# with a large momentum of their own, a sled, loosen the tolerance for the others.
_LONGER = 1.1
# Parts that may be attached are looked for in this share of the record before td, on so many states at most.
_LOOK_BACK, _LOOK_STATES = 0.1, 200
# Parts that are added to the chosen ones, at most, before all parts are tried.
_MOST_ATTACHED = 12


class FreeFlight(NamedTuple):
    """Window [time] in which ``parts`` fly freely together; None for parts: the whole model.

    ``end_seen`` is False where the record ends while it still flies.  ``damping`` is alpha, by which the momentum
    decays there [1/time].
    """

    start: float
    end: float
    parts: tuple[Part, ...] | None
    end_seen: bool
    damping: float = 0.0


def to_be_asked(momenta: Sequence[Momenta]) -> Sequence[Momenta]:
    """Give the momenta that may tell of flight, best first: all, or where a set was named to fly only that one's."""
    return [one for one in momenta if one.flying] or momenta


def flight_around(momenta: Momenta, td: float) -> FreeFlight | None:
    """Find the set of parts that flies freely around ``td`` for clearly the longest time, and when.

    Unless the set is known, tried are the chosen parts, these with the parts that move most against them, and all.

    Parameters
    ----------
    momenta : Momenta
    td : float
        [time]

    Returns
    -------
    FreeFlight or None
        None when no set flies around td.
    """
    best: FreeFlight | None = None
    for members in [momenta.flying] if momenta.flying else _sets(momenta, td):
        found = flight_of(momenta, members, td)
        if found and (best is None or found.end - found.start > _LONGER * (best.end - best.start)):
            best = found
    return best


def flight_of(momenta: Momenta, members: Sequence[int], td: float) -> FreeFlight | None:
    """Find the window around ``td`` in which these parts together fly freely, or None."""
    time, momentum = momenta.time, momenta.of(members)
    if time.size < _FEWEST or not time[0] <= td <= time[-1]:
        return None
    extent = float(np.ptp(momentum, axis=0).max())
    noise = momenta.noise(members)
    parts = None if momenta.parts is None else tuple(momenta.parts[i] for i in members)
    if extent <= max(2 * noise, _CONSTANT * float(np.abs(momentum).max())):
        return FreeFlight(float(time[0]), float(time[-1]), parts, False) if _moves(momenta, members, noise) else None
    if noise > TOLERANCE * extent:
        return None
    fit = _Fit(time, momentum)
    window = _lasting_window(fit, td, extent, noise)
    if window is None:
        return None
    first, last = window
    return FreeFlight(float(time[first]), float(time[last]), parts, time[last] < time[-1], fit.damping(first, last))


def all_flights(momenta: Momenta) -> tuple[FreeFlight, ...]:
    """Find all windows of free flight of the chosen parts and what flies with them, ascending in time."""
    found: list[FreeFlight] = []
    time = momenta.time
    for moment in np.linspace(time[0], time[-1], round(1 / _SHORTEST) + 1):
        if not found or moment > found[-1].end:
            flight = flight_around(momenta, float(moment))
            if flight:  # the tolerance may let it begin some samples before the last one has ended
                found.append(flight._replace(start=max(flight.start, found[-1].end)) if found else flight)
    return tuple(found)


def _moves(momenta: Momenta, members: Sequence[int], noise: float) -> bool:
    """Whether a constant momentum that is known up to ``noise`` tells that the chosen parts fly: not of parts at rest.

    Large parts print coarse numbers, behind which a load on the chosen ones may hide.  Where these have no mass, as
    springs, the members of the set count instead.
    """
    parts = momenta.chosen if momenta.values[:, list(momenta.chosen)].any() else members
    values = momenta.values[:, list(parts)]
    change = float(np.ptp(values, axis=0).max())
    size = change if change > 2 * momenta.noise(parts) else float(np.abs(values).max())
    return size > _VISIBLE * noise


def _lasting_window(fit: _Fit, td: float, extent: float, noise: float) -> tuple[int, int] | None:
    """Find the states around ``td`` with a misfit within the tolerance that a tighter one does not shrink, or None."""
    time, room, tight = fit.time, TOLERANCE * extent + noise, _TIGHTER * TOLERANCE * extent + noise
    first, last = fit.window(td, room)
    length = time[last] - time[first]
    if last - first + 1 < _FEWEST or length < _SHORTEST * (time[-1] - time[0]):
        return None
    tight_first, tight_last = fit.window(td, tight)
    if time[tight_last] - time[tight_first] < (1 + np.cbrt(tight / room)) / 2 * length:
        return None
    return first, last


class _Fit:
    """Least-squares fits of free flight to windows of one momentum."""

    def __init__(self, time: Samples, momentum: Samples) -> None:
        self.time, self.momentum = time, momentum
        steps = np.diff(time)[:, np.newaxis] * (momentum[1:] + momentum[:-1]) / 2
        self.integral = np.vstack([np.zeros((1, momentum.shape[1])), np.cumsum(steps, axis=0)])

    def window(self, td: float, room: float) -> tuple[int, int]:
        """First and last index of the longest window around ``td`` with a misfit below ``room``.

        Near an end of the flight a short window may reach across it: the side that is grown first decides, so
        both orders are tried.
        """
        last_state = self.time.size - 1
        at = min(int(np.searchsorted(self.time, td)), last_state)
        first = self._farthest(at, 0, lambda i: self._misfit(i, at) <= room)
        one = first, self._farthest(at, last_state, lambda j: self._misfit(first, j) <= room)
        last = self._farthest(at, last_state, lambda j: self._misfit(at, j) <= room)
        other = self._farthest(at, 0, lambda i: self._misfit(i, last) <= room), last
        return max(one, other, key=lambda window: self.time[window[1]] - self.time[window[0]])

    def _farthest(self, start: int, limit: int, fits: Callable[[int], bool]) -> int:
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

    def _misfit(self, i: int, j: int) -> float:
        """Largest deviation of the momentum from free flight between two states [momentum]."""
        if abs(j - i) < 3:  # three numbers per component fit any three states
            return 0.0
        p, impulse, alpha = self._fitted(min(i, j), max(i, j))
        return float(np.abs(p + alpha * impulse).max())

    def damping(self, first: int, last: int) -> float:
        """Least-squares alpha between two states [1/time]."""
        return self._fitted(first, last)[2]

    def _fitted(self, first: int, last: int) -> tuple[Samples, Samples, float]:
        """What is not straight of momentum and impulse, and the alpha >= 0 that explains the one by the other."""
        states = slice(first, last + 1)
        p, impulse = (_bent(self.time[states], values[states]) for values in (self.momentum, self.integral))
        power = float(np.sum(impulse**2))
        return p, impulse, max(0.0, -float(np.sum(impulse * p)) / power) if power > 0 else 0.0


def _bent(time: Samples, values: Samples) -> Samples:
    """Give what is left of each column after a straight line."""
    t = time - time.mean()
    centred = values - values.mean(axis=0)
    return np.asarray(centred - np.outer(t, t @ centred / (t @ t)))


def _sets(momenta: Momenta, td: float) -> Iterator[tuple[int, ...]]:
    """Sets of parts to try: the chosen ones, these with more and more of the attached ones, all that move."""
    moving = [i for i in range(momenta.values.shape[1]) if np.ptp(momenta.values[:, i]) > 0]
    members = list(momenta.chosen)
    yield tuple(members)
    for part in _attached(momenta, members, moving, td):
        members.append(part)
        yield tuple(sorted(members))
    if set(moving) - set(members):
        yield tuple(sorted({*moving, *members}))


def _attached(momenta: Momenta, chosen: Sequence[int], moving: Sequence[int], td: float) -> Iterator[int]:
    """Give the parts that, added one by one, straighten the momentum before td the most."""
    time = momenta.time
    back = (time >= td - _LOOK_BACK * (time[-1] - time[0])) & (time <= td)
    look = np.flatnonzero(back)[:: max(1, int(back.sum()) // _LOOK_STATES)]
    if look.size < _FEWEST:
        return
    bent = _bent(time[look], momenta.values[look].reshape(look.size, -1))
    rests = bent.reshape(look.size, -1, 3).transpose(1, 0, 2).reshape(momenta.values.shape[1], -1)
    total = rests[list(chosen)].sum(axis=0)
    left = [i for i in moving if i not in chosen]
    for _ in range(min(_MOST_ATTACHED, len(left))):
        sizes = np.linalg.norm(total + rests[left], axis=1)
        best = int(np.argmin(sizes))
        if sizes[best] >= np.linalg.norm(total):
            return
        total = total + rests[left[best]]
        yield left.pop(best)
