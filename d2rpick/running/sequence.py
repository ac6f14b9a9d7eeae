"""Which leg comes next in a first run that is switched while it runs: from what the legs so far have shown.

A leg ends at a time that was fixed before it began, so that the same command computes the same legs, however fast the
machine is.  One that is thrown away has the number of the leg that takes its place.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import D2RPickError
from d2rpick.flight.margin import SHARE
from d2rpick.flight.window import FEWEST

if TYPE_CHECKING:
    from collections.abc import Sequence

LOAD, PROBE, RIGID = "load", "probe", "rigid"
RIGID_KINDS: Final = (PROBE, RIGID)
# Where a leg ends, its history does so up to one state earlier; times within it are the same.
_STATES: Final = 1.5
# The solver numbers so many legs; flights are looked for as long as so many are left, which takes the run to its end.
_MOST_LEGS, _KEPT_BACK = 99, 10
# A leg while nothing acts is at least this share of the wait: at one of its ends the energy is higher.
_LEAST: Final = 0.25
# A leg where nothing tells how long to wait, of the run.
_UNKNOWN: Final = 0.02
# A leg of a probe lasts for the wait, this share of what it has flown, or of the run: what it computes too much costs
# some hundredths of a deformable run of the flight, and so does a leg more.
_OF_FLOWN, _OF_RUN = 0.4, 0.02
# The restart of a leg, written and read, costs as much as so many deformable cycles (some five, measured).
_RESTART: Final = 10
# A flight of fewer half swings is too short to be switched: what still swings touches the ground at another time than
# the body that is frozen does.  Two soft boxes that bounced low landed 33 and 55 ms late when rigid, after 2.4 and 2.8
# of them; of cars and boxes that flew for 3.2 of them and more the landing moved by 3.4 ms at most.
_SWINGS: Final = 3.0
# A window moves the landing behind it by up to 2 ms, the one after that by up to 37 ms (two computed boxes): one that
# saves less than this share of a deformable run is not worth that.
_WORTH: Final = 0.04


class Limits(NamedTuple):
    """What the legs keep to [time]: ``shortest`` is the least margin.

    ``interval`` is that of the history.  ``rigid_cycle`` is what a cycle of rigid parts costs, of a deformable one [-].
    """

    end: float
    interval: float
    shortest: float
    margin: float | None = None
    rigid_cycle: float = 0.5

    def margin_of(self, flight: float, *, idle: bool = False) -> float:
        """Margin before the contact at the end of a flight of this length [time]; ``idle``: nothing vibrates in it."""
        if self.margin is not None:
            return self.margin
        # the share held in eight windows of two structures; where nothing vibrates the rigid body flies as the
        # deformable one would, and the least margin is enough
        return (
            self.shortest
            if idle and self.shortest
            else max(self.shortest, SHARE * flight)
        )

    @property
    def same(self) -> float:
        """By less than this times differ that are the same."""
        return _STATES * self.interval


class Order(NamedTuple):
    """A leg to be computed, from the end of the leg before it to ``until`` [time].

    Flights that began before ``after`` are not switched any more [time].
    """

    kind: str
    number: int
    start: float
    until: float
    after: float = 0.0

    @property
    def rigid(self) -> bool:
        """Whether the parts are rigid in it."""
        return self.kind in RIGID_KINDS


class Seen(NamedTuple):
    """What the record shows up to the end of a leg.

    ``free``: since when no force acts [time]; ``wait``: how long that is asked for [time], None where it is not known,
    and ``why``; ``flies``: whether it has lasted for so long; ``tr``: the end of the leg with the higher energy [time];
    ``idle``: no energy was ever stored; ``short``: begin and end of flights in the leg that did not last for the wait;
    ``contact``: the first one of the rigid body [time]; ``swing``: the longest half of a swing so far, pushed or not
    [time].
    """

    free: float = 0.0
    wait: float | None = None
    why: str = ""
    flies: bool = False
    tr: float = 0.0
    idle: bool = False
    short: tuple[tuple[float, float], ...] = ()
    contact: float | None = None
    swing: float = 0.0


class Leg(NamedTuple):
    """A leg that is over; ``cycles`` and processor time ``cpu`` [s] are None where unknown."""

    order: Order
    seen: Seen
    cycles: int | None = None
    cpu: float | None = None

    @property
    def kind(self) -> str:
        """What it was ordered for."""
        return self.order.kind

    @property
    def length(self) -> float:
        """How long it was [time]."""
        return self.order.until - self.order.start


class Window(NamedTuple):
    """A flight that was switched, or left out with a ``reason``; ``free`` since when, ``contact`` when seen rigid.

    One that is left out is deformable from ``tr`` to ``td`` all the same.
    """

    free: float
    tr: float
    td: float
    contact: float | None
    wait: float
    reason: str | None = None


def next_order(legs: Sequence[Leg], limits: Limits) -> Order | None:
    """Say which leg comes next; None when the run is over.

    D2RPickError where the solver has no number for one more.
    """
    if not legs:  # as many states as show a fall of parts that are at rest
        return Order(LOAD, 1, 0.0, min((FEWEST + 2) * limits.interval, limits.end))
    last = legs[-1].order
    if last.rigid and legs[-1].seen.contact is not None:
        order: Order | None = _before_contact(legs, limits)
    elif last.until >= limits.end:
        order = None
    elif last.kind == PROBE:
        order = _following(
            last, PROBE, _probed(legs, _became_rigid(legs).start, limits)
        )
    elif last.kind == RIGID:
        order = _following(last, LOAD, _loaded(legs[-1], limits))._replace(
            after=last.until
        )
    else:
        order = _after_load(legs, limits)
    if order and order.number > _MOST_LEGS:
        raise D2RPickError(
            f"the run needs more than {_MOST_LEGS} legs, which the solver cannot number; raise `wait`"
        )
    return order


def _following(last: Order, kind: str, until: float) -> Order:
    return Order(kind, last.number + 1, last.until, until, last.after)


def _after_load(legs: Sequence[Leg], limits: Limits) -> Order:
    last, seen = legs[-1].order, legs[-1].seen
    switches = (
        seen.flies
        and seen.free >= last.after
        and limits.end - last.until > _WORTH * limits.end
    )
    if not switches or last.number > _MOST_LEGS - _KEPT_BACK:
        return _following(last, LOAD, _loaded(legs[-1], limits))
    if seen.idle or seen.tr > last.start:
        return _following(last, PROBE, _probed(legs, last.until, limits))
    return last._replace(
        kind=PROBE, until=_probed(legs, last.start, limits, now=last.start)
    )


def _loaded(leg: Leg, limits: Limits) -> float:
    """When a deformable leg after this one ends: when a flight that has begun, or may begin now, lasts for the wait."""
    now, seen, numbers = (
        leg.order.until,
        leg.seen,
        _MOST_LEGS - _KEPT_BACK - leg.order.number,
    )
    if numbers <= 0:
        return limits.end
    free = (
        seen.free
        if not leg.order.rigid and seen.free >= leg.order.after and not seen.flies
        else now
    )
    wait = seen.wait or _UNKNOWN * limits.end
    until = max(free + wait, now + _LEAST * wait, now + (limits.end - now) / numbers)
    return until if until < limits.end - limits.same else limits.end


def _probed(
    legs: Sequence[Leg], tr: float, limits: Limits, now: float | None = None
) -> float:
    """When the next leg of a probe that began at ``tr`` ends."""
    now = legs[-1].order.until if now is None else now
    until = now + max(
        _flown(legs).wait or 0.0,
        _OF_FLOWN * (now - tr),
        _OF_RUN * limits.end,
        FEWEST * limits.interval,
    )
    return until if until < limits.end - limits.same else limits.end


def _before_contact(legs: Sequence[Leg], limits: Limits) -> Order:
    """Go on from the last leg of a probe that ended before td, or deformable where the window does not pay."""
    window, first = window_of(legs, limits), _became_rigid(legs)
    if window.reason:
        number, now = first.number, first.start
        until = _loaded(Leg(Order(RIGID, number - 1, now, now), _flown(legs)), limits)
        return Order(LOAD, number, now, until, after=now + limits.same)
    before = [one for one in together(legs[-1].order, legs) if one.until <= window.td]
    last = before[-1] if before else None
    if last is None:
        return first._replace(kind=RIGID, until=window.td)
    if last.until == window.td:
        until = _loaded(Leg(last, _flown(legs)), limits)
        return _following(last, LOAD, until)._replace(after=last.until)
    return _following(last, RIGID, window.td)


def window_of(legs: Sequence[Leg], limits: Limits) -> Window:
    """Give the window before the contact that the last of these legs has shown, or the end of the run without one."""
    tr, before, contact = _became_rigid(legs).start, _flown(legs), legs[-1].seen.contact
    wait = before.wait or 0.0
    if contact is None:
        return Window(before.free, tr, legs[-1].order.until, None, wait)
    flight = contact - before.free
    td = contact - limits.margin_of(flight, idle=before.idle)
    ends = [
        one.until
        for one in together(legs[-1].order, legs)
        if 0 <= td - one.until <= limits.same
    ]
    td = max(ends, default=td)  # a leg that ended there need not go on by a state
    reason = _why_left_out(legs, td - tr, limits)
    if not before.idle and flight < _SWINGS * before.swing:
        reason = f"shorter than {_SWINGS:g} half swings of {before.swing:.3g}: its landing is not known"
    return Window(before.free, tr, td, contact, wait, reason)


def _why_left_out(legs: Sequence[Leg], rigid_time: float, limits: Limits) -> str | None:
    """Say why a window is not worth its probe and restarts, by the cycles so far: processor times differ each time."""
    if rigid_time <= 0:
        return "its margin begins before tr"
    frozen = _became_rigid(legs)
    probed = [
        leg for leg in legs if leg.order.rigid and leg.order.start >= frozen.start
    ]
    took = sum((leg.cycles or 0) * limits.rigid_cycle + _RESTART for leg in probed)
    saved = (rigid_time - took / _cycles(legs)) / limits.end
    return (
        None
        if saved >= _WORTH
        else f"saves {max(saved, 0.0):.1%} of the run, less than {_WORTH:.0%}"
    )


def _cycles(legs: Sequence[Leg]) -> float:
    """Deformable cycles by time, so far [1/time]."""
    loaded = [leg for leg in legs if not leg.order.rigid and leg.cycles]
    return (
        sum(leg.cycles or 0 for leg in loaded) / sum(leg.length for leg in loaded)
        if loaded
        else float("inf")
    )


def together(order: Order, legs: Sequence[Leg]) -> list[Order]:
    """Give the legs before a leg, and it, as far back as the parts were rigid as they are in it, or deformable."""
    latest, found = {leg.order.number: leg.order for leg in legs}, [order]
    while (before := latest.get(found[0].number - 1)) and before.rigid is order.rigid:
        found.insert(0, before)
    return found


def _became_rigid(legs: Sequence[Leg]) -> Order:
    """Order of the leg in which the parts became rigid, of those that the last leg goes on with."""
    return together(legs[-1].order, legs)[0]


def _flown(legs: Sequence[Leg]) -> Seen:
    """What was seen of the flight when it was decided to switch."""
    return next(leg.seen for leg in reversed(legs) if leg.order.kind == LOAD)


def windows(legs: Sequence[Leg], limits: Limits) -> list[Window]:
    """Give all flights so far that were switched or left out, in their order."""
    found: dict[float, Window] = {}
    for count, leg in enumerate(legs, start=1):
        for start, end in leg.seen.short:
            told = "over before the wait"
            found[start] = Window(start, start, end, end, leg.seen.wait or 0.0, told)
        if leg.order.rigid and (
            leg.seen.contact is not None or leg.order.until >= limits.end
        ):
            window = window_of(legs[:count], limits)
            found[window.free] = window
    return [found[start] for start in sorted(found)]
