"""Compute the internal energy that one vibration mode stores and returns, in closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.histories.samples import narrow_brackets
from d2rpick.vibration.amplitudes import SignedAmplitudes

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples


# Number of samples per block, small enough for intermediate results to fit into the processor cache.
BLOCK: Final = 8192
# Largest number of steps of the root search; it suffices for bisection alone to reach full precision.
_STEPS = 64
# Relative rounding error of a double [-].
_EPS = float(np.finfo(np.float64).eps)
# Largest energy that may be a solver error, as a fraction of the highest energy [-].
# Typical solver errors are 1e-5 of the highest energy.
SOLVER_FLOOR: Final = 1e-4
# Largest deformation that is treated as zero, as a fraction of the amplitude [-].
_ZERO = 1e-9


@dataclass(frozen=True, repr=False)
class Mode(SignedAmplitudes):
    r"""One under-damped vibration mode and its internal energy.

    .. math::
        E(t) = E_{pl} + q(t)^2, \quad
        q(t) = q_0 + e^{-\alpha s/2} (a \cos\omega s + b \sin\omega s), \quad s = t - t_0

    q is the deformation in units of the square root of energy: for the floating oscillator with stiffness k and
    deformation r = y - z, q = sqrt(k/2) r, so that q**2 is the elastic energy. The energy does not show the overall
    sign of q; only products of two values of q are meaningful.

    Parameters
    ----------
    omega : float
        Damped angular frequency of the deformation, positive [1/time]; that of the energy is twice as high. It is
        omega_2 in equation (4) of the paper.
    alpha : float
        Coefficient of mass-proportional damping [1/time].
    cosine, sine : float
        a and b [sqrt(energy)].
    origin : float
        t_0 [time].
    energy_plastic : float
        Irrecoverable part of the energy, E_pl [energy].
    preload : float
        q_0, deformation about which the mode vibrates [sqrt(energy)].

    Notes
    -----
    "Analysis of switched-rigid floating oscillator" (Shock and Vibration), equations (1), (4) and (7).

    Examples
    --------
    >>> mode = Mode(omega=np.pi, alpha=0.0, cosine=0.0, sine=2.0, origin=0.0)
    >>> float(mode.energy(0.5)), mode.peaks(0.0, 2.0)
    (4.0, (0.5, 1.5))
    >>> mode.crossings(2.0 * np.sin(np.pi / 4), 0.0, 2.0)
    (0.25, 0.75)
    """

    omega: float
    alpha: float
    cosine: float
    sine: float
    origin: float
    energy_plastic: float = 0.0
    preload: float = 0.0

    @property
    def omega_0(self) -> float:
        """Return the undamped angular frequency, omega_0**2 = omega**2 + alpha**2 / 4 [1/time]."""
        return float(np.hypot(self.omega, self.alpha / 2))

    def deformation(self, t: Samples | float) -> Samples:
        """Return the signed deformation q(t) [sqrt(energy)]."""
        return self.preload + self._swing(t, self.cosine, self.sine)

    def velocity(self, t: Samples | float) -> Samples:
        """Return dq/dt [sqrt(energy)/time]."""
        return self._swing(t, *self._velocity_parts)

    def motion(self, t: Samples) -> tuple[Samples, Samples]:
        """Return `deformation` and `velocity` from one evaluation, in the shape of ``t``."""
        s = t - self.origin
        angle = self.omega * s
        decay = np.exp(-self.alpha / 2 * s)
        cos, sin = np.cos(angle), np.sin(angle)
        cosine, sine = self._velocity_parts
        q = self.preload + decay * (self.cosine * cos + self.sine * sin)
        return q, decay * (cosine * cos + sine * sin)

    def amplitudes(self, t: Samples | float) -> Samples:
        """Return the signed deformation, in the shape of ``t`` with a first axis of length one [sqrt(energy)]."""
        return self.deformation(t)[np.newaxis]

    def energy(self, t: Samples | float) -> Samples:
        """Return E(t), the plastic and elastic energy [energy]."""
        return self.energy_plastic + self.deformation(t) ** 2

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Return the kinetic energy of the vibration, T = (dq/dt)**2 / omega_0**2 [energy].

        The formula follows from T = mu r'**2 / 2 with omega_0**2 = k / mu and q**2 = k r**2 / 2.
        """
        return (self.velocity(t) / self.omega_0) ** 2

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the energy of the vibration about the preload, V = (q - q_0)**2 + T; dV/dt = -2 alpha T [energy]."""
        cosine, sine = self._velocity_parts

        def energy(decay: Samples, cos: Samples, sin: Samples) -> Samples:
            swing = decay * (self.cosine * cos + self.sine * sin)
            velocity = decay * (cosine * cos + sine * sin)
            return swing**2 + (velocity / self.omega_0) ** 2

        return self._of_waves(energy, t)

    def energy_slopes(self, t: Samples | float) -> tuple[Samples, Samples]:
        """Return E' [energy/time] and E'' [energy/time^2], from q'' = -alpha q' - omega_0**2 (q - q_0)."""
        q = self.deformation(t)
        velocity = self.velocity(t)
        acceleration = -self.alpha * velocity - self.omega_0**2 * (q - self.preload)
        return 2 * q * velocity, 2 * (velocity**2 + q * acceleration)

    def energy_gradient(self, t: Samples, size: int) -> Samples:
        """Return the derivatives of E(t) with respect to the first ``size`` parameters without origin, (size, n)."""
        own_gradient = np.array(
            [
                self.omega,
                self.alpha,
                self.cosine,
                self.sine,
                self.energy_plastic,
                self.preload,
            ]
        )
        return compute_energy_and_jacobian(own_gradient, t - self.origin, size)[1]

    def standstill_after(self, t: Samples | float) -> Samples:
        """Return the first time at or after ``t`` with q' = 0 [time]; such times are half a period apart."""
        cosine, sine = self._velocity_parts
        # With x = omega (t - origin), the velocity cosine cos x + sine sin x is 0 at x = phase + n pi.
        phase = np.arctan2(-cosine, sine)
        angle = self.omega * (np.asarray(t) - self.origin)
        half_turns = np.ceil((angle - phase) / np.pi)
        return np.asarray(self.origin + (phase + np.pi * half_turns) / self.omega)

    def extrema(self, start: float, end: float) -> tuple[float, ...]:
        """Find the times in (start, end) with q' = 0 [time], in ascending order."""
        if not start < end:  # For infinite times, the phase would be infinite.
            return ()
        first = float(self.standstill_after(start))
        times = first + np.pi / self.omega * np.arange(
            max(0.0, np.ceil((end - first) * self.omega / np.pi))
        )
        return tuple(times[(times > start) & (times < end)].tolist())

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Find the times in (start, end) at which the energy has a local maximum [time], in ascending order.

        If q' = 0, then q'' = -omega_0**2 (q - q_0), so E'' = 2 q q'' is negative only if q (q - q_0) > 0.
        """
        times = np.array(self.extrema(start, end))
        q = self.deformation(times)
        return tuple(times[q * (q - self.preload) > 0].tolist())

    def crossings(self, level_q: float, start: float, end: float) -> tuple[float, ...]:
        """Find the times in (start, end) at which q equals ``level_q`` [time], ascending and accurate to rounding.

        Extrema that only touch the level (within rounding) are not crossings, and neither are ``start`` and ``end``.
        """
        return tuple(
            self._passages(np.array([level_q]), start, np.array([end]))[1].tolist()
        )

    def level_crossings(self, td: float, start: float) -> tuple[float, ...]:
        """Find the times in (start, td) at which the energy equals that at ``td`` [time], in ascending order."""
        return tuple(self.all_level_crossings(np.array([td]), start)[1].tolist())

    def all_level_crossings(
        self, td: Samples, start: float
    ) -> tuple[NDArray[np.intp], Samples]:
        """Find the level crossings for every ``td`` (n,) at once; return the td index and the time of each crossing."""
        level = self.deformation(td)
        # Each zero of q is counted as one zero crossing, whatever the sign of the rounding error.
        zero = np.abs(level) <= _ZERO * np.sqrt(self.vibration_energy(td))
        level = np.where(zero, 0.0, level)
        ends = np.append(td, np.where(zero, start, td))
        row, times = self._passages(np.append(level, -level), start, ends)
        row %= td.size
        order = np.lexsort((times, row))
        return row[order], times[order]

    def _passages(
        self, levels: Samples, start: float, ends: Samples
    ) -> tuple[NDArray[np.intp], Samples]:
        """Find the times in (start, end) at which q equals a level, for each level and end, both of shape (n,).

        Return the indices of the levels and the times, sorted by index and then by time.
        """
        inner = np.array(self.extrema(start, float(ends.max(initial=start))))
        rows = np.broadcast_to(inner, (ends.size, inner.size))
        edges = np.column_stack(
            [np.full(ends.size, start), np.minimum(rows, ends[:, np.newaxis]), ends]
        )
        above = self.deformation(edges) - levels[:, np.newaxis]
        scale = (
            np.abs(levels)[:, np.newaxis]
            + abs(self.preload)
            + np.sqrt(self.vibration_energy(edges))
        )
        above[np.abs(above) <= 8 * _EPS * scale] = 0.0
        # The deformation q is monotone between neighbouring extrema.
        row, cell = np.nonzero(above[:, :-1] * above[:, 1:] < 0)
        side = np.sign(above[row, cell])
        wanted = levels[row]

        def rise_above(t: Samples) -> tuple[Samples, Samples]:
            q, velocity = self.motion(t)
            return side * (q - wanted), side * velocity

        times = narrow_brackets(
            rise_above, edges[row, cell], edges[row, cell + 1], _STEPS
        )
        return row, times.at

    @property
    def _velocity_parts(self) -> tuple[float, float]:
        """Return the cosine and sine coefficients of dq/dt."""
        half = self.alpha / 2
        return (
            self.omega * self.sine - half * self.cosine,
            -self.omega * self.cosine - half * self.sine,
        )

    def _swing(self, t: Samples | float, cosine: float, sine: float) -> Samples:
        """Return exp(-alpha s/2) (cosine cos(omega s) + sine sin(omega s)) with s = t - origin."""
        return self._of_waves(
            lambda decay, cos, sin: decay * (cosine * cos + sine * sin), t
        )

    def _of_waves(
        self, make: Callable[[Samples, Samples, Samples], Samples], t: Samples | float
    ) -> Samples:
        """Apply a function to exp(-alpha s/2), cos(omega s) and sin(omega s) for many times, block by block."""

        def made(times: Samples) -> Samples:
            s = times - self.origin
            angle = self.omega * s
            return make(np.exp(-self.alpha / 2 * s), np.cos(angle), np.sin(angle))

        t = np.asarray(t, dtype=np.float64)
        if t.ndim != 1 or t.size <= BLOCK:
            return made(t)
        return np.concatenate(
            [made(t[first : first + BLOCK]) for first in range(0, t.size, BLOCK)]
        )


def compute_deformations(modes: Sequence[Mode], t: Samples) -> Samples:
    """Return `Mode.deformation` of m modes with one origin at the times (n,), shape (m, n) [sqrt(energy)].

    For a few times, one evaluation of all modes takes hardly longer than that of one mode.
    """
    omega, alpha, cosine, sine, preload = np.array(
        [
            (mode.omega, mode.alpha, mode.cosine, mode.sine, mode.preload)
            for mode in modes
        ]
    ).T[..., np.newaxis]
    s = t - modes[0].origin
    angle = omega * s
    swing = cosine * np.cos(angle) + sine * np.sin(angle)
    return np.asarray(preload + np.exp(-alpha / 2 * s) * swing)


def compute_energy_and_jacobian(
    parameters: Samples, s: Samples, size: int
) -> tuple[Samples, Samples]:
    """Return E(s), shape (n,), and its derivatives with respect to the first ``size`` parameters, shape (size, n).

    The parameters are omega, alpha, cosine, sine, energy_plastic and preload of a `Mode` whose origin is s = 0.
    """
    energy, compute_jacobian = prepare_energy_and_jacobian(parameters, s, size)
    return energy, compute_jacobian()


def prepare_energy_and_jacobian(
    parameters: Samples, s: Samples, size: int
) -> tuple[Samples, Callable[[], Samples]]:
    """Return the energy of `compute_energy_and_jacobian`, and a function that computes the derivatives if needed."""
    omega, alpha, cosine, sine, plastic, preload = parameters.tolist()
    angle = omega * s
    decay = np.exp(-alpha / 2 * s)
    cos = decay * np.cos(angle)
    sin = decay * np.sin(angle)
    swing = cosine * cos + sine * sin
    q = preload + swing

    def compute_jacobian() -> Samples:
        twice = q + q
        # The array is filled in place to save time, because identification spends most of its time here.
        jacobian = np.empty((size, s.size))
        by_rate = np.multiply(twice, s, out=jacobian[0])
        np.multiply(by_rate, swing, out=jacobian[1])
        jacobian[1] *= -0.5
        by_rate *= sine * cos - cosine * sin
        np.multiply(twice, cos, out=jacobian[2])
        np.multiply(twice, sin, out=jacobian[3])
        jacobian[4:5] = 1.0
        jacobian[5:] = twice
        return jacobian

    return plastic + q * q, compute_jacobian
