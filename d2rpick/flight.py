"""When the load is over: the window around td in which the parts fly freely."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.crossings import find_crossings
from d2rpick.identify import Identification, identify

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from d2rpick.history import History, Part, Samples

    Model = Callable[[Samples, Samples], Identification]

# Tails of the record before td that are tried for an oscillator, as shares of what comes before td.  Below an
# eighth a record has hardly the periods an oscillator needs, and what fits so little of it proves nothing.
_TAILS = (0.6, 0.36, 0.22, 0.13)
# The record leaves the fitted oscillator where the mean error over a twenty-fifth of a period (three samples at
# least) exceeds this share of the vibration energy, this many standard errors of such a mean, or this many times the
# systematic rest that the fit leaves anyway, whichever is most.  Of a million means of white noise one does by chance.
_SHARE_OFF, _ERRORS_OFF, _STRUCTURES_OFF, _MEANS_PER_PERIOD = 0.01, 5.0, 3.0, 25
# Fits of the growing window until it stays; two are usual.
_MOST_REFITS = 8
# Widening of the band of energies before td, against wiggles of a vibration that the band has not seen.
_BAND_RESERVE = 0.25


@dataclass(frozen=True)
class Flight:
    """Window of free flight [time]; ``start`` None when unknown, ``end`` None when no next contact was seen.

    ``source`` tells how the start was found: "given", "momentum", "oscillator", "energy", or None.  ``parts`` are
    those that were seen to fly together, None where the momentum did not tell, or told it of the whole model.
    """

    start: float | None
    end: float | None
    source: str | None
    parts: tuple[Part, ...] | None = None


class Span(NamedTuple):
    """Window of the record that an oscillator describes, from its first to its last sample [time]."""

    start: float
    end: float


def described_span(
    history: History, td: float, first: float, last: float, model: Model = identify
) -> tuple[Span | None, Identification]:
    """Find the longest window around td that one oscillator describes, or whatever ``model`` identifies.

    First a part of the record that it describes is looked for: all of it, up to td, then ever
    shorter tails.  From there the window grows both ways while the samples stay with the fit, is fitted anew,
    and so on until it stays.

    Parameters
    ----------
    history : History
    td, first, last : float
        Time to look around, and where the search begins and ends [time].
    model : function
        `identify`, or `identify_several`.

    Returns
    -------
    span : Span or None
        None when no oscillator describes the record around td.
    fit : Identification
        Of that window; when there is none, of the part up to td, with the reason of its refusal.
    """
    refused = []
    for start, end in _windows(first, td, last):
        fit = identify_within(history, start, end, model)
        if fit.describes_record:
            span, fit = _grow(history, td, fit, first, last, model)
            if span:
                return span, fit
        refused.append(fit)
    return None, refused[1]


def span_of(history: History, td: float, fit: Identification, first: float, last: float) -> Span | None:
    """Find the window around td, from ``first`` to ``last`` at most, in which the record stays with ``fit``.

    It ends where the energy drifts off the fit; None when it is off at td itself.
    """
    assert fit.mode is not None
    inside = slice(*np.searchsorted(history.time, [first, np.nextafter(last, np.inf)]))
    time, energy = history.time[inside], history.energy[inside]
    period = 2 * np.pi / fit.mode.fastest
    width = max(3, round(period / _MEANS_PER_PERIOD / float(np.sort(np.diff(time))[(time.size - 1) // 2])))
    with np.errstate(over="ignore", invalid="ignore"):  # far off, a damped fit grows beyond all numbers
        least = max(_ERRORS_OFF * fit.rms / np.sqrt(width), _STRUCTURES_OFF * fit.structure)
        room = np.maximum(_SHARE_OFF * fit.mode.vibration_energy(time), least)
        error = np.convolve(energy - fit.mode.energy(time), np.ones(width) / width, mode="same")
        gone = ~(np.abs(error) <= room)
    middle = int(np.searchsorted(time, td))
    before, after = np.flatnonzero(gone[:middle]), np.flatnonzero(gone[middle:])
    left = int(before[-1]) + 1 if before.size else 0
    right = middle + int(after[0]) - 1 if after.size else time.size - 1
    return Span(float(time[left]), float(time[right])) if left < right else None


def energy_flight(history: History, td: float) -> Flight:
    """Take the load to be over when the energy falls into its band before td for the last time.

    The band is that of the last quarter of the record before td, widened by a quarter of its width.  Where the
    energy never was above the band, nothing shows that a load has ended: start and source are None.
    """
    before = history.time <= td
    quarter = before & (history.time >= td - (td - history.time[0]) / 4)
    values = np.append(history.energy[quarter], history.energy_at(td))
    level = float(values.max() + _BAND_RESERVE * np.ptp(values))
    falling = [c.time for c in find_crossings(history.time[before], history.energy[before], level) if not c.rising]
    return Flight(falling[-1], None, "energy") if falling else Flight(None, None, None)


def _windows(first: float, td: float, last: float) -> Iterator[tuple[float, float]]:
    """Windows to try: the whole, up to td, then for ever shorter tails up to td, as much beyond, to the end."""
    yield first, last
    yield first, td
    for share in _TAILS:
        length = share * (td - first)
        for end in dict.fromkeys((td, min(td + length, last), last)):
            yield td - length, end


def identify_within(history: History, start: float, end: float, model: Model = identify) -> Identification:
    """Identify the oscillator from the samples in [start, end]."""
    inside = slice(*np.searchsorted(history.time, [start, np.nextafter(end, np.inf)]))
    return model(history.time[inside], history.energy[inside])


def _grow(
    history: History, td: float, fit: Identification, first: float, last: float, model: Model
) -> tuple[Span | None, Identification]:
    """Extend the fitted window while the record stays with the fit, refit, repeat."""
    span = span_of(history, td, fit, first, last)
    for _ in range(_MOST_REFITS):
        if span is None or span == (fit.start, fit.end):
            break
        refit = identify_within(history, *span, model)
        if not refit.describes_record:
            break
        fit, span = refit, span_of(history, td, refit, first, last)
    return span, fit
