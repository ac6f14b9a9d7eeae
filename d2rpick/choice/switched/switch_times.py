"""Read the switch times of a finished run from its own output and that of its reference run.

Some solvers write no kinetic energy for rigid parts, which shows the rigid windows even if nothing vibrates. Otherwise,
a window shows by an energy that is constant although that of the reference run is not.
"""

from __future__ import annotations

from itertools import chain
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import RangeError, format_ranges, list_names
from d2rpick.choice.pair.decision import GIVE_SWITCHED_RUN_OF_MODEL
from d2rpick.choice.switched.frozen import (
    FEWEST,
    compute_energy_range,
    find_frozen_times,
)
from d2rpick.choice.switched.same_model import check_same_model
from d2rpick.choice.switched.switched_run import find_absent_windows
from d2rpick.flight.internal_energy import round_off
from d2rpick.flight.window import LAST_DIGIT
from d2rpick.histories.samples import find_stretches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.base.spans import Times
    from d2rpick.choice.question import Reference
    from d2rpick.histories.history import History, Samples
    from d2rpick.histories.names import Part

# If the switch time is unknown, runs are assumed to be deformable for this first fraction of the record [-].
_EARLY: Final = 0.1
# The last output intervals of a constant energy in which a contact may have begun.
_AT_CONTACT: Final = 2
# Number of trial times between two states in the search for the switch to rigid.
_BETWEEN: Final = 101


class SwitchedWindow(NamedTuple):
    """A window in which parts of a finished run were rigid [time].

    ``tr`` lies between the last state before the window and the ``first`` state in it, at the time at which the energy
    of the reference run equals the frozen energy. ``td`` is the last state in the window. ``rigid`` contains the parts
    that their output shows to be rigid; it is empty if only the energy shows the window. ``whole`` is True if no other
    part deforms.
    """

    tr: float
    first: float
    td: float
    rigid: tuple[Part, ...] = ()
    whole: bool = True


class SwitchedWindows(NamedTuple):
    """The rigid windows of a finished run in the order of time: the judged one, and those before and after it.

    ``judged`` is None if the output shows no window between the given times.
    """

    judged: SwitchedWindow | None
    earlier: tuple[SwitchedWindow, ...] = ()
    later: tuple[SwitchedWindow, ...] = ()

    @property
    def first_rigid(self) -> float:
        """The first state that may be rigid [time]; infinity if no window is known."""
        listed = chain(self.earlier, [self.judged] if self.judged else (), self.later)
        return min((window.first for window in listed), default=np.inf)


def find_switched_windows(
    switched: Reference, reference: History
) -> tuple[SwitchedWindow, ...]:
    """Return the windows in which a finished run was rigid, in order of time; empty if none is found.

    Windows in which only some parts lack kinetic energy, and have no internal energy either, are left out: such parts
    may be at rest.
    """
    history = switched.history
    time = history.time
    windows = [
        SwitchedWindow(
            _find_start(history, reference, int(np.searchsorted(time, window.start))),
            window.start,
            window.end,
            window.rigid,
            window.whole,
        )
        for window in find_absent_windows(switched)
        if window.whole or window.is_frozen
    ]
    windows = windows or [
        SwitchedWindow(
            _find_start(history, reference, span.first),
            float(time[span.first]),
            float(time[span.last]),
        )
        for span in _find_changed_spans(history, reference)
    ]
    return tuple(windows)


def refuse_exchanged_runs(
    reference: Reference, switched: Reference, windows: Sequence[SwitchedWindow]
) -> None:
    """Raise RangeError if the reference run was switched, and the switched run has no rigid ``windows``."""
    if windows or find_frozen_times(switched.history):
        return
    rigid = [
        (window.start, window.end)
        for window in find_absent_windows(reference)
        if window.whole or window.is_frozen
    ] or find_frozen_times(reference.history)
    if not rigid:
        return
    spans = list_names([f"{start:.6g} to {end:.6g}" for start, end in rigid])
    raise RangeError(
        f"{', '.join(reference.history.source)}: this is the switched run, rigid from {spans}, and "
        f"{', '.join(switched.history.source)} was not switched: exchange them, so that `switched` names the "
        "switched run"
    )


def read_switch_times(
    switched: Reference,
    reference: History,
    windows: Sequence[SwitchedWindow],
    tr: float | None,
    td: float | None,
    explain: Callable[[], str] = str,
) -> Times:
    """Complete tr and td with those of the nearest of the rigid ``windows`` of the switched run [time].

    If neither is given, the window is the first, because only the first can be compared in every case: what it freezes
    changes the run after it. ``explain`` returns what is known of the models of the two runs if their energies differ.

    Raises
    ------
    RangeError
        If there is no window, if only some parts of the model were rigid and no part was chosen, or if the times lie
        outside the record of the reference run.
    """
    if not windows:
        raise _explain_why_no_times(switched, reference, explain)
    if td is not None:
        window = min(windows, key=lambda window: abs(window.td - td))
    elif tr is not None:
        window = min(windows, key=lambda window: abs(window.tr - tr))
    else:
        window = windows[0]
    if not window.whole and switched.history.parts is None:
        raise _ask_for_parts(switched.history, window)
    for time in (window.tr, window.td):
        reference.check(time, subject="the switch time of the switched run,")
    return window.tr if tr is None else tr, window.td if td is None else td


