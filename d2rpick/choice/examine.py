"""What a record tells about a td, found once: the flight around it, the oscillator in it, the parts."""

from __future__ import annotations

from functools import partial
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.choice.situation import Situation
from d2rpick.errors import RangeError
from d2rpick.flight.flight import find_flight, seen_flight
from d2rpick.histories.samples import window
from d2rpick.vibration.identify import Identification, identify, identify_several, judge_given
from d2rpick.vibration.model import Evidence, doubtful, energy_at
from d2rpick.vibration.span import Fits, Span, described_span, identify_within, span_of
from d2rpick.vibration.uncertainty import resolved

if TYPE_CHECKING:
    from d2rpick.choice.settings import Settings
    from d2rpick.flight.flight import Flight, Seen
    from d2rpick.histories.history import History
    from d2rpick.vibration.swings import Swings


def examine(history: History, td: float, settings: Settings, fits: Fits | None = None) -> Situation:
    """Find the flight around ``td`` and the oscillator in it.

    ``fits`` are those of an earlier look at the same record with the same settings, but for ``after``.

    RangeError when td, ``after`` or the fit window lie outside the record, or it has fewer than 3 states.
    """
    if history.time.size < 3:
        found = "1 state was" if history.time.size == 1 else f"{history.time.size} states were"
        raise RangeError(f"{', '.join(history.source)}: {found} found, choosing needs at least 3")
    history.energy_at(td, "td")
    if settings.after is not None:
        history.check(settings.after, argument="after")
    seen = seen_flight(history, td)
    flying = None if seen.refusal else seen.flight
    # where nothing flies at td, the oscillator of the nearest flight tells the pairs that there are in it
    at = (seen.flight.start + seen.flight.end) / 2 if seen.refusal and seen.flight else td
    fits = Fits() if fits is None else fits
    fit, span = _oscillator(history, at, settings, seen, fits)
    flight = find_flight(history, td, settings.after, seen, _settled(history, fit, span))
    flight = _between_supports(history, flight, td)
    given = settings.oscillator is not None
    evidence = Evidence(fit, span, given, prescribed=given or settings.fit_window is not None)
    if settings.replay:
        # without a sign of the next contact nothing is known of what comes after td
        end = flight.end or (float(history.time[-1]) if flying or span else td)
        start = min(td, float(history.time[0]) if flight.start is None else flight.start)
        if history.part_energies is not None:
            evidence = _with_parts(evidence, history, Span(start, end), fits)
        if flight.start is not None and not evidence.signed and doubtful(energy_at(history, td, evidence)):
            settled = flight.start if flight.settled is None else flight.settled
            within = Span(settled, flight.end or float(history.time[-1]))
            evidence = evidence._replace(swings=_swings(history, within, fits))
    return Situation(history, td, settings, flight, evidence, fits)


def _between_supports(history: History, flight: Flight, td: float) -> Flight:
    """Give the same of what was found in any evidence, or given; that of parts by their momentum is so already."""
    if flight.start is None or flight.refusal or flight.by_parts:
        return flight
    start, end = history.surroundings.free(history.parts, td) or (-inf, inf)
    end = min(end, inf if flight.end is None else flight.end)
    return flight._replace(start=max(start, flight.start), end=None if end == inf else end)


def _oscillator(
    history: History, td: float, settings: Settings, seen: Seen, fits: Fits
) -> tuple[Identification | None, Span | None]:
    """Find the oscillator, given or identified, and the window around td that it describes."""
    if not settings.replay:
        return None, None
    whole = bool(seen.flight or seen.refusal)
    bounds = Span(*seen.flight[:2]) if seen.flight else Span(float(history.time[0]), float(history.time[-1]))
    if settings.after is not None:
        bounds = bounds._replace(start=min(settings.after, td))
    if settings.fit_window:
        history.check(*settings.fit_window, argument="fit_window")
        fit = identify_within(history, Span(*settings.fit_window))
        return _resolved(history, fit, fits), span_of(history, td, fit, bounds) if fit.describes_record else None
    if settings.oscillator:
        given = fits.remembered("given", partial(judge_given, settings.oscillator))
        span, fit = described_span(history, td, bounds, given, whole=whole)
        return fit, span
    span, fit = described_span(history, td, bounds, fits.remembered("one", identify), whole=whole)
    if span is None:
        fitter = partial(fits.remembered("several", identify_several), quick=True)  # nobody asks why it is refused
        span, several = described_span(history, td, bounds, fitter, whole=whole)
        fit = several if span else fit
    return _resolved(history, fit, fits), span


def _resolved(history: History, fit: Identification, fits: Fits) -> Identification:
    """Look for a small second mode in what an accepted oscillator leaves over."""
    if not fit.describes_record:
        return fit
    window = history.between(fit.start, fit.end)
    return fits.once(("resolved", fit.start, fit.end, fit.rms), lambda: resolved(*window, fit))


def _settled(history: History, fit: Identification | None, span: Span | None) -> Span | None:
    """Give the window of an oscillator without its first quarter of a period, unless the record begins with it.

    While the deformation passes through zero its energy hardly shows that a load still moves it, by a tenth of its
    amplitude and more; where it is largest a hundredth shows.  Each quarter of a period has one of both.
    """
    if span is None or fit is None or fit.mode is None or span.start <= history.time[0]:
        return span
    return Span(min(span.start + np.pi / 2 / fit.mode.omega, span.end), span.end)


def _swings(history: History, within: Span, fits: Fits) -> Swings | None:
    """Count the swings of the energy in the flight, where they come down to a floor."""
    from d2rpick.vibration.swings import count_swings

    return fits.once(("swings", *within), lambda: count_swings(*history.between(*within)))


def _with_parts(evidence: Evidence, history: History, within: Span, fits: Fits) -> Evidence:
    """Add what the energies of single parts tell of the flight."""
    from d2rpick.vibration.part_signs import read_parts

    assert history.part_energies is not None
    time, _ = history.between(*within)
    if time.size < 3:
        return evidence
    energies = history.part_energies[window(history.time, *within)]
    parts = fits.once(("parts", *within), lambda: read_parts(time, energies, history.part_names))
    return evidence._replace(parts=parts)
