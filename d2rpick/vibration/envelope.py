"""How much energy vibrates, read off the peaks of the internal energy where no oscillator describes the record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.samples import find_extrema

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# Of the highest energy: a solver errs by a tenth of it at any time, so that nothing below is sure to be vibration.
SOLVER_FLOOR: Final = 1e-4


class Envelope(NamedTuple):
    """An exponential that lies on the highest peaks of an energy: ``energy`` at time ``origin``, falling at ``rate``.

    Below ``floor`` [energy] it is no more than what a solver errs by.

    The vibration energy V = E + T falls smoothly, as exp(-alpha t) where damping is proportional to mass, and E
    touches it when all modes stand still at once.  That is rare with several modes, so the envelope is an estimate,
    too low rather than too high.
    """

    energy: float
    rate: float
    origin: float
    floor: float

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Estimate of V(t) [energy]."""
        return np.asarray(self.energy * np.exp(-self.rate * (np.asarray(t) - self.origin)))


def upper_envelope(time: Samples, energy: Samples) -> Envelope | None:
    """Find the lowest falling exponential above all peaks, seen from the middle of them; None without peaks.

    Parameters
    ----------
    time, energy : array of shape (n,)
        The flight [time], [energy].

    Notes
    -----
    In the logarithm the exponential is a straight line; the lowest one above all points, at their mean time, is the
    edge of their upper convex hull there.  Peaks that may be errors of the solver do not count: a floor of them below
    a falling vibration would bend the line up.

    Examples
    --------
    >>> t = np.linspace(0.0, 3.0, 301)
    >>> found = upper_envelope(t, np.exp(-0.5 * t) * np.sin(8.0 * t) ** 2)
    >>> f"{found.rate:.2f}", f"{found.vibration_energy(0.0):.2f}"
    ('0.50', '1.00')
    """
    turns = [turn for turn in find_extrema(time, energy) if turn.peak]
    floor = max(SOLVER_FLOOR * float(np.max(energy)), 0.0)
    peaks = [(turn.time, float(np.log(turn.energy))) for turn in turns if turn.energy > floor]
    if not peaks:
        return None
    middle = float(np.mean([t for t, _ in peaks]))
    hull: list[tuple[float, float]] = []
    for peak in peaks:
        while len(hull) > 1 and _turns_left(hull[-2], hull[-1], peak):
            hull.pop()
        hull.append(peak)
    right = next((i for i, (t, _) in enumerate(hull) if t > middle), len(hull) - 1)
    (t0, top0), (t1, top1) = hull[max(right - 1, 0)], hull[right]
    rate = (top0 - top1) / (t1 - t0) if t1 > t0 else 0.0
    if rate <= 0:  # vibration energy only falls: the highest peak bounds it
        return Envelope(float(np.exp(max(top for _, top in hull))), 0.0, middle, floor)
    return Envelope(float(np.exp(top0)), rate, t0, floor)


def _turns_left(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) >= (b[1] - a[1]) * (c[0] - a[0])
