"""One run, explicit: central differences, with or without a window in which the box is rigid."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import RangeError
from d2rpick.models.rollover.bars import Bars, stiffest_rate
from d2rpick.models.rollover.contact import STIFFNESS, Contact
from d2rpick.models.rollover.model import GRAVITY, build
from d2rpick.models.rollover.rigid import RigidBody

if TYPE_CHECKING:
    from d2rpick.models.rollover.contact import Push
    from d2rpick.models.rollover.model import Parameters, Plane

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
        self._weight: Plane = np.asarray(s.masses * (-1j * GRAVITY), dtype=np.complex128)
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
        self.box.forces(self.places)  # for the last time: where it yields now, it does so before it is frozen
        of_box = slice(self.structure.of_box)
        masses, before = self.structure.masses[of_box], self.velocities[of_box]
        self.body = RigidBody(masses, self.places[of_box], before)
        after = self.body.velocities
        self.accounts.lost += float(masses @ (np.abs(before) ** 2 - np.abs(after) ** 2)) / 2
        self.velocities = np.concatenate([after, self.velocities[self.structure.of_box :]])

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
            against = float((np.vdot(push.sled.friction, mean - speed) + np.vdot(push.ground.friction, mean)).real)
            accounts.external_work += dt * by_sled
            accounts.friction -= dt * against
            accounts.walls += dt * (by_sled - float(np.vdot(push.forces, mean).real) + against)
