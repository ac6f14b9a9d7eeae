"""Which parts of a switched run were rigid in a window.

A rigid part has one internal energy, or no kinetic energy of its own where a rigid body has taken that over.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.histories.samples import window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part
    from d2rpick.histories.run import Run

# Of a part that is deformable fewer states follow each other without kinetic energy, or with one internal energy.
FEWEST: Final = 12
# An internal energy that changes by less is one value: solvers write single precision.
SAME: Final = 1e-6


def with_energy(run: Run, parts: Sequence[Part], history: History) -> tuple[Part, ...]:
    """Give those of the parts that ever have internal energy at the times of a history."""
    if not parts:
        return ()
    energies = run.part_energies(parts)
    if len(energies) != history.time.size:
        return ()
    return tuple(part for part, energy in zip(parts, energies.T, strict=True) if energy.any())


def kinetic_energies(run: Run, parts: Sequence[Part]) -> Samples | None:
    """Kinetic energies of parts, shape (n, parts); None where they are not written."""
    try:
        return run.part_kinetic_energies(parts)
    except FormatError:
        return None


def rigid_parts(run: Run, parts: Sequence[Part], time: Samples, tr: float, td: float) -> NDArray[np.bool_] | None:
    """Tell which of the parts were rigid from tr to td, shape (parts,); None where their states do not tell.

    ``time`` are the times of the parts' states (n,).
    """
    inside = window(time, np.nextafter(tr, td), np.nextafter(td, tr))
    inside = slice(inside.start + 1, max(inside.start + 1, inside.stop - 1))  # switched at the first step after tr
    if not parts or len(time[inside]) < FEWEST:
        return None
    energies, kinetic = run.part_energies(parts)[inside], kinetic_energies(run, parts)
    still = np.ptp(energies, axis=0) <= SAME * np.abs(energies).max(axis=0)
    absent = (kinetic[inside] == 0).all(axis=0) if kinetic is not None else np.zeros(len(parts), dtype=bool)
    return np.asarray(still | absent)
