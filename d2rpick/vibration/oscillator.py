"""Compute the motion of a floating oscillator (two masses, a spring, no support), free or rigid, in closed form.

Source: "Analysis of switched-rigid floating oscillator" (Shock and Vibration); equation numbers refer to that paper.
The frame of mass ``m`` has the displacement ``z``, and the suspended mass ``M`` the displacement ``y``. A spring of
stiffness ``k`` connects them, and mass-proportional damping with the rate ``alpha`` acts on both. Units are consistent.

The closed forms in this module accept any initial state. They split the motion into that of the centre of mass, which
only damping slows down, and the spring deformation ``r = y - z`` with ``r'' + alpha r' + omega_0^2 r = 0``. Equations
(7) of the paper are the case z = y = y' = 0, z' = V0. The spring-back, equation (18), is the free motion that starts
from the frozen deformation with equal velocities of both masses. A `Replay` computes the motion before tr, from tr to
td, and after td.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import RangeError
from d2rpick.histories.history import LARGEST_ENERGY
from d2rpick.vibration.modes import Mode

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


# The type is quoted to keep start-up fast, because numpy.typing is slow to import.
Values: TypeAlias = "NDArray[np.float64]"


# Limits of the stiffness and the masses, beyond which products overflow; real values are far from these limits.
_SMALLEST, _LARGEST = 1e-100, 1e100


class State(NamedTuple):
    """Displacements ``z`` (frame) and ``y`` (suspended mass) with velocities ``vz`` and ``vy``: numbers or arrays."""

    z: Values
    y: Values
    vz: Values
    vy: Values

    @classmethod
    def of(cls, z: ArrayLike, y: ArrayLike, vz: ArrayLike, vy: ArrayLike) -> State:
        """Make a state from anything that numpy converts to numbers."""
        return cls(*(np.asarray(value, dtype=np.float64) for value in (z, y, vz, vy)))


@dataclass(frozen=True)
class Oscillator:
    """A floating oscillator; raise RangeError unless stiffness and masses are from 1e-100 to 1e100 and alpha is finite.

    ``stiffness`` k [force/length], ``mass`` M (suspended) and ``frame_mass`` m [mass], ``alpha`` [1/time]. ``alpha``
    may be slightly negative, because a fit to noisy samples may yield such a value; the motion then grows.
    """

    stiffness: float
    mass: float
    frame_mass: float
    alpha: float = 0.0

    def __post_init__(self) -> None:
        for name in ("stiffness", "mass", "frame_mass"):
            if not _SMALLEST <= getattr(self, name) <= _LARGEST:
                finding = f"{name} is {getattr(self, name)}"
                raise RangeError(
                    f"{finding}, but a positive number from {_SMALLEST:g} to {_LARGEST:g} was expected"
                )
        if not np.isfinite(self.alpha):
            raise RangeError(f"alpha is {self.alpha}, but a finite number was expected")

    @property
    def reduced_mass(self) -> float:
        """Return the reduced mass mu = m M/(m + M) of the two masses that the spring connects."""
        return self.frame_mass * self.mass / (self.frame_mass + self.mass)

    @property
    def omega_0(self) -> float:
        """Return the undamped angular frequency of the vibration, sqrt(k/mu) = sqrt(1 + beta) omega_n [1/time]."""
        return float(np.sqrt(self.stiffness / self.reduced_mass))

    @property
    def omega_2(self) -> float:
        """Return the damped angular frequency of the vibration, equation (4) of the paper [1/time]; NaN if overdamped.

        Examples
        --------
        >>> Oscillator(stiffness=660e3, mass=31.4, frame_mass=15.7, alpha=50).omega_2
        249.864613022...
        """
        square = self._squared_damped_rate
        return float(np.sqrt(square)) if square >= 0 else float("nan")

    @property
    def _squared_damped_rate(self) -> float:
        """omega_2**2 as a product, which loses no digits [1/time^2]; it is negative if the oscillator is overdamped."""
        return (self.omega_0 - self.alpha / 2) * (self.omega_0 + self.alpha / 2)

    def free(self, start: State, elapsed: ArrayLike) -> State:
        """Return the state after ``elapsed`` of free motion from ``start``, equations (7) and (18) of the paper.

        Parameters
        ----------
        start : State
            Initial state; its values are numbers or arrays that broadcast with ``elapsed``.
        elapsed : array_like
            Time since ``start``, not negative [time].

        Returns
        -------
        State
            Arrays of the broadcast shape.
        """
        t = np.asarray(elapsed, dtype=np.float64)
        cosine, sine = self._vibration(t)
        r = start.y - start.z
        vr = start.vy - start.vz
        deformation = cosine * r + sine * (vr + self.alpha / 2 * r)
        rate = cosine * vr - sine * (self.omega_0**2 * r + self.alpha / 2 * vr)
        centre, velocity = self._centre(start)
        centre = centre + velocity * _compute_path(self.alpha, t)
        velocity = velocity * np.exp(-self.alpha * t)
        frame = self._share(self.mass)
        suspended = self._share(self.frame_mass)
        z = centre - frame * deformation
        y = centre + suspended * deformation
        return State(z, y, velocity - frame * rate, velocity + suspended * rate)

    def free_on_grid(self, start: State, step: float, count: int) -> State:
        """Return the states at ``step * arange(count)`` of free motion from ``start``, faster than ``free`` does.

        On an even grid, the times form a table with t = t_row + t_column. Each exponential is then the product of a
        factor for its row and a factor for its column, so a displacement is a matrix product of rank four. The result
        agrees with that of ``free`` to a few units in the last digit. The values of ``start`` must be numbers. Unless
        the motion is underdamped, ``free`` is called.
        """
        omega = self.omega_2
        if not omega > 0:
            return self.free(start, step * np.arange(count))
        columns = max(1, int(np.sqrt(count)))
        row = step * columns * np.arange(-(-count // columns), dtype=np.float64)
        column = step * np.arange(columns, dtype=np.float64)
        rate = -self.alpha / 2 + 1j * omega
        turn = np.exp(rate * column)
        turn_row = np.exp(rate * row)
        slow_row = np.exp(-self.alpha * row)
        slow = np.exp(-self.alpha * column)
        drift_row = _compute_path(self.alpha, row)
        drift = _compute_path(self.alpha, column)
        r = start.y - start.z
        vr = start.vy - start.vz
        amplitude = complex(r, -(vr + self.alpha / 2 * r) / omega)
        centre, velocity = self._centre(start)

        def displacement(share: float) -> Values:
            """Return the displacement of a mass whose fraction of the deformation is ``share``."""
            swing = share * amplitude * turn_row
            terms = [
                swing.real,
                -swing.imag,
                centre + velocity * drift_row,
                velocity * slow_row,
            ]
            table = np.stack(terms, axis=1) @ np.stack(
                [turn.real, turn.imag, np.ones(columns), drift]
            )
            return np.asarray(table.ravel()[:count])

        def speed(share: float) -> Values:
            """Return the velocity of a mass whose fraction of the deformation is ``share``."""
            swing = share * rate * amplitude * turn_row
            table = np.stack([swing.real, -swing.imag, velocity * slow_row], axis=1)
            return np.asarray(
                (table @ np.stack([turn.real, turn.imag, slow])).ravel()[:count]
            )

        frame = -self._share(self.mass)
        suspended = self._share(self.frame_mass)
        states = State(
            displacement(frame), displacement(suspended), speed(frame), speed(suspended)
        )
        for column, value in zip(states, start, strict=True):
            column[:1] = value  # The first value equals the initial value exactly.
        return states

    def rigid(self, start: State, elapsed: ArrayLike) -> State:
        """Return the state after ``elapsed`` of rigid motion from ``start``, equations (8) to (12) of the paper.

        The switch preserves the momentum, removes the relative velocity, and freezes the deformation. Therefore
        ``rigid(start, 0)`` is the state immediately after the switch. The arguments are those of ``free``.
        """
        t = np.asarray(elapsed, dtype=np.float64)
        _, velocity = self._centre(start)
        displacement = velocity * _compute_path(self.alpha, t)
        common = velocity * np.exp(-self.alpha * t)
        return State(
            start.z + displacement, start.y + displacement, common, common.copy()
        )

    def internal_energy(self, state: State) -> Values:
        """Return the energy of the spring, k r^2/2 [energy]."""
        return np.asarray(self.stiffness / 2 * (state.y - state.z) ** 2)

    def vibration_energy(self, state: State) -> Values:
        """Return the energy of the vibration: the spring energy plus mu r'^2/2 for the relative motion [energy]."""
        return np.asarray(
            self.internal_energy(state)
            + self.reduced_mass / 2 * (state.vy - state.vz) ** 2
        )

    def kinetic_energy(self, state: State) -> Values:
        """Return the kinetic energy of both masses [energy]."""
        return np.asarray(
            self.frame_mass / 2 * state.vz**2 + self.mass / 2 * state.vy**2
        )

    def _share(self, mass: float) -> float:
        """Return a mass as a fraction of the sum of both masses [-]."""
        return mass / (self.frame_mass + self.mass)

    def _centre(self, state: State) -> tuple[Values, Values]:
        """Return the displacement and the velocity of the centre of mass, equation (8) of the paper."""
        frame = self._share(self.frame_mass)
        suspended = self._share(self.mass)
        return (
            frame * state.z + suspended * state.y,
            frame * state.vz + suspended * state.vy,
        )

    def _vibration(self, t: Values) -> tuple[Values, Values]:
        """Return exp(-alpha t/2) times cos(omega_2 t) and sin(omega_2 t)/omega_2, continued to any damping.

        An overdamped motion is the sum of two decaying exponentials. The slower rate alpha/2 - kappa is computed from
        the product of both rates, omega_0^2, because the difference would lose all digits.
        """
        square = self._squared_damped_rate
        if square >= 0:
            omega = np.sqrt(square)
            decay = np.exp(-self.alpha / 2 * t)
            return decay * np.cos(omega * t), decay * t * np.sinc(omega * t / np.pi)
        kappa = np.sqrt(-square)
        slow_rate = self.omega_0**2 / (self.alpha / 2 + kappa)
        slow = np.exp(-slow_rate * t)
        # The ratio divides the faster exponential by the slower one.
        ratio = np.exp(-2 * kappa * t)
        difference = -np.expm1(-2 * kappa * t)
        return slow * (1 + ratio) / 2, slow * difference / (2 * kappa)


