"""A flaw of a run with rigid bodies: what ruins it, by a stable code that rules and warnings share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from d2rpick.deck.rows import Field

THROUGH_WALL: Final = "body-through-wall"
AT_REST: Final = "body-without-velocity"
NOT_FOLLOWED: Final = "deck-not-followed"
LEFT_RIGID: Final = "body-left-rigid"
# What ruins a run, in a few words, and the rule that says more.
RUINS: Final = {
    THROUGH_WALL: "the deck lets rigid bodies go through a wall (D2R406)",
    AT_REST: "the deck lets rigid bodies begin at rest (D2R407)",
    LEFT_RIGID: "the deck keeps parts rigid that deform (D2R408)",
}


class Flaw(NamedTuple):
    """What is wrong, with a stable ``code``, and where; `NOT_FOLLOWED` tells what was not judged, and why."""

    code: str
    place: Field
    message: str
