"""Parts whose deformations have signs: these are compared, while levels and times are those of the whole energy."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.vibration import measures
from d2rpick.vibration.lock_in_profile import Profile
from d2rpick.vibration.moments import Moment
from d2rpick.vibration.of_modes import OfModes
from d2rpick.vibration.part_signs import PartMatch, contributions

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.measures import Measured
    from d2rpick.vibration.modes import Mode, Modes
    from d2rpick.vibration.moments import Moments
    from d2rpick.vibration.of_energy import OfEnergy
    from d2rpick.vibration.part_signs import SignedParts, Unsigned
    from d2rpick.vibration.swings import Swings


class OfParts:
    """Signed parts seen from the td of ``whole``, the model of their energy together."""

    basis = "parts"
    unknown = None
    undescribed = "the signs of the parts' deformations cannot be followed from here to td"

    def __init__(self, whole: OfModes | OfEnergy, parts: SignedParts | Swings) -> None:
        self.whole, self.parts = whole, parts

    @property
    def td(self) -> float:
        """Time from which the parts are seen [time]."""
        return self.whole.td

    @property
    def estimated(self) -> str | None:
        """Why K is an estimate: no oscillator describes the whole."""
        return self.whole.unknown

    @property
    def doubts(self) -> tuple[str, ...]:
        """Those about the energy of the whole."""
        return self.whole.doubts

    @property
    def unsigned(self) -> tuple[Unsigned, ...]:
        """Parts without a sign."""
        return self.parts.unsigned

    @property
    def signed(self) -> tuple[str, ...]:
        """Names of the parts with a sign."""
        return self.parts.names

    @property
    def mode(self) -> Mode | Modes | None:
        """Closed form of the energy of the whole, where there is one."""
        return self.whole.mode

    @property
    def kinetic_share(self) -> float:
        """K at td [-]."""
        return measures.kinetic_share(self.parts, self.td)

    @property
    def has_matches(self) -> bool:
        """Always."""
        return True

    def energy(self, time: float) -> float:
        """E of the whole [energy]."""
        return self.whole.energy(time)

    def energies(self, times: Samples) -> Samples:
        """E of the whole at many times, of their shape [energy]."""
        return self.whole.energies(times)

    def described(self, time: float) -> bool:
        """Whether the model of the whole describes its energy there."""
        return self.whole.described(time)

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Times in (start, end] where the energy of the whole peaks [time]."""
        return self.whole.peaks(start, end)

    @property
    def _comparable(self) -> tuple[float, float]:
        """First and last time whose signs can be compared with those at td [time]."""
        return self.parts.comparable_since(self.td), float(self.parts.time[-1])

    @cached_property
    def profile(self) -> Profile:
        """Lock-in error at the samples before td that can be compared with it."""
        time = self.parts.time
        return Profile.of(self.parts, time[time >= self._comparable[0]], self.td)

    def moments(self, tolerance: float, since: float = -np.inf) -> list[Moment]:  # noqa: ARG002  they are few
        """Crossings and standstills of the whole, and closest matches of the parts."""
        matches = [Moment(t, "match", None) for t in self.profile.minima()]
        if not isinstance(self.whole, OfModes):
            return [*self.whole.moments(tolerance), *matches]
        first, last = self._comparable
        turns = np.array([t for t in self.whole.standstills() if first <= t <= last])
        near = measures.lock_in_error(self.parts, turns, self.td) <= tolerance
        return [*self.whole.crossings(), *(Moment(t, "extremum", None) for t in turns[near].tolist()), *matches]

    def measured(self, times: Samples) -> list[Measured | None]:
        """Measures of each time, None where the signs cannot be followed to td."""
        first, last = self._comparable
        inside = [first <= t <= last for t in times.tolist()]
        tr = times[inside]
        if not tr.size:
            return [None] * times.size
        lock_in = measures.lock_in_error(self.parts, tr, self.td)
        tolerance = self.profile.tolerances(tr, lock_in)
        residual = np.array([measures.residual(error, self.kinetic_share) for error in lock_in.tolist()])
        highest = self.parts.residual_bound(residual, tr, self.td)
        found = iter(
            measures.measured(
                self.parts, tr, self.td,
                residual=residual, residual_high=highest, timing_tolerance=tolerance, of_parts=True,
            )
        )  # fmt: skip
        return [next(found) if one else None for one in inside]

    def errors(self, times: Samples) -> Samples:
        """Lock-in errors where the signs match and can be followed to td, else infinite [-]."""
        first, last = self._comparable
        comparable = (times >= first) & (times <= last) & measures.sign_match(self.parts, times, self.td)
        return np.where(comparable, measures.lock_in_error(self.parts, times, self.td), np.inf)

    def knots(self) -> Samples:
        """Those of the whole and the times of the profile [time]."""
        return np.append(self.whole.edges(), self.profile.time)

    def reach(self, moments: Moments) -> Samples:
        """How far the whole leaves the true time open; half a cell of the profile for a match [time]."""
        return self.profile.bounding(moments, self.whole.level_reach(moments.tr))

    def part_matches(self, tr: float) -> tuple[PartMatch, ...]:
        """What each part has of the mismatch."""
        return contributions(self.parts, tr, self.td)
