"""Times that may serve as tr."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, NamedTuple, overload

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

_KINDS: Final = ("crossing", "extremum", "match", "start", "given")


class Moment(NamedTuple):
    """A time that may serve as tr, before anything is measured; ``rising`` None where the energy turns.

    ``kind``: "crossing" of the level, "extremum" near it, "match" of the deformations of several parts or modes,
    "start" of a flight in which nothing vibrates, or "given".
    """

    tr: float
    kind: str
    rising: bool | None


class Moments(Sequence[Moment]):
    """Moments as columns of shape (n,): noise makes tens of thousands, and few of them are looked at one by one.

    ``tr`` [time]; ``kind``: places in the kinds of a `Moment`; ``rising``: 1, or -1 where it falls, 0 where neither.
    """

    def __init__(self, tr: Samples, kind: NDArray[np.int8], rising: NDArray[np.int8]) -> None:
        self.tr, self.kind, self.rising = tr, kind, rising

    @classmethod
    def of(cls, found: Sequence[Moment]) -> Moments:
        """Give any moments as columns."""
        if isinstance(found, Moments):
            return found
        rising = [0 if one.rising is None else 1 if one.rising else -1 for one in found]
        kind = [_KINDS.index(one.kind) for one in found]
        return cls(np.array([one.tr for one in found], dtype=float), np.array(kind, np.int8), np.array(rising, np.int8))

    @classmethod
    def of_level(cls, crossings: Samples, rising: NDArray[np.bool_], turns: Samples) -> Moments:
        """Give crossings of the level, shape (k,), and after them the extrema near it."""
        kind = np.repeat(np.array([0, 1], np.int8), [crossings.size, turns.size])
        sides = np.concatenate([np.where(rising, 1, -1), np.zeros(turns.size)]).astype(np.int8)
        return cls(np.concatenate([crossings, turns]), kind, sides)

    def are(self, kind: str) -> NDArray[np.bool_]:
        """Which of them are of a kind."""
        return np.asarray(self.kind == _KINDS.index(kind))

    def at(self, places: NDArray[np.intp] | NDArray[np.bool_]) -> Moments:
        """Give those at some places, in their order, or where a mask holds."""
        return Moments(self.tr[places], self.kind[places], self.rising[places])

    def __len__(self) -> int:
        return self.tr.size

    @overload
    def __getitem__(self, place: int) -> Moment: ...
    @overload
    def __getitem__(self, place: slice) -> Moments: ...
    def __getitem__(self, place: int | slice) -> Moment | Moments:
        """Make the moment at a place, or give those of a slice."""
        if isinstance(place, slice):
            return Moments(self.tr[place], self.kind[place], self.rising[place])
        rising = int(self.rising[place])
        return Moment(float(self.tr[place]), _KINDS[self.kind[place]], rising > 0 if rising else None)


# Why no tr can be trusted where the vibration is known but cannot be made out at td.
SUNK = "the level at td is below the noise of the record"
