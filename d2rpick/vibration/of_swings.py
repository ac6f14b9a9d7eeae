"""The energy alone where its swings can be counted: the deformation is the root of what lies above the floor."""

from __future__ import annotations

from typing import TYPE_CHECKING

from d2rpick.vibration.of_parts import OfParts

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Measured
    from d2rpick.vibration.part_signs import PartMatch


class OfSwings(OfParts):
    """The whole as one part, whose swings are counted, seen from the td of ``whole``."""

    basis = "swings"
    undescribed = "the swings of the energy cannot be counted from here to td"
    signed = ()

    def measured(self, times: Samples) -> list[Measured | None]:
        """Measures of each time; none is of a part."""
        return [one and one._replace(part_mismatch=None) for one in super().measured(times)]

    def part_matches(self, tr: float) -> tuple[PartMatch, ...]:  # noqa: ARG002  by the protocol
        """Nothing: single parts are not known."""
        return ()
