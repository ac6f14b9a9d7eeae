"""Modes: an internal energy that several vibration modes store and give back, each on its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration.one_mode import Mode, energy_and_jacobian
from d2rpick.vibration.roots import narrow

if TYPE_CHECKING:
    from collections.abc import Callable

    from d2rpick.histories.history import Samples

# Points per period of the fastest mode on which sign changes are looked for: an extremum of the energy lasts a quarter
# of that period at least, but for shallow ones that are no use as switch times.
_POINTS_PER_PERIOD: Final = 32
_ROUNDING: Final = 1e-6  # of a radian: where an end of a window is itself an extremum, one is found this near to it


@dataclass(frozen=True)
class Modes:
    r"""Two or more under-damped vibrations with one damping, and the internal energy they make together.

    .. math:: E(t) = \sum_i q_i(t)^2, \quad q_i = e^{-\alpha s/2} (a_i \cos\omega_i s + b_i \sin\omega_i s)

    With damping proportional to mass, alpha is the same for all modes, and their energies add up without cross
    terms because their shapes are orthogonal in the stiffness.  Of each q_i the sign as a whole is not observable.

    Notes
    -----
    Eqs. (1) and (4) of "Analysis of switched-rigid floating oscillator" (Shock and Vibration), written for each mode
    of a chain of more than two masses.

    Examples
    --------
    >>> from d2rpick.vibration.one_mode import Mode
    >>> two = Modes((Mode(np.pi, 0.0, 1.0, 0.0, 0.0), Mode(2 * np.pi, 0.0, 1.0, 0.0, 0.0)))
    >>> float(two.energy(1.0)), float(two.vibration_energy(0.3))
    (2.0, 2.0)
    >>> [round(t, 6) for t in two.peaks(0.1, 1.9)]
    [0.5, 1.0, 1.5]
    """

    modes: tuple[Mode, ...]

    @classmethod
    def of(cls, parameters: Samples, origin: float) -> Modes:
        """Modes from their alpha and, for each, omega, cosine and sine, in one row; by ascending rate."""
        table = parameters[1:].reshape(-1, 3).tolist()
        return cls(tuple(Mode(row[0], float(parameters[0]), row[1], row[2], origin) for row in sorted(table)))

    @property
    def omega(self) -> float:
        """Rate of the slowest mode [1/time]."""
        return min(mode.omega for mode in self.modes)

    @property
    def fastest(self) -> float:
        """Rate of the fastest mode [1/time]."""
        return max(mode.omega for mode in self.modes)

    @property
    def apart(self) -> float:
        """Least difference of the rates of two modes [1/time]."""
        return float(np.diff(sorted(mode.omega for mode in self.modes)).min())

    @property
    def alpha(self) -> float:
        """Damping, proportional to mass [1/time]."""
        return self.modes[0].alpha

    @property
    def energy_plastic(self) -> float:
        """No energy stays behind."""
        return 0.0

    @property
    def preload(self) -> float:
        """The modes vibrate about rest."""
        return 0.0

    def amplitudes(self, t: Samples | float) -> Samples:
        """Signed deformations of all modes, of the shape of ``t`` with an axis for the modes before it."""
        return np.stack([mode.deformation(t) for mode in self.modes])

    def energy(self, t: Samples | float) -> Samples:
        """E(t) [energy]."""
        return np.asarray(sum(mode.energy(t) for mode in self.modes))

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Kinetic energy of the vibrations [energy]."""
        return np.asarray(sum(mode.kinetic_energy(t) for mode in self.modes))

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Energy of the vibrations, V = E + T [energy]."""
        return np.asarray(sum(mode.vibration_energy(t) for mode in self.modes))

    def energy_slopes(self, t: Samples | float) -> tuple[Samples, Samples]:
        """E' [energy/time] and E'' [energy/time^2]."""
        slopes = [mode.energy_slopes(t) for mode in self.modes]
        return np.asarray(sum(first for first, _ in slopes)), np.asarray(sum(second for _, second in slopes))

    def energy_gradient(self, t: Samples, size: int) -> Samples:
        """Derivatives of E(t) by alpha and, for each mode, omega, cosine and sine, shape (size, n)."""
        rows = [value for mode in self.modes for value in (mode.omega, mode.cosine, mode.sine)]
        return sum_and_jacobian(np.array([self.alpha, *rows]), t - self.modes[0].origin)[1][:size]

    def extrema(self, start: float, end: float) -> tuple[float, ...]:
        """Find the times in (start, end), ascending, where the energy turns [time]."""
        step = 2 * np.pi / self.fastest / _POINTS_PER_PERIOD
        edges = np.linspace(start, end, max(2, int(np.ceil((end - start) / step)) + 1))
        times = _roots(lambda t: self.energy_slopes(t)[0], edges)
        return tuple(t for t in times if min(t - start, end - t) > _ROUNDING / self.fastest)

    def peaks(self, start: float, end: float) -> tuple[float, ...]:
        """Find the times in (start, end), ascending, of the local maxima of the energy [time]."""
        times = np.array(self.extrema(start, end))
        return tuple(times[self.energy_slopes(times)[1] < 0].tolist()) if times.size else ()

    def level_crossings(self, td: float, start: float) -> tuple[float, ...]:
        """Find the times in (start, td), ascending, where the energy passes its level at ``td`` [time]."""
        level = self.energy(td)
        edges = np.array([start, *self.extrema(start, td), td])  # in between the energy is monotone
        return _roots(lambda t: self.energy(t) - level, edges, but=td)


def sum_and_jacobian(parameters: Samples, s: Samples) -> tuple[Samples, Samples]:
    """Return E(s), shape (n,), and its derivatives by the parameters of `Modes.of` with its origin at 0, (p, n)."""
    alpha, *rest = parameters.tolist()
    energy, jacobian = np.zeros(s.size), np.zeros((parameters.size, s.size))
    for i, (omega, cosine, sine) in enumerate(zip(rest[::3], rest[1::3], rest[2::3], strict=True)):
        own, by = energy_and_jacobian(np.array([omega, alpha, cosine, sine, 0.0, 0.0]), s, 4)
        energy += own
        jacobian[0] += by[1]
        jacobian[3 * i + 1] = by[0]
        jacobian[3 * i + 2 : 3 * i + 4] = by[2:]
    return energy, jacobian


def _roots(function: Callable[[Samples], Samples], edges: Samples, but: float = np.inf) -> tuple[float, ...]:
    """Find where ``function`` changes its sign between neighbouring ``edges``, by halving; not at ``but`` itself."""
    values = np.where(edges == but, 0.0, function(edges))
    cells = np.flatnonzero(values[:-1] * values[1:] < 0)
    side = np.sign(values[cells])
    found = narrow(lambda t: side * function(t), edges[cells], edges[cells + 1])
    return tuple(found.at.tolist())
