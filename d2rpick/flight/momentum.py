"""Free flight, seen in the momentum: gravity and damping proportional to mass are all that acts.

What flies together obeys p' = g - alpha p in each component, with constant g and one alpha >= 0, so that
p(t) = p0 + g t - alpha int p dt: linear in p0, g and alpha.  A part alone does not fly freely while another one is
attached to it and vibrates against it, so the set of parts that flies is looked for as well.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from d2rpick.flight.window import FEWEST, TOLERANCE, FreeFlight, Remembered, all_windows, lasting_window
from d2rpick.histories.samples import bent, integral

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Momenta, Samples

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
# Of each record, for each set of parts: it is asked about many td.
_LAWS: WeakKeyDictionary[Momenta, dict[tuple[int, ...], tuple[FreeFall, Remembered]]] = WeakKeyDictionary()


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
    if momenta.at_rest:
        return None
    for members in [momenta.flying] if momenta.flying else _sets(momenta, td):
        found = flight_of(momenta, members, td)
        if found and (best is None or found.end - found.start > _LONGER * (best.end - best.start)):
            best = found
    return best


def flight_of(momenta: Momenta, members: Sequence[int], td: float) -> FreeFlight | None:
    """Find the window around ``td`` in which these parts together fly freely, or None."""
    time, momentum = momenta.time, momenta.of(members)
    if time.size < FEWEST or not time[0] <= td <= time[-1]:
        return None
    extent = float(np.ptp(momentum, axis=0).max())
    noise = momenta.noise(members)
    parts = None if momenta.parts is None else tuple(momenta.parts[i] for i in members)
    if extent <= max(2 * noise, _CONSTANT * float(np.abs(momentum).max())):
        known = float(np.abs(momentum).max()) > noise and _moves(momenta, members, noise)
        return FreeFlight(float(time[0]), float(time[-1]), parts, False) if known else None
    if noise > TOLERANCE * extent:
        return None
    fit, law = _law(momenta, tuple(members))
    window = lasting_window(law, td, extent, noise)
    if window is None:
        return None
    first, last = window
    if float(np.abs(momentum[first : last + 1]).max()) <= noise:  # held, or at rest
        return None
    return FreeFlight(float(time[first]), float(time[last]), parts, last < time.size - 1, fit.damping(first, last))


def _law(momenta: Momenta, members: tuple[int, ...]) -> tuple[FreeFall, Remembered]:
    """Give the law of free flight for a set of parts, made once for all td."""
    laws = _LAWS.setdefault(momenta, {})
    if members not in laws:
        fit = FreeFall(momenta.time, momenta.of(members))
        laws[members] = fit, Remembered(fit)
    return laws[members]


def all_flights(momenta: Momenta) -> tuple[FreeFlight, ...]:
    """Find all windows of free flight of the chosen parts and what flies with them, ascending in time."""
    return all_windows(momenta.time, partial(flight_around, momenta))


def tells(momenta: Momenta) -> bool:
    """Whether the chosen parts, or the model, move enough for their momentum to say that they do not fly."""
    change = momenta.change(momenta.chosen)
    return momenta.time.size >= FEWEST and change > _VISIBLE * momenta.noise(momenta.chosen)


def _moves(momenta: Momenta, members: Sequence[int], noise: float) -> bool:
    """Whether a constant momentum that is known up to ``noise`` tells that the chosen parts fly: not of parts at rest.

    Large parts print coarse numbers, behind which a load on the chosen ones may hide.  Where these have no mass, as
    springs, the members of the set count instead.
    """
    parts = momenta.chosen if momenta.values[:, list(momenta.chosen)].any() else members
    change = momenta.change(parts)
    size = change if change > 2 * momenta.noise(parts) else float(np.abs(momenta.values[:, list(parts)]).max())
    return size > _VISIBLE * noise


class FreeFall:
    """Least-squares fits of free flight to windows of one momentum, a `Law`."""

    def __init__(self, time: Samples, momentum: Samples) -> None:
        self.time, self.momentum = time, momentum
        self.integral = integral(time, momentum)
        self._both = np.hstack([momentum, self.integral])

    def misfit(self, first: int, last: int) -> float:
        """Largest deviation of the momentum from free flight between two states [momentum]."""
        if abs(last - first) < 3:  # three numbers per component fit any three states
            return 0.0
        p, impulse, alpha = self._fitted(min(first, last), max(first, last))
        return float(np.abs(p + alpha * impulse).max())

    def damping(self, first: int, last: int) -> float:
        """Least-squares alpha between two states [1/time]."""
        return self._fitted(first, last)[2]

    def gravity(self) -> Samples:
        """Least-squares g over all states, shape (components,) [momentum/time]."""
        undamped = self.momentum + self.damping(0, self.time.size - 1) * self.integral
        return np.asarray(np.polyfit(self.time - self.time[0], undamped, 1)[0])

    def _fitted(self, first: int, last: int) -> tuple[Samples, Samples, float]:
        """What is not straight of momentum and impulse, and the alpha >= 0 that explains the one by the other."""
        states = slice(first, last + 1)
        p, impulse = np.hsplit(bent(self.time[states], self._both[states]), 2)
        power = float(np.sum(impulse**2))
        return p, impulse, max(0.0, -float(np.sum(impulse * p)) / power) if power > 0 else 0.0


def _sets(momenta: Momenta, td: float) -> Iterator[tuple[int, ...]]:
    """Sets of parts to try: the chosen ones, these with more and more of the attached ones, all that move."""
    moving, members = momenta.moving, list(momenta.chosen)
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
    if look.size < FEWEST:
        return
    rests = bent(time[look], momenta.values[look].reshape(look.size, -1))
    rests = rests.reshape(look.size, -1, 3).transpose(1, 0, 2).reshape(momenta.values.shape[1], -1)
    total = rests[list(chosen)].sum(axis=0)
    left = [i for i in moving if i not in chosen]
    for _ in range(min(_MOST_ATTACHED, len(left))):
        sizes = np.linalg.norm(total + rests[left], axis=1)
        best = int(np.argmin(sizes))
        if sizes[best] >= np.linalg.norm(total):
            return
        total = total + rests[left[best]]
        yield left.pop(best)
