"""Compute by how much a body is misplaced at td because its moving parts were frozen in a different position.

A part that moves relative to the other parts, such as an engine on its mounts, is frozen in its position at tr. The
motion of the centre of mass does not change, so the rest of the body is displaced by the part's fraction of the mass
times the part's relative displacement from tr to td, in the frame that rotates with the body
(docs/explanation/position-error.md). Displacements are integrals of the part velocities, i.e. of the momenta divided by
the masses.

If there are several rigid bodies, the largest of their errors is used. A body that consists of a single part has no
error, because its momentum does not change and no part of it is frozen in a different position.
"""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.flight.rotation import (
    count_periods,
    find_moving_parts,
    has_clear_rotation,
    subtract_circles,
)
from d2rpick.flight.turning import Flying, follow_turning
from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import find_window, integrate_by_trapezia

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.body_frame import Displacements
    from d2rpick.flight.flight import Flight
    from d2rpick.flight.turning import Turning
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part

# Largest number of states to which rotations are fitted. Displacements use all states.
_STATES: Final = 200
# A part whose relative velocity changes by at most this fraction is treated as not connected to the body [-].
# Once a body has rotated by 0.01 degrees, the relative velocity of its connected parts changes by more than this.
_STEADY: Final = 1e-4
# A position error is treated as exact if the other parts deform by at most this fraction of the part's motion [-].
# In computed cars with correct position errors, the deformation was at most 0.24 of the part's motion.
# In a public car model with position errors 3 to 4 times too small, this ratio was 1.1 to 1.4.
_NOTABLE_DOUBT: Final = 1 / 3
# A position error up to this fraction of the largest acceptable one is negligible even if it is underestimated [-].
_HARDLY: Final = 0.01
# Largest acceptable position error, relative to the path of the body [-]; it is 1/3 of the margin before a contact.
MOST_OF_PATH: Final = 0.01


class Drift:
    """Displacement of a body during the flight, caused by parts that move relative to the body between tr and td.

    Attributes
    ----------
    time : array of shape (n,)
        Times of the states in the flight [time].
    place : array of shape (n, 3)
        Displacement of the body relative to a rigid body, in the frame that rotates with the body, up to a constant
        [length].
    path : array of shape (n,)
        Distance that the centre of mass has travelled [length].
    part : Part
        The part that moves relative to the others; if there are several, the one with the largest effect.
    doubt : float
        Possible error of displacement differences, because the other parts are not exactly one rigid body [length].
    turning : Turning or None
        Rotation of the body; None unless a deck contains the positions of its parts.
    moving : tuple of int
        Indices of all parts that move relative to the others.
    slow : bool
        True if they oscillate for less than a period, so that most of their motion looks like rotation of the body.
    """

    def __init__(
        self, time: Samples, place: Samples, path: Samples, part: Part, doubt: float, turning: Turning | None = None,
        *, moving: Sequence[int] = (), slow: bool = False,
    ) -> None:  # fmt: skip
        self.time = time
        self.place = place
        self.path = path
        self.part = part
        self.doubt = doubt
        self.turning = turning
        self.moving = tuple(moving)
        self.slow = slow

    @cached_property
    def at_least(self) -> bool:
        """Return True if errors and angles are lower bounds, because internal motion looks like motion of the body.

        This is the case if the part oscillates slowly, or if the deformation of the other parts turns their frame by
        more than the body rotates. Without a deck, it is the case if the deformation of the other parts is a notable
        fraction of the part's motion.
        """
        squares = np.square(self.place - self.place.mean(axis=0)).sum(axis=1)
        moved = float(np.sqrt(np.mean(squares)))
        if moved <= _HARDLY * self.limit:
            return False
        if self.slow or self.turning is None:
            return self.slow or self.doubt > _NOTABLE_DOUBT * moved
        angles = np.radians(self.angles(self.time, float(self.time[-1])))
        return self.turning.doubt > float(np.sqrt(np.mean(angles**2)))

    def errors(self, tr: Samples, td: float) -> Samples:
        """Return the position errors of the body at td for tr (k,) [length]; NaN outside the flight.

        If the deck shows how the body rotates, the error is the largest distance at the watched nodes, otherwise that
        at the centre of mass.
        """
        if self.turning:
            return self._inside(tr, td, self.turning.offsets(tr, td))
        times = [*tr.tolist(), td]
        columns = [np.interp(times, self.time, axis) for axis in self.place.T]
        places = np.stack(columns, axis=1)
        place_at_td = places[-1]
        return self._inside(tr, td, places[:-1] - place_at_td)

    def errors_at_contact(self, tr: Samples, direction: Samples | None) -> Samples:
        """Return the position errors at the contact that ends the flight for tr (k,) [length]; NaN outside the flight.

        If a unit vector (3,) towards the contact is given, the errors of the node that touches first are used if they
        are larger.
        """
        end = float(self.time[-1])
        errors = self.errors(tr, end)
        if direction is None or self.turning is None:
            return errors
        return np.maximum(errors, self.turning.errors_at_front(tr, direction))

    def angles(self, tr: Samples, td: float) -> Samples:
        """Return the rotation errors of the body at td for tr (k,) [degrees]; NaN if unknown."""
        if self.turning is None:
            turned = np.full((tr.size, 3), np.nan)
        else:
            turned = self.turning.angles(tr, td)
        return np.degrees(self._inside(tr, td, turned))

    def _inside(self, tr: Samples, td: float, vectors: Samples) -> Samples:
        """Return the length of each vector (k, 3), or NaN for times outside the flight."""
        start, end = self.time[[0, -1]]
        is_tr_inside = (tr >= start) & (tr <= end)
        is_td_inside = start <= td <= end
        lengths = np.linalg.norm(vectors, axis=1)
        return np.where(is_tr_inside & is_td_inside, lengths, np.nan)

    @cached_property
    def limit(self) -> float:
        """Return the largest acceptable position error [length]."""
        return MOST_OF_PATH * float(self.path[-1])


