"""Flight seen in the forces of contacts and rigid walls: a window in which none of them acts.

Forces are exact where energies and momenta are not: what touches nothing has none.  But a contact does not say which
parts it is of, and one whose force is not written may act all the same, as may any other load.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.window import FEWEST, SHORTEST, FreeFlight
from d2rpick.histories.samples import union

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.history import History, Momenta, Samples

# Of the impulse of a contact that acts from outside, which is in the momentum as it is: samples of a force that is hit
# and miss leave a third of it open.
_INNER: Final = 0.2
# Means of the energy over so many pieces of computed flights rise by up to 0.06 of the highest energy, where many modes
# beat; a crash lifts them to it.
_PIECES: Final = 4
_RISE: Final = 0.1


class Touches(NamedTuple):
    """Between which states anything touches: ``acts`` (n,) tells it of the time since the state before, at ``time``."""

    time: Samples
    acts: NDArray[np.bool_]

    @classmethod
    def of(
        cls, forces: Sequence[ContactForce], whole: Momenta | None = None
    ) -> Touches | None:
        """Put the forces of all contacts together that act at some times and not at others; None without.

        A contact that always acts holds parts together, as a tied one; one that never acts may not be of these parts.
        One that does not change the momentum of the ``whole`` model, where that is known, is between its own parts.
        Of forces that were written at different times the time counts that all have.
        """
        telling = [force for force in forces if force.tells]
        telling = telling if whole is None else _from_outside(telling, whole)
        if not telling:
            return None
        start, end = (
            max(force.time[0] for force in telling),
            min(force.time[-1] for force in telling),
        )
        every = union(*(force.time for force in telling))
        time = every[(every >= start) & (every <= end)]
        if time.size < FEWEST:
            return None
        acts = np.zeros(time.size, np.bool_)
        for force in telling:
            acts |= force.acts[np.searchsorted(force.time, time)]
        acts[0] = False
        return cls(time, acts)

    def flight_around(self, td: float) -> FreeFlight | None:
        """Give the window around ``td`` [time] in which nothing touches; None where something does, or it is too short.

        No force tells whether gravity acts, so it is not known (NaN).
        """
        time = self.time
        if not time[0] <= td <= time[-1]:
            return None
        after = min(max(int(np.searchsorted(time, td)), 1), time.size - 1)
        if self.acts[after]:
            return None
        acting = np.flatnonzero(self.acts)
        place = int(np.searchsorted(acting, after))
        first = int(acting[place - 1]) if place else 0
        last = int(acting[place]) - 1 if place < acting.size else time.size - 1
        long_enough = float(time[last] - time[first]) >= SHORTEST * float(
            time[-1] - time[0]
        )
        if last - first + 1 < FEWEST or not long_enough:
            return None
        return FreeFlight.of(time, (first, last), gravity=float("nan"))


def _from_outside(forces: Sequence[ContactForce], whole: Momenta) -> list[ContactForce]:
    """Give the forces whose impulses are found in the momentum of the model, beside that of a constant gravity.

    An impulse from outside changes the momentum by itself, with either sign, since a file may tell of either side; of
    velocities, whose mass is not known, the largest share stands for that.  What is not known stays.
    """
    known = [force for force in forces if np.isfinite(force.impulses).all()]
    if not known or whole.time.size <= len(known) + 1:
        return list(forces)
    steps = np.diff(whole.time)
    changes = np.diff(whole.of(range(whole.values.shape[1])), axis=0).ravel()
    by_gravity = [np.outer(steps, axis).ravel() for axis in np.eye(3)]
    columns = np.stack(
        [*(_between(force, whole.time).ravel() for force in known), *by_gravity], axis=1
    )
    sizes = np.linalg.norm(columns, axis=0)
    sizes[sizes == 0] = 1.0
    shares = np.abs(np.linalg.lstsq(columns / sizes, changes, rcond=None)[0] / sizes)[
        : len(known)
    ]
    whole_share = float(shares.max()) if whole.velocity else 1.0
    inner = {
        id(force)
        for force, share in zip(known, shares.tolist(), strict=True)
        if share < _INNER * whole_share
    }
    return [force for force in forces if id(force) not in inner]


def _between(force: ContactForce, time: Samples) -> Samples:
    """Impulses between other times (m,), of shape (m - 1, 3)."""
    sums = np.cumsum(force.impulses, axis=0)
    return np.diff(
        np.stack([np.interp(time, force.time, axis) for axis in sums.T], axis=1), axis=0
    )


def is_deformed(history: History, flight: FreeFlight) -> bool:
    """Whether the internal energy rises in a flight by forces as where a load acts whose force is not written.

    In flight it vibrates about its level, or falls by damping.
    """
    energy = history.between(flight.start, flight.end)[1]
    means = np.array(
        [piece.mean() for piece in np.array_split(energy, _PIECES) if piece.size]
    )
    rise = means - np.minimum.accumulate(means)
    return float(rise.max(initial=0.0)) > _RISE * float(np.abs(history.energy).max())
