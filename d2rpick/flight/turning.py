"""Compute how a body that is rigid from tr to td rotates away from the deformable body of the reference run.

Both keep their angular momentum L.  In the frame of the body, with the places y of its parts about the centre of mass
of all that flies, the tensor of inertia I and w = I^-1 L,

    deformable:  w = I(t)^-1 (L - h),  h = sum m y x dy/dt        rigid:  w = I(tr)^-1 L.

To first order in their difference psi, an angle,

    dpsi/dt + w x psi + I^-1 (psi x L) = I^-1 [(I(t) - I(tr)) w + h],

where of I(t) - I(tr) and h only the parts count that become rigid.  It is linear, so that one pass over the flight
serves every tr and td.  Parts are points with an inertia of their own that turns with the body: a part that rocks on
its mounts is not seen.  Places come from where the deck puts the parts, and their momenta since.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.samples import find_window, integrate_by_trapezia

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from d2rpick.deck.geometry import Placement
    from d2rpick.histories.history import Momenta, Samples

# Largest deviation of the parts from their positions in the rotated deck, relative to the size of the body.
# A body that is bent more, or placed elsewhere, has no orientation to 0.1 degrees.
_MOST_BENT: Final = 0.05
# Largest number of states in the integration. Positions are interpolated linearly: vibration hardly rotates a body.
_STATES: Final = 2000
# Connected parts define the body frame if they have this share of its mass, else all parts that do not move.
_MOST: Final = 0.5
# The final angular velocity is the mean over the last 1/10 of the flight, which averages out the vibration.
_LAST: Final = 10
# Parts are treated as lying on a line if one moment of inertia is below this share of the others.
_ALONG_LINE: Final = 1e-9


class Turning(NamedTuple):
    """Rotation of a body, from one integration over a flight: arrays over ``time`` (n,), in the frame of the body.

    ``place`` (n, 3) is the body's displacement against the centre of mass of all flying parts, as far as the parts that
    become rigid cause it; ``arm`` (n, 3) leads from there to the points where errors are evaluated [length];
    ``inertia`` (n, 3, 3) belongs to those parts; ``carried`` (n, 3, 3), ``pushed`` (n, 3) and ``kept`` (n, 3, 3, 3)
    solve the equation of psi.  ``doubt`` is the angle by which bending of the body turns its frame from one time to
    another [rad].  ``nodes`` (k, 3) are those of the parts that become rigid at the last time, against the centre of
    mass [length], and ``rate`` (3,) is the angular velocity there [rad/time]; both have the axes of the deck.
    """

    time: Samples
    place: Samples
    arm: Samples
    inertia: Samples
    carried: Samples
    pushed: Samples
    kept: Samples
    doubt: float
    nodes: Samples
    rate: Samples

    def compute_speed_at_front(self, direction: Samples) -> float:
        """Return the speed along a unit vector (3,) that the rotation gives to the node farthest along it.

        That node touches a plane ahead first, at the last time; its whole speed is that of the centre of mass and this
        one [length/time].
        """
        front = self.nodes[int(np.argmax(self.nodes @ direction))]
        return float(np.cross(self.rate, front) @ direction)

    def angles(self, tr: Samples, td: float) -> Samples:
        """Return the rotation errors psi at td of a body that is rigid from ``tr`` (k,) on, (k, 3) [rad]."""
        pushed, kept_turn = (
            _interpolate_at(self.time, turn, np.array([td]))
            - _interpolate_at(self.time, turn, tr)
            for turn in (self.pushed, self.kept)
        )
        turned = pushed - np.einsum(
            "kaij,kij->ka", kept_turn, _interpolate_at(self.time, self.inertia, tr)
        )
        return np.asarray(
            turned @ _interpolate_at(self.time, self.carried, np.array([td]))[0].T
        )

    def offsets(self, tr: Samples, td: float) -> Samples:
        """Return the displacements of a body that is rigid from ``tr`` on, (k, 3) in its own frame [length]."""
        at_td = np.array([td])
        slid = _interpolate_at(self.time, self.place, at_td) - _interpolate_at(
            self.time, self.place, tr
        )
        return np.asarray(
            slid
            + np.cross(self.angles(tr, td), _interpolate_at(self.time, self.arm, at_td))
        )


class Flying(NamedTuple):
    """Parts in a flight from ``start`` to ``end`` [time]: part ``momenta`` and ``masses`` (parts,).

    A mass is NaN if it is unknown.  ``members`` are the columns of the parts that become one rigid body, ``others``
    those of all parts that fly with them, which the moving parts displace too.
    """

    momenta: Momenta
    masses: Samples
    members: Sequence[int]
    start: float
    end: float
    others: Collection[int] = ()


def follow_turning(
    seen: Flying, moving: Sequence[int], placement: Placement
) -> Turning | None:
    """Follow the orientation of the body of given parts, from the deck positions of all flying parts.

    ``moving`` are the columns of the parts that move against the others.  None if a mass or a place is unknown, the
    record does not begin with the run, or the parts of the body do not determine its orientation.
    """
    momenta = seen.momenta
    masses = seen.masses
    assert momenta.parts is not None
    all_members = sorted(i for i in {*seen.others, *seen.members} if masses[i] != 0)
    placed = {i: placement.parts.get(momenta.parts[i].id) for i in all_members}
    placed_parts = [part_place for part_place in placed.values() if part_place]
    time = momenta.time
    mass = masses[all_members]
    if (
        len(placed_parts) < len(all_members)
        or not np.isfinite(mass).all()
        or time[0] > time[1] - time[0]
    ):
        return None
    velocity = momenta.values[:, all_members] / mass[:, np.newaxis]
    centre = np.stack([part_place.centre for part_place in placed_parts])
    since = integrate_by_trapezia(time, velocity.reshape(time.size, -1)).reshape(
        velocity.shape
    )
    inside = find_window(time, seen.start, seen.end)
    stride = -(-(inside.stop - inside.start) // _STATES)
    body = _choose_frame_parts(seen, moving, placement)
    where = (centre + velocity[0] * time[0] + since)[inside][::stride]
    at = {i: place for place, i in enumerate(all_members)}
    rigid = [at[i] for i in seen.members]
    part = [at[i] for i in body]
    where = where - _weigh_by_mass(where, mass)[:, np.newaxis]
    home = _weigh_by_mass(centre[part], mass[part])
    shape = centre[part] - home
    middle = _weigh_by_mass(where[:, part], mass[part])
    frames = _fit_orientations(
        shape, where[:, part] - middle[:, np.newaxis], mass[part]
    )
    places = where @ frames
    middle = np.einsum("ni,nij->nj", middle, frames)
    if (
        _measure_bending(shape, places[:, part] - middle[:, np.newaxis], mass[part])
        > _MOST_BENT
    ):
        return None
    own_inertia = _compute_inertia(
        np.einsum(
            "p,pij->ij",
            mass,
            np.stack([part_place.spread for part_place in placed_parts]),
        )
    )
    inertia = _compute_inertia(_compute_second_moments(places, mass)) + own_inertia
    spin = _integrate_spin(places, mass)
    moving_inertia = _compute_inertia(
        _compute_second_moments(places[:, rigid], mass[rigid])
    )
    time = time[inside][::stride]
    solved = _solve_turning(
        time,
        frames,
        (inertia, spin),
        (moving_inertia, _integrate_spin(places[:, rigid], mass[rigid])),
    )
    column = (
        np.einsum("p,npi->ni", mass[rigid], places[:, rigid] - middle[:, np.newaxis])
        / mass.sum()
    )
    doubt = _estimate_doubt(
        shape, places[:, part] - middle[:, np.newaxis] - shape, mass[part]
    )
    looked_at = placement.watched_centre(
        momenta.parts[i].id for i in body
    )  # positions of the parts according to the deck
    arm = middle + (0.0 if looked_at is None else looked_at - home)
    nodes = placement.find_nodes([momenta.parts[i].id for i in seen.members])
    nodes = (nodes - home + middle[-1]) @ frames[-1].T
    return Turning(
        time,
        column,
        arm,
        moving_inertia,
        *solved,
        doubt,
        nodes,
        _compute_last_rate(time, frames),
    )


def _compute_last_rate(time: Samples, frames: Samples) -> Samples:
    """Return the mean angular velocity (3,) of frames (n, 3, 3) over the last tenth of the times (n,) [rad/time]."""
    count = max(1, (time.size - 1) // _LAST)
    turned = _compute_turns(frames[-count - 1 :]).sum(axis=0)
    return np.asarray(frames[-1] @ turned / (time[-1] - time[-count - 1]))


def _choose_frame_parts(
    seen: Flying, moving: Sequence[int], placement: Placement
) -> Sequence[int]:
    """Return the parts that define the body frame: connected parts that do not move relative to each other."""
    parts = seen.momenta.parts or ()
    still = [i for i in seen.members if i not in moving]
    together = placement.hanging_together([parts[i].id for i in still])
    main = [i for i in still if parts[i].id in together]
    if seen.masses[main].sum() >= _MOST * seen.masses[list(seen.members)].sum():
        return main
    return still


def _estimate_doubt(shape: Samples, bent: Samples, mass: Samples) -> float:
    """Return how much the rotation between two times changes if each frame part is left out in turn.

    Parts about their centre, (parts, 3), deviate from their shape by ``bent`` (n, parts, 3) (jackknife); two parts on a
    line determine no angle and give 0.
    """
    count = mass.size
    alone = mass * mass.sum() / (mass.sum() - mass)
    other_inertia = _compute_second_moments(shape[np.newaxis], mass) - np.einsum(
        "p,pi,pj->pij", alone, shape, shape
    )
    light = np.linalg.pinv(
        _compute_inertia(other_inertia), rcond=_ALONG_LINE, hermitian=True
    )
    turned = np.einsum(
        "pij,npj->npi", light, alone[:, np.newaxis] * np.cross(shape, bent)
    )
    return float(np.sqrt(2 * (count - 1) / count * turned.var(axis=0).sum()))


def _solve_turning(
    time: Samples,
    frames: Samples,
    whole: tuple[Samples, Samples],
    moving: tuple[Samples, Samples],
) -> tuple[Samples, Samples, Samples]:
    """Solve the equation of psi: return its propagation matrix, its particular solution, and the effect of I(tr)."""
    (inertia, spin), steps = whole, np.diff(time)
    swept = (
        np.einsum("nij,nj->ni", _take_middle_values(inertia), _compute_turns(frames))
        + spin
    )
    kept_rate = (
        np.einsum("nij,nj->i", _take_middle_values(frames), swept) / steps.sum()
    )  # angular momentum in the fixed frame
    momentum = kept_rate @ frames  # angular momentum in the frame of the body
    light = np.linalg.inv(inertia.mean(axis=0))
    rate = momentum @ light
    carried = _integrate_matrix(
        time, light @ _make_cross_matrices(momentum) - _make_cross_matrices(rate)
    )
    back = (
        _take_middle_values(np.asarray(np.linalg.inv(carried), dtype=np.float64))
        @ light
    )
    dragged = (
        np.einsum(
            "nij,nj->ni", _take_middle_values(moving[0]), _take_middle_values(rate)
        )
        * steps[:, np.newaxis]
        + moving[1]
    )
    pushed = np.einsum("nij,nj->ni", back, dragged)
    per_inertia = (
        back[..., np.newaxis]
        * (_take_middle_values(rate) * steps[:, np.newaxis])[:, np.newaxis, np.newaxis]
    )
    return carried, _sum_running(pushed), _sum_running(per_inertia)


def _integrate_matrix(time: Samples, slope: Samples) -> Samples:
    """Return the solution (n, 3, 3) of X' = slope X that starts from the unit matrix."""
    rotations = [np.eye(3)]
    unit = np.eye(3)
    for step in _take_middle_values(slope) * np.diff(time)[:, np.newaxis, np.newaxis]:
        rotations.append((unit + step + step @ step / 2) @ rotations[-1])
    return np.stack(rotations)