def _compute_path(alpha: float, t: Values) -> Values:
    """Return s(t) = (1 - exp(-alpha t))/alpha, the path of a damped body of unit speed; t if alpha is 0."""
    damping = alpha * t
    # For tiny products, the quotient loses precision, whereas two terms of the series are exact to rounding.
    return np.where(
        np.abs(damping) < 1e-8,
        t * (1 - damping / 2),
        -np.expm1(-damping) / (alpha or 1.0),
    )


def compute_lacking_energy(
    oscillator: Oscillator, reference: State, switched: State
) -> Values:
    """Return the vibration energy that the state ``switched`` lacks compared with the state ``reference`` [energy]."""
    lack = State(*(a - b for a, b in zip(switched, reference, strict=True)))
    return oscillator.vibration_energy(lack)


def make_from_mode(mode: Mode, time: Values | float) -> tuple[Oscillator, State]:
    """Return an oscillator with the same deformation as ``mode`` about its preload, and its state at ``time``.

    An energy history contains neither the masses nor the motion of the centre of mass. The stiffness k = 2 makes the
    deformation equal to q - q0; the masses are equal, and the centre of mass is at rest.
    """
    mass = 4 / mode.omega_0**2
    q = mode.deformation(time) - mode.preload
    velocity = mode.velocity(time)
    oscillator = Oscillator(stiffness=2.0, mass=mass, frame_mass=mass, alpha=mode.alpha)
    return oscillator, State(-q / 2, q / 2, -velocity / 2, velocity / 2)


