"""Balance: the energies of the whole model over time, from which the health of a run is read."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from d2rpick.histories.history import EXACT, Precision

if TYPE_CHECKING:
    from d2rpick.histories.history import Part, Samples


@dataclass(frozen=True, eq=False)
class Balance:
    """Energies of the whole model at ``time``, arrays of shape (n,); None for what the files do not have.

    ``sliding`` is the energy of all contacts, ``friction`` what of it is friction where that is told apart,
    ``external_work`` that of gravity and every other load, ``total`` the sum that the solver keeps and ``ratio`` that
    sum over what it should be: the energy at the start and the external work.  ``eroded`` is the internal energy of
    elements that were deleted.  ``velocity`` (n, 3) is that of the centre of mass, up to a factor.
    ``hourglass_of_parts`` gives the highest hourglass and the highest internal energy of parts.  ``precision`` tells
    how finely the energies were printed.
    """

    time: Samples
    internal: Samples | None = None
    kinetic: Samples | None = None
    hourglass: Samples | None = None
    sliding: Samples | None = None
    friction: Samples | None = None
    external_work: Samples | None = None
    total: Samples | None = None
    ratio: Samples | None = None
    eroded: Samples | None = None
    velocity: Samples | None = None
    hourglass_of_parts: tuple[tuple[Part, float, float], ...] = ()
    precision: Precision = EXACT
