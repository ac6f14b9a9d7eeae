"""Chains of three masses and two springs that move in a plane, integrated many at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tests.written_runs import Written

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from d2rpick.histories.history import Samples

    # A force of time, positions and velocities of the masses, each (n, 3, 2); the result has the same shape.
    Force = Callable[[float, Samples, Samples], Samples]


class Chains(NamedTuple):
    """Chains: masses (n, 3), springs and dampers between them (n, 2), and the yield forces of the springs (n, 2).

    Springs yield only up to a time (n,): the end of the load, or later.  ``places`` and ``velocities`` (n, 3, 2) are
    the initial ones.
    """

    masses: Samples
    stiffness: Samples
    damping: Samples
    strength: Samples
    yields_until: Samples
    places: Samples
    velocities: Samples


class Run(NamedTuple):
    """One chain as files store it, and the impulse (states, 2) of all forces on it except gravity."""

    written: Written
    impulse: Samples


def integrate_chains(
    chains: Chains, force: Force, weight: Force, end: float, states: int, steps: int
) -> Iterator[Run]:
    """Integrate chains up to ``end`` under a force and their weight, with this number of ``steps`` between states."""
    mass, dt = chains.masses[..., np.newaxis], end / (states * steps)
    stiffness, damping = (
        chains.stiffness[..., np.newaxis],
        chains.damping[..., np.newaxis],
    )
    strength, count = chains.strength[..., np.newaxis], len(chains.masses)
    positions, velocities = chains.places.copy(), chains.velocities.copy()
    yielded = np.diff(positions, axis=1) * 0
    impulse, work = np.zeros((count, 2)), np.zeros(count)
    damped, hardened = np.zeros(count), np.zeros((count, 2))
    rows = []
    for step in range(states * steps + 1):
        outer, heavy = (
            force(step * dt, positions, velocities),
            weight(step * dt, positions, velocities),
        )
        stretch = np.diff(positions, axis=1) - yielded
        pull = stiffness * stretch
        size = np.linalg.norm(pull, axis=2, keepdims=True)
        yields = (step * dt < chains.yields_until)[:, np.newaxis, np.newaxis]
        beyond = np.where(
            yields, np.maximum(0.0, 1 - strength / np.maximum(size, 1e-300)), 0.0
        )
        hardened += (
            np.minimum(size, strength)
            * np.linalg.norm(beyond * stretch, axis=2, keepdims=True)
        )[..., 0]
        yielded, stretch, pull = (
            yielded + beyond * stretch,
            stretch * (1 - beyond),
            pull * (1 - beyond),
        )
        if step % steps == 0:
            kinetic, elastic = (
                (mass * velocities**2).sum(axis=2) / 2,
                (stiffness * stretch**2).sum(axis=2) / 2,
            )
            rows.append(
                (
                    mass * velocities,
                    kinetic,
                    elastic + hardened,
                    impulse.copy(),
                    work.copy(),
                    damped.copy(),
                )
            )
        rates = np.diff(velocities, axis=1)
        damped += dt * (damping * rates**2).sum(axis=(1, 2))
        inner = np.diff(
            np.pad(pull + damping * rates, ((0, 0), (1, 1), (0, 0))), axis=1
        )
        earlier_velocities = velocities
        velocities = velocities + dt * (inner + outer + heavy) / mass
        work += dt * ((outer + heavy) * (earlier_velocities + velocities) / 2).sum(
            axis=(1, 2)
        )
        positions = positions + dt * velocities
        impulse += dt * outer.sum(axis=1)
    columns = [np.stack(column, axis=1) for column in zip(*rows, strict=True)]
    time = np.linspace(0, end, states + 1)
    for momentum, kinetic, springs, changed, worked, lost, masses in zip(
        *columns, chains.masses, strict=True
    ):
        internal = np.column_stack(
            [springs[:, 0] / 2, springs.sum(axis=1) / 2, springs[:, 1] / 2]
        )
        yield Run(
            Written(time, momentum, kinetic, internal, worked, masses, lost), changed
        )


def draw_directions(random: np.random.Generator, count: int) -> Samples:
    """Draw directions (count, 2); every other one is along x, so that its chain moves on one line."""
    angle = random.uniform(0, 2 * np.pi, count)
    angle[::2] = 0
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def apply_half_sine(time: float, start: Samples, length: Samples) -> Samples:
    """Return a half-sine pulse of this length that begins at ``start`` (n,); it is zero elsewhere."""
    return np.asarray(np.sin(np.pi * np.clip((time - start) / length, 0, 1)))


def apply_to_first(forces: Samples) -> Samples:
    """Apply forces (n, 2) to the first of three masses."""
    return np.stack([forces, np.zeros_like(forces), np.zeros_like(forces)], axis=1)
