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
from d2rpick.running.record import GrowingColumn, GrowingRecord, find_momenta
from d2rpick.running.witness import GrowingWitness, Quiet

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, History, Momenta, Samples
    from d2rpick.running.witness import Needed

# tr is good if the internal energy is at least this far from its minimum within one wait, as a share of its range.
# In computed runs a tr in a trough kept half of the energy that td should have, a tr at a peak at least 0.9 of it.
_HIGH: Final = 0.75
# Largest number of states before and in a flight from which gravity is determined.
_GRAVITY_STATES: Final = 1000


class GrowingEvidence:
    """Finds the time without force, and the flights, of the parts of a growing record."""

    def __init__(self) -> None:
        self._record = GrowingRecord()
        self._of_parts: list[GrowingWitness] = []
        self._of_model: list[GrowingWitness] = []  # has at most one item
        # The evidence that still grows for each set of parts, keyed by the indices of the parts.
        self._going_on: dict[tuple[int, ...], GrowingWitness] = {}
        self._first_momenta: Samples | None = None
        # For each state, the parts that have moved so far, and whether they have the complete momentum of the model.
        self._moved, self._complete = GrowingColumn(), GrowingColumn()
        self._largest_momentum = 0.0

    @property
    def history(self) -> History:
        """All states so far."""
        return self._record.history

    @property
    def witnesses(self) -> list[GrowingWitness]:
        """Evidence of each set of parts, and at last of the model if it has a momentum or contact energy."""
        return [*self._of_parts, *self._of_model]

    def take(self, states: History) -> None:
        """Append states, which must have the same quantities as the states so far."""
        self._record.add(states)
        of_model = find_momenta(states, of_parts=False)
        of_parts = find_momenta(states, of_parts=True)
        balance = states.balance
        if of_parts is not None:
            self._add_parts(of_parts, of_model, balance)
        self._add_model(of_model, balance)
        contact_precision = balance.precision if balance else EXACT
        for witness in self.witnesses:
            momenta = of_model if witness.parts is None else of_parts
            precision = momenta.precision if momenta else EXACT
            witness.follow(precision, contact_precision)

    def _add_parts(
        self, momenta: Momenta, of_model: Momenta | None, balance: Balance | None
    ) -> None:
        """Append part momenta to the evidence of all sets of parts that may fly together.

        The evidence of a set ends at a state at which the part momenta do not add up to the momentum of the model, as
        when a rigid body has absorbed some parts.
        """
        assert momenta.parts is not None
        are_complete = is_complete(momenta, of_model, self._largest_momentum)
        if of_model is not None:
            largest = float(np.abs(of_model.values).max(initial=0.0))
            self._largest_momentum = max(self._largest_momentum, largest)
        origin = self._complete.size
        moved = self._add_moved(momenta)
        self._complete.add(are_complete)
        part_numbers = range(len(momenta.parts))
        for stretch in find_stretches(are_complete):
            if stretch.start > 0:
                self._going_on.clear()
            for members in dict.fromkeys(_list_sets(momenta)):
                if members not in self._going_on:
                    self._begin(members, momenta, origin + stretch.start)
                other_parts = sorted({*part_numbers} - {*members})
                self._going_on[members].add(
                    time=momenta.time[stretch],
                    momentum=momenta.of(members)[stretch],
                    contact=_get_contact_energy(balance, momenta.time, stretch),
                    alone=np.asarray(~moved[stretch][:, other_parts].any(axis=1)),
                )
        if are_complete.size and not are_complete[-1]:
            self._going_on.clear()

    def _begin(self, members: tuple[int, ...], momenta: Momenta, origin: int) -> None:
        """Begin to collect evidence for a set of parts at a state."""
        assert momenta.parts is not None
        parts = tuple(momenta.parts[number] for number in members)
        witness = GrowingWitness(members, parts, origin)
        self._going_on[members] = witness
        self._of_parts.append(witness)

    def _add_moved(self, momenta: Momenta) -> NDArray[np.bool_]:
        """Record which parts have changed their momentum by each of these states, and return that, shape (k, parts)."""
        if self._first_momenta is None:
            self._first_momenta = momenta.values[0]
        moved = (momenta.values != self._first_momenta).any(axis=2)
        if self._moved.size:
            moved[0] |= self._moved.rows[-1]
        self._moved.add(np.logical_or.accumulate(moved, axis=0))
        return self._moved.rows[-len(moved) :]

    def alike(self, count: int) -> Iterator[tuple[slice, tuple[int, ...], bool]]:
        """Split the last ``count`` states wherever a part begins to move or momentum begins to be missing.

        Gives for each piece its states, the numbers of the parts that move, and whether the momenta are complete.
        """
        states = np.column_stack(
            [self._moved.rows[-count:], self._complete.rows[-count:]]
        )
        changes = 1 + np.flatnonzero((states[1:] != states[:-1]).any(axis=1))
        for begin, end in pairwise([0, *changes.tolist(), count]):
            *moved, are_complete = states[begin].tolist()
            moving = tuple(number for number, moves in enumerate(moved) if moves)
            yield slice(begin, end), moving, are_complete

    def _add_model(self, momenta: Momenta | None, balance: Balance | None) -> None:
        """Append the momentum and contact energy of the whole model to its evidence, if one of them is written."""
        members: tuple[int, ...] = ()
        momentum: Samples | None = None
        if momenta is not None:
            members = (0,)
            time, momentum = momenta.time, momenta.of(members)
        elif balance is not None and balance.sliding is not None:
            time = balance.time
        else:
            return
        if not self._of_model:
            self._of_model.append(GrowingWitness(members, None, 0))
        self._of_model[0].add(
            time=time,
            momentum=momentum,
            contact=_get_contact_energy(balance, time),
            alone=np.ones(time.size, np.bool_),
        )

    def flights(self, needed: Needed) -> tuple[Quiet, ...]:
        """Return all flights that were long enough, in ascending order; ``needed`` returns the wait at a state.

        As the run goes on, flights are only added, and the last one gets its ``end``.
        """
        for witness in self.witnesses:
            witness.look(needed, self._find_gravity)
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
        """Return the gravity between two states of some evidence, as `Laws.gravity`; None if a support holds parts.

        Only states up to the last one are used, and of a long record only some.
        """
        history = self.history
        if history.surroundings.held(history.parts, float(witness.time[last])):
            return None
        if not witness.members:
            return 0.0
        momenta = find_momenta(history, of_parts=witness.parts is not None)
        assert momenta is not None
        is_used = np.zeros(momenta.time.size, np.bool_)
        for begin, end in ((0, first), (first, last)):
            count = min(end - begin + 1, _GRAVITY_STATES)
            states = np.linspace(begin, end, count).round().astype(np.intp)
            is_used[witness.origin + states] = True
        so_far = select_states(momenta, is_used)
        if so_far.change(witness.members) <= so_far.noise(witness.members):
            return 0.0
        start = int(np.searchsorted(so_far.time, witness.time[first]))
        laws = get_laws_of(so_far, witness.members, history.balance)
        return laws.gravity(start, so_far.time.size - 1)

    def free_since(self, time: float) -> float:
        """Return when the force-free time that lasts up to a time began; without states, return that time itself."""
        starts = [time]
        for witness in self.witnesses:
            state = int(np.searchsorted(witness.time, time, side="right")) - 1
            if state >= 0 and time <= witness.time[-1]:
                starts.append(float(witness.time[witness.free[state]]))
        return min(starts)

    def pauses(self, since: float) -> tuple[tuple[float, float], ...]:
        """Return all force-free intervals that ended after ``since`` and were shorter than the wait."""
        if not self.witnesses:
            return ()
        going_on = [
            witness for witness in self.witnesses if witness in self._going_on.values()
        ]
        witness = going_on[0] if going_on else self.witnesses[-1]
        time = witness.time
        starts = time[np.array(witness.free, np.intp)]
        is_over = starts[1:] - starts[:-1] > (time[1:] - starts[:-1]) / 2
        ends = 1 + np.flatnonzero(is_over & (time[1:] > since))
        pauses = [(float(starts[end - 1]), float(time[end])) for end in ends.tolist()]
        flight_ends = {flight.end for flight in witness.flights}
        return tuple(pause for pause in pauses if pause[1] not in flight_ends)

    def contact_after(self, start: float, least: int = FEWEST) -> float | None:
        """Return the first state after ``start`` at which a force acts; None if no force does [time].

        No force acts at ``start``, as in a rigid leg that begins in flight.  A witness is used if it has at least
        ``least`` states from there on.
        """
        begin = max(start, float(self.history.time[0]))
        for witness in self.witnesses:
            first = int(np.searchsorted(witness.time, start))
            state_count = witness.time.size
            if witness.time[0] <= begin and first + least <= state_count:
                last = witness.last_without(first)
                at_end = last == state_count - 1
                return None if at_end else float(witness.time[last + 1])
        return None

    def rigid_times(self) -> tuple[tuple[float, float, float], ...]:
        """Return when rigid bodies had the part momenta: start, the state that shows it, and end [time].

        The last of these periods may last to the end of the record.
        """
        momenta = find_momenta(self.history, of_parts=True)
        if momenta is None:
            return ()
        time = momenta.time
        is_rigid = ~self._complete.rows.astype(np.bool_)
        return tuple(
            (
                float(time[stretch.start]),
                float(time[stretch.start + FEWEST - 1]),
                float(time[min(stretch.stop, time.size - 1)]),
            )
            for stretch in find_stretches(is_rigid, FEWEST)
        )


