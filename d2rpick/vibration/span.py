"""Find the window around td in which one oscillator describes the record, by extending and fitting it repeatedly."""

from __future__ import annotations

from itertools import product
from math import ceil, log
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import get_ends, integrate_by_trapezia
from d2rpick.vibration.fitting import average_cells
from d2rpick.vibration.identify import (
    Identification,
    find_rates,
    identify,
    judge_given,
    refuse_out_of_reach,
)
from d2rpick.vibration.modes import BLOCK, Mode
from d2rpick.vibration.two_modes import shows_two_modes

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.two_modes import KnownLines


# _BEGINNINGS: trial windows begin at these distances before td, as fractions of the time from the start to td [-].
# _ENDS: trial windows end at these distances after td, as fractions of the time from td to the end [-].
# For any flight of several periods, one of the trial windows fills most of the flight.
_BEGINNINGS, _ENDS = (0.6, 0.36, 0.22, 0.13), (0.5, 0.25, 0.12)
# Further trial windows end at these distances before td, as fractions of the time from the start to td [-].
# Further trial windows are needed if td lies in the next contact.
_EARLIER_ENDS = (0.1, 0.2, 0.35)
# Windows begin and end at fixed times (marks), so that neighbouring td share windows and fits.
# Ratio of the distances of successive marks from the start [-].
_MARKS = 0.87
# _LEAST_PERIODS: smallest number of periods in a window that an oscillator describes; fewer may fit by chance.
# _MOST: shortest window that an oscillator may describe, as a fraction of the initially fitted window [-].
_LEAST_PERIODS, _MOST = 1.25, 0.8
# The ends of a window are cut off if this reduces the misfit to at most this fraction [-].
_MUCH_BETTER = 0.7
# The record leaves the fitted oscillator if the error, averaged over a fraction of a period, exceeds three limits.
# _SHARE_OFF: first limit of the mean error, as a fraction of the vibration energy [-].
# ERRORS_OFF: second limit of the mean error [standard errors]; white noise exceeds it once in a million means.
# _STRUCTURES_OFF: third limit of the mean error, as a multiple of the systematic misfit [-].
# _MEANS_PER_PERIOD: number of intervals per period over which the error is averaged.
_SHARE_OFF, ERRORS_OFF, _STRUCTURES_OFF, _MEANS_PER_PERIOD = 0.01, 5.0, 3.0, 25
# Number of intervals per energy period over which the error is averaged, to detect a mode that only part of the
# window contains.
_MEANS_PER_ENERGY_PERIOD = 4
# An oscillator that describes at least this fraction of the bounds is used for every td in its window [-].
_MOST_OF_BOUNDS = 0.5
# Largest number of times that a growing window is fitted again; two are usually enough.
MOST_REFITS = 8

# Hidden modes with at most this fraction of the vibration energy are treated as solver errors and ignored [-].
SMALLEST: Final = 1e-3
# Largest number of lines in a spectrum, which is enough for 800 energy periods.
_MOST_LINES: Final = 8192
# Number of points per line of a spectrum, sufficient to resolve the peak of the line.
_FINER: Final = 4
# Number of cells per period of the highest-frequency line; the means over these cells still show most of the line.
_CELLS_PER_PERIOD: Final = 4
# Pair of times with no state between them.
_NO_STATE: Final = (np.inf, np.inf)


class Span(NamedTuple):
    """A window of the record, from its first to its last sample [time]."""

    start: float
    end: float


class SpanSearch(NamedTuple):
    """Settings of the search for an oscillator in a record.

    Parameters
    ----------
    history : History
    bounds : Span
        The part of the record to search [time].
    oscillator : Mode, optional
        Given oscillator, which is compared with the samples; if it is None, an oscillator is fitted.
    whole : bool
        Try only the bounds and their part up to td, because it is known that no load acts between the bounds.
    quick : bool
        Do not compute the misfit of a refused fit.
    lines : KnownLines, optional
        Known lines of modes. No oscillator is fitted to a window in which they show that none describes it.
    """

    history: History
    bounds: Span
    oscillator: Mode | None = None
    whole: bool = False
    quick: bool = False
    lines: KnownLines | None = None

    def fit(self, window: Span) -> Identification:
        """Fit an oscillator to the states in a window, or compare the given oscillator with them."""
        return fit_window(self.history, window, self.oscillator, quick=self.quick)

    def shows_two_modes(self, window: Span) -> bool:
        """Return True if known lines show that no oscillator describes a window."""
        return self.lines is not None and shows_two_modes(
            self.history, self.lines, window
        )


