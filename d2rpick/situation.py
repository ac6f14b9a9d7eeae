"""What the record tells about a td, before any tr is looked at: flight, oscillator, level, kinetic share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick import measures
from d2rpick.errors import RangeError
from d2rpick.flight import Flight, Span, described_span, energy_flight, identify_within, span_of
from d2rpick.identify import Identification, assess, identify
from d2rpick.momentum import FreeFlight, flight_around, to_be_asked

if TYPE_CHECKING:
    from d2rpick.history import History
    from d2rpick.mode import Mode

# Where the scatter of the last period exceeds this share of the vibration energy at td, the vibration has sunk
# into it: its sign is no longer certain.
_DROWNED = 0.2
# Beyond, squares of energies are no numbers any more; no unit system comes near.
_LARGEST = 1e150


@dataclass(frozen=True)
class Settings:
    """What the analyst asks for; times in the unit of the history.

    ``after``: the load ends here (None: found from the record).  ``margin``: kept clear after the load and before
    the next contact.  ``tolerance``: on the lock-in error, on the level error where no oscillator is known.
    ``max_kinetic_share``, ``max_residual``: limits that a recommendation must keep, or None.  ``oscillator``:
    given instead of identified.  ``fit_window``: the oscillator is identified there.  ``replay`` False: judge by
    the energy level alone.
    """

    after: float | None = None
    margin: float = 0.0
    tolerance: float = 0.2
    max_kinetic_share: float | None = None
    max_residual: float | None = None
    oscillator: Mode | None = None
    fit_window: tuple[float, float] | None = None
    replay: bool = True


@dataclass(frozen=True)
class Situation:
    """A history seen from one td [time].

    ``fit`` is None only where no oscillator was looked for; ``span`` is the window in which it describes the record.
    """

    history: History
    td: float
    settings: Settings
    flight: Flight
    fit: Identification | None
    span: Span | None

    @cached_property
    def mode(self) -> Mode | None:
        """Mode of the oscillator where it can be relied on at td."""
        return None if self.no_mode else self.fitted

    @property
    def fitted(self) -> Mode | None:
        """Mode of the oscillator that describes the span, whatever it is worth at td."""
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
    def drowned(self) -> bool:
        """Whether an oscillator describes the record at td, but has sunk into its scatter there."""
        return self.mode is None and self.fitted is not None and self._in_span(self.td)

    @property
    def basis(self) -> str:
        """What a choice rests on: "oscillator" or "energy"."""
        return "oscillator" if self.mode else "energy"

    @property
    def energy_td(self) -> float:
        """Energy level at td, from the oscillator where one describes the record [energy]."""
        return self.energy_at(self.td)

    @property
    def kinetic_share(self) -> float | None:
        """K, or None on basis "energy" [-]."""
        return measures.kinetic_share(self.mode, self.td) if self.mode else None

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

    def described(self, time: float) -> bool:
        """Whether there is an oscillator to rely on that describes the record at ``time``."""
        return self.mode is not None and self._in_span(time)

    def _in_span(self, time: float) -> bool:
        return self.span is not None and self.span.start <= time <= self.span.end

    def energy_at(self, time: float) -> float:
        """Energy at ``time``: of the oscillator where it describes the record, of the samples elsewhere [energy]."""
        if self.mode and self.described(time):
            return float(self.mode.energy(time))
        return self.history.energy_at(time)

    def at(self, td: float) -> Situation:
        """Give the same record, flight and oscillator seen from another ``td``."""
        return replace(self, td=td)


def examine(history: History, td: float, settings: Settings) -> Situation:
    """Find the flight around ``td`` and the oscillator in it.

    RangeError when td, --after or the fit window lie outside the record, or it has fewer than 3 states.
    """
    if history.time.size < 3:
        found = "1 state was" if history.time.size == 1 else f"{history.time.size} states were"
        raise RangeError(f"{', '.join(history.source)}: {found} found, choosing needs at least 3")
    history.energy_at(td)
    largest = float(np.abs(history.energy).max())
    if largest > _LARGEST:
        raise RangeError(f"{', '.join(history.source)}: energies up to {largest:g}, at most {_LARGEST:g} was expected")
    if settings.after is not None:
        _inside(history, settings.after, "--after")
    seen = next(filter(None, (flight_around(momenta, td) for momenta in to_be_asked(history.momenta))), None)
    fit, span = _oscillator(history, td, settings, seen)
    return Situation(history, td, settings, _flight(history, td, settings.after, seen, span), fit, span)


def _oscillator(
    history: History, td: float, settings: Settings, seen: FreeFlight | None
) -> tuple[Identification | None, Span | None]:
    """Find the oscillator, given or identified, and the window around td that it describes."""
    if not settings.replay:
        return None, None
    bounds = Span(seen.start, seen.end) if seen else Span(float(history.time[0]), float(history.time[-1]))
    if settings.after is not None:
        bounds = bounds._replace(start=min(settings.after, td))
    if settings.fit_window:
        for bound in settings.fit_window:
            _inside(history, bound, "--fit-window")
        fit = identify_within(history, Span(*settings.fit_window))
        return fit, span_of(history, td, fit, bounds) if fit.describes_record else None
    fitter = partial(assess, settings.oscillator) if settings.oscillator else identify
    span, fit = described_span(history, td, bounds, fitter, whole=seen is not None)
    return fit, span


def _flight(history: History, td: float, after: float | None, seen: FreeFlight | None, span: Span | None) -> Flight:
    """Choose the best answer to when the load is over: given, by the momentum, by the oscillator, by the energy."""
    if seen:
        end = seen.end if seen.end_seen else None
        start, source = (seen.start, "momentum") if after is None else (after, "given")
        return Flight(start, end, source, seen.parts)
    end = span.end if span and span.end < history.time[-1] else None
    if after is not None:
        return Flight(after, end, "given")
    return Flight(span.start, end, "oscillator") if span else energy_flight(history, td)


def _inside(history: History, time: float, option: str) -> None:
    if not history.time[0] <= time <= history.time[-1]:
        raise RangeError(
            f"{', '.join(history.source)}: {option} {time:g} lies outside the record, "
            f"{history.time[0]:g} to {history.time[-1]:g}"
        )


def _drowned(history: History, td: float, mode: Mode, span: Span | None) -> str | None:
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
