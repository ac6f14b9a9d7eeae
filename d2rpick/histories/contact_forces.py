"""Read contact and rigid-wall forces, and the intervals between states in which these forces act.

A solver writes exactly zero if there is no contact. LS-DYNA writes the forces at each state. Radioss writes their
impulses since the start of the run, which change only while a force acts, so that no force between two states is
missed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import find_stretches

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Samples = NDArray[np.float64]

# Forces and impulse changes up to this fraction of the largest value are treated as zero [-].
# Single precision has seven digits, so forces below this fraction are rounding errors.
_NOTHING: Final = 1e-6


class ContactForce(NamedTuple):
    """The force that the contact or rigid wall ``name`` exerts at the times ``time`` [time], shape (n,).

    ``impulses`` (n, 3) contains the impulse since the previous state [momentum]; it is 0 for the first state and NaN if
    unknown. ``acts`` (n,) is True if a force acts between the previous state and this state.
    """

    name: str
    time: Samples
    impulses: Samples
    acts: NDArray[np.bool_]

    @classmethod
    def of_forces(cls, name: str, time: Samples, forces: Samples) -> ContactForce:
        """Make a contact force from forces at the states, shape (n, 3) [force]."""
        is_nonzero = _is_above_round_off(forces)
        acts = is_nonzero.copy()
        acts[1:] |= is_nonzero[:-1]
        acts[:1] = False
        means = (forces[1:] + forces[:-1]) / 2
        impulses = np.zeros_like(forces)
        impulses[1:] = means * np.diff(time)[:, np.newaxis]
        return cls(name, time, impulses, acts)

    @classmethod
    def of_impulses(cls, name: str, time: Samples, impulses: Samples) -> ContactForce:
        """Make a contact force from impulses since the start of the run, shape (n, 3) [momentum]."""
        changes = np.zeros_like(impulses)
        changes[1:] = np.diff(impulses, axis=0)
        return cls(name, time, changes, _is_above_round_off(changes))

    @classmethod
    def of_changes(cls, name: str, time: Samples, values: Samples) -> ContactForce:
        """Make a contact force from columns (n, k) of forces or impulses that change while the force acts.

        A constant force is zero, because the force of a contact between vibrating parts always changes.
        """
        acts = np.zeros(time.size, np.bool_)
        acts[1:] = _is_above_round_off(np.diff(values, axis=0))
        return cls(name, time, np.full((time.size, 3), np.nan), acts)

    @property
    def times(self) -> tuple[tuple[float, float], ...]:
        """Intervals (start, end) in which the force acts; each interval lies between two states without force."""
        return tuple(
            (
                float(self.time[max(interval.start - 1, 0)]),
                float(self.time[interval.stop - 1]),
            )
            for interval in find_stretches(self.acts)
        )

    @property
    def tells(self) -> bool:
        """True if the force acts at some times and does not act at others."""
        return bool(self.acts.any()) and not bool(self.acts[1:].all())


def find_force(
    forces: Sequence[ContactForce], kind: str, number: int
) -> ContactForce | None:
    """Return the force of the contact, interface or rigid wall with this number; None if the files lack this force."""
    head = f"{kind} {number}"
    return next(
        (force for force in forces if f"{force.name} ".startswith(f"{head} ")), None
    )


def join_contact_forces(
    pieces: Sequence[ContactForce], keep: NDArray[np.bool_]
) -> ContactForce:
    """Join the forces of one contact from all restart segments of a run; ``keep`` is a mask of the valid states.

    Between two restart segments, the force is assumed to act if it acts immediately before or after.
    """
    if len(pieces) == 1 and keep.all():
        return pieces[0]
    columns = zip(
        *((piece.time, piece.impulses, piece.acts) for piece in pieces), strict=True
    )
    time, impulses, acts = (np.concatenate(column) for column in columns)
    begins = np.zeros(time.size, np.bool_)
    begins[np.cumsum([0, *(piece.time.size for piece in pieces[:-1])])] = True
    whole = ContactForce(pieces[0].name, time[keep], impulses[keep], acts[keep])
    for state in np.flatnonzero(begins[keep])[1:].tolist():
        whole.acts[state] = whole.acts[state - 1 : state + 2].any()
    return whole


def _is_above_round_off(values: Samples) -> NDArray[np.bool_]:
    """Return True for each state with a value above the round-off of the largest value; ``values`` has shape (n, k)."""
    sizes = np.abs(values).max(axis=1, initial=0.0)
    return np.asarray(sizes > _NOTHING * float(sizes.max(initial=0.0)))
