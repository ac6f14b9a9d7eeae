"""Times of switches by force that give planned windows: TIME1, TIME2, TIME3 and OFFSET of a pair, Tdelay of a sensor.

A switch by force knows no plan: its times are chosen so that, in a run of which it is known when something pushes, its
windows come as near to the planned ones as one wait for all of them allows.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError
from d2rpick.deck.force_switching import ForceSwitch, follow_pair
from d2rpick.deck.radioss_sensors import either, inactive

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.deck.printed_card import Times

    Spans = tuple[Times, ...]


_ROUNDING: Final = 1e-12  # of sums of times


class Pushes(NamedTuple):
    """When something pushes the parts: ``spans`` (from, to) [time], and how fast they come to it [length/time]."""

    spans: Spans
    speed: float | None = None


class Timing(NamedTuple):
    """Times of a switch by force, and the windows that come of them.

    ``earliest`` and ``latest``: it acts between them; ``wait`` is TIME3 of the set that makes parts deformable, or
    Tdelay; ``offset`` is a distance, 0 for none.
    """

    earliest: float
    latest: float
    wait: float
    offset: float
    windows: Spans


def time_pair(windows: Sequence[Times], pushes: Pushes) -> Timing:
    """Time a pair of LS-DYNA: it becomes rigid without force, after the wait, and deformable shortly before a force.

    The OFFSET is how far the parts fly from the td of the first window to the contact after it.

    Raises
    ------
    DeckError
        If no wait gives as many windows as are planned.
    """
    contacts_after = [_find_after(td, pushes.spans) for _, td in windows]
    leads = [
        start - td
        for (_, td), (start, _) in zip(windows, contacts_after, strict=True)
        if start < math.inf
    ]
    lead = min(leads, default=0.0) if pushes.speed else 0.0
    advanced = tuple((start - lead, end) for start, end in pushes.spans)
    landing = contacts_after[-1]
    latest = (
        windows[-1][1] if landing[0] == math.inf else (landing[0] + landing[1]) / 2
    )  # in the contact behind them
    rigid = ForceSwitch(True, False, windows[0][0], latest)

    def follow(wait: float) -> Sequence[tuple[float, float | None]]:
        return follow_pair(
            rigid, ForceSwitch(False, True, delay=wait), advanced, math.inf
        )

    waits = [tr - td for (_, td), (tr, _) in itertools.pairwise(windows)]
    wait, switched = _find_least_wait(waits, windows, follow, "pair of switch sets")
    return Timing(windows[0][0], latest, wait, lead * (pushes.speed or 0.0), switched)


def time_sensor(windows: Sequence[Times], pushes: Pushes) -> Timing:
    """Time a sensor of Radioss: parts are deformable while it is active, up to the wait after each force.

    Up to the first window, and from the last one on, they are deformable in any case.

    Raises
    ------
    DeckError
        If no wait gives as many windows as are planned.
    """
    contacts_before = [_find_before(tr, pushes.spans) for tr, _ in windows]
    first, last = windows[0][0], windows[-1][1]

    def follow(wait: float) -> Sequence[tuple[float, float | None]]:
        pushed = tuple((start, end + wait) for start, end in pushes.spans)
        active = either(
            [pushed, ((0.0, first),) if first > 0 else (), ((last, math.inf),)]
        )
        return inactive(active)

    waits = [
        tr - end
        for (tr, _), (_, end) in zip(windows, contacts_before, strict=True)
        if end > -math.inf
    ]
    wait, switched = _find_least_wait(waits, windows, follow, "sensor")
    return Timing(first, last, wait, 0.0, switched)


def _find_least_wait(
    waits: Sequence[float],
    windows: Sequence[Times],
    follow: Callable[[float], Sequence[tuple[float, float | None]]],
    what: str,
) -> tuple[float, Spans]:
    """Give the least wait whose windows are as many as those planned, none of which begins before it is planned."""
    switched: list[Times] = []
    for wait in sorted({0.0, *waits}):
        switched = [(tr, math.inf if td is None else td) for tr, td in follow(wait)]
        if len(switched) == len(windows) and switched[-1][1] < math.inf:
            early = (
                got < wanted * (1 - _ROUNDING)
                for (got, _), (wanted, _) in zip(switched, windows, strict=True)
            )
            if not any(early):
                return wait, tuple(switched)
    achieved = ", ".join(f"{tr:.6g} to {td:.6g}" for tr, td in switched) or "none"
    planned = ", ".join(f"{tr:.6g} to {td:.6g}" for tr, td in windows)
    raise DeckError(
        f"no wait lets a {what} switch in the planned windows ({planned}): its windows would be {achieved}; plan one"
        " for each flight, or switch by time"
    )


def _find_after(time: float, spans: Sequence[Times]) -> Times:
    """Give the first span that begins after a time; infinite without one."""
    return next((span for span in spans if span[0] >= time), (math.inf, math.inf))


def _find_before(time: float, spans: Sequence[Times]) -> Times:
    """Give the last span that ends before a time; minus infinite without one."""
    return next(
        (span for span in reversed(spans) if span[1] <= time), (-math.inf, -math.inf)
    )
