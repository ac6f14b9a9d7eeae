"""A flaw of a run with rigid bodies: what ruins it, by a stable code that rules and warnings share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from d2rpick.deck.rows import Field

THROUGH_WALL: Final = "body-through-wall"
AT_REST: Final = "body-without-velocity"
NOT_FOLLOWED: Final = "deck-not-followed"


class Flaw(NamedTuple):
    """What is wrong, with a stable ``code``, and where; `NOT_FOLLOWED` tells what was not judged, and why."""

    code: str
    place: Field
    message: str
