"""Find the flights of given parts in a growing record.

Each result depends only on the states up to its time, not on when the record was read.  A growing record therefore
has the same flights as the finished one.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.momentum import get_laws_of, is_complete
from d2rpick.flight.window import FEWEST
from d2rpick.histories.history import EXACT, select_states
from d2rpick.histories.samples import find_stretches
from d2rpick.running.inner_motion import InnerMotion
from d2rpick.running.record import (
    GrowingColumn,
    GrowingRecord,
    RunningMaximum,
)
from d2rpick.running.witness import GrowingWitness, Quiet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, History, Momenta, Samples
    from d2rpick.histories.names import Part
    from d2rpick.running.inner_motion import Wait

# Largest number of states from which gravity is determined.
_GRAVITY_STATES: Final = 1000


class GrowingEvidence:
    """Finds the force-free time and the flights of the parts of a growing record.

    ``given``, ``of_deck`` and ``before`` are those of its inner ``motion``.
    """

    def __init__(
        self,
        given: float | None = None,
        of_deck: Wait | None = None,
        before: float = 0.0,
    ) -> None:
        self.motion = InnerMotion(self, given, of_deck, before)
        self._record = GrowingRecord()
        self._witnesses: list[GrowingWitness] = []
        # Evidence that still grows, keyed by the momentum columns of its parts; the key of the whole model is None.
        self._going_on: dict[tuple[int, ...] | None, GrowingWitness] = {}
        self._first_momenta: Samples | None = None
        self._has_moved = RunningMaximum()
        # True for each state at which the part momenta add up to the momentum of the model.
        self._complete = GrowingColumn()
        self._largest_momentum = 0.0
        self.moving: list[tuple[slice, tuple[int, ...]]] = []

    @property
    def history(self) -> History:
        """All states read so far."""
        return self._record.history

    @property
    def witnesses(self) -> list[GrowingWitness]:
        """Evidence for each set of parts, followed by that for the model if its momentum or contact energy is known."""
        return sorted(self._witnesses, key=_is_of_model)

    def take(self, states: History) -> None:
        """Append states, which must have the same quantities as the states so far."""
        self._record.add(states)
        balance = states.balance
        of_model = states.find_momenta(of_parts=False)
        of_parts = states.find_momenta(of_parts=True)
        self.moving = []
        if of_parts is not None and of_parts.time.size:
            self._add_parts(of_parts, of_model, balance)
        if of_model is not None:
            columns = _make_columns(of_model.time, of_model.of((0,)), balance)
            self._add((0,), None, columns, (of_model, balance))
        elif balance is not None and balance.sliding is not None:
            motionless = np.zeros((balance.time.size, 3))
            columns = _make_columns(balance.time, motionless, balance)
            self._add((), None, columns, (None, balance))
        self.motion.take(states)

    def _add_parts(
        self, momenta: Momenta, of_model: Momenta | None, balance: Balance | None
    ) -> None:
        """Append part momenta to the evidence for all sets of parts that may fly together.

        The evidence of a set ends at a state at which the part momenta do not add up to the momentum of the model, as
        when a rigid body has absorbed some parts.
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
        moves = has_moved & are_complete[:, np.newaxis]
        changes = 1 + np.flatnonzero((moves[1:] != moves[:-1]).any(axis=1))
        for begin, end in pairwise([0, *changes.tolist(), len(moves)]):
            numbers = tuple(np.flatnonzero(moves[begin]).tolist())
            self.moving.append((slice(begin, end), numbers))
        for members in dict.fromkeys(_list_sets(momenta)):
            columns = _make_columns(momenta.time, momenta.of(members), balance)
            # Contact energy shows collisions between bodies, which do not change the total momentum.
            # Once other parts move, the contact energy includes their contacts, and is no longer used.
            other_parts = sorted({*range(len(momenta.parts))} - {*members})
            columns[has_moved[:, other_parts].any(axis=1), 1] = np.nan
            parts = tuple(momenta.parts[number] for number in members)
            self._add(members, parts, columns, (momenta, balance), are_complete)

    def _add(
        self,
        members: tuple[int, ...],
        parts: tuple[Part, ...] | None,
        columns: Samples,
        written: tuple[Momenta | None, Balance | None],
        is_used: NDArray[np.bool_] | None = None,
    ) -> None:
        """Append states to the evidence for a set of parts; after unusable states, the evidence starts again.

        ``columns`` are those of `GrowingWitness.add`, from the ``written`` momenta and energies.
        """
        key = None if parts is None else members
        used = np.ones(len(columns), np.bool_) if is_used is None else is_used
        precisions = [table.precision if table else EXACT for table in written]
        for stretch in find_stretches(used):
            if stretch.start > 0 or key not in self._going_on:
                self._going_on[key] = GrowingWitness(members, parts)
                self._witnesses.append(self._going_on[key])
            self._going_on[key].add(columns[stretch], *precisions)
        if used.size and not used[-1]:
            self._going_on.pop(key, None)

    def flights(self) -> tuple[Quiet, ...]:
        """Return all flights that lasted for their required force-free time, in ascending order.

        As the run goes on, flights are only added, and the last one gets its ``end``.
        """
        for witness in self.witnesses:
            witness.examine(self.motion.wait, self._find_gravity)
        candidates = [
            (flight, float(witness.time[-1]))
            for witness in self.witnesses
            for flight in witness.flights
        ]
        all_flights = [flight for flight, _ in candidates]
        chosen: list[Quiet] = []
        for flight, last_time in sorted(candidates, key=lambda pair: pair[0].seen):
            last_end = chosen[-1].end if chosen else -np.inf
            if last_end is not None and flight.seen > last_end:
                chosen.append(_find_end(flight, last_time, all_flights))
        return tuple(chosen)

    def _find_gravity(
        self, witness: GrowingWitness, first: int, last: int
    ) -> float | None:
        """Return the gravity between two states as `Laws.gravity` returns it; None if a support holds parts.

        Only states up to the last one are used, and of a long record only some.
        """
        history = self.history
        if history.surroundings.held(history.parts, float(witness.time[last])):
            return None
        if not witness.members:
            return 0.0
        momenta = history.find_momenta(of_parts=witness.parts is not None)
        assert momenta is not None
        times = witness.time[[0, first, last]]
        begin, start, end = np.searchsorted(momenta.time, times).tolist()
        states = [*_sample_states(begin, start), *_sample_states(start + 1, end)]
        so_far = select_states(momenta, np.array(states, np.intp))
        if so_far.change(witness.members) <= so_far.noise(witness.members):
            return 0.0  # For a constant momentum, a fit would treat rounding errors as gravity.
        laws = get_laws_of(so_far, witness.members, history.balance)
        return laws.gravity(states.index(start), len(states) - 1)

    def free_since(self, time: float) -> float:
        """Return the start of the force-free time that lasts up to a time; if there are no states, return that time."""
        starts = [time]
        for witness in self._witnesses:
            state = int(np.searchsorted(witness.time, time, side="right")) - 1
            if state >= 0 and time <= witness.time[-1]:
                starts.append(float(witness.time[witness.free[state]]))
        return min(starts)

    def pauses(self, since: float) -> tuple[tuple[float, float], ...]:
        """Return all force-free times that ended after ``since`` without being detected as flights [time]."""
        for witness in sorted(self._going_on.values(), key=_is_of_model):
            return tuple(pause for pause in witness.pauses if pause[1] > since)
        return ()

    def find_contact(self, fewest: int = FEWEST) -> float | None:
        """Return the time of the first state at which a force acts [time]; None if no force acts.

        A witness is used if it has at least ``fewest`` states from the first one of the record on.
        """
        for witness in self.witnesses:
            begins = witness.time[0] <= self.history.time[0]
            if begins and witness.time.size >= fewest:
                contacts = witness.time[np.array(witness.free) > 0].tolist()
                return contacts[0] if contacts else None
        return None

    def find_rigid_times(self) -> list[tuple[float, float, float]]:
        """Return the periods in which the part momenta were those of rigid bodies: start, detection and end [time].

        The last of these periods may last to the end of the record.
        """
        momenta = self.history.find_momenta(of_parts=True)
        if momenta is None:
            return []
        rigid_times = []
        for stretch in find_stretches(self._complete.rows == 0, FEWEST):
            end = min(stretch.stop, momenta.time.size - 1)
            states = [stretch.start, stretch.start + FEWEST - 1, end]
            rigid_times.append(tuple(momenta.time[states].tolist()))
        return rigid_times


