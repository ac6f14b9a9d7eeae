"""When no force acts, as far as a record tells so far: each answer rests on the states up to it, and on no later one.

The momentum less gravity and damping is constant within 1e-4 of its largest value so far; where none is written, the
energy of the contacts is.  A force that ends is not seen to have ended for good before a wait is over: in a car that
hit a block twice, nothing acted for 14 ms between the two (docs/first-run.md, "The wait").
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.free_fall import FreeFall
from d2rpick.flight.momentum import believed, complete, laws_of
from d2rpick.flight.window import FEWEST, TOLERANCE, Constant, farthest
from d2rpick.histories.history import rows_of
from d2rpick.histories.samples import stretches

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from d2rpick.flight.window import Law
    from d2rpick.histories.history import Balance, History, Momenta, Precision, Samples
    from d2rpick.histories.names import Part

    # Wait [time] by what was written up to now, without force since a start: (start, now); None: not known yet.
    Needed = Callable[[float, float], float | None]

# Of the largest momentum, or contact energy, so far: single precision adds up to a tenth of it.
CONSTANT: Final = 1e-4
# A state at which a force was taken for another one than gravity is tried again after so much of the time before it.
_AGAIN: Final = 0.25


class Quiet(NamedTuple):
    """Time without force: ``start``, ``seen`` when the ``wait`` was over, ``end``: the first state with a force [time].

    ``end`` is None where the record ends before.  ``source`` is "momentum" or "contact-energy"; ``left`` what changes
    from ``start`` to ``seen``, as a share of the largest value so far; ``gravity`` as of `FreeFlight`; ``parts`` are
    those that fly together, None for the whole model; ``level``: when the centre of mass is as high again as at
    ``start`` [time], None where that was over when the flight was seen.
    """

    start: float
    seen: float
    end: float | None
    wait: float
    source: str
    left: float
    gravity: float = 0.0
    parts: tuple[Part, ...] | None = None
    level: float | None = None


class _Witness:
    """What shows a force: laws over the same ``time`` (n,), and what each may leave at each state (n,).

    ``members`` of ``momenta`` fly together; None where the contact energy is all that tells.
    """

    def __init__(
        self, laws: Sequence[tuple[Law, Samples]], momenta: Momenta | None = None, members: tuple[int, ...] = ()
    ) -> None:
        self.time, self.momenta, self.members = laws[0][0].time, momenta, members
        self._laws = laws

    def left(self, first: int, last: int) -> float:
        """What is left between two states, as a share of what may be."""
        return max(law.misfit(first, last) / float(room[max(first, last)]) for law, room in self._laws)

    def last_without(self, first: int) -> int:
        """Last state up to which, from ``first`` on, no force shows."""
        return farthest(first, self.time.size - 1, lambda last: self.left(first, last) <= 1)

    def first_without(self, last: int, least: int) -> int:
        """First state, not before ``least``, from which no force shows up to ``last``."""
        return farthest(last, least, lambda first: self.left(first, last) <= 1)

    def stretches(self) -> Iterator[tuple[int, int]]:
        """First and last states between which no force shows."""
        first, end = 0, self.time.size - 1
        while first + FEWEST <= self.time.size:
            last = self.last_without(first)
            yield first, last
            if last == end:
                return
            first = self.first_without(last + 1, first)

    def gravity(self, first: int, last: int, balance: Balance | None) -> float | None:
        """Gravity between two states, as of `Laws.gravity`, by what was written up to then."""
        if self.momenta is None:
            return 0.0
        so_far = rows_of(self.momenta, slice(0, last + 1))
        if so_far.change(self.members) <= so_far.noise(self.members):
            return 0.0
        return laws_of(so_far, self.members, balance).gravity(first, last)

    def level(self, first: int, last: int) -> float | None:
        """When the centre of mass is as high again as at the first of two states [time]; None where it was before."""
        if self.momenta is None:
            return None
        begin, end = self.momenta.of(self.members)[[first, last]]
        pulled, lasted = end - begin, float(self.time[last] - self.time[first])
        risen = -2 * lasted * float(begin @ pulled) / float(pulled @ pulled)
        return float(self.time[first]) + risen if risen > lasted else None


def quiet_times(history: History, needed: Needed) -> tuple[Quiet, ...]:
    """Find all times without force that lasted for a wait, ascending.

    What is found up to a state rests on what was written up to it: as long as the run goes on the answer only grows,
    but for the ``end`` of its last member.
    """
    found = [
        (one, float(witness.time[-1])) for witness in _witnesses(history) for one in _quiet(history, witness, needed)
    ]
    kept: list[Quiet] = []
    for one, reach in sorted(found, key=lambda q: q[0].seen):
        if not kept or (kept[-1].end is not None and one.seen > kept[-1].end):
            kept.append(_going_on(one, reach, [other for other, _ in found]))
    return tuple(kept)


def times_without_force(history: History) -> Iterator[tuple[float, float]]:
    """Give from when to when no force shows, or a constant one, however short that is [time]."""
    for one in _witnesses(history):
        yield from ((float(one.time[first]), float(one.time[last])) for first, last in one.stretches())


def _going_on(one: Quiet, reach: float, found: Sequence[Quiet]) -> Quiet:
    """Let another witness tell how a flight ends that was followed to ``reach``, from where parts are not believed."""
    if one.end is not None:
        return one
    after = (q.end for q in found if q.end is not None and q.start < reach < q.end)
    return one._replace(end=next(after, None))


def contact_after(history: History, start: float, least: int = FEWEST) -> float | None:
    """Give the first state after ``start`` at which a force acts that did not then; None where none does [time].

    Nothing acts at ``start``, as in a rigid leg that begins in flight; ``least`` states are asked for from there on.
    """
    for one in _witnesses(history):
        first = int(np.searchsorted(one.time, start))
        if first + least <= one.time.size:
            last = one.last_without(first)
            return None if last == one.time.size - 1 else float(one.time[last + 1])
    return None


def highest_energy(history: History, start: float, end: float) -> float:
    """Give the state from ``start`` to ``end`` with the highest internal energy, tr without td [time].

    The later of two alike: it is never shorter of the end of a load.
    """
    time, energy = history.between(start, end)
    return float(time[energy.size - 1 - int(np.argmax(energy[::-1]))])


def _quiet(history: History, witness: _Witness, needed: Needed) -> Iterator[Quiet]:
    for first, last in witness.stretches():
        if found := _seen(history, witness, needed, first, last):
            yield found


def _seen(history: History, witness: _Witness, needed: Needed, first: int, last: int) -> Quiet | None:
    """Look at the states from ``first`` to ``last``, between which the law holds, for one at which a wait is over."""
    time, state = witness.time, first + FEWEST - 1
    start = float(time[first])
    while state <= last:
        now = float(time[state])
        wait = needed(start, now)
        if wait is None or now - start < wait:
            state += 1
            continue
        held = history.surroundings.held(history.parts, now)
        gravity = None if held else witness.gravity(first, state, history.balance)
        if gravity is not None:
            momenta, end = witness.momenta, float(time[last + 1]) if last < time.size - 1 else None
            parts = momenta.parts and tuple(momenta.parts[i] for i in witness.members) if momenta else None
            source, left = "momentum" if momenta else "contact-energy", CONSTANT * witness.left(first, state)
            level = witness.level(first, state) if gravity else None
            return Quiet(start, now, end, wait, source, left, gravity, parts, level)
        state += 1 + int(_AGAIN * (state - first))
    return None


def _witnesses(history: History) -> Iterator[_Witness]:
    contact, some = _contact(history.balance), False
    for momenta, members in _flying(history):
        values = momenta.of(members)
        room = _room(np.abs(values).max(axis=1), momenta.precision, len(members))
        if room is not None:
            some = True
            every = contact is not None and {*momenta.moving} <= {*members} and contact[1].size == momenta.time.size
            fall = FreeFall(momenta.time, values), room
            yield _Witness([fall, contact] if every and contact else [fall], momenta, members)
    if contact and not some:
        yield _Witness([contact])


def _contact(balance: Balance | None) -> tuple[Law, Samples] | None:
    """Let the energy of all contacts be constant; None where there is none."""
    if balance is None or balance.sliding is None or not balance.sliding.any():
        return None
    room = _room(np.abs(balance.sliding), balance.precision)
    return None if room is None else (Constant(balance.time, balance.sliding[:, np.newaxis]), room)


def _room(sizes: Samples, precision: Precision, number: int = 1) -> Samples | None:
    """What may be left at each state of a sum of so many values of some ``sizes`` (n,); None where digits hide more."""
    largest = np.maximum.accumulate(sizes)
    noise = number * precision.quanta(largest) / 2
    tells = noise[-1] <= TOLERANCE * largest[-1] > 0
    return np.maximum(CONSTANT * largest + noise, np.finfo(float).tiny) if tells else None


def _flying(history: History) -> Iterator[tuple[Momenta, tuple[int, ...]]]:
    """Give momenta, and whose of them may be those of a body that flies, best first.

    Tried are the parts asked for, what hangs on them by the deck, all that move, and the whole model.
    """
    whole = next((one for one in history.momenta if one.parts is None), None)
    for one in history.momenta:
        if one.parts is None:
            yield one, (0,)
            continue
        sets = dict.fromkeys(_sets(one))
        for stretch in believed(one, whole):
            yield from ((rows_of(one, stretch), members) for members in sets)


def _sets(momenta: Momenta) -> Iterator[tuple[int, ...]]:
    assert momenta.parts is not None
    chosen = tuple(momenta.flying or momenta.chosen)
    yield chosen
    number = {part.id: place for place, part in enumerate(momenta.parts)}
    own = {momenta.parts[i].id for i in chosen}
    hung = {part for body in momenta.surroundings.bodies() if own & {*body} for part in body}
    yield tuple(sorted({*chosen, *(number[part] for part in hung if part in number)}))
    yield tuple(range(momenta.values.shape[1]))


def rigid_times(history: History) -> tuple[tuple[float, float, float], ...]:
    """Give the times in which a rigid body has taken momenta of parts: start, when that was seen, end [time].

    Those that go on end with the record.
    """
    whole = next((one for one in history.momenta if one.parts is None), None)
    return tuple(
        (
            float(one.time[at.start]),
            float(one.time[at.start + FEWEST - 1]),
            float(one.time[min(at.stop, one.time.size - 1)]),
        )
        for one in history.momenta
        if one.parts is not None
        for at in stretches(~complete(one, whole), FEWEST)
    )
