"""How far a body is out of place at td because parts of it were frozen elsewhere.

A part that moves against the rest, an engine on its mounts, is frozen where it is at tr.  The centre of mass flies as
if nothing had been switched, so the rest of the body is off by the part's share of the mass times its displacement
against the rest from tr to td, in the frame that turns with the body (docs/explanation/flights.md, "Out of place").
Displacements come from the velocities of the parts, which are their momenta over their masses.

Of several rigid bodies each is off by itself, and the largest error counts.  One of a single part moves as the part
does: its momentum is kept, and nothing in it is frozen elsewhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.flight.rotation import (
    moving_apart,
    off_the_circle,
    periods_of,
    shows_rotation,
)
from d2rpick.flight.turning import Flying, turning_in_flight
from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import integral, window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.turning import Turning
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part

# Rotations are looked for on so many states at most; the displacements come from all of them.
_STATES: Final = 200
# The velocity against the others of a part that nothing joins to them changes by no more than this share of it: where a
# body turns by a hundredth of a degree, that of its parts changes by more.
_STEADY: Final = 1e-4
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
        self.time, self.place, self.path, self.part, self.doubt = (
            time,
            place,
            path,
            part,
            doubt,
        )
        self.turning, self.moving, self.slow = turning, tuple(moving), slow

    @cached_property
    def at_least(self) -> bool:
        """Whether errors and angles are lower bounds: inner motion passes for that of the body.

        A slow one of the part does.  So does that of the others, where it turns their frame by more than is said of
        the body, or where no deck tells that, moves them by a notable share of what the part does.
        """
        moved = float(
            np.sqrt(
                np.mean(np.square(self.place - self.place.mean(axis=0)).sum(axis=1))
            )
        )
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
        there = np.stack(
            [np.interp([*tr.tolist(), td], self.time, axis) for axis in self.place.T],
            axis=1,
        )
        return self._inside(tr, td, there[:-1] - there[-1])

    def angles(self, tr: Samples, td: float) -> Samples:
        """By how much the body is turned at td from where it should be, for times tr (k,) [degrees]; NaN if unknown."""
        turned = (
            np.full((tr.size, 3), np.nan)
            if self.turning is None
            else self.turning.angles(tr, td)
        )
        return np.degrees(self._inside(tr, td, turned))

    def _inside(self, tr: Samples, td: float, vectors: Samples) -> Samples:
        """Lengths of vectors (k, 3), NaN outside the flight."""
        inside = (
            (tr >= self.time[0])
            & (tr <= self.time[-1])
            & (self.time[0] <= td <= self.time[-1])
        )
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
    momenta, masses, inside = (
        seen.momenta,
        seen.masses,
        window(seen.momenta.time, seen.start, seen.end),
    )
    time, mass = momenta.time[inside], masses[list(seen.members)]
    if momenta.parts is None or time.size < FEWEST or not np.isfinite(mass).all():
        return None
    members = [i for i, m in zip(seen.members, mass.tolist(), strict=True) if m > 0]
    mass = masses[members]
    if not shows_rotation(mass):
        return None
    ways, path = _ways(
        time, momenta.values[inside][:, members] / mass[:, np.newaxis], mass
    )
    stride = -(-time.size // _STATES)
    moving, rate, rest = moving_apart(time[::stride], ways[::stride], mass)
    if not moving:
        return None
    whole = float(
        np.nansum(masses[sorted({*seen.others, *members})])
    )  # unknown ones left out: no error is told too small
    share = float(mass[moving].sum()) / whole
    doubt = share * float(
        np.sqrt(rest / ((mass.sum() - mass[moving].sum()) * -(-time.size // stride)))
    )
    offsets = _offsets(time, ways, mass, moving, rate) * float(mass.sum()) / whole
    against = [members[i] for i in moving]
    ids = [momenta.parts[i].id for i in against]
    part = momenta.parts[against[int(np.argmax(np.square(offsets).sum(axis=(0, 2))))]]
    turning = (
        turning_in_flight(seen._replace(members=members), against, placement)
        if placement
        else None
    )
    place = offsets.sum(axis=1)
    slow = bool(rate.any()) and periods_of(time[::stride], place[::stride], rate) < 1
    found = Drift(time, place, path, part, doubt, turning, moving=ids, slow=slow)
    return found if doubt <= found.limit else None


def _ways(time: Samples, velocity: Samples, mass: Samples) -> tuple[Samples, Samples]:
    """Give the ways of parts (n, parts, 3) against their centre of mass, and the path of that (n,) [length]."""
    centre = np.average(velocity, axis=1, weights=mass)
    ways = integral(
        time, (velocity - centre[:, np.newaxis]).reshape(time.size, -1)
    ).reshape(velocity.shape)
    return ways, integral(time, np.linalg.norm(centre, axis=1))


def _offsets(
    time: Samples, ways: Samples, mass: Samples, moving: Sequence[int], rate: Samples
) -> Samples:
    """How far each of the moving parts pushes the others off, if no more flies, shape (n, moving, 3) [length]."""
    others = np.setdiff1d(np.arange(mass.size), moving)
    shares = mass[list(moving), np.newaxis] / mass.sum()
    against = (
        ways[:, list(moving)]
        - np.average(ways[:, others], axis=1, weights=mass[others])[:, np.newaxis]
    )
    return np.asarray(-shares * off_the_circle(time, against, rate))


def drift_in_flight(
    history: History,
    flight: Flight,
    parts: Sequence[Part] | None = None,
    placement: Placement | None = None,
) -> Drift | None:
    """Find the drift of the body that ``parts``, or those to be switched, become in a flight.

    None also where the momentum of single parts does not show the flight.  ``placement`` is that of the deck.
    """
    seen = _seen(history, flight, parts)
    return drift_of(seen, placement) if seen else None


def apart_in_flight(
    history: History, flight: Flight, parts: Sequence[Part] | None = None
) -> tuple[Part, ...]:
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
    against = (
        momentum / mass[:, np.newaxis]
        - (whole - momentum) / (mass.sum() - mass)[:, np.newaxis]
    )
    speed, path = (
        np.linalg.norm(against.mean(axis=0), axis=1),
        np.linalg.norm(whole[:, 0] / mass.sum(), axis=1),
    )
    steady = np.linalg.norm(np.ptp(against, axis=0), axis=1) <= _STEADY * speed
    far = speed * (time[-1] - time[0]) > MOST_OF_PATH * float(
        integral(time, path[:, np.newaxis])[-1, 0]
    )
    alone = steady & far & (2 * mass <= mass.sum())
    return tuple(
        seen.momenta.parts[i]
        for i, one in zip(members, alone.tolist(), strict=True)
        if one
    )


def _seen(
    history: History, flight: Flight, parts: Sequence[Part] | None
) -> Flying | None:
    """Collect what a drift rests on; None where the momentum of single parts does not show the flight."""
    momenta, masses = (
        next((one for one in history.momenta if one.parts is not None), None),
        history.masses,
    )
    if (
        momenta is None
        or momenta.parts is None
        or masses is None
        or flight.parts is None
        or flight.refusal
    ):
        return None
    ids = {part.id for part in flight.parts}
    wanted = (
        {momenta.parts[i].id for i in momenta.chosen}
        if parts is None
        else {part.id for part in parts}
    )
    flying = [
        i for i in momenta.moving if momenta.parts[i].id in ids
    ]  # the ground does not fly
    members = [i for i in flying if momenta.parts[i].id in wanted]
    return Flying(momenta, masses, members, *flight.within(momenta.time), flying)


class RigidBody(NamedTuple):
    """Numbers of the parts that become one rigid body; ``whole`` False: a single part whose pieces move by themselves.

    Of pieces that do not hang together and yet become one body nobody writes how they move against each other.
    """

    parts: tuple[int, ...]
    whole: bool = True

    @property
    def name(self) -> str:
        """Numbers of the parts, as `parts` takes them."""
        return ",".join(map(str, self.parts))


class Off(NamedTuple):
    """How far the body that is off most will be [length], and how it drifts; ``body`` is named where there are several.

    ``assumed``: no deck tells that the parts become one body.  ``at_least``: it may be further off, or another body is.
    """

    error: float
    drift: Drift
    body: RigidBody | None
    assumed: bool
    at_least: bool = False

    @property
    def part(self) -> str | None:
        """Name of the part that is frozen elsewhere; None where nothing is."""
        return self.drift.part.name if self.error > 0 else None


class Bodies:
    """Rigid bodies of a flight, each with its drift; ``told`` are those of a deck, none where one body is assumed.

    Where the drift of one of them is not known, no error is: it may be the largest.  ``apart`` are parts that are to
    become one body with others, and fly away from them.
    """

    def __init__(
        self,
        drifts: Sequence[Drift | None],
        told: Sequence[RigidBody] | None,
        apart: Sequence[Part] = (),
    ) -> None:
        self.told, self.apart = tuple(told or ()), tuple(apart)
        self._known = tuple(one for one in drifts if one)
        self._complete = len(self._known) == len(drifts) > 0
        self.unknown = tuple(
            body for body, one in zip(self.told, drifts, strict=False) if one is None
        )

    def errors(self, tr: Samples, td: float) -> Samples:
        """How far the body that is off most will be at td, for times tr (k,) [length]; NaN outside the flight."""
        return (
            np.asarray(self._each(tr, td).max(axis=0))
            if self._complete
            else np.full(tr.shape, np.nan)
        )

    @property
    def limit(self) -> float:
        """From which error on a body is out of place, the least of those whose parts move [length]."""
        return min(
            (one.limit for one in self._known if one.place.any()), default=np.inf
        )

    def worst(self, tr: float, td: float) -> Off | None:
        """Give the body that is off most; None outside the flight, and where one is not known."""
        found = (
            self._each(np.array([tr]), td)[:, 0]
            if self._complete
            else np.full(1, np.nan)
        )
        if np.isnan(found).any():
            return None
        at = int(np.argmax(found))
        body = self.told[at] if len(self.told) > 1 else None
        return Off(
            float(found[at]),
            self._known[at],
            body,
            not self.told,
            any(one.at_least for one in self._known),
        )

    def _each(self, tr: Samples, td: float) -> Samples:
        """Errors by body, shape (bodies, k) [length]."""
        return np.stack([one.errors(tr, td) for one in self._known])


def bodies_in_flight(
    history: History,
    flight: Flight,
    told: Sequence[RigidBody] | None,
    placement: Placement | None = None,
) -> Bodies:
    """Find how the bodies that the parts to be switched become drift in a flight.

    Parameters
    ----------
    history : History
    flight : Flight
        With the parts that fly in it.
    told : sequence of RigidBody or None
        By a deck; without them the parts are taken for one body.
    placement : Placement, optional
        Where the deck puts the parts.
    """
    if not told:
        away = apart_in_flight(history, flight)
        return Bodies(
            [None if away else drift_in_flight(history, flight, placement=placement)],
            None,
            away,
        )
    parts = [
        [part for part in history.parts or () if part.id in body.parts] for body in told
    ]
    leaving = [apart_in_flight(history, flight, own) for own in parts]
    drifts = [
        None if some else _drift(history, flight, body, own, placement)
        for body, own, some in zip(told, parts, leaving, strict=True)
    ]
    return Bodies(drifts, told, sum(leaving, ()))


def _drift(
    history: History,
    flight: Flight,
    body: RigidBody,
    parts: Sequence[Part],
    placement: Placement | None,
) -> Drift | None:
    """Drift of one body of those parts that have energy; of a single part none at all while it flies."""
    if not body.whole or len(parts) < len(body.parts):
        return None
    if len(parts) > 1:
        return drift_in_flight(history, flight, parts, placement)
    (part,) = parts
    if flight.refusal or part.id not in {one.id for one in flight.parts or ()}:
        return None
    return Drift(
        np.array(flight.within(history.time)), np.zeros((2, 3)), np.zeros(2), part, 0.0
    )
