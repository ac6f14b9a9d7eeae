"""What is known of forces from outside on the parts of a run, from elsewhere than its files: from its deck."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from d2rpick.histories.names import Part


class Support(NamedTuple):
    """A support or an imposed motion, by name and place, that acts from ``start`` to ``end`` [time]."""

    name: str
    start: float = 0.0
    end: float = inf


@dataclass(frozen=True, eq=False, repr=False)
class Surroundings:
    """What acts on each part from outside, by number; on the whole model by None.

    ``gravity`` has the accelerations that it may have [length/time^2], 0 where there is a time without; of a part
    that is not in it they are not known.  ``bodies`` gives the parts that hang together, none where that is not known.
    """

    gravity: Mapping[int | None, tuple[float, ...]] = field(default_factory=dict)
    supports: Mapping[int | None, tuple[Support, ...]] = field(default_factory=dict)
    bodies: Callable[[], tuple[tuple[int, ...], ...]] = tuple

    def gravity_on(self, parts: Iterable[Part] | None) -> tuple[float, ...] | None:
        """Accelerations that gravity may have for some parts together, or the model; None where they are not known."""
        known = {self.gravity.get(number) for number in _numbers(parts)}
        return known.pop() if len(known) == 1 else None

    def supports_of(self, parts: Iterable[Part] | None) -> tuple[Support, ...]:
        """What holds some of these parts, or the model."""
        return tuple(
            one for number in _numbers(parts) for one in self.supports.get(number, ())
        )

    def held(self, parts: Iterable[Part] | None, time: float) -> str | None:
        """Say what holds some of these parts, or the model, at a time; None where nothing does."""
        for number in _numbers(parts):
            for one in self.supports.get(number, ()):
                if one.start <= time <= one.end:
                    who = "the model" if number is None else f"part {number}"
                    return f"{who} is held or moved by {one.name}: it does not fly"
        return None

    def free(
        self, parts: Iterable[Part] | None, time: float
    ) -> tuple[float, float] | None:
        """Give the time around ``time`` in which nothing holds these parts, or the model; None where something does."""
        start, end = -inf, inf
        for one in self.supports_of(parts):
            if one.start <= time <= one.end:
                return None
            start, end = (
                (max(start, one.end), end)
                if one.end < time
                else (start, min(end, one.start))
            )
        return start, end


UNKNOWN = Surroundings()


def _numbers(parts: Iterable[Part] | None) -> tuple[int | None, ...]:
    return (None,) if parts is None else tuple(part.id for part in parts)
