"""Energy of springs and dampers: which parts have it, and what of the model's internal energy it is.

Solvers count the work that dampers take as internal energy of the springs.  It only grows and never comes back, so a
level that holds it drifts.  Both solvers write what all springs and dampers have together; it is part of the internal
energy (dynasupport.com/howtos/general/total-energy).  The parts whose energies add up to it are the springs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.errors import FormatError
from d2rpick.histories.names import normalised

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.database import Legs
    from d2rpick.histories.history import Part, Samples

# Radioss; glstat of LS-DYNA and its branch of a binout.
_NAMES: Final = frozenset({"springenergy", "springanddamperenergy"})
# Formats in which these names mean that.
_SOLVERS: Final = frozenset({"radioss-th", "glstat", "binout"})
# Below this share of the peak internal energy springs have none: single precision and glstat print six digits.
_NONE: Final = 1e-6
# LS-DYNA begins to count at 1e-20.
_FLOOR: Final = 1e-15
# The energies of the springs add up to within this share of the peak: matsum prints five digits of each.
_ADDS_UP: Final = 1e-3
# Factors of a sum of parts are 0 or 1.
_HALF: Final = 0.5


def spring_energy(database: Legs) -> tuple[str, Samples] | None:
    """Give name and values (n,) of the energy of all springs and dampers; None where there is none, or no other."""
    total = database.energy_channel
    if database.format not in _SOLVERS or total is None:
        return None
    name = next((name for name in database.channels if normalised(name) in _NAMES), None)
    if name is None:
        return None
    try:
        found, whole = database.channel(name), database.channel(total)
    except FormatError:
        return None
    if not found.size or not np.isfinite(found).all():
        return None
    least = max(_NONE * float(np.abs(whole).max()), _FLOOR)
    rest = whole - found
    told_apart = found.max() > least and rest.max() > least and rest.min() >= -least  # it is part of the whole
    return (name, found) if told_apart else None


def springs_among(
    databases: Sequence[Legs], parts: Sequence[Part], energies: Samples, time: Samples
) -> tuple[Part, ...]:
    """Find the parts whose energies add up to that of all springs and dampers; none where no choice of them does.

    ``energies`` are those of all parts, shape (n, parts), at ``time`` (n,).
    """
    named = next(((one.time, found[1]) for one in databases if (found := spring_energy(one))), None)
    if named is None or not time.size > len(parts) > 0:
        return ()
    inside = (time >= named[0][0]) & (time <= named[0][-1])
    wanted, table = np.interp(time[inside], *named), energies[inside]
    if not wanted.any() or not np.isfinite(table).all():
        return ()
    chosen = np.linalg.lstsq(table, wanted, rcond=None)[0] > _HALF
    if np.abs(table[:, chosen].sum(axis=1) - wanted).max() > _ADDS_UP * np.abs(wanted).max():
        return ()
    return tuple(part for part, one in zip(parts, chosen.tolist(), strict=True) if one)
