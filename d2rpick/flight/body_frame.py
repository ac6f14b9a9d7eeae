"""Find the frame of a body in flight: the rotation of its parts, or of nodes with output, relative to the deck."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import ceil
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.window import LAST_DIGIT

if TYPE_CHECKING:
    from d2rpick.deck.geometry import Placement
    from d2rpick.histories.history import NodeMotion, Samples
    from d2rpick.histories.names import Part

# A function that reads the motion of those given nodes whose motion the solver wrote.
Displacements = Callable[[Sequence[int]], "NodeMotion | None"]

# Largest deviation of points from their positions in the rotated deck, relative to the size of the body [-].
# If points deviate more, the orientation of the body cannot be determined to within 0.1 degrees.
_MOST_BENT: Final = 0.05
# If the connected parts have at least this fraction of the body's mass, they alone define its frame [-].
_MOST: Final = 0.5
# Points are treated as collinear if their smallest moment of inertia is at most this fraction of the others [-].
_ALONG_LINE: Final = 1e-9
# Number of nodes that define the frame of a body; they are spread over the body, and more would hardly improve it.
_MOST_NODES: Final = 50


class Frame(NamedTuple):
    """Orientation of a body: ``axes`` (n, 3, 3) rotate directions in the deck to the directions at each time.

    ``doubt`` is the angle by which bending of the body may turn its frame between two times [rad].
    """

    axes: Samples
    doubt: float


def fit_frame(deck: Samples, where: Samples, mass: Samples) -> Frame | None:
    """Fit the orientation of a body to the positions of its points.

    Parameters
    ----------
    deck : array of shape (points, 3)
        Positions in the deck [length].
    where : array of shape (n, points, 3)
        Positions over time [length].
    mass : array of shape (points,)
        Weights of the points.

    Returns
    -------
    Frame or None
        None if the points lie on a line, or deviate from a rotated deck by more than 5 % of their extent across it.
    """
    shape = deck - np.average(deck, axis=0, weights=mass)
    arms = where - np.average(where, axis=1, weights=mass)[:, np.newaxis]
    axes = _fit_orientations(shape, arms, mass)
    places = arms @ axes
    if _measure_bending(shape, places, mass) > _MOST_BENT:
        return None
    return Frame(axes, _estimate_doubt(shape, places - shape, mass))


def find_frame_of_nodes(
    parts: Sequence[int],
    placement: Placement,
    displacements: Displacements,
    time: Samples,
) -> Frame | None:
    """Find the orientation of parts (ids) at times (n,) from the written motion of their nodes.

    The result is None if the orientation is unknown or if the motion is not written at all these times.
    """
    coordinates = placement.find_watched_nodes(parts)
    stride = max(1, ceil(len(coordinates) / _MOST_NODES))
    spread_ids = list(coordinates)[::stride]
    motion = displacements(spread_ids)
    if motion is None or not _is_within(time, motion.time):
        return None
    deck = np.stack([coordinates[id_] for id_ in motion.ids])
    columns = motion.displacements.reshape(motion.time.size, -1)
    at_times = [np.interp(time, motion.time, column) for column in columns.T]
    moved = np.stack(at_times, axis=1).reshape(time.size, -1, 3)
    return fit_frame(deck, deck + moved, np.ones(len(deck)))


def _is_within(wanted: Samples, written: Samples) -> bool:
    """Return True if times (n,) lie within the span of the written times (k,), apart from rounding."""
    room = LAST_DIGIT * float(np.abs(wanted).max())
    return bool(written[0] <= wanted[0] + room and written[-1] >= wanted[-1] - room)


def choose_frame_parts(
    members: Sequence[int],
    moving: Sequence[int],
    parts: Sequence[Part],
    masses: Samples,
    placement: Placement,
) -> Sequence[int]:
    """Return the parts that define the frame of a body, i.e. connected parts that do not move relative to each other.

    ``members`` and ``moving`` are column indices of ``parts``, whose masses are ``masses`` (parts,).
    """
    still = [i for i in members if i not in moving]
    together = placement.hanging_together([parts[i].id for i in still])
    main = [i for i in still if parts[i].id in together]
    if masses[main].sum() >= _MOST * masses[list(members)].sum():
        return main
    return still


def _estimate_doubt(shape: Samples, bent: Samples, mass: Samples) -> float:
    """Estimate how much the rotation between two times varies when the parts of the frame are omitted one at a time.

    This is a jackknife estimate. The positions of the parts relative to their centre, shape (parts, 3), deviate from a
    rigid shape by ``bent`` (n, parts, 3). Two parts on a line do not determine an angle; the result is then 0.
    """
    count = mass.size
    # Without a part, the common centre moves away from it, which raises its term by the factor 1/(1 - m/M).
    raised_mass = mass * mass.sum() / (mass.sum() - mass)
    of_all = compute_second_moments(shape[np.newaxis], mass)
    of_part = np.einsum("p,pi,pj->pij", raised_mass, shape, shape)
    inertia_of_others = compute_inertia(of_all - of_part)
    inverse = np.linalg.pinv(inertia_of_others, rcond=_ALONG_LINE, hermitian=True)
    moment = raised_mass[:, np.newaxis] * np.cross(shape, bent)
    # Rotation of the frame at each time if one of the parts is omitted, shape (n, parts, 3).
    turned = np.einsum("pij,npj->npi", inverse, moment)
    variance = turned.var(axis=0).sum()
    return float(np.sqrt(2 * (count - 1) / count * variance))


def _fit_orientations(shape: Samples, where: Samples, mass: Samples) -> Samples:
    """Return the rotations (n, 3, 3) that best map a shape (parts, 3) to the positions ``where`` (n, parts, 3)."""
    covariance = np.einsum("p,npi,pj->nij", mass, where, shape)
    left_vectors, _, right_vectors = np.linalg.svd(covariance)
    mirrored = np.linalg.det(left_vectors @ right_vectors) < 0
    left_vectors[mirrored, :, 2] *= -1
    return np.asarray(left_vectors @ right_vectors)


def _measure_bending(shape: Samples, places: Samples, mass: Samples) -> float:
    """Return the rms deviation of points from a rigid shape, relative to its smallest radius of gyration [-].

    It is infinite if the points lie on a line.
    """
    moments = compute_second_moments(shape[np.newaxis], mass)[0] / mass.sum()
    *across, along = np.linalg.eigvalsh(moments).tolist()
    if sum(across) <= _ALONG_LINE * along:
        return np.inf
    deviation = np.einsum("p,npi->", mass, (places - shape) ** 2)
    all_masses = len(places) * mass.sum()
    return float(np.sqrt(deviation / (all_masses * sum(across))))


def compute_second_moments(places: Samples, mass: Samples) -> Samples:
    """Return the second mass moments of positions [mass * length^2]."""
    return np.asarray(np.einsum("p,npi,npj->nij", mass, places, places))


def compute_inertia(second: Samples) -> Samples:
    """Return the inertia tensor computed from the second moments (..., 3, 3)."""
    trace = np.trace(second, axis1=-2, axis2=-1)
    return np.asarray(trace[..., np.newaxis, np.newaxis] * np.eye(3) - second)
