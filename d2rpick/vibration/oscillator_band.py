"""How far the residual of an identified oscillator may be off: by scatter, by damping, and by a mode that hides."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration import measures
from d2rpick.vibration.modes import Mode

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.identify import Identification

# Standard deviations of R^2 to either side.
_DEVIATIONS: Final = 2.5
# A hidden share may be the harmonics of a spring that is not linear: between its peaks, which stay in step, R is then
# off by up to half of so many times the share.
_HARMONIC_COUNTS: Final = 8.0


def residual_band(
    fit: Identification, stated: Samples, tr: Samples, td: Samples | float
) -> tuple[Samples, Samples, Samples]:
    """Give the residual of each tr (n,), and the lowest and highest that the record allows [-].

    Where scatter lets the square reach below zero, the middle of the rest is stated: a peak that is picked from noise
    is not exact.  A mode that hides stood opposed at worst, and is left out at best.

    Parameters
    ----------
    fit : Identification
        Accepted.
    stated : array of shape (n,)
        Residuals by its mode [-].
    tr : array of shape (n,)
        [time]
    td : float or array of shape (n,)
        [time]
    """
    assert fit.mode is not None
    mode, squared = fit.mode, np.square(stated)
    scatter = _DEVIATIONS * _deviation(fit, tr, td)
    share = measures.phase_share(mode.alpha, mode.omega)
    bent = _HARMONIC_COUNTS * fit.hidden_share * stated
    off = scatter + share * squared + bent
    hidden = fit.hidden_share * _opposed(fit, tr, td)
    return measures.band_about(squared, off, hidden, fit.hidden_share * squared)


def _opposed(fit: Identification, tr: Samples, td: Samples | float) -> Samples:
    """R^2 of a mode that stood at tr at one end of its swing, and at td at the other, smaller by its damping [-]."""
    assert fit.mode is not None
    return np.asarray(np.square(1 + np.exp(fit.mode.alpha / 2 * (td - tr))))


def _deviation(fit: Identification, tr: Samples, td: Samples | float) -> Samples:
    """Give the standard deviation of R^2 of each tr (n,), by what scatter does to the parameters of the fit [-]."""
    assert fit.mode is not None
    values, directions = np.linalg.eigh(fit.covariance)
    deviation: Samples = np.zeros(tr.shape)
    for value, direction in zip(values.tolist(), directions.T, strict=True):
        if value <= 0:
            continue
        step = np.sqrt(value) * direction
        above, below = (
            _squared(_moved(fit.mode, way), tr, td) for way in (step, -step)
        )
        deviation = np.hypot(deviation, (above - below) / 2)
    return deviation


def _moved(mode: Mode, step: Samples) -> Mode:
    """Give a mode whose first parameters are off by a ``step`` of shape (p,)."""
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


def _squared(mode: Mode, tr: Samples, td: Samples | float) -> Samples:
    """R^2 of each tr (n,) [-]."""
    lost = mode.separation(tr, td) + mode.kinetic_energy(td)
    return np.asarray(lost / mode.vibration_energy(td))
