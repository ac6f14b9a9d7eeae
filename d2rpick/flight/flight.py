"""Decide when the parts fly, from the most reliable data that show a window around td in which only gravity acts."""

from __future__ import annotations

from functools import partial
from math import isfinite, isinf
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.internal_energy import (
    find_settled_time,
    has_whole_motion,
    rises_as_it_yields,
)
from d2rpick.flight.window import (
    SHORTEST,
    explain_hole,
    find_all_windows,
    limit_to_unheld,
    limit_to_written_states,
    list_marks,
)
from d2rpick.histories.samples import find_hole_around, find_holes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.flight.contact_forces import Touches
    from d2rpick.flight.window import FreeFlight
    from d2rpick.histories.history import Balance, History, Momenta, Samples
    from d2rpick.histories.names import Part

# Why no flight is found, if the momentum excludes every flight.
NEVER_FLIES: Final = f"the momentum shows no free flight that lasts at least {SHORTEST:.0%} of the record"
_SURE: Final = ("given", "momentum", "oscillator")
BY_ENERGIES: Final = ("contact-energy", "energy-balance")
# Largest work of a load on the parts in a flight, relative to their internal energy [-].
# Such work changes the deformation by 2 %; smaller changes do not affect the ranking of pairs.
MOST_WORK: Final = 0.04
# Sources that cover the contacts of all parts. They must confirm each flight that a more reliable source shows.
_AGREEING: Final = ("contact-force", "contact-energy")
# Sources that may miss a load, because some forces are not written and fixed walls do no work.
_PARTIAL: Final = (*BY_ENERGIES, "contact-force")
# _SAME: the ends of two flights agree up to this difference, as a fraction of the flight [-].
# _SAME_STATES: they also agree up to this difference [output intervals].
_SAME, _SAME_STATES = 0.01, 3


