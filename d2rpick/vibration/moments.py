"""Find candidate times for tr, with their errors.

At most of them the total energy equals that at td. Others are extrema of the energy near this level, and times at which
the deformations match best. The energy around a td is known from its samples or from modes that describe the samples.
"""

from __future__ import annotations

from itertools import pairwise
from math import sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.histories.samples import find_crossings, find_turns
from d2rpick.vibration import measures

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Precision, Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.modes import Mode
    from d2rpick.vibration.span import Span

    Passages = tuple[Samples, NDArray[np.bool_]]


# The sign of the deformation is certain if the misfit is at most this fraction of the vibration energy at td [-].
_DROWNED = 0.2
# Times whose phases differ by at most this are treated as equal [rad].
_ZERO = 1e-9

# "crossing": the energy crosses its level at td.
# "extremum": the energy has an extremum near its level at td.
# "match": the deformation of several modes is similar to that at td.
# "start": the start of a flight in which nothing vibrates.
# "given": the user gave this time.
_KINDS: Final = ("crossing", "extremum", "match", "start", "given")
# Safety factor on the second differences of the energy, because E'' may be larger between the samples [-].
# With a factor of 1.25, the error bounds contain 99 % of the true crossings of random vibrations.
# The safety factor was tested with at least 8 samples per period.
_BEND_RESERVE = 1.25
# Number of standard deviations that bound the error of a time; 3 cover 99.7 % of normal errors.
_DEVIATIONS = 3.0
# Number of standard deviations that bound a sum of independent rounding errors; 2.6 cover 99 %.
_ROUNDING_DEVIATIONS = 2.6
# Assumed ratio of the largest systematic misfit to its rms [-], which holds for a sinusoidal misfit.
_PEAK_OF_REST = sqrt(2)
# Safety margin for times between the samples, as a fraction of the output interval [-].
_BETWEEN_SAMPLES = 1e-3


