"""Find the flights of the given parts in a growing record.

Each result depends only on the states up to its time, not on when the record was read.  A growing record therefore
has the same flights as the finished one.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.flight.momentum import get_laws_of, is_complete
from d2rpick.flight.window import FEWEST
from d2rpick.histories.history import EXACT, select_states
from d2rpick.histories.samples import find_stretches, find_window
from d2rpick.running.inner_motion import InnerMotion, Wait
from d2rpick.running.record import GrowingColumn, RunningMaximum
from d2rpick.running.witness import GrowingWitness, SeenFlight

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.history import Balance, History, Momenta, Samples
    from d2rpick.histories.names import Part
    from d2rpick.running.inner_motion import MovingParts

# Largest number of states from which gravity is determined.
_GRAVITY_STATES: Final = 1000
# An internal energy below this fraction of the kinetic energy is round-off, which shows no vibration [-].
_ROUND_OFF: Final = 1e-6


class GrowingEvidence:
    """Finds the force-free time and the flights of the parts in a growing record.

    ``given`` is the waiting time that the user gave [time]. ``of_deck`` and ``before`` are those of `InnerMotion`.
    """

    history: History

    def __init__(
        self,
        given: float | None = None,
        of_deck: Wait | None = None,
        before: float = 0.0,
    ) -> None:
        self.given = given
        # Events of past flights, keyed by the start of the flight and the time at which it was detected.
        self.decided: dict[tuple[float, float], tuple[Any, ...]] = {}
        self.motion = InnerMotion(of_deck, before)
        # Evidence for each set of parts, and last for the model if its momentum or its contact energy is known.
        self.witnesses: list[GrowingWitness] = []
        # Evidence to which states are still appended, keyed by its parts; None is the key for the whole model.
        self._going_on: dict[tuple[Part, ...] | None, GrowingWitness] = {}
        self._first_momenta: Samples | None = None
        self._has_moved = RunningMaximum()
        self._largest_momentum = 0.0
        # True for each state at which the part momenta add up to the momentum of the model.
        self._complete = GrowingColumn()

    def take(self, states: History, history: History) -> None:
        """Append states with the same quantities as all earlier states; ``history`` contains all states."""
        self.history = history
        contact = states.balance
        if contact is not None and contact.sliding is None:
            contact = None
        of_model = states.find_momenta(of_parts=False)
        of_parts = states.find_momenta(of_parts=True)
        moving_parts: MovingParts = []
        if of_parts is not None and of_parts.time.size:
            moving_parts = self._add_parts(of_parts, of_model, contact)
        members = () if of_model is None else (0,)
        columns = _make_columns(members, of_model, contact)
        self._add(members, None, columns, (of_model, contact))
        self.motion.take(states, moving_parts, self.free_since)

    def _add_parts(
        self, momenta: Momenta, of_model: Momenta | None, contact: Balance | None
    ) -> MovingParts:
        """Append part momenta to the evidence for each set of parts that may fly together, and return the moving parts.

        The evidence of a set ends at a state at which the part momenta do not add up to the momentum of the model, for
        example because a rigid body has absorbed some parts.
        """
        assert momenta.parts is not None
        are_complete = is_complete(momenta, of_model, self._largest_momentum)
        if of_model is not None:
            largest = float(np.abs(of_model.values).max(initial=0.0))
            self._largest_momentum = max(self._largest_momentum, largest)
        self._complete.add(are_complete)
        if self._first_momenta is None:
            self._first_momenta = momenta.values[:1]
        changed = (momenta.values != self._first_momenta).any(axis=2)
        has_moved = self._has_moved.add(changed)
        for members in dict.fromkeys(_list_sets(momenta)):
            columns = _make_columns(members, momenta, contact)
            # The contact energy shows collisions between bodies, which do not change the total momentum.
            # Once other parts move, the contact energy includes their contacts and is no longer used.
            other_parts = np.delete(has_moved, members, axis=1)
            columns[other_parts.any(axis=1), 1] = np.nan
            columns[~are_complete, 2:] = np.nan
            parts = tuple(momenta.parts[number] for number in members)
            self._add(members, parts, columns, (momenta, contact))
        moves = has_moved & are_complete[:, np.newaxis]
        changes = 1 + np.flatnonzero((moves[1:] != moves[:-1]).any(axis=1))
        return [
            (slice(begin, end), np.flatnonzero(moves[begin]).tolist())
            for begin, end in pairwise([0, *changes.tolist(), len(moves)])
        ]

    def _add(
        self,
        members: tuple[int, ...],
        parts: tuple[Part, ...] | None,
        columns: Samples,
        written: tuple[Momenta | None, Balance | None],
    ) -> None:
        """Append states to the evidence for a set of parts; after states without momentum, begin the evidence anew.

        ``columns`` are the columns that `GrowingWitness.add` needs, from the ``written`` momenta and energies.
        """
        precisions = [table.precision if table else EXACT for table in written]
        has_momentum = ~np.isnan(columns[:, 2])
        for stretch in find_stretches(has_momentum):
            if stretch.start > 0 or parts not in self._going_on:
                new_witness = GrowingWitness(members, parts)
                self._going_on[parts] = new_witness
                self.witnesses.append(new_witness)
                # The evidence for the model is the last.
                self.witnesses.sort(key=lambda witness: witness.parts is None)
            self._going_on[parts].add(columns[stretch], *precisions)
        if not has_momentum[-1:].all():
            self._going_on.pop(parts, None)

    def flights(self) -> tuple[SeenFlight, ...]:
        """Return all flights that lasted for the required force-free time, in ascending order.

        As the run proceeds, flights are only added, and the last flight gets its ``end``.
        """
        candidates: list[tuple[SeenFlight, float]] = []
        for witness in self.witnesses:
            witness.examine(self.find_wait, self._find_gravity)
            last_time = float(witness.time[-1])
            candidates += [(flight, last_time) for flight in witness.flights]
        # If the parts and the model show a flight at the same state, the flight of the parts comes first.
        candidates.sort(key=lambda pair: pair[0].seen)
        chosen: list[SeenFlight] = []
        for flight, last_time in candidates:
            last_end = chosen[-1].end if chosen else -np.inf
            if last_end is None or flight.seen <= last_end:
                continue
            if flight.end is None:
                # The evidence of the parts may end during the flight, e.g. when the parts become rigid.
                ends = (
                    longer.end
                    for longer, _ in candidates
                    if longer.end and longer.start < last_time < longer.end
                )
                flight = flight._replace(end=next(ends, None))
            chosen.append(flight)
        return tuple(chosen)

    def find_wait(self, start: float, now: float) -> Wait | None:
        """Return the waiting time for a flight since ``start``, from the states up to ``now``; None if unknown."""
        longest = self.motion.longest(now)
        if self.given is not None:
            reason = "as given"
            if longest is not None and longest.time > self.given:
                reason = f"as given, but a longer half cycle is known: {longest.reason}"
            return Wait(self.given, "given", reason)
        first_times = self.history.time[:FEWEST]
        begins_free = first_times.size == FEWEST and start <= first_times[-1]
        if begins_free and self._stores_no_energy(start, now):
            reason = f"nothing vibrates: {FEWEST} states are enough"
            return Wait(float(np.ptp(first_times)), "at-rest", reason)
        return None if self.motion.is_unfinished(now) else longest

    def _stores_no_energy(self, start: float, now: float) -> bool:
        """Return True if the internal energy in a time span is only a rounding error of the kinetic energy."""
        history = self.history
        _, energy = history.between(start, now)
        internal = np.abs(energy).max()
        balance = history.balance
        kinetic = 0.0
        if balance is not None and balance.kinetic is not None:
            inside = find_window(balance.time, start, now)
            kinetic = balance.kinetic[inside].max(initial=0.0)
        return bool(internal <= _ROUND_OFF * kinetic)

    def _find_gravity(
        self, witness: GrowingWitness, first: int, last: int
    ) -> float | None:
        """Return the gravity between two states, as `Laws.gravity` does; None if a support holds parts.

        No later states are used, and only some of the states of a long record.
        """
        history = self.history
        if history.surroundings.held(history.parts, float(witness.time[last])):
            return None
        if not witness.members:
            return 0.0
        momenta = history.find_momenta(of_parts=witness.parts is not None)
        assert momenta is not None
        begin = int(np.searchsorted(momenta.time, witness.time[0]))
        start = begin + first
        end = begin + last
        states = [*_sample_states(begin, start), *_sample_states(start + 1, end)]
        so_far = select_states(momenta, np.array(states, np.intp))
        laws = get_laws_of(so_far, witness.members, history.balance)
        if witness.is_constant(first, last):
            # A fit to a constant momentum would give a false gravity.
            flies = witness.moves(first, last) and not laws.is_carried
            return 0.0 if flies else None
        return laws.gravity(states.index(start), len(states) - 1)

    def free_since(self, time: float) -> float:
        """Return the start of the force-free interval that ends at a given time; without states, return this time."""
        starts = [time]
        for witness in self.witnesses:
            state = int(np.searchsorted(witness.time, time, side="right")) - 1
            if state < 0 or time > witness.time[-1]:
                continue
            first = witness.free[state]
            starts.append(float(witness.time[first]))
        return min(starts)

    def pauses(self, since: float) -> tuple[tuple[float, float], ...]:
        """Return all force-free times that ended after ``since`` but were not detected as flights [time]."""
        for witness in self.witnesses:
            if self._going_on.get(witness.parts) is witness:
                return tuple(pause for pause in witness.pauses if pause[1] > since)
        return ()

    def find_contact(self, fewest: int = FEWEST) -> float | None:
        """Return the time of the first state at which a force acts [time]; None if no force acts.

        A witness is used if it covers at least ``fewest`` states, beginning with the first state of the record.
        """
        for witness in self.witnesses:
            begins = witness.time[0] <= self.history.time[0]
            if begins and witness.time.size >= fewest:
                contacts = witness.time[np.array(witness.free) > 0].tolist()
                return contacts[0] if contacts else None
        return None

    def find_rigid_times(self) -> Iterator[tuple[float, ...]]:
        """Yield the periods in which the part momenta were those of rigid bodies, as (start, detection, end) [time].

        The last period may extend to the end of the record.
        """
        momenta = self.history.find_momenta(of_parts=True)
        for stretch in find_stretches(self._complete.rows == 0, FEWEST):
            assert momenta is not None
            end = min(stretch.stop, momenta.time.size - 1)
            states = [stretch.start, stretch.start + FEWEST - 1, end]
            yield tuple(momenta.time[states].tolist())


def _sample_states(first: int, last: int) -> Samples:
    """Return the states from ``first`` to ``last``, or evenly spaced states among them if there are too many."""
    return np.linspace(first, last, min(last - first + 1, _GRAVITY_STATES)).round()


def _make_columns(
    members: Sequence[int], momenta: Momenta | None, contact: Balance | None
) -> Samples:
    """Return time, contact energy and momentum as columns (k, 5); an energy that is not written is NaN.

    The momentum is the sum over the ``members`` (part indices), or zero if there are none.
    """
    table = momenta or contact
    if table is None:
        return np.empty((0, 5))
    columns = np.full((table.time.size, 5), np.nan)
    columns[:, 0] = table.time
    if contact is not None and contact.time.size == table.time.size:
        columns[:, 1] = contact.sliding
    columns[:, 2:] = momenta.of(members) if momenta else 0.0
    return columns


def _list_sets(momenta: Momenta) -> tuple[tuple[int, ...], ...]:
    """Return the sets of parts that may fly together: the chosen parts with all connected parts, and all parts.

    Parts are represented by their indices in the momenta.
    """
    assert momenta.parts is not None
    ids = [part.id for part in momenta.parts]
    joined = {ids[number] for number in momenta.flying or momenta.chosen}
    for body in momenta.surroundings.bodies():
        if not joined.isdisjoint(body):
            joined.update(body)
    body_numbers = tuple(number for number, part in enumerate(ids) if part in joined)
    return body_numbers, tuple(range(len(ids)))
