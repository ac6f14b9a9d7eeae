"""One or several modes that describe the record: energies, crossings and deformations in closed form."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.histories.samples import find_crossings
from d2rpick.vibration import measures
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.moments import Moment
from d2rpick.vibration.of_energy import sampled_before
from d2rpick.vibration.oscillator import replayed_residual
from d2rpick.vibration.uncertainty import fitted_reach, residual_bound, sampled_reach

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.lock_in_profile import Profile
    from d2rpick.vibration.measures import Measured
    from d2rpick.vibration.modes import Modes
    from d2rpick.vibration.moments import Moments
    from d2rpick.vibration.part_signs import PartMatch
    from d2rpick.vibration.span import Span

# Of the fastest mode: what a parabola through three of them misses of a minimum is of the order of 1e-4 of a period.
_POINTS_PER_PERIOD = 64
# Where the scatter of the last period exceeds this share of the vibration energy at td, the vibration has sunk
# into it: its sign is no longer certain.
_DROWNED = 0.2
# Of a radian: below, a time is the same but for rounding.
_ZERO = 1e-9


class OfModes:
    """The ``mode`` of a ``fit``, or several, that describes a record within ``span``, seen from a ``td`` in it."""

    basis = "oscillator"
    undescribed = "not described by the oscillator"
    unknown = estimated = None
    unsigned = signed = ()

    def __init__(
        self, history: History, td: float, fit: Identification, span: Span, doubts: tuple[str, ...] = ()
    ) -> None:
        assert fit.mode
        self.history, self.td = history, td
        self.fit, self.mode, self.span = fit, fit.mode, span
        self.doubts = doubts

    @cached_property
    def sunk(self) -> str | None:
        """Say so when the vibration at td is no more than the scatter of the record about it."""
        start, end = max(self.td - 2 * np.pi / self.mode.omega, self.span.start), max(self.td, self.span.start)
        time, energy = self.history.between(start, end)
        scatter = float(np.sqrt(np.mean((energy - self.mode.energy(time)) ** 2)))
        vibration = float(self.mode.vibration_energy(self.td))
        if vibration > 0 and scatter <= _DROWNED * vibration:  # both may be too small for a number
            return None
        return (
            f"at td the vibration energy {vibration:.3g} is below the noise of the record, {scatter:.3g}: "
            "the sign of the deformation is unknown"
        )

    @property
    def kinetic_share(self) -> float:
        """K at td [-]."""
        return measures.kinetic_share(self.mode, self.td)

    @property
    def has_matches(self) -> bool:
        """Only of several modes."""
        return self.profile is not None

    def energy(self, time: float) -> float:
        """E of the mode where it describes the record, of the samples elsewhere [energy]."""
        return float(self.mode.energy(time)) if self.described(time) else self.history.energy_at(time)

    def energies(self, times: Samples) -> Samples:
        """E at many times, of their shape [energy]."""
        return self._each(times, self.mode.energy, self.history.energies_at)

    def described(self, time: float) -> bool:
        """Whether ``time`` lies in the window that the mode describes."""
        return self.span.start <= time <= self.span.end

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Times in (start, end], within the span, where the energy of the mode peaks [time]."""
        return self.mode.peaks(max(start, self.span.start), min(end, self.span.end))

    def moments(self, tolerance: float, since: float = -np.inf) -> list[Moment]:  # noqa: ARG002  they are few
        """Crossings of the level at td, standstills near it and closest matches."""
        return self.moments_with(self.mode.level_crossings(self.td, self.before), tolerance)

    def moments_with(self, passed: Sequence[float] | Samples, tolerance: float) -> list[Moment]:
        """The same where it is known at which times the mode ``passed`` the level [time]."""
        turns = np.array(self.standstills())
        near = measures.lock_in_error(self.mode, turns, self.td) <= tolerance
        turning = [Moment(t, "extremum", None) for t in turns[near].tolist()]
        matches = [Moment(t, "match", None) for t in (self.profile.minima() if self.profile else ())]
        return [*self.crossings(passed), *turning, *matches]

    @property
    def before(self) -> float:
        """Just before the span: its first sample counts like any other [time]."""
        return self.span.start - _ZERO / self.mode.fastest

    def crossings(self, passed: Sequence[float] | Samples | None = None) -> list[Moment]:
        """Crossings of the level at td: of the samples before the span, exact ones, which may be known, within it."""
        start, level = self.span.start, self.energy(self.td)
        found = []
        if start > self.history.time[0]:
            sampled = find_crossings(*sampled_before(self.history, self.td, level), level)
            found = [Moment(one.time, "crossing", one.rising) for one in sampled if one.time < start]
        passed = self.mode.level_crossings(self.td, self.before) if passed is None else passed
        times = np.maximum(passed, start)
        slopes = self.mode.energy_slopes(times)[0]
        return found + [Moment(t, "crossing", bool(up > 0)) for t, up in zip(times.tolist(), slopes, strict=True)]

    def standstills(self) -> list[float]:
        """Times within the span, up to td itself, where the energy turns [time]."""
        start, after = self.span.start, self.td - _ZERO / self.mode.fastest  # td may be an extremum itself
        times = np.maximum(self.mode.extrema(self.before, after), start)
        return [t for t in times if self.described(float(t))]

    @cached_property
    def profile(self) -> Profile | None:
        """Lock-in error over the span before td; None without one, or for one mode, of which all has a closed form."""
        if isinstance(self.mode, Mode) or self.td <= self.span.start:
            return None
        step = 2 * np.pi / self.mode.fastest / _POINTS_PER_PERIOD
        count = max(3, int(np.ceil((self.td - self.span.start) / step)) + 1)
        from d2rpick.vibration.lock_in_profile import Profile  # not above: one mode does without it

        return Profile.of(self.mode, np.linspace(self.span.start, self.td, count), self.td)

    def measured(self, times: Samples) -> list[Measured | None]:
        """Measures of each time, None outside of the span."""
        inside = self.inside(times)
        tr = times[inside]
        if not tr.size:
            return [None] * times.size
        if isinstance(self.mode, Mode):
            tolerance = measures.timing_tolerance(self.mode, tr, self.td)
        else:
            assert self.profile is not None
            tolerance = self.profile.tolerances(tr, measures.lock_in_error(self.mode, tr, self.td))
        return spread(measured(self.fit, self.mode, tr, self.td, tolerance), inside)

    def inside(self, times: Samples) -> NDArray[np.bool_]:
        """Which times lie in the window that the mode describes."""
        return (times >= self.span.start) & (times <= self.span.end)

    def errors(self, times: Samples) -> Samples:
        """Lock-in errors where the signs match and the mode describes the record, else infinite [-]."""
        comparable = self.inside(times)
        comparable &= measures.sign_match(self.mode, times, self.td)
        return np.where(comparable, measures.lock_in_error(self.mode, times, self.td), np.inf)

    def knots(self) -> Samples:
        """Standstills, ends of the span and times of the profile [time]."""
        return np.append(self.edges(), self.profile.time if self.profile else ())

    def edges(self) -> Samples:
        """Standstills and ends of the span, between which the energy runs monotone [time]."""
        return np.concatenate([self.mode.extrema(float(self.history.time[0]), self.td), self.span])

    def reach(self, moments: Moments) -> Samples:
        """How far fit, sampling and printed digits leave the true time open; half a cell of the profile for a match."""
        reach = self.level_reach(moments.tr)
        return self.profile.bounding(moments, reach) if self.profile else reach

    def level_reach(self, times: Samples) -> Samples:
        """How far from each time the energy may have the level at td [time]."""
        return self._each(
            times,
            lambda inside: fitted_reach(self.history, self.fit, self.mode, inside, self.td),
            lambda outside: sampled_reach(self.history, outside, self.td, self.energy(self.td)),
        )

    def _each(
        self, times: Samples, inside: Callable[[Samples], Samples], outside: Callable[[Samples], Samples]
    ) -> Samples:
        """Give one thing for times in the window that the mode describes, another for those outside, of their shape."""
        here = self.inside(times)
        if here.all():  # as nearly always
            return inside(times)
        found = np.empty(times.shape)
        found[here], found[~here] = inside(times[here]), outside(times[~here])
        return found

    def part_matches(self, tr: float) -> tuple[PartMatch, ...]:  # noqa: ARG002  by the protocol
        """Nothing: single parts are not known."""
        return ()


def measured(
    fit: Identification, mode: Mode | Modes, tr: Samples, td: Samples | float, tolerance: Samples
) -> Iterator[Measured]:
    """Give the measures of each tr of shape (n,), for one ``td`` or each for its own, with its timing tolerance."""
    residual = replayed_residual(mode, tr, td)
    highest = residual_bound(residual, fit, tr, td)
    found = measures.measured(
        mode, tr, td, residual=residual, residual_high=highest, timing_tolerance=tolerance, of_parts=False
    )
    return iter(found)


def spread(found: Iterator[Measured], inside: NDArray[np.bool_]) -> list[Measured | None]:
    """Put what was found in its places, None beside them."""
    return [next(found) if one else None for one in inside.tolist()]
