"""Free flight, seen in the momentum: gravity and damping proportional to mass are all that acts.

What flies together obeys p' = g - alpha p in each component, with constant g and one alpha >= 0, so that
p(t) = p0 + g t - alpha int p dt: linear in p0, g and alpha.  A part alone does not fly freely while another one is
attached to it and vibrates against it, so the set of parts that flies is looked for as well.
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.flight.window import (
    FEWEST,
    TOLERANCE,
    Constant,
    FreeFlight,
    Remembered,
    all_windows,
    lasting_window,
    longest_window,
    moments,
)
from d2rpick.histories.samples import bent, integral, window

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Balance, Momenta, Samples

# A momentum that changes by less than this share of itself is constant: single precision keeps seven digits.
_CONSTANT = 1e-6
# Where it is constant as far as the printed digits tell, the chosen parts must move this many times what these hide.
_VISIBLE = 100
# A set with more parts is preferred when its window is longer by this factor.  Some samples more prove nothing: parts
# with a large momentum of their own, a sled, loosen the tolerance for the others.
_LONGER = 1.1
# Parts that may be attached are looked for in this share of the record before td, on so many states at most.  What
# bends the momenta of a body cancels but for this share: digits and the solver's own errors.
_LOOK_BACK, _LOOK_STATES, _CANCELS = 0.1, 200, 1e-3
# Gravity on earth in m, inches and feet per second squared; in other units of length and time a power of ten of these.
# Decks have what stands below it; a load that is so close to one of them by chance is one in two hundred.
_GRAVITY, _ALIKE = (9.80665, 3.86089, 3.21740), 0.002
_OF_DECKS = (9.80665, 9.81, 9.8, 9.807, 3.86089, 3.864, 3.86, 3.2174, 3.22)
# Digits that hide so much of the momentum leave so many times that open in its change: damping is fitted, too.
_REACH_OF_DIGITS = 10.0
# While the last of a load still bends the momentum, gravity is recognised so roughly; along an axis it has this cosine.
_ROUGHLY, _ALONG_AXIS = 0.05, 0.999
# Damping that takes so much of the momentum in a window is believed where there is so much of the largest momentum.
_DAMPED, _LEFT = 0.2, 0.05
# So little of the range may still change in a window where nothing but gravity is admitted, although a load fades on.
_ENOUGH = TOLERANCE
# A change of momentum that no gravity explains is none up to so many times what a window leaves open.
_UNSEEN = 2.0
# States that tell a work from none: twice the unknowns.
_LEAST_STATES = 6
# A body of its own flies by itself for this share of the record, at a velocity that differs by this from that of all.
_BY_ITSELF, _OF_ITS_OWN = 0.25, 0.05


def to_be_asked(momenta: Sequence[Momenta]) -> Sequence[Momenta]:
    """Give the momenta that may tell of flight, best first: all, or where a set was named to fly only that one's."""
    return [one for one in momenta if one.flying] or momenta


def flight_around(momenta: Momenta, td: float, balance: Balance | None = None) -> FreeFlight | None:
    """Find the set of parts that flies freely around ``td`` for clearly the longest time, and when.

    Unless the set is known, tried are the chosen parts, these with the parts that move most against them, and all.

    Parameters
    ----------
    momenta : Momenta
    td : float
        [time]
    balance : Balance, optional
        Of the model: tells of its momentum whether gravity works on it, where its mass does not.

    Returns
    -------
    FreeFlight or None
        None when no set flies around td.
    """
    best: FreeFlight | None = None
    if momenta.at_rest:
        return None
    for members in [momenta.flying] if momenta.flying else _sets(momenta, td):
        found = flight_of(momenta, members, td, balance)
        if found and (best is None or found.end - found.start > _LONGER * (best.end - best.start)):
            best = _of_its_bodies(momenta, members, td, found) or best
    return best


def _of_its_bodies(momenta: Momenta, members: Sequence[int], td: float, flight: FreeFlight) -> FreeFlight | None:
    """Give what of the flight of a set is one of each body in it: bodies that hit each other keep their momentum."""
    for part in bodies_apart(momenta, members):
        alone = flight_of(momenta, (part,), td)
        if alone is None:
            return None
        start, end_seen = max(flight.start, alone.start), flight.end_seen or alone.end < flight.end
        flight = flight._replace(start=start, end=min(flight.end, alone.end), end_seen=end_seen)
    return flight if flight.start < flight.end else None


