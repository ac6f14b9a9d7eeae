"""Contact: the floor and the curb of the sled, and the ground, by penalty forces with friction.

Penetration is resisted in proportion, friction by Coulomb's law, smoothed at small speeds.  The cushion of the curb is
crushed like honeycomb: at a constant force, for good, until its depth is used up.  In a drop there is only the ground.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.models.rollover.model import GRAVITY

if TYPE_CHECKING:
    from d2rpick.models.rollover.model import Ends, Parameters, Plane, Structure, Values

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
        self._fastest = FASTEST * parameters.speed + FALL + 2 * np.sqrt(2 * GRAVITY * (parameters.drop or 0.0))
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
        push = Push(self._sled(time, on_sled, velocities), self._on_all(self._ground(places, velocities), self._skin))
        if push.sled.normal.any() and not self.landings:
            self.released = time
        if push.ground.normal.any():
            last = self.landings.pop() if self.landings and time - self.landings[-1][1] < SAME_CONTACT else (time, time)
            self.landings.append((last[0], time))
        return push

    def _sled(self, time: float, on_sled: Plane, velocities: Plane) -> Face:
        nothing = np.zeros(self._points, dtype=np.complex128)
        if self._p.drop is not None:
            return Face(nothing, nothing)
        sliding = (velocities - self.sled.velocity(time)) * self._into_sled
        floor = self._on_all(self._floor(on_sled[self._skin], sliding[self._skin]), self._skin)
        curb = self._on_all(self._curb(on_sled[self._toes], sliding[self._toes]), self._toes)
        back = self._into_sled.conjugate()
        return Face((floor.normal + curb.normal) * back, (floor.friction + curb.friction) * back)

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
        return self._with_friction(self._p.ground_stiffness * depth, sliding[self._skin].real)

    def _curb(self, places: Plane, sliding: Plane) -> Face:
        """Push back, along -x, with friction along z: a floor that is turned by a quarter."""
        before = (places.imag < self._p.curb) & (places.real < self._p.cushion_depth + DEEPEST)
        depth = np.where(before, np.maximum(places.real, 0.0), 0.0)
        trial = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        yields = np.minimum(trial, self._p.cushion)
        self._crushed = np.minimum(self._crushed + (trial - yields) / STIFFNESS, self._p.cushion_depth)
        held = STIFFNESS * np.maximum(depth - self._crushed, 0.0)
        face = self._with_friction(held, sliding.imag)
        return Face(np.asarray(1j * face.normal), np.asarray(1j * face.friction))

    def _with_friction(self, normal: Values, sliding: Values) -> Face:
        """Force of a floor: ``normal`` up, friction against ``sliding`` [m/s] along it."""
        friction = self._p.friction * normal * sliding / np.hypot(sliding, SLIP)
        return Face(np.asarray(1j * normal), np.asarray(-friction, dtype=np.complex128))
