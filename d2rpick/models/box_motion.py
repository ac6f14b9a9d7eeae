"""The motion of the box, explicit by central differences: contact with sled and ground, its bars or one rigid body.

Penetration is resisted in proportion, friction by Coulomb's law, smoothed at small speeds.  The cushion of the curb is
crushed like honeycomb: at a constant force, for good, until its depth is used up.  In a drop there is only the ground.
While it is switched the box moves as one body, by three equations in the plane instead of its bars.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.models.box_model import (
    GRAVITY,
    Bars,
    Ends,
    Parameters,
    Plane,
    Structure,
    Values,
    build,
    stiffest_rate,
)

# Of floor and curb at one point [N/m]: softer than the box, so that contact does not set the time step; the weight of
# the box sinks in by half a millimetre.
STIFFNESS = 5e5
# Below this sliding speed friction grows in proportion to it [m/s]: a hundredth of the speeds here.
SLIP = 0.1
# A point deeper below the floor than this [m] is beside the sled, not in it.
DEEPEST = 0.1
# Thickness of the curb [m]; the sled ends behind it.
CURB_THICKNESS = 0.05
# No point comes nearer to floor, curb or ground faster than this many times the first speed, as much again as a fall of
# a metre gives [m/s], and twice what the drop gives: what tells how long none can touch.
FASTEST, FALL = 4.0, 5.0
# Pushes that follow each other within this time are one contact [s]: corners rattle, a flight is longer.
SAME_CONTACT = 2e-3


class Face(NamedTuple):
    """Forces of a face on points (n,) [N]: across it, and the friction along it."""

    normal: Plane
    friction: Plane

    @property
    def whole(self) -> Plane:
        """Both together."""
        return self.normal + self.friction


class Push(NamedTuple):
    """What the sled and what the ground does to all points."""

    sled: Face
    ground: Face

    @property
    def forces(self) -> Plane:
        """All forces on the points (n,) [N]."""
        return self.sled.whole + self.ground.whole


class Sled:
    """Prescribed motion: even braking from ``speed`` [m/s] to rest in the time ``braking`` [s]."""

    def __init__(self, speed: float, braking: float) -> None:
        self._speed, self._braking = speed, braking

    def velocity(self, time: float) -> float:
        """Velocity along x [m/s]."""
        return self._speed * max(0.0, 1 - time / self._braking)

    def place(self, time: float) -> float:
        """Way since time 0 [m]."""
        t = min(time, self._braking)
        return self._speed * (t - t * t / (2 * self._braking))


class Contact:
    """What pushes the points of a structure; remembers how far the cushion is crushed.

    ``released`` is when the sled pushed last before the ground did for the first time; ``landings`` are the times from
    when to when the ground pushed [s].
    """

    def __init__(self, structure: Structure, parameters: Parameters) -> None:
        self.sled = Sled(parameters.speed, parameters.braking)
        self._p = parameters
        self._skin, self._toes = structure.skin, structure.toes
        self._points = structure.places.size
        self._into_sled = complex(np.exp(1j * np.radians(parameters.tilt)))
        self._crushed = np.zeros(self._toes.size)
        self._sleeps_until = 0.0
        self._fastest = (
            FASTEST * parameters.speed
            + FALL
            + 2 * np.sqrt(2 * GRAVITY * (parameters.drop or 0.0))
        )
        self.released: float | None = None
        self.landings: list[tuple[float, float]] = []

    def push(self, time: float, places: Plane, velocities: Plane) -> Push | None:
        """Forces at ``time``; None while nothing can touch."""
        if time < self._sleeps_until:
            return None
        on_sled = (places - self.sled.place(time)) * self._into_sled
        gap = self._gap(places, on_sled)
        if gap > 0:
            self._sleeps_until = time + gap / self._fastest
            return None
        push = Push(
            self._sled(time, on_sled, velocities),
            self._on_all(self._ground(places, velocities), self._skin),
        )
        if push.sled.normal.any() and not self.landings:
            self.released = time
        if push.ground.normal.any():
            last = (
                self.landings.pop()
                if self.landings and time - self.landings[-1][1] < SAME_CONTACT
                else (time, time)
            )
            self.landings.append((last[0], time))
        return push

    def _sled(self, time: float, on_sled: Plane, velocities: Plane) -> Face:
        nothing = np.zeros(self._points, dtype=np.complex128)
        if self._p.drop is not None:
            return Face(nothing, nothing)
        sliding = (velocities - self.sled.velocity(time)) * self._into_sled
        floor = self._on_all(
            self._floor(on_sled[self._skin], sliding[self._skin]), self._skin
        )
        curb = self._on_all(
            self._curb(on_sled[self._toes], sliding[self._toes]), self._toes
        )
        back = self._into_sled.conjugate()
        return Face(
            (floor.normal + curb.normal) * back, (floor.friction + curb.friction) * back
        )

    def _on_all(self, face: Face, points: Ends) -> Face:
        """Forces on some points as forces on all."""
        forces = np.zeros((2, self._points), dtype=np.complex128)
        forces[:, points] = face
        return Face(*forces)

    def _gap(self, places: Plane, on_sled: Plane) -> float:
        """Length that the nearest point must move at least before it can touch [m]."""
        to_ground = float(places[self._skin].imag.min()) + self._p.ground
        if self._p.drop is not None:
            return to_ground
        skin, toes = on_sled[self._skin], on_sled[self._toes]
        to_floor = np.maximum(skin.imag, skin.real - CURB_THICKNESS).min()
        to_curb = np.maximum(-toes.real, toes.imag - self._p.curb).min()
        return float(min(to_floor, to_curb, to_ground))

    def _floor(self, places: Plane, sliding: Plane) -> Face:
        above = (places.real < CURB_THICKNESS) & (places.imag > -DEEPEST)
        depth = np.where(above, np.maximum(-places.imag, 0.0), 0.0)
        return self._with_friction(STIFFNESS * depth, sliding.real)

    def _ground(self, places: Plane, sliding: Plane) -> Face:
        depth = np.maximum(-self._p.ground - places[self._skin].imag, 0.0)
        return self._with_friction(
            self._p.ground_stiffness * depth, sliding[self._skin].real
        )

    def _curb(self, places: Plane, sliding: Plane) -> Face:
        """Push back, along -x, with friction along z: a floor that is turned by a quarter."""
        before = (places.imag < self._p.curb) & (
            places.real < self._p.cushion_depth + DEEPEST
        )
        depth = np.where(before, np.maximum(places.real, 0.0), 0.0)
        trial = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        yields = np.minimum(trial, self._p.cushion)
        self._crushed = np.minimum(
            self._crushed + (trial - yields) / STIFFNESS, self._p.cushion_depth
        )
        held = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        face = self._with_friction(held, sliding.imag)
        return Face(np.asarray(1j * face.normal), np.asarray(1j * face.friction))

    def _with_friction(self, normal: Values, sliding: Values) -> Face:
        """Force of a floor: ``normal`` up, friction against ``sliding`` [m/s] along it."""
        friction = self._p.friction * normal * sliding / np.hypot(sliding, SLIP)
        return Face(np.asarray(1j * normal), np.asarray(-friction, dtype=np.complex128))


class RigidBody:
    """Points that move as one body, with the momenta that they had when they were switched.

    ``arms`` from the centre of mass to the points, as they are turned now (n,) [m]; ``velocity`` of the centre
    [m/s]; ``spin`` in the sense from x to z [rad/s].
    """

    def __init__(self, masses: Values, places: Plane, velocities: Plane) -> None:
        self._mass = float(masses.sum())
        self.centre = complex(masses @ places) / self._mass
        self.arms = places - self.centre
        self._inertia = float(masses @ np.abs(self.arms) ** 2)
        self.velocity = complex(masses @ velocities) / self._mass
        self.spin = float(np.vdot(masses * self.arms, velocities).imag) / self._inertia

    @property
    def places(self) -> Plane:
        """Of the points [m]."""
        return self.centre + self.arms

    @property
    def velocities(self) -> Plane:
        """Of the points [m/s]."""
        return self.velocity + 1j * self.spin * self.arms

    def push(self, forces: Plane, damping: float, dt: float) -> None:
        """Change the motion by forces on the points (n,) [N] and damping [1/s] during a step [s]."""
        half = damping * dt / 2
        moment = float(np.vdot(self.arms, forces).imag)
        self.velocity = (
            (1 - half) * self.velocity + dt * complex(forces.sum()) / self._mass
        ) / (1 + half)
        self.spin = ((1 - half) * self.spin + dt * moment / self._inertia) / (1 + half)

    def move(self, dt: float) -> None:
        """Move on for a step [s]; the arms turn and keep their lengths."""
        self.centre += dt * self.velocity
        self.arms *= complex(np.exp(1j * dt * self.spin))


# Share of the limit 2/omega that a step takes; the limit of linear bars, which turn, yield and touch here.
_SAFETY = 0.9
# What is not a multiple of the step by less than this share of it, is one: times are written in decimals.
_SAME = 1e-6


@dataclass
class Accounts:
    """What has been exchanged with the surroundings since time 0.

    ``external_work`` of gravity and the sled, ``friction`` work of all contacts, energy of the ``walls`` (stored in
    floor, curb and ground, and what crushing the cushion took), ``damping`` energy, ``lost`` kinetic energy of the
    vibration at tr [J]; ``impulse`` [kg m/s] and ``angular_impulse`` about the origin,
    in the sense from x to z [kg m2/s], of gravity, contact and damping.
    """

    external_work: float = 0.0
    friction: float = 0.0
    walls: float = 0.0
    damping: float = 0.0
    lost: float = 0.0
    impulse: complex = 0.0
    angular_impulse: float = 0.0


class Motion:
    """The state of a run: ``places`` (n,) at step ``count``, ``velocities`` (n,) half a step before it.

    Steps take ``dt`` [s], a whole fraction (``every``) of the ``interval`` in which states are given out; RangeError
    where that holds no number of them.  ``body`` is the box while it is rigid.
    """

    def __init__(self, parameters: Parameters, interval: float) -> None:
        s = self.structure = build(parameters)
        touching = np.zeros(s.places.size)
        touching[s.skin] = max(STIFFNESS, parameters.ground_stiffness)
        rate = stiffest_rate(s.masses, s.box, s.step, extra=touching)
        limit = 2 / rate
        if not (limit > 0 and np.isfinite(interval / limit)):
            found = f"an output interval of {interval:g} s holds no number of steps at a rate of {rate:g} 1/s"
            raise RangeError(f"{found}; choose a shorter one, or softer bars")
        self.every = int(np.ceil(interval / (_SAFETY * limit)))
        self.dt = interval / self.every
        self.damping = parameters.damping
        self._weight: Plane = np.asarray(
            s.masses * (-1j * GRAVITY), dtype=np.complex128
        )
        self._mobility = self.dt / s.masses
        self.places = s.places.copy()
        self.velocities: Plane = np.full(s.places.size, complex(parameters.speed))
        self.box, self.step = Bars(s.box, s.places.size), Bars(s.step, s.places.size)
        self.contact = Contact(s, parameters)
        self.body: RigidBody | None = None
        self.accounts = Accounts()
        self.count = 0

    @property
    def time(self) -> float:
        """Of the places [s]."""
        return self.count * self.dt

    def step_at(self, time: float) -> int:
        """Number of the first step at or after ``time`` [s]."""
        return int(np.ceil(time / self.dt - _SAME))

    def copy(self) -> Motion:
        """Give a run that goes on from here by itself."""
        return copy.deepcopy(self)

    def make_rigid(self) -> None:
        """Switch the box to a rigid body: its momenta stay, its vibration stops, its deformation is frozen."""
        self.box.forces(
            self.places
        )  # for the last time: where it yields now, it does so before it is frozen
        of_box = slice(self.structure.of_box)
        masses, before = self.structure.masses[of_box], self.velocities[of_box]
        self.body = RigidBody(masses, self.places[of_box], before)
        after = self.body.velocities
        self.accounts.lost += (
            float(masses @ (np.abs(before) ** 2 - np.abs(after) ** 2)) / 2
        )
        self.velocities = np.concatenate(
            [after, self.velocities[self.structure.of_box :]]
        )

    def make_deformable(self) -> None:
        """Switch back: the points go on with the motion of the body, the bars with the elongations they had."""
        self.body = None

    def advance(self) -> Plane:
        """Bring the velocities to half a step after the places; give their mean over the step, shape (n,) [m/s]."""
        s, before = self.structure, self.velocities
        push = self.contact.push(self.time, self.places, before)
        outer = self._weight + push.forces if push else self._weight
        forces = outer + self.step.forces(self.places)
        if not self.body:
            forces += self.box.forces(self.places)
        half = self.damping * self.dt / 2
        after = ((1 - half) * before + self._mobility * forces) / (1 + half)
        if self.body:
            self.body.push(forces[: s.of_box], self.damping, self.dt)
            after[: s.of_box] = self.body.velocities
        mean: Plane = np.multiply(0.5, before + after)
        self._account(mean, outer, push)
        self.velocities = after
        return mean

    def move(self) -> None:
        """Move the points on by a step."""
        self.places = self.places + self.dt * self.velocities
        if self.body:
            of_box = slice(self.structure.of_box)
            self.body.move(self.dt)
            self.places[of_box] = self.body.places
            self.velocities[of_box] = self.body.velocities
        self.count += 1

    def _account(self, mean: Plane, outer: Plane, push: Push | None) -> None:
        """Enter what acts from outside during a step, with the mean velocities over it."""
        accounts, dt = self.accounts, self.dt
        momenta = self.structure.masses * mean
        drag = self.damping * momenta
        accounts.external_work -= dt * GRAVITY * float(momenta.sum().imag)
        accounts.damping += dt * float(np.vdot(drag, mean).real)
        accounts.impulse += dt * complex((outer - drag).sum())
        accounts.angular_impulse += dt * float(np.vdot(self.places, outer - drag).imag)
        if push:
            speed = self.contact.sled.velocity(self.time)
            by_sled = float(push.sled.whole.real.sum()) * speed
            against = float(
                (
                    np.vdot(push.sled.friction, mean - speed)
                    + np.vdot(push.ground.friction, mean)
                ).real
            )
            accounts.external_work += dt * by_sled
            accounts.friction -= dt * against
            accounts.walls += dt * (
                by_sled - float(np.vdot(push.forces, mean).real) + against
            )