def bodies_apart(momenta: Momenta, members: Sequence[int]) -> tuple[int, ...]:
    """Give the parts among ``members`` that fly by themselves at some time, at a velocity that is not that of all."""
    key = "apart", tuple(members)
    if key not in momenta.known:
        momenta.known[key] = tuple(_apart(momenta, key[1])) if momenta.parts and len(members) > 1 else ()
    found: tuple[int, ...] = momenta.known[key]
    return found


def _apart(momenta: Momenta, members: tuple[int, ...]) -> Iterator[int]:
    mass, masses = momenta.mass(members), momenta.masses
    if masses is None or not mass > 0:
        return
    velocity = momenta.of(members) / mass
    room = _OF_ITS_OWN * float(np.abs(velocity).max())
    for part in members:
        if not masses[part] > 0:
            continue
        relative = np.linalg.norm(momenta.values[:, part] / masses[part] - velocity, axis=1)
        flights = all_windows(momenta.time, partial(flight_of, momenta, (part,)))
        apart = (
            flight.end - flight.start
            for flight in flights
            if float(relative[window(momenta.time, flight.start, flight.end)].min()) > room
        )
        if sum(apart) > _BY_ITSELF * float(momenta.time[-1] - momenta.time[0]):
            yield part


def flight_of(momenta: Momenta, members: Sequence[int], td: float, balance: Balance | None = None) -> FreeFlight | None:
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
    laws = _laws(momenta, tuple(members), balance)
    states, gravity = laws.window(td)
    if states is None or (not gravity and _falls(momenta)):
        return None  # what does not fall with the others is carried
    first, last = states
    if float(np.abs(momentum[(first + last) // 2 : last + 1]).max()) <= TOLERANCE * extent + noise:
        return None  # held, or at rest
    damping = laws.fit.damping(first, last) if gravity is not None else 0.0
    return FreeFlight(float(time[first]), float(time[last]), parts, last < time.size - 1, damping, gravity or 0.0)


def _laws(momenta: Momenta, members: tuple[int, ...], balance: Balance | None = None) -> Laws:
    """Give the laws of free flight for a set of parts, made once for all td."""
    mass = momenta.mass(members)
    whole = balance if momenta.parts is None or np.isnan(mass) else None
    key = "laws", members, whole is None
    if key not in momenta.known:
        momenta.known[key] = Laws(momenta.time, momenta.of(members), mass, momenta.noise(members), whole)
    laws: Laws = momenta.known[key]
    return laws


def _falls(momenta: Momenta) -> bool:
    """Whether some part by itself is seen to fall under gravity."""
    if "falls" not in momenta.known:
        momenta.known["falls"] = momenta.parts is not None and any(_laws(momenta, (i,)).fall for i in momenta.moving)
    return bool(momenta.known["falls"])


class Laws:
    """Free flight of one set of parts: under gravity and damping, or where nothing at all acts.

    A constant net force is no proof of gravity, and a push that fades exponentially looks like damping under such a
    force.  So it is believed only if it is the mass times the gravity of the earth, in whatever units.
    """

    def __init__(self, time: Samples, momentum: Samples, mass: float, noise: float, balance: Balance | None) -> None:
        self.fit, self.mass, self.noise, self.balance = FreeFall(time, momentum), mass, noise, balance
        self.extent = float(np.ptp(momentum, axis=0).max())
        self._falling, self._steady = Remembered(self.fit), Remembered(Constant(time, momentum))
        self._given: dict[float, Remembered] = {}

    def window(self, td: float) -> tuple[tuple[int, int] | None, float | None]:
        """Give the states around ``td`` in free flight, and its gravity [length/time^2]; None where nothing acts."""
        window = lasting_window(self._falling, td, self.extent, self.noise, fades=True)
        gravity = self._gravity(window) if window and not self._braked(*window) else None
        if gravity is not None:
            return window, gravity
        window = lasting_window(self._steady, td, self.extent, self.noise, fades=True, enough=_ENOUGH)
        if window:
            return (None if self.fall else window), None
        return self._under_gravity(td)

    def _braked(self, first: int, last: int) -> bool:
        """Whether what is left of a motion that a brake has taken looks like damping."""
        largest, left = (float(np.abs(self.fit.momentum[slice(at, last + 1)]).max()) for at in (0, first))
        length = float(self.fit.time[last] - self.fit.time[first])
        return left < _LEFT * largest and self.fit.damping(first, last) * length > _DAMPED

    def _under_gravity(self, td: float) -> tuple[tuple[int, int] | None, float | None]:
        """Give the window around ``td`` under one of the accelerations that decks have for gravity: a load may fade."""
        time, momentum = self.fit.time, self.fit.momentum
        at = min(int(np.searchsorted(time, td)), time.size - 1)
        first, last = longest_window(self._falling, at, _ENOUGH * self.extent + self.noise)
        if last - first < FEWEST or not self.mass > 0:
            return None, None
        slope = np.polyfit(time[first : last + 1] - time[first], momentum[first : last + 1], 1)[0] / self.mass
        size = float(np.linalg.norm(slope))
        if not size > 0:
            return None, None
        direction = np.round(slope / size) if np.abs(slope / size).max() > _ALONG_AXIS else slope / size
        found = []
        for gravity in _gravities_near(size):
            if gravity not in self._given:
                weight = (time - time[0])[:, np.newaxis] * direction * (self.mass * gravity)
                self._given[gravity] = Remembered(Constant(time, momentum - weight))
            law = self._given[gravity]
            found.append((lasting_window(law, td, self.extent, self.noise, fades=True), gravity))
        windows = [(one, gravity) for one, gravity in found if one]
        return max(windows, key=lambda one: float(np.ptp(time[[*one[0]]])), default=(None, None))

    def _gravity(self, window: tuple[int, int]) -> float | None:
        """Acceleration in a window: 0 where none is seen, None where it is not that of gravity [length/time^2].

        NaN where neither the mass nor the work tells.
        """
        start, end = self.fit.time[[*window]].tolist()
        vector = self.fit.gravity(*window)
        force, mass = float(np.linalg.norm(vector)), self.mass if self.mass > 0 else float("nan")
        if force * (end - start) <= _UNSEEN * (TOLERANCE * self.extent + self.noise):
            return None if self.fall else 0.0
        if is_gravity(force / mass, _ALIKE + _REACH_OF_DIGITS * self.noise / (force * (end - start))):
            return force / mass
        found = None
        if self.balance is not None:
            found = acceleration_by_work(self.balance, self.fit.time, self.fit.momentum @ (vector / force), start, end)
        velocity = self.mass == 1.0
        if found is None:
            return float("nan") if velocity or np.isnan(mass) else None
        return found if is_gravity(found) or (velocity and found > 0) else None

    @cached_property
    def fall(self) -> bool:
        """Whether gravity moves the parts at some time: where it does not show, something carries them."""
        self.fall = False  # asked while it is looked for
        if not self.noise < TOLERANCE * self.extent or self.fit.time.size < FEWEST:
            return False
        windows = (
            lasting_window(self._falling, td, self.extent, self.noise, fades=True) for td in moments(self.fit.time)
        )
        return any((self._gravity(one) or 0.0) > 0 for one in windows if one)


def _gravities_near(acceleration: float) -> Iterator[float]:
    """What decks have for gravity, roughly as large as an acceleration."""
    for value in _OF_DECKS if acceleration > 0 else ():
        gravity = float(value * 10.0 ** np.round(np.log10(acceleration / value)))
        if abs(acceleration / gravity - 1) < _ROUGHLY:
            yield gravity


def is_gravity(acceleration: float, error: float = _ALIKE) -> bool:
    """Whether an acceleration [length/time^2], known with a relative error, is gravity on earth in consistent units.

    Examples
    --------
    >>> [is_gravity(one) for one in (9.81, 9810, 9.80665e-3, 386.4, 5.0, float("nan"))]
    [True, True, True, True, False, False]
    """
    if not acceleration > 0:
        return False
    powers = np.log10(acceleration / np.array(_GRAVITY))
    return bool(np.abs(powers - np.round(powers)).min() <= np.log10(1 + error))


def acceleration_by_work(balance: Balance, time: Samples, momentum: Samples, start: float, end: float) -> float | None:
    """Acceleration by which the external work grows on a momentum, or else kinetic and internal energy [length/time^2].

    Gravity g works by the integral of g p, whatever part of the model it moves; what is fixed has no momentum.

    Parameters
    ----------
    balance : Balance
    time, momentum : array of shape (n,)
        Momentum along the force.
    start, end : float
        [time]

    Returns
    -------
    float or None
        None where none of them is written.
    """
    worked = balance.external_work is not None and bool(np.ptp(balance.external_work))
    work = balance.external_work if worked else balance.kinetic_and_internal
    inside = window(balance.time, start, end)
    if work is None or balance.time[inside].size < _LEAST_STATES:
        return None
    impulse = integral(balance.time[inside], np.interp(balance.time[inside], time, momentum))
    columns = [np.ones_like(impulse), impulse]
    if balance.kinetic is not None:
        columns.append(integral(balance.time[inside], balance.kinetic[inside]))
    factors, *_ = np.linalg.lstsq(np.stack(columns, axis=1), work[inside], rcond=None)
    return float(factors[1])


def all_flights(momenta: Momenta, balance: Balance | None = None) -> tuple[FreeFlight, ...]:
    """Find all windows of free flight of the chosen parts and what flies with them, ascending in time."""
    return all_windows(momenta.time, partial(flight_around, momenta, balance=balance))


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

    def gravity(self, first: int = 0, last: int = -1) -> Samples:
        """Least-squares g between two states, by default of all, shape (components,) [momentum/time]."""
        last %= self.time.size
        states = slice(first, last + 1)
        undamped = self.momentum[states] + self.damping(first, last) * self.integral[states]
        return np.asarray(np.polyfit(self.time[states] - self.time[first], undamped, 1)[0])

    def _fitted(self, first: int, last: int) -> tuple[Samples, Samples, float]:
        """What is not straight of momentum and impulse, and the alpha >= 0 that explains the one by the other."""
        states = slice(first, last + 1)
        p, impulse = np.hsplit(bent(self.time[states], self._both[states]), 2)
        power = float(np.sum(impulse**2))
        return p, impulse, max(0.0, -float(np.sum(impulse * p)) / power) if power > 0 else 0.0


def _sets(momenta: Momenta, td: float) -> Iterator[tuple[int, ...]]:
    """Sets of parts to try: the chosen ones, these with what hangs on them, all that move.

    Where all parts are chosen, nobody chose: then those that something carries are left out.
    """
    chosen = tuple(momenta.chosen)
    yield chosen
    if len(chosen) == momenta.values.shape[1] and len(apart := bodies_apart(momenta, chosen)) > 0:
        yield apart
    attached = tuple(sorted({*chosen, *_attached(momenta, chosen, td)}))
    if attached != chosen:
        yield attached
    if set(momenta.moving) - set(attached):
        yield tuple(sorted({*momenta.moving, *attached}))


def _attached(momenta: Momenta, chosen: Sequence[int], td: float) -> tuple[int, ...]:
    """Give the parts that must be added for what bends the momenta of all before td to cancel.

    Within each body that flies, forces cancel: added up, the momenta of its parts are straight.  So such sums are the
    null space of what is bent, and in its projector the parts of a body stand together.
    """
    time = momenta.time
    back = (time >= td - _LOOK_BACK * (time[-1] - time[0])) & (time <= td)
    look = np.flatnonzero(back)[:: max(1, int(back.sum()) // _LOOK_STATES)]
    if look.size < FEWEST:
        return ()
    rests = bent(time[look], momenta.values[look].reshape(look.size, -1))
    rests = rests.reshape(look.size, -1, 3).transpose(1, 0, 2).reshape(momenta.values.shape[1], -1)
    sizes = np.linalg.norm(rests, axis=1)
    moving = [i for i in momenta.moving if sizes[i] > 0]
    if not set(chosen) & set(moving):
        return ()
    left, values, _ = np.linalg.svd(rests[moving] / sizes[moving, np.newaxis], full_matrices=True)
    values = np.append(values, np.zeros(len(moving) - values.size))
    null = left[:, values <= _CANCELS * values[0]]
    shares = (null @ null.T) / np.outer(sizes[moving], sizes[moving])
    rows = [moving.index(i) for i in chosen if i in moving]
    joined = (shares[rows] > np.diag(shares)[rows, np.newaxis] / 2).any(axis=0)
    return _polished(rests, {*chosen, *np.array(moving)[joined].tolist()}, chosen, moving)


def _polished(rests: Samples, members: set[int], chosen: Sequence[int], moving: Sequence[int]) -> tuple[int, ...]:
    """Add or leave out single parts as long as what is bent of the sum, (parts, k), becomes less."""
    total = rests[sorted(members)].sum(axis=0)
    free = [i for i in moving if i not in chosen]
    while free:
        sides = np.array([-1.0 if i in members else 1.0 for i in free])
        sizes = np.linalg.norm(total + sides[:, np.newaxis] * rests[free], axis=1)
        best = int(np.argmin(sizes))
        if sizes[best] >= np.linalg.norm(total):
            break
        total = total + sides[best] * rests[free[best]]
        members = members ^ {free[best]}
    return tuple(sorted(members - set(chosen)))
