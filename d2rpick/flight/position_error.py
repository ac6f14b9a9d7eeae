"""How far a body is out of place at td because parts of it were frozen elsewhere.

A part that moves against the rest, an engine on its mounts, is frozen where it is at tr.  The centre of mass flies as
if nothing had been switched, so the rest of the body is off by the part's share of the mass times its displacement
against the rest from tr to td, in the frame that turns with the body (docs/choosing.md, "Out of place").
Displacements come from the velocities of the parts, which are their momenta over their masses.
"""

from __future__ import annotations

from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.rotation import least_rests, least_ways, off_the_circle, periods_of, steady_rotation
from d2rpick.flight.turning import Flying, turning_in_flight
from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import integral, window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.turning import Turning
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part

    Places = NDArray[np.intp]

# Rotations are looked for on so many states at most; the displacements come from all of them.
_STATES: Final = 200
# Parts that are tried as the one that moves against the others, by what a rotation and by what rest leaves over.
_TRIED: Final = 2
# Without a further part that moves, the others leave over no more than this of what they did with it.
_MORE_RIGID: Final = 0.5
# Less than this share of all that the parts do, r^2, is nothing: a thousandth of the ways.
_NOTHING: Final = 1e-6
# A rotation by which the others move a tenth of what the part does changes its displacement by no more.
_NOTABLE_WAY: Final = 0.1
# A body shows no rotation where one part has more than this share of it.
_MOST_OF_BODY: Final = 0.95
# The velocity against the others of a part that nothing joins to them changes by no more than this share of it: where a
# body turns by a hundredth of a degree, that of its parts changes by more.
_STEADY: Final = 1e-4
# Parts of a smaller share of the mass move the others too little to be asked about that.
_HEAVY: Final = 0.05
# Others that bend so make the error a lower bound.  In computed cars whose errors came out right this was at most 0.24,
# in a public one whose error was three and four times as large 1.1 and 1.4.
_NOTABLE_DOUBT: Final = 1 / 3
# What moves the body by less than this share of the limit may be three times as much: it stays in place.
_HARDLY: Final = 0.01
# A body that has flown so many times its error is not out of place: that is a third of the margin before a contact,
# 3 % of the flight, within which runs have moved their landing.
MOST_OF_PATH: Final = 0.01


class Drift:
    """How far a body is off where the parts that move against it are: differences count, from tr to td.

    Attributes
    ----------
    time : array of shape (n,)
        Of the states in flight [time].
    place : array of shape (n, 3)
        Of the body against where a rigid body would be, in the frame that turns with it, up to a constant [length].
    path : array of shape (n,)
        How far the centre of mass has flown [length].
    part : Part
        The part that moves against the others, of several the one with most effect.
    doubt : float
        What may be wrong with the differences, since the others are not one rigid body either [length].
    turning : Turning or None
        How the body turns, where a deck places its parts.
    moving : tuple of int
        Numbers of all parts that move against the others.
    slow : bool
        Whether they swing for less than a period: most of that passes for the rotation.
    """

    def __init__(
        self, time: Samples, place: Samples, path: Samples, part: Part, doubt: float, turning: Turning | None = None,
        *, moving: Sequence[int] = (), slow: bool = False,
    ) -> None:  # fmt: skip
        self.time, self.place, self.path, self.part, self.doubt = time, place, path, part, doubt
        self.turning, self.moving, self.slow = turning, tuple(moving), slow

    @cached_property
    def at_least(self) -> bool:
        """Whether errors and angles are lower bounds: inner motion passes for that of the body.

        A slow one of the part does.  So does that of the others, where it turns their frame by more than is said of
        the body, or where no deck tells that, moves them by a notable share of what the part does.
        """
        moved = float(np.sqrt(np.mean(np.square(self.place - self.place.mean(axis=0)).sum(axis=1))))
        if moved <= _HARDLY * self.limit:
            return False
        if self.slow or self.turning is None:
            return self.slow or self.doubt > _NOTABLE_DOUBT * moved
        said = np.radians(self.angles(self.time, float(self.time[-1])))
        return self.turning.doubt > float(np.sqrt(np.mean(said**2)))

    def errors(self, tr: Samples, td: float) -> Samples:
        """Distances of the body at td from where it should be, for times tr (k,) [length]; NaN outside the flight.

        Where the deck tells how it turns, at the nodes of the body that the run watches, else at its centre of mass.
        """
        if self.turning:
            return self._inside(tr, td, self.turning.offsets(tr, td))
        there = np.stack([np.interp([*tr.tolist(), td], self.time, axis) for axis in self.place.T], axis=1)
        return self._inside(tr, td, there[:-1] - there[-1])

    def angles(self, tr: Samples, td: float) -> Samples:
        """By how much the body is turned at td from where it should be, for times tr (k,) [degrees]; NaN if unknown."""
        turned = np.full((tr.size, 3), np.nan) if self.turning is None else self.turning.angles(tr, td)
        return np.degrees(self._inside(tr, td, turned))

    def _inside(self, tr: Samples, td: float, vectors: Samples) -> Samples:
        """Lengths of vectors (k, 3), NaN outside the flight."""
        inside = (tr >= self.time[0]) & (tr <= self.time[-1]) & (self.time[0] <= td <= self.time[-1])
        return np.where(inside, np.linalg.norm(vectors, axis=1), np.nan)

    @cached_property
    def limit(self) -> float:
        """From which error on the body is out of place [length]."""
        return MOST_OF_PATH * float(self.path[-1])


