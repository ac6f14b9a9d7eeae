"""When the parts fly: which evidence counts for the window around td in which nothing but gravity acts on them."""

from __future__ import annotations

from functools import cache, partial
from math import isfinite, isinf
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.contact_forces import Touches, is_deformed
from d2rpick.flight.internal_energy import (
    moves_as_a_whole,
    rises_as_it_yields,
    settled_from,
)
from d2rpick.flight.window import SHORTEST, all_windows, marks, unheld

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.flight.window import FreeFlight
    from d2rpick.histories.history import Balance, History, Momenta, Samples
    from d2rpick.histories.names import Part

# Where a flight may be known from, best first.
SOURCES: Final = (
    "given",
    "momentum",
    "contact-force",
    "contact-energy",
    "energy-balance",
    "oscillator",
    "energy",
    None,
)
_SURE: Final = ("given", "momentum", "oscillator")
BY_ENERGIES: Final = ("contact-energy", "energy-balance")
# In free flight no load works.  An energy that is off by 4 % is a deformation that is off by 0.02, within which two
# candidates count as equally good.
MOST_WORK: Final = 0.04
# What must show every flight that a better source shows: a contact of any part is a contact.
_AGREEING: Final = ("contact-force", "contact-energy")
# Forces that are not written, and loads, do not show in the forces of contacts, nor do walls in energies.
_PARTIAL: Final = (*BY_ENERGIES, "contact-force")
# Ends of a flight by two sources are the same within this share of it, or so many output intervals.
_SAME, _SAME_STATES = 0.01, 3


class Flight(NamedTuple):
    """Window of free flight [time]; ``start`` None when unknown, ``end`` None when no next contact was seen.

    Where nothing flies at td, it is the last flight before td, or else the first after it, and ``refusal`` says what
    shows that.  ``source`` tells how the start was found, one of `SOURCES`.  ``parts`` are those that were seen to
    fly together, None where the momentum did not tell, or told it of the whole model.  ``damping`` is alpha of their
    momentum [1/time], ``gravity`` what was taken for gravity [length/time^2], both as of `FreeFlight`.  ``doubts`` say
    which sources contradict each other.  Of the energy alone: ``settled`` is when it had settled, from there to
    ``start`` is given up for safety.  ``described``: one oscillator describes the energy in it.
    """

    start: float | None = None
    end: float | None = None
    source: str | None = None
    parts: tuple[Part, ...] | None = None
    damping: float = 0.0
    refusal: str | None = None
    doubts: tuple[str, ...] = ()
    settled: float | None = None
    gravity: float = 0.0
    described: bool = False

    def within(self, time: Samples) -> tuple[float, float]:
        """Give it as a window within a record of these times (n,) [time]."""
        first, last = float(time[0]), float(time[-1])
        return (
            first if self.start is None else self.start,
            last if self.end is None else self.end,
        )

    @property
    def by_parts(self) -> bool:
        """Whether the momentum of its parts shows it: contacts and loads that the model has elsewhere do not count."""
        return self.source == "momentum" and self.parts is not None

    @property
    def unknown_load(self) -> bool:
        """Whether a load acts in it that may be gravity, or a pull, or friction, and nothing tells which."""
        return self.source != "given" and not isfinite(self.gravity)

    @property
    def certain(self) -> bool:
        """Whether nothing but free flight looks like that.

        A fixed rigid wall does no work and has no contact energy: without the momentum, only an oscillator that swings
        on tells a flight from a crash into it.
        """
        if self.unknown_load or (self.source == "given" and self.doubts):
            return False
        return self.source in _SURE or (self.source in _PARTIAL and self.described)


class Witness(NamedTuple):
    """One source of evidence: the flight that it shows around a time, and all its ``flights``, ascending in time.

    ``decisive``: where it shows none, there is none, even if it shows none anywhere.
    """

    source: str
    time: Samples
    around: Callable[[float], FreeFlight | None]
    flights: Callable[[], tuple[FreeFlight, ...]]
    decisive: bool

    @classmethod
    def of(
        cls,
        source: str,
        time: Samples,
        around: Callable[[float], FreeFlight | None],
        *,
        decisive: bool,
    ) -> Witness:
        """Give the source that shows flights over ``time`` (n,), which looks around no time, and for all, only once."""
        once = cache(around)
        return cls(
            source,
            time,
            once,
            cache(partial(all_windows, time, partial(_of_middle, time, once))),
            decisive,
        )

    def holding(self, td: float) -> FreeFlight | None:
        """Give the flight that it shows around td: that of the first mark whose flight holds td, else td's own."""
        return _holding(self.time, self.around, td)

    def counts(self) -> bool:
        """Whether there is no flight where it shows none."""
        return self.decisive or bool(self.flights())


