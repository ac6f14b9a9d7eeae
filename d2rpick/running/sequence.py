"""Which leg comes next in a first run that is switched while it runs: from what the legs so far have shown.

What each kind of leg does is said in docs/first-run.md.  One that is thrown away has the number of the leg that takes
its place.  A probe with a restart shortly before td is kept up to there.
"""

from __future__ import annotations

from itertools import takewhile
from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import D2RPickError
from d2rpick.flight.margin import SHARE

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

LOAD, SEARCH, APPROACH, PROBE, RIGID = "load", "search", "approach", "probe", "rigid"
RIGID_KINDS: Final = (PROBE, RIGID)
# A search ends when nothing higher came for this share of it: the rest would be computed twice.
_PASSED: Final = 0.25
# Where a leg ends, its history does so up to one state earlier; times within it are the same.
_STATES: Final = 1.5
# Cycles are counted from the last state before a leg, though it begins up to one interval later: that many small steps
# are five times as long when rigid, and a restart may come so much later than it seems.
_EARLY: Final = 8.0
_MOST_LEGS: Final = 99


class Limits(NamedTuple):
    """What the legs keep to [time]: ``shortest`` is the wait of a flight without energy, and the least margin.

    ``interval`` is that of the history.
    """

    end: float
    interval: float
    shortest: float
    margin: float | None = None

    def margin_of(self, flight: float, *, idle: bool = False) -> float:
        """Margin before the contact at the end of a flight of this length [time]; ``idle``: nothing vibrates in it."""
        if self.margin is not None:
            return self.margin
        # the share held in eight windows of two structures; where nothing vibrates the rigid body flies as the
        # deformable one would, and the least margin is enough
        return self.shortest if idle and self.shortest else max(self.shortest, SHARE * flight)

    @property
    def same(self) -> float:
        """By less than this times differ that are the same."""
        return _STATES * self.interval


class Order(NamedTuple):
    """A leg to be computed: to ``until`` at most, from a restart at ``start``; flights from before ``after`` are over.

    ``restart`` is its letter, None for the last one of the leg before.
    """

    kind: str
    number: int
    start: float
    until: float
    after: float = 0.0
    restart: str | None = None

    @property
    def rigid(self) -> bool:
        """Whether the parts are rigid in it."""
        return self.kind in RIGID_KINDS


class Seen(NamedTuple):
    """What the record of a leg shows up to its last state, at ``time``.

    ``free``: since when no force acts, None where one does; ``wait``: how long that is asked for; ``peak``: when the
    energy was highest in the leg; ``idle``: no energy was ever stored; ``contact``: the first one in the leg.
    """

    time: float
    free: float | None = None
    wait: float = 0.0
    peak: float | None = None
    idle: bool = False
    contact: float | None = None


class Leg(NamedTuple):
    """A leg that is over; ``cut``: the solver was ended from outside, and its last restart is what counts.

    ``restarts`` are those that it wrote on its way, each with its time and letter; ``cycles`` and processor time
    ``cpu`` [s] are None where unknown.
    """

    order: Order
    seen: Seen
    cut: bool = False
    restarts: tuple[tuple[float, str], ...] = ()
    cycles: int | None = None
    cpu: float | None = None

    @property
    def kind(self) -> str:
        """What it was ordered for."""
        return self.order.kind

    @property
    def length(self) -> float:
        """How long it was [time]."""
        return self.seen.time - self.order.start

    def whole(self, limits: Limits) -> bool:
        """Whether it reached its end."""
        return self.seen.time > self.order.until - limits.same


class Window(NamedTuple):
    """A flight that was switched, or left out with a ``reason``; ``free`` since when, ``contact`` when seen rigid."""

    free: float
    tr: float
    td: float
    contact: float | None
    wait: float
    reason: str | None = None


def next_order(legs: Sequence[Leg], limits: Limits) -> Order | None:
    """Say which leg comes next; None when the run is over.

    Raises
    ------
    D2RPickError
        If a leg got nowhere, or the solver has no number for one more.
    """
    if not legs:
        return Order(LOAD, 1, 0.0, limits.end)
    last = legs[-1]
    if last.order.number > 1 and last.seen.time <= last.order.start and not last.cut:
        raise D2RPickError(f"leg {last.order.number} stopped where it began, at {last.seen.time:.6g}; see its listing")
    order = _NEXT[last.order.kind](legs, limits)
    if order and order.number > _MOST_LEGS:
        raise D2RPickError(f"the run needs more than {_MOST_LEGS} legs, which the solver cannot number; raise `wait`")
    return order


def _after_load(legs: Sequence[Leg], limits: Limits) -> Order | None:
    last, seen = legs[-1], legs[-1].seen
    if last.whole(limits):
        return None
    if last.cut or not lasts(last.order, seen, limits):
        return _following(last, LOAD, limits.end)
    if not _room(seen, seen.time, limits):
        return _following(last, LOAD, limits.end)._replace(after=seen.time)
    if seen.idle:
        return _following(last, PROBE, limits.end)
    return _following(last, SEARCH, min(seen.time + seen.wait, limits.end))


