"""Determine the sign of a deformation whose energy returns to its minimum in each half cycle, whatever the spring law.

At each of these minima the deformation passes through zero: the energy above the floor (the lower envelope of the
energy) is elastic, and its root is the deformation, which changes its sign at the minimum. Plastic work raises the
floor; heat and drift move it slowly. If the minima do not lie on a smooth floor, another mode has energy at these
times, and half cycles cannot be counted.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.histories.samples import find_turns
from d2rpick.vibration.amplitudes import SignedAmplitudes
from d2rpick.vibration.measures import Profile, vertices, wrong_sign
from d2rpick.vibration.modes import SOLVER_FLOOR

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples


# An extremum is counted if the energy then changes by at least this fraction of its previous change [-].
_SWING: Final = 0.2
# Largest deviation of a minimum on the lower envelope from the line through its neighbours, per local amplitude [-].
_OFF_FLOOR: Final = 0.02
# Half cycles are counted if at most this fraction of the minima lies off the lower envelope [-].
_MOST_OFF: Final = 0.1
# Smallest number of minima that define a lower envelope.
_FEWEST: Final = 5
# Smallest relative difference in length of neighbouring half cycles in a beat [-].
# The relative length difference is about half of the other mode's energy fraction, which is thus 0.02 at the limit.
_UNEVEN: Final = 0.009
# _MOST_BEATING: if a larger fraction of the half cycles alternates, two modes beat [-].
# _STRETCHED: smallest ratio of relative length difference to relative height difference in a beat [-]; preload: 0.3.
_MOST_BEATING, _STRETCHED = 0.75, 1.3
# Factor by which the residual may be larger or smaller because the spring law is unknown [-].
# In 1,368 pairs of 12 springs that stiffen by up to 200 %, 98 % of the residuals above 0.1 were within this factor.
_OF_ANY_SPRING: Final = 1.5
# _OF_THE_FLOOR: effect of a hidden mode on the residual, per square root of its energy fraction [-].
# In theory, the factor is 2, but the lower envelope shows only a part of a hidden mode.
# _UNRESOLVED: additional contribution to the residual from motion that the states do not resolve [-].
# In 1,378 records of two modes, 98.2 % of the residuals below 0.3 lay in the error band.
_OF_THE_FLOOR, _UNRESOLVED = 5.0, 0.05


@dataclass(frozen=True, eq=False, repr=False)
class Swings(SignedAmplitudes):
    """The signed deformation from counted half cycles, in the states of a flight.

    Parameters
    ----------
    time, deformation : array of shape (n,)
        States of the flight [time], [sqrt(energy)]; the overall sign is arbitrary.
    unclear : array
        Times at which the sign may or may not change. Times on different sides of such a time cannot be compared.
    envelope : Envelope
        Estimate of the vibration energy.
    bottoms, floor : array of shape (k,)
        Times of the minima [time], and the energy at them [energy].
    """

    time: Samples
    deformation: Samples
    unclear: Samples
    envelope: Envelope
    bottoms: Samples
    floor: Samples
    signed: ClassVar = True
    told: ClassVar = "counted cycles of the energy"
    kinetic: ClassVar = "the counted swings leave"
    undescribed: ClassVar = "the swings of the energy cannot be counted from here to td"

    def amplitudes(self, t: Samples | float) -> Samples:
        """Return the signed deformation, in the shape of ``t`` with a first axis of length one [sqrt(energy)]."""
        return np.asarray(np.interp(t, self.time, self.deformation))[np.newaxis]

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Return the kinetic energy of the vibration, the estimated vibration energy minus the elastic energy."""
        return np.asarray(self.vibration_energy(t) - self.amplitudes(t)[0] ** 2)

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the energy of the vibration, which is at least the elastic energy [energy]."""
        return np.asarray(
            np.maximum(self.envelope.vibration_energy(t), self.amplitudes(t)[0] ** 2)
        )

    def comparable_since(self, td: float) -> float:
        """Return the earliest time at which the sign of the deformation can be related to that at ``td`` [time]."""
        unclear_before = self.unclear[self.unclear < td]
        return float(unclear_before[-1] if unclear_before.size else self.time[0])

    def known_at(self, td: float) -> bool:
        """Return True if at least two half cycles before ``td`` were counted and the energy exceeds solver errors."""
        counted = np.count_nonzero(
            (self.bottoms > self.comparable_since(td)) & (self.bottoms < td)
        )
        return bool(
            counted > 1 and self.envelope.vibration_energy(td) >= self.envelope.floor
        )

    def profile(self, td: float) -> Profile:
        """Return frozen-deformation errors at the times before ``td`` at which the sign of the deformation is known."""
        since = np.searchsorted(self.time, self.comparable_since(td))
        return Profile.of(
            self, self.time[since:], td
        )  # The arrays are views, because a copy for each td would fill the memory.

    def residual_band(
        self, stated: Samples, tr: Samples, td: float
    ) -> tuple[Samples, Samples, Samples]:
        """Return the residual of each tr (n,) with its bounds, which allow for an unknown spring law and hidden modes.

        A hidden mode is as likely as none, so the residual includes half of its energy.
        """
        hidden_share = self.unseen(tr, td)
        hidden = np.minimum(
            _OF_THE_FLOOR * np.sqrt(hidden_share) + _UNRESOLVED, wrong_sign(0.0)
        )
        lowest_squared = np.square(stated / _OF_ANY_SPRING) - np.square(hidden)
        highest = np.hypot(_OF_ANY_SPRING * stated, hidden)
        likely = np.sqrt(np.square(stated) + np.minimum(hidden_share, 1.0) / 2)
        return likely, np.sqrt(np.maximum(lowest_squared, 0.0)), np.asarray(highest)

    def unseen(self, tr: Samples | float, td: float) -> Samples:
        """Return the fraction of vibration energy at td of a mode hidden in the lower envelope, for each tr (n,) [-].

        It follows from the deviations of the floor from a straight line, because heat and drift move the floor slowly.
        It is at most the largest energy of the floor itself.
        """
        first = np.clip(np.searchsorted(self.bottoms, np.atleast_1d(tr)) - 1, 0, None)
        last = int(np.searchsorted(self.bottoms, td)) + 1
        around = [slice(min(at, last - 1), last) for at in first.tolist()]
        energies = np.array(
            [
                min(
                    float(np.ptp(self._excursions[states])),
                    float(np.abs(self.floor[states]).max()),
                )
                for states in around
            ]
        )
        return energies / float(self.vibration_energy(td))

    @cached_property
    def _excursions(self) -> Samples:
        """Return the distance of each minimum from the straight line fitted to all minima, shape (k,) [energy]."""
        since_first = self.bottoms - self.bottoms[0]
        line = np.polyfit(since_first, self.floor, 1)
        return np.asarray(self.floor - np.polyval(line, since_first))


def count_swings(time: Samples, energy: Samples) -> Swings | None:
    """Count the half cycles of an energy in free flight; None if they do not return to a common minimum.

    Parameters
    ----------
    time, energy : array of shape (n,)
        [time], [energy].

    Examples
    --------
    >>> t = np.linspace(0.0, 3.0, 301)
    >>> found = count_swings(t, 5.0 + 0.2 * t + np.sin(8.0 * t) ** 2)
    >>> bool(np.abs(np.abs(found.amplitudes(t)) - np.abs(np.sin(8.0 * t))).max() < 0.05)
    True
    >>> count_swings(t, np.sin(8.0 * t) ** 2 + np.sin(13.0 * t) ** 2)
    """
    at, open_end = _find_turns(energy)
    if at.size > 1:
        low = energy[at] < energy[np.roll(at, 1)]
    else:
        low = np.zeros(0, dtype=bool)
    low[:1] = ~low[1:2]
    if np.count_nonzero(low) < _FEWEST:
        return None
    moment, value = vertices(time, energy, at)
    bottom = moment[low]
    floor = value[low]
    swing = np.interp(bottom, moment[~low], value[~low]) - floor
    is_off_floor = np.abs(_measure_off_line(bottom, floor)) > _OFF_FLOOR * swing
    if np.count_nonzero(is_off_floor) > _MOST_OFF * is_off_floor.size:
        return None
    if _is_beat(bottom, floor, moment[~low], value[~low]):
        return None
    elastic = np.maximum(energy - _extend_lines(time, bottom, floor), 0.0)
    whole = find_upper_envelope(time, elastic)
    if whole is None:
        return None
    turned = np.searchsorted(bottom, time) % 2 == 1
    deformation = np.where(turned, -np.sqrt(elastic), np.sqrt(elastic))
    unclear = np.sort(
        np.concatenate([bottom[is_off_floor], time[[1, open_end]]])
    )  # Minima next to the ends are not visible.
    return Swings(time, deformation, unclear, whole, bottom, floor)


def _is_beat(bottom: Samples, floor: Samples, top: Samples, peak: Samples) -> bool:
    """Return True if half cycles alternate as in the beat of two modes with frequency ratios 2:3, 2:5 or 2:7.

    All minima of a beat may lie on one level. The deformation of a single mode stays longer on the side of its preload,
    and is larger there by a similar fraction. In a beat, the longer half cycle is the lower one, or the half cycles
    differ much more in length than in height.

    Parameters
    ----------
    bottom, floor : array of shape (k,)
        Times of the minima [time], and the energy at them [energy].
    top, peak : array of shape (m,)
        Times of the maxima between them [time], and the energy at them [energy].
    """
    middle = (bottom[1:] + bottom[:-1]) / 2
    lasting = np.diff(bottom)
    upper = np.interp(middle, top, peak)
    lower = np.interp(middle, bottom, floor)
    height = upper - lower
    longer = np.diff(lasting) / (lasting[1:] + lasting[:-1])
    higher = np.diff(height) / (height[1:] + height[:-1])
    # The first and the last difference have only one neighbour.
    neighbours = np.stack([longer[:-2], longer[2:]])
    longer, higher = longer[1:-1], higher[1:-1]
    is_uneven = np.abs(longer) > _UNEVEN
    alternating = is_uneven & np.all(longer * neighbours < 0, axis=0)
    opposed = longer * higher < 0
    stretched = np.abs(longer) > _STRETCHED * np.abs(higher)
    beating = alternating & (opposed | stretched)
    return bool(np.count_nonzero(beating) > _MOST_BEATING * beating.size)


def _find_turns(energy: Samples) -> tuple[NDArray[np.intp], int]:
    """Return the indices of the energy extrema, and the last extremum that is completely visible."""
    turning_points = find_turns(energy)[0]
    last = energy.size - 2
    # So many extrema can only be caused by noise.
    if 4 * turning_points.size > energy.size:
        return np.zeros(0, dtype=np.intp), last
    turning_points = np.concatenate([[0], turning_points, [energy.size - 1]])
    turns = []
    swing = float(np.ptp(energy))
    last_extreme = float(energy[0])
    extreme = last_extreme
    direction = 1 if energy[turning_points[1]] > last_extreme else -1
    at = 0
    for turning_point, value in zip(
        turning_points.tolist(), energy[turning_points].tolist(), strict=True
    ):
        if direction * (value - extreme) >= 0:
            extreme, at = value, turning_point
        elif abs(value - extreme) > _SWING * swing:
            turns.append(at)
            swing = abs(extreme - last_extreme) or swing
            last_extreme = extreme
            extreme, at, direction = value, turning_point, -direction
    inner_turns = np.array([turn for turn in turns if turn > 0], dtype=np.intp)
    last_visible = last if direction > 0 else min(at, last)
    return inner_turns, last_visible


def _extend_lines(time: Samples, x: Samples, y: Samples) -> Samples:
    """Return values on the straight lines between points, extrapolated at both ends from the two nearest points."""
    start, end = time[0], time[-1]
    first_slope = (y[1] - y[0]) / (x[1] - x[0])
    last_slope = (y[-2] - y[-1]) / (x[-2] - x[-1])
    at_start = y[0] + first_slope * (start - x[0])
    at_end = y[-1] + last_slope * (end - x[-1])
    times = np.array([start, *x, end])
    values = np.array([at_start, *y, at_end])
    return np.asarray(np.interp(time, times, values))


def _measure_off_line(x: Samples, y: Samples) -> Samples:
    """Return the distance of each of n >= 3 values from the line through its two nearest neighbours."""
    index = np.arange(x.size)
    # The two nearest neighbours of the first value both follow it; those of the last value both precede it.
    middle = np.clip(index, 1, x.size - 2)
    is_end = index != middle
    near = np.where(is_end, middle, middle - 1)
    far = np.where(is_end, 2 * middle - index, middle + 1)
    slope = (y[far] - y[near]) / (x[far] - x[near])
    return np.asarray(y - y[near] - slope * (x - x[near]))


class Envelope(NamedTuple):
    """An exponential through the highest peaks of an energy: ``energy`` at time ``origin``, decaying at ``rate``.

    An envelope below ``floor`` [energy] does not exceed the error of the solver.

    The vibration energy V = E + T falls smoothly, like exp(-alpha t) for mass-proportional damping, and E equals V
    whenever all modes stand still at once. This is rare with several modes, so the envelope is usually too low an
    estimate.
    """

    energy: float
    rate: float
    origin: float
    floor: float

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the estimate of V(t) [energy]."""
        return np.asarray(
            self.energy * np.exp(-self.rate * (np.asarray(t) - self.origin))
        )


