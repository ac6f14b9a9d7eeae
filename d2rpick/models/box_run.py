"""Compute runs of the box model, with or without rigid windows, make histories of them, and scan over tr."""

from __future__ import annotations

from itertools import pairwise
from time import perf_counter
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import RangeError
from d2rpick.base.workers import choose_farm, count_cores
from d2rpick.histories.history import EXACT, Given, History, Momenta, Track
from d2rpick.histories.names import Part
from d2rpick.models.box_motion import BoxMotion

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from d2rpick.models.box_model import Parameters, Plane, Values


PARTS: Final = ("box", "step")
BOX: Final = 0
_REALS, _PLANES = 12, 4
# Number of states whose results are computed at once, because numpy calls for single states would be slow.
_BLOCK: Final = 256

# Default output interval [s], which gives 25 states per period of a 400 Hz mode.
INTERVAL = 1e-4
# Largest number of time steps, which take minutes to compute; a request for more is probably a mistake.
MOST_STEPS = 5_000_000
# _FINE: interval between the tr values of a scan while the load may still act [s].
# _COARSE: interval between the tr values during the flight [s]; it gives six values per energy period of 25 ms.
# _LAST: time before td during which no tr is tried [s].
_FINE, _COARSE, _LAST = 0.003, 0.004, 0.03


class Record(NamedTuple):
    """States of a run at the times ``time`` (n,) in SI units; vectors are complex numbers x + i z.

    Columns of the box are its ``centre`` of mass and its ``velocity`` (n,), the forward ``roll`` since time 0 [rad],
    ``omega`` from the angular momentum [rad/s], and the ``outline`` (n, points). Columns of the box and the step, (n,
    2), are ``internal_energy``, ``kinetic_energy`` and ``momentum``; ``mass`` is that of both. Columns of the whole
    model since time 0, (n,), are ``external_work``, ``friction_energy``, ``wall_energy``, ``damping_energy`` and
    ``lost_energy`` at tr. ``landings`` are the intervals with ground contact, and ``released`` is the last time before
    them at which the sled exerted a force, None if it never did. ``dt`` is the time step [s]; ``bar_updates`` and
    ``seconds`` are the cost of the run.

    The friction energy corresponds to the contact energy that a solver reports. Floor, curb and ground are softer than
    the box and deform by centimetres. A solver would model them as rigid walls, springs or separate parts, so the
    energy that they store and that the cushion dissipates is not part of the contact energy.
    """

    time: Values
    centre: Plane
    velocity: Plane
    roll: Values
    omega: Values
    internal_energy: Values
    kinetic_energy: Values
    momentum: Plane
    external_work: Values
    friction_energy: Values
    wall_energy: Values
    damping_energy: Values
    lost_energy: Values
    outline: Plane
    mass: float
    released: float | None
    landings: tuple[tuple[float, float], ...]
    dt: float
    bar_updates: int
    seconds: float

    @property
    def landed(self) -> float | None:
        """Time of the first contact force from the ground [s]; None if the box does not touch the ground."""
        return self.landings[0][0] if self.landings else None

    @property
    def total_energy(self) -> Values:
        """Sum of current and dissipated energy, shape (n,) [J]; like a solver, it omits the energy lost at tr."""
        present = self.internal_energy.sum(axis=1) + self.kinetic_energy.sum(axis=1)
        return np.asarray(
            present + self.friction_energy + self.wall_energy + self.damping_energy
        )

    @property
    def energy_ratio(self) -> Values:
        """Ratio of the total energy to the initial energy plus external work, shape (n,) [-]; 1 if both are 0."""
        reference = self.total_energy[0] + self.external_work - self.external_work[0]
        ratios = 1 + 0 * reference
        np.divide(self.total_energy, reference, out=ratios, where=reference != 0)
        return np.asarray(ratios)

    @property
    def imbalance(self) -> Values:
        """Error of the energy balance as a fraction of the largest total energy, shape (n,) [-]."""
        total = self.total_energy + self.lost_energy
        error = total - total[0] - self.external_work + self.external_work[0]
        return np.asarray(error / np.abs(total).max())


