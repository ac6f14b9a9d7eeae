"""Compute how a body that is rigid from tr to td rotates relative to the deformable body of the reference run.

Both bodies keep their angular momentum L. In the frame of the body, let y be the positions of its parts relative to the
centre of mass of all flying parts, I the inertia tensor, and w = I^-1 L. The angular velocities are

    deformable:  w = I(t)^-1 (L - h),  h = sum m y x dy/dt        rigid:  w = I(tr)^-1 L.

To first order, the angle psi between both bodies obeys

    dpsi/dt + w x psi + I^-1 (psi x L) = I^-1 [(I(t) - I(tr)) w + h],

where I(t) - I(tr) and h contain only the parts that become rigid. The equation is linear, so it is integrated once over
the flight for all tr and td. Parts are points with inertias that rotate with the body, so a part that rocks on its
mounts is not detected. Positions are those in the deck plus the integrals of the part velocities. If the parts of the
body lie on a line, or if the record does not begin with the run, nodes whose motion is written determine the frame.
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
    from d2rpick.flight.body_frame import Displacements, Frame
    from d2rpick.histories.history import Momenta, Samples

# Largest number of states in the integration; they suffice, because vibration hardly rotates a body.
_STATES: Final = 2000
# The final angular velocity is averaged over 1/_LAST of the flight, which removes vibration [-].
_LAST: Final = 10


class Turning(NamedTuple):
    """Rotation of a body, integrated over a flight: arrays over ``time`` (n,), in the frame of the body.

    ``place`` (n, 3) is the displacement of the body relative to the centre of mass of all flying parts, as far as the
    parts that become rigid cause it [length]. ``arm`` (n, 3) leads from there to the points at which errors are
    evaluated [length]. ``inertia`` (n, 3, 3) is that of the parts that become rigid. ``carried`` (n, 3, 3), ``pushed``
    (n, 3) and ``kept`` (n, 3, 3, 3) are the solution of the equation of psi. ``doubt`` is the angle by which bending of
    the body may turn its frame between two times [rad]. ``nodes`` (k, 3) are the positions of the nodes of these parts
    at the last time, relative to the centre of mass [length]. ``rate`` (3,) is the angular velocity at the last time
    [rad/time]. Both refer to the axes of the deck, to which ``frame`` (3, 3) rotates the axes of the body.
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
        """Return the speed along a unit vector (3,) that the rotation gives to the node farthest along this vector.

        At the last time, this node is the first to touch a plane ahead. Its total speed is that of the centre of mass
        plus the result [length/time].
        """
        front = self._find_front(direction)
        return float(np.cross(self.rate, front) @ direction)

    def errors_at_front(self, tr: Samples, direction: Samples) -> Samples:
        """Return the position error at the last time for the node that is then farthest along a unit vector (3,).

        The body is rigid from ``tr`` (k,) to the last time; the result has shape (k,) [length].
        """
        last = float(self.time[-1])
        slid = self._compute_slides(tr, last)
        front_in_body = self._find_front(direction) @ self.frame
        turned = np.cross(self.angles(tr, last), front_in_body)
        return np.asarray(np.linalg.norm(slid + turned, axis=1))

    def _find_front(self, direction: Samples) -> Samples:
        """Return the coordinates (3,) of the node that lies farthest in the direction of a unit vector [length]."""
        return np.asarray(self.nodes[int(np.argmax(self.nodes @ direction))])

    def angles(self, tr: Samples, td: float) -> Samples:
        """Return the rotation errors psi at td of a body that has been rigid since ``tr`` (k,), shape (k, 3) [rad]."""
        pushed = self._compute_increase(self.pushed, tr, td)
        per_inertia = self._compute_increase(self.kept, tr, td)
        inertia = _interpolate_at(self.time, self.inertia, tr)
        kept = np.einsum("kaij,kij->ka", per_inertia, inertia)
        # The particular solution refers to the first state; the propagation matrix carries it to td.
        carried = _interpolate_at(self.time, self.carried, np.array([td]))[0]
        return np.asarray((pushed - kept) @ carried.T)

    def _compute_increase(self, values: Samples, tr: Samples, td: float) -> Samples:
        """Return by how much values (n, ...) increase from each ``tr`` (k,) to td, shape (k, ...)."""
        at_td = _interpolate_at(self.time, values, np.array([td]))
        at_tr = _interpolate_at(self.time, values, tr)
        return np.asarray(at_td - at_tr)

    def offsets(self, tr: Samples, td: float) -> Samples:
        """Return the displacements (k, 3) of a body that is rigid from ``tr`` (k,) on, in the body frame [length]."""
        arm = _interpolate_at(self.time, self.arm, np.array([td]))
        slid = self._compute_slides(tr, td)
        turned = np.cross(self.angles(tr, td), arm)
        return np.asarray(slid + turned)

    def _compute_slides(self, tr: Samples, td: float) -> Samples:
        """Return the displacements (k, 3) from ``tr`` to td [length], without rotation, in the body frame."""
        return self._compute_increase(self.place, tr, td)


