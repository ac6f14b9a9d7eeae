r"""Compute the error of any pair of times, for any number of modes, from the energy at tr, td and midway between them.

A linear structure in free flight has modes :math:`q_k = a_k e^{-g_k t} \cos(w_k t + p_k)`, scaled so that the elastic
energy of the vibration is :math:`V = \sum q_k^2`.  With m halfway between tr and td and :math:`\tau` from tr to td,

.. math::
    X = \sum q_k(t_r) q_k(t_d) = V(m) - H(m)/2 + C(m, \tau)/2

    H(t) = \sum h_k e^{-2 g_k t}, \quad C(t, \tau) = \sum h_k e^{-2 g_k t} \cos(w_k \tau), \quad h_k = a_k^2

    R^2 = 1 + [V(t_r) - 2 X] / U(t_d)

The formulas are exact for any damping of the modes. They follow from 2 cos a cos b = cos(a + b) + cos(a - b), where (a
+ b)/2 is the phase at m. V is the recorded energy. H and C follow from its lines: a mode with the peak energy h has a
line of height h/2 at twice its frequency and twice its decay rate (docs/explanation/midpoint.md).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass
from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Complex, Exponentials, Spectrum

    Mask = NDArray[np.bool_]


class PairEnergies(NamedTuple):
    """The elastic energies at tr and at td, the product of both deformations, and the coherence of the modes [energy].

    Noise may make elastic energies negative.
    """

    elastic_energy_tr: Samples
    elastic_energy_td: Samples
    overlap: Samples
    coherence: Samples


@dataclass(frozen=True, eq=False, repr=False)
class Reading:
    """An interpretation of a spectrum: which of its lines are modes.

    ``is_mode`` (k,) marks the lines that are modes; the others are due to a static deformation. If ``no_static`` is
    True, all of the mean energy is vibration energy; otherwise the mean energy contains half of the mode energies, and
    its remainder is static. ``rest`` is the part of the misfit that is added to the spectrum [energy], at ``times``
    [time]. ``tiny`` is the smallest divisor of energies [energy].

    ``hidden_pairs`` is the energy of pairs of modes with equal frequencies and opposite phases, whose lines cancel each
    other, relative to the energy of the visible modes [-].
    """

    spectrum: Spectrum
    is_mode: Mask
    no_static: bool
    times: Samples
    rest: Samples
    tiny: float
    hidden_pairs: float = 0.0

    @cached_property
    def modes(self) -> Exponentials:
        """Return the lines of the modes."""
        return self.spectrum.lines.some(self.is_mode)

    @cached_property
    def _other_lines(self) -> Exponentials:
        """Return the lines that are not those of modes."""
        return self.spectrum.lines.some(~self.is_mode)

    @cached_property
    def _peak_energies(self) -> Samples:
        """Return the peak energy of each mode at the time origin [energy]."""
        return 2 * (1 + self.hidden_pairs) * np.abs(self.modes.weights)

    def elastic_energy(self, t: Samples | float) -> Samples:
        """Return V, the elastic energy of the vibration [energy], in the shape of ``t``; noise may make it negative."""
        t = np.asarray(t, dtype=np.float64)
        energy = self.modes.at(t) + np.interp(t, self.times, self.rest)
        if self.no_static:
            return np.asarray(
                energy + self.spectrum.mean.at(t) + self._other_lines.at(t)
            )
        return np.asarray(energy + self.level_of_modes(t) / 2)

    def level_of_modes(self, t: Samples | float) -> Samples:
        """Return the sum of the mode energies according to their lines, in the shape of ``t`` [energy]."""
        decays = self.modes._replace(
            poles=self.modes.poles.real.astype(np.complex128),
            weights=self._peak_energies.astype(np.complex128),
        )
        return decays.at(t)

    def level(self, t: Samples | float) -> Samples:
        """Return the peak energy H of all modes, averaged over a period, in the shape of ``t`` [energy]."""
        if self.no_static:
            level = 2 * self.spectrum.mean.at(t)
        else:
            level = self.level_of_modes(t)
        return np.maximum(level, self.tiny)

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return U = V + T, the elastic and kinetic energy of the vibration, in the shape of ``t`` [energy]."""
        return np.maximum(self.level(t) + self._within_period.at(t), self.tiny)

    @cached_property
    def _within_period(self) -> Exponentials:
        """Return how damping, which acts only during motion, changes the energy of each mode within a period."""
        poles = self.modes.poles
        damping = -poles.real / np.abs(poles)
        # With the damping ratio z, the change at the phase theta is z (z cos 2 theta + sqrt(1 - z^2) sin 2 theta).
        turned = damping * (damping - 1j * np.sqrt(1 - damping**2))
        return self.modes._replace(weights=2 * self.modes.weights * turned)

    def energies_of_modes(self, t: float) -> Samples:
        """Return the vibration energy of each mode at a time, at least 0, shape (k,) [energy]."""
        decayed = self._peak_energies * np.abs(self.modes.waves(t))
        within_period = self._within_period
        return np.maximum(
            decayed + (within_period.waves(t) * within_period.weights).real, 0.0
        )

    def coherence(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return C, the coherence of the modes after td - tr, for broadcastable times [energy]."""
        return np.asarray(
            np.einsum("...k,...k->...", self.earlier(tr), self.later(td)).real
        )

    def earlier(self, tr: Samples | float) -> Complex:
        """Return the tr-dependent factor of the coherence [energy]; the last axis indexes the modes."""
        half = self.modes._replace(poles=self.modes.poles.conj() / 2)
        return half.waves(tr) * self._peak_energies

    def later(self, td: Samples | float) -> Complex:
        """Return the td-dependent factor of the coherence [-]; the last axis indexes the modes."""
        return self.modes._replace(poles=self.modes.poles / 2).waves(td)

    def overlap(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return X, the product of the deformations at tr and td [energy].

        The product is clipped to its bounds, because noise or a wrong model may cause values beyond them.
        """
        return self.compare(tr, td).overlap

    def compare(self, tr: Samples | float, td: Samples | float) -> PairEnergies:
        """Return what is known of pairs of times, which may be broadcast."""
        middle = (np.asarray(tr) + td) / 2
        level = self.level(middle)
        coherence = self.coherence(tr, td)
        free = self.elastic_energy(middle) - level / 2 + coherence / 2
        at_tr = self.elastic_energy(tr)
        at_td = self.elastic_energy(td)
        # The largest possible product of deformations with these elastic energies.
        bound = np.sqrt(np.maximum(at_tr, 0.0) * np.maximum(at_td, 0.0))
        return PairEnergies(at_tr, at_td, np.clip(free, -bound, bound), coherence)

    def residual_squared(self, tr: Samples | float, td: Samples | float) -> Samples:
        """Return the squared residual R^2 of pairs of times [-]."""
        return self.square_residual(self.compare(tr, td), td)

    def square_residual(self, pairs: PairEnergies, td: Samples | float) -> Samples:
        """Return the squared residual R^2 of pairs of times that were compared [-]."""
        lost = pairs.elastic_energy_tr - 2 * pairs.overlap
        return np.maximum(1 + lost / self.vibration_energy(td), 0.0)