def _holding(
    time: Samples, around: Callable[[float], FreeFlight | None], td: float
) -> FreeFlight | None:
    shared = filter(None, map(around, marks(time, td)))
    return next(
        (flight for flight in shared if flight.start <= td <= flight.end), None
    ) or around(td)


def _of_middle(
    time: Samples, around: Callable[[float], FreeFlight | None], moment: float
) -> FreeFlight | None:
    """Give the flight around a time as it is told of a td in its middle: so that a flight is listed as it is used."""
    flight = around(moment)
    of_middle = (
        _holding(time, around, (flight.start + flight.end) / 2) if flight else None
    )
    return (
        of_middle
        if of_middle and of_middle.start <= moment <= of_middle.end
        else flight
    )


class Seen(NamedTuple):
    """What the evidence says of a td: the flight around it, or the one nearest to it and what denies one at td.

    ``held``: supports do, which hold also where the end of the load is given.
    """

    flight: FreeFlight | None = None
    source: str | None = None
    refusal: str | None = None
    doubts: tuple[str, ...] = ()
    held: bool = False


def seen_flight(history: History, td: float) -> Seen:
    """Find the free flight around ``td`` [time] in everything but the energy of the parts.

    The best source that shows a flight counts.  A better one that shows none at td is never overruled, nor is the
    contact energy; where two sources show different ends, the later start and the earlier end count.  What is held at
    td does not fly, whatever the evidence; of a whole model those parts may that nothing holds.
    """
    held = history.surroundings.held(history.parts, td)
    if held is None:
        return _seen(history, td)
    seen = None if history.parts else _seen(history, td)
    return (
        seen
        if seen and seen.flight and seen.flight.parts
        else Seen(refusal=held, held=True)
    )


def _seen(history: History, td: float) -> Seen:
    found: list[tuple[str, FreeFlight]] = []
    for witness in witnesses(history):
        flight = witness.holding(td)
        if flight:
            found.append((witness.source, flight))
        elif (not found or _may_deny(witness, found[0][1])) and witness.counts():
            refusal = _refusal(history, witness, td)
            doubts = tuple(
                f"the {source} shows a flight there, but {refusal}"
                for source, _ in found
            )
            return _nearest(witness, td, refusal, doubts)
    if not found:
        return Seen()
    return history.known.once(
        ("confirmed", *found), lambda: _confirmed(history, found)
    )  # many td lie in the same


def _refusal(history: History, witness: Witness, td: float) -> str:
    """Say what shows that nothing flies at td [time]: a momentum may be that of free flight, and the energy not."""
    if witness.source == "momentum":
        from d2rpick.flight.momentum import flight_around, to_be_asked

        if any(
            flight_around(one, td, history.balance)
            for one in to_be_asked(history.momenta)
        ):
            found = f"the momentum is that of free flight at td = {td:.6g}, but the internal energy keeps no level"
            return f"{found}: parts of the model may touch each other, or energies are wrong"
    return f"the {spoken(witness.source)} shows no free flight at td = {td:.6g}"


def all_seen(history: History) -> tuple[tuple[str, FreeFlight], ...]:
    """Find all flights that the best source shows and no other denies, each with its source, ascending in time."""
    asked = witnesses(history)
    for place, witness in enumerate(asked):
        kept, flights = [], witness.flights()
        for flight in flights:
            middle = (flight.start + flight.end) / 2
            may_deny = (
                one
                for one in asked[place + 1 :]
                if _may_deny(one, flight) and one.counts()
            )
            others = [(one.source, one.around(middle)) for one in may_deny]
            if not all(other for _, other in others):
                continue
            found = [
                (witness.source, flight),
                *((source, other) for source, other in others if other),
            ]
            seen = _confirmed(history, found)
            if seen.flight and not seen.refusal:
                kept.append((witness.source, seen.flight))
        if flights or witness.decisive:
            return tuple(kept)
    return ()


