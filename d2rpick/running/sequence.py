"""Choose the next engine run (leg) of a run that chooses its own switching times, from the results so far.

The end of an engine run is fixed before it starts, so the same command computes the same engine runs on any machine. An
engine run that replaces a discarded one gets its number. If a probe has replaced a deformable engine run and the window
of the probe is not used, the deformable engine run is computed again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from d2rpick.base.errors import D2RPickError
from d2rpick.deck.engine_files import MOST_LEGS
from d2rpick.flight.margin import LEAST_MARGIN
from d2rpick.flight.window import FEWEST

if TYPE_CHECKING:
    from collections.abc import Sequence

# Each engine run (leg) of a first run is of one of three kinds.
# LOAD: the parts are deformable.
# PROBE: the parts are rigid, and the engine run continues until it shows the contact that ends the flight.
# RIGID: the parts are rigid, and the engine run ends at the td that a probe has determined.
LOAD, PROBE, RIGID = "load", "probe", "rigid"
# Times that differ by at most this are treated as equal [output intervals].
# A history may end one output interval early.
_STATES: Final = 1.5
# If only this many engine runs are left, no further flight is switched, so that the run can reach its end.
_KEPT_BACK: Final = 10
# Shortest deformable engine run in a flight, relative to the force-free time after which a flight is detected [-].
_LEAST: Final = 0.25
# Length of a deformable engine run while the vibration period is unknown, as a fraction of the run [-].
_UNKNOWN: Final = 0.02
# A longer probe computes more after the contact, but shorter probes need more restarts.
# _OF_FLOWN: smallest length of a probe, as a fraction of its rigid time so far [-].
# _OF_RUN: smallest length of a probe, as a fraction of the run [-].
_OF_FLOWN, _OF_RUN = 0.4, 0.02
# Assumed cost of writing and reading a restart file [deformable cycles]; about 5 cycles were measured.
_RESTART: Final = 10
# Shortest flight that is switched, in half periods of the slowest vibration [-].
# In shorter flights, the frozen vibration shifts the landing too much.
# After flights of 2.4 and 2.8 half periods, two soft boxes landed 33 ms and 55 ms late.
# After flights of at least 3.2 half periods, cars and boxes landed at most 3.4 ms too early or too late.
_SWINGS: Final = 3.0
# Smallest saving for which a window is worthwhile, relative to the cost of a deformable run [-].
# Smaller savings do not justify the shift of later landings, which reached 37 ms for two computed boxes.
_WORTH: Final = 0.04


class Limits(NamedTuple):
    """Limits that apply to all engine runs [time].

    ``interval`` is the output interval of the history, ``shortest`` the smallest margin, and ``margin`` the margin that
    the user gave. ``rigid_cycle`` is the cost of a cycle with rigid parts divided by that of a deformable cycle [-].
    """

    end: float
    interval: float
    shortest: float
    margin: float | None = None
    rigid_cycle: float = 0.5

    def margin_of(self, flight: float, *, idle: bool = False) -> float:
        """Return the margin before the contact that ends a flight of the given length [time].

        If nothing vibrates (``idle``), a rigid body flies like the deformable one, and the smallest margin suffices.
        Otherwise the margin is at least a fraction of the flight that sufficed in 8 windows of two structures.
        """
        if self.margin is not None:
            return self.margin
        if idle and self.shortest:
            return self.shortest
        return max(self.shortest, LEAST_MARGIN * flight)

    @property
    def same(self) -> float:
        """Times that differ by less than this are treated as equal [time]."""
        return _STATES * self.interval

    def until_end(self, until: float) -> float:
        """Return ``until``, or the end of the run if it is close to ``until`` [time]."""
        return until if until < self.end - self.same else self.end


class Order(NamedTuple):
    """An engine run to be computed, from the end of the previous engine run to ``until`` [time].

    Flights that began before ``switch_after`` are no longer switched [time].
    """

    kind: str
    number: int
    start: float
    until: float
    switch_after: float = 0.0

    @property
    def rigid(self) -> bool:
        """Return True if the parts are rigid in this engine run."""
        return self.kind != LOAD

    def undone(self) -> Order:
        """Return the order to repeat this engine run, from the end of the previous one."""
        return self._replace(number=self.number - 1, until=self.start)

    def following(self, kind: str, until: float) -> Order:
        """Return the request for an engine run that begins where this one ends."""
        return Order(kind, self.number + 1, self.until, until, self.switch_after)


class LegFindings(NamedTuple):
    """The findings from the record up to the end of an engine run.

    Attributes
    ----------
    free : float
        Start of the current force-free time [time].
    wait : float or None
        Force-free time after which a flight is detected [time]; None as long as it is unknown.
    why : str
        Reason for the length of the waiting time.
    flies : bool
        True if no force has acted for as long as the waiting time.
    tr : float
        Start or end of the engine run, whichever has the higher internal energy [time].
    idle : bool
        True if the parts have never stored internal energy.
    short : tuple of (float, float)
        Start and end of each force-free time in the engine run that was shorter than the waiting time [time].
    contact : float or None
        First contact of the rigid body [time].
    swing : float
        Half of the longest oscillation period so far, even if a force lengthened it [time].
    steady_from : float
        In a flight shorter than this, an oscillating part displaces the body by more than 1 % of its path [time].
    swing_warning : str
        Warning about this part for a shorter flight, or "".
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
    steady_from: float = 0.0
    swing_warning: str = ""


