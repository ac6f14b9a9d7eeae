"""Evaluate force-triggered switches (LS-DYNA's CODE 1 to 4) for known contact times.

Source: the vendor's keyword data as published in its Python library. A set switches between TIME1 and TIME2 when the
force of its contact or wall is zero (CODE 1, 2) or not zero (CODE 3, 4). The sets of a pair act in turn, beginning with
the one that has PAIRED 1. No set acts within TIME3 after the last switch. This was not tested with the solver.
"""

from __future__ import annotations

import itertools
import math
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    Spans = Sequence[tuple[float, float]]  # Start and end of each time span [time].


class ForceSwitch(NamedTuple):
    """A switch set that waits until a force acts (``with_force`` is True) or until no force acts.

    The set acts between ``earliest`` and ``latest`` [time]. ``delay`` is TIME3. ``paired`` is True if the set and its
    counterpart act in turn.
    """

    to_rigid: bool
    with_force: bool
    earliest: float = 0.0
    latest: float = math.inf
    delay: float = 0.0
    paired: bool = True


def follow_pair(
    first: ForceSwitch,
    second: ForceSwitch | None,
    contacts: Spans,
    end: float,
    second_contacts: Spans | None = None,
) -> list[tuple[float, float | None]]:
    """Return the windows in which a switch set and its counterpart make their parts rigid.

    Parameters
    ----------
    first, second : ForceSwitch
        The set that acts first, and its pair; a single set has no pair (None) and switches once.
    contacts : sequence of (float, float)
        Spans in which a contact force acts, ascending [time].
    end : float
        End of the run [time].
    second_contacts : sequence of (float, float), optional
        Contacts for the second set, which may wait for the force of another contact, or act before the contact because
        of its OFFSET. The default is ``contacts``.

    Returns
    -------
    list of (float, float or None)
        Begin and end of each rigid window; None if it lasts to the end of the run.

    Examples
    --------
    >>> rigid, back = ForceSwitch(True, False, 0.02), ForceSwitch(False, True, delay=0.01)
    >>> follow_pair(rigid, back, [(0.0, 0.03), (0.05, 0.052), (0.054, 0.07)], 0.1)
    [(0.03, 0.05), (0.07, None)]
    """
    windows: list[tuple[float, float | None]] = []
    seen_by_second = contacts if second_contacts is None else second_contacts
    for time, to_rigid in _follow_switches(
        (first, contacts), (second, seen_by_second), end
    ):
        if to_rigid and not (windows and windows[-1][1] is None):
            windows.append((time, None))
        elif not to_rigid and windows and windows[-1][1] is None:
            windows[-1] = windows[-1][0], time
    return windows


def _follow_switches(
    first: tuple[ForceSwitch, Spans],
    second: tuple[ForceSwitch | None, Spans],
    end: float,
) -> Iterator[tuple[float, bool]]:
    """Yield the times at which two sets switch in turn, each with True if the parts become rigid, else False.

    While the conditions of both sets hold, the sets act again and again (chatter). Only the first two of these switches
    are yielded; the next one follows when a force begins or ends.
    """
    changes = _list_changes(first, second)
    last_time, ready = -math.inf, 0.0
    turns = cycle((first, second)) if first[0].paired else iter((first, second))
    for acting, contacts in turns:
        if acting is None:
            return
        time = _find_next_switch(
            acting.with_force, max(acting.earliest, ready), contacts
        )
        if time >= end or time > acting.latest:
            return
        yield time, acting.to_rigid
        ready = max(time + acting.delay, math.nextafter(time, math.inf))
        if not acting.to_rigid and not any(
            last_time < change <= time for change in changes
        ):
            later = (change for change in changes if change > time)
            ready = max(ready, min(later, default=math.inf))
        last_time = time


def _list_changes(*sets: tuple[ForceSwitch | None, Spans]) -> list[float]:
    """Return the times at which the condition of one of the sets begins or ceases to hold."""
    return [
        time
        for acting, contacts in sets
        if acting is not None
        for time in (acting.earliest, *itertools.chain(*contacts))
    ]


def _find_next_switch(with_force: bool, since: float, contacts: Spans) -> float:
    """Return the first time at or after ``since`` at which a force acts, or none acts; infinity if there is none."""
    for start, end in contacts:
        if since < end:
            if with_force:
                return max(since, start)
            if since < start:
                return since
            since = end
    return math.inf if with_force else since


def find_delay_without_chatter(
    windows: Sequence[tuple[float, float]], contacts: Spans
) -> float | None:
    """Return the smallest TIME3 of the releasing set with which the pair switches only in these windows.

    TIME3 begins at the end of a window. It must last until the next contact begins, because the parts would otherwise
    become rigid again before this contact, and until all contacts before the next window have ended. The result is None
    if there is no contact before or after a window.
    """
    delays = [end - begin for begin, end in _list_pauses(windows, contacts)]
    return max(delays, default=None)


def _list_pauses(
    windows: Sequence[tuple[float, float]], contacts: Spans
) -> Iterator[tuple[float, float]]:
    """Yield the time spans around the contacts in which the pair must not act."""
    for tr, _ in windows:
        earlier = [span for span in contacts if span[1] <= tr]
        if earlier:
            last_end = earlier[-1][1]
            ends_of_windows = [td for _, td in windows if td <= last_end]
            yield max(ends_of_windows, default=earlier[0][0]), last_end
    for _, td in windows:
        start = min((start for start, _ in contacts if start >= td), default=None)
        if start is not None:
            yield td, start