def _fit_orientations(shape: Samples, where: Samples, mass: Samples) -> Samples:
    """Return the rotations (n, 3, 3) that best map a shape (parts, 3) to the positions ``where`` (n, parts, 3)."""
    left_vectors, _, right_vectors = np.linalg.svd(
        np.einsum("p,npi,pj->nij", mass, where, shape)
    )
    mirrored = np.linalg.det(left_vectors @ right_vectors) < 0
    left_vectors[mirrored, :, 2] *= -1
    return np.asarray(left_vectors @ right_vectors)


def _measure_bending(shape: Samples, places: Samples, mass: Samples) -> float:
    """Return the deviation of parts from their shape, relative to its size across its longest axis."""
    least_extent = (
        np.linalg.eigvalsh(_compute_second_moments(shape[np.newaxis], mass)[0])[
            :2
        ].sum()
        / mass.sum()
    )
    across = np.sqrt(max(0.0, float(least_extent)))
    deviation = np.sqrt(
        np.einsum("p,npi->", mass, (places - shape) ** 2) / (len(places) * mass.sum())
    )
    return float(deviation / across) if across > 0 else np.inf


def _compute_turns(frames: Samples) -> Samples:
    """Return the rotation from each frame to the next, (n - 1, 3) [rad], for small angles."""
    between = frames[:-1].transpose(0, 2, 1) @ frames[1:]
    odd = (between - between.transpose(0, 2, 1)) / 2
    sine = np.stack([odd[:, 2, 1], odd[:, 0, 2], odd[:, 1, 0]], axis=1)
    size = np.linalg.norm(sine, axis=1, keepdims=True)
    return np.asarray(
        sine
        * np.where(
            size > 0,
            np.arcsin(np.minimum(size, 1.0)) / np.where(size > 0, size, 1.0),
            1.0,
        )
    )


