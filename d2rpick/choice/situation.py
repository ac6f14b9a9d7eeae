"""What the record tells about a td, before any tr is looked at: flight, vibration, level, kinetic share."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.choice.rest import nothing_vibrates
from d2rpick.histories.digits import sum_as_read
from d2rpick.vibration.model import Evidence, describing, model_at
from d2rpick.vibration.span import Fits

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.choice.settings import Settings
    from d2rpick.flight.bodies import Bodies
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.model import Vibration


@dataclass(frozen=True, eq=False, repr=False)
class Situation:
    """A history seen from one td [time].

    ``evidence`` is what was found of a vibration in it, ``fits`` is what was tried.
    """

    history: History
    td: float
    settings: Settings
    flight: Flight
    evidence: Evidence
    fits: Fits = field(default_factory=Fits)

    @cached_property
    def vibration(self) -> Vibration:
        """What can be relied on at td."""
        return model_at(self.history, self.td, self.evidence)

    @property
    def basis(self) -> str:
        """What a choice rests on: "parts", "oscillator" (one or several of them), "swings" or "energy"."""
        return self.vibration.basis

    @property
    def energy_td(self) -> float:
        """Energy level at td, from the oscillator where one describes the record [energy]."""
        return self.vibration.energy(self.td)

    @property
    def kinetic_share(self) -> float | None:
        """K, or None on basis "energy" and at rest [-]."""
        return None if self.at_rest else self.vibration.kinetic_share  # where nothing vibrates there is no share

    @property
    def earliest_tr(self) -> float | None:
        """Start of the flight with the margin, or None when unknown [time]."""
        start = self.flight.start
        return None if start is None else sum_as_read(start, self.settings.margin or 0.0)

    @property
    def latest_td(self) -> float:
        """End of the flight with the margin; infinite when no contact was seen [time]."""
        end = self.flight.end
        return float("inf") if end is None else sum_as_read(end, -(self.settings.margin or 0.0))

    @cached_property
    def at_rest(self) -> bool:
        """Whether nothing vibrates in the flight."""
        start = self.earliest_tr
        if start is None or not self.in_flight:
            return False
        window, deformed = (start, self.flight.end), self.vibration.unknown is None
        return nothing_vibrates(self.history, window, self.td, deformed=deformed)

    @cached_property
    def bodies(self) -> Bodies | None:
        """How the bodies that the parts to be switched become drift in the flight; None where no parts show it."""
        if self.flight.parts is None:
            return None
        from d2rpick.flight.bodies import bodies_in_flight  # not above: a table has no parts

        told, placement = self.settings.bodies, self.settings.placement
        return self.fits.once(
            ("drift", self.flight, told), lambda: bodies_in_flight(self.history, self.flight, told, placement)
        )

    def position_errors(self, times: Samples) -> Samples:
        """How far a body is out of place at td when it is frozen at each of ``times`` [length]; NaN where unknown."""
        return np.full(times.shape, np.nan) if self.bodies is None else self.bodies.errors(times, self.td)

    def errors(self, times: Samples) -> Samples:
        """What a tolerance is held against, of the shape of ``times`` [-]: at rest nothing, else the vibration's."""
        return np.zeros(times.shape) if self.at_rest else self.vibration.errors(times)

    @property
    def in_flight(self) -> bool:
        """Whether td lies in a known flight, with the margin."""
        return self.earliest_tr is not None and self.earliest_tr < self.td <= self.latest_td

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Times in (start, end], ascending, where the energy peaks: of an oscillator, of the samples without one."""
        return describing(self.history, self.td, self.evidence).peaks(start, end)

    def turns_since(self, times: Samples) -> NDArray[np.intp]:
        """How often the sampled energy turns between each of ``times`` and td, of the shape of ``times``."""
        turns = self.history.turns
        after = np.searchsorted(turns, self.td) - np.searchsorted(turns, times, side="right")
        return np.asarray(np.maximum(after, 0))

    def sees_as(self, other: Situation) -> bool:
        """Whether the two, of one record, have one flight and one evidence: then only their td differ."""
        own, its = self.evidence, other.evidence
        same = own.fit is its.fit and own.parts is its.parts and own.swings is its.swings
        return same and own.span == its.span and self.flight == other.flight

    def at(self, td: float) -> Situation:
        """Give the same record, flight and evidence seen from another ``td``."""
        return self if td == self.td else replace(self, td=td)
