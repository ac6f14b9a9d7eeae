"""Fit the energy of one vibration mode to samples by least squares; no initial guess is required.

All quantities are scaled: the time s runs from 0 to 1 over the record, and energies are in units of the record's range.
A parameter vector is (omega, alpha, cosine, sine, energy_plastic, preload) of

    E(s) = energy_plastic + q**2,  q = preload + exp(-alpha s/2) (cosine cos(omega s) + sine sin(omega s)).

The misfit may be white noise; its structure, i.e. the part that neighbouring samples share, must be small.
"""

from __future__ import annotations

from functools import partial, reduce
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import integrate_by_trapezia
from d2rpick.vibration.modes import BLOCK, prepare_energy_and_jacobian

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples

    # A function that returns energies (n,) at n times, and a function that computes their derivatives (p, n) with
    # respect to p parameters.
    Model = Callable[[Samples, Samples], tuple[Samples, Callable[[], Samples]]]


# Numbers of free parameters of three models: vibration, vibration with plastic work, vibration with preload.
VIBRATION, WITH_PLASTIC, WITH_PRELOAD = 4, 5, 6

# Numbers of exponentials in q**2 that the matrix-pencil method tries, one for each of the three models.
_ORDERS: Final = (3, 4, 6)
# Window length of the matrix-pencil method [cells]; 1/3 of _MIN_CELLS minimises the error due to noise.
_LAGS: Final = 64
# Smallest number of cells into which the record is divided.
_MIN_CELLS: Final = 192
# Largest number of cells into which the record is divided; it limits the memory of the method to 5 MB.
_MAX_CELLS: Final = 8192
# Smallest number of cells per period of the strongest oscillation of the energy.
_CELLS_PER_PERIOD: Final = 24

# Number of samples used for the initial comparison and refinement of starting values.
COARSE: Final = 400
# Number of samples in an intermediate fit. If this fit is poor, no fit to all samples follows.
_MEDIUM: Final = 2048
# The refinement stops after a step that reduces the misfit by less than this fraction [-].
_NEAR: Final = 1e-6
# Largest accepted rms misfit, relative to the standard deviation of the energy [-]; more may hide another mode.
MAX_MISFIT: Final = 0.4
# Safety factor on the largest accepted variance of the misfit if only some of the samples are used [-].
_FAR_TOO_MUCH: Final = 1.2
# Maximum number of starting values to refine; more than one, because the first may not be the best.
STARTS: Final = 3
# No second starting value is tried if the first one leaves less than this fraction of the variance unexplained [-].
CERTAIN: Final = 0.01
# Largest number of steps of a refinement.
_MAX_STEPS: Final = 40
# Smallest phase angle that a vibration passes through in the record [rad], i.e. 1/10 period; less is a drift.
# In a test with 1,100 slow drifts, no refined fit to all samples showed a vibration.
_DRIFT: Final = 0.1 * 2 * np.pi

# A parameter has no effect if the derivative of the scaled energy with respect to it is smaller than this [-].
_NO_EFFECT: Final = 1e-100
# Largest accepted rms of the misfit that neighbouring samples share, relative to the energy's standard deviation [-].
MAX_STRUCTURE: Final = 0.02
# A misfit has structure if its covariance exceeds that of white noise by more than this [standard deviations].
_DEVIATIONS: Final = 3.0
# The structure is certain if the covariance exceeds that of white noise by this [standard deviations].
_BEYOND_DOUBT: Final = 6.0
# A fit to some of the samples is rejected at once if its systematic misfit exceeds MAX_STRUCTURE by this factor [-];
# a fit to all samples would be rejected too.
_BEYOND_STRUCTURE: Final = 2.0


def fit_few(
    poles: NDArray[np.complex128], s: Samples, e: Samples, size: int, worst: float
) -> Samples | None:
    """Return least-squares parameters for a selection of samples.

    The first ``size`` parameters are free, the others zero.

    The result is None if the fit leaves more than the fraction ``worst`` of the variance. It is also None if ``worst``
    is finite and the misfit has too much structure.
    """
    few_states = _take_few(s, e)
    model = partial(prepare_energy_and_jacobian, size=size)
    best = refine(
        _find_starts(poles, *few_states, size=size), model, *few_states, worst
    )
    quick = np.isfinite(worst)
    if best is None or (quick and _is_structured(best, model, *few_states)):
        return None
    return best