def sort_windows(windows: Sequence[SwitchedWindow], pair: Times) -> SwitchedWindows:
    """Return the window that overlaps with tr and td the longest, and the windows before and after it."""
    tr, td = pair

    def measure_overlap(window: SwitchedWindow) -> float:
        return min(td, window.td) - max(tr, window.tr)

    judged = max(windows, key=measure_overlap, default=None)
    if judged and measure_overlap(judged) <= 0:
        judged = None
    others = [window for window in windows if window is not judged]
    start = judged.first if judged else tr
    return SwitchedWindows(
        judged,
        tuple(window for window in others if window.first < start),
        tuple(window for window in others if window.first >= start),
    )


def _explain_why_no_times(
    switched: Reference, reference: History, explain: Callable[[], str]
) -> RangeError:
    """Return the error that explains why no rigid window of a switched run is found."""
    early = reference.start + _EARLY * reference.duration
    history = switched.history
    source = ", ".join(history.source)
    for reason in check_same_model(reference, history, early, explain):
        return RangeError(f"{source}: {reason}; {GIVE_SWITCHED_RUN_OF_MODEL}")
    reason, cure = _explain_missing_window(switched, reference)
    cure = history.left_beside or f"; {cure}"
    return RangeError(f"{source}: {reason}{cure}")


def _ask_for_parts(switched: History, window: SwitchedWindow) -> RangeError:
    """Return the error that names the rigid parts of a window, because the energy of the whole model is not theirs."""
    span = f"from {window.first:.6g} to {window.td:.6g}"
    names = list_names([part.name for part in window.rigid])
    ids = ",".join(format_ranges(part.id for part in window.rigid))
    return RangeError(
        f"{', '.join(switched.source)}: {span} only these parts were rigid: {names}; choose them with `parts` {ids}"
    )


def _explain_missing_window(switched: Reference, reference: History) -> tuple[str, str]:
    """Return why no rigid window is found, and what to do if the times are not given."""
    other_run = "give the run with the switching cards, or `tr` and `td`"
    history = switched.history
    is_same = np.array_equal(history.time, reference.time) and np.array_equal(
        history.energy, reference.energy
    )
    if is_same:
        reason = (
            "both runs have the same energies, so it may be the reference run again"
        )
        return reason, other_run
    constant = next(_find_constant_spans(history, reference), None)
    if constant is None:
        reason = f"the energy never stays constant for {FEWEST} states, so no part seems to have been rigid"
        return reason, other_run
    start, end = history.time[constant.first], history.time[constant.last]
    reason = (
        f"the energy stays constant from {start:.6g} to {end:.6g}, but that of the reference run does too, so it does "
        "not show when the parts were rigid"
    )
    if history.parts or not switched.run.parts:
        return reason, "give `tr` and `td`"
    return reason, "give the rigid parts with `parts`, or `tr` and `td`"


class _ConstantSpan(NamedTuple):
    """First and last state of a span of constant energy, and the change that is treated as zero [energy]."""

    first: int
    last: int
    limit: float


def _find_constant_spans(
    switched: History, reference: History
) -> Iterator[_ConstantSpan]:
    """Yield the spans in which the energy of a switched run is constant, from state to state and as a whole.

    The energies of rigid or resting parts are only round-off, which may change during a fall.
    """
    limits = _find_limits_of_change(switched, round_off(reference))
    unchanged = np.abs(np.diff(switched.energy)) <= limits[1:]
    for still in find_stretches(np.append(False, unchanged), FEWEST):
        states = slice(max(still.start - 1, 0), still.stop)
        limit = 2 * float(limits[states].max())
        if np.ptp(switched.energy[states]) <= limit:
            yield _ConstantSpan(states.start, states.stop - 1, limit)


def _find_changed_spans(
    switched: History, reference: History
) -> Iterator[_ConstantSpan]:
    """Yield the spans in which the energy of the switched run is constant, but that of the reference run is not.

    The end of a span does not count, because a contact may begin there, and a little later in the switched run.
    """
    for span in _find_constant_spans(switched, reference):
        start, end = switched.time[[span.first, span.last]].tolist()
        end = max(start, end - _AT_CONTACT * switched.step)
        if compute_energy_range(reference, start, end) > span.limit:
            yield span


def _find_limits_of_change(switched: History, rounding: float) -> Samples:
    """Return the largest change of each energy that is treated as zero, shape (n,) [energy]."""
    energy = switched.energy
    digits = np.maximum(
        LAST_DIGIT * np.abs(energy), switched.energy_precision.quanta(energy)
    )
    return np.maximum(digits, rounding)


def _find_start(switched: History, reference: History, first: int) -> float:
    """Return when a window with the ``first`` rigid state begins: when the reference run has the frozen energy."""
    time = switched.time
    times_before = np.linspace(time[max(first - 1, 0)], time[first], _BETWEEN)
    differences = reference.energies_at(times_before) - switched.energy[first]
    return float(times_before[np.abs(differences).argmin()])
