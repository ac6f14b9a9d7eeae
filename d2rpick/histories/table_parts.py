"""Name and read the table columns with the internal energies of parts that were not chosen."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.histories.formats import READERS
from d2rpick.histories.names import Part

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.database import Legs
    from d2rpick.histories.history import Samples

# Name of the column with the energy of the chosen parts in a written table.
CHOSEN_ENERGY: Final = "internal_energy"
_NOT_CHOSEN: Final = "not_chosen_part_"


def name_energy_of_part_not_chosen(part: Part) -> str:
    """Return the name of the column for the internal energy of a part that was not chosen.

    Examples
    --------
    >>> name_energy_of_part_not_chosen(Part(2, "step"))
    'not_chosen_part_2'
    """
    return f"{_NOT_CHOSEN}{part.id}"


def find_parts_not_chosen(database: Legs) -> tuple[Part, ...]:
    """Return the parts whose energies a table contains in addition to the chosen parts; empty for a solver file."""
    if READERS[database.format].solver:
        return ()
    names = (
        re.fullmatch(rf"{_NOT_CHOSEN}(\d{{1,18}})", name) for name in database.channels
    )
    return tuple(Part(int(name[1]), "") for name in names if name)


def read_energies_of_parts_not_chosen(database: Legs, parts: Sequence[Part]) -> Samples:
    """Return the internal energies of parts that were not chosen, one column per part, shape (n, parts) [energy]."""
    columns = [database.channel(name_energy_of_part_not_chosen(part)) for part in parts]
    return np.stack(columns, axis=1)
