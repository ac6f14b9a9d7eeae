"""Runs from start to end, switched or not."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import RangeError
from d2rpick.models.rollover.motion import Motion
from d2rpick.models.rollover.record import Recorder

if TYPE_CHECKING:
    from d2rpick.models.rollover.model import Parameters
    from d2rpick.models.rollover.record import Record

# States are given out in this time [s]: 25 of them for a mode of 400 Hz, and a step is not much shorter.
INTERVAL = 1e-4
# Some minutes; what asks for more was hardly meant.
MOST_STEPS = 5_000_000


@dataclass(frozen=True)
class RigidWindow:
    """The box is rigid from ``tr`` to ``td`` [s]; RangeError unless 0 <= tr <= td."""

    tr: float
    td: float

    def __post_init__(self) -> None:
        if not 0 <= self.tr <= self.td:
            raise RangeError(f"tr {self.tr:g} and td {self.td:g} must be in this order after the start at 0")


def simulate(parameters: Parameters, t_end: float, *windows: RigidWindow, interval: float = INTERVAL) -> Record:
    """Compute a run from 0 to ``t_end``, with a state every ``interval`` [s].

    RangeError when it takes too many steps, or when ``windows`` overlap or are not in order.

    Examples
    --------
    >>> from d2rpick.models.rollover.model import Parameters
    >>> run = simulate(Parameters(mesh=4), 0.01)
    >>> run.time.size, bool(abs(run.imbalance).max() < 0.01)
    (101, True)
    """
    with np.errstate(over="ignore"):  # the number of steps tells whether it can be computed
        motion = Motion(parameters, interval)
    if motion.step_at(t_end) > MOST_STEPS:
        raise RangeError(f"steps of {motion.dt:.3g} s make more than {MOST_STEPS} until {t_end:g}; choose softer bars")
    for one, following in pairwise(windows):
        if not one.td < following.tr:
            raise RangeError(f"the window from tr {following.tr:g} begins before the one up to td {one.td:g} is over")
    return proceed(motion, t_end, *windows)


def proceed(motion: Motion, t_end: float, *windows: RigidWindow) -> Record:
    """Go on with ``motion`` to ``t_end`` [s], switching at the first step at or after the times of ``windows``.

    RangeError when its numbers become infinite.
    """
    last = motion.every * (motion.step_at(t_end) // motion.every)
    rigid, deformable = {motion.step_at(one.tr) for one in windows}, {motion.step_at(one.td) for one in windows}
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # the record tells whether it went well
        recorder = Recorder(motion, last)
        while True:
            if motion.count in rigid:
                motion.make_rigid()
            if motion.count in deformable:
                motion.make_deformable()
            mean = motion.advance()
            if motion.count % motion.every == 0:
                recorder.note(mean)
            if motion.count >= last:
                return recorder.record()
            motion.move()


def run_to(motion: Motion, time: float) -> None:
    """Go on, without switching, to the first step at or after ``time`` [s]."""
    for _ in range(motion.step_at(time) - motion.count):
        motion.advance()
        motion.move()