def highest_energy(history: History, start: float, end: float) -> float:
    """Return the last time from ``start`` to ``end`` at which the internal energy has its maximum [time]."""
    time, energy = history.between(start, end)
    return float(time[energy.size - 1 - int(np.argmax(energy[::-1]))])


def _find_end(flight: Quiet, last_time: float, flights: Sequence[Quiet]) -> Quiet:
    """Return a flight that its own data show up to ``last_time``, with the end that other data show."""
    if flight.end is not None:
        return flight
    ends = (
        other_flight.end
        for other_flight in flights
        if other_flight.end is not None
        and other_flight.start < last_time < other_flight.end
    )
    return flight._replace(end=next(ends, None))


def _is_of_model(witness: GrowingWitness) -> bool:
    """Return True if the evidence concerns the whole model; such evidence is used after the evidence for parts."""
    return witness.parts is None


def _sample_states(first: int, last: int) -> Samples:
    """Return the states from ``first`` to ``last``; if there are too many, a uniform selection of them."""
    return np.linspace(first, last, min(last - first + 1, _GRAVITY_STATES)).round()


def _make_columns(time: Samples, momentum: Samples, balance: Balance | None) -> Samples:
    """Return time, contact energy and momentum as columns (k, 5); the energy is NaN if it is not written."""
    contact = np.full(time.size, np.nan)
    if (
        balance is not None
        and balance.sliding is not None
        and balance.time.size == time.size
    ):
        contact = balance.sliding
    return np.column_stack([time, contact, momentum])


def _list_sets(momenta: Momenta) -> tuple[tuple[int, ...], ...]:
    """Return the sets of parts that may fly together: the chosen parts with all connected parts, and all parts.

    Parts are given by their numbers in the momenta.
    """
    assert momenta.parts is not None
    ids = [part.id for part in momenta.parts]
    joined = {ids[number] for number in momenta.flying or momenta.chosen}
    bodies = [{*body} for body in momenta.surroundings.bodies()]
    joined = joined.union(*(body for body in bodies if body & joined))
    body_numbers = tuple(number for number, part in enumerate(ids) if part in joined)
    return body_numbers, tuple(range(len(ids)))
