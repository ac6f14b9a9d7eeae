"""Refine the spectral lines of a noisy record by least squares: add missing lines, and remove those fitted to noise.

The poles that follow from shift invariance (`lines`) do not minimise the misfit. A line that decays early is weak in
the whole record, so noise may replace it in the signal subspace, although the first part of the record shows it. A line
that clearly exceeds the rest of the misfit is not noise. A line is kept or added only if it reduces the misfit by more
than chance would.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.vibration.fitting import measure_structure
from d2rpick.vibration.lines import (
    MOST_GROWTH,
    PERFECT,
    are_lines,
    fit_weights,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Complex, Grid, Prediction, Spectrum

# Largest number of refinement steps; three steps are usually enough.
_MOST_STEPS: Final = 6
# Fractions of a full step that are tried in this order until the misfit falls [-].
_STEP_LENGTHS: Final = (1.0, 0.5, 0.25)
# The refinement ends if a step raises twice the logarithm of the likelihood by less than this [-].
_CONVERGED: Final = 0.1
# Largest growth factor of the sum of heights in a step [-]; large lines that cancel out would be fitted to noise.
_MOST_INFLATED: Final = 1.1
# Relative damping of the normal equations, which would be singular if two lines are almost equal [-].
_DAMPING: Final = 1e-9
# Largest number of parameters per state of the grid [-].
_MOST_PARAMETERS: Final = 0.5
# Number of parameters of a line: two for its weight and two for its pole.
_OF_A_LINE: Final = 4
# The Bayesian information criterion states by how much a line must raise twice the logarithm of the likelihood.
# The source of the criterion is Schwarz, Annals of Statistics 6, 1978.
# An added line must exceed the criterion by this amount, because it is chosen from many possible lines [-].
_BEYOND_CHOICE: Final = 6.0
# Largest frequency difference between a line of the first part and the same line of the record [cycles over record].
_SAME_LINE: Final = 0.5
# Decay exponents over the record that are tried in the search for lines in a misfit [-].
_DECAYS: Final = (0.0, 2.0, 6.0, 18.0)
# A faster decay than that of the following limits would fit a few states of a load.
# _MOST_DECAY: largest exponent by which an added line may decay over the record.
# _FEWEST_CYCLES: smallest number of cycles in which a line that decays faster may fall by a factor of e.
_MOST_DECAY, _FEWEST_CYCLES = 8.0, 4.0
# Largest number of lines that are added because the misfit contains them.
_MOST_OF_REST: Final = 3
# Number of points per cycle over the record at which the spectrum of a misfit is evaluated.
_FINER: Final = 2
# Lowest frequency of an added line [cycles over the record]; slower changes are treated as part of the mean.
_OF_MEAN: Final = 1.0


def refine_prediction(grid: Grid, prediction: Prediction) -> Prediction:
    """Return the prediction with refined lines of the whole record, if these lines leave only noise as the misfit.

    The same lines are then refined in the first part of the record, whose own search may have missed one of two lines
    that only the whole record separates.  Lines that a linear structure does not have differ there.
    """
    spectrum = prediction.spectrum
    if spectrum.error <= PERFECT * prediction.swing or not spectrum.lines.poles.size:
        return prediction
    spectrum = _refine_spectrum(grid, spectrum)
    for pole in _list_missing_poles(spectrum, prediction.of_first_part, grid):
        spectrum = _add_line(grid, spectrum, pole) or spectrum
    for _ in range(_MOST_OF_REST):
        strongest = _find_strongest_in_rest(grid, spectrum.rest)
        # The shape of a candidate is not refined yet, so half of the gain is enough at this stage.
        if strongest.gain < _get_needed_gain(grid) / 2:
            break
        extended = _add_line(grid, spectrum, strongest.pole)
        if extended is None:
            break
        spectrum = extended
    spectrum = _remove_needless_lines(grid, spectrum)
    # If the remaining misfit is not noise, the refined lines may be fitted to a load that is still ending.
    # The prediction then keeps its unrefined lines.
    if measure_structure(spectrum.rest) > 0:
        return prediction
    of_first_part = _refine_in_first_part(grid, spectrum)
    return prediction._replace(spectrum=spectrum, of_first_part=of_first_part)


def _refine_in_first_part(grid: Grid, spectrum: Spectrum) -> Spectrum:
    """Return the spectral lines of the record, estimated from its first part alone."""
    poles = spectrum.lines.poles, spectrum.mean.poles
    return _refine_spectrum(grid.first_part, fit_weights(grid.first_part, *poles))


def _refine_spectrum(grid: Grid, spectrum: Spectrum) -> Spectrum:
    """Reduce the misfit by the Gauss-Newton method, which changes the poles of the lines but not those of the mean.

    If no step reduces the misfit, the spectrum is returned as it is.
    """
    for _ in range(_MOST_STEPS):
        step = _compute_step_of_poles(grid, spectrum)
        better = next(_try_steps(grid, spectrum, step), None)
        if better is None:
            break
        gain = _compute_gain(spectrum, better)
        spectrum = better
        if gain < _CONVERGED:
            break
    return spectrum


def _compute_step_of_poles(grid: Grid, spectrum: Spectrum) -> Complex:
    """Return the change of the poles, shape (k,), that would remove the misfit if all parameters acted linearly."""
    count = spectrum.lines.poles.size
    design = spectrum.differentiate_means(grid)
    if design.shape[1] > _MOST_PARAMETERS * grid.time.size:
        return np.zeros(count, np.complex128)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    design /= scale
    normal = design.T @ design + _DAMPING * np.eye(scale.size)
    step = np.linalg.solve(normal, design.T @ spectrum.rest) / scale
    decay, rate = step[2 * count : 3 * count], step[3 * count : 4 * count]
    return np.asarray(decay + 1j * rate)


def _try_steps(grid: Grid, spectrum: Spectrum, step: Complex) -> Iterator[Spectrum]:
    """Yield each spectrum with a smaller misfit, after a full step of the poles and then after shorter steps."""
    for length in _STEP_LENGTHS:
        poles = spectrum.lines.poles + length * step
        growth = np.minimum(poles.real, MOST_GROWTH / grid.span)
        poles = growth + 1j * poles.imag
        is_aliased = poles.imag * grid.step >= np.pi
        if are_lines(poles, grid.span).all() and not is_aliased.any():
            moved = fit_weights(grid, poles, spectrum.mean.poles)
            is_inflated = _sum_sizes(moved) > _MOST_INFLATED * _sum_sizes(spectrum)
            if moved.error < spectrum.error and not is_inflated:
                yield moved


def _sum_sizes(spectrum: Spectrum) -> float:
    """Return the sum of the heights of all spectral lines at the first sample [energy]."""
    return float(np.abs(spectrum.lines.weights).sum())


def _list_missing_poles(
    spectrum: Spectrum, of_first_part: Spectrum, grid: Grid
) -> list[complex]:
    """Return the poles of lines found in the first part of the record but not in all of it, strongest first."""
    lines = of_first_part.lines
    rates = lines.poles.imag
    apart = np.abs(np.subtract.outer(rates, spectrum.lines.poles.imag))
    nearest = apart.min(axis=1) * grid.span
    is_missing = nearest > 2 * np.pi * _SAME_LINE
    strongest_first = np.argsort(-np.abs(lines.weights))
    poles = lines.poles[strongest_first]
    missing_poles = poles[is_missing[strongest_first]]
    return [complex(pole) for pole in missing_poles]


def _add_line(grid: Grid, spectrum: Spectrum, pole: complex) -> Spectrum | None:
    """Return the spectrum with a further line after refining all lines; None if the line hardly reduces the misfit."""
    poles = np.append(spectrum.lines.poles, pole)
    if not are_lines(poles, grid.span).all():
        return None
    extended = _refine_spectrum(grid, fit_weights(grid, poles, spectrum.mean.poles))
    needed = _get_needed_gain(grid) + _BEYOND_CHOICE
    is_needed = _compute_gain(spectrum, extended) > needed
    is_lasting = _lasts(complex(extended.lines.poles[-1]), grid.span)
    return extended if is_needed and is_lasting else None


def _lasts(pole: complex, span: float) -> bool:
    """Return True if a line decays so slowly that it cannot describe the end of a load in the record."""
    decay = -pole.real
    has_many_cycles = pole.imag > 2 * np.pi * _FEWEST_CYCLES * decay
    return decay * span < _MOST_DECAY or has_many_cycles


def _remove_needless_lines(grid: Grid, spectrum: Spectrum) -> Spectrum:
    """Return the spectrum without the lines that hardly reduce the misfit; at least one line remains."""
    for rank in range(spectrum.lines.poles.size - 1, 0, -1):
        strongest_first = np.argsort(-np.abs(spectrum.lines.weights))
        is_kept = np.arange(strongest_first.size) != strongest_first[rank]
        poles = spectrum.lines.poles[is_kept]
        simpler = _refine_spectrum(grid, fit_weights(grid, poles, spectrum.mean.poles))
        if _compute_gain(simpler, spectrum) <= _get_needed_gain(grid):
            spectrum = simpler
    return spectrum


def _get_needed_gain(grid: Grid) -> float:
    """Return by how much a line of the spectrum must raise twice the logarithm of the likelihood [-]."""
    return float(_OF_A_LINE * np.log(grid.time.size))


def _compute_gain(spectrum: Spectrum, better: Spectrum) -> float:
    """Return twice the increase of the logarithm of the likelihood if the misfit is white noise [-].

    Each parameter reduces the number of independent states from which the misfit is computed by one.
    """
    least = max(better.error, 1e-300)
    parameters = _OF_A_LINE * better.lines.poles.size + better.mean.poles.size
    freedom = max(better.rest.size - parameters, 1)
    reduction = max(spectrum.error, least) / least
    return float(2 * freedom * np.log(reduction))


class _Candidate(NamedTuple):
    """A line that a misfit may contain: its ``pole`` [1/time], and the ``gain`` of adding it without refinement [-]."""

    pole: complex
    gain: float


def _find_strongest_in_rest(grid: Grid, rest: Samples) -> _Candidate:
    """Find the decaying line that reduces a misfit (m,) most, by matched filters for a few decays."""
    since_start = grid.time - grid.time[0]
    count = rest.size
    variance = max(float(np.mean(rest**2)), 1e-300)
    candidates = []
    for decay in _DECAYS:
        course = np.exp(-decay * since_start / grid.span)
        transform = np.fft.rfft(rest * course, _FINER * count)
        # Cosine and sine each have half of their envelope's sum of squares, and fit independent parts of the misfit.
        gains = 2 * np.abs(transform) ** 2 / (variance * np.sum(course**2))
        gains[: int(_FINER * _OF_MEAN) + 1] = 0.0
        strongest = int(np.argmax(gains))
        rate = 2 * np.pi * strongest / (_FINER * count * grid.step)
        pole = complex(-decay / grid.span, rate)
        candidates.append(_Candidate(pole, float(gains[strongest])))
    return max(candidates, key=lambda candidate: candidate.gain)
