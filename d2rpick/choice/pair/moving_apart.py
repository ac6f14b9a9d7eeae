"""Judge the motion of parts that are switched together although nothing connects them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.base.errors import list_names
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.flight.position_error import Bodies
    from d2rpick.histories.names import Part


class MovingApart(NamedTuple):
    """The switched parts that are ``leaving`` the others in the flight, and the parts ``staying`` together.

    ``staying`` is empty if every moving part flies on its own. ``are_joined`` is True if the deck joins the switched
    parts to one rigid body.
    """

    leaving: tuple[Part, ...]
    staying: tuple[Part, ...]
    are_joined: bool

    @classmethod
    def of(cls, bodies: Bodies) -> MovingApart:
        """Collect the parts of rigid bodies that fly away from the other parts of their body."""
        return cls(bodies.apart, bodies.staying, bool(bodies.told))

    @property
    def are_all_separate(self) -> bool:
        """True if every moving part flies on its own, so that there is no main body to which the others do not belong.

        The flight is then that of each part, and remains valid if each part becomes a rigid body of its own.
        """
        return not self.staying and not self.are_joined

    def describe(self) -> str:
        """Describe how the parts move, and what one rigid body would do."""
        verb = "flies" if len(self.leaving) == 1 else "fly"
        names = list_names([part.name for part in self.leaving])
        if self.are_all_separate:
            return (
                f"{names} {verb} away from each other: use a rigid body for each of them, because one rigid body of "
                "all would move wrongly"
            )
        return (
            f"{names} {verb} away from the other parts: nothing connects them, and one rigid body of all would move "
            "like none of them"
        )

    @property
    def advice(self) -> str:
        """What to make rigid instead."""
        if self.staying:
            return "leave these parts out"
        return "make each of these parts a rigid body of its own, and give the deck, which shows the bodies, as `deck`"


def find_parts_moving_apart(situation: Situation) -> MovingApart | None:
    """Return the switched parts that leave the others in the flight; None if there are none or nothing shows them."""
    bodies = situation.bodies
    return MovingApart.of(bodies) if bodies and bodies.apart else None
