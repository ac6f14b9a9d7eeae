"""What switches by a force do in a run of which it is known when something pushes: pairs of LS-DYNA, by their CODEs.

Source: the vendor's keyword data as published in its Python library: a set switches between TIME1 and TIME2 when the
force of its contact or wall is zero (CODE 1, 2) or not (3, 4), sets of a pair act in turn, the one with PAIRED 1 first,
and none acts again before TIME3 of the last switch is over.  Not tried with the solver.
"""

from __future__ import annotations

import math
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    Spans = Sequence[tuple[float, float]]  # of time


class ForceSwitch(NamedTuple):
    """A switch set: what it makes of its parts, whether it waits for a force, and between which times [time].

    ``delay`` is TIME3; ``paired``: its pair and it act in turn.
    """

    to_rigid: bool
    with_force: bool
    earliest: float = 0.0
    latest: float = math.inf
    delay: float = 0.0
    paired: bool = True


def follow_pair(
    first: ForceSwitch,
    other: ForceSwitch | None,
    contacts: Spans,
    end: float,
    other_contacts: Spans | None = None,
) -> list[tuple[float, float | None]]:
    """Give the windows in which a set and its pair make their parts rigid.

    Parameters
    ----------
    first, other : ForceSwitch
        The set that acts first, and its pair; None for a set alone, which switches once.
    contacts : sequence of (float, float)
        When something pushes, ascending [time].
    end : float
        Of the run [time].
    other_contacts : sequence of (float, float), optional
        When something pushes as the other set sees it: it may wait for the force of another contact, or be early by
        its OFFSET.  As ``contacts`` by default.

    Returns
    -------
    list of (float, float or None)
        From when to when the parts are rigid; None: to the end.

    Examples
    --------
    >>> rigid, back = ForceSwitch(True, False, 0.02), ForceSwitch(False, True, delay=0.01)
    >>> follow_pair(rigid, back, [(0.0, 0.03), (0.05, 0.052), (0.054, 0.07)], 0.1)
    [(0.03, 0.05), (0.07, None)]
    """
    windows: list[tuple[float, float | None]] = []
    others = contacts if other_contacts is None else other_contacts
    for time, to_rigid in _switches((first, contacts), (other, others), end):
        if to_rigid and not (windows and windows[-1][1] is None):
            windows.append((time, None))
        elif not to_rigid and windows and windows[-1][1] is None:
            windows[-1] = windows[-1][0], time
    return windows


def _switches(
    first: tuple[ForceSwitch, Spans],
    second: tuple[ForceSwitch | None, Spans],
    end: float,
) -> Iterator[tuple[float, bool]]:
    """Give when the sets act, in turn, and whether they make their parts rigid; each by the contacts that it sees."""
    ready = 0.0
    turns = cycle((first, second)) if first[0].paired else iter((first, second))
    for acting, contacts in turns:
        if acting is None:
            return
        time = _next(acting.with_force, max(acting.earliest, ready), contacts)
        if time >= end or time > acting.latest:
            return
        yield time, acting.to_rigid
        ready = max(time + acting.delay, math.nextafter(time, math.inf))


def _next(with_force: bool, since: float, contacts: Spans) -> float:
    """Give the first time from ``since`` on at which there is a force, or none; infinite for never."""
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
    """Give the least TIME3 of the set that makes parts deformable for it to switch in these windows alone.

    Each contact after which a window begins has to be over before; None where no contact comes before any.
    """
    before = [[span for span in contacts if span[1] <= tr] for tr, _ in windows]
    clusters = [_cluster(spans, windows) for spans in before if spans]
    return max((end - start for start, end in clusters), default=None)


def _cluster(
    contacts: Spans, windows: Sequence[tuple[float, float]]
) -> tuple[float, float]:
    """Give the time from the first to the last of some contacts, of those that follow the last window before them."""
    last = contacts[-1][1]
    after = max((td for _, td in windows if td <= last), default=-math.inf)
    return min(start for start, end in contacts if end > after), last