def _may_deny(witness: Witness, flight: FreeFlight) -> bool:
    """Whether a source may deny a flight that a better one shows.

    What parts touch while their own momentum is that of free flight is each other, or others touch something.
    """
    return witness.source in _AGREEING and flight.parts is None


def witnesses(history: History) -> tuple[Witness, ...]:
    """Give the sources of evidence that a history has, best first; it is asked about many td."""
    return history.known.once("witnesses", lambda: tuple(_witnesses(history)))


def _witnesses(history: History) -> Iterator[Witness]:
    if history.momenta:
        from d2rpick.flight import momentum

        momenta = momentum.to_be_asked(history.momenta)
        around = partial(_first, history, momenta)
        decisive = any(momentum.tells(one) for one in momenta)
        yield Witness.of("momentum", momenta[0].time, around, decisive=decisive)
    forces, whole = (
        history.evidence.forces,
        next((one for one in history.momenta if one.parts is None), None),
    )
    touches = Touches.of(forces, whole) if forces else None
    balance, is_better_known = history.balance, bool(history.momenta)
    if touches is not None:
        by_forces = Witness.of(
            "contact-force",
            touches.time,
            partial(_by_forces, history, touches),
            decisive=False,
        )
        is_better_known = is_better_known or bool(by_forces.flights())
        yield by_forces
    if balance is None:
        return
    from d2rpick.flight import work

    if work.shows_contacts(balance):
        around = partial(
            _by_energies, history, work.plateau_around, level=not is_better_known
        )
        yield Witness.of("contact-energy", balance.time, around, decisive=False)
    if work.can_tell(balance):
        around = partial(_by_energies, history, work.balanced_around, level=True)
        yield Witness.of(
            "energy-balance", balance.time, around, decisive=balance.worked is not None
        )


def _first(
    history: History, momenta: Sequence[Momenta], td: float
) -> FreeFlight | None:
    """Give the flight by the momentum of the parts, or else of the whole model."""
    from d2rpick.flight.momentum import flight_around

    for one in momenta:
        found = flight_around(one, td, history.balance)
        if found:
            return (
                found
                if one.parts is not None or one.flying
                else _keeping_level(history, found, td, one)
            )
    return None


def _by_energies(
    history: History,
    look: Callable[[Balance, float], FreeFlight | None],
    td: float,
    *,
    level: bool,
) -> FreeFlight | None:
    """Give the flight around td by energies; of those that do not see a wall that does no work it keeps a ``level``."""
    assert history.balance
    found = look(history.balance, td)
    if level:
        found = _keeping_level(history, found, td)
        if (
            found
            and isinf(found.gravity)
            and history.surroundings.gravity_on(None) == (0.0,)
        ):
            return None  # no gravity feeds the energies
        found = (
            found
            if found and moves_as_a_whole(history.balance, found.start, found.end)
            else None
        )
    return unheld(history.surroundings, found, history.parts, td)


def _by_forces(history: History, touches: Touches, td: float) -> FreeFlight | None:
    """Give the flight around td by forces; where the energy rises as if another load acted, what keeps its level.

    Before any contact has ended a load of another kind may act, which only the external work shows.
    """
    found, balance = touches.flight_around(td), history.balance
    if (
        found
        and found.start <= touches.time[0]
        and (balance is None or balance.external_work is None)
    ):
        return None
    if found and is_deformed(history, found):
        found = _keeping_level(history, found, td)
    if found and balance and not moves_as_a_whole(balance, found.start, found.end):
        return None
    return unheld(history.surroundings, found, history.parts, td)


