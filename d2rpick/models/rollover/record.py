"""Record of a run: what the box and its step did, state by state."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from d2rpick.models.rollover.model import Plane, Values
    from d2rpick.models.rollover.motion import Motion

PARTS: Final = ("box", "step")
BOX: Final = 0
_REALS, _PLANES = 11, 4


@dataclass(frozen=True, eq=False)
class Record:
    """States of a run over ``time`` (n,); SI units, vectors x + i z.

    Of the box: ``centre`` of mass and its ``velocity`` (n,), ``roll`` forward since time 0 [rad], ``omega`` [rad/s] by
    the angular momentum.  Of box and step: ``internal_energy``, ``kinetic_energy`` and ``momentum`` (n, 2).  Of the
    whole: ``external_work``, ``contact_energy``, ``damping_energy`` and ``lost_energy`` at tr, each since time 0 (n,).
    ``outline`` of the box (n, points).  ``released``: the sled pushed last, ``landed``: the ground first; None if not.
    ``dt`` is the step [s], ``bar_updates`` and ``seconds`` are what the run cost.
    """

    time: Values
    centre: Plane
    velocity: Plane
    roll: Values
    omega: Values
    internal_energy: Values
    kinetic_energy: Values
    momentum: Plane
    external_work: Values
    contact_energy: Values
    damping_energy: Values
    lost_energy: Values
    outline: Plane
    released: float | None
    landed: float | None
    dt: float
    bar_updates: int
    seconds: float

    @property
    def balance(self) -> Values:
        """What energy is there and was spent, less the work done, over that of the start; 1 is perfect (n,) [-]."""
        there = self.internal_energy.sum(axis=1) + self.kinetic_energy.sum(axis=1)
        spent = self.contact_energy + self.damping_energy + self.lost_energy
        return np.asarray((there + spent - self.external_work) / there[0])


class Recorder:
    """Collects states of a ``motion`` up to its step ``last``."""

    def __init__(self, motion: Motion, last: int) -> None:
        self._motion, self._began, self._updates = motion, perf_counter(), _updates(motion)
        s = motion.structure
        states = last // motion.every - -(-motion.count // motion.every) + 1
        self._reals = np.zeros((states, _REALS))
        self._planes = np.zeros((states, _PLANES), dtype=np.complex128)
        self._outline = np.zeros((states, s.of_box // 2), dtype=np.complex128)
        self._next = 0
        self._box_masses = s.masses[: s.of_box]
        self._box_mass = float(self._box_masses.sum())
        self._start = self._box_masses * self._arms(s.places)

    def note(self, mean: Plane) -> None:
        """Note the state of the motion, with the velocities ``mean`` (n,) [m/s] over the step around it."""
        motion, s = self._motion, self._motion.structure
        n, places, momenta, accounts = s.of_box, motion.places, s.masses * mean, motion.accounts
        arms = self._arms(places)
        of_box, of_step = complex(momenta[:n].sum()), complex(momenta[n:].sum())
        spin = np.vdot(arms, momenta[:n]).imag / (self._box_masses @ np.abs(arms) ** 2)
        kinetic = (np.conj(mean) * momenta).real / 2
        self._reals[self._next] = (
            motion.time, np.angle(np.vdot(arms, self._start)), -spin,
            motion.box.internal_energy(places), motion.step.internal_energy(places), kinetic[:n].sum(),
            kinetic[n:].sum(), accounts.external_work, accounts.contact, accounts.damping, accounts.lost,
        )  # fmt: skip
        self._planes[self._next] = complex(places[0] - arms[0]), of_box / self._box_mass, of_box, of_step
        self._outline[self._next] = places[: n // 2]
        self._next += 1

    def record(self) -> Record:
        """Give what was collected."""
        motion, real, plane = self._motion, self._reals.T, self._planes.T
        return Record(
            time=real[0],
            centre=plane[0],
            velocity=plane[1],
            roll=np.unwrap(real[1]),
            omega=real[2],
            internal_energy=real[3:5].T,
            kinetic_energy=real[5:7].T,
            momentum=plane[2:4].T,
            external_work=real[7],
            contact_energy=real[8],
            damping_energy=real[9],
            lost_energy=real[10],
            outline=self._outline,
            released=motion.contact.released,
            landed=motion.contact.landed,
            dt=motion.dt,
            bar_updates=_updates(motion) - self._updates,
            seconds=perf_counter() - self._began,
        )

    def _arms(self, places: Plane) -> Plane:
        """From the centre of mass of the box to its points [m]."""
        of_box = places[: self._box_masses.size]
        return np.asarray(of_box - self._box_masses @ of_box / self._box_mass)


def _updates(motion: Motion) -> int:
    return motion.box.evaluations + motion.step.evaluations
