"""Choosing both times: td in a window, and tr for it."""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.choice.candidates import find_candidates
from d2rpick.choice.examine import examine
from d2rpick.choice.expectation import expectation, mean_in_flight, shortfall
from d2rpick.choice.ranking import EQUALLY_GOOD, best_of, kept, rank
from d2rpick.choice.suggest import Pair, Suggestion, suggest_at
from d2rpick.flight.flight import SOURCES, all_seen
from d2rpick.vibration.fits import Fits

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from d2rpick.choice.candidates import Candidate, Candidates
    from d2rpick.choice.settings import Settings
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import History

    Look = Callable[[float], Situation]

# Peaks of a window that are tried, the highest first: the higher a peak of several modes, the less energy is kinetic.
_MOST_PEAKS = 12


def suggest_in_window(history: History, window: tuple[float, float], settings: Settings) -> Suggestion:
    """Choose td in ``window`` and tr for it; RangeError when the window lies outside the record.

    Where deformations are known: of the best pairs of each peak of the energy those with a residual within 0.02 of
    the smallest, and of these the one with the longest rigid window.  Where no peak has an acceptable tr, the ends of
    the window are tried.  On the energy alone: the highest acceptable peaks up to twice the mean energy.
    """
    for time in window:
        history.energy_at(time)
    look = cache(partial(examine, history, settings=settings, fits=Fits()))  # the record is examined once for each td
    situation = _flying(look, window)
    window_in_flight = window[0], max(window[0], min(window[1], situation.latest_td))
    if situation.vibration.unknown:
        found = _highest(situation, window_in_flight, look)
    else:
        peaks = situation.peaks(*window_in_flight)
        best = _best(situation, peaks, look) or _best(situation, window_in_flight, look)
        found = suggest_at(best or look(window[1]))
    return found._replace(td_window=window)


def advice(history: History, settings: Settings) -> str:
    """Tell where td should lie when none was given: before the end of the flight, on the last peak before it."""
    time = history.time
    flights = [flight for _, flight in all_seen(history)]
    if flights:
        longest = max(flights, key=lambda flight: flight.end - flight.start)
        start, end, seen = longest.start, longest.end, longest.end_seen
    else:
        middle = examine(history, float(time[0] + time[-1]) / 2, settings)
        start, seen = middle.flight.start or float(time[0]), middle.flight.end is not None
        end = float(time[-1]) if middle.flight.end is None else middle.flight.end
    peaks = [t for t in examine(history, (start + end) / 2, settings).peaks(start, end) if t < end]
    where = (
        f"the flight ends at {end:.6g}" if seen else f"no contact was found before the end of the record at {end:.6g}"
    )
    last = f"the last peak of the energy before it is at {peaks[-1]:.6g}" if peaks else "the energy has no peak there"
    return f"{', '.join(history.source)}: {where}, {last}"


def _flying(look: Look, window: tuple[float, float]) -> Situation:
    """Situation at the start, middle or end of the window: in the flight that is known best, the first of these."""
    low, high = window
    situations = []
    for td in (low, (low + high) / 2, high):
        situations.append(look(td))
        if _certainty(situations[-1]) == (False, 0):
            break  # none can be known better
    return min(situations, key=_certainty)


def _certainty(situation: Situation) -> tuple[bool, int]:
    """How well it is known that td lies in a flight, the smallest first."""
    return not situation.in_flight, SOURCES.index(situation.flight.source)


def _best(situation: Situation, times: tuple[float, ...], look: Look) -> Situation | None:
    """Situation at the td of the best pair, of the highest of these times; None where none has an acceptable tr."""
    highest = sorted(times, key=lambda t: -situation.vibration.energy(t))[:_MOST_PEAKS]
    pairs: list[tuple[Situation, Candidate]] = []
    for td in highest:
        there = look(td)
        best = best_of(there, rank(find_candidates(there)))
        if best and not best.same_swing:
            pairs.append((there, best))
    limit = min((best.error for _, best in pairs), default=0.0) + EQUALLY_GOOD
    good = [(best.rigid_time, there) for there, best in pairs if best.error <= limit]
    return max(good, key=lambda one: (one[0], one[1].td))[1] if good else None


def _highest(situation: Situation, window: tuple[float, float], look: Look) -> Suggestion:
    """Choose the highest peaks up to twice the mean energy; without them what is best at the end of the window."""
    history, mean = situation.history, mean_in_flight(situation)
    if mean is not None:
        peaks = [t for t in situation.peaks(*window) if shortfall(history.energy_at(t), mean) < 1]
        peaks_before = situation.peaks(float(history.time[0]), window[1])
        for td in sorted(peaks, key=lambda t: shortfall(history.energy_at(t), mean)):
            there = situation.at(td)
            if not _shortening(there, find_candidates(there)).any():
                continue  # an oscillator is not sought again for each peak
            ranked = rank(find_candidates(look(td)))
            on_peaks = np.isin(ranked.tr, peaks_before) & _shortening(look(td), ranked)
            errors = [(shortfall(ranked.energy[i], mean), i) for i in np.flatnonzero(on_peaks).tolist()]
            limit = min((error for error, _ in errors), default=0.0) + EQUALLY_GOOD
            good = [i for error, i in errors if error <= limit < float("inf")]
            if good:
                return _recommending(suggest_at(look(td)), min(good, key=lambda i: ranked.tr[i]))
    return suggest_at(look(window[1]))


def _shortening(situation: Situation, candidates: Candidates) -> NDArray[np.bool_]:
    """Which candidates are acceptable, keep the limits and save something."""
    return kept(situation, candidates) & ~candidates.same_swing


def _recommending(found: Suggestion, place: int) -> Suggestion:
    """Give the suggestion with the candidate at another place recommended."""
    best = found.candidates[place]
    return found._replace(
        candidates=found.candidates.recommending(place),
        recommended=Pair(best.tr, found.situation.td, best.residual),
        expected=expectation(found.situation, best.energy),
    )