def _keeping_level(
    history: History,
    flight: FreeFlight | None,
    td: float,
    momenta: Momenta | None = None,
) -> FreeFlight | None:
    """Give what of a flight of the whole model the internal energy keeps its level in, or None where td is before.

    ``momenta`` are those that show the flight.
    """
    if flight is None:
        return None
    balance, damped, time, energy, unseen = (
        history.balance,
        None,
        history.time,
        history.energy,
        0.0,
    )
    if (
        balance
        and balance.kinetic_and_internal is not None
        and balance.internal is not None
    ):
        from d2rpick.flight.work import lowered_by_damping

        sums, unseen = lowered_by_damping(balance, flight, momenta)
        damped = (
            np.stack([np.interp(time, balance.time, one) for one in sums])
            if sums
            else None
        )
        if history.parts is not None:
            energy = np.interp(time, balance.time, balance.internal)
    start = settled_from(time, energy, damped, flight.start, flight.end, unseen)
    if start is not None and start > flight.start and momenta is not None:
        # without gravity the sum itself; with it the last one, less the work of gravity
        whole = None if damped is None else damped[-1 if flight.gravity else 0]
        if rises_as_it_yields(time, energy, whole, flight.start, start, flight.end):
            start = flight.start
    if (
        start is None
        or start > td
        or flight.end - start < SHORTEST * (time[-1] - time[0])
    ):
        return None
    if damped is not None and not flight.gravity:
        first, last = np.interp((flight.start, start), time, damped[0])
        if last - first > MOST_WORK * float(np.abs(energy).max()):
            return None  # forces that cancel worked on it, as where it is held and moved, and they may still act
    return flight._replace(start=start)


def _nearest(
    witness: Witness, td: float, refusal: str, doubts: tuple[str, ...]
) -> Seen:
    """Give the last flight before ``td``, or else the first one after it, where nothing flies at td."""
    flights = witness.flights()
    before = [one for one in flights if one.end < td]
    nearest = before[-1] if before else flights[0] if flights else None
    return Seen(nearest, witness.source if nearest else None, refusal, doubts)


def spoken(source: str | None) -> str:
    """Words for a source."""
    return str(source).replace("-", " ")


def _confirmed(history: History, found: Sequence[tuple[str, FreeFlight]]) -> Seen:
    """Give what is flight by the best source and those that should agree with it, and say where they do not."""
    source, best = found[0]
    refusal = _driven(history, source, best)
    if refusal:
        return Seen(refusal=refusal)
    start, end, end_seen = best.start, best.end, best.end_seen
    doubts = []
    room = same_within(history, start, end)
    for other, flight in found[1:]:
        if other not in _AGREEING or best.parts is not None:
            continue
        if abs(flight.start - best.start) > room or abs(flight.end - best.end) > room:
            one, two = (
                f"{f.start:.6g} to {f.end:.6g} by the {spoken(n)}"
                for n, f in (found[0], (other, flight))
            )
            doubts.append(
                f"the flight lasts from {one}, from {two}; the later start and the earlier end count"
            )
        if flight.end < end:
            end, end_seen = flight.end, flight.end_seen
        start = max(start, flight.start)
    return Seen(
        best._replace(start=start, end=end, end_seen=end_seen),
        source,
        doubts=tuple(doubts),
    )


def same_within(history: History, start: float, end: float) -> float:
    """By how much two sources may differ that show the same flight [time]."""
    return max(_SAME * (end - start), _SAME_STATES * history.step)


def _driven(history: History, source: str, flight: FreeFlight) -> str | None:
    """Say so when a load works on the model in a flight, unless it may work on other parts than those that fly."""
    from d2rpick.flight.work import work_beyond_gravity

    balance = history.balance
    if balance is None or (source == "momentum" and _is_subset(history, flight)):
        return None
    work = work_beyond_gravity(balance, flight.start, flight.end)
    energy = history.mean_energy(flight.start, flight.end)
    if work is None or energy is None or work <= MOST_WORK * max(energy, 0.0):
        return None
    return (
        f"the {spoken(source)} shows a flight from {flight.start:.6g} to {flight.end:.6g}, but there the "
        f"external work beyond gravity and damping is {work:.3g} at a mean energy of {energy:.3g}: it is driven"
    )


def _is_subset(history: History, flight: FreeFlight) -> bool:
    """Whether other parts than those that fly move, too."""
    momenta = next((one for one in history.momenta if one.parts is not None), None)
    if momenta is None or momenta.parts is None or flight.parts is None:
        return False
    members, moves = (
        {part.id for part in flight.parts},
        np.ptp(momenta.values, axis=0).any(axis=1),
    )
    return any(
        part.id not in members
        for part, one in zip(momenta.parts, moves, strict=True)
        if one
    )
