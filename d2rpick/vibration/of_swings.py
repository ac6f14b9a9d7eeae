"""The energy alone where its swings can be counted: the deformation is the root of what lies above the floor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration.measures import wrong_sign
from d2rpick.vibration.of_parts import OfParts

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Measured
    from d2rpick.vibration.of_energy import OfEnergy
    from d2rpick.vibration.part_shares import PartMatch
    from d2rpick.vibration.swings import Swings


# A spring that stiffens swings at another rate once the amplitude is another: over two periods after td its residual
# came out up to so many times that of a linear one.
_OF_ANY_SPRING: Final = 1.5
# A mode that is hidden at the worst moves the residual by twice the root of its share; the floor shows less than all of
# it.  Of some 10,000 random pairs with a second mode 0.1 % were beyond by more than 0.05.
_OF_THE_FLOOR: Final = 3.0


class OfSwings(OfParts):
    """The whole as one part, whose swings are counted, seen from the td of ``whole``."""

    basis = "swings"
    undescribed = "the swings of the energy cannot be counted from here to td"
    signed = unsigned = ()

    def __init__(self, whole: OfEnergy, swings: Swings) -> None:
        super().__init__(whole, swings.vibration)
        self.swings = swings

    def measured(self, times: Samples) -> list[Measured | None]:
        """Measures of each time; the highest residual is that with what may hide in the floor at its worst."""
        found = super().measured(times)
        hidden = np.minimum(_OF_THE_FLOOR * np.sqrt(self.swings.unseen(times, self.td)), wrong_sign(0.0))
        return [
            one and one._replace(residual_high=float(np.hypot(_OF_ANY_SPRING * one.residual, most)), part_mismatch=None)
            for one, most in zip(found, hidden, strict=True)
        ]

    def part_matches(self, tr: float) -> tuple[PartMatch, ...]:  # noqa: ARG002  by the protocol
        """Nothing: single parts are not known."""
        return ()
