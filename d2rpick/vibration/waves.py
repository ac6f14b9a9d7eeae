"""Determine the sign of a deformation from its square: its zeros, confirmed by a few damped waves.

The root of a part's energy is proportional to its deformation except for the sign, which changes where the energy
passes through zero.  In a record no energy is exactly zero.  But the deformation is smooth: at a zero the root has a
sharp bend unless the sign is changed there; at any other minimum it has one if the sign is changed.

Zeros alone prove no sign.  If a part bends in two planes its energy is the sum of two squares, which is hardly ever
zero, and its root with signs from its minima jumps or bends as no sum of a few waves does.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.histories.samples import find_stretches
from d2rpick.vibration.fitting import find_factors
from d2rpick.vibration.span import estimate_hidden_share

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.modes import Mode

    Complex = NDArray[np.complex128]
    Places = NDArray[np.intp]

# Largest number of waves. More waves would fit almost any record.
_MOST: Final = 6
# _MOST_SAMPLES: largest number of samples in the search for rates, whose cost grows with its third power.
# _LEAST_SAMPLES: smallest number of samples with which six waves can be found.
_MOST_SAMPLES, _LEAST_SAMPLES = 400, 36
# _AS_GOOD: fewer waves are preferred if their misfit is at most this many times the misfit of more waves.
# _ROUNDING: a relative misfit below this is rounding error.
_AS_GOOD, _ROUNDING = 1.5, 1e-12
# Eigenvalues of the product matrix below this share of the largest are rounding errors.
_ROUNDING_OF_SQUARES: Final = 1e-14
# Largest exponent of a wave, since a decaying wave grows without limit before the fitted record.
_LARGEST_EXPONENT: Final = 100.0

# One choice of the sign must be this many times smoother than the other.
# For a chain of two springs at 24 samples per period the least clear of 35 minima had 2.5, usual ones 5 to 60.
_SMOOTHER = 2.0
# While minima are unclear, every second sample is dropped: solver errors hide zeros in fine output.
# Minima keep at least this many samples between them.
_LEAST_APART = 8
# Samples of parts that are processed together, so that they fit into the cache of the processor.
_TOGETHER = 1 << 14
# Signs of five samples around a minimum if the sign changes nowhere, just before the minimum, or just after it.
_TURNS = np.array([[1, 1, 1, 1, 1], [-1, -1, 1, 1, 1], [-1, -1, -1, 1, 1]])
# Largest misfit of the waves as a share of the energy: a wrong sign at one of thirty minima gives 10 times as much.
# Noise of 0.5 % of the highest energy gives 1/10 of it.
_MOST_LEFT: Final = 0.01
# A second plane with this share of the energy hides zeros or produces false ones.
_MOST_HIDDEN: Final = 0.01
# The sign is unclear if the deviation over a quarter period exceeds this share of the vibration energy.
_OFF: Final = 0.2
_MOST_OFF: Final = 0.5  # largest share of the samples with an unclear sign
_ROUNDS: Final = 4  # repetitions until the fitted window contains all clear times


class Waves(NamedTuple):
    r"""A signed deformation as the sum of modes in one part.

    .. math:: q(t) = \mathrm{Re} \sum_i w_i e^{\lambda_i (t - t_0)}

    ``rates`` are the lambda of shape (m,), with positive imaginary and no positive real parts [1/time]; ``weights`` are
    the w [sqrt(energy)]; ``origin`` is t_0 [time].  A vibration is measured by its modes, each with the energies q_i^2
    and (q_i'/w_0i)^2, w_0i its undamped rate.  What crosses between two modes in the energy of a part is zero on
    average over time, and other parts take it back, since the shapes of modes are orthogonal in mass and stiffness.
    """

    rates: Complex
    weights: Complex
    origin: float

    @property
    def alpha(self) -> float:
        """Return the damping, the mean of the waves weighted by their energies [1/time]."""
        return float(
            -2 * np.average(self.rates.real, weights=np.abs(self.weights) ** 2)
        )

    def amplitudes(self, t: Samples | float) -> Samples:
        """Return signed deformations, with the shape of ``t`` and a first axis for waves [sqrt(energy)]."""
        return np.asarray(self._each(t).real)

    def deformation(self, t: Samples | float) -> Samples:
        """Return q(t) [sqrt(energy)]."""
        return np.asarray(self.amplitudes(t).sum(axis=0))

    def energy(self, t: Samples | float) -> Samples:
        """Return q(t)^2 [energy]."""
        return self.deformation(t) ** 2

    def kinetic_energy(self, t: Samples | float) -> Samples:
        """Return the kinetic energy of the modes [energy]."""
        return self._sum_kinetic_energy(self._each(t))

    def vibration_energy(self, t: Samples | float) -> Samples:
        """Return the internal plus kinetic energy of the modes [energy]."""
        waves = self._each(t)
        internal_energy = (waves.real**2).sum(axis=0)
        return np.asarray(internal_energy + self._sum_kinetic_energy(waves))

    def _sum_kinetic_energy(self, waves: Complex) -> Samples:
        """Return the kinetic energy of complex waves, summed over the first axis [energy]."""
        turns = self.rates / np.abs(self.rates)
        turned = waves * turns.reshape(-1, *(1,) * (waves.ndim - 1))
        return np.asarray((turned.real**2).sum(axis=0))

    def _each(self, t: Samples | float) -> Complex:
        """Return the complex waves, with the shape of ``t`` and a first axis for waves."""
        s = np.multiply.outer(self.rates, np.asarray(t, dtype=np.float64) - self.origin)
        waves = np.exp(np.minimum(s.real, _LARGEST_EXPONENT) + 1j * s.imag)
        return np.asarray(waves * self.weights.reshape(-1, *(1,) * np.ndim(t)))


def fit_waves(time: Samples, deformation: Samples) -> Waves | None:
    """Fit as few waves as describe a deformation nearly as well as six; None if nothing oscillates.

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
    windows = np.lib.stride_tricks.sliding_window_view(
        np.interp(even, time, deformation), 2 * even.size // 3
    )
    space = _find_leading_space(windows, 2 * _MOST)
    fits = (
        _fit(space[:, : 2 * count], even[1] - even[0], time, deformation)
        for count in range(1, _MOST + 1)
    )
    usable_fits = [fit for fit in fits if fit]
    if not usable_fits:
        return None
    worst_accepted = max(
        _AS_GOOD * min(misfit for misfit, _ in usable_fits),
        _ROUNDING * float(deformation @ deformation),
    )
    return next(waves for misfit, waves in usable_fits if misfit <= worst_accepted)


def _find_leading_space(windows: Samples, order: int) -> Samples:
    """Return an orthonormal basis of the ``order`` strongest directions of windows (k, m), at most of shape (m, order).

    They come from the eigenvectors of the smaller matrix W W^T, at a third of the cost of all singular vectors.
    Directions below 1e-7 of the strongest are rounding and are left out.
    """
    squares, left = np.linalg.eigh(windows @ windows.T)
    is_seen = squares > _ROUNDING_OF_SQUARES * squares[-1]
    strongest = left[:, is_seen][:, : -order - 1 : -1]
    return np.linalg.qr(windows.T @ strongest)[0]


def _fit(
    space: Samples, step: float, time: Samples, deformation: Samples
) -> tuple[float, Waves] | None:
    """Return the sum of squared misfits and the waves whose windows span ``space``, an orthonormal basis."""
    rates = np.log(find_factors(space)) / step
    rates = rates[rates.imag > np.abs(rates.real)]  # a faster decay is not a vibration
    if not rates.size:
        return None
    rates = (
        np.minimum(rates.real, 0.0) + 1j * rates.imag
    )  # Noise may make a free vibration seem to grow.
    waves = np.exp(np.multiply.outer(time - time[0], rates))
    basis = np.hstack([waves.real, -waves.imag])
    weight = np.abs(
        deformation
    )  # The square root of the energy has half the relative error of the energy.
    solution = np.linalg.lstsq(
        basis * weight[:, np.newaxis], deformation * weight, rcond=None
    )[0]
    remainder = deformation - basis @ solution
    weights = solution[: rates.size] + 1j * solution[rates.size :]
    return float(remainder @ remainder), Waves(rates, weights, float(time[0]))


class Zeros(NamedTuple):
    """Times at which a deformation passes or may pass zero, and the ranges at the ends in which this cannot be seen."""

    sure: Samples
    doubtful: Samples
    unseen: Samples


def find_all_zeros(time: Samples, roots: Samples) -> Iterator[Zeros]:
    """Find the zeros of each row of ``roots``, shape (k, n)."""
    rows = max(1, _TOGETHER // time.size)
    for first in range(0, len(roots), rows):
        yield from _find_zeros(time, roots[first : first + rows])


def _find_zeros(time: Samples, roots: Samples) -> list[Zeros]:
    """Find the zeros of each row from every sample, every second sample and so on, with the fewest doubtful ones."""
    best = _find_zeros_in(time, roots, _find_minima(roots))
    stride = 2
    unsure = _list_unsure(best, range(len(best)))
    while unsure.size:
        coarse = roots[unsure, ::stride]
        minima = _find_minima(coarse)
        apart = coarse.shape[1] >= _LEAST_APART * np.maximum(
            1, np.count_nonzero(minima, axis=1)
        )
        rows = unsure[apart].tolist()
        for row, coarser in zip(
            rows,
            _find_zeros_in(time[::stride], coarse[apart], minima[apart]),
            strict=True,
        ):
            best[row] = min(best[row], coarser, key=lambda zeros: zeros.doubtful.size)
        unsure = _list_unsure(best, rows)
        stride = 2 * stride
    return best


def _list_unsure(zeros: Sequence[Zeros], rows: Iterable[int]) -> Places:
    """Return the row numbers with doubtful zeros."""
    return np.array([row for row in rows if zeros[row].doubtful.size], dtype=np.intp)


def _find_zeros_in(
    time: Samples, roots: Samples, minima: NDArray[np.bool_]
) -> list[Zeros]:
    """Find the zeros of each row from the given samples and minima."""
    row, at = np.nonzero(minima)
    # The curvature of the root needs two samples on both sides, so a minimum closer to an end remains doubtful.
    early = at < 2
    late = at >= time.size - 2
    row_of_zero = row[~early & ~late]
    middle = at[~early & ~late]
    around = middle[:, np.newaxis] + np.arange(-2, 3)
    plain, bend_before, bend_after = _measure_bends(
        time[around], roots[row_of_zero[:, np.newaxis], around] * _TURNS[:, np.newaxis]
    )
    turned = np.minimum(bend_before, bend_after)
    zero = plain > _SMOOTHER * turned
    doubt = ~zero & (turned <= _SMOOTHER * plain)
    left_state = np.where(bend_before < bend_after, middle - 1, middle)[zero]
    low = roots[row_of_zero[zero], left_state]
    high = roots[row_of_zero[zero], left_state + 1]
    share = np.divide(
        low, low + high, out=np.full(left_state.shape, 0.5), where=low + high > 0
    )
    sure = time[left_state] + share * (time[left_state + 1] - time[left_state])
    # The zero of a minimum near an end may lie one sample farther inside.
    ends = np.append(row[early], row[late])
    unseen = np.append(time[at[early] + 1], time[at[late] - 1])
    order = np.argsort(ends, kind="stable")
    tables = (
        (sure, row_of_zero[zero]),
        (time[middle[doubt]], row_of_zero[doubt]),
        (unseen[order], ends[order]),
    )
    parted = (_split_by_row(times, owners, len(roots)) for times, owners in tables)
    return [Zeros(*columns) for columns in zip(*parted, strict=True)]


def _split_by_row(values: Samples, row: Places, rows: int) -> list[Samples]:
    """Split values by row; rows may be empty."""
    edges = np.searchsorted(row, np.arange(rows + 1)).tolist()
    return [values[first:last] for first, last in pairwise(edges)]


def _find_minima(values: Samples) -> NDArray[np.bool_]:
    """Return a mask of the local minima in each row: the first sample of a flat one, and low ends."""
    around = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    return np.asarray((values < around[:, :-2]) & (values <= around[:, 2:]))


def _measure_bends(times: Samples, values: Samples) -> Samples:
    """Return the largest second difference of slopes for each five samples, with any leading axes."""
    slopes = (values[..., 1:] - values[..., :-1]) / (times[:, 1:] - times[:, :-1])
    return np.asarray(
        np.abs(slopes[..., 1:] - slopes[..., :-1]).max(axis=-1, initial=0.0)
    )


class PartMotion(NamedTuple):
    """A ``model`` of a part's vibration, the times at which its sign is ``unclear``, and its ``hidden`` share.

    That is the share of the vibration energy that a further mode may have unseen [-].
    """

    model: Waves | Mode
    unclear: Samples
    hidden: float


def follow_waves(time: Samples, tracked: Samples, zeros: Zeros) -> PartMotion | None:
    """Fit waves to a deformation at times with a clear sign, and use the waves to decide the doubtful signs.

    Parameters
    ----------
    time, tracked : array of shape (n,)
        [time], the root of the energy with the signs that its zeros give [sqrt(energy)].
    zeros : Zeros

    Returns
    -------
    PartMotion or None
        None where no waves follow it.
    """
    root = np.abs(tracked)
    deformation = tracked
    width = max(3, time.size // (2 * zeros.sure.size))
    edges = np.sort(np.concatenate([time[[0, -1]], zeros.doubtful, zeros.unseen]))
    longest = int(np.argmax(np.diff(edges)))
    stretch = slice(*np.searchsorted(time, edges[longest : longest + 2]).tolist())
    for _ in range(_ROUNDS):
        fit = fit_waves(time[stretch], deformation[stretch])
        if fit is None:
            return None
        waves = fit
        modelled = waves.deformation(time)
        miss = (np.abs(modelled) - root) ** 2
        missed = _average_around(miss, width) > _OFF * waves.vibration_energy(time)
        # Times next to it are unclear too, although the mean there contains many correct values.
        is_missed = _average_around(missed.astype(np.float64), width) * width > 0.5
        fitted = stretch
        stretch = max(
            find_stretches(~is_missed),
            key=lambda stretch: stretch.stop - stretch.start,
            default=slice(0, 0),
        )
        if stretch == fitted:
            break
        deformation = np.copysign(root, modelled)
    if (
        np.mean(is_missed) > _MOST_OFF
        or miss[~is_missed].sum() > _MOST_LEFT * (root[~is_missed] ** 2).sum()
    ):
        return None
    hidden = estimate_hidden_share(time[fitted], root[fitted] ** 2, waves)
    return (
        PartMotion(waves, time[is_missed], hidden) if hidden <= _MOST_HIDDEN else None
    )


def _average_around(values: Samples, width: int) -> Samples:
    """Return means over ``width`` values around each value."""
    return np.convolve(values, np.ones(width) / width, mode="same")