def fit(
    few: Samples | None, s: Samples, e: Samples, size: int, worst: float = np.inf
) -> Samples | None:
    """Fit all samples, starting from the parameters of `fit_few`; None if the misfit is too large."""
    best = fit_all(few, partial(prepare_energy_and_jacobian, size=size), s, e, worst)
    if best is None:
        return None
    if best[5] < 0:  # q and -q describe the same energy.
        best[[2, 3, 5]] *= -1
    if best[0] < 0:
        best[[0, 3]] *= -1
    return best


def fit_all(
    best: Samples | None,
    model: Model,
    s: Samples,
    e: Samples,
    worst: float,
) -> Samples | None:
    """Return the best fit to all samples, starting from the ``best`` fit to a selection of them.

    The result is None if ``best`` is None, or if ``worst`` is finite and the misfit of some of the samples has too much
    structure. Fits with far too large a misfit, and drifts, are not refined for all samples: they will be refused and
    would converge slowly.
    """
    if best is None or s.size <= COARSE:
        return best
    some_states = _take_few(s, e, _MEDIUM)
    if some_states[0].size < s.size:
        best, left_over = refine_parameters(best, model, *some_states, near=_NEAR)
        if np.isfinite(worst) and _is_structured(best, model, *some_states):
            return None
        variance = some_states[0].size * float(np.var(some_states[1]))
        if left_over > _FAR_TOO_MUCH * MAX_MISFIT**2 * variance or _is_drift(best):
            return best
    return refine_parameters(best, model, s, e)[0]


def _is_drift(parameters: Samples) -> bool:
    """Return True if the frequency is so low that a fit with all samples would still be a drift."""
    return bool(abs(parameters[0]) < _DRIFT)


