"""Times that may serve as tr, and how the lock-in error runs between them where it has no closed form."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.vibration import measures

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Deformation

_KINDS: Final = ("crossing", "extremum", "match", "start", "given")


class Moment(NamedTuple):
    """A time that may serve as tr, before anything is measured; ``rising`` None where the energy turns.

    ``kind``: "crossing" of the level, "extremum" near it, "match" of the deformations of several parts or modes,
    "start" of a flight in which nothing vibrates, or "given".
    """

    tr: float
    kind: str
    rising: bool | None


@dataclass(frozen=True, eq=False)
class Moments:
    """Moments as columns of shape (n,): noise makes tens of thousands, and few of them are looked at one by one.

    ``tr`` [time]; ``kind``: places in the kinds of a `Moment`; ``rising``: 1, or -1 where it falls, 0 where neither.
    """

    tr: Samples
    kind: NDArray[np.int8]
    rising: NDArray[np.int8]

    @classmethod
    def of(cls, kind: str, times: Samples | Sequence[float]) -> Moments:
        """Give moments of one kind, where nothing is said of how the energy runs."""
        none = np.zeros(len(times), np.int8)
        return cls(np.array(times, dtype=float), none + np.int8(_KINDS.index(kind)), none)

    @classmethod
    def of_level(cls, crossings: Samples, rising: NDArray[np.bool_], *others: Moments) -> Moments:
        """Give crossings of the level, shape (k,), and after them other moments."""
        kind, sides = np.zeros(crossings.size, np.int8), np.where(rising, 1, -1).astype(np.int8)
        columns = zip((crossings, kind, sides), *((one.tr, one.kind, one.rising) for one in others), strict=True)
        return cls(*map(np.concatenate, columns))

    def are(self, kind: str) -> NDArray[np.bool_]:
        """Which of them are of a kind."""
        return np.asarray(self.kind == _KINDS.index(kind))

    def at(self, places: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Moments:
        """Give those at some places, in their order, or where a mask holds."""
        return Moments(self.tr[places], self.kind[places], self.rising[places])

    def __len__(self) -> int:
        return self.tr.size

    def __getitem__(self, place: int) -> Moment:
        """Make the moment at a place."""
        rising = int(self.rising[place])
        return Moment(float(self.tr[place]), _KINDS[self.kind[place]], rising > 0 if rising else None)


@dataclass(frozen=True, eq=False)
class Profile:
    """Lock-in errors ``error`` at ascending times ``time``, both of shape (n,), for one td [time], [-]."""

    time: Samples
    error: Samples

    @classmethod
    def of(cls, vibration: Deformation, time: Samples, td: float) -> Profile:
        """Profile at the times before ``td``."""
        before = time[time < td]
        return cls(before, measures.lock_in_error(vibration, before, td))

    def minima(self) -> tuple[float, ...]:
        """Times of the local minima: the vertex of the parabola through three squares, for L^2 is smooth [time]."""
        t, square = self.time, self.error**2
        if t.size < 3:
            return ()
        at = np.flatnonzero((square[1:-1] < square[:-2]) & (square[1:-1] <= square[2:])) + 1
        left, right = t[at] - t[at - 1], t[at + 1] - t[at]
        fall, rise = (square[at] - square[at - 1]) / left, (square[at + 1] - square[at]) / right
        # the slope grows evenly from ``fall`` in the middle of the left interval to ``rise`` in that of the right
        share = -fall / (rise - fall)
        return tuple((t[at] - left / 2 + share * (left + right) / 2).tolist())

    def cell(self, at: Samples) -> Samples:
        """Interval between the two times around each of ``at`` [time]."""
        after = np.clip(np.searchsorted(self.time, at), 1, self.time.size - 1)
        return np.asarray(self.time[after] - self.time[after - 1])

    def bounding(self, moments: Moments, reach: Samples) -> Samples:
        """Give ``reach`` of each moment, of a match half of its cell: it lies where the error is least [time]."""
        return np.where(moments.are("match"), self.cell(moments.tr) / 2, reach)

    def tolerances(self, tr: Samples, errors: Samples) -> Samples:
        """Give the tolerance of each tr of shape (n,) with its error [time]."""
        return np.array([self.tolerance(*one) for one in zip(tr.tolist(), errors.tolist(), strict=True)])

    def tolerance(self, tr: float, error: float) -> float:
        """How far ``tr`` may be off before ``error``, the one there, grows by 0.05; at most over all times [time]."""
        t, limit = self.time, error + measures.TOLERATED_GROWTH
        outside = self.error > limit
        middle = int(np.searchsorted(t, tr))
        after, before = np.flatnonzero(outside[middle:]), np.flatnonzero(outside[:middle])
        reaches = [float(t[-1] - t[0])]
        if after.size:
            reaches.append(self._leaving(middle + int(after[0]), -1, tr, limit))
        if before.size:
            reaches.append(self._leaving(int(before[-1]), 1, tr, limit))
        return min(reaches)

    def _leaving(self, outside: int, inwards: int, tr: float, limit: float) -> float:
        """Distance from ``tr`` to where the error passes ``limit``, linear from the sample ``outside`` inwards."""
        inside = outside + inwards
        if not 0 <= inside < self.time.size or self.error[inside] > limit:  # no sample between tr and the outside
            return abs(float(self.time[outside]) - tr)
        share = (limit - self.error[inside]) / (self.error[outside] - self.error[inside])
        place = self.time[inside] + share * (self.time[outside] - self.time[inside])
        return abs(float(place) - tr)