class Leg(NamedTuple):
    """A completed engine run, with its number of ``cycles`` and CPU time ``cpu`` [s]; both None without a listing.

    Both are zero if a probe had replaced the engine run and its files were then restored instead of being computed
    again.
    """

    order: Order
    findings: LegFindings
    cycles: int | None = None
    cpu: float | None = None

    @property
    def length(self) -> float:
        """Duration of the engine run [time]."""
        return self.order.until - self.order.start


class Window(NamedTuple):
    """A flight that was switched at ``tr`` and ``td``, or left deformable for the given ``reason``.

    ``free`` is the start of the flight, and ``contact`` the first contact of the rigid body [time]; None if the run
    ended before. ``warning`` names a part that moves so much that the body may be misplaced at td; otherwise it is "".
    """

    free: float
    tr: float
    td: float
    contact: float | None
    wait: float
    reason: str | None = None
    warning: str = ""


def choose_next_leg(legs: Sequence[Leg], limits: Limits) -> Order | None:
    """Choose the next engine run; None once the run is complete.

    Raises
    ------
    D2RPickError
        If the solver has no number for a further engine run.
    """
    if not legs:  # The first engine run can show whether parts fall from rest.
        return Order(LOAD, 1, 0.0, min((FEWEST + 2) * limits.interval, limits.end))
    last = legs[-1].order
    findings = legs[-1].findings
    if findings.contact is not None:
        order = _return_before_contact(legs, limits)
    elif last.until >= limits.end:
        return None
    elif last.kind == PROBE or _starts_window(last, findings, limits):
        order = _order_probe(legs, limits)
    else:
        order = _order_load(last, findings, limits)
    if order.number > MOST_LEGS:
        raise D2RPickError(
            f"the run needs more than {MOST_LEGS} engine runs, which the solver cannot number; increase `wait`"
        )
    return order


def _starts_window(last: Order, findings: LegFindings, limits: Limits) -> bool:
    """Return True if a deformable engine run has shown a flight that may be switched and can still pay off."""
    return (
        findings.flies
        and findings.free >= last.switch_after
        and limits.end - last.until > _WORTH * limits.end
        and last.number <= MOST_LEGS - _KEPT_BACK
    )


def _order_load(last: Order, findings: LegFindings, limits: Limits) -> Order:
    """Schedule a deformable engine run that is long enough to detect a flight that starts now or has already started.

    A flight in which a window has ended is not switched again.
    """
    now = last.until
    end = limits.end
    legs_left = MOST_LEGS - _KEPT_BACK - last.number
    if legs_left <= 0:
        return last.following(LOAD, end)
    wait = findings.wait or _UNKNOWN * end
    flight_start = now
    if last.rigid:
        last = last._replace(switch_after=now)
    elif findings.free >= last.switch_after and not findings.flies:
        flight_start = findings.free
    until = max(flight_start + wait, now + _LEAST * wait, now + (end - now) / legs_left)
    return last.following(LOAD, limits.until_end(until))


def _order_probe(legs: Sequence[Leg], limits: Limits) -> Order:
    """Schedule the next part of a probe that began earlier or begins after the last engine run."""
    last = legs[-1].order
    findings = get_flight_findings(legs)
    flown = 0.0
    if last.rigid:
        flown = last.until - collect_joined_legs(last, legs)[0].start
    elif not findings.idle and findings.tr <= last.start:
        # The energy was higher at the start of the last engine run than at its end, so the probe starts there.
        last = last.undone()
    length = max(
        findings.wait or 0.0,
        _OF_FLOWN * flown,
        _OF_RUN * limits.end,
        FEWEST * limits.interval,
    )
    return last.following(PROBE, limits.until_end(last.until + length))