class Recorder:
    """Collects the states of a ``motion`` up to its time step ``last``."""

    def __init__(self, motion: BoxMotion, last: int) -> None:
        self._motion = motion
        self._began = perf_counter()
        self._updates = _count_updates(motion)
        s = motion.structure
        first_state = -(-motion.count // motion.every)
        state_count = last // motion.every - first_state + 1
        self._reals = np.zeros((state_count, _REALS))
        self._planes = np.zeros((state_count, _PLANES), dtype=np.complex128)
        self._outline = np.zeros((state_count, s.of_box // 2), dtype=np.complex128)
        self._next = 0
        self._box_masses = s.masses[: s.of_box]
        self._box_mass = float(self._box_masses.sum())
        self._start = self._box_masses * self._arms(s.places)
        # States of the current block, from which the results are computed together.
        block_shape = (_BLOCK, s.places.size)
        self._places = np.zeros(block_shape, dtype=np.complex128)
        self._means = np.zeros(block_shape, dtype=np.complex128)
        self._rests = [
            np.zeros((_BLOCK, bars.rest.size)) for bars in (motion.box, motion.step)
        ]

    def note(self, mean: Plane) -> None:
        """Store the state of the motion, with the mean velocities ``mean`` (n,) over the time step around it [m/s]."""
        motion = self._motion
        accounts = self._motion.accounts
        at = self._next % _BLOCK
        self._places[at] = motion.places
        self._means[at] = mean
        rests_of_box, rests_of_step = self._rests
        rests_of_box[at] = motion.box.rest
        rests_of_step[at] = motion.step.rest
        self._reals[self._next] = (
            motion.time, 0.0, 0.0, motion.box.plastic_work, motion.step.plastic_work, 0.0, 0.0, accounts.external_work,
            accounts.friction, accounts.walls, accounts.damping, accounts.lost,
        )  # fmt: skip
        self._next += 1
        if at == _BLOCK - 1:
            self._work_out()

    def _work_out(self) -> None:
        """Compute the results of the states that were stored after the last complete block."""
        count = (self._next - 1) % _BLOCK + 1
        states = slice(self._next - count, self._next)
        s = self._motion.structure
        n = s.of_box
        positions = self._places[:count]
        means = self._means[:count]
        momenta = s.masses * means
        momenta_in_box = momenta[:, :n]
        momentum_of_box = momenta_in_box.sum(axis=1)
        momentum_of_step = momenta[:, n:].sum(axis=1)
        kinetic = (np.conj(means) * momenta).real / 2
        arms = self._arms(positions)
        # conj(a) b is the scalar product of the vectors a and b, plus i times their cross product.
        angular_momentum = (np.conj(arms) * momenta_in_box).imag.sum(axis=1)
        inertia = np.abs(arms) ** 2 @ self._box_masses
        # The rows are those that `record` reads: time, roll, angular velocity, and energies.
        reals = self._reals[states].T
        reals[1] = np.angle(np.conj(arms) @ self._start)
        reals[2] = -angular_momentum / inertia
        trusses = zip((self._motion.box, self._motion.step), self._rests, strict=True)
        for row, (bars, rest) in enumerate(trusses, start=3):
            reals[row] = bars.internal_energy(positions, rest[:count], reals[row])
        reals[5] = kinetic[:, :n].sum(axis=1)
        reals[6] = kinetic[:, n:].sum(axis=1)
        centre = positions[:, 0] - arms[:, 0]
        velocity = momentum_of_box / self._box_mass
        self._planes[states] = np.stack(
            [centre, velocity, momentum_of_box, momentum_of_step], axis=1
        )
        self._outline[states] = positions[:, : n // 2]

    def record(self) -> Record:
        """Return the collected states; raise RangeError if a number is not finite."""
        if self._next % _BLOCK:
            self._work_out()
        motion = self._motion
        real = self._reals.T
        plane = self._planes.T
        if not (np.isfinite(real).all() and np.isfinite(plane).all()):
            raise RangeError(
                "the motion of the box becomes infinite: these parameters are beyond what the model can do"
            )
        exchanged = (
            "external_work",
            "friction_energy",
            "wall_energy",
            "damping_energy",
            "lost_energy",
        )
        return Record(
            time=real[0],
            centre=plane[0],
            velocity=plane[1],
            roll=np.unwrap(real[1]),
            omega=real[2],
            internal_energy=real[3:5].T,
            kinetic_energy=real[5:7].T,
            momentum=plane[2:4].T,
            **dict(zip(exchanged, real[7:], strict=True)),
            outline=self._outline,
            mass=float(motion.structure.masses.sum()),
            released=motion.contact.released,
            landings=tuple(motion.contact.landings),
            dt=motion.dt,
            bar_updates=_count_updates(motion) - self._updates,
            seconds=perf_counter() - self._began,
        )

    def _arms(self, positions: Plane) -> Plane:
        """Return the vectors from the centre of mass of the box to its points, shape (..., points of the box) [m]."""
        of_box = positions[..., : self._box_masses.size]
        centre = of_box @ self._box_masses / self._box_mass
        return np.asarray(of_box - centre[..., np.newaxis])


def _count_updates(motion: BoxMotion) -> int:
    """Return the number of evaluations of the bar forces so far."""
    return motion.box.evaluations + motion.step.evaluations


@dataclass(frozen=True)
class BoxWindow:
    """The interval from ``tr`` to ``td`` [s] in which the box is rigid, alone or joined to the step (``with_step``).

    Raises RangeError unless 0 <= tr <= td.
    """

    tr: float
    td: float
    with_step: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.tr <= self.td:
            raise RangeError(
                f"tr {self.tr:g} and td {self.td:g} must be in this order after the start at 0"
            )


def simulate(
    parameters: Parameters,
    t_end: float,
    *windows: BoxWindow,
    interval: float = INTERVAL,
) -> Record:
    """Compute a run from 0 to ``t_end`` that stores a state every ``interval`` [s].

    Raises RangeError if it takes too many time steps, or if ``windows`` overlap or are not in order.

    Examples
    --------
    >>> from d2rpick.models.box_model import Parameters
    >>> run = simulate(Parameters(mesh=4), 0.01)
    >>> run.time.size, bool(abs(run.imbalance).max() < 0.01)
    (101, True)
    """
    # Overflow warnings are suppressed, because an overflow appears as too many time steps, which are rejected below.
    with np.errstate(over="ignore"):
        motion = BoxMotion(parameters, interval)
    if motion.step_at(t_end) > MOST_STEPS:
        raise RangeError(
            f"steps of {motion.dt:.3g} s make more than {MOST_STEPS} until {t_end:g}; choose softer bars"
        )
    for window, following in pairwise(windows):
        if not window.td < following.tr:
            raise RangeError(
                f"the window from tr {following.tr:g} begins before the one up to td {window.td:g} is over"
            )
    return continue_motion(motion, t_end, *windows)


def continue_motion(motion: BoxMotion, t_end: float, *windows: BoxWindow) -> Record:
    """Continue ``motion`` to ``t_end`` [s] and switch at the first time step at or after the times of ``windows``.

    Raises RangeError if its numbers become infinite.
    """
    last = motion.every * (motion.step_at(t_end) // motion.every)
    rigid = {motion.step_at(window.tr): window for window in windows}
    deformable = {motion.step_at(window.td) for window in windows}
    # Floating-point warnings are suppressed, because the recorder raises an error for non-finite numbers.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        recorder = Recorder(motion, last)
        while True:
            if motion.count in rigid:
                motion.make_rigid(with_step=rigid[motion.count].with_step)
            if motion.count in deformable:
                motion.make_deformable()
            mean = motion.advance()
            if motion.count % motion.every == 0:
                recorder.note(mean)
            if motion.count >= last:
                return recorder.record()
            motion.move()


def run_to(motion: BoxMotion, time: float) -> None:
    """Continue a motion without switching to the first time step at or after ``time`` [s]."""
    for _ in range(motion.step_at(time) - motion.count):
        motion.advance()
        motion.move()


@dataclass(frozen=True, eq=False, repr=False)
class BoxEvidence(Given):
    """The momentum and the internal energy of the box and of the step, as a run's ``matsum`` file lists them.

    ``part_energies`` holds the energies, ``values`` of shape (n, 2) [J].
    """

    part_energies: Track | None = None

    def internal_energies(self, parts: Sequence[Part]) -> Track | None:
        """Return the internal energies of the box or the step, with ``values`` of shape (n, parts) [J]."""
        if self.part_energies is None:
            return None
        time, values = self.part_energies
        return Track(time, values[:, [part.id - 1 for part in parts]])


def make_history(record: Record) -> History:
    """Return the history of the box energy, with the momenta and energies of both parts."""
    parts = tuple(Part(number, title) for number, title in enumerate(PARTS, start=1))
    along_x = record.momentum.real
    along_z = record.momentum.imag
    momentum = np.stack([along_x, 0 * along_x, along_z], axis=2)
    momenta = Momenta(record.time, momentum, parts, EXACT, chosen=(BOX,))
    return History(
        time=record.time,
        energy=record.internal_energy[:, BOX],
        source=("rollover",),
        format="rollover",
        channel="internal energy of box",
        parts=parts[:1],
        evidence=BoxEvidence(
            (momenta,),
            part_energies=Track(record.time, record.internal_energy),
        ),
        time_unit="s",
    )


class Outcome(NamedTuple):
    """One switched run in comparison with the reference run.

    ``energy`` is the energy of the box at tr, which is frozen [J], and ``energy_ratio`` this energy divided by that at
    td. The errors at td are ``roll_error`` [degrees], ``x_error`` and ``z_error`` of the centre of mass [m], and
    ``omega_error`` [rad/s].  ``lost_energy`` is the kinetic energy of the vibration at tr [J].  ``mean_ratio`` is the
    ratio of the mean energy of the box from td to the landing to the same mean in the reference run.
    """

    tr: float
    energy: float
    energy_ratio: float
    roll_error: float
    x_error: float
    z_error: float
    omega_error: float
    lost_energy: float
    mean_ratio: float


def scan_times(released: float, td: float) -> list[float]:
    """Return the tr values up to td [s], closely spaced until 1.5 times the end of the load and then more widely.

    Raises RangeError if td leaves no time for tr.
    """
    dense = min(1.5 * released, td - _LAST)
    if not dense > _FINE:
        raise RangeError(
            f"td {td:g} leaves no time for tr; the earliest possible td is {_FINE + _LAST:g}"
        )
    fine = np.arange(_FINE, dense, _FINE)
    coarse = np.arange(dense, td - _LAST, _COARSE)
    return [*fine.tolist(), *coarse.tolist()]


def find_comparison_end(reference: Record, td: float) -> float:
    """Return the time at which the comparison after ``td`` ends: the landing or the end of the record [s].

    Raise RangeError if ``td`` is not before that time.
    """
    end = float(reference.time[-1]) if reference.landed is None else reference.landed
    if not td < end:
        raise RangeError(f"td {td:g} is not before the end of the flight at {end:g}")
    return end


def scan(
    parameters: Parameters,
    reference: Record,
    times: Sequence[float],
    td: float,
    jobs: int | None = None,
) -> Iterator[Outcome]:
    """Yield the outcome of a switched run for each of ``times``, in ascending order of tr.

    All runs equal the reference run until their tr, so this part is computed only once. Then ``jobs`` processes share
    the runs (None: one process for each core; 1: only this process).
    """
    end = find_comparison_end(reference, td)
    ready: dict[int, Record] = {}
    ordered = sorted(times)
    following = 0
    with choose_farm(jobs or count_cores(), "d2rpick.models.box_run") as farm:
        for answer in farm.answers(
            _compute_switched_run,
            _make_branches(
                BoxMotion(parameters, _find_interval(reference)), ordered, td, end
            ),
        ):
            if answer.error:
                raise answer.error
            ready[answer.number] = answer.result
            while following in ready:
                yield compare_box_runs(
                    reference, ready.pop(following), ordered[following], td
                )
                following += 1


def _make_branches(
    motion: BoxMotion, times: Iterable[float], td: float, end: float
) -> Iterator[tuple[BoxMotion, float, BoxWindow]]:
    """Yield, for each tr, a copy of the reference run at that tr, the end time of the switched run, and its window."""
    for tr in times:
        run_to(motion, tr)
        yield motion.copy(), end, BoxWindow(tr, td)


def _compute_switched_run(branch: tuple[BoxMotion, float, BoxWindow]) -> Record:
    """Compute a switched run that branches off from the reference run at tr."""
    return continue_motion(*branch)


def compare_box_runs(
    reference: Record, switched: Record, tr: float, td: float
) -> Outcome:
    """Compare a switched run, which may begin at tr, with the reference run at td and between td and the landing."""
    interval = _find_interval(reference)
    at = round(td / interval)
    end = round(find_comparison_end(reference, td) / interval)
    begin = round(float(switched.time[0]) / interval)
    after_td = slice(at, end)
    after_td_switched = slice(at - begin, end - begin)
    energy = float(np.interp(tr, reference.time, reference.internal_energy[:, BOX]))
    displacement = complex(switched.centre[at - begin] - reference.centre[at])
    mean = reference.internal_energy[after_td, BOX].mean()
    mean_switched = switched.internal_energy[after_td_switched, BOX].mean()
    return Outcome(
        tr=tr,
        energy=energy,
        energy_ratio=energy / float(reference.internal_energy[at, BOX]),
        roll_error=float(np.degrees(switched.roll[at - begin] - reference.roll[at])),
        x_error=displacement.real,
        z_error=displacement.imag,
        omega_error=float(switched.omega[at - begin] - reference.omega[at]),
        lost_energy=float(switched.lost_energy[-1]),
        mean_ratio=float(mean_switched) / float(mean),
    )


def _find_interval(record: Record) -> float:
    """Return the output interval of a record [s]."""
    return float(record.time[1] - record.time[0])
