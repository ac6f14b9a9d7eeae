"""Since when has nothing acted on some parts, or on the whole model?  Answered at each state, by the states up to it.

From the time that is the answer on, the momentum less gravity and damping is constant within 1e-4 of its largest value
so far; where none is written, the energy of the contacts is.  It is a flight when that has lasted for a wait: a force
that ends may come back, in a car that hit a block twice after 14 ms (docs/reference/first-run.md).

What is left of a push that dies away makes the answer a little later as the flight goes on.  A contact makes it later
than the middle of what the flight was.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from d2rpick.flight.free_fall import FreeFall
from d2rpick.flight.window import FEWEST, TOLERANCE, Constant, farthest
from d2rpick.running.record import Column

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from d2rpick.flight.window import Law
    from d2rpick.histories.history import Precision, Samples
    from d2rpick.histories.names import Part

    # Wait [time] by what was written up to now, without force since a start: (start, now); None: not known yet.
    Needed = Callable[[float, float], float | None]

# Of the largest momentum, or contact energy, so far: single precision adds up to a tenth of it.
CONSTANT: Final = 1e-4
# A state at which a force was taken for another one than gravity is tried again after so much of the time before it.
_AGAIN: Final = 0.25
# States of a long stretch that are held against the law: what acts changes the momentum for good.
_HELD: Final = 128


class Quiet(NamedTuple):
    """Time without force: ``start``, ``seen`` when the ``wait`` was over, ``end``: the first state with a force [time].

    ``start`` is what was known at ``seen``.  ``end`` is None where the record ends before.  ``source`` is "momentum" or
    "contact-energy"; ``left`` what changes from ``start`` to ``seen``, as a share of the largest value so far;
    ``gravity`` as of `FreeFlight`; ``parts`` are those that fly together, None for the whole model; ``level``: when the
    centre of mass is as high again as at ``start`` [time], None where that was over when the flight was seen.
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


class _Fall(FreeFall):
    """The law of free fall, held against some of the states of a long window."""

    def _fitted(self, first: int, last: int) -> tuple[Samples, Samples, float]:
        if last - first <= _HELD:
            return super()._fitted(first, last)
        states = np.linspace(first, last, _HELD).round().astype(np.intp)
        thinned = FreeFall.__new__(FreeFall)
        thinned.time, thinned.momentum, thinned._both = (
            self.time[states],
            self.momentum[states],
            self._both[states],
        )
        return thinned._fitted(0, _HELD - 1)