def to_mode(oscillator: Oscillator, v0: float) -> Mode:
    """Return the vibration mode of an ``oscillator`` whose frame has velocity ``v0`` at time 0, all else being at rest.

    Raise RangeError if the oscillator is overdamped, because it then has no vibration to freeze, or if squares of its
    energies would overflow.
    """
    omega = oscillator.omega_2
    if not omega > 0:
        finding = f"alpha {oscillator.alpha:g} overdamps the oscillator, whose rate is {oscillator.omega_0:g}"
        raise RangeError(
            f"{finding}, but less than {2 * oscillator.omega_0:g} was expected"
        )
    sine = -v0 / omega * sqrt(oscillator.stiffness / 2)
    if not abs(sine) <= sqrt(LARGEST_ENERGY):
        raise RangeError(
            f"v0 is {v0:g}: it gives energies above {LARGEST_ENERGY:g}; choose units of moderate numbers"
        )
    return Mode(omega=omega, alpha=oscillator.alpha, cosine=0.0, sine=sine, origin=0.0)


@dataclass(frozen=True)
class Replay:
    """Motion from ``start`` at ``origin``, rigid from ``tr`` to ``td``; raise RangeError unless origin <= tr <= td.

    All times have the unit of the run.
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

    def reference(self, time: Values | float) -> State:
        """Return the states of the run without switching at ``time``, equation (7) of the paper."""
        return self.oscillator.free(self.start, np.asarray(time) - self.origin)

    def motion(self, time: Values | float) -> State:
        """Return the states of the switched run at ``time``: equations (7), (9) to (12), and (18) of the paper.

        At tr itself, the state is that after the switch.
        """
        time = np.asarray(time, dtype=np.float64)
        released = self.oscillator.rigid(self.reference(self.tr), self.td - self.tr)
        phases = (
            self.reference(np.minimum(time, self.tr)),
            self.oscillator.rigid(
                self.reference(self.tr), np.clip(time - self.tr, 0, self.td - self.tr)
            ),
            self.oscillator.free(released, np.maximum(time - self.td, 0)),
        )
        phase = np.where(time < self.tr, 0, np.where(time < self.td, 1, 2))
        return State(
            *(np.choose(phase, values) for values in zip(*phases, strict=True))
        )

    def residual(self) -> float:
        """Return the energy norm of the vibration that the switched run lacks at td, relative to the reference [-]."""
        reference = self.reference(self.td)
        lack = compute_lacking_energy(self.oscillator, reference, self.motion(self.td))
        return float(np.sqrt(lack / self.oscillator.vibration_energy(reference)))


class Trajectory(NamedTuple):
    """Motion at evenly spaced times ``time`` (n,): ``state`` and both energies, as arrays of the same shape."""

    time: Values
    state: State
    internal_energy: Values
    kinetic_energy: Values


def compute_trajectory(
    oscillator: Oscillator,
    start: State,
    t_end: float,
    dt: float,
    switched: Replay | None = None,
) -> Trajectory:
    """Compute the motion at 0, dt, 2 dt, ... up to ``t_end`` [time]; ``switched`` defines the rigid window, if any.

    Times are rounded to the 14th digit of ``t_end``, so that a multiple of dt equals a switch time with the same
    decimal digits.
    """
    count = int(np.floor(t_end / dt * (1 + 1e-12))) + 1
    with np.errstate(all="ignore"):
        time = np.round(dt * np.arange(count), 13 - int(np.floor(np.log10(t_end))))
        if switched is None:
            state = oscillator.free_on_grid(start, dt, count)
        else:
            state = switched.motion(time)
        motion = Trajectory(
            time,
            state,
            oscillator.internal_energy(state),
            oscillator.kinetic_energy(state),
        )
    if not all(
        np.isfinite(column).all()
        for column in (time, *state, motion.internal_energy, motion.kinetic_energy)
    ):
        raise RangeError(
            "the motion exceeds the range of numbers; choose units that give moderate numbers"
        )
    return motion
