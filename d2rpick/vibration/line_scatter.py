"""Compute the uncertainty of residuals that are derived from spectral lines fitted to a noisy record.

The lines are the least-squares fit of a sum of decaying waves, so the scatter of the record about them gives the
covariance of their weights and poles, and the gradient of R^2 by these gives the standard deviation of R^2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.data_classes import dataclass

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Exponentials, Grid
    from d2rpick.vibration.midpoint import Reading

# Upper limit of the correlation of neighbouring misfits [-], so that some of the states remain independent.
MOST_SHARED: Final = 0.9
# Prior standard deviation of the frequency of a line, in cycles over the record [-].
# The prior limits the uncertainty of spurious lines that are fitted to noise.
_LOOSE_TURNS: Final = 0.5


@dataclass(frozen=True, eq=False, repr=False)
class LineScatter:
    """Standard deviation of the squared residual if the lines on a ``grid`` are assigned to modes as in ``reading``.

    ``systematic`` is the fraction of the misfit that neighbouring states have in common [-].
    """

    reading: Reading
    grid: Grid
    systematic: float

    def compute_deviation(
        self, tr: Samples | float, td: Samples | float, squared: Samples
    ) -> Samples:
        """Return the standard deviation of the ``squared`` residual of pairs of broadcastable times [-]."""
        tr, td = np.broadcast_arrays(
            np.asarray(tr, dtype=np.float64), np.asarray(td, dtype=np.float64)
        )
        gradient = self._compute_gradient(tr.ravel(), td.ravel(), np.ravel(squared))
        deviation = np.linalg.norm(gradient @ self._spread, axis=1)
        return np.asarray(deviation.reshape(tr.shape))

    @cached_property
    def _spread(self) -> Samples:
        """Return a square root of the parameters' covariance matrix, shape (p, p)."""
        spectrum = self.reading.spectrum
        design = spectrum.differentiate_means(self.grid)
        freedom = max(self.grid.time.size - design.shape[1], 1)
        shared = min(self.systematic, MOST_SHARED)
        # The number of independent states follows from a first-order autoregressive model.
        variance = np.sum(spectrum.rest**2) / freedom * (1 + shared) / (1 - shared)
        if variance <= 0:
            return np.zeros((design.shape[1], 1))
        loose = self._list_loose_scatters()
        scaled = design * loose / np.sqrt(variance)
        # The inverse variances of the fit and of the prior are added.
        information, directions = np.linalg.eigh(scaled.T @ scaled)
        roots = directions / np.sqrt(1 + np.maximum(information, 0.0))
        return np.asarray(roots * loose[:, np.newaxis])

    def _list_loose_scatters(self) -> Samples:
        """Return the prior standard deviation of each parameter, shape (p,)."""
        spectrum = self.reading.spectrum
        lines = spectrum.lines
        sizes = np.maximum(np.abs(lines.weights), self.reading.tiny)
        decays = np.abs(lines.poles.real) + 1 / self.grid.span
        rates = np.full(sizes.shape, 2 * np.pi * _LOOSE_TURNS / self.grid.span)
        of_mean = np.maximum(np.abs(spectrum.mean.weights), self.reading.tiny)
        return np.concatenate([sizes, sizes, decays, rates, of_mean])

    def _compute_gradient(self, tr: Samples, td: Samples, squared: Samples) -> Samples:
        """Differentiate the ``squared`` residual with respect to all parameters, shape (n, p) [1/energy, time/1].

        R^2 = 1 + [V(tr) - 2 V(m) + H(m) - C(tr, td)] / H(td), which neglects the small change of U within a period.
        """
        reading = self.reading
        lines = reading.spectrum.lines
        middle = (tr + td) / 2
        lost = lines.differentiate(tr) - 2 * lines.differentiate(middle)
        raised = (1 + reading.hidden_pairs) * np.tile(reading.is_mode, 4)
        lost = lost - _differentiate_coherence(lines, tr, td) * raised
        of_level = np.zeros_like(lost)
        of_mean = np.zeros((tr.size, reading.spectrum.mean.poles.size))
        level_of_mean = np.zeros_like(of_mean)
        if reading.no_static:
            of_mean += reading.spectrum.mean.waves(tr).real
            level_of_mean += 2 * reading.spectrum.mean.waves(td).real
        else:
            lost = lost * np.tile(reading.is_mode, 4)
            lost += _differentiate_level(lines, tr) * raised / 2
            of_level += _differentiate_level(lines, td) * raised
        gradient = np.hstack([lost, of_mean])
        level_gradient = np.hstack([of_level, level_of_mean])
        level = reading.level(td)
        return np.asarray(
            (gradient - (squared - 1)[:, np.newaxis] * level_gradient)
            / level[:, np.newaxis]
        )


def _differentiate_level(waves: Exponentials, times: Samples) -> Samples:
    """Return the derivatives of H, twice the sum of the amplitudes of the decaying waves, shape (n, 4 k)."""
    return _differentiate_coherence(waves, times, times)


def _differentiate_coherence(waves: Exponentials, tr: Samples, td: Samples) -> Samples:
    """Return the derivatives of C, the sum of 2 |w| exp(Re p m) cos(Im p tau / 2), shape (n, 4 k)."""
    sizes = np.maximum(np.abs(waves.weights), 1e-300)
    since_origin = ((tr + td) / 2 - waves.origin)[:, np.newaxis]
    half_apart = ((td - tr) / 2)[:, np.newaxis]
    decayed = 2 * np.exp(since_origin * waves.poles.real)
    cosine = decayed * np.cos(half_apart * waves.poles.imag)
    sine = decayed * np.sin(half_apart * waves.poles.imag)
    return np.hstack(
        [
            cosine * waves.weights.real / sizes,
            cosine * waves.weights.imag / sizes,
            cosine * sizes * since_origin,
            -sine * sizes * half_apart,
        ]
    )