def limit_bounds(
    bounds: Span, td: float, after: float | None, landing: float | None
) -> Span:
    """Return bounds from the end of the load ``after`` to the landing, if these times are given [time].

    If a given time lies on the wrong side of td, the bounds end at td.
    """
    if after is not None:
        bounds = bounds._replace(start=min(after, td))
    if landing is not None:
        bounds = bounds._replace(end=max(min(bounds.end, landing), td))
    return bounds


def find_oscillator(
    search: SpanSearch, td: float, window: tuple[float, float] | None = None
) -> tuple[Span | None, Identification]:
    """Return the window around ``td`` that a given or identified oscillator describes, and its fit.

    Parameters
    ----------
    search : SpanSearch
    td : float
        [time]
    window : tuple of two times, optional
        Window that the user gives for the fit of the oscillator [time].

    Returns
    -------
    span : Span or None
        None if no oscillator describes the record around td or before.
    fit : Identification
        The accepted fit with its hidden fraction of the vibration energy, or the reason why none is accepted.
    """
    history, bounds = search.history, search.bounds
    if window:
        fit = identify(*history.between(*window))
        span = find_span(history, td, fit, bounds) if fit.describes_record else None
        return span, _add_what_is_hidden(history, fit, span)
    if search.oscillator:
        return find_described_span(search._replace(quick=False), td)
    longest_fit = find_longest_described(history, bounds, search.whole)
    if longest_fit is not None and longest_fit[0].start <= td <= longest_fit[0].end:
        span, fit = longest_fit
    else:
        span, fit = find_described_span(search, td)
    return span, _add_what_is_hidden(history, fit, span)


def _add_what_is_hidden(
    history: History, fit: Identification, span: Span | None
) -> Identification:
    """Add to an accepted fit the energy of a mode that its misfit may hide in its window or in ``span``."""
    if not fit.describes_record or fit.mode is None:
        return fit
    described = span or Span(fit.start, fit.end)
    return _estimate_what_is_hidden(history, described, fit.rms, fit=fit)


@remember
def _estimate_what_is_hidden(
    history: History, described: Span, _: float, *, fit: Identification
) -> Identification:
    """Return a fit with the hidden energy. It is cached, so that situations can tell that they share a fit."""
    assert fit.mode is not None
    share = estimate_hidden_share(*history.between(fit.start, fit.end), fit.mode)
    times, deviations = measure_deviations(*history.between(*described), fit)
    return fit._replace(
        hidden_share=max(fit.hidden_share, share),
        deviation_times=times,
        deviations=deviations,
    )


def find_described_span(
    search: SpanSearch, td: float
) -> tuple[Span | None, Identification]:
    """Find the longest window around td that a single oscillator describes.

    If there is none, use the last one before td.

    The search first tries parts of the record, longest first, until an oscillator describes one. The window is then
    extended in both directions as long as the samples follow the fit, and the oscillator is fitted again, until the
    window no longer changes.

    Returns
    -------
    span : Span or None
        None if no oscillator describes the record around td or before.
    fit : Identification
        Fit to that window; if there is none, the refused fit to the bounds up to td, with the reason.
    """
    up_to_td = Span(search.bounds.start, _mark(search.bounds, td))
    refused = {}
    for window in _list_windows_around(search.bounds, td, whole=search.whole):
        # Only the misfit of the window up to td is shown to the user.
        quickly = search.quick or window != up_to_td
        if quickly and search.shows_two_modes(window):
            refused[window] = _refuse_window(search.history, window)
            continue
        span, fit = _grow_span(search._replace(quick=quickly), td, window)
        if span:
            return span, fit
        refused[window] = fit
    return None, refused[up_to_td]


@remember
def _refuse_window(history: History, window: Span) -> Identification:
    """Return the refusal of a window without a fit. It is cached, so that situations can tell that they share it."""
    return refuse_out_of_reach(history.between(*window)[0])