class Witness:
    """What shows a force on some parts, or on the whole model, in neighbouring states of a record.

    ``members`` of the momenta fly together; none where the energy of the contacts is all that tells.  ``origin`` is the
    place of its first state among those of the record.
    """

    def __init__(
        self, members: tuple[int, ...], parts: tuple[Part, ...] | None, origin: int
    ) -> None:
        self.members, self.parts, self.origin = members, parts, origin
        self.free: list[
            int
        ] = []  # by state: the first of those from which on no force shows up to it
        self.flights: list[Quiet] = []
        self.tells = np.empty(
            0, np.bool_
        )  # whether digits let a momentum, or contact energy, show a force
        self._columns = {
            name: Column() for name in ("time", "momentum", "contact", "alone")
        }
        self._looked = self._again = 0

    @property
    def time(self) -> Samples:
        """Times of the states, shape (n,) [time]."""
        return self._columns["time"].rows

    def add(self, **rows: NDArray[Any] | None) -> None:
        """Append states: time, momentum (k, 3), energy of all contacts (k,), and whether nothing else has moved."""
        for name, values in rows.items():
            if values is not None:
                self._columns[name].add(values)

    def follow(self, of_momentum: Precision, of_contact: Precision) -> None:
        """Ask of each new state since when nothing has acted, with the precisions of what is written."""
        self._laws: list[tuple[Law, Samples]] = []
        contact, momentum = (
            self._columns["contact"].rows,
            self._columns["momentum"].rows,
        )
        if contact.size == self.time.size:
            room, self.tells = _room(np.abs(contact), of_contact)
            # two bodies that hit each other keep their momentum; what is not among the members may do as it likes
            alone = self._columns["alone"].rows
            self._laws.append(
                (
                    Constant(self.time, contact[:, np.newaxis]),
                    np.where(alone, room, np.inf),
                )
            )
        if self.members:
            room, self.tells = _room(
                np.abs(momentum).max(axis=1), of_momentum, len(self.members)
            )
            self._laws.append((_Fall(self.time, momentum), room))
        first = self.free[-1] if self.free else 0
        for state in range(len(self.free), self.time.size):
            first = self._first_without(state, first)
            self.free.append(first)

    def left(self, first: int, last: int) -> float:
        """What is left between two states, as a share of what may be."""
        return max(
            law.misfit(first, last) / float(room[last]) for law, room in self._laws
        )

    def last_without(self, first: int) -> int:
        """Last state up to which, from ``first`` on, no force shows."""
        return farthest(
            first, self.time.size - 1, lambda last: self.left(first, last) <= 1
        )

    def _first_without(self, last: int, first: int) -> int:
        """First state from ``first`` on from which no force shows up to ``last``: near by, then farther and farther."""
        if self.left(first, last) <= 1:
            return first
        acts, step = first, 1
        while self.left(min(acts + step, last), last) > 1:
            acts, step = acts + step, 2 * step
        good = min(acts + step, last)
        while good - acts > 1:
            middle = (acts + good) // 2
            if self.left(middle, last) <= 1:
                good = middle
            else:
                acts = middle
        return good

    def look(
        self, needed: Needed, flies: Callable[[Witness, int, int], float | None]
    ) -> None:
        """Find what flights began and ended in the states that are new.

        ``flies`` gives the gravity between two states, None where what acts there is no gravity or something holds.
        """
        for state in range(self._looked, len(self.free)):
            first, now = self.free[state], float(self.time[state])
            start = float(self.time[first])
            last = self.flights[-1] if self.flights else None
            if last is not None and last.end is None:
                if now - start < max(last.wait, now - last.start) / 2:
                    self.flights[-1] = last._replace(end=now)
                    self._again = state
            elif (
                first + FEWEST <= state + 1
                and self._again <= state
                and self.tells[state]
            ):
                wait = needed(start, now)
                if wait is not None and now - start >= wait:
                    self._see(first, state, wait, flies(self, first, state))
        self._looked = len(self.free)

    def _see(self, first: int, state: int, wait: float, gravity: float | None) -> None:
        if gravity is None:
            self._again = state + 1 + int(_AGAIN * (state - first))
            return
        start, now = float(self.time[first]), float(self.time[state])
        source = "momentum" if self.members else "contact-energy"
        level = self._level(first, state) if gravity else None
        left = CONSTANT * self.left(first, state)
        self.flights.append(
            Quiet(start, now, None, wait, source, left, gravity, self.parts, level)
        )

    def _level(self, first: int, last: int) -> float | None:
        """When the centre of mass is as high again as at the first of two states [time]; None where it was before."""
        begin, end = self._columns["momentum"].rows[[first, last]]
        pulled, lasted = end - begin, float(self.time[last] - self.time[first])
        risen = -2 * lasted * float(begin @ pulled) / float(pulled @ pulled)
        return float(self.time[first]) + risen if risen > lasted else None


def _room(
    sizes: Samples, precision: Precision, number: int = 1
) -> tuple[Samples, NDArray[np.bool_]]:
    """What may be left at each state of a sum of so many values of some ``sizes`` (n,), and whether that tells any."""
    largest = np.maximum.accumulate(sizes)
    noise = number * precision.quanta(largest) / 2
    return (
        np.maximum(CONSTANT * largest + noise, np.finfo(float).tiny),
        (noise <= TOLERANCE * largest) & (largest > 0),
    )
