"""The deformation of the floating oscillator behind a record, without switching and switched."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.vibration.modes import Mode
from d2rpick.vibration.oscillator import Replay, State, from_mode

if TYPE_CHECKING:
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# Points of a curve: some dozens for each swing.
_POINTS = 2000


class Motion(NamedTuple):
    """Deformations over ``time`` [time], without switching and ``switched``, of one shape [square root of energy]."""

    time: Samples
    reference: Samples
    switched: Samples


def replayed_motion(situation: Situation, tr: float, time: Samples | None = None) -> Motion | None:
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
    mode, span, td = situation.vibration.whole.mode, situation.evidence.span, situation.td
    if not (isinstance(mode, Mode) and span and situation.vibration.whole.described(tr)):
        return None
    if time is None:
        time = np.linspace(span.start, max(span.end, td), _POINTS)
    oscillator, start = from_mode(mode, span.start)
    replay = Replay(oscillator, start, span.start, tr, td)

    def deformation(state: State) -> Samples:
        return np.asarray(mode.preload + state.y - state.z)

    return Motion(time, deformation(replay.reference(time)), deformation(replay.motion(time)))


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
    mode, span, td = situation.vibration.whole.mode, situation.evidence.span, situation.td
    if not (isinstance(mode, Mode) and span):
        return None
    time = np.linspace(span.start, max(span.end, td), _POINTS)
    oscillator, _ = from_mode(mode, span.start)
    unit = oscillator.free(State.of(-0.5, 0.5, 0.0, 0.0), time - span.start)
    return Response(time, np.asarray(mode.deformation(time)), np.asarray(unit.y - unit.z), mode.preload)


def locked_in(situation: Situation, tr: float) -> float | None:
    """Deformation that tr locks in [square root of energy]; None where no single oscillator describes it."""
    mode = situation.vibration.whole.mode
    return float(mode.deformation(tr)) if isinstance(mode, Mode) and situation.vibration.whole.described(tr) else None
