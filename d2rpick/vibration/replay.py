"""Replay: the floating oscillator run through tr and td, in closed form and, independent of it, step by step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from d2rpick.errors import RangeError
from d2rpick.vibration.oscillator import State, lacking_energy

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.oscillator import Oscillator


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
    with np.errstate(all="ignore"):
        time = np.round(dt * np.arange(count), 13 - int(np.floor(np.log10(t_end))))
        state = oscillator.free_on_grid(start, dt, count) if switched is None else switched.motion(time)
        motion = Trajectory(time, state, oscillator.internal_energy(state), oscillator.kinetic_energy(state))
    if not all(np.isfinite(column).all() for column in (time, *state, motion.internal_energy, motion.kinetic_energy)):
        raise RangeError("the motion exceeds the range of numbers; choose units that give moderate numbers")
    return motion


# Of each step, relative and absolute: far below what a figure shows, far above rounding.
_RELATIVE, _ABSOLUTE = 1e-11, 1e-14


def integrated(switched: Replay, time: Samples) -> State:
    """Integrate the equations of motion (1) through a switched run and give its states at ``time``.

    Free up to tr; rigid up to td, when both masses have the velocity that keeps the momentum and only damping acts;
    then free again from what that leaves.  An explicit Runge-Kutta method of order 8 (scipy's DOP853) knows nothing of
    the closed forms.

    Parameters
    ----------
    switched : Replay
        Oscillator, start and switch times.
    time : array of shape (n,)
        Ascending, from the start on [time].

    Returns
    -------
    State
        Arrays of shape (n,); at tr and td the state before the switch.
    """
    from scipy.integrate import solve_ivp

    o = switched.oscillator
    masses = np.array([o.frame_mass, o.mass])

    def free(_: float, x: Samples) -> Samples:
        force = o.stiffness * (x[1] - x[0])
        return np.concatenate([x[2:], np.array([force, -force]) / masses - o.alpha * x[2:]])

    def rigid(_: float, x: Samples) -> Samples:
        return np.concatenate([x[2:], -o.alpha * x[2:]])

    x = np.array(switched.start, dtype=np.float64)
    found = np.empty((4, time.size))
    bounds = (switched.origin, switched.tr, switched.td, max(switched.td, float(time[-1])))
    for phase, (motion, start, end) in enumerate(zip((free, rigid, free), bounds, bounds[1:], strict=False)):
        if phase == 1:
            x[2:] = masses @ x[2:] / masses.sum()  # (8)
        steps = solve_ivp(motion, (start, end), x, "DOP853", dense_output=True, rtol=_RELATIVE, atol=_ABSOLUTE)
        inside = (time >= start) & (time <= end)
        if inside.any():
            found[:, inside] = steps.sol(time[inside])
        x = steps.y[:, -1]
    return State(*found)
