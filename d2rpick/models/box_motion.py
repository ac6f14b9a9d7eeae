"""Integrate the motion of the box by central differences, with contact, as a truss or as one rigid body.

The contact force is proportional to the penetration; friction follows Coulomb's law, smoothed at low speeds. The
cushion of the curb crushes like honeycomb: irreversibly and at a constant force until its depth is used up. In a drop
test, there is only the ground. While it is switched, the box, alone or with its step, moves as one rigid body, which
has three equations of motion in the plane.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import RangeError
from d2rpick.models.box_model import (
    GRAVITY,
    Bars,
    Ends,
    Parameters,
    Plane,
    Structure,
    Values,
    build_structure,
    compute_stiffest_rate,
)

# Contact stiffness of the floor and the curb per point [N/m]; it is lower than the stiffness of the box.
# This stiffness does not limit the time step; the weight of the box causes a penetration of 0.5 mm.
STIFFNESS = 5e5
# Sliding speed below which friction is proportional to the speed [m/s].
# Typical sliding speeds are 100 times this speed.
SLIP = 0.1
# A point at most this far below the floor [m] touches the floor; deeper points have left the sled.
DEEPEST = 0.1
# Thickness of the curb at the end of the sled [m].
CURB_THICKNESS = 0.05
# No point moves faster than FASTEST times the initial speed, plus FALL and twice the drop speed [m/s].
# The largest possible speed gives the time within which no point can reach the floor, the curb or the ground.
# FALL is the speed of a point after a fall of 1 m [m/s].
FASTEST, FALL = 4.0, 5.0
# Longest gap between two contact forces that belong to the same contact [s]; gaps occur because corners rattle.
SAME_CONTACT = 2e-3

# Safety factor on the stable time step 2/omega [-], which is exact only for linear bars without contact.
_SAFETY = 0.9
# Times that exceed a whole number of time steps by at most this fraction of a step are rounded down [-].
_SAME = 1e-6


class Face(NamedTuple):
    """Forces that a face exerts on points, shape (n,) [N]: the force normal to the face, and the friction along it."""

    normal: Plane
    friction: Plane

    @property
    def whole(self) -> Plane:
        """The sum of the normal force and the friction force."""
        return self.normal + self.friction


class Push(NamedTuple):
    """The forces of the sled and the ground on all points."""

    sled: Face
    ground: Face

    @property
    def forces(self) -> Plane:
        """All forces on the points, shape (n,) [N]."""
        return self.sled.whole + self.ground.whole


class Sled:
    """Prescribed motion of the sled: constant deceleration from ``speed`` [m/s] to rest within ``braking`` [s]."""

    def __init__(self, speed: float, braking: float) -> None:
        self._speed = speed
        self._braking = braking

    def velocity(self, time: float) -> float:
        """Return the velocity along x [m/s]."""
        return self._speed * max(0.0, 1 - time / self._braking)

    def place(self, time: float) -> float:
        """Return the displacement since time 0 [m]."""
        t = min(time, self._braking)
        return self._speed * (t - t * t / (2 * self._braking))


class Contact:
    """The contact forces on the points of a structure; the depth to which the cushion is crushed is kept as state.

    ``released`` is the last time at which the sled exerted a force before the first ground contact [s]; ``landings``
    are the intervals (start, end) with ground contact [s].
    """

    def __init__(self, structure: Structure, parameters: Parameters) -> None:
        self.sled = Sled(parameters.speed, parameters.braking)
        self._p = parameters
        self._skin = structure.skin
        self._toes = structure.toes
        self._points = structure.places.size
        self._into_sled = complex(np.exp(1j * np.radians(parameters.tilt)))
        self._crushed = np.zeros(self._toes.size)
        self._sleeps_until = 0.0
        drop_speed = np.sqrt(2 * GRAVITY * (parameters.drop or 0.0))
        self._fastest = FASTEST * parameters.speed + FALL + 2 * drop_speed
        self.released: float | None = None
        self.landings: list[tuple[float, float]] = []

    def push(self, time: float, positions: Plane, velocities: Plane) -> Push | None:
        """Return the forces at ``time``, or None while no contact is possible."""
        if time < self._sleeps_until:
            return None
        on_sled = (positions - self.sled.place(time)) * self._into_sled
        gap = self._gap(positions, on_sled)
        if gap > 0:
            self._sleeps_until = time + gap / self._fastest
            return None
        of_sled = self._sled(time, on_sled, velocities)
        of_ground = self._on_all(self._ground(positions, velocities), self._skin)
        push = Push(of_sled, of_ground)
        if push.sled.normal.any() and not self.landings:
            self.released = time
        if push.ground.normal.any():
            start = time
            if self.landings and time - self.landings[-1][1] < SAME_CONTACT:
                start, _ = self.landings.pop()
            self.landings.append((start, time))
        return push

    def _sled(self, time: float, on_sled: Plane, velocities: Plane) -> Face:
        """Return the forces of the floor and the curb of the sled on all points [N]."""
        nothing = np.zeros(self._points, dtype=np.complex128)
        if self._p.drop is not None:
            return Face(nothing, nothing)
        sliding = (velocities - self.sled.velocity(time)) * self._into_sled
        on_skin = self._floor(on_sled[self._skin], sliding[self._skin])
        on_toes = self._curb(on_sled[self._toes], sliding[self._toes])
        floor = self._on_all(on_skin, self._skin)
        curb = self._on_all(on_toes, self._toes)
        # Multiplication by this number rotates vectors from the axes of the sled to those of the ground.
        out_of_sled = self._into_sled.conjugate()
        normal = (floor.normal + curb.normal) * out_of_sled
        friction = (floor.friction + curb.friction) * out_of_sled
        return Face(normal, friction)

    def _on_all(self, face: Face, points: Ends) -> Face:
        """Return the forces on selected points as an array for all points, with zero forces on the other points."""
        forces = np.zeros((2, self._points), dtype=np.complex128)
        forces[:, points] = face
        return Face(*forces)

    def _gap(self, positions: Plane, on_sled: Plane) -> float:
        """Return the distance from the floor, the curb and the ground to the nearest point [m]."""
        to_ground = float(positions[self._skin].imag.min()) + self._p.ground
        if self._p.drop is not None:
            return to_ground
        skin = on_sled[self._skin]
        toes = on_sled[self._toes]
        to_floor = np.maximum(skin.imag, skin.real - CURB_THICKNESS).min()
        to_curb = np.maximum(-toes.real, toes.imag - self._p.curb).min()
        return float(min(to_floor, to_curb, to_ground))

    def _floor(self, positions: Plane, sliding: Plane) -> Face:
        """Return the forces of the floor on the points on the surface of the structure [N]."""
        x = positions.real
        z = positions.imag
        may_touch = (x < CURB_THICKNESS) & (z > -DEEPEST)
        depth = np.where(may_touch, np.maximum(-z, 0.0), 0.0)
        return self._with_friction(STIFFNESS * depth, sliding.real)

    def _ground(self, positions: Plane, sliding: Plane) -> Face:
        """Return the forces of the ground on the points on the surface of the structure [N]."""
        depth = np.maximum(-self._p.ground - positions[self._skin].imag, 0.0)
        return self._with_friction(
            self._p.ground_stiffness * depth, sliding[self._skin].real
        )

    def _curb(self, positions: Plane, sliding: Plane) -> Face:
        """Return the forces of the curb along -x [N], with friction along z; the curb acts like an upright floor."""
        x = positions.real
        z = positions.imag
        is_low = z < self._p.curb
        is_near = x < self._p.cushion_depth + DEEPEST
        depth = np.where(is_low & is_near, np.maximum(x, 0.0), 0.0)
        # The cushion crushes by as much as lowers its force to the yield force.
        elastic_force = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        limited_force = np.minimum(elastic_force, self._p.cushion)
        crushed = self._crushed + (elastic_force - limited_force) / STIFFNESS
        self._crushed = np.minimum(crushed, self._p.cushion_depth)
        normal = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        face = self._with_friction(normal, sliding.imag)
        return Face(np.asarray(1j * face.normal), np.asarray(1j * face.friction))

    def _with_friction(self, normal: Values, sliding: Values) -> Face:
        """Return the forces of a floor [N]: ``normal`` upwards, and friction against the velocity ``sliding`` [m/s]."""
        # A smooth sign function of the velocity: v / sqrt(v^2 + SLIP^2).
        speed = np.hypot(sliding, SLIP)
        friction = self._p.friction * normal * sliding / speed
        return Face(np.asarray(1j * normal), np.asarray(-friction, dtype=np.complex128))


class RigidPoints:
    """Points that move as one rigid body. At the switch, the body has the linear and angular momentum of the points.

    ``arms`` (n,) leads from the centre of mass to the points and rotates with the body [m]. ``velocity`` is that of the
    centre of mass [m/s], and ``spin`` the angular velocity from x to z [rad/s].
    """

    def __init__(self, masses: Values, positions: Plane, velocities: Plane) -> None:
        self._mass = float(masses.sum())
        self.centre = complex(masses @ positions) / self._mass
        self.arms = positions - self.centre
        self._inertia = float(masses @ np.abs(self.arms) ** 2)
        self.velocity = complex(masses @ velocities) / self._mass
        angular_momentum = float(np.vdot(masses * self.arms, velocities).imag)
        self.spin = angular_momentum / self._inertia

    @property
    def places(self) -> Plane:
        """Positions of the points [m]."""
        return self.centre + self.arms

    @property
    def velocities(self) -> Plane:
        """Velocities of the points [m/s], from the velocity and spin of the body."""
        return self.velocity + 1j * self.spin * self.arms

    def push(self, forces: Plane, damping: float, dt: float) -> None:
        """Advance velocity and spin by one time step [s] under the forces (n,) [N] on the points and damping [1/s]."""
        # Damping acts on the mean of the velocities before and after the time step.
        half = damping * dt / 2
        force = complex(forces.sum())
        moment = float(np.vdot(self.arms, forces).imag)
        velocity_gain = dt * force / self._mass
        spin_gain = dt * moment / self._inertia
        self.velocity = ((1 - half) * self.velocity + velocity_gain) / (1 + half)
        self.spin = ((1 - half) * self.spin + spin_gain) / (1 + half)

    def move(self, dt: float) -> None:
        """Move the body by one time step [s]; the arms to the points rotate but keep their lengths."""
        self.centre += dt * self.velocity
        self.arms *= complex(np.exp(1j * dt * self.spin))


@dataclass
class Accounts:
    """Energy and momentum exchanged with the surroundings since time zero.

    All energies are in J: ``external_work`` of gravity and the sled, ``friction`` work of all contacts, energy of the
    ``walls`` (stored in floor, curb and ground, and dissipated by the cushion), ``damping`` energy, and ``lost``
    kinetic energy of the vibration at tr. ``impulse`` [kg m/s] and ``angular_impulse`` about the origin, from x to z
    [kg m2/s], are those of gravity, contact and damping.
    """

    external_work: float = 0.0
    friction: float = 0.0
    walls: float = 0.0
    damping: float = 0.0
    lost: float = 0.0
    impulse: complex = 0.0
    angular_impulse: float = 0.0


class BoxMotion:
    """The state of a run: ``places`` (n,) at time step ``count``, ``velocities`` (n,) half a time step earlier.

    The time step ``dt`` [s] is 1/``every`` of the output ``interval``; RangeError is raised if there is no such time
    step. ``body`` is the rigid body, or None while there is none; it contains the points of the box, and those of the
    step if the step is rigid, too.
    """

    def __init__(self, parameters: Parameters, interval: float) -> None:
        s = self.structure = build_structure(parameters)
        touching = np.zeros(s.places.size)
        touching[s.skin] = max(STIFFNESS, parameters.ground_stiffness)
        rate = compute_stiffest_rate(s.masses, s.box, s.step, extra=touching)
        limit = 2 / rate
        if not (limit > 0 and np.isfinite(interval / limit)):
            problem = f"an output interval of {interval:g} s holds no number of steps at a rate of {rate:g} 1/s"
            raise RangeError(f"{problem}; choose a shorter one, or softer bars")
        self.every = int(np.ceil(interval / (_SAFETY * limit)))
        self.dt = interval / self.every
        self.damping = parameters.damping
        self._weight: Plane = np.asarray(
            s.masses * (-1j * GRAVITY), dtype=np.complex128
        )
        self._mobility = self.dt / s.masses
        self.places = s.places.copy()
        self.velocities: Plane = np.full(s.places.size, complex(parameters.speed))
        self.box = Bars(s.box, s.places.size)
        self.step = Bars(s.step, s.places.size)
        self.contact = Contact(s, parameters)
        self.body: RigidPoints | None = None
        self._rigid_points = slice(0)
        self._deformable_bars: tuple[Bars, ...] = (self.step, self.box)
        self.accounts = Accounts()
        self.count = 0

    @property
    def time(self) -> float:
        """Time at which the positions apply [s]."""
        return self.count * self.dt

    def step_at(self, time: float) -> int:
        """Return the number of the first time step at or after ``time`` [s]."""
        return int(np.ceil(time / self.dt - _SAME))

    def copy(self) -> BoxMotion:
        """Return an independent copy that can be continued."""
        return copy.deepcopy(self)

    def make_rigid(self, *, with_step: bool = False) -> None:
        """Make the box rigid, alone or together with the step.

        The rigid points keep their total momenta, their vibration stops, and their deformation is frozen.
        """
        frozen_bars = (self.box, self.step) if with_step else (self.box,)
        self._deformable_bars = () if with_step else (self.step,)
        # The forces are evaluated again, so that bars yield before they are frozen.
        for bars in frozen_bars:
            bars.forces(self.places)
        s = self.structure
        points = slice(s.places.size if with_step else s.of_box)
        self._rigid_points = points
        masses = s.masses[points]
        deformable = self.velocities[points]
        self.body = RigidPoints(masses, self.places[points], deformable)
        rigid = self.body.velocities
        lost_squares = np.abs(deformable) ** 2 - np.abs(rigid) ** 2
        self.accounts.lost += float(masses @ lost_squares) / 2
        self.velocities = np.concatenate([rigid, self.velocities[points.stop :]])

    def make_deformable(self) -> None:
        """Make all parts deformable again: points keep the velocities of the body, and bars keep their lengths."""
        self.body = None
        self._deformable_bars = (self.step, self.box)

    def advance(self) -> Plane:
        """Advance the velocities to half a step after the positions; return their mean over the step (n,) [m/s]."""
        old_velocities = self.velocities
        push = self.contact.push(self.time, self.places, old_velocities)
        outer = self._weight + push.forces if push else self._weight
        forces = outer
        for bars in self._deformable_bars:
            forces = forces + bars.forces(self.places)
        # Damping acts on the mean of the velocities before and after the time step.
        half = self.damping * self.dt / 2
        pushed_velocities = (1 - half) * old_velocities + self._mobility * forces
        new_velocities = pushed_velocities / (1 + half)
        if self.body:
            points = self._rigid_points
            self.body.push(forces[points], self.damping, self.dt)
            new_velocities[points] = self.body.velocities
        mean: Plane = np.multiply(0.5, old_velocities + new_velocities)
        self._account(mean, outer, push)
        self.velocities = new_velocities
        return mean

    def move(self) -> None:
        """Move the points by one time step."""
        self.places = self.places + self.dt * self.velocities
        if self.body:
            points = self._rigid_points
            self.body.move(self.dt)
            self.places[points] = self.body.places
            self.velocities[points] = self.body.velocities
        self.count += 1

    def _account(self, mean: Plane, outer: Plane, push: Push | None) -> None:
        """Add the external work and impulse of one time step, computed from the mean velocities over the time step."""
        accounts = self.accounts
        dt = self.dt
        momenta = self.structure.masses * mean
        drag = self.damping * momenta
        accounts.external_work -= dt * GRAVITY * float(momenta.sum().imag)
        accounts.damping += dt * float(np.vdot(drag, mean).real)
        accounts.impulse += dt * complex((outer - drag).sum())
        accounts.angular_impulse += dt * float(np.vdot(self.places, outer - drag).imag)
        if push:
            # All powers are in W; the product of force and velocity is the real part of `vdot`.
            speed = self.contact.sled.velocity(self.time)
            power_of_sled = float(push.sled.whole.real.sum()) * speed
            on_sled = np.vdot(push.sled.friction, mean - speed)
            on_ground = np.vdot(push.ground.friction, mean)
            power_of_friction = float((on_sled + on_ground).real)
            power_on_points = float(np.vdot(push.forces, mean).real)
            accounts.external_work += dt * power_of_sled
            accounts.friction -= dt * power_of_friction
            power_into_walls = power_of_sled - power_on_points + power_of_friction
            accounts.walls += dt * power_into_walls
