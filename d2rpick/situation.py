"""What the record tells about a td, before any tr is looked at: flight, oscillator, level, kinetic share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from d2rpick import measures
from d2rpick.errors import RangeError
from d2rpick.flight import Flight, Span, described_span, energy_flight, identify_within, span_of
from d2rpick.identify import Identification, assess
from d2rpick.momentum import FreeFlight, flight_around, to_be_asked

if TYPE_CHECKING:
    from d2rpick.history import History
    from d2rpick.mode import Mode

# Where the scatter of the last period exceeds this share of the vibration energy at td, the vibration has sunk
# into it: its sign is no longer certain.
_DROWNED = 0.2


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

    ``fit`` is None only where no oscillator was looked for; ``mode`` is its mode where it can be relied on at td,
    else None, and then ``no_mode`` says why.  ``span`` is the window in which it describes the record.
    """

    history: History
    td: float
    settings: Settings
    flight: Flight
    fit: Identification | None
    mode: Mode | None
    span: Span | None
    no_mode: str | None

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
    def earliest_tr(self) -> float | None:
        """Start of the flight with the margin, or None when unknown [time]."""
        return None if self.flight.start is None else self.flight.start + self.settings.margin

    @property
    def latest_td(self) -> float:
        """End of the flight with the margin; infinite when no contact was seen [time]."""
        return float("inf") if self.flight.end is None else self.flight.end - self.settings.margin

    def described(self, time: float) -> bool:
        """Whether the oscillator describes the record at ``time``."""
        return self.mode is not None and self.span is not None and self.span.start <= time <= self.span.end

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
    if settings.after is not None:
        _inside(history, settings.after, "--after")
    seen = next(filter(None, (flight_around(momenta, td) for momenta in to_be_asked(history.momenta))), None)
    fit, span = _oscillator(history, td, settings, seen)
    mode, no_mode = _reliable_mode(history, td, fit, span, given=settings.oscillator is not None)
    flight = _flight(history, td, settings.after, seen, span)
    return Situation(history, td, settings, flight, fit, mode, span, no_mode)


def _oscillator(
    history: History, td: float, settings: Settings, seen: FreeFlight | None
) -> tuple[Identification | None, Span | None]:
    """Find the oscillator, given or identified, and the window around td that it describes."""
    if not settings.replay:
        return None, None
    first, last = (seen.start, seen.end) if seen else (float(history.time[0]), float(history.time[-1]))
    if settings.after is not None:
        first = min(settings.after, td)
    fit = _given_fit(history, settings, first)
    if fit is None:
        span, fit = described_span(history, td, first, last)
        return fit, span
    return fit, span_of(history, td, fit, first, last) if fit.describes_record else None


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


def _given_fit(history: History, settings: Settings, first: float) -> Identification | None:
    """Give the fit that the user prescribed, by an oscillator or by a window; None when it is to be searched."""
    if settings.oscillator:
        inside = history.time >= first
        return assess(settings.oscillator, history.time[inside], history.energy[inside])
    if settings.fit_window:
        for bound in settings.fit_window:
            _inside(history, bound, "--fit-window")
        return identify_within(history, *settings.fit_window)
    return None


def _inside(history: History, time: float, option: str) -> None:
    if not history.time[0] <= time <= history.time[-1]:
        raise RangeError(
            f"{', '.join(history.source)}: {option} {time:g} lies outside the record, "
            f"{history.time[0]:g} to {history.time[-1]:g}"
        )


def _reliable_mode(
    history: History, td: float, fit: Identification | None, span: Span | None, *, given: bool
) -> tuple[Mode | None, str | None]:
    """Give the mode of ``fit`` if it can be relied on at td, else None and why not."""
    if fit is None:
        return None, "no oscillator was looked for (--no-verify)"
    if not fit.describes_record or fit.mode is None:
        what = "the given oscillator does not describe" if given else "no single oscillator describes"
        return None, f"{what} the record: {fit.reason}"
    if span is None:
        return None, "the oscillator does not describe the record at td"
    period = 2 * np.pi / fit.mode.omega
    last = (history.time >= max(td - period, span.start)) & (history.time <= max(td, span.start))
    scatter = float(np.sqrt(np.mean((history.energy[last] - fit.mode.energy(history.time[last])) ** 2)))
    vibration = float(fit.mode.vibration_energy(td))
    if scatter > _DROWNED * vibration:
        return None, (
            f"at td the vibration energy {vibration:.3g} has sunk into the scatter of the record, {scatter:.3g}: "
            "the sign of the deformation cannot be told"
        )
    return fit.mode, None
