"""What one looks at to see a choice: the flight around td, how high the energy stands there, the motion behind it."""

from __future__ import annotations

from statistics import median
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.flight.internal_energy import round_off
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator import Replay, State, make_from_mode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.choice.situation import Situation
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples

# Shown beyond each end of the flight, as a share of it: enough to see load and landing begin.
_BEYOND = 0.06
# Beyond this ratio of the highest energy to the level, the level would vanish on a linear axis; a logarithmic one ends
# at this part of the level.
LOGARITHMIC = 20.0
BELOW_LEVEL = 100.0
# Room above and below the curve, as a share of its height.
_ROOM = 0.08
# By this share of a flight its ends may be off: the load or the landing may stand there already.
_UNSURE = 0.01
# Points of a curve: some dozens for each swing.
_POINTS = 2000


class View(NamedTuple):
    """From ``start`` to ``end`` [time]; there the flight has energies from ``low`` to ``high``.

    ``above`` names what stands above the flight in that time, "load" and "landing", and how high [energy].
    """

    start: float
    end: float
    low: float
    high: float
    above: tuple[tuple[str, float], ...]


class Scale(NamedTuple):
    """Lowest and highest value in sight, with some room [energy]; ``logarithmic``: how the axis between them runs."""

    low: float
    high: float
    logarithmic: bool


def merged(
    windows: Sequence[tuple[float, float]], gap: float
) -> list[tuple[float, float]]:
    """Join windows, ascending, that are less than ``gap`` apart [time]: noise makes hundreds that no eye tells apart.

    Examples
    --------
    >>> merged([(0.0, 1.0), (1.1, 2.0), (3.0, 4.0)], 0.5)
    [(0.0, 2.0), (3.0, 4.0)]
    """
    joined = list(windows[:1])
    for start, end in windows[1:]:
        if start - joined[-1][1] < gap:
            joined[-1] = joined[-1][0], end
        else:
            joined.append((start, end))
    return joined


def scale_of(low: float, high: float, level: float) -> Scale:
    """Give the scale that shows values from ``low`` to ``high``, and a ``level`` on which the eye must rest [energy].

    Examples
    --------
    >>> scale_of(1.0, 2.0, 1.5), scale_of(0.0, 1000.0, 1.0).logarithmic
    (Scale(low=0.92, high=2.08, logarithmic=False), True)
    """
    if level > 0 and high > LOGARITHMIC * level:
        return Scale(
            max(low, level / BELOW_LEVEL), high * LOGARITHMIC**_ROOM, logarithmic=True
        )
    room = _ROOM * (high - low or abs(high) or 1.0)
    return Scale(low - room, high + room, logarithmic=False)


def scale_in(situation: Situation, seen: View, levels: Sequence[float]) -> Scale:
    """Give the scale for a flight and its levels; where nothing vibrates, beside what the whole run has [energy]."""
    if situation.at_rest:
        return scale_of(
            0.0,
            max(float(situation.history.energy.max()), round_off(situation.history)),
            0.0,
        )
    return scale_of(min(seen.low, *levels), max(seen.high, *levels), median(levels))


def view_of(situation: Situation, *times: float) -> View:
    """Give what shows the flight of a situation, its td and other ``times`` [time]."""
    span = situation.evidence.span
    known = max(span.end, situation.td) if span else None
    return view(situation.history, situation.flight, [situation.td, *times], known)


def view(
    history: History, flight: Flight, times: list[float], known: float | None = None
) -> View:
    """Give what shows a flight and ``times`` [time]; a flight whose end was not seen lasts to ``known``, or the last.

    Where no flight is known, the whole record is shown.
    """
    first, last = float(history.time[0]), float(history.time[-1])
    if flight.start is None:
        inner = first, last
    else:
        end = (
            flight.end
            if flight.end is not None
            else known
            if known is not None
            else last
        )
        inner = max(first, min(flight.start, *times)), min(last, max(end, *times))
        inner = inner if inner[0] < inner[1] else (first, last)
    beyond = _BEYOND * (inner[1] - inner[0])
    start, end = max(first, inner[0] - beyond), min(last, inner[1] + beyond)
    begin = inner[0] if flight.start is None else flight.start
    stop = inner[1] if flight.end is None else flight.end
    flown = _flown(history, begin, stop, inner)
    low, high = float(flown.min()), float(flown.max())
    middle = min(max(start, (begin + stop) / 2), end)
    sides = (("load", start, middle), ("landing", middle, end))
    highest = [
        (what, float(history.between(*side)[1].max(initial=high)))
        for what, *side in sides
    ]
    return View(
        start,
        end,
        low,
        high,
        tuple((what, energy) for what, energy in highest if energy > high),
    )


def _flown(
    history: History, start: float, end: float, inner: tuple[float, float]
) -> Samples:
    """Energies in the flight, but for its ends; where it has no state, those between which it lies."""
    off = _UNSURE * (end - start)
    flown = history.between(start + off, end - off)[1]
    return flown if flown.size else history.energies_at(np.array(inner))


class Motion(NamedTuple):
    """Deformations over ``time`` [time], without switching and ``switched``, of one shape [square root of energy]."""

    time: Samples
    reference: Samples
    switched: Samples


def replayed_motion(
    situation: Situation, tr: float, time: Samples | None = None
) -> Motion | None:
    """Replay a pair of switch times with the one oscillator that describes the record.

    Parameters
    ----------
    situation : Situation
    tr : float
        When the parts are switched to rigid [time].
    time : array of shape (n,), optional
        Where the deformation is wanted [time], from the start of the window that the oscillator describes on; by
        default all of that window, up to td at least.

    Returns
    -------
    Motion or None
        None where no single oscillator describes the record at tr.
    """
    mode, span, td = (
        situation.vibration.whole.mode,
        situation.evidence.span,
        situation.td,
    )
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

    return Motion(
        time, deformation(replay.reference(time)), deformation(replay.motion(time))
    )


class Response(NamedTuple):
    """What any pair of switch times makes of the one oscillator that describes a record.

    On an even grid of ``time`` (n,) [time]: ``reference``, the deformation without switching, and ``release``, by what
    share a deformation is left as long after td as ``time`` is after its first.  Deformations swing about ``preload``
    [square root of energy]: switched they are the reference until tr, then what it is there until td, then that share
    of it.
    """

    time: Samples
    reference: Samples
    release: Samples
    preload: float


def response(situation: Situation) -> Response | None:
    """Give the response of the one oscillator that describes the record; None where none does."""
    mode, span, td = (
        situation.vibration.whole.mode,
        situation.evidence.span,
        situation.td,
    )
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


def locked_in(situation: Situation, tr: float | None) -> float | None:
    """Deformation that tr locks in [square root of energy]; None where no single oscillator describes it."""
    mode = (
        None
        if tr is None or not situation.vibration.whole.described(tr)
        else situation.vibration.whole.mode
    )
    return (
        float(mode.deformation(tr))
        if tr is not None and isinstance(mode, Mode)
        else None
    )
