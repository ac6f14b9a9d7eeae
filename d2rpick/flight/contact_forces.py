"""Find flights from contact and rigid-wall forces; a flight is a window in which no such force acts.

Forces are more exact than energies and momenta, because they are 0 for a part that touches nothing. But the files do
not name the parts of a contact, and contacts whose force is not written, or other loads, may act as well.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.window import FEWEST, SHORTEST, FreeFlight
from d2rpick.histories.samples import merge_times

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.history import History, Momenta, Samples

# Smallest momentum change of the model that shows an external contact, relative to the contact's impulse [-].
# The output may miss up to 1/3 of the impulse of an intermittent contact.
_INNER: Final = 0.2
# _PIECES: number of sections of a flight whose mean energies are compared with each other.
# _RISE: smallest rise of the mean energy that indicates a crash, relative to the highest energy [-].
# In computed flights with many beating modes, the mean energy rises by up to 6 % of the highest energy.
# In a crash, the mean energy rises from nearly zero to nearly the highest energy.
_PIECES: Final = 4
_RISE: Final = 0.1


class Touches(NamedTuple):
    """The intervals with a contact force. Entry i of ``acts`` (n,) refers to the interval that ends at ``time[i]``."""

    time: Samples
    acts: NDArray[np.bool_]

    @classmethod
    def of(
        cls, forces: Sequence[ContactForce], whole: Momenta | None = None
    ) -> Touches | None:
        """Combine the forces of all intermittent contacts; None if there are no such contacts.

        A contact that always acts holds parts together, like a tied contact; a contact that never acts may belong to
        other parts. A contact that does not change the momentum of the ``whole`` model, if this is known, acts between
        parts of the model. If the forces were written at different times, the period that all of them cover is used.
        """
        telling = [force for force in forces if force.tells]
        telling = telling if whole is None else _select_outer_forces(telling, whole)
        if not telling:
            return None
        start = max(force.time[0] for force in telling)
        end = min(force.time[-1] for force in telling)
        all_times = merge_times(*(force.time for force in telling))
        time = all_times[(all_times >= start) & (all_times <= end)]
        if time.size < FEWEST:
            return None
        acts = np.zeros(time.size, np.bool_)
        for force in telling:
            acts |= force.acts[np.searchsorted(force.time, time)]
        acts[0] = False
        return cls(time, acts)

    def flight_around(self, td: float) -> FreeFlight | None:
        """Return the window without contact around ``td`` [time]; None if it is too short or a contact acts at td.

        Forces do not show whether gravity acts, so gravity is NaN.
        """
        time = self.time
        if not time[0] <= td <= time[-1]:
            return None
        next_state = min(max(int(np.searchsorted(time, td)), 1), time.size - 1)
        if self.acts[next_state]:
            return None
        acting = np.flatnonzero(self.acts)
        next_contact = int(np.searchsorted(acting, next_state))
        first = 0
        last = time.size - 1
        if next_contact > 0:
            first = int(acting[next_contact - 1])
        if next_contact < acting.size:
            last = int(acting[next_contact]) - 1
        duration = float(time[last] - time[first])
        least_duration = SHORTEST * float(time[-1] - time[0])
        if last - first + 1 < FEWEST or duration < least_duration:
            return None
        return FreeFlight.of(time, (first, last), gravity=float("nan"))


def _select_outer_forces(
    forces: Sequence[ContactForce], whole: Momenta
) -> list[ContactForce]:
    """Return the forces whose impulses change the momentum of the model, apart from constant gravity.

    The impulse of an external force changes the momentum by its full size, with either sign, because a file may contain
    the force on either side of the contact. If only velocities are known and the mass is not, the largest ratio of
    velocity change to impulse is treated as the full size. Forces whose impulses are unknown are kept.
    """
    complete_forces = [force for force in forces if np.isfinite(force.impulses).all()]
    if not complete_forces or whole.time.size <= len(complete_forces) + 1:
        return list(forces)
    steps = np.diff(whole.time)
    changes = np.diff(whole.of(range(whole.values.shape[1])), axis=0).ravel()
    by_forces = [
        _sum_impulses_between(force, whole.time).ravel() for force in complete_forces
    ]
    by_gravity = [np.outer(steps, axis).ravel() for axis in np.eye(3)]
    columns = np.stack([*by_forces, *by_gravity], axis=1)
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0] = 1.0
    factors = np.linalg.lstsq(columns / sizes, changes, rcond=None)[0] / sizes
    shares = np.abs(factors)[: len(complete_forces)]
    whole_share = float(shares.max()) if whole.velocity else 1.0
    inner = {
        id(force)
        for force, share in zip(complete_forces, shares.tolist(), strict=True)
        if share < _INNER * whole_share
    }
    return [force for force in forces if id(force) not in inner]


def _sum_impulses_between(force: ContactForce, time: Samples) -> Samples:
    """Return the impulses of a force between successive times (m,), shape (m - 1, 3)."""
    sums = np.cumsum(force.impulses, axis=0)
    sums_at_times = [np.interp(time, force.time, axis) for axis in sums.T]
    return np.diff(np.stack(sums_at_times, axis=1), axis=0)


def is_deformed(history: History, flight: FreeFlight) -> bool:
    """Return True if the internal energy rises during the flight, which shows a load that the files do not contain.

    In a flight, the energy oscillates about its level or falls because of damping.
    """
    _, energy = history.between(flight.start, flight.end)
    pieces = np.array_split(energy, _PIECES)
    means = np.array([piece.mean() for piece in pieces if piece.size])
    rises = means - np.minimum.accumulate(means)
    largest_rise = float(rises.max(initial=0.0))
    highest = float(np.abs(history.energy).max())
    return largest_rise > _RISE * highest