def find_drift(
    seen: Flying,
    placement: Placement | None = None,
    displacements: Displacements | None = None,
) -> Drift | None:
    """Find by how much a flying body is displaced from the rigid body that replaces it.

    The moving parts are chosen so that the other parts most nearly form one rigid body that rotates at a constant rate;
    together they have at most half of the mass.

    Parameters
    ----------
    seen : Flying
    placement : Placement, optional
        Positions of the parts according to the deck, which show how the body rotates.
    displacements : function, optional
        Reads the displacements of nodes, which show the rotation if the parts do not.

    Returns
    -------
    Drift or None
        None if the displacement is unknown: a mass is unknown; there are fewer than three parts, or two of three have
        almost no mass; or the other parts are far from one rigid body and no deck shows how they rotate.
    """
    momenta = seen.momenta
    masses = seen.masses
    inside = find_window(momenta.time, seen.start, seen.end)
    time = momenta.time[inside]
    mass = masses[list(seen.members)]
    if momenta.parts is None or time.size < FEWEST or not np.isfinite(mass).all():
        return None
    members = [i for i, m in zip(seen.members, mass.tolist(), strict=True) if m > 0]
    mass = masses[members]
    if not has_clear_rotation(mass):
        return None
    velocity = momenta.values[inside][:, members] / mass[:, np.newaxis]
    ways, path = integrate_displacements(time, velocity, mass)
    stride = ceil(time.size / _STATES)
    some_times = time[::stride]
    moving, rate, misfit = find_moving_parts(some_times, ways[::stride], mass)
    if not moving:
        return None
    # Parts with unknown positions are left out, because they would make the error too small.
    flying_mass = float(np.nansum(masses[sorted({*seen.others, *members})]))
    moving_mass = mass[moving].sum()
    share = float(moving_mass) / flying_mass
    # The misfit is the sum of m r^2 over the other parts and the states.
    mean_square = misfit / ((mass.sum() - moving_mass) * some_times.size)
    doubt = share * float(np.sqrt(mean_square))
    offsets_alone = _compute_offsets(time, ways, mass, moving, rate)
    offsets = offsets_alone * float(mass.sum()) / flying_mass
    moving_columns = [members[i] for i in moving]
    ids = [momenta.parts[i].id for i in moving_columns]
    effects = np.square(offsets).sum(axis=(0, 2))
    part = momenta.parts[moving_columns[int(np.argmax(effects))]]
    if placement:
        body = seen._replace(members=members)
        turning = follow_turning(body, moving_columns, placement, displacements)
    else:
        turning = None
    offset = offsets.sum(axis=1)
    slow = bool(rate.any()) and count_periods(some_times, offset[::stride], rate) < 1
    drift = Drift(time, offset, path, part, doubt, turning, moving=ids, slow=slow)
    return drift if turning or doubt <= drift.limit else None