def _take_few(s: Samples, e: Samples, most: int = COARSE) -> tuple[Samples, Samples]:
    """Return evenly spaced samples, at most ``most``; the default is the number used to compare starting values."""
    stride = -(-s.size // most)
    return s[::stride], e[::stride]


def refine(
    starts: Sequence[Samples], model: Model, s: Samples, e: Samples, worst: float
) -> Samples | None:
    """Refine the starting values; return the best fit, or None if its misfit exceeds ``worst`` times the variance."""
    variance = float(np.sum((e - np.mean(e)) ** 2))
    best = None
    least_cost = worst * variance
    for start in starts:
        parameters, cost = refine_parameters(start, model, s, e, worst * variance)
        if cost <= least_cost:
            best, least_cost = parameters, cost
        if least_cost < CERTAIN * variance:
            break
    return best


def _is_structured(parameters: Samples, model: Model, s: Samples, e: Samples) -> bool:
    """Return True if the misfit on evenly spaced samples is large enough to refuse the fit to all samples."""
    return has_clear_structure(e - model(parameters, s)[0], float(np.std(e)))


class Pencil(NamedTuple):
    """Signal subspace of the exponentials in the energy: singular vectors of its Hankel matrix, shape (lags, lags).

    Matrix pencil (Hua and Sarkar, IEEE Trans. ASSP 38, 1990): the leading right singular vectors of the Hankel matrix
    of equidistant values span the exponentials, and a shift by one cell multiplies each exponential by exp(p h). The
    means of an exponential over cells form an exponential with the same p, so dense records can be averaged over cells.
    """

    vectors: Samples
    cells: int

    @classmethod
    def of(cls, s: Samples, e: Samples) -> Pencil:
        """Compute the singular vectors in descending order of their contribution to the energy."""
        running = integrate_by_trapezia(s, e)
        fine = average_cells(s, running, min(s.size - 1, _MAX_CELLS))
        power = np.abs(np.fft.rfft(fine - np.mean(fine))) ** 2
        periods = int(
            np.argmax(power * np.arange(power.size))
        )  # The power is weighted per octave, so that decays are not preferred.
        count = min(
            max(_CELLS_PER_PERIOD * periods, _MIN_CELLS), s.size - 1, _MAX_CELLS
        )
        cells = average_cells(s, running, count)
        hankel = np.lib.stride_tricks.sliding_window_view(
            cells, min(_LAGS, count // 2) + 1
        )
        return cls(np.linalg.eigh(hankel.T @ hankel)[1][:, ::-1], count)

    def rates(self, orders: tuple[int, ...] = _ORDERS) -> NDArray[np.complex128]:
        """Return the complex exponents p of the oscillating terms exp(p s) that the energy may contain.

        The real part of p is the negative damping rate, and its imaginary part the positive angular frequency.

        ``orders`` lists the numbers of exponentials to try.
        """
        z = np.concatenate([find_factors(self.vectors[:, :order]) for order in orders])
        return np.asarray(np.log(z[z.imag > 0]) * self.cells)


def find_factors(vectors: Samples) -> NDArray[np.complex128]:
    """Return the factors z of exponentials z**k whose windows over k are spanned by ``vectors`` (n, order).

    A shift by one value maps the space of the windows onto itself; its eigenvalues are the factors.
    """
    shift = np.linalg.lstsq(vectors[:-1], vectors[1:], rcond=None)[0]
    return np.linalg.eigvals(shift).astype(np.complex128)


def average_cells(s: Samples, running: Samples, count: int) -> Samples:
    """Return the means of the energy over equal cells of [0, 1], from its ``running`` integral over s."""
    return np.asarray(
        np.diff(np.interp(np.linspace(0, 1, count + 1), s, running)) * count
    )


def _find_starts(
    poles: NDArray[np.complex128], s: Samples, e: Samples, *, size: int
) -> list[Samples]:
    """Return the best parameter vectors to start a fit from, for a model with ``size`` free parameters.

    A rate p belongs to q**2 (alpha = -Re p, omega = Im p / 2) or, with a preload, to q (alpha = -2 Re p, omega = Im p).
    For given rates, E is linear in products of the other parameters. A linear fit of these products ranks the rates and
    gives the parameters.
    """
    omega = poles.imag / 2
    alpha = -poles.real
    if size == WITH_PRELOAD:
        omega = np.concatenate((omega, 2 * omega))
        alpha = np.concatenate((alpha, 2 * alpha))
    alpha = np.maximum(
        alpha, -1.0
    )  # The limit prevents an overflow of exp. Growing vibrations are refused later.
    vibration = np.exp(s * (1j * omega - alpha / 2)[:, None])
    square = vibration * vibration
    rows = [
        np.abs(square),
        square.real,
        square.imag,
        np.ones(square.shape),
        vibration.real,
        vibration.imag,
    ]
    basis = np.stack(
        rows[: {VIBRATION: 3, WITH_PLASTIC: 4, WITH_PRELOAD: 6}[size]], axis=1
    )
    norm = np.linalg.norm(basis, axis=2)
    normal = basis @ basis.transpose(0, 2, 1) / (norm[:, :, None] * norm[:, None, :])
    projections = (basis @ e / norm)[..., None]
    linear = (
        np.linalg.solve(normal + 1e-10 * np.eye(norm.shape[1]), projections)[..., 0]
        / norm
    )
    misfit = np.sum((e - (linear[:, None] @ basis)[:, 0]) ** 2, axis=1)
    linear = np.pad(linear, ((0, 0), (0, 6 - linear.shape[1])))
    # The fitted coefficients at the double frequency are (cosine + i sine)**2 / 2.
    phasor = np.sqrt(2 * (linear[:, 1] + 1j * linear[:, 2]))
    # The fitted coefficients at the single frequency are 2 preload (cosine + i sine).
    mixed = linear[:, 4] + 1j * linear[:, 5]
    preload = (mixed * phasor.conj()).real / (2 * np.abs(phasor) ** 2 + 1e-12)
    plastic = linear[:, 3] - preload**2
    table = np.stack((omega, alpha, phasor.real, phasor.imag, plastic, preload), axis=1)
    best: list[Samples] = []
    for start in table[np.argsort(misfit)]:
        # Two starting values lead to the same minimum if their phases over the record differ by less than 0.5 rad.
        if all(
            abs(start[0] - start_before[0]) > 0.5
            or abs(start[1] - start_before[1]) > 0.5
            for start_before in best
        ):
            best.append(start)
    return best[:STARTS]


@np.errstate(
    over="ignore", invalid="ignore"
)  # Overflow is ignored, because steps that are too large are rejected.
def refine_parameters(
    parameters: Samples,
    model: Model,
    s: Samples,
    e: Samples,
    hopeless: float = np.inf,
    near: float = 1e-12,
) -> tuple[Samples, float]:
    """Refine parameters by the Levenberg-Marquardt method; return them and the sum of squares.

    Parameters without derivatives are kept. The iteration ends if a step reduces the sum of squares by less than the
    fraction ``near``. It ends early if such steps cannot reach the sum ``hopeless``, or after more steps than usual if
    the fit is ``doomed`` to be refused.
    """
    # The damping of the Levenberg-Marquardt method is small, because the starting values are good.
    damping = 1e-4
    equations = _build_normal_equations(parameters, model, s, e)
    if equations is None:  # The energies are not numbers.
        return parameters, np.nan
    for steps_left in range(_MAX_STEPS, 0, -1):
        step = equations.solve(damping)
        trial = parameters.copy()
        trial[: step.size] += step
        expected = float(step @ equations.gradient)
        trial_equations = _build_normal_equations(trial, model, s, e, equations.cost)
        if trial_equations:
            parameters, equations = trial, trial_equations
            damping = max(damping / 10, 1e-10)
            if steps_left * expected < equations.cost - hopeless:
                break
        else:
            damping *= 10
        if expected <= near * equations.cost + 1e-31 * e.size:
            break
    return parameters, equations.cost


class _NormalEquations:
    """Squared misfit ``cost``, and the equations whose solution is a step (p,) of p parameters.

    The ``gradient`` (p,) is J times the misfit, where J contains the derivatives of the energies. ``normal`` is J J^T,
    shape (p, p).
    """

    def __init__(self, cost: float, normal: Samples, gradient: Samples) -> None:
        self.cost = cost
        self.gradient = gradient
        self._scale = np.sqrt(normal.diagonal()) + 1e-150
        self._scaled_normal = normal / (self._scale * self._scale[:, None])
        self._scaled_gradient = gradient / self._scale

    def solve(self, damping: float) -> Samples:
        """Return the step if ``damping`` is added to the diagonal of the matrix, which is scaled to 1."""
        damped = self._scaled_normal.copy()
        damped.flat[:: self.gradient.size + 1] += damping
        return np.asarray(np.linalg.solve(damped, self._scaled_gradient) / self._scale)


def _build_normal_equations(
    parameters: Samples, model: Model, s: Samples, e: Samples, most: float = np.inf
) -> _NormalEquations | None:
    """Return the normal equations, computed by blocks; None if the squared misfit exceeds ``most`` or is not a number.

    The derivatives, which take most of the time, are not computed for such a misfit.
    """
    cost = 0.0
    blocks = []
    for first in range(0, s.size, BLOCK):
        block = slice(first, first + BLOCK)
        energy, compute_jacobian = model(parameters, s[block])
        remainder = e[block] - energy
        cost += float(remainder @ remainder)
        if not cost <= most:
            return None
        jacobian = compute_jacobian()
        blocks.append((jacobian @ jacobian.T, jacobian @ remainder))
    normals, gradients = zip(*blocks, strict=True)
    return _NormalEquations(cost, reduce(np.add, normals), reduce(np.add, gradients))


def evaluate_energies(
    parameters: Samples, model: Model, s: Samples
) -> tuple[Samples, Samples]:
    """Return energies (n,) and the matrix J J^T (p, p) of their derivatives J, computed by blocks to save memory."""
    energy = np.empty(s.size)
    normal = np.zeros(())
    for first in range(0, s.size, BLOCK):
        block = slice(first, first + BLOCK)
        energy[block], compute_jacobian = model(parameters, s[block])
        jacobian = compute_jacobian()
        normal = normal + jacobian @ jacobian.T
    return energy, normal


def compute_covariance(normal: Samples, rest: Samples) -> Samples:
    """Return the covariance matrix s**2 (J J^T)^-1, from the pseudo-inverse of J J^T scaled to a unit diagonal."""
    norm = np.sqrt(normal.diagonal())
    norm[norm < _NO_EFFECT] = 1.0
    scale = norm * norm[:, None]
    freedom = rest.size - norm.size
    variance = float(rest @ rest) / freedom
    inverse = np.linalg.pinv(normal / scale, hermitian=True)
    return np.asarray(variance * inverse / scale)


def measure_structure(rest: Samples, deviations: float = _DEVIATIONS) -> float:
    """Return the rms of the part of ``rest`` that neighbouring values share, beyond the part due to white noise.

    The larger of the values for lags 1 and 2 is returned: a vibration sampled four times per period shows only at lag
    2.
    """

    def excess(products: Samples) -> float:
        """Return by how much the sum of products of neighbouring misfits exceeds the limit for white noise."""
        return abs(float(np.sum(products))) - deviations * float(
            np.linalg.norm(products)
        )

    largest_excess = max(0.0, *(excess(rest[:-lag] * rest[lag:]) for lag in (1, 2)))
    return float(np.sqrt(largest_excess / rest.size))


def has_clear_structure(rest: Samples, spread: float) -> bool:
    """Return True if the structure of the misfit on evenly spaced samples suffices to refuse a fit to all samples.

    ``spread`` is the standard deviation of the energy at these samples [energy].
    """
    return (
        measure_structure(rest, _BEYOND_DOUBT)
        > _BEYOND_STRUCTURE * MAX_STRUCTURE * spread
    )