class SampledEnergy:
    """The samples of a record for one ``td``, with linear interpolation."""

    mode: Mode | None = None

    def __init__(self, history: History, td: float) -> None:
        self.history, self.td = history, td

    def energy(self, time: float) -> float:
        """Return the energy at a time [energy], from the modes if they describe that time, otherwise the samples."""
        if self.mode and self.described(time):
            return float(self.mode.energy(time))
        return self.history.energy_at(time)

    def energies(self, times: Samples) -> Samples:
        """Return the energy E at the given times, in their shape [energy]."""
        return self.history.energies_at(times)

    def described(self, time: float) -> bool:  # noqa: ARG002  the interface requires this argument
        """Return True if modes describe the energy at a time."""
        return False

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Return the times in (start, end] at which the energy peaks [time], in ascending order."""
        peaks = self.history.peaks
        return tuple(peaks[(start < peaks) & (peaks <= end)].tolist())

    def crossings(self, since: float) -> Passages:
        """Return the times (k,) from ``since`` to td at which the energy crosses the level, and whether it rises."""
        time, energy = self._sampled_before(since)
        times, rising = find_crossings(time, energy, energy[-1])
        in_question = (since <= times) & (times < self.td)
        return times[in_question], rising[in_question]

    def turns_near(self, tolerance: float, since: float) -> Samples:
        """Return the times (k,) from ``since`` to td at which the energy has an extremum near the level at td."""
        time, energy = self._sampled_before(since)
        turns, _ = find_turns(energy)
        level_errors = measures.level_error(energy[turns], energy[-1])
        near = time[turns[level_errors <= tolerance]]
        return near[near >= since]

    def _sampled_before(self, since: float) -> tuple[Samples, Samples]:
        """Return times and energies from the last sample before ``since`` up to td, which has the level."""
        first, last = np.searchsorted(self.history.time, (since, self.td))
        states_before = slice(max(int(first) - 1, 0), int(last))
        time = self.history.time[states_before]
        energy = self.history.energy[states_before]
        return np.append(time, self.td), np.append(energy, self.energy(self.td))

    def edges(self) -> Samples:
        """Return the times before td between which the energy of modes is monotone [time]; empty for samples."""
        return np.zeros(0)

    def reach(self, times: Samples) -> Samples:
        """Return the uncertainty of each time at which the energy equals the energy at td [time]."""
        return compute_sampled_reach(self.history, times, self.td, self.energy(self.td))


class OscillatorEnergy(SampledEnergy):
    """A ``mode``, its ``fit`` to a record in the window ``span``, and a ``td`` in this window."""

    mode: Mode

    def __init__(
        self, history: History, td: float, fit: Identification, span: Span
    ) -> None:
        super().__init__(history, td)
        assert fit.mode
        self.fit, self.mode, self.span = fit, fit.mode, span

    @cached_property
    def sunk(self) -> str | None:
        """Return why the sign is unknown if the vibration at td does not exceed the noise; otherwise None."""
        start, end = (
            max(self.td - 2 * np.pi / self.mode.omega, self.span.start),
            max(self.td, self.span.start),
        )
        time, energy = self.history.between(start, end)
        vibration = float(self.mode.vibration_energy(self.td))
        fit = self.fit
        fitted = fit.start <= start and end <= fit.end
        if (
            fitted
            and fit.rms * np.sqrt(self.history.time.size / time.size)
            < _DROWNED * vibration
        ):
            return None  # Even the misfit of the whole record would be below the limit.
        scatter = float(np.sqrt(np.mean((energy - self.mode.energy(time)) ** 2)))
        # Both energies may underflow to zero.
        if vibration > 0 and scatter <= _DROWNED * vibration:
            return None
        finding = f"at td the vibration energy {vibration:.3g} is below the noise of the record, {scatter:.3g}"
        return f"{finding}: the sign of the deformation is unknown"

    def energies(self, times: Samples) -> Samples:
        """Return the energies at the given times, in the shape of the times [energy]."""
        return self._each(times, self.mode.energy, self.history.energies_at)

    def described(self, time: float) -> bool:
        """Return True if ``time`` lies in the window described by the modes."""
        return self.span.start <= time <= self.span.end

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Return the times in (start, end] within the span at which the energy of the modes peaks [time]."""
        return self.mode.peaks(max(start, self.span.start), min(end, self.span.end))

    @property
    def before(self) -> float:
        """Return a time [time] just before the span, so that the span's first sample is treated like all others."""
        return self.span.start - _ZERO / self.mode.omega

    def crossings(self, since: float) -> Passages:
        """Return the crossing times, interpolated before the span and exact inside it, and whether the energy rises."""
        times = np.maximum(
            self.mode.level_crossings(self.td, self.before), self.span.start
        )
        slopes, _ = self.mode.energy_slopes(times)
        sampled_times, sampled_rising = self.crossings_before(since)
        return (
            np.append(sampled_times, times),
            np.append(sampled_rising, slopes > 0),
        )

    def crossings_before(self, since: float) -> Passages:
        """Return the crossings of the samples before the span."""
        if self.span.start <= max(since, self.history.time[0]):
            return np.zeros(0), np.zeros(0, dtype=bool)
        times, rising = super().crossings(since)
        is_before = times < self.span.start
        return times[is_before], rising[is_before]

    def standstills(self) -> Samples:
        """Return the times in the span, up to td, at which the energy has an extremum [time]."""
        # td itself may be an extremum that rounding places before td.
        end = self.td - _ZERO / self.mode.omega
        times = np.maximum(self.mode.extrema(self.before, end), self.span.start)
        return times[self.within(times)]

    def edges(self) -> Samples:
        """Return the times of the energy extrema and span ends, between which the energy is monotone [time]."""
        return np.concatenate(
            [self.mode.extrema(float(self.history.time[0]), self.td), self.span]
        )

    def reach(self, times: Samples) -> Samples:
        """Return the uncertainty of the crossing times due to the fit, the sampling and the printed digits [time]."""
        return self._each(
            times,
            lambda inside: compute_fitted_reach(
                self.history, self.fit, self.mode, inside, self.td
            ),
            super().reach,
        )

    def within(self, times: Samples) -> NDArray[np.bool_]:
        """Return a mask of the times that lie in the window described by the modes."""
        return (times >= self.span.start) & (times <= self.span.end)

    def _each(
        self,
        times: Samples,
        inside: Callable[[Samples], Samples],
        outside: Callable[[Samples], Samples],
    ) -> Samples:
        """Apply one function to times in the window described by the modes, and another function to all other times."""
        is_described = self.within(times)
        if is_described.all():  # Usually, the modes describe all times.
            return inside(times)
        energies = np.empty(times.shape)
        energies[is_described], energies[~is_described] = (
            inside(times[is_described]),
            outside(times[~is_described]),
        )
        return energies


