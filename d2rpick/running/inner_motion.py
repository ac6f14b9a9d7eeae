"""How parts swing inside a body, by what a run shows so far: what is to be waited for, and what becomes out of place.

Before it counts as flight nothing must act for half of the longest inner period.
Inside a load contacts open and close again, as parts on springs swing to and fro: the longest gap is shorter than half
of the longest period (measured: 13 of 17 ms in a falling box, 14 of 22 ms in a car).  A wait that is shorter takes
such a gap for flight, and a body that is frozen there never makes the push that was to come.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import RangeError
from d2rpick.deck.pieces import inner_period
from d2rpick.flight.flight import Flight
from d2rpick.flight.momentum import believed
from d2rpick.flight.position_error import MOST_OF_PATH, drift_in_flight
from d2rpick.flight.window import FEWEST
from d2rpick.histories.samples import integral, window
from d2rpick.running.evidence import times_without_force

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.deck.model import Inventory
    from d2rpick.histories.history import History, Momenta, Samples

# A swing is one by this share of the range so far of a velocity.
_SWING: Final = 1 / 3
# From a tenth of a swing to nine tenths takes a harmonic motion this share of half its period: its ends may be flat.
_INNER, _SHARE = 0.1, float(np.arccos(-0.8) - np.arccos(0.8)) / np.pi
# A swing with less than this share of the strongest mean force of all is that of a body that turns.
_SLOW: Final = 0.05
# What moves at less than this share of the speed of all stands still against them.
_SLOWEST: Final = 1e-3
# What has swung for so many times its longest half period goes on for nobody knows how long.
_LONGER: Final = 2.0
# A period is known no better: a wait that is given may be so much shorter.
_EXACT: Final = 0.9
# Parts of a smaller share of the mass move the others too little.
_HEAVY: Final = 0.05
# Below this share of the largest energy so far the internal energy is round-off: nothing vibrates.
_ROUND_OFF: Final = 1e-6


class Wait(NamedTuple):
    """Time without force that counts as flight [time], where it comes from and why.

    ``source``: "given", "record", "deck" or "at-rest".
    """

    time: float
    source: str
    reason: str


class _HalfPeriod(NamedTuple):
    """Half a period of an inner motion from state ``begin`` to ``end``, known from a state on.

    ``half`` is what it took [time], ``strength`` its mean change by time, 0 where it is less than a swing.
    """

    begin: int
    end: int
    known: int
    half: float
    strength: float


class _Motion(NamedTuple):
    """Something that swings by ``name``: its ``values`` (n,), the least change that is a swing (n,), its swings.

    Half a period takes ``times`` as long as a swing of the values.  ``sets_out`` are the first state of the first one
    and that from which it is known; None where nothing moves.
    """

    name: str
    time: Samples
    values: Samples
    room: Samples
    swings: tuple[_HalfPeriod, ...]
    sets_out: tuple[int, int] | None
    times: float = 1.0

    def going_on(self, now: float) -> tuple[float, float, float] | None:
        """Tell what swings ``now``: its mean change by time, how long it has, and the longest half period before."""
        state = int(np.searchsorted(self.time, now, side="right")) - 1
        if self.sets_out is None or not self.sets_out[1] <= state or now > self.time[-1]:
            return None
        before = [one for one in self.swings if one.known <= state]
        begin = before[-1].end if before else self.sets_out[0]
        middle = (begin + state) // 2
        change, lately = (abs(float(self.values[state] - self.values[one])) for one in (begin, middle))
        if change <= self.room[state] or lately <= self.room[state] / 2:
            return None  # it has come to rest, or turns with the body
        took = self.times * (now - float(self.time[begin]))
        return change / took, took, max((one.half for one in before), default=0.0)


class _Known(NamedTuple):
    """What is known ``since`` a time: ``half`` a period of something [time], 0 where it tells none, and mean force."""

    since: float
    half: float
    strength: float
    name: str


class InnerMotion:
    """The wait that a record asks for at each of its states, by what it has shown of its inner motion up to there.

    ``given`` is asked for by the user [time]; ``of_deck`` is what the deck tells, or the record of flights before, of
    which the one at hand may show more.
    """

    def __init__(self, history: History, given: float | None = None, of_deck: Wait | None = None) -> None:
        self._history, self._given, self._of_deck = history, given, of_deck

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
            time = self._history.time
            return Wait(float(time[FEWEST - 1] - time[0]), "at-rest", f"nothing vibrates: {FEWEST} states are enough")
        known = self.longest(now)
        if self._given is None:
            return None if self._swings_on(now) else known
        if now - start >= self._given and not at_rest:
            check_wait(self._given, known, ", ".join(self._history.source))
        return Wait(self._given, "given", "as given")

    def longest(self, now: float) -> Wait | None:
        """Give half of the longest period that is known ``now``, by the deck or the record so far."""
        known = max((one for one in self._known if one.since <= now), key=lambda one: one.half, default=None)
        if known is None or (self._of_deck and self._of_deck.time >= known.half):
            return self._of_deck
        reason = f"{known.name} took {known.half:.3g} for half a period that was over at {known.since:.6g}"
        return Wait(known.half, "record", reason)

    def _at_rest(self, start: float, now: float) -> bool:
        """Whether nothing has acted since the record began, and nothing vibrates."""
        history = self._history
        if history.time.size < FEWEST or start > history.time[FEWEST - 1]:
            return False
        balance = history.balance
        terms = (balance.internal, balance.kinetic, balance.external_work) if balance else ()
        inside = window(history.time, start, now)
        energies = [float(np.abs(one[inside]).max()) for one in (history.energy, *terms) if one is not None]
        return energies[0] <= _ROUND_OFF * max(energies)

    def _swings_on(self, now: float) -> bool:
        """Whether something swings that has taken much longer already than all of its swings before."""
        strongest = max((one.strength for one in self._known if one.since <= now), default=0.0)
        going = (motion.going_on(now) for motion in self._motions if motion.time[0] <= now)
        return any(s >= _SLOW * strongest and took > _LONGER * before for s, took, before in filter(None, going))

    @cached_property
    def _known(self) -> tuple[_Known, ...]:
        """Half periods in the order in which they become known, without those of a body that turns."""
        free = [*times_without_force(self._history)]
        before = self._of_deck is not None and self._of_deck.source == "record"
        found = sorted(one for motion in self._motions for one in _own(motion, free, has_own=before))
        strongest = np.maximum.accumulate([one.strength for one in found])
        return tuple(one for one, most in zip(found, strongest, strict=True) if one.strength >= _SLOW * most)

    @cached_property
    def _motions(self) -> tuple[_Motion, ...]:
        return tuple(_of_parts(self._history)) or tuple(_of_energy(self._history))


def wait_of_deck(inventory: Inventory) -> Wait | None:
    """Give half of what the longest period cannot be below, by a deck; None where its springs are not known.

    The record shows what it is more than that; half of that was longer than any gap in the load of a car.
    """
    found = inner_period(inventory)
    return found and Wait(found.least / 2, "deck", f"half of {found.least:.3g}, the least period of {found.reason}")


def check_wait(given: float, known: Wait | None, name: str) -> None:
    """RangeError where a wait that was given is below half of a known period."""
    if known and given < _EXACT * known.time:
        raise RangeError(
            f"{name}: `wait` {given:g} is below {known.time:.3g}, half of a period that is known: {known.reason}; "
            "a gap in the load would pass for flight"
        )


def _own(motion: _Motion, free: Sequence[tuple[float, float]], *, has_own: bool) -> Iterator[_Known]:
    """Give the half periods of a motion: where it ``has_own``, without a force, in ``free`` times, of others 0.

    A push within a swing makes it longer or shorter.
    """
    for one in motion.swings:
        begin, end, known = (float(motion.time[state]) for state in (one.begin, one.end, one.known))
        own = any(start <= begin and end <= stop for start, stop in free)
        if one.strength > 0:
            has_own |= own
            yield _Known(known, one.half if own or not has_own else 0.0, one.strength, motion.name)


def _of_parts(history: History) -> Iterator[_Motion]:
    """Momenta of the heavy parts against the centre of mass of all that move."""
    whole = next((one for one in history.momenta if one.parts is None), None)
    for momenta in history.momenta:
        if momenta.parts is None or momenta.masses is None:
            continue
        masses = momenta.masses
        members = [i for i in momenta.moving if masses[i] > 0]
        heavy = [i for i in members if _HEAVY < masses[i] / masses[members].sum() < 1 - _HEAVY]
        for states in believed(momenta, whole) if heavy else ():
            time, values = momenta.time[states], momenta.values[states]
            centre = values[:, members].sum(axis=1) / masses[members].sum()
            least = _SLOWEST * np.maximum.accumulate(np.abs(centre).max(axis=1))
            for i in heavy:
                against = values[:, i] - masses[i] * centre
                yield from (_motion(momenta.parts[i].name, time, one, masses[i] * least) for one in against.T)


def _of_energy(history: History) -> Iterator[_Motion]:
    """Internal energy, which swings twice as often as what deforms."""
    if history.time.size:
        least = _SLOWEST * np.maximum.accumulate(np.abs(history.energy))
        yield _motion("the internal energy", history.time, history.energy, least, times=2.0)


def _motion(name: str, time: Samples, values: Samples, least: Samples, times: float = 1.0) -> _Motion:
    extent = np.maximum.accumulate(values) - np.minimum.accumulate(values)
    room = np.maximum(_SWING * extent, least)
    sets_out = int(np.argmax(extent > room)) if (extent > room).any() else None
    if sets_out is None:
        return _Motion(name, time, values, room, (), None)
    first = _last_extreme(values[: sets_out + 1])
    swings = []
    for begin, end, known in _turns(values.tolist(), room.tolist(), first, sets_out):
        way = np.abs(values[begin : end + 1] - values[begin])
        begun = int(np.flatnonzero(way <= _INNER * way[-1])[-1])
        ended = begun + int(np.argmax(way[begun:] >= (1 - _INNER) * way[-1]))
        half = times * float(time[begin + ended] - time[begin + begun]) / _SHARE
        swings.append(_HalfPeriod(begin, end, known, half, float(way[-1]) / half if way[-1] > room[known] else 0.0))
    return _Motion(name, time, values, room, tuple(swings), (first, sets_out), times)


def _last_extreme(values: Samples) -> int:
    """Last state at which values (n,) are as far from the last of them as they ever are."""
    away = np.abs(values - values[-1])
    return int(np.flatnonzero(away == away.max())[-1])


def _turns(values: list[float], room: list[float], turn: int, first: int) -> Iterator[tuple[int, int, int]]:
    """Give the states at which a swing begins and ends, and that at which the next one has gone back by ``room``."""
    far, rising = first, values[first] > values[turn]
    for state in range(first, len(values)):
        value = values[state]
        if (value >= values[far]) if rising else (value <= values[far]):
            far = state
        elif abs(values[far] - value) > room[state]:
            yield turn, far, state
            turn, far, rising = far, state, not rising


class Swing(NamedTuple):
    """A part that swings against the others: its ``name``, and how far the body may be out of place [length].

    In a flight that is shorter than ``flight`` [time] that is more than 1 % of the path, beyond which a body is out of
    place.  ``at_most``: two parts alone may turn instead, which puts nothing out of place.
    """

    name: str
    error: float
    flight: float
    at_most: bool = False

    @property
    def told(self) -> str:
        """What is to be known before the body becomes rigid."""
        what, limit = ("still swings against the others", "about")
        if self.at_most:
            what, limit = "swings against the other, or both turn", "at most"
        return (
            f"{self.name} {what}: at td the body may be off by {limit} {self.error:.3g},"
            f" more than {MOST_OF_PATH:.0%} of its path in a flight shorter than {self.flight:.3g}"
        )


def swing_in(history: History, start: float, tr: float) -> Swing | None:
    """Find how far the body that becomes rigid at ``tr`` may be out of place, in a flight since ``start`` [time].

    td is not known: it is taken for the state so far at which the parts stand farthest from where they are at tr.  None
    where the momenta of the parts do not tell.
    """
    momenta = next((one for one in history.momenta if one.parts is not None), None)
    if momenta is None or momenta.parts is None:
        return None
    flying = tuple(momenta.parts[i] for i in momenta.moving)
    drift = drift_in_flight(history, Flight(start, tr, "momentum", flying))
    if drift is None:
        name, error, path = _of_two(momenta, start, tr)
    else:
        name, error, path = drift.part.name, np.max(drift.errors(drift.time, float(drift.time[-1]))), drift.path[-1]
    return (
        Swing(name, float(error), float(error / path) / MOST_OF_PATH * (tr - start), drift is None)
        if path > 0
        else None
    )


def _of_two(momenta: Momenta, start: float, tr: float) -> tuple[str, float, float]:
    """Name the lighter of two parts, how far off the other is at most, and the path; 0 for others."""
    inside = window(momenta.time, start, tr)
    time, masses = momenta.time[inside], momenta.masses
    pair = [] if masses is None else [i for i in momenta.moving if i in momenta.chosen and masses[i] > 0]
    if momenta.parts is None or masses is None or len(pair) != 2 or time.size < 2:
        return "", 0.0, 0.0
    light, heavy = sorted(pair, key=lambda i: float(masses[i]))
    centre = momenta.values[inside][:, pair].sum(axis=1) / masses[pair].sum()
    away = integral(time, momenta.values[inside][:, heavy] / masses[heavy] - centre)
    off, path = np.linalg.norm(away - away[-1], axis=1).max(), integral(time, np.linalg.norm(centre, axis=1))[-1]
    return momenta.parts[light].name, float(off), float(path)
