"""Where a sampled energy passes a level or turns.

Between samples the energy is taken as linear: on piecewise linear data the answers are exact to rounding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Samples = NDArray[np.float64]


class Crossing(NamedTuple):
    """The energy passes a level at ``time`` [time], upwards when ``rising``."""

    time: float
    rising: bool


class Extremum(NamedTuple):
    """The energy turns at ``time`` [time] with the value ``energy``; a ``peak`` or a valley."""

    time: float
    energy: float
    peak: bool


def find_crossings(time: Samples, energy: Samples, level: float) -> tuple[Crossing, ...]:
    """All passages of ``energy`` through ``level``, ascending in time.

    What counts is that the energy lies on different sides before and after:

    * a sample exactly on the level is passed once, at that sample; a plateau on the level once, at its first;
    * touching the level and turning back is no crossing (``find_extrema`` gives such points);
    * a record that begins on the level has a crossing at its first sample, one that ends on it has one where
      it arrives; ``rising`` then tells the one side there is.  A record that stays on the level has none.

    Parameters
    ----------
    time, energy : array of shape (n,)
        Increasing times [time] and energies [energy].
    level : float
        [energy]

    Examples
    --------
    >>> import numpy as np
    >>> find_crossings(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 4.0, 1.0, 2.0]), 1.0)
    (Crossing(time=0.25, rising=True),)
    >>> find_crossings(np.array([0.0, 1.0, 2.0]), np.array([3.0, 1.0, 0.0]), 1.0)
    (Crossing(time=1.0, rising=False),)
    """
    times, rising = passages(time, energy, level)
    return tuple(map(Crossing, times.tolist(), rising.tolist()))


def passages(time: Samples, energy: Samples, level: float) -> tuple[Samples, NDArray[np.bool_]]:
    """Times of the crossings by the rule of ``find_crossings``, and which of them rise, both of shape (k,)."""
    side = np.sign(energy - level)
    off = np.flatnonzero(side)
    if not off.size:
        return np.zeros(0), np.zeros(0, dtype=bool)
    turn = np.flatnonzero(side[off[:-1]] != side[off[1:]])
    before, after = off[turn], off[turn + 1]
    share = np.where(
        after == before + 1, (level - energy[before]) / (energy[before + 1] - energy[before]), 1.0
    )  # with samples on the level in between, the first of them: a share of 1
    at = time[before] + share * (time[before + 1] - time[before])
    rising = side[after] > 0
    if off[0] > 0:
        at, rising = np.append(time[0], at), np.append(side[off[0]] > 0, rising)
    if off[-1] < side.size - 1:
        at, rising = np.append(at, time[off[-1] + 1]), np.append(rising, side[off[-1]] < 0)
    return at, rising


def find_extrema(time: Samples, energy: Samples) -> tuple[Extremum, ...]:
    """Samples where the energy turns; a flat top or bottom counts once, at its first sample, the ends never.

    Parameters
    ----------
    time, energy : array of shape (n,)
        Increasing times [time] and energies [energy].

    Examples
    --------
    >>> import numpy as np
    >>> find_extrema(np.array([0.0, 1.0, 2.0, 3.0]), np.array([0.0, 4.0, 4.0, 2.0]))
    (Extremum(time=1.0, energy=4.0, peak=True),)
    """
    at, peak = find_turns(energy)
    return tuple(map(Extremum, time[at].tolist(), energy[at].tolist(), peak.tolist()))


def find_turns(energy: Samples) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Places of the extrema among the samples, by the rule of ``find_extrema``, and which of them are peaks."""
    slope = np.sign(np.diff(energy))
    moving = np.flatnonzero(slope)
    turn = np.flatnonzero(slope[moving[:-1]] != slope[moving[1:]])
    return moving[turn] + 1, slope[moving[turn]] > 0