def highest_energy(history: History, start: float, end: float) -> float:
    """Return the last time from ``start`` to ``end`` at which the internal energy has its maximum [time]."""
    time, energy = history.between(start, end)
    return float(time[energy.size - 1 - int(np.argmax(energy[::-1]))])


def range_of_energy(
    history: History, now: float, wait: float
) -> tuple[float, float, float]:
    """Return the lowest and highest internal energy within the last wait, and the lowest energy that is good for tr."""
    energy = history.between(now - wait, now)[1]
    low, high = float(energy.min()), float(energy.max())
    return low, high, low + _HIGH * (high - low)


def _find_end(flight: Quiet, last_time: float, flights: Sequence[Quiet]) -> Quiet:
    """Return a flight whose own evidence ended at ``last_time`` with the end that other evidence shows."""
    if flight.end is not None:
        return flight
    ends = (
        other_flight.end
        for other_flight in flights
        if other_flight.end is not None
        and other_flight.start < last_time < other_flight.end
    )
    return flight._replace(end=next(ends, None))


def _get_contact_energy(
    balance: Balance | None, time: Samples, states: slice = slice(None)
) -> Samples | None:
    """Return the contact energy at the ``states`` of these times; None if the file does not contain it there."""
    if balance is None or balance.sliding is None or balance.time.size != time.size:
        return None
    return balance.sliding[states]


def _list_sets(momenta: Momenta) -> Iterator[tuple[int, ...]]:
    """Yield the sets of parts that may fly together: the chosen parts, these with all connected parts, and all parts.

    Parts are given by their numbers in the momenta.
    """
    assert momenta.parts is not None
    chosen = tuple(momenta.flying or momenta.chosen)
    yield chosen
    number_of_part = {part.id: number for number, part in enumerate(momenta.parts)}
    chosen_ids = {momenta.parts[number].id for number in chosen}
    joined_ids = {
        part_id
        for body in momenta.surroundings.bodies()
        if chosen_ids & {*body}
        for part_id in body
    }
    joined = {
        number_of_part[part_id] for part_id in joined_ids if part_id in number_of_part
    }
    yield tuple(sorted({*chosen, *joined}))
    yield tuple(range(momenta.values.shape[1]))