def _after_search(legs: Sequence[Leg], limits: Limits) -> Order | None:
    last, seen = legs[-1], legs[-1].seen
    if last.cut or last.seen.contact is not None or seen.peak is None:
        return _following(last, LOAD, limits.end) if seen.time < limits.end - limits.same else None
    if seen.peak <= last.order.start + limits.same:
        return last.order._replace(kind=PROBE, until=limits.end)
    if seen.peak >= seen.time - limits.same:
        return _following(last, PROBE, limits.end)
    before = [one for one in last.restarts if one[0] < seen.peak - limits.same]
    if not before:
        return last.order._replace(kind=APPROACH, until=seen.peak)
    start, letter = max(before)
    return _following(last, APPROACH, seen.peak)._replace(start=start, restart=letter)


def _passed(order: Order, seen: Seen, limits: Limits) -> bool:
    """Whether nothing higher came for so long that a search is over."""
    return seen.peak is not None and seen.time - seen.peak >= _PASSED * (order.until - order.start) - limits.same


def _after_approach(legs: Sequence[Leg], limits: Limits) -> Order | None:
    last = legs[-1]
    kind, until = (PROBE, limits.end) if last.whole(limits) else (APPROACH, last.order.until)
    return _following(last, LOAD if last.cut else kind, limits.end if last.cut else until)


def _after_probe(legs: Sequence[Leg], limits: Limits) -> Order | None:
    last = legs[-1]
    if last.seen.contact is None:
        return None if last.whole(limits) and not last.cut else last.order
    found, first = window_of(legs, limits), _frozen(legs)
    if found.reason:
        return first._replace(kind=LOAD, until=limits.end, after=found.tr + limits.same)
    before = [one for one in last.restarts if one[0] < found.td - _EARLY * limits.interval]
    if not before:
        return first._replace(kind=RIGID, until=found.td)
    start, letter = max(before)
    return _following(last, RIGID, found.td)._replace(start=start, restart=letter)


def _after_rigid(legs: Sequence[Leg], limits: Limits) -> Order | None:
    last = legs[-1]
    if last.seen.contact is not None:
        return _after_probe(legs, limits)
    if last.cut or not last.whole(limits):
        return last.order
    return _following(last, LOAD, limits.end)._replace(after=last.seen.time)


_NEXT: Final[Mapping[str, Callable[[Sequence[Leg], Limits], Order | None]]] = {
    LOAD: _after_load,
    SEARCH: _after_search,
    APPROACH: _after_approach,
    PROBE: _after_probe,
    RIGID: _after_rigid,
}


def _following(last: Leg, kind: str, until: float) -> Order:
    start = last.order.start if last.cut else last.seen.time  # nobody knows when its last restart was written
    return Order(kind, last.order.number + 1, start, until, last.order.after)


def lasts(order: Order, seen: Seen, limits: Limits, share: float = 1.0) -> bool:
    """Whether what is seen has been a flight for this share of the wait."""
    if seen.free is None or seen.free < order.after:
        return False
    return seen.time - seen.free >= share * _wait(seen, limits) - limits.same


def _room(seen: Seen, time: float, limits: Limits) -> bool:
    """Whether a window that begins at a time can last for two waits before the run ends."""
    return limits.end - time >= 2 * _wait(seen, limits)


def _wait(seen: Seen, limits: Limits) -> float:
    return min(seen.wait, limits.shortest) if seen.idle and limits.shortest else seen.wait


def window_of(legs: Sequence[Leg], limits: Limits) -> Window:
    """Give the window before the contact that the last of these legs has shown, or the end of the run without one."""
    seen, tr = legs[-1].seen, _frozen(legs).start
    flown = next(leg.seen for leg in reversed(legs) if leg.order.kind == LOAD)
    free = tr if flown.free is None else flown.free
    wait = _wait(flown, limits)
    if seen.contact is None:
        return Window(free, tr, seen.time, None, wait)
    td = seen.contact - limits.margin_of(seen.contact - free, idle=flown.idle)
    reason = f"shorter than two waits, {2 * wait:.4g}" if td - tr < 2 * wait else None
    return Window(free, tr, td, seen.contact, wait, reason)


def _frozen(legs: Sequence[Leg]) -> Order:
    """Order of the leg in which the parts became rigid, of those that the last leg goes on with."""
    *_, first = takewhile(lambda leg: leg.order.rigid, reversed(legs))
    return first.order


def windows(legs: Sequence[Leg], limits: Limits) -> list[Window]:
    """Give the windows of all flights so far that were switched or left out, in their order."""
    found: dict[int, Window] = {}
    for count, leg in enumerate(legs, start=1):
        ended_by_itself = leg.order.kind == PROBE and leg.whole(limits) and not leg.cut
        if leg.order.rigid and (leg.seen.contact is not None or ended_by_itself):
            found[_frozen(legs[:count]).number] = window_of(legs[:count], limits)
    return list(found.values())


def control(order: Order, seen: Seen, limits: Limits) -> str:
    """Say what the engine is to be told by what is seen of a leg that is being computed; nothing where it goes on."""
    if seen.time <= order.start:
        return ""  # its first state is still to come
    if order.rigid:
        return "/KILL\n" if seen.contact is not None else ""
    if order.kind == SEARCH:
        return "/STOP\n" if _passed(order, seen, limits) else ""
    if order.kind != LOAD or seen.free is None or not lasts(order, seen, limits, 0.5):
        return ""
    ready = seen.free + _wait(seen, limits)
    if not _room(seen, ready, limits):
        return ""
    return f"/TIME/{ready:.9g}\n/STOP\n" if ready > seen.time else "/STOP\n"
