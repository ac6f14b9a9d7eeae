"""Compute the error band of an identified oscillator's residual due to noise, damping and hidden modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration import measures
from d2rpick.vibration.modes import Mode
from d2rpick.vibration.span import SMALLEST

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.identify import Identification

# A hidden mode with at most this effect on the squared residual raises only the upper bound of the residual [-].
_HARMLESS: Final = 0.25**2
# Effect of the harmonics of a nonlinear spring on the squared residual, per hidden fraction of the energy [-].
_HARMONIC_COUNTS: Final = 8.0


def residual_band(
    fit: Identification, stated: Samples, tr: Samples, td: Samples | float
) -> tuple[Samples, Samples, Samples]:
    """Return the residual of each tr (n,) with its lower and upper bound [-].

    If noise makes the band of the square reach below zero, the middle of its remainder is returned, because an extremum
    chosen from noise is not exact. The upper bound assumes a hidden mode in opposite phase, the lower bound none. If a
    hidden mode may raise the residual above 0.25, half of its effect is included in the residual.

    Parameters
    ----------
    fit : Identification
        An accepted fit.
    stated : array of shape (n,)
        Residuals according to the fitted mode [-].
    tr : array of shape (n,)
        [time]
    td : float or array of shape (n,)
        [time]
    """
    assert fit.mode is not None
    mode = fit.mode
    squared = np.square(stated)
    scatter = measures.BAND_DEVIATIONS * _compute_deviation(fit, tr, td)
    share = measures.phase_share(mode.alpha, mode.omega)
    bent = _HARMONIC_COUNTS * fit.hidden_share * stated
    off = scatter + share * squared + bent
    opposed = _count_opposed(fit, tr, td)
    decayed = _count_decayed(fit, tr, td)
    # The misfit may hide a lasting mode or a mode that decays early; the larger effect of the two is assumed.
    hidden = np.maximum(fit.hidden_share * opposed, decayed)
    stated_now, low, high = measures.band_about(
        squared, off, hidden, fit.hidden_share * squared
    )
    # A hidden mode is assumed to exist with a probability of 1/2.
    # The stated residual therefore includes half of the hidden mode's effect beyond the solver error.
    solver_error = SMALLEST * mode.vibration_energy(tr) / mode.vibration_energy(td)
    beyond_solver = np.maximum(
        max(fit.hidden_share - SMALLEST, 0.0) * opposed, decayed - solver_error
    )
    notable = np.maximum(beyond_solver - _HARMLESS, 0.0)
    return np.sqrt(np.square(stated_now) + notable / 2), low, high


def _count_opposed(fit: Identification, tr: Samples, td: Samples | float) -> Samples:
    """Return the squared residual of a hidden damped mode whose deformations at tr and td are opposite extremes [-]."""
    assert fit.mode is not None
    return np.asarray(np.square(1 + np.exp(fit.mode.alpha / 2 * (td - tr))))


def _count_decayed(fit: Identification, tr: Samples, td: Samples | float) -> Samples:
    """Return the squared residual of a mode that the fit omits at tr and that has decayed by td [-].

    At tr, the deformation contains the energy of this mode, which is compared with the remaining vibration energy at
    td.
    """
    assert fit.mode is not None
    if fit.deviations.size == 0:
        return np.zeros(tr.shape)
    energy = np.interp(tr, fit.deviation_times, fit.deviations)
    return np.asarray(energy / fit.mode.vibration_energy(td))


def _compute_deviation(
    fit: Identification, tr: Samples, td: Samples | float
) -> Samples:
    """Return the standard deviation of the squared residual for each tr (n,), due to uncertain fitted parameters [-].

    The covariance is first scaled to a unit diagonal, because the parameters have different units.
    """
    assert fit.mode is not None
    sizes = np.sqrt(np.diag(fit.covariance))
    sizes[sizes == 0] = 1.0
    values, directions = np.linalg.eigh(fit.covariance / np.outer(sizes, sizes))
    deviation: Samples = np.zeros(tr.shape)
    for value, direction in zip(values.tolist(), directions.T, strict=True):
        if value <= 0:
            continue
        step = np.sqrt(value) * sizes * direction
        above = _compute_squared(_move_parameters(fit.mode, step), tr, td)
        below = _compute_squared(_move_parameters(fit.mode, -step), tr, td)
        deviation = np.hypot(deviation, (above - below) / 2)
    return deviation


def _move_parameters(mode: Mode, step: Samples) -> Mode:
    """Return a mode with its first parameters changed by a ``step`` of shape (p,)."""
    parameters = np.array(
        [
            mode.omega,
            mode.alpha,
            mode.cosine,
            mode.sine,
            mode.energy_plastic,
            mode.preload,
        ]
    )
    parameters[: step.size] += step
    omega, alpha, cosine, sine, plastic, preload = parameters.tolist()
    return Mode(omega, alpha, cosine, sine, mode.origin, plastic, preload)


def _compute_squared(mode: Mode, tr: Samples, td: Samples | float) -> Samples:
    """Return the squared residual R^2 of each tr (n,) [-]."""
    lost = mode.separation(tr, td) + mode.kinetic_energy(td)
    return np.asarray(lost / mode.vibration_energy(td))