class Flying(NamedTuple):
    """Parts in a flight from ``start`` to ``end`` [time]: part ``momenta`` and ``masses`` (parts,).

    A mass is NaN if it is unknown. ``members`` contains the columns of the parts that become one rigid body. ``others``
    contains those of all parts that fly with them, because the moving parts displace these parts, too.
    """

    momenta: Momenta
    masses: Samples
    members: Sequence[int]
    start: float
    end: float
    others: Collection[int] = ()


class _FlyingParts(NamedTuple):
    """Flying parts whose masses and positions in the deck are known.

    ``columns`` contains their columns in the momenta. ``masses`` (parts,), ``centres`` (parts, 3) [length] and
    ``spreads`` (parts, 3, 3) have the same order; ``spreads`` contains the second moments about the centre per unit
    mass [length^2].
    """

    columns: list[int]
    masses: Samples
    centres: Samples
    spreads: Samples

    def find_rows(self, columns: Sequence[int]) -> list[int]:
        """Return the indices of these parts' array rows that belong to the given momentum columns."""
        rows = {column: row for row, column in enumerate(self.columns)}
        return [rows[column] for column in columns]


class _BodyMotion(NamedTuple):
    """Motion of the flying parts at times ``time`` (n,): the body ``frame``, and the ``places`` (n, parts, 3) in it.

    The places are relative to the centre of mass of all flying parts [length].
    """

    time: Samples
    frame: Frame
    places: Samples


class _Rotor(NamedTuple):
    """The rotating parts in the body frame: ``inertia`` (n, 3, 3), and ``spin`` (n - 1, 3) between states.

    The spin is the angular momentum in this frame, integrated over each step.
    """

    inertia: Samples
    spin: Samples


def follow_turning(
    seen: Flying,
    moving: Sequence[int],
    placement: Placement,
    displacements: Displacements | None = None,
) -> Turning | None:
    """Follow the orientation of the body that the given parts form, from the deck positions of all flying parts.

    ``moving`` contains the columns of the parts that move relative to the others. The result is None if a mass or a
    position is unknown, or if neither the parts of the body nor nodes whose ``displacements`` are written determine its
    orientation.
    """
    momenta = seen.momenta
    assert momenta.parts is not None
    flying = _locate_flying_parts(seen, placement)
    if flying is None:
        return None
    masses = flying.masses
    frame_columns = choose_frame_parts(
        seen.members, moving, momenta.parts, seen.masses, placement
    )
    motion = _follow_parts(seen, flying, frame_columns, placement, displacements)
    if motion is None:
        return None
    time, frame, places = motion

    own_inertia = compute_inertia(np.einsum("p,pij->ij", masses, flying.spreads))
    point_inertia = compute_inertia(compute_second_moments(places, masses))
    everything = _Rotor(point_inertia + own_inertia, _integrate_spin(places, masses))
    rigid_rows = flying.find_rows(seen.members)
    rigid_places, rigid_masses = places[:, rigid_rows], masses[rigid_rows]
    rigid = _Rotor(
        compute_inertia(compute_second_moments(rigid_places, rigid_masses)),
        _integrate_spin(rigid_places, rigid_masses),
    )
    carried, pushed, kept = _solve_turning(time, frame.axes, everything, rigid)

    # The centre of the parts that define the frame is needed both in the frame and in the deck.
    frame_rows = flying.find_rows(frame_columns)
    frame_centre = _weigh_by_mass(places[:, frame_rows], masses[frame_rows])
    deck_centre = _weigh_by_mass(flying.centres[frame_rows], masses[frame_rows])
    mass_times_shift = np.einsum(
        "p,npi->ni", rigid_masses, rigid_places - frame_centre[:, np.newaxis]
    )
    arm = frame_centre
    watched_centre = placement.watched_centre(
        momenta.parts[column].id for column in frame_columns
    )
    if watched_centre is not None:
        arm = frame_centre + (watched_centre - deck_centre)
    nodes = placement.find_nodes([momenta.parts[i].id for i in seen.members])
    nodes_at_end = (nodes - deck_centre + frame_centre[-1]) @ frame.axes[-1].T
    return Turning(
        time=time,
        place=mass_times_shift / masses.sum(),
        arm=arm,
        inertia=rigid.inertia,
        carried=carried,
        pushed=pushed,
        kept=kept,
        doubt=frame.doubt,
        nodes=nodes_at_end,
        frame=frame.axes[-1],
        rate=_compute_last_rate(time, frame.axes),
    )