def integrate_displacements(
    time: Samples, velocity: Samples, mass: Samples
) -> tuple[Samples, Samples]:
    """Return the displacements of parts (n, parts, 3) from their centre of mass, and its path (n,) [length]."""
    centre_velocity = np.average(velocity, axis=1, weights=mass)
    relative = velocity - centre_velocity[:, np.newaxis]
    columns = relative.reshape(time.size, -1)
    ways = integrate_by_trapezia(time, columns).reshape(velocity.shape)
    speed = np.linalg.norm(centre_velocity, axis=1)
    return ways, integrate_by_trapezia(time, speed)


def _compute_offsets(
    time: Samples, ways: Samples, mass: Samples, moving: Sequence[int], rate: Samples
) -> Samples:
    """Return how far each moving part displaces all others if nothing else flies, shape (n, moving, 3) [length]."""
    frame_parts = np.setdiff1d(np.arange(mass.size), moving)
    shares = mass[list(moving), np.newaxis] / mass.sum()
    centre_of_frame = np.average(
        ways[:, frame_parts], axis=1, weights=mass[frame_parts]
    )
    relative = ways[:, list(moving)] - centre_of_frame[:, np.newaxis]
    return np.asarray(-shares * subtract_circles(time, relative, rate))


def find_drift_in_flight(
    history: History,
    flight: Flight,
    parts: Sequence[Part] | None = None,
    placement: Placement | None = None,
) -> Drift | None:
    """Find the displacement, in a flight, of the body that consists of ``parts`` or of the parts to be switched.

    The result is also None if the part momenta do not show the flight. ``placement`` contains the part positions in the
    deck.
    """
    flying = _collect_flying(history, flight, parts)
    if flying is None:
        return None
    return find_drift(flying, placement, history.evidence.displacements)


def find_parts_apart(
    history: History, flight: Flight, parts: Sequence[Part] | None = None
) -> tuple[Part, ...]:
    """Return those of ``parts`` (by default, of the parts to be switched) that separate from the others in the flight.

    The velocity of such a part relative to the others is constant, whereas that of a connected part oscillates and
    rotates.
    """
    flying = _collect_flying(history, flight, parts)
    if flying is None or flying.momenta.parts is None:
        return ()
    members = [i for i in flying.members if flying.masses[i] > 0]
    inside = find_window(flying.momenta.time, flying.start, flying.end)
    mass = flying.masses[members]
    time = flying.momenta.time[inside]
    momentum = flying.momenta.values[inside][:, members]
    if time.size < FEWEST or len(members) < 2:
        return ()
    whole = momentum.sum(axis=1, keepdims=True)
    velocity = momentum / mass[:, np.newaxis]
    velocity_of_others = (whole - momentum) / (mass.sum() - mass)[:, np.newaxis]
    relative = velocity - velocity_of_others
    speed = np.linalg.norm(relative.mean(axis=0), axis=1)
    change = np.linalg.norm(np.ptp(relative, axis=0), axis=1)
    is_steady = change <= _STEADY * speed
    speed_of_body = np.linalg.norm(whole[:, 0] / mass.sum(), axis=1)
    path = float(integrate_by_trapezia(time, speed_of_body[:, np.newaxis])[-1, 0])
    moves_far = speed * (time[-1] - time[0]) > MOST_OF_PATH * path
    is_minor = 2 * mass <= mass.sum()
    separate = np.flatnonzero(is_steady & moves_far & is_minor).tolist()
    return tuple(flying.momenta.parts[members[row]] for row in separate)


