"""A finished switched run held against its reference: what was locked in, what came back, whether the motion is right.

Between the switches nothing is compared but energy: a rigid part reports neither kinetic energy nor momentum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import RangeError

if TYPE_CHECKING:
    from d2rpick.history import History, Samples, Track

# A deviation of the momentum after td beyond this share of it is worth an objection: the motion is another one.
MOST_MOMENTUM_ERROR = 0.05
# Momentum below this share of the largest of the run is hardly any: a body that has come to rest cannot be off by much.
_AT_REST = 0.01
# Some solvers report a wrong energy for rigid solid elements; beyond this share, and beyond what the energy changes
# from state to state anyway, that is worth a note.
_REPORTED_OFF = 0.01


@dataclass(frozen=True)
class Comparison:
    """Measures of a switched run; fields are the keys of the JSON output, None where the files lack the quantity.

    ``energy_frozen`` is the energy that came back at td, ``energy_td`` that of the reference there.  Means and spreads
    (standard deviations) are over the time from td to ``end``.  ``momentum_error`` is the largest deviation of the
    momentum behind the first state from td on, relative to the largest that the reference has there;
    ``displacement`` the largest distance there of the parts' centre from where the reference has it [length].
    ``notes``: what was left out or assumed in reading the switched run and not the reference, and what is odd in it.
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
        If a run holds fewer than three states in that window.
    """
    end = min(end, float(reference.time[-1]), float(switched.time[-1]))
    after, reference_after = _between(switched, td, end), _between(reference, td, end)
    if min(after.size, reference_after.size) < 3:
        short = min(reference, switched, key=lambda history: history.time[-1])
        found = f"fewer than 3 states from td {td:g} to {end:g}"
        raise RangeError(f"{', '.join(short.source)}: {found}; nothing can be compared there")
    before = switched.energy[switched.time < td]
    if before.size and after[0] == before[-1] and _reported_wrong(before[-1], after[1:]):
        after = after[1:]  # the switch comes at the first step from td on: this state was still rigid
    frozen, wanted = float(after[0]), reference.energy_at(td)
    notes = tuple(note for note in switched.notes if note not in reference.notes)
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
        notes=(*notes, *(_reported(float(before[-1]), after) if before.size else ())),
    )


def _between(history: History, start: float, end: float) -> Samples:
    return history.energy[(history.time >= start) & (history.time <= end)]


def _reported_wrong(rigid: float, after: Samples) -> bool:
    """Whether the energy reported while rigid is not the one that comes back."""
    usual = np.abs(np.diff(after)).max()
    return bool(abs(rigid - after[0]) > max(usual, _REPORTED_OFF * abs(after[0])))


def _reported(rigid: float, after: Samples) -> tuple[str, ...]:
    """Note an energy that the solver reports just before td otherwise than it comes back."""
    if not _reported_wrong(rigid, after):
        return ()
    found = f"while rigid the run reports an energy of {rigid:.6g}, at td {after[0]:.6g} came back"
    return (f"{found}; some solvers report rigid solid elements wrongly",)


def _relative(reference: Track | None, other: Track | None, td: float, end: float) -> float | None:
    distance = _distance(reference, other, td, end)
    if reference is None or distance is None:
        return None
    sizes = np.linalg.norm(reference.values, axis=1)
    there = sizes[(reference.time >= td) & (reference.time <= end)]
    largest = max(float(there.max(initial=0.0)), _AT_REST * float(sizes.max()))
    return distance / largest if largest > 0 else None


def _distance(reference: Track | None, other: Track | None, td: float, end: float) -> float | None:
    """Largest distance of the second track from the first between two times; None where one is missing.

    The first state from td on is left out, since it may still be rigid.
    """
    if reference is None or other is None:
        return None
    inside = np.flatnonzero((other.time >= td) & (other.time <= end))[1:]
    if not inside.size:
        return None
    there = [np.interp(other.time[inside], reference.time, column) for column in reference.values.T]
    return float(np.linalg.norm(other.values[inside] - np.stack(there, axis=1), axis=1).max())