@remember
def find_longest_described(
    history: History, bounds: Span, whole: bool
) -> tuple[Span, Identification] | None:
    """Find a window that fills most of the ``bounds`` and that a single oscillator describes; None if there is none.

    The window is the same for every td in it, because the search starts in the middle of the bounds. A window without
    this middle is found only if the search starts from a td in it. ``whole`` has the same meaning as in `SpanSearch`.
    """
    start, end = bounds
    middle = (start + end) / 2
    beginnings = [start]
    ends = [end]
    if not whole:
        beginnings.append(_mark(bounds, middle - _BEGINNINGS[0] * (middle - start)))
        ends.append(_mark(bounds, middle + _ENDS[0] * (end - middle), 1))
    windows = [Span(*window) for window in product(beginnings, ends)]
    search = SpanSearch(history, bounds, whole=whole, quick=True)
    for window in sorted(windows, key=lambda one: one.start - one.end):
        span, fit = _grow_span(search, middle, window)
        if span and span.end - span.start >= _MOST_OF_BOUNDS * (end - start):
            return span, fit
    return None


def fit_window(
    history: History, window: Span, oscillator: Mode | None = None, *, quick: bool
) -> Identification:
    """Fit an oscillator to the states in a window, or compare a given one with them; see `identify` for ``quick``."""
    time, _ = history.between(*window)
    return _fit_states(history, get_ends(time), oscillator, quick)


@remember
def _fit_states(
    history: History, ends: tuple[float, ...], oscillator: Mode | None, quick: bool
) -> Identification:
    """Fit the states between two times; there are no states if ``ends`` is `_NO_STATE`."""
    time, energy = history.between(*(ends or _NO_STATE))
    if oscillator is not None:
        return judge_given(oscillator, time, energy, quick=quick)
    return identify(time, energy, quick=quick, rates=_find_rates(history, ends))


@remember
def _find_rates(history: History, ends: tuple[float, ...]) -> NDArray[np.complex128]:
    """Return the complex exponents found in the energies between two states; quick and full fits share the result."""
    return find_rates(*history.between(*(ends or _NO_STATE)))


def _find_reach(
    history: History, bounds: Span, anchor: float, fit: Identification
) -> Span | None:
    """Return the window of a fit, extended from its middle if the anchor lies in the window.

    Many td share one window; since the extension starts from its middle, all of them get the same result.
    """
    span = find_span(history, (fit.start + fit.end) / 2, fit, bounds)
    if span is not None and span.start <= anchor <= span.end:
        return span
    return find_span(history, anchor, fit, bounds)


def find_span(
    history: History, anchor: float, fit: Identification, bounds: Span
) -> Span | None:
    """Find the window around ``anchor`` [time], within ``bounds``, in which the record follows ``fit``.

    The window ends where the energy deviates from the fit. The result is None if the energy deviates at the anchor
    itself.
    """
    assert fit.mode is not None
    return _find_span_of_mode(history, anchor, bounds, fit.mode, fit.rms, fit.structure)


@remember
def _find_span_of_mode(
    history: History,
    anchor: float,
    bounds: Span,
    mode: Mode,
    rms: float,
    structure: float,
) -> Span | None:
    """Find the window around ``anchor`` in which the record follows a mode whose misfit is given."""
    time, energy = history.between(*bounds)
    period = 2 * np.pi / mode.omega
    steps = np.diff(time)
    middle_rank = steps.size // 2
    typical_step = float(np.partition(steps, middle_rank)[middle_rank])
    # Number of samples in a mean.
    width = max(3, round(period / _MEANS_PER_PERIOD / typical_step))
    room = max(ERRORS_OFF * rms / np.sqrt(width), _STRUCTURES_OFF * structure)
    middle = int(np.searchsorted(time, anchor))
    states_behind = width // 2
    ahead = (width - 1) // 2
    first_after = _find_first_off(
        time, energy, mode, room, middle, states_behind, ahead
    )
    last_before = _find_first_off(
        time[::-1],
        energy[::-1],
        mode,
        room,
        time.size - middle,
        ahead,
        states_behind,
    )
    # A mean over ``width`` samples includes half of these samples on each side of its middle.
    left_end = 0 if last_before is None else time.size - last_before + width // 2
    right_end = time.size - 1 if first_after is None else first_after - 1 - width // 2
    return (
        Span(float(time[left_end]), float(time[right_end]))
        if left_end < right_end
        else None
    )


