"""Replay: the floating oscillator run through tr and td, beside the same oscillator without switching."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.errors import RangeError
from d2rpick.vibration.one_mode import Mode
from d2rpick.vibration.oscillator import Oscillator, State

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.modes import Modes


@dataclass(frozen=True)
class Replay:
    """Motion from ``start`` at time ``origin`` on, rigid from ``tr`` to ``td``; RangeError unless origin <= tr <= td.

    Times in the unit of the run.
    """

    oscillator: Oscillator
    start: State
    origin: float
    tr: float
    td: float

    def __post_init__(self) -> None:
        if not self.origin <= self.tr <= self.td:
            raise RangeError(
                f"tr {self.tr:g} and td {self.td:g} must be in this order after the start at {self.origin:g}"
            )

    def reference(self, time: Samples | float) -> State:
        """States of the run without switching at ``time`` (7)."""
        return self.oscillator.free(self.start, np.asarray(time) - self.origin)

    def motion(self, time: Samples | float) -> State:
        """States of the switched run at ``time``: free (7), rigid (9)-(12), free again (18).

        At tr itself the state after the switch.
        """
        time = np.asarray(time, dtype=np.float64)
        released = self.oscillator.rigid(self.reference(self.tr), self.td - self.tr)
        phases = (
            self.reference(np.minimum(time, self.tr)),
            self.oscillator.rigid(self.reference(self.tr), np.clip(time - self.tr, 0, self.td - self.tr)),
            self.oscillator.free(released, np.maximum(time - self.td, 0)),
        )
        phase = np.where(time < self.tr, 0, np.where(time < self.td, 1, 2))
        return State(*(np.choose(phase, values) for values in zip(*phases, strict=True)))

    def residual(self) -> float:
        """Energy norm of what the switched run lacks at td, over that of the reference vibration [-]."""
        reference = self.reference(self.td)
        lack = lacking_energy(self.oscillator, reference, self.motion(self.td))
        return float(np.sqrt(lack / self.oscillator.vibration_energy(reference)))


def lacking_energy(oscillator: Oscillator, reference: State, switched: State) -> Samples:
    """Energy of the vibration that ``switched`` lacks against ``reference``, states at td, numbers or arrays."""
    lack = State(*(a - b for a, b in zip(switched, reference, strict=True)))
    return oscillator.vibration_energy(lack)


def replayed_residual(vibration: Mode | Modes, tr: Samples, td: Samples | float) -> Samples:
    """Replay each tr of shape (n,) up to ``td`` and give the residual there, of all modes together [-].

    ``td`` is one for all, or one for each.  Energy norm of what the switched run lacks at td, over that of the
    reference vibration.
    """
    lack, whole = np.zeros(tr.shape), np.zeros(tr.shape)
    for mode in vibration.modes:
        oscillator, at_td = from_mode(mode, td)
        at_tr = oscillator.free(at_td, tr - td)  # the closed form runs backwards as well
        lack += lacking_energy(oscillator, at_td, oscillator.rigid(at_tr, td - tr))
        whole += oscillator.vibration_energy(at_td)
    return np.sqrt(lack / whole)


def from_mode(mode: Mode, time: Samples | float) -> tuple[Oscillator, State]:
    """Give an oscillator whose deformation is that of ``mode`` about its preload, and its state at ``time``.

    An energy history tells neither masses nor the motion of the whole; they are chosen so that the deformation
    equals q - q0 (k = 2), with equal masses and the centre of mass at rest.
    """
    mass = 4 / mode.omega_0**2
    q, velocity = mode.deformation(time) - mode.preload, mode.velocity(time)
    oscillator = Oscillator(stiffness=2.0, mass=mass, frame_mass=mass, alpha=mode.alpha)
    return oscillator, State(-q / 2, q / 2, -velocity / 2, velocity / 2)


def to_mode(oscillator: Oscillator, v0: float) -> Mode:
    """Give the energy mode of ``oscillator`` struck at time 0: frame velocity ``v0``, all else at rest (7).

    RangeError when it is not underdamped: such a motion has no vibration to lock in.
    """
    omega = oscillator.omega_2
    if not omega > 0:
        raise RangeError(
            f"alpha {oscillator.alpha:g} overdamps the oscillator, whose rate is {oscillator.omega_0:g}, "
            f"less than {2 * oscillator.omega_0:g} was expected"
        )
    sine = -v0 * np.sqrt(oscillator.stiffness / 2) / omega
    return Mode(omega=omega, alpha=oscillator.alpha, cosine=0.0, sine=float(sine), origin=0.0)


class Trajectory(NamedTuple):
    """Motion on an even grid of ``time`` (n,): ``state`` and both energies, arrays of the same shape."""

    time: Samples
    state: State
    internal_energy: Samples
    kinetic_energy: Samples


def trajectory(
    oscillator: Oscillator, start: State, t_end: float, dt: float, switched: Replay | None = None
) -> Trajectory:
    """Compute the motion at 0, dt, 2 dt, ... up to ``t_end``, of ``switched`` where it is given [time].

    Times are rounded to the 14th digit of ``t_end``, so that a multiple of dt meets the switch time that is
    written the same.
    """
    count = int(np.floor(t_end / dt * (1 + 1e-12))) + 1
    time = np.round(dt * np.arange(count), 13 - int(np.floor(np.log10(t_end))))
    with np.errstate(all="ignore"):
        state = oscillator.free_on_grid(start, dt, count) if switched is None else switched.motion(time)
        motion = Trajectory(time, state, oscillator.internal_energy(state), oscillator.kinetic_energy(state))
    if not all(np.isfinite(column).all() for column in (time, *state, motion.internal_energy, motion.kinetic_energy)):
        raise RangeError("the motion exceeds the range of numbers; choose units that give moderate numbers")
    return motion
