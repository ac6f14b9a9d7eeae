"""Linear structures whose motion is computed here from their modes, independently of d2rpick."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from d2rpick.histories.history import Samples


class LinearStructure(NamedTuple):
    """Modes a exp(-g t) cos(w t + p) about a slow stretch; squared deformations are elastic energies."""

    amplitude: Samples
    damping: Samples
    rate: Samples
    phase: Samples

    @classmethod
    def draw(cls, seed: int, count: int) -> LinearStructure:
        """Draw modes that each have their own damping."""
        random = np.random.default_rng(seed)
        rate = (
            2 * np.pi * np.cumprod(np.append(1.0, random.uniform(1.2, 1.7, count - 1)))
        )
        return cls(
            np.exp(random.uniform(-1.5, 0.0, count)),
            random.uniform(0.0, 0.02, count) * rate,
            rate,
            random.uniform(0.0, 2 * np.pi, count),
        )

    def deformations(self, time: Samples | float) -> Samples:
        """Return the deformation of each mode, in the shape of ``time`` after an axis for modes."""
        reach = np.asarray(time)[np.newaxis]
        decay = self.amplitude[:, np.newaxis] * np.exp(
            -self.damping[:, np.newaxis] * reach
        )
        return np.asarray(
            decay * np.cos(self.rate[:, np.newaxis] * reach + self.phase[:, np.newaxis])
        )

    def kinetic_energies(self, time: Samples | float) -> Samples:
        """Return the kinetic energy of each mode, in the shape of `deformations`."""
        reach = np.asarray(time)[np.newaxis]
        angle = self.rate[:, np.newaxis] * reach + self.phase[:, np.newaxis]
        decay = self.amplitude[:, np.newaxis] * np.exp(
            -self.damping[:, np.newaxis] * reach
        )
        speed = decay * (
            self.rate[:, np.newaxis] * np.sin(angle)
            + self.damping[:, np.newaxis] * np.cos(angle)
        )
        undamped = np.hypot(self.rate, self.damping)[:, np.newaxis]
        return np.asarray((speed / undamped) ** 2)

    def elastic_energy(self, time: Samples) -> Samples:
        """Return the elastic energy of all modes, in the shape of ``time``."""
        return np.asarray(np.sum(self.deformations(time) ** 2, axis=0))

    def kinetic_energy(self, time: Samples) -> Samples:
        """Return the kinetic energy of all modes, in the shape of ``time``."""
        return np.asarray(np.sum(self.kinetic_energies(time), axis=0))

    def residual(self, tr: Samples, td: Samples) -> Samples:
        """Return R of pairs of times: energy norm of the missing motion at td over that of the reference vibration."""
        lack = np.sum((self.deformations(tr) - self.deformations(td)) ** 2, axis=0)
        kinetic, elastic = self.kinetic_energy(td), self.elastic_energy(td)
        return np.asarray(np.sqrt((lack + kinetic) / (kinetic + elastic)))
