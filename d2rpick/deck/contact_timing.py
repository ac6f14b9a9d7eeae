"""Find settings with which force-triggered switches make parts rigid in the planned windows.

These are TIME1, TIME2, TIME3 and OFFSET of an LS-DYNA pair, or Tdelay of a Radioss sensor. A force-triggered switch has
no times of its own. The same waiting time applies to all windows; it is chosen so that, with the known contact times of
a run, the resulting windows are as close as possible to the planned windows.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import DeckError
from d2rpick.deck.force_switching import ForceSwitch, follow_pair
from d2rpick.deck.radioss_sensors import invert_spans, join_spans

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.base.spans import Spans, Times


_ROUNDING: Final = 1e-12  # Relative rounding error in a sum of times [-].


class Pushes(NamedTuple):
    """Time spans in which a contact force acts on the switched parts [time].

    ``speed`` is the speed at which the parts approach the contact [length/time].
    """

    spans: Spans
    speed: float | None = None


class ForceTiming(NamedTuple):
    """Times of a force-triggered switch, and the windows in which it makes parts rigid.

    The switch acts between ``earliest`` and ``latest``. ``wait`` is TIME3 of the set that makes parts deformable, or
    Tdelay. ``offset`` is OFFSET [length]; 0 if the card has no offset.
    """

    earliest: float
    latest: float
    wait: float
    offset: float
    windows: Spans


def find_pair_timing(windows: Sequence[Times], pushes: Pushes) -> ForceTiming:
    """Return the times of a pair of LS-DYNA switch sets that makes parts rigid in the planned windows.

    The switch makes parts rigid when no force has acted for the wait (the force-free time after which it switches), and
    deformable shortly before the next force. OFFSET is the distance that the parts fly from td of the first window to
    the contact after it.

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
    if landing[0] == math.inf:
        latest = windows[-1][1]
    else:
        latest = (landing[0] + landing[1]) / 2
    rigid = ForceSwitch(True, False, windows[0][0], latest)

    def follow(wait: float) -> Sequence[tuple[float, float | None]]:
        # OFFSET belongs to the set that makes the parts deformable. The other set still sees no force at this time.
        returns = ForceSwitch(False, True, delay=wait)
        return follow_pair(rigid, returns, pushes.spans, math.inf, advanced)

    waits = [tr - td for (_, td), (tr, _) in itertools.pairwise(windows)]
    # Until the middle of the next contact, so that the wait also suffices if this contact begins somewhat later.
    waits += [
        (start + end) / 2 - td
        for (_, td), (start, end) in zip(windows, contacts_after, strict=True)
        if start < math.inf and lead > 0
    ]
    wait, switched = _find_least_wait(waits, windows, follow, "pair of switch sets")
    return ForceTiming(
        windows[0][0], latest, wait, lead * (pushes.speed or 0.0), switched
    )


def find_sensor_timing(windows: Sequence[Times], pushes: Pushes) -> ForceTiming:
    """Return the times of a Radioss force sensor; parts are deformable during each force and a waiting time after it.

    Before the first window and after the last one, they are always deformable.

    Raises
    ------
    DeckError
        If no wait gives as many windows as are planned.
    """
    contacts_before = [_find_before(tr, pushes.spans) for tr, _ in windows]
    first = windows[0][0]
    last = windows[-1][1]

    def follow(wait: float) -> Sequence[tuple[float, float | None]]:
        pushed = tuple((start, end + wait) for start, end in pushes.spans)
        active = join_spans(
            [pushed, ((0.0, first),) if first > 0 else (), ((last, math.inf),)]
        )
        return invert_spans(active)

    waits = [
        tr - end
        for (tr, _), (_, end) in zip(windows, contacts_before, strict=True)
        if end > -math.inf
    ]
    wait, switched = _find_least_wait(waits, windows, follow, "sensor")
    return ForceTiming(first, last, wait, 0.0, switched)


def _find_least_wait(
    waits: Sequence[float],
    windows: Sequence[Times],
    follow: Callable[[float], Sequence[tuple[float, float | None]]],
    what: str,
) -> tuple[float, Spans]:
    """Return the shortest waiting time that gives the planned number of windows, none of them earlier than planned."""
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
        f"no force-free time lets a {what} switch in the planned windows ({planned}): its windows "
        f"would be {achieved}; plan one"
        " window for each flight, or switch by time"
    )


def _find_after(time: float, spans: Sequence[Times]) -> Times:
    """Return the first span that begins at or after a time, or (infinity, infinity) if there is none."""
    return next((span for span in spans if span[0] >= time), (math.inf, math.inf))


def _find_before(time: float, spans: Sequence[Times]) -> Times:
    """Return the last span that ends at or before a time, or (-infinity, -infinity) if there is none."""
    return next(
        (span for span in reversed(spans) if span[1] <= time), (-math.inf, -math.inf)
    )
