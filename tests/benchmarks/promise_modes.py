"""Linear structures with closed-form motion: individually damped modes under any loads."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples


class Load(NamedTuple):
    """A force on the modes; ``heights`` (k,) is the deformation that its peak would cause statically.

    A push is a half-sine of the ``duration``; a load that ``fades`` has always been there, and is gone by then.
    """

    start: float
    duration: float
    heights: Samples
    fades: bool = False

    @property
    def end(self) -> float:
        """Time at which the force has ended [time]."""
        return self.start + self.duration

    def evaluate(self, time: Samples) -> Samples:
        """Return the time history of the force with a peak of 1, shape (n,)."""
        phase = np.pi * np.clip((time - self.start) / self.duration, 0.0, 1.0)
        return (1 + np.cos(phase)) / 2 if self.fades else np.sin(phase)

    def integrate(self, time: Samples) -> Samples:
        """Return the impulse from the start of the record to these times [time], shape (n,)."""
        phase = np.pi * np.clip((time - self.start) / self.duration, 0.0, 1.0)
        if self.fades:
            return np.minimum(time, self.start) + self.duration / (2 * np.pi) * (
                phase + np.sin(phase)
            )
        return self.duration / np.pi * (1 - np.cos(phase))


class Stretch(NamedTuple):
    """A slow deformation about which the modes vibrate: ``courses`` maps times (n,) to shape (n,); and its rate."""

    heights: Samples
    course: Callable[[Samples], Samples]
    rate: Callable[[Samples], Samples]


class Parts(NamedTuple):
    """Relation between the energies of the recorded springs and masses and the modes.

    Spring i holds ``(springs[i] @ q)**2`` and mass j moves with ``(masses[j] @ q')**2``; ``owners`` numbers the part of
    each spring.
    """

    springs: Samples
    masses: Samples
    owners: NDArray[np.int_]


class Modes(NamedTuple):
    """Modes q'' + 2 decay q' + (rate^2 + decay^2) q = force, where q^2 is the elastic energy; both of shape (k,)."""

    rate: Samples
    decay: Samples
    loads: Sequence[Load]
    stretch: Stretch | None = None
    parts: Parts | None = None

    @property
    def most_times(self) -> int:
        """Largest number of times for which a search is fast enough."""
        return 900

    @property
    def fastest_period(self) -> float:
        """Period of the fastest mode [time]."""
        return float(2 * np.pi / self.rate.max())

    @property
    def loaded_until(self) -> float:
        """End of the last load [time]."""
        return max(load.end for load in self.loads)

    @property
    def undamped(self) -> Samples:
        """Undamped angular frequency of each mode, shape (k,) [1/time]."""
        return np.hypot(self.rate, self.decay)

    def follow(self, time: Samples) -> tuple[Samples, Samples]:
        """Return points of the reference run, shape (n, d), and sizes of the vibration about the stretch, (n,)."""
        points = np.hstack(self._project(*self.compute_states(time)))
        vibration = np.hstack(self._project(*self._compute_vibration(time)))
        return points, np.linalg.norm(vibration, axis=1)

    def release(self, time: Samples) -> Samples:
        """Return the points of runs that start at rest with the deformation at these times, shape (n, d)."""
        deformation, velocity = self._project(*self.compute_states(time))
        return np.hstack([deformation, np.zeros_like(velocity)])

    def compute_states(self, time: Samples) -> tuple[Samples, Samples]:
        """Return q and q' including the slow deformation, each of shape (n, k)."""
        deformation, velocity = self._compute_vibration(time)
        if self.stretch is None:
            return deformation, velocity
        course, rate = self.stretch.course(time), self.stretch.rate(time)
        return deformation + np.outer(
            course, self.stretch.heights
        ), velocity + np.outer(rate, self.stretch.heights)

    def compute_energies(self, time: Samples) -> tuple[Samples, Samples]:
        """Return the recorded elastic energy of each part, shape (n, p), and the recorded kinetic energy, (n,)."""
        deformation, velocity = self._project(*self.compute_states(time))
        kinetic = np.sum(velocity**2, axis=1)
        if self.parts is None:
            return np.sum(deformation**2, axis=1)[:, np.newaxis], kinetic
        owners = self.parts.owners
        elastic = [
            np.sum(deformation[:, owners == part] ** 2, axis=1)
            for part in np.unique(owners)
        ]
        return np.stack(elastic, axis=1), kinetic

    def _project(
        self, deformation: Samples, velocity: Samples
    ) -> tuple[Samples, Samples]:
        """Return the square roots of the recorded energies, each of shape (n, d/2)."""
        if self.parts is None:
            return deformation, velocity / self.undamped
        return deformation @ self.parts.springs.T, velocity @ self.parts.masses.T

    def _compute_vibration(self, time: Samples) -> tuple[Samples, Samples]:
        """Add the response to the loads by superposition: q and q', each of shape (n, k)."""
        deformation = np.zeros((time.size, self.rate.size))
        velocity = np.zeros_like(deformation)
        for load in self.loads:
            wave = np.pi / load.duration
            # A half-sine is the sum of a sine that begins and of an equal sine that begins half a period later.
            begun, begun_rate = self._respond(time - load.start, wave)
            ended, ended_rate = self._respond(time - load.end, wave)
            if load.fades:
                step, step_rate = self._respond(time - load.start, 0.0)
                last, last_rate = self._respond(time - load.end, 0.0)
                answer = 1 - (step - begun + last - ended).real / 2
                rate = -(step_rate - begun_rate + last_rate - ended_rate).real / 2
            else:
                answer, rate = (begun + ended).imag, (begun_rate + ended_rate).imag
            deformation += load.heights * answer
            velocity += load.heights * rate
        return deformation, velocity

    def _respond(self, since: Samples, wave: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the deformation under a unit force exp(i wave t) that begins at 0, and its rate, complex (n, k)."""
        pole = -self.decay + 1j * self.rate
        square = self.undamped**2
        forced = square / (square - wave**2 + 2j * wave * self.decay)
        first = forced * (pole.conj() - 1j * wave) / (pole - pole.conj())
        second = -forced - first
        begun = since[:, np.newaxis] >= 0
        time = np.maximum(since, 0.0)[:, np.newaxis]
        terms = (
            (forced, np.exp(1j * wave * time), 1j * wave),
            (first, np.exp(pole * time), pole),
            (second, np.exp(pole.conj() * time), pole.conj()),
        )
        deformation = sum(size * course for size, course, _ in terms)
        rate = sum(size * course * power for size, course, power in terms)
        return np.where(begun, deformation, 0.0), np.where(begun, rate, 0.0)