def _collect_flying(
    history: History, flight: Flight, parts: Sequence[Part] | None
) -> Flying | None:
    """Collect the flying parts and their momenta for `find_drift`; None if the part momenta do not show the flight."""
    momenta = history.find_momenta(of_parts=True)
    masses = history.masses
    if flight.parts is None or flight.refusal:
        return None
    if momenta is None or momenta.parts is None or masses is None:
        return None
    flying_ids = {part.id for part in flight.parts}
    if parts is None:
        member_ids = {momenta.parts[i].id for i in momenta.chosen}
    else:
        member_ids = {part.id for part in parts}
    # Fixed parts, such as the ground, are left out.
    flying = [i for i in momenta.moving if momenta.parts[i].id in flying_ids]
    members = [i for i in flying if momenta.parts[i].id in member_ids]
    start, end = flight.within(momenta.time)
    return Flying(momenta, masses, members, start, end, flying)


class RigidBody(NamedTuple):
    """Ids of the parts that become one rigid body; ``whole`` is False for a single part in disconnected pieces.

    No file shows how such pieces move relative to each other.
    """

    parts: tuple[int, ...]
    whole: bool = True

    @property
    def name(self) -> str:
        """Return the ids of the parts in the form accepted by `parts`."""
        return ",".join(map(str, self.parts))


class Off(NamedTuple):
    """Largest position error of a body [length], and its cause; ``body`` is empty if there is only one body.

    ``assumed`` is True if the parts are only assumed to become one body, because there is no deck. ``at_least`` is True
    if the error is a lower bound.
    """

    error: float
    drift: Drift
    body: RigidBody | None
    assumed: bool
    at_least: bool = False

    @property
    def part(self) -> str | None:
        """Return the name of the part that is frozen in a different position; None if there is no such part."""
        return self.drift.part.name if self.error > 0 else None


class Bodies:
    """Rigid bodies in a flight with their displacements; a single body is assumed unless a deck defines them.

    If one displacement is unknown, the error is unknown too, because this displacement may be the largest. ``apart``
    contains the parts that are to become one body with others but separate from them. If there are any, ``staying``
    contains the other moving parts.
    """

    def __init__(
        self,
        drifts: Sequence[Drift | None],
        told: Sequence[RigidBody] | None,
        apart: Sequence[Part] = (),
        staying: Sequence[Part] = (),
    ) -> None:
        self.told = tuple(told or ())
        self.apart = tuple(apart)
        self.staying = tuple(staying)
        self._known = tuple(drift for drift in drifts if drift)
        self._complete = len(self._known) == len(drifts) > 0
        self.unknown = tuple(
            body
            for body, drift in zip(self.told, drifts, strict=False)
            if drift is None
        )

    def errors(self, tr: Samples, td: float) -> Samples:
        """Return the position error of the most displaced body at td for tr (k,) [length]; NaN outside the flight."""
        if self._complete:
            return np.asarray(self._each(tr, td).max(axis=0))
        return np.full(tr.shape, np.nan)

    def find_largest_error(
        self, tr: Samples, direction: Samples | None
    ) -> float | None:
        """Return the largest position error at the contact that ends the flight, over tr (k,) and bodies [length].

        ``direction`` is a unit vector (3,) towards the contact. The result is None if an error is unknown, or if all tr
        lie outside the flight.
        """
        if not self._complete:
            return None
        errors_of_bodies = [
            drift.errors_at_contact(tr, direction) for drift in self._known
        ]
        errors = np.stack(errors_of_bodies)
        inside = errors[np.isfinite(errors)]
        return float(inside.max()) if inside.size else None

    @property
    def limit(self) -> float:
        """Return the largest acceptable position error [length]: the smallest limit of any body with moving parts."""
        return min(
            (drift.limit for drift in self._known if drift.place.any()), default=np.inf
        )

    def compute_speed_at_front(self, direction: Samples) -> float | None:
        """Return the speed along a unit vector (3,) that rotation adds at the point of a body farthest along it.

        For several bodies, the result is the smallest speed [length/time]. It is None if the rotation of any body is
        unknown.
        """
        turnings = [drift.turning for drift in self._known if drift.turning]
        if not self._complete or len(turnings) < len(self._known):
            return None
        return min(turning.compute_speed_at_front(direction) for turning in turnings)

    def worst(self, tr: float, td: float) -> Off | None:
        """Return the most displaced body; None outside the flight or if an error is unknown."""
        if self._complete:
            errors = self._each(np.array([tr]), td)[:, 0]
        else:
            errors = np.full(1, np.nan)
        if np.isnan(errors).any():
            return None
        at = int(np.argmax(errors))
        body = self.told[at] if len(self.told) > 1 else None
        return Off(
            float(errors[at]),
            self._known[at],
            body,
            not self.told,
            any(drift.at_least for drift in self._known),
        )

    def _each(self, tr: Samples, td: float) -> Samples:
        """Return the position errors of all bodies, shape (bodies, k) [length]."""
        return np.stack([drift.errors(tr, td) for drift in self._known])


