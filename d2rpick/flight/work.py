"""Free flight, seen in work and energy: gravity and damping proportional to mass are all that works.

With the resultant F of gravity, the momentum p and the mass m, gravity works by the integral of F p/m; such damping by
-2 alpha times the integral of the kinetic energy, which Radioss counts as external work.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.window import FEWEST, FreeFlight, lasting_window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.energy_balance import Balance
    from d2rpick.histories.history import Samples

# States from which a load can be told from gravity and damping: twice the unknowns.
FEWEST_STATES: Final = 6
# What sampling and the solver's own sums leave of the work of gravity, as a share of its change: contacts do more.
_OWN_ERROR: Final = 1e-3


def work_beyond_gravity(balance: Balance, start: float, end: float) -> float | None:
    """Largest external work in a window that neither gravity nor damping explains [energy].

    Both factors have a sign: gravity acts along the mean change of the momentum, and damping takes energy.  Where
    no velocity is written, the work of gravity is an upward parabola of time.  What printed digits and a solver's own
    sums leave open is not counted.  None where the work is not written, or the window holds too few states.
    """
    inside = slice(*np.searchsorted(balance.time, [start, np.nextafter(end, np.inf)]))
    if balance.external_work is None or balance.time[inside].size < FEWEST_STATES:
        return None
    time, work = balance.time[inside], balance.external_work[inside]
    elapsed = (time - time[0]) / (time[-1] - time[0])
    free = [np.ones_like(time)]
    if balance.velocity is None:
        free.append(elapsed)
        gravity = elapsed**2
    else:
        from d2rpick.flight.momentum import FreeFall

        velocity = balance.velocity[inside]
        gravity = _integral(time, velocity @ FreeFall(time, velocity).gravity())
    one_sided = [gravity]
    if balance.kinetic is not None:
        one_sided.append(-_integral(time, balance.kinetic[inside]))
    rest = float(np.abs(_rest(work, free, one_sided)).max())
    own = balance.precision.quantum(float(np.abs(work).max())) + _OWN_ERROR * float(np.ptp(work))
    return max(0.0, rest - own)


def _rest(values: Samples, free: Sequence[Samples], one_sided: Sequence[Samples]) -> Samples:
    """What least squares leave of ``values``; the columns of ``one_sided`` are only ever added."""
    used = [column / np.abs(column).max() for column in one_sided if column.any()]
    while True:
        table = np.stack([*free, *used], axis=1)
        factors, *_ = np.linalg.lstsq(table, values, rcond=None)
        kept = [column for column, factor in zip(used, factors[len(free) :], strict=True) if factor > 0]
        if len(kept) == len(used):
            return np.asarray(values - table @ factors)
        used = kept


def _integral(time: Samples, values: Samples) -> Samples:
    """Integral from the first time on, by trapezia; shape of ``time``."""
    return np.append(0.0, np.cumsum(np.diff(time) * (values[1:] + values[:-1]) / 2))


def can_tell(balance: Balance) -> bool:
    """Whether work or energy is written that free flight would hold to a law."""
    return balance.time.size >= FEWEST and bool(_terms(balance))


def balanced_around(balance: Balance, td: float) -> FreeFlight | None:
    """Find the window around ``td`` [time] in which energy changes by gravity and damping only, or None.

    Held to it are the external work, and kinetic and internal energy together.
    """
    time, terms = balance.time, _terms(balance)
    if not terms or time.size < FEWEST or not time[0] <= td <= time[-1]:
        return None
    largest = max(float(np.abs(term).max()) for term in terms)
    extent = min(float(np.ptp(term)) for term in terms)
    noise = balance.precision.quantum(largest) / 2
    if noise > _OWN_ERROR * extent:
        return None
    law = _Parabola(time, np.stack(terms, axis=1), balance.kinetic)
    window = lasting_window(law, td, extent, noise)
    if window is None:
        return None
    first, last = window
    return FreeFlight(float(time[first]), float(time[last]), None, last < time.size - 1)


def _terms(balance: Balance) -> list[Samples]:
    """Energies that change by gravity and damping only, as far as they are written and change at all."""
    found = []
    if balance.external_work is not None:
        found.append(balance.external_work)
    if balance.kinetic is not None and balance.internal is not None:
        hourglass = 0.0 if balance.hourglass is None else balance.hourglass
        found.append(balance.kinetic + balance.internal + hourglass)
    return [term for term in found if np.ptp(term) > 0]


class _Parabola:
    """Energies that are parabolas of time but for damping, which takes a share of the kinetic energy; a `Law`."""

    def __init__(self, time: Samples, energies: Samples, kinetic: Samples | None) -> None:
        self.time, self.energies = time, energies
        self.spent = None if kinetic is None else _integral(time, kinetic)

    def misfit(self, first: int, last: int) -> float:
        """Largest deviation between two states [energy]."""
        states = slice(min(first, last), max(first, last) + 1)
        time = self.time[states]
        if time.size < FEWEST_STATES:
            return 0.0
        elapsed = (time - time[0]) / (time[-1] - time[0])
        columns = [np.ones_like(elapsed), elapsed, elapsed**2]
        if self.spent is not None and np.ptp(self.spent[states]) > 0:
            columns.append((self.spent[states] - self.spent[states][0]) / np.ptp(self.spent[states]))
        table = np.stack(columns, axis=1)
        factors, *_ = np.linalg.lstsq(table, self.energies[states], rcond=None)
        return float(np.abs(self.energies[states] - table @ factors).max())
