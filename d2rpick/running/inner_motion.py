"""Determine the waiting time (the force-free time that shows a flight) from the internal oscillations of the body.

The wait is half of the longest inner period.  Inside a load, contacts open and close as parts swing on their springs,
and the longest gap between them is shorter than that (measured: 13 of 17 ms in a falling box, 14 of 22 ms in a car).  A
shorter wait treats such a gap as a flight, and a body frozen in it cannot rebound as it would have done.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.deck.pieces import find_inner_period
from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import find_window
from d2rpick.running.record import GrowingColumn, RunningMaximum

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History, Momenta, Samples

# Smallest velocity change that is an oscillation, as a fraction of the velocity range so far [-].
_SWING: Final = 1 / 3
# _INNER: fraction of the change in a half period that is omitted at each end to measure the half period [-].
# _INNER_TIME: fraction of half its period that a harmonic motion takes for the middle part of the change [-].
_INNER, _INNER_TIME = 0.1, float(np.arccos(-0.8) - np.arccos(0.8)) / np.pi
# Largest mean force of an oscillation treated as body rotation, as a fraction of the largest mean force so far [-].
_ROTATION: Final = 0.05
# Smallest number of states in an oscillation; a change within fewer states is treated as a jump.
_FEWEST_STATES: Final = 4
# Smallest relative velocity of a part that oscillates, as a fraction of the velocity of all parts [-].
_AT_REST: Final = 1e-3
# Ratio to the longest earlier half period above which the end of an oscillation is unknown [-].
_MUCH_LONGER: Final = 2.0
# _LONGEST_FREE: largest duration of a free oscillation that is no body rotation, in half periods of the deck [-].
# _LONGEST_PUSHED: largest duration of an oscillation under load that is no body rotation, in half periods [-].
_LONGEST_FREE, _LONGEST_PUSHED = 1.5, 2.5
# Smallest waiting time that the user may give, as a fraction of half the longest period [-], uncertain by 10 %.
_EXACT: Final = 0.9
# Smallest mass fraction of parts that are considered [-], because lighter parts hardly move the other parts.
_HEAVY: Final = 0.05
# Largest internal energy that is only round-off and shows no vibration, relative to the largest energy [-].
_ROUND_OFF: Final = 1e-6


class Wait(NamedTuple):
    """Force-free time that shows a flight [time], with its source and reason.

    ``source``: "given", "record", "deck" or "at-rest".  ``least`` is a lower bound of half of a period of the deck
    [time]; None if that is the wait itself.
    """

    time: float
    source: str
    reason: str
    least: float | None = None


class _HalfPeriod(NamedTuple):
    """Half a period of an internal motion, from ``begin`` to ``end``, detected at ``seen_at`` [time].

    ``half`` is half of its period [time], ``strength`` its mean change by time.
    """

    begin: float
    end: float
    seen_at: float
    half: float = 0.0
    strength: float = 0.0


class _Motion:
    """One oscillating quantity, such as a velocity component of a part: its states and half periods so far.

    Half a period takes ``halves_per_swing`` swings of its values: 1 for a velocity, 2 for an energy.
    """

    def __init__(self, name: str, halves_per_swing: float = 1.0) -> None:
        self.name, self._factor = name, halves_per_swing
        # True once an unforced oscillation has been detected.
        self.has_free_swing = False
        # The first half period has no duration; it ends when the motion is first detected.
        self._swings: list[_HalfPeriod] = []
        # The columns contain time, value, and the smallest change that is an oscillation.
        self._columns = GrowingColumn()
        self._highest, self._lowest = RunningMaximum(), RunningMaximum()
        # State at the last extremum, state at the extreme value since then, and direction (1 rising, -1 falling).
        self._turn, self._extreme, self._sign = 0, 0, 1

    def covers(self, now: float) -> bool:
        """Return True if a time is between the first and the last state."""
        time = self._columns.rows[:, 0]
        return bool(time[0] <= now <= time[-1])

    def add(
        self, time: Samples, values: Samples, least_swing: Samples
    ) -> Iterator[_HalfPeriod]:
        """Append states (k,), and return the half periods that they complete, if larger than ``least_swing`` (k,)."""
        ranges = self._highest.add(values) + self._lowest.add(-values)
        limits = np.maximum(_SWING * ranges, least_swing)
        first = self._columns.size
        self._columns.add(np.column_stack([time, values, limits]))
        rows = self._columns.rows
        if not self._swings:
            moved = np.flatnonzero(ranges > limits)
            if not moved.size:
                return
            first += int(moved[0])
            self._begin(first)
        for state, (_, value, limit) in enumerate(rows[first:].tolist(), start=first):
            beyond_extreme = self._sign * (value - rows[self._extreme, 1])
            if beyond_extreme >= 0:
                self._extreme = state
            elif -beyond_extreme > limit:
                if self._extreme - self._turn >= _FEWEST_STATES:
                    yield self._measure(state)
                self._turn, self._extreme = self._extreme, state
                self._sign = -self._sign

    def _begin(self, state: int) -> None:
        """Begin to follow the motion, which is first detected at a state."""
        time, values, _ = self._columns.rows[: state + 1].T
        distance = np.abs(values - values[-1])
        self._turn = int(np.flatnonzero(distance == distance.max())[-1])
        self._extreme = state
        self._sign = 1 if values[-1] > values[self._turn] else -1
        now = float(time[-1])
        self._swings.append(_HalfPeriod(now, now, now))

    def _measure(self, state: int) -> _HalfPeriod:
        """Measure the half period from the last extremum to the extreme value; it is detected at a later state."""
        time, values, _ = self._columns.rows[self._turn : state + 1].T
        end = self._extreme - self._turn
        distance = np.abs(values[: end + 1] - values[0])
        low = int(np.flatnonzero(distance <= _INNER * distance[-1])[-1])
        high = low + int(np.argmax(distance[low:] >= (1 - _INNER) * distance[-1]))
        half = self._factor * float(time[high] - time[low]) / _INNER_TIME
        begin, end_time, now = time[[0, end, -1]].tolist()
        strength = float(distance[-1]) / half
        self._swings.append(_HalfPeriod(begin, end_time, now, half, strength))
        return self._swings[-1]

    def outlasts_earlier_swings(self, now: float, least_strength: float) -> bool:
        """Return True if the current oscillation is much longer than all earlier ones and is neither rest nor rotation.

        The mean change by time of a rotation is below ``least_strength``.
        """
        swings = [swing for swing in self._swings if swing.seen_at <= now]
        if not swings:
            return False
        time, values, limits = self._columns.rows.T
        begin, state = np.searchsorted(time, [swings[-1].end, now]).tolist()
        earlier_values = values[[begin, (begin + state) // 2]]
        change, late_change = np.abs(values[state] - earlier_values).tolist()
        duration = self._factor * (now - swings[-1].end)
        longest_half = max(swing.half for swing in swings)
        is_rest = change <= limits[state] or late_change <= limits[state] / 2
        is_rotation = change < least_strength * duration
        return (
            not is_rest and not is_rotation and duration > _MUCH_LONGER * longest_half
        )


class EvidenceOfForces(Protocol):
    """The part of the evidence of a growing record that is needed to follow internal motion."""

    # Slices of the latest states, each with the columns of the parts that move in it; empty if there are no momenta.
    moving: list[tuple[slice, tuple[int, ...]]]

    @property
    def history(self) -> History:
        """All states read so far."""

    def free_since(self, time: float) -> float:
        """Return when the force-free time that lasts up to a time began [time]."""


class _Longest(NamedTuple):
    """The longest half period of the internal motion so far [time], and the part or energy that showed it.

    ``since`` is the time of detection, ``over`` the end of the half period. ``strength`` is the largest mean rate of
    change so far. ``swing`` is half of the longest swing, even if a force pushed the swing [time].
    """

    since: float
    half: float = 0.0
    strength: float = 0.0
    name: str = ""
    over: float = 0.0
    swing: float = 0.0


class InnerMotion:
    """The waiting time at each state of a record, from the internal motion up to that state.

    ``evidence`` shows which parts move, and since when no force has acted.
    ``given`` is the user's waiting time, ``of_deck`` the deck's, ``before`` that of earlier flights [time].
    """

    def __init__(
        self,
        evidence: EvidenceOfForces,
        given: float | None = None,
        of_deck: Wait | None = None,
        before: float = 0.0,
    ) -> None:
        self._evidence = evidence
        self._given, self._least = given, of_deck
        self._half_of_springs = of_deck.time if of_deck else np.inf
        if before > (of_deck.time if of_deck else 0.0):
            self._least = Wait(before, "record", "as in the flight before")
        self._energy = _Motion("the internal energy", halves_per_swing=2.0)
        self._part_motions: list[_Motion] = []
        # Motions that still continue, keyed by the indices of part and axis.
        self._going_on: dict[tuple[int, int], _Motion] = {}
        self._heavy: tuple[int, ...] = ()
        self._largest_speed, self._largest_energy = RunningMaximum(), RunningMaximum()
        # Time from which the motions of the parts are used instead of the energy [time].
        self._parts_since = np.inf
        # Longest half period of any part so far, with one entry for each time at which it grew.
        self._longest_of_parts = [_Longest(-np.inf)]
        self._longest_of_energy = [_Longest(-np.inf)]

    def take(self, states: History) -> None:
        """Append states that the evidence already contains."""
        momenta = states.find_momenta(of_parts=True)
        if momenta is not None and momenta.masses is not None:
            swings = self._follow_parts(momenta, momenta.masses)
            for swing, motion in sorted(swings, key=lambda pair: pair[0].seen_at):
                self._learn(swing, motion, self._longest_of_parts)
        least_swing = _AT_REST * self._largest_energy.add(np.abs(states.energy))
        for swing in self._energy.add(states.time, states.energy, least_swing):
            self._learn(swing, self._energy, self._longest_of_energy)

    def _follow_parts(
        self, momenta: Momenta, masses: Samples
    ) -> Iterator[tuple[_HalfPeriod, _Motion]]:
        """Follow the momenta of heavy parts relative to the centre of mass of all moving parts."""
        for states, moving in self._evidence.moving:
            members = [number for number in moving if masses[number] > 0]
            whole = float(masses[members].sum())
            heavy = tuple(
                number
                for number in members
                if _HEAVY < masses[number] / whole < 1 - _HEAVY
            )
            if heavy != self._heavy:
                self._going_on.clear()
            self._heavy = heavy
            if not heavy:
                continue
            time = momenta.time[states]
            self._parts_since = min(self._parts_since, float(time[0]))
            velocity = momenta.values[states][:, members].sum(axis=1) / whole
            speeds = self._largest_speed.add(np.abs(velocity).max(axis=1))
            for number in heavy:
                relative = momenta.values[states, number] - masses[number] * velocity
                least_swing = masses[number] * _AT_REST * speeds
                for axis, values in enumerate(relative.T):
                    motion = self._get_motion(momenta, number, axis)
                    for swing in motion.add(time, values, least_swing):
                        yield swing, motion

    def _get_motion(self, momenta: Momenta, number: int, axis: int) -> _Motion:
        """Return the motion of a part along an axis. A part that starts to move or deforms again gets a new motion."""
        assert momenta.parts is not None
        if (number, axis) not in self._going_on:
            motion = _Motion(momenta.parts[number].name)
            self._going_on[number, axis] = motion
            self._part_motions.append(motion)
        return self._going_on[number, axis]

    def _learn(
        self, swing: _HalfPeriod, motion: _Motion, so_far: list[_Longest]
    ) -> None:
        """Lengthen the waiting time if a completed half period requires it and was neither a rotation nor pushed.

        A pushed swing counts if there is no deck and this motion has not yet had an unforced oscillation.
        """
        longest = so_far[-1]
        strongest = max(longest.strength, swing.strength)
        longest = longest._replace(since=swing.seen_at, strength=strongest)
        is_free = self._evidence.free_since(swing.end) <= swing.begin
        motion.has_free_swing |= is_free
        is_too_long = is_free and swing.half > _LONGEST_FREE * self._half_of_springs
        if swing.strength >= _ROTATION * strongest and not is_too_long:
            half = min(swing.half, _LONGEST_PUSHED * self._half_of_springs)
            longest = longest._replace(swing=max(longest.swing, half))
            counts = is_free or not (motion.has_free_swing or self._least)
            if counts and swing.half > longest.half:
                longest = longest._replace(
                    half=swing.half, name=motion.name, over=swing.seen_at
                )
        so_far.append(longest)

    def wait(self, start: float, now: float) -> Wait | None:
        """Return the waiting time for a flight since ``start``, from the states up to ``now``; None if unknown."""
        longest = self.longest(now)
        if self._given is not None:
            reason = "as given"
            if longest is not None and longest.time > self._given:
                reason = f"as given, but {longest.reason}"
            return Wait(self._given, "given", reason)
        if self._is_at_rest(start, now):
            time = self._evidence.history.time
            return Wait(
                float(time[FEWEST - 1] - time[0]),
                "at-rest",
                f"nothing vibrates: {FEWEST} states are enough",
            )
        if self._least is None and self._has_long_ongoing_swing(now):
            return None
        return longest

    def longest(self, now: float) -> Wait | None:
        """Return the longest half period known at the time ``now``, from the deck or from the record so far."""
        longest = self._get_longest(now)
        if longest.half <= (self._least.time if self._least else 0.0):
            return self._least
        reason = f"{longest.name} took {longest.half:.3g} for half a period, until {longest.over:.6g}"
        return Wait(longest.half, "record", reason)

    def longest_swing(self, now: float) -> float:
        """Return the longest half period known at the time ``now``, even if a push lengthened it [time]."""
        least = self._least.time if self._least else 0.0
        return max(self._get_longest(now).swing, least)

    def _get_longest(self, now: float) -> _Longest:
        """Return the longest half period known at a time: from the parts, or from the energy while no part moves."""
        has_parts = self._parts_since <= now
        so_far = self._longest_of_parts if has_parts else self._longest_of_energy
        return so_far[bisect_right(so_far, now, key=lambda longest: longest.since) - 1]

    def _is_at_rest(self, start: float, now: float) -> bool:
        """Return True if no force has acted since the record began, and nothing vibrates."""
        history = self._evidence.history
        if history.time.size < FEWEST or start > history.time[FEWEST - 1]:
            return False
        energies: list[Samples | None] = [history.energy]
        if balance := history.balance:
            energies += (balance.internal, balance.kinetic, balance.external_work)
        inside = find_window(history.time, start, now)
        largest = [
            float(np.abs(energy[inside]).max())
            for energy in energies
            if energy is not None
        ]
        return largest[0] <= _ROUND_OFF * max(largest)

    def _has_long_ongoing_swing(self, now: float) -> bool:
        """Return True if an unfinished oscillation is already much longer than all earlier ones."""
        least_strength = _ROTATION * self._get_longest(now).strength
        motions = [motion for motion in self._part_motions if motion.covers(now)]
        return any(
            motion.outlasts_earlier_swings(now, least_strength)
            for motion in motions or [self._energy]
        )


def wait_of_deck(inventory: Inventory) -> Wait | None:
    """Return half of the longest period of a deck's springs; None if the deck does not define it."""
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
    if shortest and given < _EXACT * shortest:
        raise RangeError(
            f"{name}: `wait` {given:g} is below {shortest:.3g}, half of a known period: {longest.reason}; a gap in the "
            "load would be treated as flight, so give a longer one"
        )