def find_bodies_in_flight(
    history: History,
    flight: Flight,
    told: Sequence[RigidBody] | None,
    placement: Placement | None = None,
) -> Bodies:
    """Find the displacements in a flight of the bodies that the switched parts become.

    Parameters
    ----------
    history : History
    flight : Flight
        Flight with the parts that fly in it.
    told : sequence of RigidBody or None
        Bodies that the deck defines; if there is no deck, the parts are assumed to become one body.
    placement : Placement, optional
        Positions of the parts according to the deck.
    """
    if not told:
        away = find_parts_apart(history, flight)
        staying = _list_other_moving_parts(history, flight, away)
        drift = None
        if not away:
            drift = find_drift_in_flight(history, flight, placement=placement)
        return Bodies([drift], None, away, staying)
    drifts: list[Drift | None] = []
    away = ()
    for body in told:
        parts = [part for part in history.parts or () if part.id in body.parts]
        leaving = find_parts_apart(history, flight, parts)
        drift = None
        if not leaving:
            drift = _find_drift_of_body(history, flight, body, parts, placement)
        drifts.append(drift)
        away += leaving
    staying = _list_other_moving_parts(history, flight, away)
    return Bodies(drifts, told, away, staying)


def _list_other_moving_parts(
    history: History, flight: Flight, away: Sequence[Part]
) -> tuple[Part, ...]:
    """Return the moving parts to be switched other than those that fly ``away``; empty if none flies away."""
    if not away:
        return ()
    flying = _collect_flying(history, flight, None)
    if flying is None or flying.momenta.parts is None:
        return ()
    members = [i for i in flying.members if flying.masses[i] > 0]
    parts = [flying.momenta.parts[i] for i in members]
    return tuple(part for part in parts if part not in away)


def _find_drift_of_body(
    history: History,
    flight: Flight,
    body: RigidBody,
    parts: Sequence[Part],
    placement: Placement | None,
) -> Drift | None:
    """Return the displacement of a body, zero for a single part in flight; None if the energy of a part is unknown."""
    if not body.whole or len(parts) < len(body.parts):
        return None
    if len(parts) > 1:
        return find_drift_in_flight(history, flight, parts, placement)
    (part,) = parts
    flying_ids = {flying_part.id for flying_part in flight.parts or ()}
    if flight.refusal or part.id not in flying_ids:
        return None
    ends = np.array(flight.within(history.time))
    return Drift(ends, np.zeros((2, 3)), np.zeros(2), part, 0.0)
