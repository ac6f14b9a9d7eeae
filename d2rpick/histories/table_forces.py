"""Forces of contacts among the columns of a table, known by their names."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.formats import READERS

if TYPE_CHECKING:
    from d2rpick.histories.database import Legs

# What columns of contact forces are called in tables, beside FNX and so on of Radioss; compiled where they are needed.
_TOUCHING: Final = (
    r"(?:contact|interface|wall|rcforc|rwforc|ground|barrier|impact(?:or)?)"
)
_OF_CONTACT: Final = rf"(?i){_TOUCHING}.*forc|forc.*{_TOUCHING}|rcforc|rwforc|(?<![a-z])f[nt][xyz](?![a-z])"
_NO_FORCE: Final = r"(?i)energy|work|moment|ratio"


def forces_of(database: Legs) -> tuple[ContactForce, ...]:
    """Give the forces of a database; those of a table are columns whose names speak of them, each by itself."""
    if READERS[database.format].solver:
        return database.contact_forces
    named = [
        name
        for name in database.channels
        if re.search(_OF_CONTACT, name) and not re.search(_NO_FORCE, name)
    ]
    return tuple(
        ContactForce.of_changes(
            repr(name), database.time, database.channel(name)[:, np.newaxis]
        )
        for name in named
    )
