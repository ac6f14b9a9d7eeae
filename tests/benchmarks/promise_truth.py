"""The true error R of any pair, and the least that a flight allows.

The state of a vibration is a point in a space whose squared lengths are energies.  The switched run starts at td with
the deformation of tr, at rest; R is its distance from the reference run there, over the size of the vibration.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

import numpy as np

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# Times of the search per period of the fastest mode, and their least number.
_DENSITY: Final = 24
_FEWEST: Final = 100
# Times between two neighbours of the search at which the least error is refined.
_FINER: Final = 20


class Vibration(Protocol):
    """A motion that is known at any time, as points in the energy norm; all times are in its own unit."""

    @property
    def most_times(self) -> int:
        """Number of times that a search can afford."""
        ...

    @property
    def fastest_period(self) -> float:
        """Period of the fastest mode [time]."""
        ...

    def follow(self, time: Samples) -> tuple[Samples, Samples]:
        """Return points of the reference run at times of shape (n,), shape (n, d), and sizes of the vibration, (n,)."""
        ...

    def release(self, time: Samples) -> Samples:
        """Return the points of runs that start at rest with the deformation of these times, shape (n, d)."""
        ...


class Truth(NamedTuple):
    """The true errors of pairs of a record: its ``vibration``, the ``flight`` from start to end, in its own unit.

    ``unit``: times of the file over those of the vibration.
    """

    vibration: Vibration
    flight: tuple[float, float]
    unit: float = 1.0

    def compute_residual(self, tr: float, td: float) -> float:
        """Return the true R of one pair, whose times are those of the file."""
        errors = self._compute_errors(np.array([tr]) / self.unit, np.array([td]) / self.unit)
        return float(errors[0, 0])

    def find_least_residual(self, td: float | None, shortest: float = 0.0) -> float:
        """Return the least true R in the flight, of pairs that are rigid for at least the ``shortest`` time.

        With ``td`` the only choice is tr, and ``shortest`` does not count.  Times are those of the file.
        """
        start, end = self.flight
        wanted = _DENSITY * (end - start) / self.vibration.fastest_period
        count = int(np.clip(wanted, _FEWEST, self.vibration.most_times))
        grid = np.linspace(start, end, count)
        ends = grid if td is None else np.array([td]) / self.unit
        rigid_time = ends - grid[:, np.newaxis]
        least_time = min(shortest / self.unit, end - start) if td is None else 0.0
        allowed = rigid_time >= least_time
        if not allowed.any():
            return float("nan")
        errors = np.where(allowed, self._compute_errors(grid, ends), np.inf)
        best_tr, best_td = np.unravel_index(np.argmin(errors), errors.shape)
        step = grid[1] - grid[0]
        nearby = grid[best_tr] + np.linspace(-step, step, 2 * _FINER + 1)
        latest = ends[best_td] - least_time
        nearby = np.clip(nearby, start, latest)
        return float(self._compute_errors(nearby, ends[[best_td]]).min())

    def _compute_errors(self, tr: Samples, td: Samples) -> Samples:
        """Return R of all pairs of times of shapes (m,) and (n,), shape (m, n)."""
        released = self.vibration.release(tr)
        followed, sizes = self.vibration.follow(td)
        squares = np.sum(released**2, axis=1)[:, np.newaxis] + np.sum(followed**2, axis=1)
        distances = np.sqrt(np.maximum(squares - 2 * released @ followed.T, 0.0))
        return np.asarray(np.divide(distances, sizes, out=np.zeros_like(distances), where=sizes > 0))
