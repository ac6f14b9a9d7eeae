"""Determine the waiting time (the force-free time after which a flight is detected) from oscillations inside the body.

The waiting time is half of the longest internal period. During a load, contacts open and close as parts oscillate on
their springs, and the longest gap between them is shorter than half of this period (in computed runs, 13 of 17 ms for a
falling box, and 14 of 22 ms for a car). With a shorter waiting time, such a gap would be treated as a flight, and a
body that is frozen in it could not rebound correctly.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.deck.pieces import find_inner_period
from d2rpick.running.record import GrowingColumn, RunningMaximum

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History, Momenta, Samples

    # Slices of the latest states, each with the columns of the parts that move in the slice.
    MovingParts = Sequence[tuple[slice, Sequence[int]]]

# Velocity changes of at least this fraction of the velocity range so far are treated as an oscillation [-].
_SWING: Final = 1 / 3
# _INNER: fraction of the velocity change ignored at each end when a half period is measured [-].
# _INNER_TIME: fraction of the half period that the middle part of that change takes in a harmonic motion [-].
_INNER, _INNER_TIME = 0.1, float(np.arccos(-0.8) - np.arccos(0.8)) / np.pi
# A mean force up to this fraction of the largest one so far is attributed to body rotation [-].
_ROTATION: Final = 0.05
# Smallest number of states in an oscillation; a change over fewer states is treated as a jump.
_FEWEST_STATES: Final = 4
# Smallest relative velocity of an oscillating part, as a fraction of the velocity of all parts [-].
_AT_REST: Final = 1e-3
# An unfinished oscillation longer than this multiple of the longest half period may last arbitrarily long [-].
_MUCH_LONGER: Final = 2.0
# _LONGEST_FREE: a free oscillation above this many half periods of the deck is attributed to body rotation [-].
# _LONGEST_PUSHED: upper limit for the half period of an oscillation under load, in half periods of the deck [-].
_LONGEST_FREE, _LONGEST_PUSHED = 1.5, 2.5
# Smallest waiting time that the user may give, relative to half the longest period [-], which is uncertain by 10 %.
_EXACT: Final = 0.9
# Smallest mass fraction of the parts considered [-]; lighter parts hardly move the other parts.
_HEAVY: Final = 0.05


class Wait(NamedTuple):
    """Force-free time after which a flight is detected [time], with its source and a reason.

    ``source`` is "given", "record", "deck" or "at-rest". ``least`` is a lower bound of half of the deck's period
    [time]; it is None if the waiting time is this half period itself.
    """

    time: float
    source: str
    reason: str
    least: float | None = None


class _HalfPeriod(NamedTuple):
    """Half a period of an internal ``motion``, from ``begin`` to ``end``, detected at the time ``seen_at`` [time].

    ``half`` is half of its period [time], and ``strength`` its mean rate of change [unit of the values/time].
    """

    motion: _Motion
    begin: float
    end: float
    seen_at: float
    half: float = 0.0
    strength: float = 0.0


class _Motion:
    """One oscillating quantity, such as a velocity component of a part, with its states and half periods so far.

    ``halves_per_swing`` is the number of changes of the values from one extremum to the next in half a period: 1 for a
    velocity, 2 for an energy.
    """

    def __init__(self, name: str, halves_per_swing: float = 1.0) -> None:
        self.name = name
        self._factor = halves_per_swing
        # True once an unforced oscillation has been detected.
        self.has_free_swing = False
        # The first half period has no duration, because it ends when the motion is first detected.
        self._swings: list[_HalfPeriod] = []
        # The columns contain the time, the value, and the smallest change that is treated as an oscillation.
        self._columns = GrowingColumn()
        self._highest = RunningMaximum()
        self._lowest = RunningMaximum()
        # State at the last extremum.
        self._turn = 0
        # Most extreme state since then.
        self._extreme = 0
        # Direction of the motion since then: 1 rising, -1 falling.
        self._sign = 1

    def add(
        self, time: Samples, values: Samples, least_swing: Samples
    ) -> Iterator[_HalfPeriod]:
        """Append states (k,), and return the half periods completed by them that exceed ``least_swing`` (k,)."""
        ranges = self._highest.add(values) + self._lowest.add(-values)
        limits = np.maximum(_SWING * ranges, least_swing)
        rows = self._columns.add(np.column_stack([time, values, limits]))
        first = len(rows) - len(time)
        if not self._swings:
            moved = np.flatnonzero(ranges > limits)
            if not moved.size:
                return
            first += int(moved[0])
            self._begin(rows[: first + 1])
        for state, (now, value, limit) in enumerate(rows[first:].tolist(), start=first):
            beyond_extreme = self._sign * (value - rows[self._extreme, 1])
            if beyond_extreme >= 0:
                self._extreme = state
            elif -beyond_extreme > limit:
                if self._extreme - self._turn >= _FEWEST_STATES:
                    yield self._measure(rows[self._turn : self._extreme + 1], now)
                self._turn = self._extreme
                self._extreme = state
                self._sign = -self._sign

    def _begin(self, rows: Samples) -> None:
        """Begin to follow a motion that is first detected at the last of its states."""
        values = rows[:, 1]
        last = len(rows) - 1
        distances = np.abs(values - values[last])
        # The last extremum is the latest of the states whose values differ most from the last one.
        states_since = int(np.argmax(distances[::-1]))
        self._extreme = last
        self._turn = last - states_since
        self._sign = int(np.sign(values[last] - values[self._turn]))
        now = float(rows[last, 0])
        self._swings.append(_HalfPeriod(self, now, now, now))

    def _measure(self, rows: Samples, now: float) -> _HalfPeriod:
        """Measure the half period from the last extremum to the current extreme value, detected at ``now``."""
        time = rows[:, 0]
        values = rows[:, 1]
        changes = np.abs(values - values[0])
        whole_change = changes[-1]
        # The inner part of the change is not affected by the states near the extrema, where the values hardly change.
        is_low = changes <= _INNER * whole_change
        low = int(np.flatnonzero(is_low)[-1])
        is_high = changes[low:] >= (1 - _INNER) * whole_change
        high = low + int(np.argmax(is_high))
        inner_time = float(time[high] - time[low])
        half = self._factor * inner_time / _INNER_TIME
        strength = float(whole_change) / half
        begin = float(time[0])
        end = float(time[-1])
        half_period = _HalfPeriod(self, begin, end, now, half, strength)
        self._swings.append(half_period)
        return half_period

    def outlasts_earlier_swings(self, now: float, least_strength: float) -> bool:
        """Return True if the oscillation is much longer than all earlier ones and is neither rest nor rotation.

        The mean rate of change due to a rotation is below ``least_strength``.
        """
        swings = [swing for swing in self._swings if swing.seen_at <= now]
        if not swings:
            return False
        time, values, limits = self._columns.rows.T
        if now > time[-1]:
            return False
        begin, state = np.searchsorted(time, [swings[-1].end, now]).tolist()
        earlier_values = values[[begin, (begin + state) // 2]]
        change, late_change = np.abs(values[state] - earlier_values).tolist()
        duration = self._factor * (now - swings[-1].end)
        longest_half = max(swing.half for swing in swings)
        return (
            duration > _MUCH_LONGER * longest_half
            and change > max(limits[state], least_strength * duration)
            and late_change > limits[state] / 2
        )


class _Longest(NamedTuple):
    """The longest half period of the internal motion so far, and the waiting time ``wait`` that it requires, if any.

    ``since`` is the time of detection [time], and ``strength`` the largest mean rate of change so far. ``swing`` is
    half of the longest oscillation period, even if a force acted during that oscillation [time].
    """

    since: float
    wait: Wait | None = None
    strength: float = 0.0
    swing: float = 0.0


class InnerMotion:
    """The internal motion up to each state of a record, and the longest half period that it has shown.

    ``of_deck`` is the waiting time that follows from the deck, ``before`` that of earlier flights [time].
    """

    def __init__(self, of_deck: Wait | None = None, before: float = 0.0) -> None:
        time_of_deck = of_deck.time if of_deck else 0.0
        self._half_of_springs = time_of_deck or np.inf
        self._least = of_deck
        self._least_time = max(before, time_of_deck)
        if before > time_of_deck:
            self._least = Wait(before, "record", "as in the flight before")
        self._energy = _Motion("the internal energy", halves_per_swing=2.0)
        # Motions of parts, keyed by the number of earlier times without motion, the part index and the axis index.
        self._part_motions: dict[tuple[int, int, int], _Motion] = {}
        self._rest_count = 0
        self._largest_speed = RunningMaximum()
        self._largest_energy = RunningMaximum()
        # Time at which the part motions begin to be used instead of the energy [time].
        self._parts_since = np.inf
        # Longest half period of any part so far; a new entry is added each time it increases.
        self._longest_of_parts = [_Longest(-np.inf)]
        self._longest_of_energy = [_Longest(-np.inf)]

    def take(
        self,
        states: History,
        moving_parts: MovingParts,
        free_since: Callable[[float], float],
    ) -> None:
        """Append states; ``free_since`` returns the start of the force-free interval up to a given time [time]."""
        momenta = states.find_momenta(of_parts=True)
        if momenta is not None and momenta.masses is not None:
            swings = self._follow_parts(momenta, momenta.masses, moving_parts)
            self._learn(swings, self._longest_of_parts, free_since)
        least_swing = _AT_REST * self._largest_energy.add(np.abs(states.energy))
        swings = self._energy.add(states.time, states.energy, least_swing)
        self._learn(swings, self._longest_of_energy, free_since)

    def _follow_parts(
        self, momenta: Momenta, masses: Samples, moving_parts: MovingParts
    ) -> Iterator[_HalfPeriod]:
        """Follow the momenta of heavy parts relative to the centre of mass of all moving parts."""
        assert momenta.parts is not None
        for states, moving in moving_parts:
            members = [number for number in moving if masses[number] > 0]
            shares = masses[members] / masses[members].sum()
            is_heavy = (shares > _HEAVY) & (shares < 1 - _HEAVY)
            if not is_heavy.any():
                self._rest_count += 1
                continue
            time = momenta.time[states]
            self._parts_since = min(self._parts_since, float(time[0]))
            momentum = momenta.values[states][:, members]
            velocity = momentum.sum(axis=1) / masses[members].sum()
            speeds = self._largest_speed.add(np.abs(velocity).max(axis=1))
            for number in np.array(members)[is_heavy].tolist():
                relative = momenta.values[states, number] - masses[number] * velocity
                least_swing = masses[number] * _AT_REST * speeds
                for axis, values in enumerate(relative.T):
                    key = self._rest_count, number, axis
                    name = momenta.parts[number].name
                    motion = self._part_motions.setdefault(key, _Motion(name))
                    yield from motion.add(time, values, least_swing)

    def _learn(
        self,
        swings: Iterable[_HalfPeriod],
        so_far: list[_Longest],
        free_since: Callable[[float], float],
    ) -> None:
        """Lengthen the waiting time if a half period requires it that is neither a rotation nor lengthened by a force.

        A half period during a force is used only if there is no deck and this motion has not yet oscillated freely.
        """
        for swing in sorted(swings, key=lambda swing: swing.seen_at):
            motion = swing.motion
            is_free = free_since(swing.end) <= swing.begin
            motion.has_free_swing |= is_free
            strongest = max(so_far[-1].strength, swing.strength)
            longest = so_far[-1]._replace(since=swing.seen_at, strength=strongest)
            so_far.append(longest)
            longest_free_half = _LONGEST_FREE * self._half_of_springs
            is_too_long = is_free and swing.half > longest_free_half
            is_rotation = swing.strength < _ROTATION * strongest
            if is_rotation or is_too_long:
                continue
            half = min(swing.half, _LONGEST_PUSHED * self._half_of_springs)
            longest = longest._replace(swing=max(longest.swing, half))
            counts = is_free or not (motion.has_free_swing or self._least)
            if counts and (longest.wait is None or swing.half > longest.wait.time):
                reason = f"half cycle of {motion.name}: {swing.half:.3g}, completed at {swing.seen_at:.6g}"
                longest = longest._replace(wait=Wait(swing.half, "record", reason))
            so_far[-1] = longest

    def longest(self, now: float) -> Wait | None:
        """Return the longest half period at the time ``now``, from the deck or from the record up to ``now``."""
        wait = self._get_longest(now).wait
        if wait is None or wait.time <= self._least_time:
            return self._least
        return wait

    def longest_swing(self, now: float) -> float:
        """Return the longest half period measured up to ``now``, even if a force lengthened this half period [time]."""
        return max(self._get_longest(now).swing, self._least_time)

    def _get_longest(self, now: float) -> _Longest:
        """Return the longest half period up to a time, from part motions or, before any part moves, from the energy."""
        if self._parts_since <= now:
            so_far = self._longest_of_parts
        else:
            so_far = self._longest_of_energy
        count = bisect_right(so_far, now, key=lambda longest: longest.since)
        return so_far[count - 1]

    def is_unfinished(self, now: float) -> bool:
        """Return True if an unfinished oscillation is much longer than all earlier ones and there is no deck."""
        if self._least is not None:
            return False
        least_strength = _ROTATION * self._get_longest(now).strength
        motions = [self._energy]
        if self._parts_since <= now:
            motions = [*self._part_motions.values()]
        return any(
            motion.outlasts_earlier_swings(now, least_strength) for motion in motions
        )


def wait_of_deck(inventory: Inventory) -> Wait | None:
    """Return half of the longest period of the springs in a deck; None if the deck does not determine it."""
    period = find_inner_period(inventory)
    if period is None:
        return None
    reason = f"half of the period {period.time:.3g} of {period.reason}"
    return Wait(period.time / 2, "deck", reason, period.least / 2)


def check_wait(given: float, longest: Wait | None, name: str) -> None:
    """Raise RangeError if a given waiting time is shorter than half of a known period."""
    if longest is None:
        return
    shortest = longest.time if longest.least is None else longest.least
    if given < _EXACT * shortest:
        raise RangeError(
            f"{name}: `wait` {given:g} is below {shortest:.3g}, half of a known period: {longest.reason}; a gap in the "
            "load would be treated as flight, so give a longer one"
        )
