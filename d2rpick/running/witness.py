"""At each state of a record, find how long the parts or the model have been free of forces, from the states so far.

In the force-free time, the momentum without the effects of gravity and damping is constant within 1e-4 of its largest
value so far. If no momentum is written, the contact energy must be constant instead. A flight is detected once this has
lasted for the waiting time, because a force that ends may act again: a car hit a block twice within 14 ms
(docs/reference/first-run.md).

As a flight goes on, a fading force may shift the detected start of the flight to slightly later times, whereas a
contact would shift it beyond the middle of the flight. Without gravity, the end of a force may look like damping, so
the force-free time may begin before this end. The flight then begins when the momentum itself is constant.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.flight.free_fall import FreeFall
from d2rpick.flight.window import FEWEST, TOLERANCE, VISIBLE, Constant, find_farthest
from d2rpick.running.record import GrowingColumn

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from d2rpick.flight.window import Law
    from d2rpick.histories.history import Precision, Samples
    from d2rpick.histories.names import Part
    from d2rpick.running.inner_motion import Wait

    # Returns the acceleration due to gravity between two states, or None if another force acts or parts are supported.
    FindGravity = Callable[["GrowingWitness", int, int], float | None]

# Changes of a momentum or contact energy up to this fraction of its largest value so far are treated as zero [-].
# CONSTANT is 10 times the error of single-precision sums.
CONSTANT: Final = 1e-4
# Time between two tests for a force, as a fraction of the force-free time so far [-].
_TEST_AGAIN: Final = 0.25
# Number of states of a long window that are compared with the law; few suffice, because a force has a lasting effect.
_MOST_COMPARED: Final = 128


class SeenFlight(NamedTuple):
    """A flight, i.e. a period without force that lasted for the required time.

    Attributes
    ----------
    start : float
        Start of the force-free time as determined at ``seen`` [time].
    seen : float
        Time of the state at which the waiting time was over [time].
    end : float or None
        Time of the first state at which a force acts [time]; None if the record ends before.
    wait : Wait
        Waiting time, i.e. the force-free time after which the flight was detected.
    quantity : str
        The quantity that shows the flight: "momentum less gravity" or "contact energy".
    left : float
        Change of the momentum or contact energy from ``start`` to ``seen``, relative to the largest value so far [-].
    gravity : float
        Acceleration, as in `FreeFlight`.
    parts : tuple of Part or None
        Parts that fly together; None stands for the whole model.
    level : float or None
        Time at which the centre of mass is again as high as at ``start`` [time]; None if this time is before ``seen``.
    """

    start: float
    seen: float
    end: float | None
    wait: Wait
    quantity: str
    left: float
    gravity: float = 0.0
    parts: tuple[Part, ...] | None = None
    level: float | None = None


class _SampledFall(FreeFall):
    """Comparison of the law of free fall with a sample of the states in a long window; no load passes for damping."""

    def _select_states(self, first: int, last: int) -> NDArray[np.intp]:
        count = min(last - first + 1, _MOST_COMPARED)
        return np.linspace(first, last, count).round().astype(np.intp)

    def _fitted(self, first: int, last: int) -> tuple[Samples, Samples, float]:
        p, impulse, alpha = super()._fitted(first, last)
        return p, impulse, min(alpha, self.limit_damping(first, last))


class GrowingWitness:
    """Finds the force-free time of the given parts, or of the whole model, at each state.

    Attributes
    ----------
    time : array of float
        Times of the states, shape (n,) [time].
    members : tuple of int
        Indices in the momenta of the parts that fly together; empty if only the contact energy is written.
    free : list of int
        For each state, the index of the first state of the force-free time that lasts up to this state.
    flights : list of SeenFlight
        Flights so far.
    pauses : list of (float, float)
        Start and end of each force-free time that ended before the waiting time was over [time].
    """

    def __init__(
        self, members: tuple[int, ...], parts: tuple[Part, ...] | None
    ) -> None:
        self.members = members
        self.parts = parts
        self.free: list[int] = []
        self.flights: list[SeenFlight] = []
        self.pauses: list[tuple[float, float]] = []
        self._columns = GrowingColumn()
        self.time: Samples = self._columns.rows
        self._laws: list[tuple[Law, Samples]] = []
        # True for each state whose printed digits are precise enough to show a force.
        self._shows_forces: NDArray[np.bool_] = np.empty(0, np.bool_)
        # Start of the force-free time that has lasted until the last examined state [time].
        self._start = 0.0
        self._examined_count = self._test_again_at = 0

    def add(
        self,
        columns: Samples,
        momentum_precision: Precision,
        contact_precision: Precision,
    ) -> None:
        """Append states, and find the force-free time at each of them.

        ``columns`` (k, 5) contains the time, the contact energy (NaN where it is not used), and the momentum vector.
        """
        self.time, contact, *_ = self._columns.add(columns).T
        momentum = self._columns.rows[:, 2:]
        self._laws = []
        is_used = ~np.isnan(contact)
        if is_used.any():
            energy = np.nan_to_num(contact)
            tolerance, self._shows_forces = _set_tolerance(energy, contact_precision)
            law = Constant(self.time, energy[:, np.newaxis])
            self._laws.append((law, np.where(is_used, tolerance, np.inf)))
        if self.members:
            largest = np.abs(momentum).max(axis=1)
            tolerance, self._shows_forces = _set_tolerance(
                largest, momentum_precision, len(self.members)
            )
            self._laws.append((_SampledFall(self.time, momentum), tolerance))
        first = self.free[-1] if self.free else 0
        for state in range(len(self.free), self.time.size):
            first = self._find_first_without_force(first, state)
            self.free.append(first)

    def misfit(self, first: int, last: int) -> float:
        """Return the ratio of the unexplained change between two states to its tolerance [-]; above 1, a force acts."""
        return max(
            law.misfit(first, last) / float(tolerance[last])
            for law, tolerance in self._laws
        )

    def is_constant(self, first: int, last: int) -> bool:
        """Return True if the momentum is constant between two states, so that not even gravity acts."""
        momentum, tolerance = self._get_momentum(first, last)
        return float(np.ptp(momentum, axis=0).max()) <= 2 * tolerance

    def moves(self, first: int, last: int) -> bool:
        """Return True if the parts are not at rest between two states."""
        momentum, tolerance = self._get_momentum(first, last)
        return float(np.abs(momentum).max()) > VISIBLE * tolerance

    def _get_momentum(self, first: int, last: int) -> tuple[Samples, float]:
        """Return the momenta from one state to another, and their tolerance at the last one."""
        momentum = self._columns.rows[first : last + 1, 2:]
        _, tolerance = self._laws[-1]
        return momentum, float(tolerance[last])

    def _find_first_without_force(self, earliest: int, last: int) -> int:
        """Return the first state from ``earliest`` on from which no force acts until the state ``last``."""
        if self.misfit(earliest, last) <= 1:
            return earliest
        return find_farthest(
            last, earliest, lambda first: self.misfit(first, last) <= 1
        )

    def examine(
        self,
        find_wait: Callable[[float, float], Wait | None],
        find_gravity: FindGravity,
    ) -> None:
        """Add the flights and the completed force-free times that the new states show.

        ``find_wait`` returns the waiting time for a flight that begins at one time, from the states up to a later time;
        None if it is unknown.
        """
        time = self.time
        for state in range(self._examined_count, len(self.free)):
            first = self.free[state]
            start = float(time[first])
            now = float(time[state])
            flies = bool(self.flights) and self.flights[-1].end is None
            earlier_start = self.flights[-1].start if flies else self._start
            if state > 0 and now - start < (now - earlier_start) / 2:
                if flies:
                    self.flights[-1] = self.flights[-1]._replace(end=now)
                else:
                    self.pauses.append((earlier_start, now))
                self._test_again_at = state
            elif (
                not flies
                and first + FEWEST <= state + 1
                and self._test_again_at <= state
                and self._shows_forces[state]
            ):
                wait = find_wait(start, now)
                if wait is not None and now - start >= wait.time:
                    self._see(first, state, wait, find_gravity)
            self._start = start
        self._examined_count = len(self.free)

    def _see(
        self, first: int, state: int, wait: Wait, find_gravity: FindGravity
    ) -> None:
        """Record a flight since ``first`` that is detected now; if another force acts, only schedule a new test."""
        gravity = find_gravity(self, first, state)
        if gravity is None:
            self._test_again_at = state + 1 + int(_TEST_AGAIN * (state - first))
            # In a flight without gravity, the force-free time may begin while a contact force is still fading.
            first = find_farthest(
                state, first, lambda earlier: self.is_constant(earlier, state)
            )
            has_lasted = self.time[state] - self.time[first] >= wait.time
            if has_lasted and first + FEWEST <= state + 1:
                gravity = find_gravity(self, first, state)
        if gravity is None:
            return
        self.flights.append(
            SeenFlight(
                start=float(self.time[first]),
                seen=float(self.time[state]),
                end=None,
                wait=wait,
                quantity="momentum less gravity" if self.members else "contact energy",
                left=CONSTANT * self.misfit(first, state),
                gravity=gravity,
                parts=self.parts,
                level=self._find_level(first, state) if gravity else None,
            )
        )

    def _find_level(self, first: int, last: int) -> float | None:
        """Return when the centre of mass is again as high as at ``first`` [time]; None if that is before ``last``."""
        rows = self._columns.rows
        start = rows[first, 0]
        now = rows[last, 0]
        momentum = rows[first, 2:]
        gained = rows[last, 2:] - momentum
        # For the momentum p and the weight G, the height is p t + G t^2/2 along G, which is 0 at t = -2 (p G)/(G G).
        time_to_level = -2 * (now - start) * (momentum @ gained) / (gained @ gained)
        level = float(start + time_to_level)
        return level if level > now else None


def _set_tolerance(
    values: Samples, precision: Precision, count: int = 1
) -> tuple[Samples, NDArray[np.bool_]]:
    """Return the tolerance of a sum of ``count`` values at each state, and whether it is small enough to show forces.

    ``values`` (n,) are the values of the sum.
    """
    largest_so_far = np.maximum.accumulate(np.abs(values))
    # Each of the values is rounded by up to half a unit of its last digit.
    rounding = count * precision.quanta(largest_so_far) / 2
    tolerance = CONSTANT * largest_so_far + rounding
    tolerance = np.maximum(tolerance, np.finfo(float).tiny)
    is_precise = rounding <= TOLERANCE * largest_so_far
    return tolerance, is_precise & (largest_so_far > 0)