def _weigh_by_mass(values: Samples, mass: Samples) -> Samples:
    """Return the mass-weighted mean of values."""
    return np.asarray(np.einsum("p,...pi->...i", mass, values) / mass.sum())


def _compute_second_moments(places: Samples, mass: Samples) -> Samples:
    """Return the second mass moments of positions."""
    return np.asarray(np.einsum("p,npi,npj->nij", mass, places, places))


def _compute_inertia(second: Samples) -> Samples:
    """Return the inertia tensor from the second moments (..., 3, 3)."""
    return np.asarray(
        np.trace(second, axis1=-2, axis2=-1)[..., np.newaxis, np.newaxis] * np.eye(3)
        - second
    )


def _integrate_spin(places: Samples, mass: Samples) -> Samples:
    """Return the parts' angular momentum integrated over each step (twice the swept areas), shape (n - 1, 3)."""
    return np.asarray(np.einsum("p,npi->ni", mass, np.cross(places[:-1], places[1:])))


def _make_cross_matrices(vectors: Samples) -> Samples:
    """Return the cross-product matrices (n, 3, 3): matrix i times u is the cross product of ``vectors[i]`` and u."""
    return np.asarray(np.cross(vectors[:, np.newaxis], np.eye(3)).transpose(0, 2, 1))


def _take_middle_values(values: Samples) -> Samples:
    """Return the mean of the values at both ends of each step."""
    return np.asarray((values[1:] + values[:-1]) / 2)


def _sum_running(steps: Samples) -> Samples:
    """Return the running sum over steps, which starts at 0."""
    return np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])


def _interpolate_at(time: Samples, values: Samples, when: Samples) -> Samples:
    """Return values (n, ...) at times (k,), linear between samples."""
    next_state = np.clip(np.searchsorted(time, when), 1, time.size - 1)
    share = (when - time[next_state - 1]) / (time[next_state] - time[next_state - 1])
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[next_state - 1] * (1 - share) + values[next_state] * share)