# Far from the window, a damped fit overflows.
@np.errstate(over="ignore", invalid="ignore")
def _find_first_off(
    time: Samples,
    energy: Samples,
    mode: Mode,
    room: float,
    first: int,
    behind: int,
    ahead: int,
) -> int | None:
    """Return the index of the first mean, at or after the index ``first``, that exceeds its limit; None if none does.

    The search proceeds outwards block by block, so that no sum contains the large errors beyond the end of the window.
    """
    for begin in range(first, time.size, BLOCK):
        inside = slice(max(begin - behind, 0), begin + BLOCK + ahead)
        deviation = energy[inside] - mode.energy(time[inside])
        running = _average_running(deviation, begin - inside.start, behind, ahead)
        means = np.abs(running[:BLOCK])
        # NaN exceeds every limit.
        loud = np.flatnonzero(~(means <= room))
        limit = _SHARE_OFF * mode.vibration_energy(time[begin + loud])
        far = loud[~(means[loud] <= limit)]
        if far.size:
            return begin + int(far[0])
    return None


def _average_running(values: Samples, first: int, behind: int, ahead: int) -> Samples:
    """Return means of the ``behind`` values before and the ``ahead`` values after each value, from ``first`` on."""
    needed = values[max(first - behind, 0) :]
    width = behind + 1 + ahead
    sums = np.zeros(values.size - first + width)
    begin = 1 + max(behind - first, 0)
    sums[begin : begin + needed.size] = needed
    np.cumsum(sums, out=sums)
    return np.asarray((sums[width:] - sums[:-width]) / width)


def _list_windows_around(bounds: Span, td: float, *, whole: bool) -> Iterator[Span]:
    """Yield trial windows: first those around td, in descending order of length, then those before td."""
    start, end = bounds
    mark_of_td = _mark(bounds, td)
    beginnings = [start]
    ends = [end, mark_of_td]
    early_ends = []
    if not whole:
        for share in _BEGINNINGS:
            beginning = _mark(bounds, td - share * (td - start))
            beginnings.append(beginning)
        for share in _ENDS:
            late_end = _mark(bounds, td + share * (end - td), 1)
            ends.append(late_end)
        for share in _EARLIER_ENDS:
            early_end = _mark(bounds, td - share * (td - start))
            early_ends.append(early_end)
    around = {
        Span(beginning, late)
        for beginning in beginnings
        for late in ends
        if beginning < late
    }
    around.add(Span(start, mark_of_td))
    yield from sorted(around, key=lambda window: window.start - window.end)
    for early_end in early_ends:
        for beginning in dict.fromkeys(beginnings):
            if beginning < early_end:
                yield Span(beginning, early_end)


def _mark(bounds: Span, time: float, after: int = 0) -> float:
    """Return the last mark up to ``time`` or, if ``after`` is 1, the first mark after it; the bounds are marks."""
    start, end = bounds
    if time <= start:
        return start
    if time >= end:
        return end
    share = (time - start) / (end - start)
    marks_behind = ceil(log(share) / log(_MARKS))
    return start + (end - start) * _MARKS ** max(marks_behind - after, 0)


def _grow_span(
    search: SpanSearch, td: float, window: Span
) -> tuple[Span | None, Identification]:
    """Fit the window and extend it while the record follows the fit; repeat until the window stays the same."""
    bounds = search.bounds
    fit = search.fit(window)
    span = window
    for _ in range(MOST_REFITS):
        if not fit.follows or fit.mode is None:
            return None, fit
        shortest = max(
            _LEAST_PERIODS * 2 * np.pi / fit.mode.omega,
            _MOST * (window.end - window.start),
        )
        # If the period is much longer than the record, the means would need more samples than there are.
        possible = shortest <= bounds.end - bounds.start
        anchor = min(td, window.end)
        grown = _find_reach(search.history, bounds, anchor, fit) if possible else None
        if grown is None or grown.end - grown.start < shortest:
            reason = fit.reason or "an oscillator fits only a part of the record"
            return None, fit._replace(describes_record=False, reason=reason)
        if grown == (fit.start, fit.end):
            # The fit fails if, for example, the window is too short.
            if not fit.describes_record:
                return None, fit
            return _clear_ends(search, grown, fit)
        span = grown
        fit = search.fit(span)
    return (span, fit) if fit.describes_record else (None, fit)


