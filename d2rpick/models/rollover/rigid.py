"""Switching: the motion of the box as one body, three equations in the plane instead of its bars."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from d2rpick.models.rollover.model import Plane, Values


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
        self.velocity = ((1 - half) * self.velocity + dt * complex(forces.sum()) / self._mass) / (1 + half)
        self.spin = ((1 - half) * self.spin + dt * moment / self._inertia) / (1 + half)

    def move(self, dt: float) -> None:
        """Move on for a step [s]; the arms turn and keep their lengths."""
        self.centre += dt * self.velocity
        self.arms *= complex(np.exp(1j * dt * self.spin))