def _follow_parts(
    seen: Flying,
    flying: _FlyingParts,
    frame_columns: Sequence[int],
    placement: Placement,
    displacements: Displacements | None,
) -> _BodyMotion | None:
    """Follow the frame of the body and the flying parts in it; None if nothing determines the frame."""
    momenta = seen.momenta
    assert momenta.parts is not None
    frame_ids = [momenta.parts[column].id for column in frame_columns]
    frame_rows = flying.find_rows(frame_columns)
    masses = flying.masses
    inside = find_window(momenta.time, seen.start, seen.end)
    stride = -(-(inside.stop - inside.start) // _STATES)
    time = momenta.time[inside][::stride]
    travel = _integrate_velocities(momenta, flying.columns, masses)[inside][::stride]

    # If the record begins with the run, the parts start at their deck positions and have moved by their travel.
    frame = None
    begins_with_run = momenta.time[0] <= momenta.time[1] - momenta.time[0]
    positions = flying.centres + travel
    if begins_with_run:
        frame = fit_frame(
            flying.centres[frame_rows], positions[:, frame_rows], masses[frame_rows]
        )
    if frame is None and displacements is not None:
        frame = find_frame_of_nodes(frame_ids, placement, displacements, time)
    if frame is None:
        return None
    if not begins_with_run:
        positions = _place_by_frames(flying.centres, travel, frame.axes)
    centre_of_mass = _weigh_by_mass(positions, masses)
    places = (positions - centre_of_mass[:, np.newaxis]) @ frame.axes
    return _BodyMotion(time, frame, places)


def _locate_flying_parts(seen: Flying, placement: Placement) -> _FlyingParts | None:
    """Find the parts that have a mass in the deck; None if a mass is unknown or the deck lacks a part."""
    momenta = seen.momenta
    assert momenta.parts is not None
    columns = sorted(
        column for column in {*seen.others, *seen.members} if seen.masses[column] != 0
    )
    part_places = [placement.parts.get(momenta.parts[column].id) for column in columns]
    known_places = [part_place for part_place in part_places if part_place]
    masses = seen.masses[columns]
    if len(known_places) < len(columns) or not np.isfinite(masses).all():
        return None
    return _FlyingParts(
        columns,
        masses,
        np.stack([part_place.centre for part_place in known_places]),
        np.stack([part_place.spread for part_place in known_places]),
    )


def _integrate_velocities(
    momenta: Momenta, members: Sequence[int], mass: Samples
) -> Samples:
    """Return how far the parts in these columns have moved since the start of the run, shape (n, parts, 3) [length].

    The velocity before the first state is assumed to be that of the first state.
    """
    time = momenta.time
    velocity = momenta.values[:, members] / mass[:, np.newaxis]
    before = velocity[0] * time[0]
    columns = velocity.reshape(time.size, -1)
    since_first_state = integrate_by_trapezia(time, columns)
    return np.asarray(before + since_first_state.reshape(velocity.shape))


def _place_by_frames(centre: Samples, since: Samples, frames: Samples) -> Samples:
    """Return the positions of parts during a section of the run, up to a common displacement, shape (n, parts, 3).

    ``since`` (n, parts, 3) is the motion of the parts since the start of the section. The mean position of each part
    over the flight, in the frame of the body, is assumed to be its position in the deck, because a part on mounts
    vibrates about it.
    """
    in_frame = np.einsum("nij,pj->npi", frames, centre)
    return np.asarray(since + (in_frame - since).mean(axis=0))


def _compute_last_rate(time: Samples, frames: Samples) -> Samples:
    """Return the mean angular velocity (3,) of frames (n, 3, 3) over the last tenth of the times (n,) [rad/time]."""
    step_count = max(1, (time.size - 1) // _LAST)
    first = -step_count - 1
    turned_in_body = _compute_turns(frames[first:]).sum(axis=0)
    turned = frames[-1] @ turned_in_body
    duration = time[-1] - time[first]
    return np.asarray(turned / duration)


def _solve_turning(
    time: Samples, frames: Samples, everything: _Rotor, rigid: _Rotor
) -> tuple[Samples, Samples, Samples]:
    """Solve the equation of the rotation error psi; return propagation matrix, particular solution and inertia effect.

    ``frames`` (n, 3, 3) are the axes of the body. ``everything`` contains all flying parts, ``rigid`` those that become
    rigid.
    """
    steps = np.diff(time)[:, np.newaxis]
    # The angular momentum is constant in the fixed frame of reference; it is the mean of I w + h over the flight.
    inertia = _take_middle_values(everything.inertia)
    momentum_of_turns = np.einsum("nij,nj->ni", inertia, _compute_turns(frames))
    momentum_times_step = momentum_of_turns + everything.spin
    middle_frames = _take_middle_values(frames)
    summed_momentum = np.einsum("nij,nj->i", middle_frames, momentum_times_step)
    fixed_momentum = summed_momentum / steps.sum()
    momentum = fixed_momentum @ frames
    inverse_inertia = np.linalg.inv(everything.inertia.mean(axis=0))
    rate = momentum @ inverse_inertia

    # Homogeneous equation: dpsi/dt = I^-1 (L x psi) - w x psi.
    slope = inverse_inertia @ _make_cross_matrices(momentum)
    slope = slope - _make_cross_matrices(rate)
    carried = _integrate_matrix(time, slope)

    # Variation of constants: the right-hand side is carried back to the first state.
    carried_back = np.asarray(np.linalg.inv(carried), dtype=np.float64)
    back = _take_middle_values(carried_back) @ inverse_inertia
    middle_rate = _take_middle_values(rate)
    rate_times_step = middle_rate * steps
    rigid_inertia = _take_middle_values(rigid.inertia)
    rigid_momentum = np.einsum("nij,nj->ni", rigid_inertia, middle_rate)
    momentum_of_rigid_parts = rigid_momentum * steps + rigid.spin
    pushed = np.einsum("nij,nj->ni", back, momentum_of_rigid_parts)
    per_inertia = back[..., np.newaxis] * rate_times_step[:, np.newaxis, np.newaxis]
    return carried, _sum_running(pushed), _sum_running(per_inertia)


def _integrate_matrix(time: Samples, slope: Samples) -> Samples:
    """Return the solution (n, 3, 3) of X' = slope X that starts from the identity matrix."""
    rotations = [np.eye(3)]
    unit = np.eye(3)
    intervals = np.diff(time)[:, np.newaxis, np.newaxis]
    for step in _take_middle_values(slope) * intervals:
        increment = unit + step + step @ step / 2
        rotations.append(increment @ rotations[-1])
    return np.stack(rotations)


def _compute_turns(frames: Samples) -> Samples:
    """Return the rotation from each frame to the next, for small angles, shape (n - 1, 3) [rad]."""
    inverses = frames[:-1].transpose(0, 2, 1)
    between = inverses @ frames[1:]
    # The odd part of a rotation matrix contains the rotation axis times the sine of the angle.
    odd = (between - between.transpose(0, 2, 1)) / 2
    x = odd[:, 2, 1]
    y = odd[:, 0, 2]
    z = odd[:, 1, 0]
    axis_times_sine = np.stack([x, y, z], axis=1)
    sine = np.linalg.norm(axis_times_sine, axis=1, keepdims=True)
    is_turned = sine > 0
    # Rounding may raise a sine above 1.
    angle = np.arcsin(np.minimum(sine, 1.0))
    divisor = np.where(is_turned, sine, 1.0)
    angle_over_sine = np.where(is_turned, angle / divisor, 1.0)
    return np.asarray(axis_times_sine * angle_over_sine)


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
    """Return the mean of the values at the two ends of each step."""
    return np.asarray((values[1:] + values[:-1]) / 2)


def _sum_running(steps: Samples) -> Samples:
    """Return the running sum over the steps, starting at 0."""
    return np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])


def _interpolate_at(time: Samples, values: Samples, when: Samples) -> Samples:
    """Return values (n, ...) at times (k,), interpolated linearly."""
    next_state = np.clip(np.searchsorted(time, when), 1, time.size - 1)
    last_state = next_state - 1
    start = time[last_state]
    interval = time[next_state] - start
    share = (when - start) / interval
    # The shares (k,) multiply values of any shape (k, ...).
    further_axes = [1] * (values.ndim - 1)
    share = share.reshape(-1, *further_axes)
    from_last = values[last_state] * (1 - share)
    from_next = values[next_state] * share
    return np.asarray(from_last + from_next)
