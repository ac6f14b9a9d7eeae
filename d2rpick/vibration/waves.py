"""Waves: a deformation with its sign as a sum of damped waves, found by linear algebra alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.vibration.fitting import factors_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

    Waving = NDArray[np.complex128]

# With more of them nearly any record could be described.
_MOST: Final = 6
# Samples in which the rates are sought: the work grows with the third power.  Fewer show too little for six waves.
_MOST_SAMPLES, _LEAST_SAMPLES = 400, 36
# Fewer waves are as good where they leave no more than this many times what more of them do; below, all is rounding.
_AS_GOOD, _ROUNDING = 1.5, 1e-12
# Of the exponent: beyond the record that was fitted a decay grows backwards without end.
_LARGEST_EXPONENT: Final = 100.0


class Waves(NamedTuple):
    r"""A signed deformation, the sum of the modes that meet in one part.

    .. math:: q(t) = \mathrm{Re} \sum_i w_i e^{\lambda_i (t - t_0)}

    ``rates`` are the lambda of shape (m,), with positive imaginary and no positive real parts [1/time]; ``weights`` are
    the w [sqrt(energy)]; ``origin`` is t_0 [time].  A vibration is measured by its modes, each with the energies q_i^2
    and (q_i'/w_0i)^2, w_0i its undamped rate.  What crosses between two modes in the energy of a part is zero on
    average over time, and other parts take it back, since the shapes of modes are orthogonal in mass and stiffness.
    """

    rates: Waving
    weights: Waving
    origin: float

    @property
    def alpha(self) -> float:
        """Damping, the mean of the waves by their energies [1/time]."""
        return float(-2 * np.average(self.rates.real, weights=np.abs(self.weights) ** 2))

    def amplitudes(self, t: Samples | float) -> Samples:
        """Signed deformations of all waves, of the shape of ``t`` with an axis before it [sqrt(energy)]."""
        return np.asarray(self._each(t).real)

    def deformation(self, t: Samples | float) -> Samples:
        """q(t) [sqrt(energy)]."""
        return np.asarray(self.amplitudes(t).sum(axis=0))

    def energy(self, t: Samples | float) -> Samples:
        """q(t)^2 [energy]."""
        return self.deformation(t) ** 2

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Kinetic energy of the modes [energy]."""
        turned = (self.rates / np.abs(self.rates)).reshape(-1, *(1,) * np.ndim(t))
        return np.asarray(((self._each(t) * turned).real ** 2).sum(axis=0))

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Internal and kinetic energy of the modes [energy]."""
        return np.asarray((self.amplitudes(t) ** 2).sum(axis=0) + self.kinetic_energy(t))

    def _each(self, t: Samples | float) -> Waving:
        s = np.multiply.outer(self.rates, np.asarray(t, dtype=np.float64) - self.origin)
        waves = np.exp(np.minimum(s.real, _LARGEST_EXPONENT) + 1j * s.imag)
        return np.asarray(waves * self.weights.reshape(-1, *(1,) * np.ndim(t)))


def fit_waves(time: Samples, deformation: Samples) -> Waves | None:
    """Fit as few waves as describe a deformation nearly as well as six do; None where nothing swings.

    Parameters
    ----------
    time, deformation : array of shape (n,)
        Ascending [time], [sqrt(energy)].

    Notes
    -----
    Windows of equidistant samples lie in the space that the windows of the waves span (Barkhuijsen et al., Journal of
    Magnetic Resonance 73, 1987).

    Examples
    --------
    >>> t = np.linspace(0.0, 6.0, 301)
    >>> found = fit_waves(t, np.exp(-0.1 * t) * np.sin(5.0 * t) + 0.5 * np.exp(-0.1 * t) * np.cos(8.0 * t))
    >>> [f"{rate.real:.6f} {rate.imag:.6f}" for rate in sorted(found.rates, key=lambda rate: rate.imag)]
    ['-0.100000 5.000000', '-0.100000 8.000000']
    """
    if time.size < _LEAST_SAMPLES or not np.any(deformation):
        return None
    inner = time[:: -(-time.size // _MOST_SAMPLES)]
    even = np.linspace(inner[0], inner[-1], inner.size)
    windows = np.lib.stride_tricks.sliding_window_view(np.interp(even, time, deformation), 2 * even.size // 3)
    space = np.linalg.svd(windows, full_matrices=False)[2]
    fits = (_fit(space[: 2 * count].T, even[1] - even[0], time, deformation) for count in range(1, _MOST + 1))
    found = [fit for fit in fits if fit]
    if not found:
        return None
    most = max(_AS_GOOD * min(left for left, _ in found), _ROUNDING * float(deformation @ deformation))
    return next(waves for left, waves in found if left <= most)


def _fit(space: Samples, step: float, time: Samples, deformation: Samples) -> tuple[float, Waves] | None:
    """Sum of squares that is left, and the waves whose windows span ``space``, an orthonormal basis in columns."""
    rates = np.log(factors_of(space)) / step
    rates = rates[rates.imag > np.abs(rates.real)]  # what decays faster is no vibration
    if not rates.size:
        return None
    rates = np.minimum(rates.real, 0.0) + 1j * rates.imag  # noise lets a free vibration grow
    waves = np.exp(np.multiply.outer(time - time[0], rates))
    basis = np.hstack([waves.real, -waves.imag])
    weight = np.abs(deformation)  # what is off in an energy is off by so much less in its root
    found = np.linalg.lstsq(basis * weight[:, np.newaxis], deformation * weight, rcond=None)[0]
    rest = deformation - basis @ found
    weights = found[: rates.size] + 1j * found[rates.size :]
    return float(rest @ rest), Waves(rates, weights, float(time[0]))