def find_upper_envelope(time: Samples, energy: Samples) -> Envelope | None:
    """Find the decaying exponential above all peaks that is lowest at their mean time; None if there are no peaks.

    Parameters
    ----------
    time, energy : array of shape (n,)
        The flight [time], [energy].

    Notes
    -----
    On a logarithmic scale, the exponential is a straight line. It is the edge of the upper convex hull of all points
    at their mean time. Peaks that may be errors of the solver are ignored, because they would tilt
    the line upwards at the end of a decaying vibration.

    Examples
    --------
    >>> t = np.linspace(0.0, 3.0, 301)
    >>> found = find_upper_envelope(t, np.exp(-0.5 * t) * np.sin(8.0 * t) ** 2)
    >>> f"{found.rate:.2f}", f"{found.vibration_energy(0.0):.2f}"
    ('0.50', '1.00')
    """
    at, is_peak = find_turns(energy)
    floor = max(SOLVER_FLOOR * float(np.max(energy)), 0.0)
    high = at[is_peak & (energy[at] > floor)]
    if not high.size:
        return None
    middle = float(np.mean(time[high]))
    peaks = list(zip(time[high].tolist(), np.log(energy[high]).tolist(), strict=True))
    hull: list[tuple[float, float]] = []
    for peak in peaks:
        while len(hull) > 1 and _is_left_turn(hull[-2], hull[-1], peak):
            hull.pop()
        hull.append(peak)
    vertices_after = [i for i, (t, _) in enumerate(hull) if t > middle]
    right_vertex = vertices_after[0] if vertices_after else len(hull) - 1
    t0, top0 = hull[max(right_vertex - 1, 0)]
    t1, top1 = hull[right_vertex]
    rate = (top0 - top1) / (t1 - t0) if t1 > t0 else 0.0
    # The vibration energy never rises, so it cannot exceed the highest peak.
    if rate <= 0:
        highest = max(top for _, top in hull)
        return Envelope(float(np.exp(highest)), 0.0, middle, floor)
    return Envelope(float(np.exp(top0)), rate, t0, floor)


def _is_left_turn(
    a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]
) -> bool:
    """Return True if the path through three points turns left at the second point."""
    return (b[0] - a[0]) * (c[1] - a[1]) >= (b[1] - a[1]) * (c[0] - a[0])
