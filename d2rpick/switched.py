"""A finished switched run held against its reference: what was locked in, what came back, whether the motion is right.

Between the switches nothing is compared but energy: a rigid part reports neither kinetic energy nor momentum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import RangeError

if TYPE_CHECKING:
    from d2rpick.history import History, Samples
    from d2rpick.momentum import Track

# A deviation of the momentum after td beyond this share of it is worth an objection: the motion is another one.
MOST_MOMENTUM_ERROR = 0.05
# Some solvers report a wrong energy for rigid solid elements; beyond this share that is worth a note.
_REPORTED_OFF = 0.01


@dataclass(frozen=True)
class Comparison:
    """Measures of a switched run; fields are the keys of the JSON output, None where the files lack the quantity.

    ``energy_frozen`` is the energy that came back at td, ``energy_td`` that of the reference there.  Means and spreads
    (standard deviations) are over the time from td to ``end``.  ``momentum_error`` is the largest deviation after td
    relative to the largest momentum of the reference, ``displacement`` the largest distance of the parts' centre from
    where the reference has it [length].
    """

    source: tuple[str, ...]
    energy_frozen: float
    energy_td: float
    energy_ratio: float | None
    end: float
    mean_after: float
    mean_after_reference: float
    spread_after: float
    spread_after_reference: float
    momentum_error: float | None
    displacement: float | None
    notes: tuple[str, ...]

    @property
    def objections(self) -> tuple[str, ...]:
        """What is wrong with the motion of the switched run."""
        if self.momentum_error is None or self.momentum_error <= MOST_MOMENTUM_ERROR:
            return ()
        return (f"the switched run's momentum after td is off by {self.momentum_error:.1%}: its motion is another one",)


def compare(
    reference: History,
    switched: History,
    td: float,
    end: float,
    momenta: tuple[Track | None, Track | None],
    centres: tuple[Track | None, Track | None],
) -> Comparison:
    """Hold a switched run against its reference from ``td`` to ``end``.

    Parameters
    ----------
    reference, switched : History
        Energies of the same parts in both runs.
    td, end : float
        Switch back, and the next contact or the end of the records [time].
    momenta, centres : pair of Track or None
        Of the reference and of the switched run, None where it has none.

    Raises
    ------
    RangeError
        If the switched run holds fewer than two states in that window.
    """
    end = min(end, float(reference.time[-1]), float(switched.time[-1]))
    after, reference_after = _between(switched, td, end), _between(reference, td, end)
    if min(after.size, reference_after.size) < 2:
        raise RangeError(f"{', '.join(switched.source)}: fewer than two states between td {td:g} and {end:g}")
    frozen, wanted = float(after[0]), reference.energy_at(td)
    return Comparison(
        source=switched.source,
        energy_frozen=frozen,
        energy_td=wanted,
        energy_ratio=frozen / wanted if wanted > 0 else None,
        end=end,
        mean_after=float(after.mean()),
        mean_after_reference=float(reference_after.mean()),
        spread_after=float(after.std()),
        spread_after_reference=float(reference_after.std()),
        momentum_error=_relative(*momenta, td, end),
        displacement=_distance(*centres, td, end),
        notes=_reported(switched, td, frozen),
    )


def _between(history: History, start: float, end: float) -> Samples:
    return history.energy[(history.time >= start) & (history.time <= end)]


def _reported(switched: History, td: float, frozen: float) -> tuple[str, ...]:
    """Note an energy that the solver reports just before td otherwise than it comes back."""
    before = switched.energy[switched.time < td]
    if not before.size or abs(before[-1] - frozen) <= _REPORTED_OFF * abs(frozen):
        return ()
    found = f"while rigid the run reports an energy of {before[-1]:.6g}, at td {frozen:.6g} came back"
    return (f"{found}; some solvers report rigid solid elements wrongly",)


def _relative(reference: Track | None, other: Track | None, td: float, end: float) -> float | None:
    distance = _distance(reference, other, td, end)
    if reference is None or distance is None:
        return None
    largest = float(np.linalg.norm(reference.values, axis=1).max(initial=0.0))
    return distance / largest if largest > 0 else None


def _distance(reference: Track | None, other: Track | None, td: float, end: float) -> float | None:
    """Largest distance of the second track from the first between two times; None where one is missing."""
    if reference is None or other is None:
        return None
    inside = (other.time >= td) & (other.time <= end)
    there = [np.interp(other.time[inside], reference.time, column) for column in reference.values.T]
    return float(np.linalg.norm(other.values[inside] - np.stack(there, axis=1), axis=1).max(initial=0.0))
