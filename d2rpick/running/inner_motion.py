"""How parts swing inside a body, by what a run shows so far: what is to be waited for.

Before it counts as flight nothing must act for half of the longest inner period.
Inside a load contacts open and close again, as parts on springs swing to and fro: the longest gap is shorter than half
of the longest period (measured: 13 of 17 ms in a falling box, 14 of 22 ms in a car).  A wait that is shorter takes
such a gap for flight, and a body that is frozen there never makes the push that was to come.
"""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.deck.pieces import inner_period
from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import window
from d2rpick.running.evidence import Evidence
from d2rpick.running.record import Column

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History, Momenta, Samples

# A swing is one by this share of the range so far of a velocity.
_SWING: Final = 1 / 3
# From a tenth of a swing to nine tenths takes a harmonic motion this share of half its period: its ends may be flat.
_INNER, _SHARE = 0.1, float(np.arccos(-0.8) - np.arccos(0.8)) / np.pi
# A swing with less than this share of the strongest mean force of all is that of a body that turns.
_SLOW: Final = 0.05
# A swing of fewer states is a jump, as of an energy in the first state.
_RESOLVED: Final = 4
# What moves at less than this share of the speed of all stands still against them.
_SLOWEST: Final = 1e-3
# What has swung for so many times its longest half period goes on for nobody knows how long.
_LONGER: Final = 2.0
# A swing that no push disturbed and that takes more than so many times half of the period of the deck is that of a body
# that turns; one that was pushed counts as so long at most.
_TURNS, _BEYOND = 1.5, 2.5
# A period is known no better: a wait that is given may be so much shorter.
_EXACT: Final = 0.9
# Parts of a smaller share of the mass move the others too little.
_HEAVY: Final = 0.05
# Below this share of the largest energy so far the internal energy is round-off: nothing vibrates.
_ROUND_OFF: Final = 1e-6


class Wait(NamedTuple):
    """Time without force that counts as flight [time], where it comes from and why.

    ``source``: "given", "record", "deck" or "at-rest".  ``least``: what half of a period of the deck cannot be below
    [time]; else it is the wait itself.
    """

    time: float
    source: str
    reason: str
    least: float | None = None


class _HalfPeriod(NamedTuple):
    """Half a period of an inner motion from one time to another, ``known`` from a third one on [time].

    ``half`` is what it took [time], ``strength`` its mean change by time, 0 where it is less than a swing.
    """

    begin: float
    end: float
    known: float
    half: float
    strength: float


