"""Compute the error band of an identified oscillator's residual due to noise, damping and hidden modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.vibration import measures
from d2rpick.vibration.modes import Mode, compute_deformations
from d2rpick.vibration.span import SMALLEST

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.identify import Identification

# A hidden mode with at most this effect on the squared residual raises only the upper bound of the residual [-].
_HARMLESS: Final = 0.25**2
# Effect of the harmonics of a nonlinear spring on the squared residual, per hidden fraction of the energy [-].
_HARMONIC_COUNTS: Final = 8.0
# Number of tr for which all moved modes are evaluated at once, so that the values fit into the processor cache.
_TOGETHER: Final = 2048


class OscillatorBand:
    """The error band of residuals by an identified oscillator; ``fit`` is accepted, ``td`` is the usual td [time]."""

    def __init__(self, fit: Identification, td: float) -> None:
        assert fit.mode is not None
        self._fit, self._mode, self._td = fit, fit.mode, td

    def bound_residual(
        self, stated: Samples, tr: Samples, td: Samples | float
    ) -> tuple[Samples, Samples, Samples]:
        """Return the residual of each tr (n,) with its lower and upper bound [-].

        If scatter lets the square reach below zero, the middle of the rest is stated: a peak chosen from noise is not
        exact.  A hidden mode is in opposite phase in the worst case, and absent in the best.  If it may raise the
        residual above 0.25, the middle of what is above is stated.

        Parameters
        ----------
        stated : array of shape (n,)
            Residuals by the mode of the fit [-].
        tr : array of shape (n,)
            [time]
        td : float or array of shape (n,)
            [time]
        """
        fit, mode = self._fit, self._mode
        squared = np.square(stated)
        scatter = measures.BAND_DEVIATIONS * self._compute_deviation(tr, td)
        share = measures.phase_share(mode.alpha, mode.omega)
        bent = _HARMONIC_COUNTS * fit.hidden_share * stated
        off = scatter + share * squared + bent
        opposed = _count_opposed(mode, tr, td)
        decayed = _count_decayed(fit, mode, tr, td)
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

    def _compute_deviation(self, tr: Samples, td: Samples | float) -> Samples:
        """Return the standard deviation of the squared residual for each tr (n,), due to uncertain parameters [-]."""
        above, below = self._moved_modes
        if not above:
            return np.zeros(tr.shape)
        is_usual = isinstance(td, float) and td == self._td
        residuals = (
            self._residuals_at_usual_td
            if is_usual
            else _SquaredResiduals([*above, *below], td)
        )
        deviation = np.empty(tr.shape)
        for first in range(0, tr.size, _TOGETHER):
            block = slice(first, first + _TOGETHER)
            squared = residuals.compute(tr, block)
            differences = (squared[: len(above)] - squared[len(above) :]) / 2
            deviation[block] = np.hypot.reduce(differences, axis=0, initial=0.0)
        return deviation

    @cached_property
    def _residuals_at_usual_td(self) -> _SquaredResiduals:
        """The squared residuals of the moved modes at the usual td, which many calls ask for."""
        above, below = self._moved_modes
        return _SquaredResiduals([*above, *below], self._td)

    @cached_property
    def _moved_modes(self) -> tuple[list[Mode], list[Mode]]:
        """Modes with parameters above and below those of the fit, by one standard deviation in independent directions.

        The covariance is scaled to a unit diagonal first: its parameters have different units.
        """
        covariance = self._fit.covariance
        sizes = np.sqrt(np.diag(covariance))
        sizes[sizes == 0] = 1.0
        values, directions = np.linalg.eigh(covariance / np.outer(sizes, sizes))
        steps = [
            np.sqrt(value) * sizes * direction
            for value, direction in zip(values.tolist(), directions.T, strict=True)
            if value > 0
        ]
        return (
            [_move_parameters(self._mode, step) for step in steps],
            [_move_parameters(self._mode, -step) for step in steps],
        )


class _SquaredResiduals:
    """The squared residuals R^2 of modes at one td, or at a td for each tr; what depends on td is computed once."""

    def __init__(self, modes: Sequence[Mode], td: Samples | float) -> None:
        def compute_row(energy: Callable[[Mode], Samples]) -> Samples:
            """Return a value of each mode, shape (m, 1) for one td, else (m, n)."""
            return np.reshape([energy(mode) for mode in modes], (len(modes), -1))

        self._modes = modes
        self._deformations_at_td = compute_row(lambda mode: mode.deformation(td))
        self._kinetic_energies = compute_row(lambda mode: mode.kinetic_energy(td))
        self._energies = compute_row(lambda mode: mode.vibration_energy(td))

    def compute(self, tr: Samples, block: slice) -> Samples:
        """Return R^2 of each mode for each tr (n,) in a block of k times, shape (m, k) [-]."""
        at_td, kinetic, energy = (
            np.broadcast_to(values, (len(self._modes), tr.size))[:, block]
            for values in (
                self._deformations_at_td,
                self._kinetic_energies,
                self._energies,
            )
        )
        differences = compute_deformations(self._modes, tr[block]) - at_td
        return np.asarray((differences**2 + kinetic) / energy)


def _count_opposed(mode: Mode, tr: Samples, td: Samples | float) -> Samples:
    """Return the squared residual of a hidden damped mode whose deformations at tr and td are opposite extremes [-]."""
    return np.asarray(np.square(1 + np.exp(mode.alpha / 2 * (td - tr))))


def _count_decayed(
    fit: Identification, mode: Mode, tr: Samples, td: Samples | float
) -> Samples:
    """Return the squared residual of a mode that the fit omits at tr and that has decayed by td [-].

    At tr, the deformation contains the energy of this mode, which is compared with the remaining vibration energy at
    td.
    """
    if fit.deviations.size == 0:
        return np.zeros(tr.shape)
    energy = np.interp(tr, fit.deviation_times, fit.deviations)
    return np.asarray(energy / mode.vibration_energy(td))


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
