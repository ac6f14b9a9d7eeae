"""The floating oscillator integrated step by step: an independent way to what the closed forms give."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.vibration.oscillator import State

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.replay import Replay

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
