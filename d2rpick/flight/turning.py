"""Compute how a body that is rigid from tr to td rotates away from the deformable body of the reference run.

Both keep their angular momentum L.  In the frame of the body, with the places y of its parts about the centre of mass
of all that flies, the tensor of inertia I and w = I^-1 L,

    deformable:  w = I(t)^-1 (L - h),  h = sum m y x dy/dt        rigid:  w = I(tr)^-1 L.

To first order in their difference psi, an angle,

    dpsi/dt + w x psi + I^-1 (psi x L) = I^-1 [(I(t) - I(tr)) w + h],

where of I(t) - I(tr) and h only the parts count that become rigid.  It is linear, so that one pass over the flight
serves every tr and td.  Parts are points with an inertia of their own that turns with the body: a part that rocks on
its mounts is not seen.  Places come from where the deck puts the parts, and their momenta since.  If the parts of the
body lie on a line, or the record begins later than the run, nodes whose motion is written show the frame.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.body_frame import (
    choose_frame_parts,
    compute_inertia,
    compute_second_moments,
    find_frame_of_nodes,
    fit_frame,
)
from d2rpick.histories.samples import find_window, integrate_by_trapezia

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from d2rpick.deck.geometry import Placement
    from d2rpick.flight.body_frame import Displacements
    from d2rpick.histories.history import Momenta, Samples

# Largest number of states in the integration, which suffices because vibration hardly rotates a body.
_STATES: Final = 2000
# Inverse of the fraction of the flight over which the final angular velocity is averaged, to remove vibration [-].
_LAST: Final = 10


class Turning(NamedTuple):
    """Rotation of a body, from one integration over a flight: arrays over ``time`` (n,), in the frame of the body.

    ``place`` (n, 3) is the body's displacement against the centre of mass of all flying parts, as far as the parts that
    become rigid cause it; ``arm`` (n, 3) leads from there to the points where errors are evaluated [length];
    ``inertia`` (n, 3, 3) belongs to those parts; ``carried`` (n, 3, 3), ``pushed`` (n, 3) and ``kept`` (n, 3, 3, 3)
    solve the equation of psi.  ``doubt`` is the angle by which bending of the body turns its frame from one time to
    another [rad].  ``nodes`` (k, 3) are those of the parts that become rigid at the last time, against the centre of
    mass [length], and ``rate`` (3,) is the angular velocity there [rad/time]; both have the axes of the deck, to which
    ``frame`` (3, 3) rotates those of the body.
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
    frame: Samples
    rate: Samples

    def compute_speed_at_front(self, direction: Samples) -> float:
        """Return the speed along a unit vector (3,) that the rotation gives to the node farthest along the vector.

        That node touches a plane ahead first, at the last time; its whole speed is that of the centre of mass and this
        one [length/time].
        """
        front = self._find_front(direction)
        return float(np.cross(self.rate, front) @ direction)

    def errors_at_front(self, tr: Samples, direction: Samples) -> Samples:
        """Return the position error at the last time of the node that is then farthest along a unit vector (3,).

        The body is rigid from ``tr`` (k,) to the last time; the result has shape (k,) [length].
        """
        last = float(self.time[-1])
        slid = self._compute_slides(tr, last)
        front = self._find_front(direction) @ self.frame
        moved = slid + np.cross(self.angles(tr, last), front)
        return np.asarray(np.linalg.norm(moved, axis=1))

    def _find_front(self, direction: Samples) -> Samples:
        """Return the coordinates (3,) of the node that lies farthest in a given direction, a unit vector [length]."""
        return np.asarray(self.nodes[int(np.argmax(self.nodes @ direction))])

    def angles(self, tr: Samples, td: float) -> Samples:
        """Return the rotation errors psi at td of a body that is rigid since ``tr`` (k,), shape (k, 3) [rad]."""
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
        """Return the displacements (k, 3) of a body that is rigid since ``tr`` (k,), in the body frame [length]."""
        arm = _interpolate_at(self.time, self.arm, np.array([td]))
        return np.asarray(
            self._compute_slides(tr, td) + np.cross(self.angles(tr, td), arm)
        )

    def _compute_slides(self, tr: Samples, td: float) -> Samples:
        """Return the displacements (k, 3) from ``tr`` to td without the part due to rotation, in the body frame."""
        at_td = _interpolate_at(self.time, self.place, np.array([td]))
        return np.asarray(at_td - _interpolate_at(self.time, self.place, tr))


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
    seen: Flying,
    moving: Sequence[int],
    placement: Placement,
    displacements: Displacements | None = None,
) -> Turning | None:
    """Follow the orientation of the body of given parts, from the deck positions of all flying parts.

    ``moving`` are the columns of the parts that move against the others.  None if a mass or a place is unknown, or
    neither the parts of the body nor nodes whose ``displacements`` are written determine its orientation.
    """
    momenta = seen.momenta
    masses = seen.masses
    assert momenta.parts is not None
    all_members = sorted(i for i in {*seen.others, *seen.members} if masses[i] != 0)
    placed = {i: placement.parts.get(momenta.parts[i].id) for i in all_members}
    placed_parts = [part_place for part_place in placed.values() if part_place]
    mass = masses[all_members]
    if len(placed_parts) < len(all_members) or not np.isfinite(mass).all():
        return None
    inside = find_window(momenta.time, seen.start, seen.end)
    stride = -(-(inside.stop - inside.start) // _STATES)
    time = momenta.time[inside][::stride]
    centre = np.stack([part_place.centre for part_place in placed_parts])
    since = _integrate_velocities(momenta, all_members, mass)[inside][::stride]
    body = choose_frame_parts(seen.members, moving, momenta.parts, masses, placement)
    at = {i: place for place, i in enumerate(all_members)}
    rigid = [at[i] for i in seen.members]
    part = [at[i] for i in body]
    home = _weigh_by_mass(centre[part], mass[part])
    where = None
    frame = None
    if momenta.time[0] <= momenta.time[1] - momenta.time[0]:
        where = centre + since
        frame = fit_frame(centre[part], where[:, part], mass[part])
    if frame is None and displacements is not None:
        ids = [momenta.parts[i].id for i in body]
        frame = find_frame_of_nodes(ids, placement, displacements, time)
    if frame is None:
        return None
    if where is None:
        where = _place_by_frames(centre, since, frame.axes)
    frames = frame.axes
    places = (where - _weigh_by_mass(where, mass)[:, np.newaxis]) @ frames
    middle = _weigh_by_mass(places[:, part], mass[part])
    own_inertia = compute_inertia(
        np.einsum(
            "p,pij->ij",
            mass,
            np.stack([part_place.spread for part_place in placed_parts]),
        )
    )
    inertia = compute_inertia(compute_second_moments(places, mass)) + own_inertia
    spin = _integrate_spin(places, mass)
    moving_inertia = compute_inertia(
        compute_second_moments(places[:, rigid], mass[rigid])
    )
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
    looked_at = placement.watched_centre(
        momenta.parts[i].id for i in body
    )  # Centre of the parts according to the deck [length].
    arm = middle + (0.0 if looked_at is None else looked_at - home)
    nodes = placement.find_nodes([momenta.parts[i].id for i in seen.members])
    nodes = (nodes - home + middle[-1]) @ frames[-1].T
    return Turning(
        time,
        column,
        arm,
        moving_inertia,
        *solved,
        frame.doubt,
        nodes,
        frames[-1],
        _compute_last_rate(time, frames),
    )


def _integrate_velocities(
    momenta: Momenta, members: Sequence[int], mass: Samples
) -> Samples:
    """Return how far the parts in these columns have moved since the run began, shape (n, parts, 3) [length].

    The velocity before the first state is the one of that state.
    """
    velocity = momenta.values[:, members] / mass[:, np.newaxis]
    time = momenta.time
    since = integrate_by_trapezia(time, velocity.reshape(time.size, -1))
    return np.asarray(velocity[0] * time[0] + since.reshape(velocity.shape))


def _place_by_frames(centre: Samples, since: Samples, frames: Samples) -> Samples:
    """Return the positions (n, parts, 3) of parts in a record within the run, up to a common displacement.

    Their motion ``since`` (n, parts, 3) is known.  In the mean over the flight each part is where the deck puts it in
    the frame of the body: a part that vibrates on its mounts does so about its place.
    """
    in_frame = np.einsum("nij,pj->npi", frames, centre)
    return np.asarray(since + (in_frame - since).mean(axis=0))


def _compute_last_rate(time: Samples, frames: Samples) -> Samples:
    """Return the mean angular velocity (3,) of frames (n, 3, 3) over the last tenth of the times (n,) [rad/time]."""
    count = max(1, (time.size - 1) // _LAST)
    turned = _compute_turns(frames[-count - 1 :]).sum(axis=0)
    return np.asarray(frames[-1] @ turned / (time[-1] - time[-count - 1]))


def _solve_turning(
    time: Samples,
    frames: Samples,
    whole: tuple[Samples, Samples],
    moving: tuple[Samples, Samples],
) -> tuple[Samples, Samples, Samples]:
    """Solve the equation of the rotation error psi; return propagation matrix, particular solution, inertia effect."""
    (inertia, spin), steps = whole, np.diff(time)
    swept = (
        np.einsum("nij,nj->ni", _take_middle_values(inertia), _compute_turns(frames))
        + spin
    )
    kept_rate = (
        np.einsum("nij,nj->i", _take_middle_values(frames), swept) / steps.sum()
    )  # Angular momentum in the fixed frame of reference.
    # Angular momentum in the frame of the body.
    momentum = kept_rate @ frames
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


def _compute_turns(frames: Samples) -> Samples:
    """Return the rotation from each frame to the next, shape (n - 1, 3) [rad], for small angles."""
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
    """Return values (n, ...) at times (k,), interpolated linearly."""
    next_state = np.clip(np.searchsorted(time, when), 1, time.size - 1)
    share = (when - time[next_state - 1]) / (time[next_state] - time[next_state - 1])
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[next_state - 1] * (1 - share) + values[next_state] * share)