class _Motion:
    """Something that swings by ``name``: the states of its ``values`` so far, and its swings.

    Half a period takes ``times`` as long as a swing of the values.
    """

    def __init__(self, name: str, times: float = 1.0) -> None:
        self.name, self._times = name, times
        self.has_own = False  # whether it has shown a swing that no push disturbed
        self.swings: list[_HalfPeriod] = []
        self._columns = {what: Column() for what in ("time", "values", "room")}
        self._lowest, self._highest = np.inf, -np.inf
        self._turn: int | None = (
            None  # state of the last turn; None before anything moves
        )
        self._far, self._rising = 0, False
        self._sets_out: float | None = None

    @property
    def begins(self) -> float:
        """Time of the first state [time]."""
        return float(self._columns["time"].rows[0])

    @property
    def ends(self) -> float:
        """Time of the last state [time]."""
        return float(self._columns["time"].rows[-1])

    def add(
        self, time: Samples, values: Samples, least: Samples
    ) -> Iterator[_HalfPeriod]:
        """Append states (k,), whose least change that is a swing is at least ``least`` (k,); give the swings seen."""
        lows = np.minimum(np.minimum.accumulate(values), self._lowest)
        highs = np.maximum(np.maximum.accumulate(values), self._highest)
        self._lowest, self._highest = float(lows[-1]), float(highs[-1])
        room = np.maximum(_SWING * (highs - lows), least)
        begin = self._columns["time"].size
        moved = np.flatnonzero(highs - lows > room)
        for what, rows in (("time", time), ("values", values), ("room", room)):
            self._columns[what].add(rows)
        every, limits = self._columns["values"].rows, room.tolist()
        if self._turn is None:
            if not moved.size:
                return
            state = begin + int(moved[0])
            self._sets_out = float(time[moved[0]])
            self._turn = _last_extreme(every[: state + 1])
            self._far, self._rising = state, bool(every[state] > every[self._turn])
            begin, limits = state, limits[int(moved[0]) :]
        for state, (value, limit) in enumerate(
            zip(every[begin:].tolist(), limits, strict=True), start=begin
        ):
            yield from self._turned(state, value, limit, every)

    def _turned(
        self, state: int, value: float, room: float, every: Samples
    ) -> Iterator[_HalfPeriod]:
        """Follow the swing by a state; give it where the next one has gone back by its room."""
        if (value >= every[self._far]) if self._rising else (value <= every[self._far]):
            self._far = state
        elif abs(every[self._far] - value) > room:
            assert self._turn is not None
            if self._far - self._turn >= _RESOLVED:
                self.swings.append(
                    self._half_period(self._turn, self._far, state, room)
                )
                yield self.swings[-1]
            self._turn, self._far, self._rising = self._far, state, not self._rising

    def _half_period(
        self, begin: int, end: int, state: int, room: float
    ) -> _HalfPeriod:
        time, values = (
            self._columns["time"].rows,
            self._columns["values"].rows[begin : end + 1],
        )
        way = np.abs(values - values[0])
        begun = int(np.flatnonzero(way <= _INNER * way[-1])[-1])
        ended = begun + int(np.argmax(way[begun:] >= (1 - _INNER) * way[-1]))
        half = self._times * float(time[begin + ended] - time[begin + begun]) / _SHARE
        strength = float(way[-1]) / half if way[-1] > room else 0.0
        return _HalfPeriod(
            float(time[begin]), float(time[end]), float(time[state]), half, strength
        )

    def going_on(self, now: float) -> tuple[float, float, float] | None:
        """Tell what swings ``now``: its mean change by time, how long it has, and the longest half period before."""
        time, values = self._columns["time"].rows, self._columns["values"].rows
        state = int(np.searchsorted(time, now, side="right")) - 1
        if self._turn is None or self._sets_out is None or self._sets_out > now:
            return None
        before = [one for one in self.swings if one.known <= now]
        turned = before[-1].end if before else self._sets_out
        begin = int(np.searchsorted(time, turned))
        room = float(self._columns["room"].rows[state])
        change, lately = (
            abs(float(values[state] - values[one]))
            for one in (begin, (begin + state) // 2)
        )
        if change <= room or lately <= room / 2:
            return None  # it has come to rest, or turns with the body
        took = self._times * (now - turned)
        return change / took, took, max((one.half for one in before), default=0.0)


class _Known(NamedTuple):
    """What is known ``since`` a time: the longest ``half`` period, when it was ``over`` [time], and what it was of.

    ``strength`` is that of the strongest mean force so far, ``swing`` the longest of all, pushed or not [time].
    """

    since: float
    half: float
    strength: float
    name: str
    over: float
    swing: float


class InnerMotion:
    """The wait that a record asks for at each of its states, by what it has shown of its inner motion up to there.

    ``given`` is asked for by the user, ``before`` by the record of flights before [time], ``of_deck`` by the deck.
    """

    def __init__(
        self,
        given: float | None = None,
        of_deck: Wait | None = None,
        before: float = 0.0,
    ) -> None:
        self._given, self._floor = given, of_deck
        self._springs = of_deck.time if of_deck else np.inf
        if before > (of_deck.time if of_deck else 0.0):
            self._floor = Wait(before, "record", "as in the flight before")
        self._evidence = Evidence()
        self._motions: list[_Motion] = []  # of parts along axes
        self._going_on: dict[
            tuple[int, int], _Motion
        ] = {}  # of these, as long as the same parts move
        self._energy = _Motion("the internal energy", times=2.0)
        self._heavy: tuple[int, ...] = ()
        self._largest = self._highest = 0.0  # speed of the centre of mass, and energy
        self._known: dict[bool, list[_Known]] = {
            True: [],
            False: [],
        }  # by motions of parts; by the energy

    @classmethod
    def of(
        cls, history: History, given: float | None = None, of_deck: Wait | None = None
    ) -> InnerMotion:
        """Give that of a whole record."""
        evidence, motion = Evidence(), cls(given, of_deck)
        evidence.take(history)
        motion.take(history, evidence)
        return motion

    def take(self, states: History, evidence: Evidence) -> None:
        """Append states, which the ``evidence`` has taken already."""
        self._evidence = evidence
        momenta = next(
            (
                one
                for one in states.momenta
                if one.parts is not None and one.masses is not None
            ),
            None,
        )
        for swing, motion in sorted(
            self._of_parts(momenta) if momenta else (), key=lambda pair: pair[0].known
        ):
            self._learn(swing, motion)
        for swing in self._of_energy(states):
            self._learn(swing, self._energy)

    def _of_parts(self, momenta: Momenta) -> Iterator[tuple[_HalfPeriod, _Motion]]:
        """Follow the momenta of heavy parts against the centre of mass of all that move."""
        masses = momenta.masses
        assert masses is not None
        assert momenta.parts is not None
        for states, moving, believed in self._evidence.alike(momenta.time.size):
            members = [i for i in moving if masses[i] > 0]
            whole = float(masses[members].sum())
            heavy = tuple(i for i in members if _HEAVY < masses[i] / whole < 1 - _HEAVY)
            if heavy != self._heavy or not believed:
                self._going_on.clear()
            self._heavy = heavy
            if not heavy or not believed:
                continue
            centre = momenta.values[states][:, members].sum(axis=1) / whole
            fastest = np.maximum(
                np.maximum.accumulate(np.abs(centre).max(axis=1)), self._largest
            )
            self._largest = float(fastest[-1])
            for i in heavy:
                against = momenta.values[states, i] - masses[i] * centre
                for axis, values in enumerate(against.T):
                    if (i, axis) not in self._going_on:
                        self._going_on[i, axis] = _Motion(momenta.parts[i].name)
                        self._motions.append(self._going_on[i, axis])
                    motion = self._going_on[i, axis]
                    for swing in motion.add(
                        momenta.time[states], values, masses[i] * _SLOWEST * fastest
                    ):
                        yield swing, motion

    def _of_energy(self, states: History) -> Iterator[_HalfPeriod]:
        """Follow the internal energy, which swings twice as often as what deforms."""
        if not states.time.size:
            return
        highest = np.maximum(
            np.maximum.accumulate(np.abs(states.energy)), self._highest
        )
        self._highest = float(highest[-1])
        yield from self._energy.add(states.time, states.energy, _SLOWEST * highest)

    def _learn(self, swing: _HalfPeriod, motion: _Motion) -> None:
        """Let a swing that is over make the wait longer: not that of a body that turns, nor one that was pushed.

        Where no deck tells anything, and this motion has not shown a swing without a push before, pushed ones count.
        """
        if swing.strength <= 0:
            return
        so_far = self._known[motion is not self._energy]
        longest = (
            so_far[-1]
            if so_far
            else _Known(swing.known, 0.0, 0.0, motion.name, swing.known, 0.0)
        )
        strongest = max(longest.strength, swing.strength)
        own = self._evidence.free_since(swing.end) <= swing.begin
        motion.has_own |= own
        inner = swing.strength >= _SLOW * strongest and not (
            own and swing.half > _TURNS * self._springs
        )
        counts = inner and (own or not (motion.has_own or self._floor))
        half, who = (
            (swing.half, motion.name)
            if counts and swing.half > longest.half
            else (longest.half, longest.name)
        )
        over = swing.known if half > longest.half else longest.over
        longest_swing = max(
            longest.swing, min(swing.half, _BEYOND * self._springs) if inner else 0.0
        )
        so_far.append(_Known(swing.known, half, strongest, who, over, longest_swing))

    def needed(self, start: float, now: float) -> float | None:
        """Wait [time], where nothing has acted from ``start`` to ``now``; None where it is not known yet.

        RangeError where the one that was given is over, and shorter than half of a known period.
        """
        wait = self.wait(start, now)
        return wait and wait.time

    def wait(self, start: float, now: float) -> Wait | None:
        """Give the same with its reason."""
        at_rest = self._at_rest(start, now)
        if self._given is None and at_rest:
            time = self._evidence.history.time
            return Wait(
                float(time[FEWEST - 1] - time[0]),
                "at-rest",
                f"nothing vibrates: {FEWEST} states are enough",
            )
        known = self.longest(now)
        if self._given is None:
            return None if self._floor is None and self._swings_on(now) else known
        if now - start >= self._given and not at_rest:
            check_wait(self._given, known, ", ".join(self._evidence.history.source))
        return Wait(self._given, "given", "as given")

    def longest(self, now: float) -> Wait | None:
        """Give half of the longest period that is known ``now``, by the deck or the record so far."""
        known = self._so_far(now)
        if known is None or known.half <= (self._floor.time if self._floor else 0.0):
            return self._floor
        reason = f"{known.name} took {known.half:.3g} for half a period that was over at {known.over:.6g}"
        return Wait(known.half, "record", reason)

    def longest_swing(self, now: float) -> float:
        """Longest half of a swing that is known ``now``, though a push may have made it longer [time]."""
        known = self._so_far(now)
        return max(
            known.swing if known else 0.0, self._floor.time if self._floor else 0.0
        )

    def _so_far(self, now: float) -> _Known | None:
        known = self._known[any(one.begins <= now for one in self._motions)]
        place = bisect_right(known, now, key=lambda one: one.since)
        return known[place - 1] if place else None

    def _at_rest(self, start: float, now: float) -> bool:
        """Whether nothing has acted since the record began, and nothing vibrates."""
        history = self._evidence.history
        if history.time.size < FEWEST or start > history.time[FEWEST - 1]:
            return False
        balance = history.balance
        terms = (
            (balance.internal, balance.kinetic, balance.external_work)
            if balance
            else ()
        )
        inside = window(history.time, start, now)
        energies = [
            float(np.abs(one[inside]).max())
            for one in (history.energy, *terms)
            if one is not None
        ]
        return energies[0] <= _ROUND_OFF * max(energies)

    def _swings_on(self, now: float) -> bool:
        """Whether something swings that has taken much longer already than all of its swings before."""
        known = self._so_far(now)
        strongest = known.strength if known else 0.0
        of_parts = [one for one in self._motions if one.begins <= now <= one.ends]
        going = (one.going_on(now) for one in of_parts or [self._energy])
        return any(
            s >= _SLOW * strongest and took > _LONGER * before
            for s, took, before in filter(None, going)
        )


def wait_of_deck(inventory: Inventory) -> Wait | None:
    """Give half of the longest period of the springs of a deck; None where these are not known."""
    found = inner_period(inventory)
    if found is None:
        return None
    return Wait(
        found.time / 2,
        "deck",
        f"half of the period {found.time:.3g} of {found.reason}",
        found.least / 2,
    )


def check_wait(given: float, known: Wait | None, name: str) -> None:
    """RangeError where a wait that was given is below half of what a known period cannot be below."""
    least = known and (known.time if known.least is None else known.least)
    if known and least and given < _EXACT * least:
        raise RangeError(
            f"{name}: `wait` {given:g} is below {least:.3g}, half of a period that is known: {known.reason}; "
            "a gap in the load would pass for flight"
        )


def _last_extreme(values: Samples) -> int:
    """Last state at which values (n,) are as far from the last of them as they ever are."""
    away = np.abs(values - values[-1])
    return int(np.flatnonzero(away == away.max())[-1])
