"""How the lock-in error runs over all times before td, where it has no closed form: of parts, and of several modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.vibration import measures

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Deformation
    from d2rpick.vibration.moments import Moments


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
