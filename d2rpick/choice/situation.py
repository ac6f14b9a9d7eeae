"""What the record tells about a td, before any tr is looked at: flight, oscillator, level, kinetic share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.choice import measures
from d2rpick.histories.crossings import find_extrema

if TYPE_CHECKING:
    from d2rpick.choice.lock_in_profile import Profile
    from d2rpick.choice.settings import Settings
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.modes import Modes
    from d2rpick.vibration.one_mode import Mode
    from d2rpick.vibration.part_signs import Parts, PartVibration
    from d2rpick.vibration.span import Span

# Of the fastest mode: what a parabola through three of them misses of a minimum is of the order of 1e-4 of a period.
_POINTS_PER_PERIOD = 64
# Where the scatter of the last period exceeds this share of the vibration energy at td, the vibration has sunk
# into it: its sign is no longer certain.
_DROWNED = 0.2


@dataclass(frozen=True)
class Situation:
    """A history seen from one td [time].

    ``fit`` is None only where no oscillator was looked for; ``span`` is the window in which it describes the record.
    ``parts`` are the deformations of single parts, where their energies are known and an oscillator was looked for;
    ``signed_parts`` is their vibration, where they have a sign.
    """

    history: History
    td: float
    settings: Settings
    flight: Flight
    fit: Identification | None
    span: Span | None
    parts: Parts | None = None
    signed_parts: PartVibration | None = None

    @cached_property
    def mode(self) -> Mode | Modes | None:
        """Mode of the oscillator, or several, where it can be relied on at td."""
        return None if self.no_mode else self.fitted

    @property
    def fitted(self) -> Mode | Modes | None:
        """Mode of the oscillator, or several, that describes the span, whatever it is worth at td."""
        return self.fit.mode if self.fit and self.span else None

    @cached_property
    def no_mode(self) -> str | None:
        """Why there is no mode to rely on at td."""
        if self.fit is None:
            return "no oscillator was looked for (--no-verify)"
        if self.fit.reason:
            what = (
                "the given oscillator does not describe"
                if self.settings.oscillator
                else "no single oscillator describes"
            )
            return f"{what} the record: {self.fit.reason}"
        if not self._in_span(self.td):
            return "the oscillator does not describe the record at td"
        assert self.fitted is not None  # there is a span
        return _drowned(self.history, self.td, self.fitted, self.span)

    @property
    def part_vibration(self) -> PartVibration | None:
        """Vibration of the parts, where it can be relied on at td."""
        return None if self._parts_sunk else self.signed_parts

    @cached_property
    def _parts_sunk(self) -> bool:
        """Whether the vibration of the parts, estimated for want of an oscillator, is below a solver's errors at td."""
        return self.signed_parts is not None and self.signed_parts.sunk(self.td)

    @property
    def drowned(self) -> bool:
        """Whether the vibration is known, but has sunk into the scatter of the record at td."""
        return self._parts_sunk or (self.mode is None and self.fitted is not None and self._in_span(self.td))

    @property
    def basis(self) -> str:
        """What a choice rests on: "parts", "oscillator" (one or several of them) or "energy"."""
        return "parts" if self.part_vibration else "oscillator" if self.mode else "energy"

    @property
    def vibration(self) -> PartVibration | Mode | Modes | None:
        """Deformations with their signs, or None on basis "energy"."""
        return self.part_vibration or self.mode

    @property
    def energy_td(self) -> float:
        """Energy level at td, from the oscillator where one describes the record [energy]."""
        return self.energy_at(self.td)

    @property
    def no_vibration(self) -> str | None:
        """Why no deformation with its sign is known, None where one is."""
        if self.vibration:
            return None
        unsigned = self.parts.unsigned if self.parts else ()
        sunk = ("at td the parts vibrate no more than a solver errs",) if self._parts_sunk else ()
        return "; ".join([self.no_mode or "", *sunk, *(f"{part.name}: {part.reason}" for part in unsigned)])

    @property
    def kinetic_share(self) -> float | None:
        """K, or None on basis "energy" [-]."""
        return measures.kinetic_share(self.vibration, self.td) if self.vibration else None

    @property
    def kinetic_share_estimated(self) -> bool:
        """Whether K comes from the envelope of the energy, for want of an oscillator that describes the record."""
        return self.part_vibration is not None and self.mode is None

    @property
    def prescribed(self) -> bool:
        """Whether the user gave the oscillator, or the window to identify it in."""
        return bool(self.settings.oscillator or self.settings.fit_window)

    @property
    def earliest_tr(self) -> float | None:
        """Start of the flight with the margin, or None when unknown [time]."""
        return None if self.flight.start is None else self.flight.start + self.settings.margin

    @property
    def end_of_load(self) -> str:
        """Words for ``earliest_tr``: the start of the flight, and the margin where one is kept."""
        margin = f" with the margin {self.settings.margin:.6g}" if self.settings.margin else ""
        return f"the end of the load at {self.flight.start:.6g}{margin}"

    @property
    def end_of_flight(self) -> str:
        """Words for ``latest_td``: the end of the flight, and the margin where one is kept."""
        margin = f" with the margin {self.settings.margin:.6g}" if self.settings.margin else ""
        return f"the end of the flight at {self.flight.end:.6g}{margin}"

    @property
    def latest_td(self) -> float:
        """End of the flight with the margin; infinite when no contact was seen [time]."""
        return float("inf") if self.flight.end is None else self.flight.end - self.settings.margin

    @property
    def in_flight(self) -> bool:
        """Whether td lies in a known flight, with the margin."""
        return self.earliest_tr is not None and self.earliest_tr < self.td <= self.latest_td

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Times in (start, end], ascending, where the energy peaks: of the oscillator, of the samples without one."""
        if self.fitted and self.span:
            return self.fitted.peaks(max(start, self.span.start), min(end, self.span.end))
        history = self.history
        return tuple(e.time for e in find_extrema(history.time, history.energy) if e.peak and start < e.time <= end)

    def described(self, time: float) -> bool:
        """Whether there is an oscillator to rely on that describes the record at ``time``."""
        return self.mode is not None and self._in_span(time)

    def _in_span(self, time: float) -> bool:
        return self.span is not None and self.span.start <= time <= self.span.end

    @property
    def measured_span(self) -> tuple[float, float]:
        """First and last time whose deformation can be compared with that at td; nothing is between them without."""
        if self.part_vibration:
            parts = self.part_vibration.parts
            return parts.comparable_since(self.td), float(parts.time[-1])
        return self.span if self.mode and self.span else (np.inf, -np.inf)

    def measured(self, time: float) -> bool:
        """Whether the deformation at ``time`` can be compared with that at td."""
        first, last = self.measured_span
        return first <= time <= last

    @cached_property
    def profile(self) -> Profile | None:
        """Lock-in error over all times before td that can be compared with it; None where it has a closed form."""
        vibration: measures.Vibration
        if self.part_vibration:
            parts = self.part_vibration.parts
            vibration, times = self.part_vibration, parts.time[parts.time >= parts.comparable_since(self.td)]
        elif self.mode and len(self.mode.modes) > 1 and self.span:
            step = 2 * np.pi / self.mode.fastest / _POINTS_PER_PERIOD
            count = max(3, int(np.ceil((self.td - self.span.start) / step)) + 1)
            vibration, times = self.mode, np.linspace(self.span.start, self.td, count)
        else:
            return None
        from d2rpick.choice.lock_in_profile import Profile

        return Profile.of(vibration, times, self.td)

    def turns_since(self, time: float) -> int:
        """How often the sampled energy turns between ``time`` and td."""
        return int(np.count_nonzero((self._turns > time) & (self._turns < self.td)))

    @cached_property
    def _turns(self) -> Samples:
        return np.array([e.time for e in find_extrema(self.history.time, self.history.energy)])

    def energy_at(self, time: float) -> float:
        """Energy at ``time``: of the oscillator where it describes the record, of the samples elsewhere [energy]."""
        if self.mode and self.described(time):
            return float(self.mode.energy(time))
        return self.history.energy_at(time)

    def at(self, td: float) -> Situation:
        """Give the same record, flight and oscillator seen from another ``td``."""
        return replace(self, td=td)


def _drowned(history: History, td: float, mode: Mode | Modes, span: Span | None) -> str | None:
    """Say so when the vibration at td is no more than the scatter of the record about it."""
    assert span is not None  # td lies in it
    last = (history.time >= max(td - 2 * np.pi / mode.omega, span.start)) & (history.time <= max(td, span.start))
    scatter = float(np.sqrt(np.mean((history.energy[last] - mode.energy(history.time[last])) ** 2)))
    vibration = float(mode.vibration_energy(td))
    if scatter <= _DROWNED * vibration:
        return None
    return (
        f"at td the vibration energy {vibration:.3g} has sunk into the scatter of the record, {scatter:.3g}: "
        "the sign of the deformation cannot be told"
    )