def drift_of(seen: Flying, placement: Placement | None = None) -> Drift | None:
    """Find how the body drifts in flight against where a rigid one would be.

    The parts that move against the others are those without which the others are most nearly one rigid body that
    turns at a constant rate; together they have at most half of the mass.

    Parameters
    ----------
    seen : Flying
    placement : Placement, optional
        Where the deck puts the parts: how the body turns is known too then.

    Returns
    -------
    Drift or None
        None where it is not known: a mass is not, there are fewer than three parts, or two with hardly any mass beside
        the third, or the others are no rigid body by far.
    """
    momenta, masses, inside = seen.momenta, seen.masses, window(seen.momenta.time, seen.start, seen.end)
    time, mass = momenta.time[inside], masses[list(seen.members)]
    if momenta.parts is None or time.size < FEWEST or not np.isfinite(mass).all():
        return None
    members = [i for i, m in zip(seen.members, mass.tolist(), strict=True) if m > 0]
    mass = masses[members]
    if not _shows_rotation(mass):
        return None
    ways, path = _ways(time, momenta.values[inside][:, members] / mass[:, np.newaxis], mass)
    stride = -(-time.size // _STATES)
    moving, rate, rest = _apart(time[::stride], ways[::stride], mass)
    if not moving:
        return None
    whole = float(
        np.nansum(masses[sorted({*seen.others, *members})])
    )  # unknown ones left out: no error is told too small
    share = float(mass[moving].sum()) / whole
    doubt = share * float(np.sqrt(rest / ((mass.sum() - mass[moving].sum()) * -(-time.size // stride))))
    offsets = _offsets(time, ways, mass, moving, rate) * float(mass.sum()) / whole
    against = [members[i] for i in moving]
    ids = [momenta.parts[i].id for i in against]
    part = momenta.parts[against[int(np.argmax(np.square(offsets).sum(axis=(0, 2))))]]
    turning = turning_in_flight(seen._replace(members=members), against, placement) if placement else None
    place = offsets.sum(axis=1)
    slow = bool(rate.any()) and periods_of(time[::stride], place[::stride], rate) < 1
    found = Drift(time, place, path, part, doubt, turning, moving=ids, slow=slow)
    return found if doubt <= found.limit else None


def _ways(time: Samples, velocity: Samples, mass: Samples) -> tuple[Samples, Samples]:
    """Give the ways of parts (n, parts, 3) against their centre of mass, and the path of that (n,) [length]."""
    centre = np.average(velocity, axis=1, weights=mass)
    ways = integral(time, (velocity - centre[:, np.newaxis]).reshape(time.size, -1)).reshape(velocity.shape)
    return ways, integral(time, np.linalg.norm(centre, axis=1))


def _offsets(time: Samples, ways: Samples, mass: Samples, moving: Sequence[int], rate: Samples) -> Samples:
    """How far each of the moving parts pushes the others off, if no more flies, shape (n, moving, 3) [length]."""
    others = np.setdiff1d(np.arange(mass.size), moving)
    shares = mass[list(moving), np.newaxis] / mass.sum()
    against = ways[:, list(moving)] - np.average(ways[:, others], axis=1, weights=mass[others])[:, np.newaxis]
    return np.asarray(-shares * off_the_circle(time, against, rate))


def _apart(time: Samples, ways: Samples, mass: Samples) -> tuple[list[int], Samples, float]:
    """Find the parts that move against the others, the rate at which these turn, and their rest; none if unknown."""
    moving: list[int] = []
    rate, rest = np.zeros(3), np.inf
    while True:
        found = _next_apart(time, ways, mass, np.setdiff1d(np.arange(mass.size), moving))
        if found is None or found.rest > _MORE_RIGID * rest:
            return moving, rate, rest
        part, rate, rest, _ = found
        moving.append(part)


class _Apart(NamedTuple):
    """A part that is left out, how the others turn and what is left of them, and how far the part pushes them off."""

    part: int
    rate: Samples
    rest: float
    effect: float


def _next_apart(time: Samples, ways: Samples, mass: Samples, left: Places) -> _Apart | None:
    """Of the parts that are left, find that without which the others are most nearly rigid.

    A slide of one part may look like a rotation of all: of those alike in this, the one with most effect counts.
    """
    about, masses = _about_centre(ways[:, left], mass[left]), mass[left]
    orders = (np.argsort(least_rests(time, about, masses)), np.argsort(least_ways(about, masses)))
    may = [[one for one in left[order].tolist() if _may_leave(mass, left, one)][:_TRIED] for order in orders]
    found = [_without(time, ways, mass, left, part) for part in dict.fromkeys(chain(*may))]
    nothing = _NOTHING * float(np.sum(masses[:, np.newaxis] * (about - about.mean(axis=0)) ** 2))
    least = min((one.rest for one in found), default=0.0) + nothing
    alike = [one for one in found if _MORE_RIGID * one.rest <= least]
    return max(alike, key=lambda one: one.effect, default=None)


def _without(time: Samples, ways: Samples, mass: Samples, left: Places, part: int) -> _Apart:
    """Leave one part out and see how the others turn."""
    others = left[left != part]
    way = ways[:, [part]] - np.average(ways[:, others], axis=1, weights=mass[others])[:, np.newaxis]
    least = _NOTABLE_WAY**2 * mass[others].sum() * float(np.sum((way - way.mean(axis=0)) ** 2))
    rate, rest = steady_rotation(time, _about_centre(ways[:, others], mass[others]), mass[others], least)
    return _Apart(part, rate, rest, float(mass[part] * np.linalg.norm(off_the_circle(time, way, rate))))


def _about_centre(ways: Samples, mass: Samples) -> Samples:
    return np.asarray(ways - np.average(ways, axis=1, weights=mass)[:, np.newaxis])


def _may_leave(mass: Samples, left: Places, part: int) -> bool:
    """Whether the others have half of the mass, not nearly all of it in one part."""
    others = mass[left[left != part]]
    return bool(2 * others.sum() >= mass.sum() and others.max() <= _MOST_OF_BODY * others.sum())


def _shows_rotation(mass: Samples) -> bool:
    """Whether the body without any of the heavy parts still shows how it turns."""
    if mass.size < 3:
        return False
    places = np.arange(mass.size)
    heavy = places[(mass >= _HEAVY * mass.sum()) & (2 * mass <= mass.sum())]
    return all(_may_leave(mass, places, part) for part in heavy.tolist())


def drift_in_flight(
    history: History, flight: Flight, parts: Sequence[Part] | None = None, placement: Placement | None = None
) -> Drift | None:
    """Find the drift of the body that ``parts``, or those to be switched, become in a flight.

    None also where the momentum of single parts does not show the flight.  ``placement`` is that of the deck.
    """
    seen = _seen(history, flight, parts)
    return drift_of(seen, placement) if seen else None


def apart_in_flight(history: History, flight: Flight, parts: Sequence[Part] | None = None) -> tuple[Part, ...]:
    """Give those of ``parts``, or of those to be switched, that fly away from the others: nothing joins them to these.

    The velocity of such a part against the others is constant, where that of a part of a body vibrates and turns.
    """
    seen = _seen(history, flight, parts)
    if seen is None or seen.momenta.parts is None:
        return ()
    members = [i for i in seen.members if seen.masses[i] > 0]
    inside, mass = window(seen.momenta.time, seen.start, seen.end), seen.masses[members]
    time, momentum = seen.momenta.time[inside], seen.momenta.values[inside][:, members]
    if time.size < FEWEST or len(members) < 2:
        return ()
    whole = momentum.sum(axis=1, keepdims=True)
    against = momentum / mass[:, np.newaxis] - (whole - momentum) / (mass.sum() - mass)[:, np.newaxis]
    speed, path = np.linalg.norm(against.mean(axis=0), axis=1), np.linalg.norm(whole[:, 0] / mass.sum(), axis=1)
    steady = np.linalg.norm(np.ptp(against, axis=0), axis=1) <= _STEADY * speed
    far = speed * (time[-1] - time[0]) > MOST_OF_PATH * float(integral(time, path[:, np.newaxis])[-1, 0])
    alone = steady & far & (2 * mass <= mass.sum())
    return tuple(seen.momenta.parts[i] for i, one in zip(members, alone.tolist(), strict=True) if one)


def _seen(history: History, flight: Flight, parts: Sequence[Part] | None) -> Flying | None:
    """Collect what a drift rests on; None where the momentum of single parts does not show the flight."""
    momenta, masses = next((one for one in history.momenta if one.parts is not None), None), history.masses
    if momenta is None or momenta.parts is None or masses is None or flight.parts is None or flight.refusal:
        return None
    ids = {part.id for part in flight.parts}
    wanted = {momenta.parts[i].id for i in momenta.chosen} if parts is None else {part.id for part in parts}
    flying = [i for i in momenta.moving if momenta.parts[i].id in ids]  # the ground does not fly
    members = [i for i in flying if momenta.parts[i].id in wanted]
    return Flying(momenta, masses, members, *flight.within(momenta.time), flying)
