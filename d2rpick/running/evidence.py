"""When a record that grows shows a flight of some parts: each answer rests on the states up to it.

As no answer asks when somebody looked, those of a record that grows are those of the finished one.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.flight.momentum import complete, laws_of
from d2rpick.flight.window import FEWEST
from d2rpick.histories.history import EXACT, rows_of
from d2rpick.histories.samples import stretches
from d2rpick.running.record import Column, GrowingRecord
from d2rpick.running.witness import Quiet, Witness

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, History, Momenta, Samples
    from d2rpick.running.witness import Needed

# A switch is good where the internal energy is this share of the way from the lowest to the highest of one wait: in a
# trough of computed runs the energy after td was half of what it should be, from a peak 0.9 of it and more.
_HIGH: Final = 0.75
# States before a flight, and in it, that tell whether it is gravity that acts.
_TOLD: Final = 1000


class Evidence:
    """Since when no force has acted on the parts of a record that grows, and the flights that were seen in it."""

    def __init__(self) -> None:
        self._record = GrowingRecord()
        self._witnesses: dict[bool, list[Witness]] = {
            True: [],
            False: [],
        }  # of parts; of the whole model
        self._going_on: dict[
            tuple[int, ...], Witness
        ] = {}  # by their members, of parts
        self._at_first: Samples | None = None
        self._moved, self._complete = (
            Column(),
            Column(),
        )  # by state: of each part; of all, as against the whole model
        self._largest = 0.0

    @property
    def history(self) -> History:
        """All states so far."""
        return self._record.history

    @property
    def witnesses(self) -> list[Witness]:
        """Those of parts first, then that of the whole model, of which there is one where anything is written."""
        return [*self._witnesses[True], *self._witnesses[False]]

    def take(self, states: History) -> None:
        """Append states that follow those so far; HistoryError where they hold other quantities."""
        self._record.add(states)
        whole = next((one for one in states.momenta if one.parts is None), None)
        for momenta in states.momenta:
            if momenta.parts is not None:
                self._add_parts(momenta, whole, states.balance)
        self._add_whole(whole, states.balance)
        of_contact = states.balance.precision if states.balance else EXACT
        for witness in self.witnesses:
            own = next(
                (
                    one
                    for one in states.momenta
                    if (one.parts is None) is (witness.parts is None)
                ),
                None,
            )
            witness.follow(own.precision if own else EXACT, of_contact)

    def _add_parts(
        self, momenta: Momenta, whole: Momenta | None, balance: Balance | None
    ) -> None:
        """Append momenta of parts to the witnesses of sets that may fly; those end where they are not believed."""
        believed = complete(momenta, whole, self._largest)
        if whole is not None:
            self._largest = max(
                self._largest, float(np.abs(whole.values).max(initial=0.0))
            )
        before, moved = self._complete.size, self._moving(momenta)
        self._complete.add(believed)
        assert momenta.parts is not None
        for stretch in stretches(believed):
            if stretch.start > 0:
                self._going_on.clear()
            for members in dict.fromkeys(_sets(momenta)):
                if members not in self._going_on:
                    flying = tuple(momenta.parts[i] for i in members)
                    self._going_on[members] = Witness(
                        members, flying, before + stretch.start
                    )
                    self._witnesses[True].append(self._going_on[members])
                others = sorted({*range(len(momenta.parts))} - {*members})
                self._going_on[members].add(
                    time=momenta.time[stretch],
                    momentum=momenta.of(members)[stretch],
                    contact=_contact(balance, momenta.time, stretch),
                    alone=np.asarray(~moved[stretch][:, others].any(axis=1)),
                )
        if believed.size and not believed[-1]:
            self._going_on.clear()

    def _moving(self, momenta: Momenta) -> NDArray[np.bool_]:
        """Which parts have changed their momentum up to each of these states, shape (k, parts)."""
        if self._at_first is None:
            self._at_first = momenta.values[0]
        moved = (momenta.values != self._at_first).any(axis=2)
        if self._moved.size:
            moved[0] |= self._moved.rows[-1]
        self._moved.add(np.logical_or.accumulate(moved, axis=0))
        return self._moved.rows[-len(moved) :]

    def alike(self, count: int) -> Iterator[tuple[slice, tuple[int, ...], bool]]:
        """Give the last so many states in pieces: in each the same parts have moved, and are believed or not."""
        states = np.column_stack(
            [self._moved.rows[-count:], self._complete.rows[-count:]]
        )
        changes = 1 + np.flatnonzero((states[1:] != states[:-1]).any(axis=1))
        for begin, end in pairwise([0, *changes.tolist(), count]):
            *moved, believed = states[begin].tolist()
            yield (
                slice(begin, end),
                tuple(i for i, one in enumerate(moved) if one),
                believed,
            )

    def _add_whole(self, whole: Momenta | None, balance: Balance | None) -> None:
        """Append what is written of the whole model; the energy of its contacts alone where it has no momentum."""
        if whole is None and (balance is None or balance.sliding is None):
            return
        if not self._witnesses[False]:
            self._witnesses[False].append(
                Witness(() if whole is None else (0,), None, 0)
            )
        (witness,) = self._witnesses[False]
        time = (
            balance.time
            if whole is None and balance
            else whole.time
            if whole
            else np.empty(0)
        )
        momentum = None if whole is None else whole.of((0,))
        witness.add(
            time=time,
            momentum=momentum,
            contact=_contact(balance, time),
            alone=np.ones(time.size, np.bool_),
        )

    def flights(self, needed: Needed) -> tuple[Quiet, ...]:
        """Give all times without force that lasted for a wait, ascending; what is ``needed`` is asked of each state.

        As long as the run goes on the answer only grows, but for the ``end`` of its last member.
        """
        for witness in self.witnesses:
            witness.look(needed, self._gravity)
        seen = [
            (one, float(witness.time[-1]))
            for witness in self.witnesses
            for one in witness.flights
        ]
        kept: list[Quiet] = []
        for one, reach in sorted(seen, key=lambda pair: pair[0].seen):
            if not kept or (kept[-1].end is not None and one.seen > kept[-1].end):
                kept.append(_going_on(one, reach, [other for other, _ in seen]))
        return tuple(kept)

    def _gravity(self, witness: Witness, first: int, last: int) -> float | None:
        """Gravity between two states, as of `Laws.gravity`, by what was written up to then; None where parts are held.

        Of a long record some of the states are enough.
        """
        history, now = self.history, float(witness.time[last])
        if history.surroundings.held(history.parts, now):
            return None
        if not witness.members:
            return 0.0
        momenta = next(
            one
            for one in history.momenta
            if (one.parts is None) is (witness.parts is None)
        )
        states = np.zeros(momenta.time.size, np.bool_)
        for begin, end in ((0, first), (first, last)):
            count = min(end - begin + 1, _TOLD)
            states[
                witness.origin + np.linspace(begin, end, count).round().astype(np.intp)
            ] = True
        so_far = rows_of(momenta, states)
        if so_far.change(witness.members) <= so_far.noise(witness.members):
            return 0.0
        begin = int(np.searchsorted(so_far.time, witness.time[first]))
        return laws_of(so_far, witness.members, history.balance).gravity(
            begin, so_far.time.size - 1
        )

    def free_since(self, time: float) -> float:
        """Since when nothing had acted at a ``time``, by the states up to it; the time itself where no state tells."""
        found = [time]
        for one in self.witnesses:
            state = int(np.searchsorted(one.time, time, side="right")) - 1
            if state >= 0 and time <= one.time[-1]:
                found.append(float(one.time[one.free[state]]))
        return min(found)

    def pauses(self, since: float) -> tuple[tuple[float, float], ...]:
        """Give from when to when nothing acted in what ended after a time, but for flights: too short for the wait."""
        if not self.witnesses:
            return ()
        best = next(
            (one for one in self.witnesses if one in self._going_on.values()),
            self.witnesses[-1],
        )
        time, starts = best.time, best.time[np.array(best.free, np.intp)]
        over = 1 + np.flatnonzero(
            (starts[1:] - starts[:-1] > (time[1:] - starts[:-1]) / 2)
            & (time[1:] > since)
        )
        found = [
            (float(starts[state - 1]), float(time[state])) for state in over.tolist()
        ]
        seen = [one.end for one in best.flights]
        return tuple(one for one in found if one[1] not in seen)

    def contact_after(self, start: float, least: int = FEWEST) -> float | None:
        """Give the first state after ``start`` at which a force acts that did not then; None where none does [time].

        Nothing acts at ``start``, as in a rigid leg that begins in flight; ``least`` states from there on tell it.
        """
        begin = max(start, float(self.history.time[0]))
        for one in self.witnesses:
            first = int(np.searchsorted(one.time, start))
            if one.time[0] <= begin and first + least <= one.time.size:
                last = one.last_without(first)
                return None if last == one.time.size - 1 else float(one.time[last + 1])
        return None

    def rigid_times(self) -> tuple[tuple[float, float, float], ...]:
        """Give the times in which a rigid body has taken momenta of parts: start, when that was seen, end [time].

        Those that go on end with the record.
        """
        time = next(
            (one.time for one in self.history.momenta if one.parts is not None),
            np.empty(0),
        )
        return tuple(
            (
                float(time[at.start]),
                float(time[at.start + FEWEST - 1]),
                float(time[min(at.stop, time.size - 1)]),
            )
            for at in stretches(~self._complete.rows.astype(np.bool_), FEWEST)
        )


def quiet_times(history: History, needed: Needed) -> tuple[Quiet, ...]:
    """Find all times without force that lasted for a wait, ascending, as `Evidence.flights`."""
    evidence = Evidence()
    evidence.take(history)
    return evidence.flights(needed)


def highest_energy(history: History, start: float, end: float) -> float:
    """Give the state from ``start`` to ``end`` with the highest internal energy, tr without td [time].

    The later of two alike: it is never shorter of the end of a load.
    """
    time, energy = history.between(start, end)
    return float(time[energy.size - 1 - int(np.argmax(energy[::-1]))])


def range_of_energy(
    history: History, now: float, wait: float
) -> tuple[float, float, float]:
    """Give the lowest and the highest internal energy within the last wait, and from which one on tr is good."""
    energy = history.between(now - wait, now)[1]
    low, high = float(energy.min()), float(energy.max())
    return low, high, low + _HIGH * (high - low)


def _going_on(one: Quiet, reach: float, found: Sequence[Quiet]) -> Quiet:
    """Let another witness tell how a flight ends that was followed to ``reach``, from where parts are not believed."""
    if one.end is not None:
        return one
    after = (q.end for q in found if q.end is not None and q.start < reach < q.end)
    return one._replace(end=next(after, None))


def _contact(
    balance: Balance | None, time: Samples, states: slice = slice(None)
) -> Samples | None:
    """Energy of all contacts at these times; None where it is not written there."""
    if balance is None or balance.sliding is None or balance.time.size != time.size:
        return None
    return balance.sliding[states]


def _sets(momenta: Momenta) -> Iterator[tuple[int, ...]]:
    """Give sets of parts that may fly together: those asked for, what hangs on them by the deck, all."""
    assert momenta.parts is not None
    chosen = tuple(momenta.flying or momenta.chosen)
    yield chosen
    number = {part.id: place for place, part in enumerate(momenta.parts)}
    own = {momenta.parts[i].id for i in chosen}
    hung = {
        part for body in momenta.surroundings.bodies() if own & {*body} for part in body
    }
    yield tuple(sorted({*chosen, *(number[part] for part in hung if part in number)}))
    yield tuple(range(momenta.values.shape[1]))
