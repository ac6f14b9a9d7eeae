"""Read contact forces from table columns, which are recognised by their names."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.histories.formats import READERS

if TYPE_CHECKING:
    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.database import Legs

# Words in the names of contact forces in tables; Radioss uses names such as FNX.
_TOUCHING: Final = (
    r"(?:contact|interface|wall|rcforc|rwforc|ground|barrier|impact(?:or)?)"
)
_OF_CONTACT: Final = rf"(?i){_TOUCHING}.*forc|forc.*{_TOUCHING}|rcforc|rwforc|(?<![a-z])f[nt][xyz](?![a-z])"
_NO_FORCE: Final = r"(?i)energy|work|moment|ratio"


def find_forces(database: Legs) -> tuple[ContactForce, ...]:
    """Return the contact forces of a database. In a table, each column named like a contact force is a force."""
    if READERS[database.format].solver:
        return database.contact_forces
    names = [
        name
        for name in database.channels
        if re.search(_OF_CONTACT, name) and not re.search(_NO_FORCE, name)
    ]
    if not names:
        return ()
    # Imported here to keep start-up fast.
    from d2rpick.histories.contact_forces import ContactForce

    return tuple(
        ContactForce.of_changes(
            repr(name), database.time, database.channel(name)[:, np.newaxis]
        )
        for name in names
    )
