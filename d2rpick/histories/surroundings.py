"""Represent the external forces on the parts of a run: gravity, supports and prescribed motions in the deck."""

from __future__ import annotations

from dataclasses import field
from math import inf
from typing import TYPE_CHECKING

from d2rpick.base.data_classes import dataclass
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from d2rpick.histories.names import Part


class Support(NamedTuple):
    """A support or a prescribed motion with its name and place; it acts from ``start`` to ``end`` [time]."""

    name: str
    start: float = 0.0
    end: float = inf


@dataclass(frozen=True, eq=False, repr=False)
class Surroundings:
    """External forces on each part, keyed by part id, and on the whole model, keyed by None.

    ``gravity`` contains the possible accelerations [length/time^2], including 0 if there are times without gravity; the
    accelerations of a part that is not listed are unknown. ``bodies`` returns the groups of connected parts; the result
    is empty if they are unknown.
    """

    gravity: Mapping[int | None, tuple[float, ...]] = field(default_factory=dict)
    supports: Mapping[int | None, tuple[Support, ...]] = field(default_factory=dict)
    bodies: Callable[[], tuple[tuple[int, ...], ...]] = tuple

    def gravity_on(self, parts: Iterable[Part] | None) -> tuple[float, ...] | None:
        """Return the possible gravity accelerations of the given parts, or of the model; None if they are unknown."""
        accelerations = {self.gravity.get(number) for number in _list_ids(parts)}
        return accelerations.pop() if len(accelerations) == 1 else None

    def supports_of(self, parts: Iterable[Part] | None) -> tuple[Support, ...]:
        """Return the supports of the given parts, or of the model."""
        supports: list[Support] = []
        for number in _list_ids(parts):
            supports += self.supports.get(number, ())
        return tuple(supports)

    def held(self, parts: Iterable[Part] | None, time: float) -> str | None:
        """Return a sentence on the support that holds the given parts, or the model, at a time; None if none does."""
        for number in _list_ids(parts):
            for support in self.supports.get(number, ()):
                if support.start <= time <= support.end:
                    subject = "the model" if number is None else f"part {number}"
                    return (
                        f"{subject} is held or moved by {support.name}: it does not fly"
                    )
        return None

    def free(
        self, parts: Iterable[Part] | None, time: float
    ) -> tuple[float, float] | None:
        """Return the interval around ``time`` in which no support holds these parts, or the model; None if one does."""
        start, end = -inf, inf
        for support in self.supports_of(parts):
            if support.start <= time <= support.end:
                return None
            if support.end < time:
                start = max(start, support.end)
            else:
                end = min(end, support.start)
        return start, end


UNKNOWN = Surroundings()


def _list_ids(parts: Iterable[Part] | None) -> tuple[int | None, ...]:
    """Return the ids of parts; None stands for the whole model."""
    return (None,) if parts is None else tuple(part.id for part in parts)