class ModalEnergy(SampledEnergy):
    """The samples of a record for one ``td``, interpolated with the help of the modes that describe a window.

    ``elastic_energy`` returns the elastic energy of the modes at given times. ``window`` contains the first and the
    last time that the modes describe [time].
    """

    def __init__(
        self,
        history: History,
        td: float,
        elastic_energy: Callable[[Samples], Samples],
        window: tuple[float, float],
    ) -> None:
        super().__init__(history, td)
        self.elastic_energy = elastic_energy
        self.window = window

    def energy(self, time: float) -> float:
        """Return the energy at a time [energy]."""
        return float(self.energies(np.array([time]))[0])

    def energies(self, times: Samples) -> Samples:
        """Return the energies at the given times (n,) [energy].

        A straight line between two states of a coarse record misses the energy by much, because the energy of a
        vibration is curved. The modes give the difference between the curve and the line.
        """
        energies = self.history.energies_at(times)
        first, last = self.window
        is_described = (times >= first) & (times <= last)
        described = times[is_described]
        states = self.history.time
        after = np.clip(np.searchsorted(states, described), 1, states.size - 1)
        start = states[after - 1]
        step = states[after] - start
        fraction = np.divide(
            described - start, step, out=np.zeros(described.shape), where=step > 0
        )
        elastic_at_start = self.elastic_energy(start)
        rise = self.elastic_energy(states[after]) - elastic_at_start
        on_line = elastic_at_start + fraction * rise
        energies[is_described] += self.elastic_energy(described) - on_line
        return energies


