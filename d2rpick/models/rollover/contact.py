"""Contact: the floor and the curb of the sled, and the ground, by penalty forces with friction.

Penetration is resisted in proportion, friction by Coulomb's law, smoothed at small speeds.  The cushion of the curb is
crushed like honeycomb: at a constant force, for good, until its depth is used up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from d2rpick.models.rollover.model import Parameters, Plane, Structure, Values

# Of floor, curb and ground at one point [N/m]: softer than the box, so that contact does not set the time step; the
# weight of the box sinks in by half a millimetre, a landing by centimetres.
STIFFNESS = 5e5
# Below this sliding speed friction grows in proportion to it [m/s]: a hundredth of the speeds here.
SLIP = 0.1
# A point deeper below the floor than this [m] is beside the sled, not in it.
DEEPEST = 0.1
# Thickness of the curb [m]; the sled ends behind it.
CURB_THICKNESS = 0.05
# No point comes nearer to floor, curb or ground faster than this many times the first speed of the sled and as much
# again as a fall of a metre gives [m/s]: what tells how long none can touch.
FASTEST, FALL = 4.0, 5.0


class Push(NamedTuple):
    """Contact forces on all points (n,) [N], and what of them the sled exerts, summed [N]."""

    forces: Plane
    of_sled: complex


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

    ``released`` is when the sled pushed last before the ground did for the first time, at ``landed`` [s].
    """

    def __init__(self, structure: Structure, parameters: Parameters) -> None:
        self.sled = Sled(parameters.speed, parameters.braking)
        self._p = parameters
        self._skin, self._toes = structure.skin, structure.toes
        self._points = structure.places.size
        self._into_sled = complex(np.exp(1j * np.radians(parameters.tilt)))
        self._crushed = np.zeros(self._toes.size)
        self._sleeps_until = 0.0
        self.released: float | None = None
        self.landed: float | None = None

    def push(self, time: float, places: Plane, velocities: Plane) -> Push | None:
        """Forces at ``time``; None while nothing can touch."""
        if time < self._sleeps_until:
            return None
        on_sled = (places - self.sled.place(time)) * self._into_sled
        gap = self._gap(places, on_sled)
        if gap > 0:
            self._sleeps_until = time + gap / (FASTEST * self._p.speed + FALL)
            return None
        sliding = (velocities - self.sled.velocity(time)) * self._into_sled
        of_sled = np.zeros(self._points, dtype=np.complex128)
        of_sled[self._skin] = self._floor(on_sled[self._skin], sliding[self._skin])
        of_sled[self._toes] += self._curb(on_sled[self._toes], sliding[self._toes])
        of_sled *= self._into_sled.conjugate()
        of_ground = self._ground(places[self._skin], velocities[self._skin])
        self._remember(time, of_sled.any(), of_ground.any())
        forces = of_sled.copy()
        forces[self._skin] += of_ground
        return Push(forces, complex(of_sled.sum()))

    def _remember(self, time: float, by_sled: np.bool_, by_ground: np.bool_) -> None:
        if by_sled and self.landed is None:
            self.released = time
        if by_ground and self.landed is None:
            self.landed = time

    def _gap(self, places: Plane, on_sled: Plane) -> float:
        """Length that the nearest point must move at least before it can touch [m]."""
        skin, toes = on_sled[self._skin], on_sled[self._toes]
        to_floor = np.maximum(skin.imag, skin.real - CURB_THICKNESS).min()
        to_curb = np.maximum(-toes.real, toes.imag - self._p.curb).min()
        to_ground = places[self._skin].imag.min() + self._p.ground
        return float(min(to_floor, to_curb, to_ground))

    def _floor(self, places: Plane, sliding: Plane) -> Plane:
        above = (places.real < CURB_THICKNESS) & (places.imag > -DEEPEST)
        depth = np.where(above, np.maximum(-places.imag, 0.0), 0.0)
        return self._with_friction(STIFFNESS * depth, sliding.real)

    def _ground(self, places: Plane, sliding: Plane) -> Plane:
        return self._with_friction(STIFFNESS * np.maximum(-self._p.ground - places.imag, 0.0), sliding.real)

    def _curb(self, places: Plane, sliding: Plane) -> Plane:
        """Push back, along -x, with friction along z: a floor that is turned by a quarter."""
        before = (places.imag < self._p.curb) & (places.real < self._p.cushion_depth + DEEPEST)
        depth = np.where(before, np.maximum(places.real, 0.0), 0.0)
        trial = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        yields = np.minimum(trial, self._p.cushion)
        self._crushed = np.minimum(self._crushed + (trial - yields) / STIFFNESS, self._p.cushion_depth)
        held = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        return np.asarray(1j * self._with_friction(held, sliding.imag))

    def _with_friction(self, normal: Values, sliding: Values) -> Plane:
        """Force of a floor: ``normal`` up, friction against ``sliding`` [m/s] along it."""
        return np.asarray(1j * normal - self._p.friction * normal * sliding / np.hypot(sliding, SLIP))
