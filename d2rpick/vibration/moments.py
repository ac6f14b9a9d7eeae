"""Times that may serve as tr."""

from __future__ import annotations

from typing import NamedTuple


class Moment(NamedTuple):
    """A time that may serve as tr, before anything is measured; ``rising`` None where the energy turns.

    ``kind``: "crossing" of the level, "extremum" near it, "match" of the deformations of several parts or modes, or
    "given".
    """

    tr: float
    kind: str
    rising: bool | None


# Why no tr can be trusted where the vibration is known but cannot be made out at td.
SUNK = "the level at td is below the noise of the record"