@dataclass(frozen=True, eq=False, repr=False)
class Moments:
    """Candidate times for tr, before any error is computed, as columns of shape (n,).

    Columns save time, because noise may cause tens of thousands of candidates. ``tr`` contains the times [time], and
    ``kind`` the index of the kind's name. ``rising`` is 1 if the energy rises, -1 if it falls, and 0 otherwise.
    """

    tr: Samples
    kind: NDArray[np.int8]
    rising: NDArray[np.int8]

    @classmethod
    def of(cls, kind: str, times: Samples | Sequence[float]) -> Moments:
        """Make moments of one kind, without the direction in which the energy changes."""
        none = np.zeros(len(times), np.int8)
        return cls(
            np.array(times, dtype=float), none + np.int8(_KINDS.index(kind)), none
        )

    @classmethod
    def of_level(
        cls, crossings: Samples, rising: NDArray[np.bool_], *others: Moments
    ) -> Moments:
        """Make moments from level crossings (k,), followed by further moments."""
        kind = np.zeros(crossings.size, np.int8)
        sides = np.where(rising, 1, -1).astype(np.int8)
        return cls.joined([cls(crossings, kind, sides), *others])

    @classmethod
    def joined(cls, some: Iterable[Moments]) -> Moments:
        """Concatenate several moments in the given order."""
        return cls(
            *map(
                np.concatenate,
                zip(
                    *((moments.tr, moments.kind, moments.rising) for moments in some),
                    strict=True,
                ),
            )
        )

    def are(self, kind: str) -> NDArray[np.bool_]:
        """Return a mask of the moments of the given kind."""
        return np.asarray(self.kind == _KINDS.index(kind))

    def at(self, places: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Moments:
        """Return the moments at given indices, in the order of the indices, or those selected by a mask."""
        return Moments(self.tr[places], self.kind[places], self.rising[places])

    def __len__(self) -> int:
        return self.tr.size

    def __getitem__(self, place: int) -> tuple[float, str, bool | None]:
        """Return tr, kind and direction of one moment; the direction is None at an extremum of the energy."""
        rising = int(self.rising[place])
        return (
            float(self.tr[place]),
            _KINDS[self.kind[place]],
            rising > 0 if rising else None,
        )


def find_moments_of_mode(
    seen: Sequence[OscillatorEnergy], tolerance: float, since: Sequence[float]
) -> list[Moments]:
    """Return the moments of one mode in one window for each ``seen`` energy and its td, in ascending order.

    Extrema of the energy are moments if their error is within the ``tolerance`` [-]. Crossings before the time in
    ``since`` for the respective energy [time] may be omitted.
    """
    mode = seen[0].mode
    td = np.array([energy.td for energy in seen])
    row, times = mode.all_level_crossings(td, seen[0].before)
    times = np.maximum(times, seen[0].span.start)
    early = [
        energy.crossings_before(first)
        for energy, first in zip(seen, since, strict=True)
    ]
    crossings = np.concatenate([*(sampled for sampled, _ in early), times])
    rising = np.concatenate(
        [*(up for _, up in early), mode.energy_slopes(times)[0] > 0]
    )
    turns = seen[int(td.argmax())].standstills()
    # td itself may be an extremum that rounding places before td.
    of, which = np.nonzero(turns < (td - _ZERO / mode.omega)[:, np.newaxis])
    near = measures.lock_in_error(mode, turns[which], td[of]) <= tolerance
    moments = Moments.of_level(
        crossings, rising, Moments.of("extremum", turns[which[near]])
    )
    row = np.concatenate(
        [
            np.repeat(np.arange(td.size), [sampled.size for sampled, _ in early]),
            row,
            of[near],
        ]
    )
    order = np.lexsort((moments.tr, row))
    moments = moments.at(order)
    ends = np.searchsorted(row[order], np.arange(td.size + 1)).tolist()
    return [moments.at(slice(*limits)) for limits in pairwise(ends)]


def compute_sampled_reach(
    history: History, times: Samples, td: float, level: float
) -> Samples:
    """Return the error of a tr that is interpolated linearly between samples: its distance from the crossing [time].

    Parameters
    ----------
    history : History
    times : array of shape (n,)
        Switch times tr at which the energy equals ``level`` [time].
    td : float
        [time]
    level : float
        Energy assumed at td [energy]; it is that of the samples or of a fit.

    Returns
    -------
    array of shape (n,)
        The true crossing lies between tr - x and tr + x [time]; x is at most two output intervals.
    """
    time = history.time
    energy = history.energy
    cell, interval = _find_cells(time, times)
    at_td, _ = _find_cells(time, np.atleast_1d(td))
    bend = estimate_curvature(time, energy, times)
    # The error of linear interpolation is E''/2 times the distances to both neighbouring samples.
    off_td = (
        float(estimate_curvature(time, energy, td))
        * (td - time[at_td])
        * (time[at_td + 1] - td)
        / 2
    )
    curved = _BEND_RESERVE * (bend * interval**2 / 8 + off_td)
    of_tr = _compute_rounding(history, times)
    of_td = _compute_rounding(history, np.atleast_1d(td))
    largest, square = (a + b for a, b in zip(of_tr, of_td, strict=True))
    rounded = np.minimum(largest, _ROUNDING_DEVIATIONS * np.sqrt(square))
    slope = np.abs((energy[cell + 1] - energy[cell]) / interval)
    error = np.hypot(curved, rounded) + abs(level - history.energy_at(td))
    return np.minimum(compute_reach(slope, bend, error), 2 * interval)


def compute_fitted_reach(
    history: History, fit: Identification, mode: Mode, times: Samples, td: float
) -> Samples:
    """Return the error of tr if both tr and the energy level at td are computed from the fitted oscillator [time].

    The energy error is that of the fitted curve at tr and at td. It consists of the standard deviation due to the
    scatter of the record about the curve, and the systematic part of the misfit. The arguments and the result are those
    of ``compute_sampled_reach``, but there is no ``level``.
    """
    all_times = np.append(times, td)
    deviation = _DEVIATIONS * fit.energy_deviation(
        all_times
    ) + _PEAK_OF_REST * _estimate_local_rest(fit, mode, all_times)
    error = deviation[:-1] + deviation[-1]
    slope, bend = mode.energy_slopes(times)
    distance = compute_reach(np.abs(slope), np.abs(bend), error)
    # The fit limits the error of a crossing to a quarter of a period, not to an output interval.
    quanta = (
        _compute_half_quanta(history.time_precision, times)
        + history.time_precision.quantum(td) / 2
    )
    return (
        np.minimum(distance, np.pi / 2 / mode.omega)
        + _BETWEEN_SAMPLES * history.step
        + quanta
    )


def _estimate_local_rest(fit: Identification, mode: Mode, at: Samples) -> Samples:
    """Return the rms of the systematic misfit near each time, increased if the vibration is larger [energy]."""
    return np.asarray(
        fit.structure * np.maximum(1.0, mode.vibration_energy(at) / fit.vibration)
    )


def _find_cells(time: Samples, at: Samples) -> tuple[NDArray[np.intp], Samples]:
    """Return the index of the sample before each time, and the interval to the next sample."""
    cell = np.clip(np.searchsorted(time, at, side="right") - 1, 0, time.size - 2)
    return cell, time[cell + 1] - time[cell]


def _compute_rounding(history: History, at: Samples) -> tuple[Samples, Samples]:
    """Return the largest error and the mean square error of interpolated energies due to printed digits [energy].

    The energies and times of both neighbours have errors of up to half of their last printed digit, uniformly
    distributed.
    """
    cell, interval = _find_cells(history.time, at)
    distance = at - history.time[cell]
    share = distance / interval
    slope = (history.energy[cell + 1] - history.energy[cell]) / interval
    interpolated = history.energy[cell] + slope * distance
    of_energy = _compute_half_quanta(history.energy_precision, interpolated)
    of_time = slope * _compute_half_quanta(history.time_precision, at)
    # A uniform distribution has a variance of a third of its squared half-width; interpolation averages two values.
    weights = (1 - share) ** 2 + share**2
    square = (of_energy**2 + of_time**2) / 3 * weights
    return of_energy + np.abs(of_time), square


def _compute_half_quanta(precision: Precision, values: Samples) -> Samples:
    """Return half of the rounding step of each value."""
    return precision.quanta(values) / 2


def estimate_curvature(time: Samples, energy: Samples, at: Samples | float) -> Samples:
    """Return the largest |E''| near ``at``, from the four surrounding second divided differences [energy/time^2].

    The result is zero if the record has fewer than three samples.
    """
    at = np.asarray(at, dtype=np.float64)
    if time.size < 3:
        return np.zeros(at.shape)
    cell = np.searchsorted(time, at, side="right") - 1
    first = np.clip(cell[..., np.newaxis] + np.arange(-2, 2), 0, time.size - 3)
    t0, t1, t2 = time[first], time[first + 1], time[first + 2]
    e0, e1, e2 = energy[first], energy[first + 1], energy[first + 2]
    slope_before = (e1 - e0) / (t1 - t0)
    slope_after = (e2 - e1) / (t2 - t1)
    curvature = np.abs(2 * (slope_after - slope_before) / (t2 - t0))
    return np.asarray(curvature.max(axis=-1))


def compute_reach(
    slope: Samples | float, bend: Samples | float, error: Samples | float
) -> Samples:
    """Return the error of a crossing time due to the energy error ``error`` [time].

    The result is the smaller root x of slope x - bend x^2/2 = error. If there is no root, the curve may have an
    extremum before it reaches the level; the result is then sqrt(2 error/bend), the distance at which the curvature
    alone causes the error.

    Parameters
    ----------
    slope, bend, error : array_like
        |E'| [energy/time], |E''| [energy/time^2] and the energy error [energy]; none is negative.

    Examples
    --------
    >>> float(compute_reach(2.0, 0.0, 1.0)), float(compute_reach(0.0, 2.0, 1.0))
    (0.5, 1.0)
    """
    slope, bend, error = np.broadcast_arrays(
        *(np.asarray(v, dtype=np.float64) for v in (slope, bend, error))
    )
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        steep = slope / error
        # The bend is divided by the error, because squares of energies might overflow.
        curved = bend / error
        root = steep**2 - 2 * curved
        regular = 2 / (steep + np.sqrt(np.maximum(root, 0)))
        turning = np.sqrt(2 / curved)
    return np.where(error == 0, 0.0, np.where(root > 0, regular, turning))
