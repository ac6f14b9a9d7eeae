"""The oscillator behind a mode: one whose spring holds the same energy, what a switch costs it, and the way back."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.errors import RangeError
from d2rpick.vibration.one_mode import LARGEST_ENERGY, Mode
from d2rpick.vibration.oscillator import Oscillator, State

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.modes import Modes


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

    RangeError when it is not underdamped: such a motion has no vibration to lock in; or when its energies are beyond
    what can be squared.
    """
    omega = oscillator.omega_2
    if not omega > 0:
        raise RangeError(
            f"alpha {oscillator.alpha:g} overdamps the oscillator, whose rate is {oscillator.omega_0:g}, "
            f"less than {2 * oscillator.omega_0:g} was expected"
        )
    sine = -v0 / omega * sqrt(oscillator.stiffness / 2)
    if not abs(sine) <= sqrt(LARGEST_ENERGY):
        raise RangeError(f"v0 is {v0:g}: it gives energies above {LARGEST_ENERGY:g}; choose units of moderate numbers")
    return Mode(omega=omega, alpha=oscillator.alpha, cosine=0.0, sine=sine, origin=0.0)
