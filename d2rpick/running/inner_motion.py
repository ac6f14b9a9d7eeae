"""Determine the wait, the force-free time that shows a flight, from the inner oscillations of the body.

The wait is half of the longest inner period.  Inside a load, contacts open and close as parts swing on their springs,
and the longest gap between them is shorter than that (measured: 13 of 17 ms in a falling box, 14 of 22 ms in a car).  A
shorter wait treats such a gap as a flight, and a body frozen in it cannot rebound as it would have done.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.deck.pieces import find_inner_period
from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import find_window
from d2rpick.running.evidence import GrowingEvidence
from d2rpick.running.record import GrowingColumn

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History, Momenta, Samples

# A change of velocity is an oscillation if it exceeds this share of the range so far.
_SWING: Final = 1 / 3
# _INNER: share of an oscillation at each end that is not used to measure it, since its ends may be flat.
# _INNER_TIME: share of half its period that a harmonic motion takes for the rest.
_INNER, _INNER_TIME = 0.1, float(np.arccos(-0.8) - np.arccos(0.8)) / np.pi
# An oscillation whose mean force is below this share of the strongest one so far is a rotation of the body.
_ROTATION: Final = 0.05
# A change within fewer states is a jump, not an oscillation, such as the jump of an energy after the first state.
_FEWEST_STATES: Final = 4
# A part oscillates only if its relative velocity exceeds this share of the velocity of all parts.
_AT_REST: Final = 1e-3
# How an oscillation ends is unknown once it lasts this many times the longest half period before it.
_MUCH_LONGER: Final = 2.0
# Longest oscillations, in half periods according to the deck. A longer one is a rotation of the body.
# _LONGEST_FREE is for free oscillations, _LONGEST_PUSHED for those under a load.
_LONGEST_FREE, _LONGEST_PUSHED = 1.5, 2.5
# Periods are uncertain by 10 %, so a given wait may be as short as this share of half the period.
_EXACT: Final = 0.9
# Parts with a smaller share of the mass hardly move the other parts.
_HEAVY: Final = 0.05
# Internal energy below this share of the largest energy is round-off, so there is no vibration.
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
    """Half a period of an inner motion, from ``begin`` to ``end``; it was detected at the time ``seen_at`` [time].

    ``half`` is half of its period [time], ``strength`` its mean change by time, 0 if that is less than a swing.
    """

    begin: float
    end: float
    seen_at: float
    half: float
    strength: float


class _OngoingSwing(NamedTuple):
    """An unfinished oscillation: its mean rate of change, its duration, and the longest half period before it."""

    strength: float
    duration: float
    longest_half_before: float


class _Motion:
    """One oscillating quantity, such as a velocity component of a part: its states and half periods so far.

    Half a period takes ``halves_per_swing`` swings of its values: 1 for a velocity, 2 for an energy.
    """

    def __init__(self, name: str, halves_per_swing: float = 1.0) -> None:
        self.name, self._factor = name, halves_per_swing
        self.has_free_swing = False  # True after an oscillation without a push
        self.swings: list[_HalfPeriod] = []
        self._columns = {
            name: GrowingColumn() for name in ("time", "values", "least_swing")
        }
        self._lowest, self._highest = np.inf, -np.inf
        # State at the last turning point (None before any motion), and at the extreme value since then.
        self._turn: int | None = None
        self._extreme, self._rising = 0, False
        self._first_moved: float | None = None  # time of the first motion [time]

    @property
    def begins(self) -> float:
        """Time of the first state [time]."""
        return float(self._columns["time"].rows[0])

    @property
    def ends(self) -> float:
        """Time of the last state [time]."""
        return float(self._columns["time"].rows[-1])

    def add(
        self, time: Samples, values: Samples, least_swing: Samples
    ) -> Iterator[_HalfPeriod]:
        """Append states (k,) and return the half periods that they complete, if larger than ``least_swing`` (k,)."""
        lows = np.minimum(np.minimum.accumulate(values), self._lowest)
        highs = np.maximum(np.maximum.accumulate(values), self._highest)
        self._lowest, self._highest = float(lows[-1]), float(highs[-1])
        limits = np.maximum(_SWING * (highs - lows), least_swing)
        begin = self._columns["time"].size
        self._columns["time"].add(time)
        self._columns["values"].add(values)
        self._columns["least_swing"].add(limits)
        all_values = self._columns["values"].rows
        skipped = 0
        if self._turn is None:
            moved = np.flatnonzero(highs - lows > limits)
            if not moved.size:
                return
            skipped = int(moved[0])
            state = begin + skipped
            self._first_moved = float(time[skipped])
            self._turn = _find_last_extreme(all_values[: state + 1])
            self._extreme = state
            self._rising = bool(all_values[state] > all_values[self._turn])
        new_values = values[skipped:].tolist()
        new_limits = limits[skipped:].tolist()
        for state, (value, limit) in enumerate(
            zip(new_values, new_limits, strict=True), start=begin + skipped
        ):
            swing = self._follow(state, value, limit, float(all_values[self._extreme]))
            if swing is not None:
                yield swing

    def _follow(
        self, state: int, value: float, least_swing: float, extreme_value: float
    ) -> _HalfPeriod | None:
        """Follow the motion to a state; return a half period once values have gone back by ``least_swing`` after it."""
        goes_on = value >= extreme_value if self._rising else value <= extreme_value
        if goes_on:
            self._extreme = state
            return None
        if abs(extreme_value - value) <= least_swing:
            return None
        assert self._turn is not None
        swing = None
        if self._extreme - self._turn >= _FEWEST_STATES:
            swing = self._measure(self._turn, self._extreme, state, least_swing)
            self.swings.append(swing)
        self._turn, self._extreme, self._rising = (
            self._extreme,
            state,
            not self._rising,
        )
        return swing

    def _measure(
        self, begin: int, end: int, state: int, least_swing: float
    ) -> _HalfPeriod:
        """Measure the half period between two states; it is detected at a third state."""
        time = self._columns["time"].rows
        values = self._columns["values"].rows[begin : end + 1]
        distance = np.abs(values - values[0])
        whole = distance[-1]
        low = int(np.flatnonzero(distance <= _INNER * whole)[-1])
        high = low + int(np.argmax(distance[low:] >= (1 - _INNER) * whole))
        inner_time = float(time[begin + high] - time[begin + low])
        half = self._factor * inner_time / _INNER_TIME
        strength = float(whole) / half if whole > least_swing else 0.0
        return _HalfPeriod(
            float(time[begin]), float(time[end]), float(time[state]), half, strength
        )

    def find_ongoing(self, now: float) -> _OngoingSwing | None:
        """Return the unfinished oscillation ``now``; None if the motion has come to rest or is a rotation."""
        time, values = self._columns["time"].rows, self._columns["values"].rows
        if self._turn is None or self._first_moved is None or self._first_moved > now:
            return None
        state = int(np.searchsorted(time, now, side="right")) - 1
        swings_before = [swing for swing in self.swings if swing.seen_at <= now]
        turned_at = swings_before[-1].end if swings_before else self._first_moved
        begin = int(np.searchsorted(time, turned_at))
        middle = (begin + state) // 2
        change = abs(float(values[state] - values[begin]))
        change_of_late = abs(float(values[state] - values[middle]))
        least_swing = float(self._columns["least_swing"].rows[state])
        if change <= least_swing or change_of_late <= least_swing / 2:
            return None
        duration = self._factor * (now - turned_at)
        longest = max((swing.half for swing in swings_before), default=0.0)
        return _OngoingSwing(change / duration, duration, longest)


class _Longest(NamedTuple):
    """The longest half period known ``since`` a time: its source, and its end ``over`` [time].

    ``strength`` is the strongest mean change by time so far, ``swing`` half of the longest swing, pushed or not [time].
    """

    since: float
    half: float
    strength: float
    name: str
    over: float
    swing: float


class InnerMotion:
    """The wait at each state of a record, from the inner motion up to that state.

    ``given`` is the wait of the user, ``of_deck`` the one of the deck, ``before`` that of earlier flights [time].
    """

    def __init__(
        self,
        given: float | None = None,
        of_deck: Wait | None = None,
        before: float = 0.0,
    ) -> None:
        self._given, self._least = given, of_deck
        self._half_of_springs = of_deck.time if of_deck else np.inf
        if before > (of_deck.time if of_deck else 0.0):
            self._least = Wait(before, "record", "as in the flight before")
        self._evidence = GrowingEvidence()
        self._part_motions: list[_Motion] = []
        # Motions that still continue, keyed by the indices of part and axis.
        self._going_on: dict[tuple[int, int], _Motion] = {}
        self._energy = _Motion("the internal energy", halves_per_swing=2.0)
        self._heavy: tuple[int, ...] = ()
        self._largest_speed = self._largest_energy = 0.0
        # Longest half periods in the order in which they became known.
        self._longest_of_parts: list[_Longest] = []
        self._longest_of_energy: list[_Longest] = []

    def take(self, states: History, evidence: GrowingEvidence) -> None:
        """Append states that the ``evidence`` already contains."""
        self._evidence = evidence
        for momenta in states.momenta:
            if momenta.parts is not None and momenta.masses is not None:
                swings = sorted(
                    self._follow_parts(momenta), key=lambda pair: pair[0].seen_at
                )
                for swing, motion in swings:
                    self._learn(swing, motion)
                break
        for swing in self._follow_energy(states):
            self._learn(swing, self._energy)

    def _follow_parts(self, momenta: Momenta) -> Iterator[tuple[_HalfPeriod, _Motion]]:
        """Follow the momenta of heavy parts relative to the centre of mass of all moving parts."""
        masses = momenta.masses
        assert masses is not None
        for states, moving, complete in self._evidence.alike(momenta.time.size):
            members = [number for number in moving if masses[number] > 0]
            whole = float(masses[members].sum())
            heavy = tuple(
                number
                for number in members
                if _HEAVY < masses[number] / whole < 1 - _HEAVY
            )
            if heavy != self._heavy or not complete:
                self._going_on.clear()
            self._heavy = heavy
            if not heavy or not complete:
                continue
            velocity = momenta.values[states][:, members].sum(axis=1) / whole
            speeds = np.maximum.accumulate(np.abs(velocity).max(axis=1))
            largest_speeds = np.maximum(speeds, self._largest_speed)
            self._largest_speed = float(largest_speeds[-1])
            for number in heavy:
                relative = momenta.values[states, number] - masses[number] * velocity
                least_swing = masses[number] * _AT_REST * largest_speeds
                for axis, values in enumerate(relative.T):
                    motion = self._get_motion(momenta, number, axis)
                    for swing in motion.add(momenta.time[states], values, least_swing):
                        yield swing, motion

    def _get_motion(self, momenta: Momenta, number: int, axis: int) -> _Motion:
        """Return the motion of a part along an axis. A part that starts to move or deforms again gets a new motion."""
        assert momenta.parts is not None
        if (number, axis) not in self._going_on:
            motion = _Motion(momenta.parts[number].name)
            self._going_on[number, axis] = motion
            self._part_motions.append(motion)
        return self._going_on[number, axis]

    def _follow_energy(self, states: History) -> Iterator[_HalfPeriod]:
        """Follow the internal energy, which oscillates at twice the rate of the deformation."""
        if not states.time.size:
            return
        energies = np.maximum.accumulate(np.abs(states.energy))
        largest = np.maximum(energies, self._largest_energy)
        self._largest_energy = float(largest[-1])
        yield from self._energy.add(states.time, states.energy, _AT_REST * largest)

    def _learn(self, swing: _HalfPeriod, motion: _Motion) -> None:
        """Lengthen the wait if a completed half period requires it, unless this was a rotation or disturbed by a push.

        A pushed swing counts if there is no deck and this motion has not swung without a push before.
        """
        if swing.strength <= 0:
            return
        of_energy = motion is self._energy
        so_far = self._longest_of_energy if of_energy else self._longest_of_parts
        longest = (
            so_far[-1]
            if so_far
            else _Longest(swing.seen_at, 0.0, 0.0, motion.name, swing.seen_at, 0.0)
        )
        strongest = max(longest.strength, swing.strength)
        free = self._evidence.free_since(swing.end) <= swing.begin
        motion.has_free_swing |= free
        too_long = free and swing.half > _LONGEST_FREE * self._half_of_springs
        is_vibration = swing.strength >= _ROTATION * strongest and not too_long
        counts = is_vibration and (free or not (motion.has_free_swing or self._least))
        swing_half = longest.swing
        if is_vibration:
            cut = min(swing.half, _LONGEST_PUSHED * self._half_of_springs)
            swing_half = max(swing_half, cut)
        longest = longest._replace(
            since=swing.seen_at, strength=strongest, swing=swing_half
        )
        if counts and swing.half > longest.half:
            longest = longest._replace(
                half=swing.half, name=motion.name, over=swing.seen_at
            )
        so_far.append(longest)

    def needed(self, start: float, now: float) -> float | None:
        """Return the wait for a flight that began at ``start``, from the states up to ``now`` [time]; None if unknown.

        Raises
        ------
        RangeError
            If a given wait is over and is shorter than half of a known period.
        """
        wait = self.wait(start, now)
        return wait.time if wait else None

    def wait(self, start: float, now: float) -> Wait | None:
        """Return the wait of `needed` with its reason."""
        at_rest = self._is_at_rest(start, now)
        if self._given is None and at_rest:
            time = self._evidence.history.time
            return Wait(
                float(time[FEWEST - 1] - time[0]),
                "at-rest",
                f"nothing vibrates: {FEWEST} states are enough",
            )
        longest = self.longest(now)
        if self._given is None:
            unknown = self._least is None and self._has_long_ongoing_swing(now)
            return None if unknown else longest
        if now - start >= self._given and not at_rest:
            names = ", ".join(self._evidence.history.source)
            check_wait(self._given, longest, names)
        return Wait(self._given, "given", "as given")

    def longest(self, now: float) -> Wait | None:
        """Return the longest half period known ``now``, from the deck or from the record so far."""
        longest = self._get_longest(now)
        if longest is None or longest.half <= (
            self._least.time if self._least else 0.0
        ):
            return self._least
        reason = f"{longest.name} took {longest.half:.3g} for half a period, until {longest.over:.6g}"
        return Wait(longest.half, "record", reason)

    def longest_swing(self, now: float) -> float:
        """Return the longest half period known ``now``, even if a push lengthened it [time]."""
        longest = self._get_longest(now)
        of_record = longest.swing if longest else 0.0
        return max(of_record, self._least.time if self._least else 0.0)

    def _get_longest(self, now: float) -> _Longest | None:
        """Return the longest half period known at a time: from the parts, or from the energy while no part moves."""
        has_parts = any(motion.begins <= now for motion in self._part_motions)
        so_far = self._longest_of_parts if has_parts else self._longest_of_energy
        count = bisect_right(so_far, now, key=lambda longest: longest.since)
        return so_far[count - 1] if count else None

    def _is_at_rest(self, start: float, now: float) -> bool:
        """Return True if no force has acted since the record began, and nothing vibrates."""
        history = self._evidence.history
        if history.time.size < FEWEST or start > history.time[FEWEST - 1]:
            return False
        energies = [history.energy]
        if balance := history.balance:
            terms = (balance.internal, balance.kinetic, balance.external_work)
            energies += [term for term in terms if term is not None]
        inside = find_window(history.time, start, now)
        largest = [float(np.abs(energy[inside]).max()) for energy in energies]
        return largest[0] <= _ROUND_OFF * max(largest)

    def _has_long_ongoing_swing(self, now: float) -> bool:
        """Return True if an unfinished oscillation is already much longer than all earlier ones."""
        longest = self._get_longest(now)
        strongest = longest.strength if longest else 0.0
        motions = [
            motion
            for motion in self._part_motions
            if motion.begins <= now <= motion.ends
        ]
        for motion in motions or [self._energy]:
            swing = motion.find_ongoing(now)
            if (
                swing is not None
                and swing.strength >= _ROTATION * strongest
                and swing.duration > _MUCH_LONGER * swing.longest_half_before
            ):
                return True
        return False


def wait_of_deck(inventory: Inventory) -> Wait | None:
    """Return half of the longest period of a deck's springs; None if the deck does not define it."""
    period = find_inner_period(inventory)
    if period is None:
        return None
    reason = f"half of the period {period.time:.3g} of {period.reason}"
    return Wait(period.time / 2, "deck", reason, period.least / 2)


def check_wait(given: float, longest: Wait | None, name: str) -> None:
    """Raise RangeError if a given wait is shorter than half of a known period."""
    if longest is None:
        return
    shortest = longest.time if longest.least is None else longest.least
    if shortest and given < _EXACT * shortest:
        raise RangeError(
            f"{name}: `wait` {given:g} is below {shortest:.3g}, half of a known period: {longest.reason}; a gap in the "
            "load would be treated as flight, so give a longer one"
        )


def _find_last_extreme(values: Samples) -> int:
    """Return the state at which values (n,) differ most from the last value; if there are several, the last of them."""
    distance = np.abs(values - values[-1])
    return int(np.flatnonzero(distance == distance.max())[-1])
