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
_COLUMN: Final = r"not_chosen_(part|spring)_(\d{1,18})"


def name_energy_of_part_not_chosen(part: Part, springs: Sequence[Part] = ()) -> str:
    """Return the name of the column for the internal energy of a part that was not chosen.

    The name says whether the part is one of the ``springs`` and dampers, which cannot become rigid.

    Examples
    --------
    >>> name_energy_of_part_not_chosen(Part(2, "step"))
    'not_chosen_part_2'
    """
    kind = "spring" if part in springs else "part"
    return f"not_chosen_{kind}_{part.id}"


def find_parts_not_chosen(database: Legs) -> tuple[Part, ...]:
    """Return the parts whose energies a table contains in addition to the chosen parts; empty for a solver file."""
    return tuple(Part(int(column[2]), "") for column in _find_columns(database))


def find_springs_not_chosen(database: Legs) -> tuple[Part, ...]:
    """Return the springs and dampers among the parts that a table contains in addition to the chosen parts."""
    columns = _find_columns(database)
    return tuple(
        Part(int(column[2]), "") for column in columns if column[1] == "spring"
    )


def read_energies_of_parts_not_chosen(database: Legs, parts: Sequence[Part]) -> Samples:
    """Return the internal energies of parts that were not chosen, one column per part, shape (n, parts) [energy]."""
    name_by_id = {int(column[2]): column[0] for column in _find_columns(database)}
    columns = [database.channel(name_by_id[part.id]) for part in parts]
    return np.stack(columns, axis=1)


def _find_columns(database: Legs) -> tuple[re.Match[str], ...]:
    """Return the matched names of the columns for parts that were not chosen; empty for a solver file."""
    if READERS[database.format].solver:
        return ()
    names = [re.fullmatch(_COLUMN, name) for name in database.channels]
    return tuple(name for name in names if name)
