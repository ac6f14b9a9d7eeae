"""Nonlinear structures whose motion scipy integrates: stiffening springs, closing gaps, friction."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from scipy.integrate import OdeSolution

    from d2rpick.histories.history import Samples

# Periods of the slowest mode after td over which two runs are compared, and the number of compared times.
COMPARED: Final = 2.0
_COMPARED_AT: Final = 200
_EXACT: Final[dict[str, Any]] = {"method": "DOP853", "rtol": 1e-7, "atol": 1e-10}
# A joint has kinks, for which a method of high order has no advantage.
_EXACT_WITH_KINKS: Final[dict[str, Any]] = {
    "method": "RK45",
    "rtol": 1e-6,
    "atol": 1e-9,
}
# Accuracy for the search among hundreds of runs integrated at once: R within 0.001, with contacts within 0.01.
_MANY: Final[dict[str, Any]] = {"method": "RK45", "rtol": 1e-4, "atol": 1e-6}


class Joint(NamedTuple):
    """A contact or friction between two places, whose relative displacement is ``row @ q``, shape (k,).

    Contact acts beyond a ``gap`` on both sides with a ``stiffness``; ``friction`` is a force that is full from a
    relative velocity of ``creep`` on.  ``recorded``: whether the energy of the contact is in that of the record.
    """

    row: Samples
    stiffness: float = 0.0
    gap: float = 0.0
    friction: float = 0.0
    creep: float = 1.0
    recorded: bool = True

    def compute_force(self, q: Samples, speed: Samples) -> Samples:
        """Return the force on each mode, in the shape of q, (k, n)."""
        contact = self.stiffness * self._compress(q)
        rubbing = self.friction * np.tanh(self.row @ speed / self.creep)
        return np.multiply.outer(self.row, contact + rubbing)

    def compute_energy(self, q: Samples) -> Samples:
        """Return the recorded elastic energy of the contact, shape (n,)."""
        return self.recorded * self.stiffness / 2 * self._compress(q) ** 2

    def _compress(self, q: Samples) -> Samples:
        """Return by how much the displacement exceeds the gap, with its sign, shape (n,)."""
        displacement = self.row @ q
        beyond = np.maximum(np.abs(displacement) - self.gap, 0.0)
        return np.asarray(np.copysign(beyond, displacement))


class Structure(NamedTuple):
    """Modes q'' = -alpha q' - omega^2 (q + stiffening q^3) + half-sine pushes; q^2 is the linear energy.

    ``omega``, ``stiffening`` of shape (k,); ``pushes`` of shape (p, 2 + k): start, end, and height on each mode.
    """

    omega: Samples
    alpha: float
    stiffening: Samples
    pushes: Samples
    joint: Joint | None = None

    @property
    def loaded_until(self) -> float:
        """End of the last push [time]."""
        return float(self.pushes[:, 1].max(initial=-np.inf))

    @property
    def is_linear(self) -> bool:
        """True if the sum of two free motions is a free motion."""
        return self.joint is None and not self.stiffening.any()

    @property
    def _settings(self) -> dict[str, Any]:
        """Accuracy with which scipy integrates one run."""
        return _EXACT if self.joint is None else _EXACT_WITH_KINKS

    def move(
        self, start: float, end: float, state: Samples
    ) -> Callable[[Samples], Samples]:
        """Integrate from a state that contains q and q'; return both at any times, shape (2 k, n)."""
        stops = np.unique(
            np.clip([start, *self.pushes[:, :2].ravel(), end], start, end)
        )
        pieces: list[OdeSolution] = []
        for first, last in pairwise(stops.tolist()):  # a push begins with a kink
            moving = self if first < self.loaded_until else self.release_loads()
            answer = solve_ivp(
                moving._slope, (first, last), state, dense_output=True, **self._settings
            )
            pieces.append(answer.sol)
            state = answer.y[:, -1]

        def evaluate(t: Samples) -> Samples:
            piece_index = np.clip(np.searchsorted(stops, t) - 1, 0, len(pieces) - 1)
            states = np.empty((state.size, t.size))
            for piece in np.unique(piece_index):
                states[:, piece_index == piece] = pieces[piece](t[piece_index == piece])
            return states

        return evaluate

    def release_loads(self) -> Structure:
        """Return the structure in free flight."""
        return self._replace(pushes=self.pushes[:0])

    def compute_push(self, time: Samples) -> Samples:
        """Return the force on each mode at times of shape (n,), shape (n, k)."""
        first, last = self.pushes[:, 0], self.pushes[:, 1]
        since = np.asarray(time)[:, np.newaxis] - first
        inside = (since > 0) & (since < last - first)
        course = np.where(inside, np.sin(np.pi * since / (last - first)), 0.0)
        return np.asarray(course @ self.pushes[:, 2:])

    def compute_paths(self, states: Samples) -> Samples:
        """Return the motion of free runs from states of shape (2 k, n), as points in the energy norm, shape (n, d)."""
        free = self.release_loads()
        if self.is_linear:
            return np.asarray(
                states.T @ free._integrate_paths(np.eye(2 * self.omega.size), _EXACT)
            )
        return free._integrate_paths(
            states, self._settings if states.shape[1] == 1 else _MANY
        )

    def _integrate_paths(self, states: Samples, settings: Mapping[str, Any]) -> Samples:
        """Integrate all states of shape (2 k, n) at once; return points of shape (n, d)."""
        end = COMPARED * 2 * np.pi / float(self.omega.min())
        times = np.linspace(0.0, end, _COMPARED_AT)
        answer = solve_ivp(
            self._slope, (0.0, end), states.ravel(), t_eval=times, **settings
        )
        deformation, velocity = np.split(answer.y.reshape(*states.shape, times.size), 2)
        points = np.stack(
            [deformation, velocity / self.omega[:, np.newaxis, np.newaxis]]
        )
        return np.moveaxis(points, 2, 0).reshape(states.shape[1], -1)

    def compute_energies(self, states: Samples) -> tuple[Samples, Samples]:
        """Return elastic energy (without that of the joint) and kinetic energy of states (2 k, n), each (k, n)."""
        q, speed = np.split(states, 2)
        return q**2 + self.stiffening[:, np.newaxis] * q**4 / 2, (
            speed / self.omega[:, np.newaxis]
        ) ** 2

    def _slope(self, t: float, state: Samples) -> Samples:
        """Return the time derivative of one state or of many, raveled from shape (2 k, n)."""
        count = self.omega.size
        states = state.reshape(2 * count, -1)
        q, speed = (
            states[:count],
            states[count:],
        )  # np.split would take 20 % of the time
        square = self.omega[:, np.newaxis] ** 2
        force = (
            -square * (q + self.stiffening[:, np.newaxis] * q**3) - self.alpha * speed
        )
        if self.joint is not None:
            force -= square / 2 * self.joint.compute_force(q, speed)
        if self.pushes.size:
            force += self.compute_push(np.array([t])).T
        return np.concatenate([speed, force]).ravel()


class IntegratedRun(NamedTuple):
    """A structure, and its ``states`` (2 k, n) at any times (n,)."""

    structure: Structure
    states: Callable[[Samples], Samples]

    @property
    def most_times(self) -> int:
        """Number of times that a search can afford: unless the structure is linear, each has to be integrated."""
        return 900 if self.structure.is_linear else 300

    @property
    def fastest_period(self) -> float:
        """Period of the fastest mode [time]."""
        return float(2 * np.pi / self.structure.omega.max())

    def follow(self, time: Samples) -> tuple[Samples, Samples]:
        """Return points of the reference run from these times on, shape (n, d), and their lengths, shape (n,)."""
        points = self.structure.compute_paths(self.states(time))
        return points, np.linalg.norm(points, axis=1)

    def release(self, time: Samples) -> Samples:
        """Return the points of runs that start at rest with the deformation at these times, shape (n, d)."""
        deformation, velocity = np.split(self.states(time), 2)
        return self.structure.compute_paths(
            np.concatenate([deformation, np.zeros_like(velocity)])
        )
