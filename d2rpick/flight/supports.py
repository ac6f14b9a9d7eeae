"""What supports leave of a flight: nothing flies while something holds it."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.flight.window import FreeFlight
    from d2rpick.histories.names import Part
    from d2rpick.histories.surroundings import Surroundings


def unheld(
    surroundings: Surroundings, flight: FreeFlight | None, parts: Sequence[Part] | None, td: float
) -> FreeFlight | None:
    """Give what of a flight around ``td`` [time] lies between the times in which parts, or the model, are held."""
    between = surroundings.free(parts, td)
    if between is None or flight is None:
        return None
    start, end = max(flight.start, between[0]), min(flight.end, between[1])
    return flight._replace(start=start, end=end, end_seen=flight.end_seen or end < flight.end)
