"""Forces of contacts and rigid walls, as far as the files of a run tell them, and between which states they act.

A solver writes a force that is exactly zero where nothing touches.  Forces are written as they are at each state, by
LS-DYNA, or as their impulses since the start, by Radioss: these do not change where no force acts, and miss none.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import stretches

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Samples = NDArray[np.float64]

# A force, or a change of an impulse, below this share of the largest is none: single precision keeps seven digits.
_NOTHING: Final = 1e-6


class ContactForce(NamedTuple):
    """What a contact or a rigid wall of this ``name`` does, over ``time`` (n,) [time].

    ``impulses`` of shape (n, 3) are those since the state before, 0 for the first one; NaN where they are not known
    [momentum].  ``acts`` (n,) tells whether a force is seen between a state and the one before.
    """

    name: str
    time: Samples
    impulses: Samples
    acts: NDArray[np.bool_]

    @classmethod
    def of_forces(cls, name: str, time: Samples, forces: Samples) -> ContactForce:
        """Take from forces at the states, of shape (n, 3) [force]."""
        seen = _is_something(forces)
        acts = seen.copy()
        acts[1:] |= seen[:-1]
        acts[:1] = False
        means = (forces[1:] + forces[:-1]) / 2
        impulses = np.zeros_like(forces)
        impulses[1:] = means * np.diff(time)[:, np.newaxis]
        return cls(name, time, impulses, acts)

    @classmethod
    def of_impulses(cls, name: str, time: Samples, impulses: Samples) -> ContactForce:
        """Take from impulses since the start, of shape (n, 3) [momentum]."""
        changes = np.zeros_like(impulses)
        changes[1:] = np.diff(impulses, axis=0)
        return cls(name, time, changes, _is_something(changes))

    @classmethod
    def of_changes(cls, name: str, time: Samples, values: Samples) -> ContactForce:
        """Take from columns (n, k) of which nobody knows whether they are forces or impulses: both change as it acts.

        A force that stays at one value is zero, since a contact lets parts vibrate.
        """
        acts = np.zeros(time.size, np.bool_)
        acts[1:] = _is_something(np.diff(values, axis=0))
        return cls(name, time, np.full((time.size, 3), np.nan), acts)

    @property
    def times(self) -> tuple[tuple[float, float], ...]:
        """Times (start, end) in which it acts, ascending: from the last state without a force to the next one."""
        return tuple(
            (float(self.time[max(one.start - 1, 0)]), float(self.time[one.stop - 1]))
            for one in stretches(self.acts)
        )

    @property
    def tells(self) -> bool:
        """Whether it acts at some times and not at others."""
        return bool(self.acts.any()) and not bool(self.acts[1:].all())


def find_force(
    forces: Sequence[ContactForce], kind: str, number: int
) -> ContactForce | None:
    """Give the force of the contact, interface or rigid wall (``kind``) of this number; None if it is not written."""
    head = f"{kind} {number}"
    return next(
        (force for force in forces if f"{force.name} ".startswith(f"{head} ")), None
    )


def joined(pieces: Sequence[ContactForce], keep: NDArray[np.bool_]) -> ContactForce:
    """Join what legs of a run tell of one contact; ``keep`` are the states that count, of all legs together.

    Between two legs a force is taken to act where it does just before or behind.
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
    for place in np.flatnonzero(begins[keep])[1:].tolist():
        whole.acts[place] = whole.acts[place - 1 : place + 2].any()
    return whole


def _is_something(values: Samples) -> NDArray[np.bool_]:
    """Whether any of the values of a state (n, k) is more than round-off beside the largest of all."""
    sizes = np.abs(values).max(axis=1, initial=0.0)
    return np.asarray(sizes > _NOTHING * float(sizes.max(initial=0.0)))
