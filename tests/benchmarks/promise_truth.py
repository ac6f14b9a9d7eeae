"""The true error R of any pair, and the smallest error that a flight allows.

The state of a vibration is a point in a space whose squared lengths are energies.  The switched run starts at td with
the deformation of tr, at rest; R is its distance from the reference run there, over the size of the vibration.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

import numpy as np
from scipy.ndimage import minimum_filter

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# Number of times per period of the fastest mode in the search, and the smallest total number.
_DENSITY: Final = 24
_FEWEST: Final = 100
# Number of times between two neighbours in the search at which a minimum is refined.
_FINER: Final = 10
# Number of the deepest local minima that are refined, because any of them may contain the smallest error.
_VALLEYS: Final = 12


class Vibration(Protocol):
    """Motion that is known at any time, as points in the energy norm; all times are in its own unit."""

    @property
    def most_times(self) -> int:
        """Largest number of times for which a search is fast enough."""
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
    """The true errors of pairs of a record, with its ``vibration`` and the ``flight`` (start, end) in its own unit.

    ``unit``: times of the file over those of the vibration.
    """

    vibration: Vibration
    flight: tuple[float, float]
    unit: float = 1.0

    @property
    def flight_of_file(self) -> tuple[float, float]:
        """Start and end of the flight [time of the file]."""
        start, end = self.flight
        return start * self.unit, end * self.unit

    def compute_residual(self, tr: float, td: float) -> float:
        """Return the true R of one pair, whose times are those of the file."""
        errors = self._compute_errors(
            np.array([tr]) / self.unit, np.array([td]) / self.unit
        )
        return float(errors[0, 0])

    def find_least_residual(self, td: float | None, shortest: float = 0.0) -> float:
        """Return the smallest true R in the flight among pairs that are rigid for at least the ``shortest`` time.

        With ``td`` the only choice is tr, and ``shortest`` does not count.  Times are those of the file.
        """
        start, end = self.flight
        wanted = _DENSITY * (end - start) / self.vibration.fastest_period
        count = int(np.clip(wanted, _FEWEST, self.vibration.most_times))
        grid = np.linspace(start, end, count)
        ends = grid if td is None else np.array([td]) / self.unit
        least_time = min(shortest / self.unit, end - start) if td is None else 0.0
        errors = self._compute_allowed(grid, ends, least_time)
        valleys = np.argwhere(
            (errors == minimum_filter(errors, size=3)) & np.isfinite(errors)
        )
        depths = errors[tuple(valleys.T)]
        deepest = valleys[np.argsort(depths)[:_VALLEYS]]
        nearby = (grid[1] - grid[0]) * np.linspace(-1, 1, 2 * _FINER + 1)
        finer_tr = _surround(grid[deepest[:, 0]], nearby, self.flight)
        finer_td = (
            ends
            if td is not None
            else _surround(grid[deepest[:, 1]], nearby, self.flight)
        )
        finer = self._compute_allowed(finer_tr, finer_td, least_time)
        least_residual = min(errors.min(), finer.min(initial=np.inf))
        return float(least_residual) if np.isfinite(least_residual) else float("nan")

    def _compute_allowed(self, tr: Samples, td: Samples, least_time: float) -> Samples:
        """Return R of all pairs of times of shapes (m,) and (n,), infinite for those that are rigid too short."""
        is_allowed = td - tr[:, np.newaxis] >= least_time
        return np.where(is_allowed, self._compute_errors(tr, td), np.inf)

    def _compute_errors(self, tr: Samples, td: Samples) -> Samples:
        """Return R of all pairs of times of shapes (m,) and (n,), shape (m, n)."""
        released = self.vibration.release(tr)
        followed, sizes = self.vibration.follow(td)
        squares = np.sum(released**2, axis=1)[:, np.newaxis] + np.sum(
            followed**2, axis=1
        )
        distances = np.sqrt(np.maximum(squares - 2 * released @ followed.T, 0.0))
        return np.asarray(
            np.divide(distances, sizes, out=np.zeros_like(distances), where=sizes > 0)
        )


def _surround(times: Samples, nearby: Samples, flight: tuple[float, float]) -> Samples:
    """Return the times and the times close to each of them, within the flight."""
    return np.clip(np.add.outer(times, nearby).ravel(), *flight)