def _return_before_contact(legs: Sequence[Leg], limits: Limits) -> Order:
    """Schedule the engine run that ends the window at its td, or a deformable one if the window does not pay off."""
    window = find_next_window(legs, limits)
    orders = collect_joined_legs(legs[-1].order, legs)
    findings = get_flight_findings(legs)
    if window.reason:
        switch_after = window.tr + limits.same
        replaced = find_replaced_leg(orders[0], legs)
        if replaced:
            return replaced.order._replace(switch_after=switch_after)
        load = _order_load(orders[0].undone(), findings, limits)
        return load._replace(switch_after=switch_after)
    orders_before = [order for order in orders if order.until <= window.td]
    if not orders_before:
        return orders[0]._replace(kind=RIGID, until=window.td)
    if orders_before[-1].until == window.td:
        return _order_load(orders_before[-1], findings, limits)
    return orders_before[-1].following(RIGID, window.td)


def find_next_window(legs: Sequence[Leg], limits: Limits) -> Window:
    """Return the window before the contact that the last engine run showed or, without a contact, up to its end."""
    rigid_orders = collect_joined_legs(legs[-1].order, legs)
    findings = get_flight_findings(legs)
    contact = legs[-1].findings.contact
    window = Window(
        findings.free,
        rigid_orders[0].start,
        rigid_orders[-1].until,
        contact,
        findings.wait or 0.0,
    )
    if contact is None:
        return window
    flight = contact - findings.free
    td = contact - limits.margin_of(flight, idle=findings.idle)
    for order in rigid_orders:
        if 0 <= td - order.until <= limits.same:
            td = order.until  # An engine run must contain at least two states.
    reason = _explain_too_little_saved(legs, window.tr, td, limits)
    if not findings.idle and flight < _SWINGS * findings.swing:
        reason = f"shorter than {_SWINGS:g} half cycles of {findings.swing:.3g}: its landing is unknown"
    warning = ""
    if reason is None and td - findings.free < findings.steady_from:
        warning = findings.swing_warning
    return window._replace(td=td, reason=reason, warning=warning)


def _explain_too_little_saved(
    legs: Sequence[Leg], tr: float, td: float, limits: Limits
) -> str | None:
    """Explain why a window saves less than its probe and restarts cost; None if it saves more.

    The comparison uses cycles, because CPU times vary and the same command must compute the same run.
    """
    if td <= tr:
        return "its margin begins before tr"
    # An engine run that was taken back counts once, even if it had to be computed again.
    deformable_legs = {
        (leg.order.start, leg.order.until): leg
        for leg in legs
        if not leg.order.rigid and leg.cycles
    }
    length = sum(leg.length for leg in deformable_legs.values())
    cycles = sum(leg.cycles or 0 for leg in deformable_legs.values())
    cost = 0.0  # The cost is measured in deformable cycles.
    for leg in legs:
        if leg.order.rigid and leg.order.start >= tr:
            cost += (leg.cycles or 0) * limits.rigid_cycle + _RESTART
    saved = (td - tr - cost * length / max(cycles, 1)) / limits.end
    if saved >= _WORTH:
        return None
    return f"saves {max(saved, 0.0):.1%} of the run, less than {_WORTH:.0%}"


def is_same_run(first: Order, second: Order) -> bool:
    """Return True if two orders describe the same engine run, whichever of its flights may be switched."""
    return first._replace(switch_after=second.switch_after) == second


def find_replaced_leg(probe: Order, legs: Sequence[Leg]) -> Leg | None:
    """Return the deformable engine run that was replaced when the probe began; None if the probe began at its end."""
    last_load = next(leg for leg in reversed(legs) if leg.order.kind == LOAD)
    return last_load if last_load.order.number == probe.number else None


def collect_joined_legs(order: Order, legs: Sequence[Leg]) -> list[Order]:
    """Return the engine runs since parts last became rigid or deformable, including the given one."""
    latest = {leg.order.number: leg.order for leg in legs}
    joined = [order]
    previous = latest.get(order.number - 1)
    while previous and previous.rigid is order.rigid:
        joined.insert(0, previous)
        previous = latest.get(previous.number - 1)
    return joined


def get_flight_findings(legs: Sequence[Leg]) -> LegFindings:
    """Return the findings about the switched flight, as they were at the end of the last deformable engine run."""
    return next(leg.findings for leg in reversed(legs) if leg.order.kind == LOAD)


def windows(legs: Sequence[Leg], limits: Limits) -> list[Window]:
    """Return all flights so far in order of start time, whether the parts were switched or stayed deformable."""
    by_start: dict[float, Window] = {}
    for count, leg in enumerate(legs, start=1):
        for start, end in leg.findings.short:
            wait = leg.findings.wait or 0.0
            reason = "over before the force-free time"
            by_start[start] = Window(start, start, end, end, wait, reason)
        ends_flight = leg.findings.contact is not None or leg.order.until >= limits.end
        if leg.order.rigid and ends_flight:
            window = find_next_window(legs[:count], limits)
            by_start[window.free] = window
    return [by_start[start] for start in sorted(by_start)]
