"""Select the content of a figure about a choice: the flight around td, its energy range, and the motion after td."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.flight.internal_energy import round_off
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator import Replay, State, make_from_mode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.pair.situation import Situation
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples

# Time shown before and after the flight, as a fraction of its length [-], so that load and landing are visible.
_BEYOND = 0.06
# LOGARITHMIC: the energy axis is logarithmic if the highest energy exceeds this multiple of the target energy [-].
# BELOW_LEVEL: ratio of the target energy to the lowest energy of a logarithmic energy axis [-].
LOGARITHMIC = 20.0
BELOW_LEVEL = 100.0
# Space above and below a curve, as a fraction of the curve's height [-].
_ROOM = 0.08
# Fraction of a flight that is ignored at each end, because the load or the landing may still act there [-].
_UNSURE = 0.01
# Number of points of a curve, which gives a few dozen points per oscillation cycle.
_POINTS = 2000


class View(NamedTuple):
    """The visible range from ``start`` to ``end`` [time], in which the flight has energies from ``low`` to ``high``.

    ``above`` lists the name ("load", "landing") and height [energy] of each peak in this range above the flight.
    """

    start: float
    end: float
    low: float
    high: float
    above: tuple[tuple[str, float], ...]


class Scale(NamedTuple):
    """Lowest and highest visible value of an axis [energy], and whether the axis is ``logarithmic``."""

    low: float
    high: float
    logarithmic: bool


def merge_windows(
    windows: Sequence[tuple[float, float]], gap: float
) -> list[tuple[float, float]]:
    """Merge ascending windows separated by less than ``gap`` [time], because noise produces hundreds of windows.

    Examples
    --------
    >>> merge_windows([(0.0, 1.0), (1.1, 2.0), (3.0, 4.0)], 0.5)
    [(0.0, 2.0), (3.0, 4.0)]
    """
    joined = list(windows[:1])
    for start, end in windows[1:]:
        if start - joined[-1][1] < gap:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((start, end))
    return joined


def make_scale(low: float, high: float, level: float) -> Scale:
    """Return a scale for values from ``low`` to ``high`` on which ``level`` is clearly visible [energy].

    Examples
    --------
    >>> make_scale(1.0, 2.0, 1.5), make_scale(0.0, 1000.0, 1.0).logarithmic
    (Scale(low=0.92, high=2.08, logarithmic=False), True)
    """
    if level > 0 and high > LOGARITHMIC * level:
        return Scale(
            max(low, level / BELOW_LEVEL), high * LOGARITHMIC**_ROOM, logarithmic=True
        )
    room = _ROOM * (high - low or abs(high) or 1.0)
    return Scale(low - room, high + room, logarithmic=False)


def make_scale_of_flight(
    situation: Situation, view: View, levels: Sequence[float]
) -> Scale:
    """Return the scale for a flight and its levels or, if nothing vibrates, for the energy of the whole run."""
    if situation.at_rest:
        return make_scale(
            0.0,
            max(float(situation.history.energy.max()), round_off(situation.history)),
            0.0,
        )
    return make_scale(min(view.low, *levels), max(view.high, *levels), median(levels))


def make_view_of_situation(situation: Situation, *times: float) -> View:
    """Return the view of the flight of a situation, including td and other ``times`` [time]."""
    span = situation.evidence.span
    last_known = max(span.end, situation.td) if span else None
    return make_view(
        situation.history, situation.flight, [situation.td, *times], last_known
    )


def make_view(
    history: History,
    flight: Flight,
    times: list[float],
    last_known: float | None = None,
) -> View:
    """Return the view of a flight and ``times`` [time]. A flight without a known end lasts until ``last_known``.

    If no flight is known, the view is the whole record.
    """
    first = history.start
    last = history.end
    if flight.start is None:
        inner = first, last
    else:
        if flight.end is not None:
            end = flight.end
        else:
            end = last_known if last_known is not None else last
        inner = max(first, min(flight.start, *times)), min(last, max(end, *times))
        inner = inner if inner[0] < inner[1] else (first, last)
    beyond = _BEYOND * (inner[1] - inner[0])
    start = max(first, inner[0] - beyond)
    end = min(last, inner[1] + beyond)
    begin = inner[0] if flight.start is None else flight.start
    stop = inner[1] if flight.end is None else flight.end
    flown = _read_flight_energies(history, begin, stop, inner)
    low = float(flown.min())
    high = float(flown.max())
    middle = min(max(start, (begin + stop) / 2), end)
    sides = (("load", start, middle), ("landing", middle, end))
    highest = [
        (peak_name, float(history.between(*side)[1].max(initial=high)))
        for peak_name, *side in sides
    ]
    return View(
        start,
        end,
        low,
        high,
        tuple((peak_name, energy) for peak_name, energy in highest if energy > high),
    )


def _read_flight_energies(
    history: History, start: float, end: float, inner: tuple[float, float]
) -> Samples:
    """Return the energies in the flight except near its ends or, if it has none, those of adjacent states."""
    margin = _UNSURE * (end - start)
    flown = history.between(start + margin, end - margin)[1]
    return flown if flown.size else history.energies_at(np.array(inner))


class ReplayedMotion(NamedTuple):
    """Deformation at the times ``time`` in the reference run and in the ``switched`` run [square root of energy]."""

    time: Samples
    reference: Samples
    switched: Samples


def replay_motion(
    situation: Situation, tr: float, time: Samples | None = None
) -> ReplayedMotion | None:
    """Compute the motion for a pair of switch times with the single oscillator that describes the record.

    Parameters
    ----------
    situation : Situation
    tr : float
        When the parts are switched to rigid [time].
    time : array of shape (n,), optional
        Times of the deformation [time], not before the window that the oscillator describes; by default all of that
        window, up to td at least.

    Returns
    -------
    Motion or None
        None if no single oscillator describes the record at tr.
    """
    mode = situation.vibration.whole.mode
    span = situation.evidence.span
    td = situation.td
    if not (
        isinstance(mode, Mode) and span and situation.vibration.whole.described(tr)
    ):
        return None
    if time is None:
        time = np.linspace(span.start, max(span.end, td), _POINTS)
    oscillator, start = make_from_mode(mode, span.start)
    replay = Replay(oscillator, start, span.start, tr, td)

    def deformation(state: State) -> Samples:
        return np.asarray(mode.preload + state.y - state.z)

    return ReplayedMotion(
        time, deformation(replay.reference(time)), deformation(replay.motion(time))
    )


class Response(NamedTuple):
    """Response of the single oscillator that describes a record; the motion for any switch times follows from it.

    On an even grid of ``time`` (n,) [time], ``reference`` is the deformation without switching; ``release`` is the
    share of a released deformation that remains after the time since the first grid point.  Deformations vibrate about
    ``preload`` [square root of energy].  A switched deformation is the reference until tr, then constant until td, then
    that constant times ``release``.
    """

    time: Samples
    reference: Samples
    release: Samples
    preload: float


def compute_response(situation: Situation) -> Response | None:
    """Return the response of the single oscillator that describes the record; None if there is no such oscillator."""
    mode = situation.vibration.whole.mode
    span = situation.evidence.span
    td = situation.td
    if not (isinstance(mode, Mode) and span):
        return None
    time = np.linspace(span.start, max(span.end, td), _POINTS)
    oscillator, _ = make_from_mode(mode, span.start)
    unit = oscillator.free(State.of(-0.5, 0.5, 0.0, 0.0), time - span.start)
    return Response(
        time,
        np.asarray(mode.deformation(time)),
        np.asarray(unit.y - unit.z),
        mode.preload,
    )


def compute_locked_in_deformation(
    situation: Situation, tr: float | None
) -> float | None:
    """Return the deformation locked in at tr [square root of energy]; None if no oscillator describes the record."""
    if tr is None or not situation.vibration.whole.described(tr):
        mode = None
    else:
        mode = situation.vibration.whole.mode
    if tr is not None and isinstance(mode, Mode):
        return float(mode.deformation(tr))
    return None