def _clear_ends(
    search: SpanSearch, span: Span, fit: Identification
) -> tuple[Span, Identification]:
    """Cut off half a period at each end at which the record leaves the fit, and fit the rest again.

    Near its ends, a fit may have adapted to the beginning of a contact or the end of a load. If the fit without the
    ends follows its samples much better, it determines the window.
    """
    assert fit.mode is not None
    bounds = search.bounds
    inset = np.pi / fit.mode.omega
    inner = Span(
        span.start + inset if span.start > bounds.start else span.start,
        span.end - inset if span.end < bounds.end else span.end,
    )
    if inner == span or inner.end - inner.start < 2 * _LEAST_PERIODS * 2 * inset:
        return span, fit
    core = search.fit(inner)
    if not core.describes_record or core.rms > _MUCH_BETTER * fit.rms:
        return span, fit
    middle = (inner.start + inner.end) / 2
    return _find_reach(search.history, bounds, middle, core) or span, core


def estimate_hidden_share(time: Samples, energy: Samples, mode: Mode) -> float:
    """Return the fraction of the vibration energy that a further mode hidden in the misfit may have [-].

    It is the energy of a mode that decays like the vibration and causes the strongest line of the misfit; it is at most
    1.

    Parameters
    ----------
    time, energy : array of shape (n,)
        The states in the fitted window [time], [energy].
    mode : Mode
        The fitted mode.
    """
    span = float(time[-1] - time[0])
    count = min(time.size - 1, _MOST_LINES)
    s = (time - time[0]) / span
    misfit = energy - mode.energy(time)
    remainder = average_cells(s, integrate_by_trapezia(s, misfit), count)
    decay = np.exp(-mode.alpha * span * (np.arange(count) + 0.5) / count)
    # The frequencies range from one period per record to the highest frequency that the averaging cells resolve.
    visible = slice(_FINER, max(_FINER + 1, _FINER * count // _CELLS_PER_PERIOD))
    lines = np.abs(np.fft.rfft(remainder * decay, _FINER * count))
    strongest = float(lines[visible].max())
    amplitude = 2 * strongest / float(np.sum(decay**2))
    # The energy of a mode oscillates about its mean by half of the vibration energy.
    return min(2 * amplitude / float(mode.vibration_energy(time[0])), 1.0)


def measure_deviations(
    time: Samples, energy: Samples, fit: Identification
) -> tuple[Samples, Samples]:
    """Return times [time], and by how much the energy near each time deviates from the fit beyond noise.

    A further mode that decays fast is hidden in the misfit of the whole record, but not in that of its first periods.
    Each deviation is that of one energy period: the largest of the mean misfits over its quarters.

    Parameters
    ----------
    time, energy : array of shape (n,)
        The states in the fitted window [time], [energy].
    fit : Identification
        An accepted fit.

    Returns
    -------
    times, deviations : array of shape (d,)
        Times [time], and the deviations near them [energy], which are not negative.
    """
    assert fit.mode is not None
    period = np.pi / fit.mode.omega
    count = max(ceil((time[-1] - time[0]) / period * _MEANS_PER_ENERGY_PERIOD), 1)
    edges = np.linspace(time[0], time[-1], count + 1)
    cells = np.minimum(np.searchsorted(edges, time, side="right") - 1, count - 1)
    states = np.bincount(cells, minlength=count)
    sums = np.bincount(cells, energy - fit.mode.energy(time), minlength=count)
    # A product of roots is used, because a difference of squares might overflow.
    noise = np.sqrt(max(fit.rms - fit.structure, 0.0)) * np.sqrt(
        fit.rms + fit.structure
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond_noise = np.abs(sums) / states - ERRORS_OFF * noise / np.sqrt(states)
    # A cell without states has no value.
    deviations = np.nan_to_num(np.maximum(beyond_noise, 0.0), posinf=0.0)
    padded = np.pad(deviations, _MEANS_PER_ENERGY_PERIOD)
    around = np.lib.stride_tricks.sliding_window_view(
        padded, 2 * _MEANS_PER_ENERGY_PERIOD + 1
    )
    return (edges[1:] + edges[:-1]) / 2, around.max(axis=1)
