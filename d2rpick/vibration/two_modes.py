"""Recognise windows that no single oscillator describes, because known modes have two different lines in them.

The energy of an oscillator has one line, and a second one at half of its frequency if it has a preload. A fit of an
oscillator to a window that clearly shows two other lines is refused, so it need not be made.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.vibration.fitting import MAX_STRUCTURE

if TYPE_CHECKING:
    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.lines import Exponentials

# Two lines are distinct if the numbers of their cycles in a window differ by at least this.
_DISTINCT_CYCLES: Final = 2.0
# Smallest height of a line that an oscillator cannot leave unexplained, as a multiple of the accepted misfit [-].
_CLEAR: Final = 10.0
# Parts of a window, from its start, in which lines are compared, because damping makes them weak towards its end [-].
_SHARES: Final = (1.0, 0.5, 0.25)


class KnownLines(NamedTuple):
    """The spectral ``lines`` of a record from ``first`` to ``last`` [time]."""

    lines: Exponentials
    first: float
    last: float


def shows_two_modes(
    history: History, known: KnownLines, window: tuple[float, float]
) -> bool:
    """Return True if ``known`` lines of a record show that no oscillator describes it in a window [time]."""
    lines, first, last = known
    start, end = window
    return _compare_lines(history, start, end, first, last, lines=lines)


@remember
def _compare_lines(
    history: History,
    start: float,
    end: float,
    first: float,
    last: float,
    *,
    lines: Exponentials,
) -> bool:
    """Return True if two lines are clear and distinct in a part of a window, from ``first`` to ``last`` at most."""
    _, energy = history.between(start, end)
    first, last = max(start, first), min(end, last)
    if not (energy.size and first < last):
        return False
    accepted = MAX_STRUCTURE * float(np.std(energy))
    for share in _SHARES:
        length = share * (last - first)
        # A misfit in a part of the window is larger than in the whole window.
        limit = _CLEAR * accepted * np.sqrt((end - start) / length)
        ends = np.array([first, first + length])
        is_clear = np.abs(lines.waves(ends) * lines.weights).min(axis=0) > limit
        if _has_two_distinct(lines.poles.imag[is_clear] * length):
            return True
    return False


def _has_two_distinct(phases: Samples) -> bool:
    """Return True if two lines, which turn by these ``phases`` in a window, differ and are not locked [rad]."""
    phase, other = phases[:, np.newaxis], phases
    apart = np.min(
        np.abs([phase - other, 2 * phase - other, phase - 2 * other]), axis=0
    )
    return bool(np.any(apart >= 2 * np.pi * _DISTINCT_CYCLES))
