"""Find the window in which the modes of a structure continue undisturbed, if no other evidence shows a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import compute_median, get_ends
from d2rpick.vibration.doubts import MOST_MISSED
from d2rpick.vibration.lines import is_unpredictable, make_even_grid
from d2rpick.vibration.modal import FEWEST_STATES, ModalVibration, identify_in_grid
from d2rpick.vibration.span import ERRORS_OFF, MOST_REFITS, Span

if TYPE_CHECKING:
    from d2rpick.histories.history import History, Samples
    from d2rpick.vibration.lines import Grid

# Number of equal parts of the record; windows end at the boundaries of the parts.
_PARTS: Final = 16
# Starts of the trial windows that extend to the end of the record, as fractions of the record [-].
_BEGINNINGS: Final = (0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75)
# A record no longer follows its modes if a mean energy over part of a period deviates from the modes' prediction.
# _MEANS_PER_PERIOD: number of mean energies that are checked per period of the highest-frequency mode.
# _MOST_OFF: largest deviation of a mean energy from the modes' prediction, relative to the vibration energy [-].
# The limit of the deviation is _MOST_OFF or, if larger, ERRORS_OFF standard errors.
_MEANS_PER_PERIOD, _MOST_OFF = 8, 0.02


class ModalWindow(NamedTuple):
    """A ``vibration`` that describes the record in a time ``span``."""

    vibration: ModalVibration
    span: Span


def find_described(
    history: History, td: float, guess: Span | None
) -> ModalWindow | None:
    """Find the longest window around td in which modes continue undisturbed; None if there is none.

    Of several windows, the longest one whose modes explain all but noise is used: if a window begins in a load, its
    modes may seem good, but those of a later window explain more.  Noise shortens the guessed window, and by another
    amount at each td.

    Parameters
    ----------
    history : History
    td : float
        [time]
    guess : Span or None
        Window in which the energy seems to keep its level [time]; None if there is none.
    """
    windows = _list_windows(history, td, guess)
    grown = (_grow_described(history, window) for window in windows)
    best: ModalWindow | None = None
    for described in filter(None, grown):
        if best is None or _rate_window(described) > _rate_window(best):
            best = described
        vibration = best.vibration
        if vibration.explains_all and not vibration.is_vague:
            break  # The windows that follow are shorter.
    return best


def _rate_window(described: ModalWindow) -> tuple[bool, bool, float]:
    """Return a sort key of a window; the largest key is that of the best window."""
    vibration, span = described
    return not vibration.is_vague, vibration.explains_all, span.end - span.start


@remember
def _grow_described(history: History, window: Span) -> ModalWindow | None:
    """Extend a window if its modes continue undisturbed outside it; otherwise return None.

    The result depends only on the window, not on the td for which the window was first needed.
    """
    time, _ = history.between(*window)
    if time.size < FEWEST_STATES:
        return None
    # Most windows of a record without a flight are refused by this test, which is much faster than the identification.
    if is_unpredictable(_make_grid(history, *get_ends(time)), MOST_MISSED):
        return None
    vibration = identify_window(history, window)
    if vibration is None or not vibration.convinces:
        return None
    return _grow_window(history, ModalWindow(vibration, window))


def get_inner_window(history: History, guess: Span) -> Span:
    """Return the part of a window that starts and ends at multiples of 1/16 of the record, so that many td share it."""
    first = history.start
    last = history.end
    part = (last - first) / _PARTS
    start = first + part * np.ceil((guess.start - first) / part)
    if guess.end >= last:
        end = last
    else:
        end = first + part * np.floor((guess.end - first) / part)
    return Span(float(start), float(end))


def _list_windows(history: History, td: float, guess: Span | None) -> list[Span]:
    """Return trial windows around td, the longest first: the guessed one, and those that extend to the record's end."""
    first = history.start
    last = history.end
    windows = [Span(first + share * (last - first), last) for share in _BEGINNINGS]
    if guess is not None:
        windows.append(get_inner_window(history, guess))
    return sorted(
        (window for window in windows if window.start < td <= window.end),
        key=lambda window: window.start - window.end,
    )


def identify_window(history: History, window: Span) -> ModalVibration | None:
    """Identify the modes in a window; the result is cached for all windows with the same states."""
    time, _ = history.between(*window)
    if time.size < FEWEST_STATES:
        return None
    return _identify_states(history, *get_ends(time))


@remember
def _identify_states(
    history: History, first: float, last: float
) -> ModalVibration | None:
    """Identify the modes of the states between two times."""
    return identify_in_grid(_make_grid(history, first, last), (first, last))


@remember
def _make_grid(history: History, first: float, last: float) -> Grid:
    """Resample the energies of the states between two times on an even grid."""
    return make_even_grid(*history.between(first, last))


def _grow_window(history: History, described: ModalWindow) -> ModalWindow:
    """Extend a window as far as the record follows its modes and identify them again, until nothing changes."""
    for _ in range(MOST_REFITS):
        span = _find_reach(history, described)
        if span == described.span:
            break
        vibration = identify_window(history, span)
        if vibration is None or not vibration.convinces:
            break
        described = ModalWindow(vibration, span)
    return described


def _find_reach(history: History, found: ModalWindow) -> Span:
    """Return the window in which the record follows the modes; it contains the window of their identification."""
    time = history.time
    energy = history.energy
    inside = slice(*np.searchsorted(time, found.span).tolist())
    spacing = float(compute_median(np.diff(time[inside])))
    period = (
        2 * np.pi / max(float(found.vibration.reading.modes.poles.imag.max()), 1e-300)
    )
    width = max(3, round(period / _MEANS_PER_PERIOD / spacing))
    last_before = _count_up_to_last_off(
        time[: inside.start], energy[: inside.start], found.vibration, width
    )
    first_after = _count_up_to_last_off(
        time[inside.stop :][::-1], energy[inside.stop :][::-1], found.vibration, width
    )
    return Span(
        float(time[last_before]) if last_before < inside.start else found.span.start,
        float(time[time.size - 1 - first_after])
        if first_after < time.size - inside.stop
        else found.span.end,
    )


def _count_up_to_last_off(
    time: Samples, energy: Samples, vibration: ModalVibration, width: int
) -> int:
    """Return the index after the last state that deviates from the modes; all of the states precede the window."""
    if time.size < width:
        return int(time.size)
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # Far from the window, the exponentials of damped modes overflow.
        deviation = energy - vibration.reading.spectrum.at(time)
        means = np.abs(np.convolve(deviation, np.full(width, 1 / width), mode="valid"))
        room = np.maximum(
            _MOST_OFF * vibration.vibration_energy(time[width - 1 :]),
            ERRORS_OFF * vibration.noise / np.sqrt(width),
        )
        is_off = np.flatnonzero(~(means <= room))
    return int(is_off[-1]) + width if is_off.size else 0
