"""Bound the speed that rotation may add at the point of contact if no file shows how the body rotates.

The kinetic energy of a body minus that of its centre of mass is the kinetic energy of its vibration and its rotation.
The rotational energy is the same in all states of a flight, so the smallest value of the sum is an upper bound of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.flight.body_frame import compute_inertia, compute_second_moments
from d2rpick.flight.margin import compute_closing_speed, select_momenta_of_flight
from d2rpick.histories.samples import find_window

if TYPE_CHECKING:
    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples


def bound_turning_speed(
    history: History, flight: Flight, placement: Placement
) -> float | None:
    r"""Return the largest speed that rotation can give to any node of the flying parts [length/time].

    Let E be the rotational energy, I the inertia tensor, w the angular velocity, and r the position of a node relative
    to the centre of mass. The speed of the node along a unit vector n is (r x n) w, so that

    .. math:: v \le \sqrt{2 E\, (r \times n)^T I^{-1} (r \times n)}

    for any w. The result is the largest value over all nodes and directions. It is None if the part momenta, the
    positions of the parts in the deck, or the kinetic energy are unknown.
    """
    evidence = select_momenta_of_flight(history, flight)
    if evidence is None or evidence[0].parts is None or flight.parts is None:
        return None
    momenta, members = evidence
    energy = _bound_energy_of_rotation(history, flight)
    mass = momenta.masses
    parts = [part.id for part in flight.parts]
    if mass is None or energy is None or not placement.parts.keys() >= set(parts):
        return None
    factor = _compute_largest_factor(placement, parts, mass[list(members)])
    return float(np.sqrt(2 * energy * factor))


def may_turn_back(history: History, flight: Flight) -> bool:
    """Return True if the rotational energy may move parts away from the ground as fast as the body approaches it.

    The rotation then moves parts at the radius of gyration as fast as the centre of mass, and parts outside even
    faster. The result is False if the files do not show the energies.
    """
    evidence = select_momenta_of_flight(history, flight)
    energy = _bound_energy_of_rotation(history, flight)
    closing = compute_closing_speed(history, flight)
    if evidence is None or energy is None or closing is None:
        return False
    momenta, members = evidence
    return bool(2 * energy >= momenta.mass(members) * closing**2)


def _bound_energy_of_rotation(history: History, flight: Flight) -> float | None:
    """Return an upper bound on the rotational energy in a flight [energy]; None if masses or energies are unknown.

    If only the kinetic energy of the model is written, it is used instead, because that of the flying parts is not
    larger.
    """
    evidence = select_momenta_of_flight(history, flight)
    kinetic = history.evidence.kinetic_energy(flight.parts)
    kinetic = kinetic or history.evidence.kinetic_energy(None)
    if evidence is None or kinetic is None:
        return None
    momenta, members = evidence
    mass = momenta.mass(members)
    inside = find_window(momenta.time, *flight.within(momenta.time))
    if not mass > 0 or momenta.time[inside].size == 0:
        return None
    momentum = momenta.of(members)[inside]
    energy_of_centre = np.square(momentum).sum(axis=1) / (2 * mass)
    whole_energy = np.interp(momenta.time[inside], kinetic.time, kinetic.values)
    least_remainder = float((whole_energy - energy_of_centre).min())
    return max(0.0, least_remainder)


def _compute_largest_factor(
    placement: Placement, parts: list[int], mass: Samples
) -> float:
    """Return the largest (r x n) I^-1 (r x n) over all nodes r of the given parts and all unit vectors n [1/mass]."""
    centres = np.stack([placement.parts[part].centre for part in parts])
    spreads = np.stack([placement.parts[part].spread for part in parts])
    centre_of_mass = np.average(centres, axis=0, weights=mass)
    arms_of_parts = (centres - centre_of_mass)[np.newaxis]
    of_points = compute_second_moments(arms_of_parts, mass)[0]
    of_spreads = np.einsum("p,pij->ij", mass, spreads)
    inertia = compute_inertia(of_points + of_spreads)
    inverse_inertia = np.linalg.pinv(inertia, hermitian=True)
    arms = placement.find_nodes(parts) - centre_of_mass
    # The columns are r x n for the three axes n.
    crossed = np.cross(arms[:, np.newaxis], np.eye(3))
    # For a node r, the largest (r x n) I^-1 (r x n) over all n is the largest eigenvalue of its matrix in n.
    matrices = np.einsum("nai,ij,nbj->nab", crossed, inverse_inertia, crossed)
    factors = np.linalg.eigvalsh(matrices)
    return float(factors[:, -1].max())
