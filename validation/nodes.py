"""Motion of all nodes of a run, and the error of the vibration of a switched run (R, correlation).

A deck writes the motion of nodes by its first card /TH/NODE, in six columns each: DX, DY, DZ, VX, VY and VZ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.deck import read_inventory
from d2rpick.deck.geometry import compute_masses_and_steps, compute_sizes_and_lengths
from d2rpick.deck.mesh import NO_NODE
from d2rpick.deck.model import SPRING
from d2rpick.histories.formats.radioss_th import TimeHistory

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Reals = NDArray[np.float64]

_COLUMNS = 6
_LINES = ("beam", SPRING)  # a third node orients them
_NUMBER = 4  # bytes


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes whose motion a deck writes: positions (nodes, 3) [length] and masses (nodes,) [mass]."""

    places: Reals
    masses: Reals

    def centre(self, positions: Reals) -> Reals:
        """Return the centre of mass of the nodes at some positions (..., nodes, 3)."""
        return np.asarray(
            np.einsum("n,...nx->...x", self.masses, positions) / self.masses.sum()
        )


class Motion(NamedTuple):
    """Times (n,), positions and velocities of all nodes (n, nodes, 3)."""

    time: Reals
    places: Reals
    velocities: Reals


class VibrationError(NamedTuple):
    """Error of the vibration of a switched run, from the velocities of all nodes less the rigid motion.

    ``residual`` is the root of the kinetic energy of the difference over that of the reference [-]; ``correlation`` is
    the mean product of the velocities, weighted by mass, over the root of the product of both kinetic energies [-].
    """

    residual: float
    correlation: float


def read_nodes(deck: Path) -> Nodes:
    """Read the nodes whose motion a starter deck writes.

    The mass of a part is distributed to its elements by size (equally for springs), and the mass of an element to its
    nodes equally.
    """
    inventory = read_inventory(str(deck))
    of_parts = compute_masses_and_steps(inventory)
    masses = np.zeros(len(inventory.coordinates))
    for elements in inventory.elements:
        ends = elements.nodes[:, :2] if elements.kind in _LINES else elements.nodes
        sizes, _ = compute_sizes_and_lengths(
            elements.kind, elements.nodes, inventory.coordinates
        )
        for part in np.unique(elements.part).tolist():
            own_elements = elements.part == part
            shares = (
                np.ones(own_elements.sum())
                if elements.kind == SPRING
                else sizes[own_elements]
            )
            mass = of_parts[part][0]
            if mass is None:
                raise ValueError(
                    f"{deck}: the mass of part {part} is unknown; give its density and size"
                )
            is_given = ends[own_elements] != NO_NODE  # a triangle has no fourth node
            of_nodes = (
                is_given
                * (mass * shares / shares.sum() / is_given.sum(axis=1))[:, np.newaxis]
            )
            np.add.at(masses, ends[own_elements][is_given], of_nodes[is_given])
    return Nodes(inventory.coordinates[inventory.watched], masses[inventory.watched])


def read_motion(legs: Sequence[Path], nodes: Nodes, start: float, end: float) -> Motion:
    """Read the motion between two times [time] from the time histories of a run."""
    motions = [_read_motion_of_leg(leg, nodes, start, end) for leg in sorted(legs)]
    return Motion(*(np.concatenate(pieces) for pieces in zip(*motions, strict=True)))


def _read_motion_of_leg(leg: Path, nodes: Nodes, start: float, end: float) -> Motion:
    count = len(nodes.places)
    history = TimeHistory(leg.read_bytes(), str(leg))
    inside = (history.time >= start) & (history.time <= end)
    record = history._head.counts.index(_COLUMNS * count)
    first = history._begins[record] + history._records.place(0)
    states = np.frombuffer(leg.read_bytes(), np.uint8, offset=history._records.at)
    states = states[: history._states * history._stride].reshape(
        history._states, history._stride
    )
    columns = np.ascontiguousarray(
        states[inside, first : first + _NUMBER * _COLUMNS * count]
    )
    values = columns.view(">f4").astype(float).reshape(-1, count, _COLUMNS)
    return Motion(history.time[inside], nodes.places + values[..., :3], values[..., 3:])


def compare_vibration(
    reference: Motion, switched: Motion, nodes: Nodes
) -> VibrationError:
    """Compare the vibration of a switched run with that of its reference, at the times of the reference."""
    inside = (reference.time >= switched.time[0]) & (
        reference.time <= switched.time[-1]
    )
    reference = Motion(*(values[inside] for values in reference))
    wanted = remove_rigid_motion(reference, nodes)
    switched_velocities = remove_rigid_motion(
        interpolate(switched, reference.time), nodes
    )

    def energy(first: Reals, second: Reals) -> float:
        return float(np.einsum("n,tnx,tnx->", nodes.masses, first, second))

    residual = np.sqrt(
        energy(switched_velocities - wanted, switched_velocities - wanted)
        / energy(wanted, wanted)
    )
    correlation = energy(switched_velocities, wanted) / np.sqrt(
        energy(switched_velocities, switched_velocities) * energy(wanted, wanted)
    )
    return VibrationError(float(residual), float(correlation))


def interpolate(motion: Motion, times: Reals) -> Motion:
    """Return a motion at other times, which are between its own."""
    next_state = np.clip(np.searchsorted(motion.time, times), 1, motion.time.size - 1)
    share = (times - motion.time[next_state - 1]) / (
        motion.time[next_state] - motion.time[next_state - 1]
    )
    share = share[:, np.newaxis, np.newaxis]
    positions, velocities = (
        values[next_state - 1] + share * (values[next_state] - values[next_state - 1])
        for values in (motion.places, motion.velocities)
    )
    return Motion(times, positions, velocities)


def remove_rigid_motion(motion: Motion, nodes: Nodes) -> Reals:
    """Return the velocities (n, nodes, 3) less those of the rigid body with the same linear and angular momentum."""
    arms = motion.places - nodes.centre(motion.places)[:, np.newaxis]
    moving = motion.velocities - nodes.centre(motion.velocities)[:, np.newaxis]
    angular = np.einsum("n,tnx->tx", nodes.masses, np.cross(arms, moving))
    products = np.einsum("n,tnx,tny->txy", nodes.masses, arms, arms)
    inertia = (
        np.trace(products, axis1=1, axis2=2)[:, np.newaxis, np.newaxis] * np.eye(3)
        - products
    )
    spin = np.linalg.solve(inertia, angular[..., np.newaxis])[..., 0]
    return np.asarray(moving - np.cross(spin[:, np.newaxis], arms))


def compute_vibration_energy(motion: Motion, nodes: Nodes) -> float:
    """Return the mean energy of the vibration [energy]: twice the kinetic energy, if the times cover whole periods."""
    moving = remove_rigid_motion(motion, nodes)
    return float(np.einsum("n,tnx,tnx->", nodes.masses, moving, moving) / len(moving))