class Flight(NamedTuple):
    """A window of free flight [time]; ``start`` is None if unknown, ``end`` is None if the data show no later contact.

    If td is not in a flight, this is the last flight before td or, if there is none, the first one after it, and
    ``refusal`` gives the reason. ``source`` is the evidence for the start, one of `SOURCES`. ``parts`` are the parts
    that fly together; None stands for the whole model. ``damping`` is the rate alpha at which their momentum decays
    [1/time]. ``gravity`` is the acceleration that is assumed to be gravity [length/time^2], see `FreeFlight`.
    ``doubts`` lists contradictions between sources.  For a flight from the energy alone, ``settled`` is the time when
    the energy had settled; the time from there to ``start`` is left unused for safety.  ``described`` is True if one
    oscillator describes the energy in the flight.  ``shows_contact`` is False if the user gave the end and the record
    shows that the parts fly on, so that the event at the end, such as an airbag that fires, is not in the record.
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
    shows_contact: bool = True

    def within(self, time: Samples) -> tuple[float, float]:
        """Return the window of the flight [time]; an unknown end is replaced by the end of the record at times (n,)."""
        first = float(time[0])
        last = float(time[-1])
        return (
            first if self.start is None else self.start,
            last if self.end is None else self.end,
        )

    @property
    def by_parts(self) -> bool:
        """Return True if part momenta show the flight, so that contacts between other parts do not matter."""
        return self.source == "momentum" and self.parts is not None

    @property
    def unknown_load(self) -> bool:
        """Return True if a load of unknown type acts in the flight: gravity, a pull or friction."""
        return self.source != "given" and not isfinite(self.gravity)

    @property
    def certain(self) -> bool:
        """Return True if the evidence excludes everything except a free flight.

        A fixed rigid wall does no work and has no contact energy.  Without the momentum, only an undisturbed vibration
        distinguishes a flight from a crash into such a wall.
        """
        if self.unknown_load or (self.source == "given" and self.doubts):
            return False
        return self.source in _SURE or (self.source in _PARTIAL and self.described)


def _explain_nothing(_: float) -> None:
    """Return None for every time; the default for ``explain_contradiction``."""


class Witness(NamedTuple):
    """A source of evidence for flights in a history, with times (n,), and the function that searches for a flight.

    If ``decisive`` is True, the source can exclude a flight at a time even if it shows no flight anywhere.
    ``explain_contradiction`` is called for a time at which only the momentum shows a flight, and returns how this
    source contradicts the flight, or None.
    """

    history: History
    source: str
    time: Samples
    search: Callable[[float], FreeFlight | None]
    decisive: bool
    explain_contradiction: Callable[[float], str | None] = _explain_nothing

    def around(self, moment: float) -> FreeFlight | None:
        """Return the flight around a time; each flight is searched for only once."""
        return _search_once(
            self.history, self.source, moment, search=self.search, time=self.time
        )

    def flights(self) -> tuple[FreeFlight, ...]:
        """Return all flights in ascending order; they are searched for only once."""
        return _list_flights(self.history, self.source, witness=self)

    def holding(self, td: float) -> FreeFlight | None:
        """Return the flight around td.

        The search starts from a fixed time within the flight if possible, otherwise from td.
        """
        return _find_flight_with_td(self.time, self.around, td)

    def counts(self) -> bool:
        """Return True if td is certainly in no flight whenever this source shows none."""
        return self.decisive or bool(self.flights())


@remember
def _search_once(
    history: History,
    source: str,
    moment: float,
    *,
    search: Callable[[float], FreeFlight | None],
    time: Samples,
) -> FreeFlight | None:
    """Return the flight around a time according to one source of evidence in a history."""
    flight = search(moment)
    holes = _list_holes(history, source, time=time)
    return flight and limit_to_written_states(flight, holes, moment)


@remember
def _list_holes(
    _: History, _source: str, *, time: Samples
) -> tuple[tuple[float, float], ...]:
    """Return the intervals without states of a source of evidence [time]."""
    return find_holes(time)


@remember
def _list_flights(
    _: History, _source: str, *, witness: Witness
) -> tuple[FreeFlight, ...]:
    """Return all flights that a source of evidence in a history shows, in ascending order."""
    find_flight = partial(_find_flight_from_middle, witness.time, witness.around)
    return find_all_windows(witness.time, find_flight)


def _find_flight_with_td(
    time: Samples, around: Callable[[float], FreeFlight | None], td: float
) -> FreeFlight | None:
    """Return the flight around ``td``.

    The search starts from a time shared by many td if possible, otherwise from td.
    """
    shared = filter(None, map(around, list_marks(time, td)))
    return next(
        (flight for flight in shared if flight.start <= td <= flight.end), None
    ) or around(td)


def _find_flight_from_middle(
    time: Samples, around: Callable[[float], FreeFlight | None], moment: float
) -> FreeFlight | None:
    """Return the flight around a time; search again from its middle to obtain the same flight as in the list."""
    flight = around(moment)
    if flight:
        of_middle = _find_flight_with_td(time, around, (flight.start + flight.end) / 2)
    else:
        of_middle = None
    if of_middle and of_middle.start <= moment <= of_middle.end:
        return of_middle
    return flight


class Seen(NamedTuple):
    """Evidence for a td: the flight around td, or the nearest flight and the reason why td is not in a flight.

    ``held`` is True if supports hold the parts; the parts then do not fly even if the user gives the end of the load.
    """

    flight: FreeFlight | None = None
    source: str | None = None
    refusal: str | None = None
    doubts: tuple[str, ...] = ()
    held: bool = False


def find_seen_flight(history: History, td: float) -> Seen:
    """Find the free flight around ``td`` [time] from all sources except the internal energy of the parts.

    The most reliable source that shows a flight is used. A more reliable source that shows no flight at td is never
    overruled, and neither is the contact energy. If two sources show different ends, the later start and the earlier
    end are used. Parts that are held at td do not fly, whatever the evidence; in a whole model, only the parts that no
    support holds may fly.
    """
    held = history.surroundings.held(history.parts, td)
    if held is None:
        return _find_flight_by_evidence(history, td)
    evidence = None if history.parts else _find_flight_by_evidence(history, td)
    if evidence and evidence.flight and evidence.flight.parts:
        return evidence
    return Seen(refusal=held, held=True)


def _find_flight_by_evidence(history: History, td: float) -> Seen:
    """Find the flight around ``td`` from all sources of evidence, without considering supports."""
    flights: list[tuple[str, FreeFlight]] = []
    for witness in list_witnesses(history):
        flight = witness.holding(td)
        if flight:
            flights.append((witness.source, flight))
        elif (not flights or _can_deny(witness, flights[0][1])) and witness.counts():
            refusal = _explain_refusal(witness, td)
            doubts = tuple(
                f"the {source} shows a flight there, but {refusal}"
                for source, _ in flights
            )
            return _find_nearest(witness, td, refusal, doubts)
    if not flights:
        return Seen()
    return _join_evidence(history, *flights)


def _explain_refusal(witness: Witness, td: float) -> str:
    """Return the reason why td [time] is not in a flight, even if the momentum alone shows a flight there."""
    hole = find_hole_around(find_holes(witness.time), td)
    if hole:
        return explain_hole(hole, td)
    contradiction = witness.explain_contradiction(td)
    if contradiction:
        return contradiction
    refusal = f"the {name_source(witness.source)} shows no free flight at td = {td:.6g}"
    hint = ""
    if witness.source == "momentum":
        hint = describe_hiding_digits(witness.history, td)
    return f"{refusal}; {hint}" if hint else refusal


def find_all_seen(history: History) -> tuple[tuple[str, FreeFlight], ...]:
    """Find all flights that the most reliable source shows and no other source contradicts, each with its source."""
    sources = list_witnesses(history)
    for rank, witness in enumerate(sources):
        confirmed_flights = []
        flights = witness.flights()
        for flight in flights:
            middle = (flight.start + flight.end) / 2
            may_deny = (
                later_witness
                for later_witness in sources[rank + 1 :]
                if _can_deny(later_witness, flight) and later_witness.counts()
            )
            other_flights = [
                (later_witness.source, later_witness.around(middle))
                for later_witness in may_deny
            ]
            if not all(other_flight for _, other_flight in other_flights):
                continue
            agreeing = [
                (witness.source, flight),
                *(
                    (source, other_flight)
                    for source, other_flight in other_flights
                    if other_flight
                ),
            ]
            confirmed = _join_evidence(history, *agreeing)
            if confirmed.flight and not confirmed.refusal:
                confirmed_flights.append((witness.source, confirmed.flight))
        if flights or witness.decisive:
            return tuple(confirmed_flights)
    return ()


def denies_every_flight(history: History) -> bool:
    """Return True if the momentum shows that the parts, or the model, have no long flight in the record."""
    return any(
        witness.source == "momentum" and witness.decisive and not witness.flights()
        for witness in list_witnesses(history)
    )


def describe_hiding_digits(history: History, td: float | None = None) -> str:
    """Return that the momentum may have too few digits to show a flight, around ``td`` if given; otherwise ""."""
    from d2rpick.flight import momentum

    for momenta in momentum.select_momenta_for_flight(history.momenta):
        digits = momentum.find_hiding_digits(momenta, td, history.balance)
        if digits is not None:
            count = f"{digits} significant digit{'s' * (digits != 1)}"
            return f"the {count} of the momentum may be too few to show a flight: write more digits"
    return ""


def _can_deny(witness: Witness, flight: FreeFlight) -> bool:
    """Return True if a source may contradict a flight that a more reliable source shows.

    If the momentum of the parts shows a flight, any contact acts between these parts or between other parts.
    """
    return witness.source in _AGREEING and flight.parts is None


@remember
def list_witnesses(history: History) -> tuple[Witness, ...]:
    """Return the sources of evidence for the flights in a history, from most to least reliable."""
    return tuple(_make_witnesses(history))


def _make_witnesses(history: History) -> Iterator[Witness]:
    """Compute the evidence for the flights in a history, from the most to the least reliable source."""
    if history.momenta:
        from d2rpick.flight import momentum

        momenta = momentum.select_momenta_for_flight(history.momenta)
        search = partial(_find_flight_by_momentum, history, momenta)
        decisive = any(momentum.can_deny_flight(candidate) for candidate in momenta)
        explain = partial(_explain_contradicted_momentum, history, momenta)
        yield Witness(history, "momentum", momenta[0].time, search, decisive, explain)
    forces = history.evidence.forces
    whole = history.find_momenta(of_parts=False)
    touches = None
    if forces:
        # Imported here to keep start-up fast.
        from d2rpick.flight.contact_forces import Touches

        touches = Touches.of(forces, whole)
    balance = history.balance
    is_better_known = bool(history.momenta)
    if touches is not None:
        search = partial(_find_flight_by_forces, history, touches)
        by_forces = Witness(
            history, "contact-force", touches.time, search, decisive=False
        )
        is_better_known = is_better_known or bool(by_forces.flights())
        yield by_forces
    if balance is None:
        return
    from d2rpick.flight import work

    if work.has_visible_contacts(balance):
        search = partial(
            _find_flight_by_energies,
            history,
            work.find_plateau,
            level=not is_better_known,
        )
        yield Witness(history, "contact-energy", balance.time, search, decisive=False)
    if work.has_laws(balance):
        search = partial(
            _find_flight_by_energies, history, work.find_balanced_window, level=True
        )
        is_decisive = balance.worked is not None
        yield Witness(history, "energy-balance", balance.time, search, is_decisive)


def _explain_contradicted_momentum(
    history: History, momenta: Sequence[Momenta], td: float
) -> str | None:
    """Return how the energies contradict a flight that only the momentum shows at ``td`` [time]; None if they agree."""
    from d2rpick.flight.momentum import find_flight_around

    flights = [
        find_flight_around(candidate, td, history.balance) for candidate in momenta
    ]
    flight = next(filter(None, flights), None)
    if flight is None:
        return None
    contradiction = (
        f"the momentum is that of free flight at td = {td:.6g}, but the internal "
        "energy is not that of a free vibration"
    )
    return (
        _explain_why_driven(history, "momentum", flight)
        or f"{contradiction}: parts of the model may touch each other, or the energies are wrong"
    )


def _find_flight_by_momentum(
    history: History, momenta: Sequence[Momenta], td: float
) -> FreeFlight | None:
    """Return the flight around ``td`` from the momentum of the parts or, if there is none, of the whole model."""
    from d2rpick.flight.momentum import find_flight_around

    for candidate in momenta:
        flight = find_flight_around(candidate, td, history.balance)
        if flight:
            flight = _limit_to_undriven(history, flight, td)
            if candidate.parts is not None or candidate.flying:
                return flight
            return _limit_to_level(history, flight, td, candidate)
    return None


def _limit_to_undriven(
    history: History, flight: FreeFlight, td: float
) -> FreeFlight | None:
    """Return the part of a flight, found by the momentum, during which no load does work; None if a load does at td.

    Opposite forces and weak forces may do work on the model although its momentum hardly shows them.
    """
    from d2rpick.flight.work import limit_to_undriven

    if not _explain_why_driven(history, "momentum", flight):
        return flight
    assert history.balance
    limited = limit_to_undriven(history.balance, flight, td)
    if limited is None or limited.end - limited.start < SHORTEST * history.duration:
        return None
    return None if _explain_why_driven(history, "momentum", limited) else limited


def _find_flight_by_energies(
    history: History,
    look: Callable[[Balance, float], FreeFlight | None],
    td: float,
    *,
    level: bool,
) -> FreeFlight | None:
    """Return the flight around td from energies; if ``level`` is True, the internal energy must stay on one level.

    Energies alone do not show a fixed wall, because it does no work.
    """
    assert history.balance
    flight = look(history.balance, td)
    if level:
        flight = _limit_to_level(history, flight, td)
        if (
            flight
            and isinf(flight.gravity)
            and history.surroundings.gravity_on(None) == (0.0,)
        ):
            # Without gravity, no load does work on a model in flight.
            return None
        if not (flight and has_whole_motion(history.balance, flight.start, flight.end)):
            flight = None
    return limit_to_unheld(history.surroundings, flight, history.parts, td)


def _find_flight_by_forces(
    history: History, touches: Touches, td: float
) -> FreeFlight | None:
    """Return the flight around td from contact forces, limited to a period with one energy level if the energy rises.

    Before the end of the first contact, a load of another kind may act, which only the external work shows.
    """
    # Imported here to keep start-up fast.
    from d2rpick.flight.contact_forces import is_deformed

    flight = touches.flight_around(td)
    balance = history.balance
    if (
        flight
        and flight.start <= touches.time[0]
        and (balance is None or balance.external_work is None)
    ):
        return None
    if flight and is_deformed(history, flight):
        flight = _limit_to_level(history, flight, td)
    if flight and balance and not has_whole_motion(balance, flight.start, flight.end):
        return None
    return limit_to_unheld(history.surroundings, flight, history.parts, td)


def _limit_to_level(
    history: History,
    flight: FreeFlight | None,
    td: float,
    momenta: Momenta | None = None,
) -> FreeFlight | None:
    """Limit a flight to the period in which the internal energy stays on one level; None if td is before that period.

    ``momenta`` are the momenta that show the flight.
    """
    if flight is None:
        return None
    balance = history.balance
    damped = None
    time = history.time
    energy = history.energy
    unseen = 0.0
    if (
        balance
        and balance.kinetic_and_internal is not None
        and balance.internal is not None
    ):
        from d2rpick.flight.work import list_damped_energies

        sums, unseen = list_damped_energies(balance, flight, momenta)
        if sums:
            damped = np.stack(
                [np.interp(time, balance.time, energy_sum) for energy_sum in sums]
            )
        else:
            damped = None
        # A load acts on the whole model, so the energy of single parts does not show it.
        if history.parts is not None or history.evidence.not_chosen:
            energy = np.interp(time, balance.time, balance.internal)
    start = find_settled_time(
        time,
        energy,
        damped,
        flight.start,
        flight.end,
        unseen,
        driven=isinf(flight.gravity),
    )
    if start is not None and start > flight.start and momenta is not None:
        # The first row contains the sum of energies with the work of gravity, the last row the sum without this work.
        whole = None if damped is None else damped[-1 if flight.gravity else 0]
        if rises_as_it_yields(time, energy, whole, flight.start, start, flight.end):
            start = flight.start
    shortest = SHORTEST * (time[-1] - time[0])
    if start is None or start > td or flight.end - start < shortest:
        return None
    if damped is not None and not flight.gravity:
        first, last = np.interp((flight.start, start), time, damped[0])
        if last - first > MOST_WORK * float(np.abs(energy).max()):
            return None  # Opposite forces may deform the model without changing its momentum.
    return flight._replace(start=start)


def _find_nearest(
    witness: Witness, td: float, refusal: str, doubts: tuple[str, ...]
) -> Seen:
    """For a td outside all flights, return the last flight before td if there is one, otherwise the next flight."""
    flights = witness.flights()
    earlier_flights = [flight for flight in flights if flight.end < td]
    nearest: FreeFlight | None = None
    if earlier_flights:
        nearest = earlier_flights[-1]
    elif flights:
        nearest = flights[0]
    return Seen(nearest, witness.source if nearest else None, refusal, doubts)


def name_source(source: str | None) -> str:
    """Return a phrase that names the data from which a flight was found."""
    return str(source).replace("-", " ")


@remember
def _join_evidence(history: History, *shown_flights: tuple[str, FreeFlight]) -> Seen:
    """Combine the flight of the best source with those of the sources that must confirm it, and note disagreements."""
    source, best = shown_flights[0]
    refusal = _explain_why_driven(history, source, best)
    if refusal:
        return Seen(refusal=refusal)
    start = best.start
    end = best.end
    end_seen = best.end_seen
    doubts = []
    room = get_agreement_limit(history, start, end)
    for other_source, flight in shown_flights[1:]:
        if other_source not in _AGREEING or best.parts is not None:
            continue
        if abs(flight.start - best.start) > room or abs(flight.end - best.end) > room:
            first_text, second_text = (
                f"{f.start:.6g} to {f.end:.6g} by the {name_source(n)}"
                for n, f in (shown_flights[0], (other_source, flight))
            )
            doubts.append(
                f"the flight lasts from {first_text}, from {second_text}; the later start and the earlier end are used"
            )
        if flight.end < end:
            end = flight.end
            end_seen = flight.end_seen
        start = max(start, flight.start)
    return Seen(
        best._replace(start=start, end=end, end_seen=end_seen),
        source,
        doubts=tuple(doubts),
    )


def get_agreement_limit(history: History, start: float, end: float) -> float:
    """Return the largest difference at which the ends of a flight in two sources agree [time]."""
    return max(_SAME * (end - start), _SAME_STATES * history.step)


def _explain_why_driven(
    history: History, source: str, flight: FreeFlight
) -> str | None:
    """Return the reason why a load drives a flight; None if no load does work, or if it acts on other parts only."""
    from d2rpick.flight.work import compute_work_beyond_gravity

    balance = history.balance
    if balance is None or (source == "momentum" and _is_subset(history, flight)):
        return None
    work = compute_work_beyond_gravity(balance, flight.start, flight.end)
    energy = history.mean_energy(flight.start, flight.end)
    if work is None or energy is None or work <= MOST_WORK * max(energy, 0.0):
        return None
    return (
        f"the {name_source(source)} shows a flight from {flight.start:.6g} to {flight.end:.6g}, but there the "
        f"external work beyond gravity and damping is {work:.3g} at a mean energy of {energy:.3g}: a load drives it"
    )


def _is_subset(history: History, flight: FreeFlight) -> bool:
    """Return True if only some of the model's moving parts fly."""
    momenta = history.find_momenta(of_parts=True)
    if momenta is None or momenta.parts is None or flight.parts is None:
        return False
    members = {part.id for part in flight.parts}
    moves = np.ptp(momenta.values, axis=0).any(axis=1)
    return any(
        part.id not in members
        for part, is_moving in zip(momenta.parts, moves, strict=True)
        if is_moving
    )
