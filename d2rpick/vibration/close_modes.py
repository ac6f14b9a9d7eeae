"""Detect two modes whose frequencies are so close that the record shows a single line, from the mean energy.

The line of two close modes is as high as the sum of both modes only while they are in phase. As they get out of phase,
the line falls, and the energy that it loses looks like rising static energy. If no energy is static, the mean energy is
the sum of the line heights of all modes; under this condition the record shows both modes. Heat may look the same, so
the two modes are only one of two interpretations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration.lines import (
    MOST_DECAY,
    MOST_GROWTH,
    PERFECT,
    Exponentials,
    Spectrum,
)
from d2rpick.vibration.locked_lines import ABOVE_SCATTER

if TYPE_CHECKING:
    from collections.abc import Iterator

    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Grid, Prediction

# _MOST_STATIC: largest seemingly static energy of a beat, relative to the sum of the heights of all lines [-].
# _LEAST_CHANGE: smallest change of the seemingly static energy that shows a beat, relative to that energy [-].
_MOST_STATIC, _LEAST_CHANGE = 1.0, 0.1
# Number of the strongest lines that are tried as the line of two close modes.
_STRONGEST: Final = 3
# Two modes describe the record equally well if twice the logarithm of the likelihood falls by at most this [-].
_AS_WELL: Final = 4.0
# _MOST_STEPS: largest number of steps of the fit; 10 are usual.
# _CONVERGED: the fit ends with a step that reduces the sum of squares by at most this fraction [-].
_MOST_STEPS, _CONVERGED = 30, 1e-5
# _DAMPING: damping of the first step of the Levenberg-Marquardt method, relative to the scaled normal matrix [-].
# _LEAST_DAMPING: smallest damping of a step [-].
# _MOST_DAMPING: the fit ends if steps with up to this damping do not reduce the misfit [-].
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-9, 1e6
# Standard deviation of the rise of a fitted straight line over the record, per standard deviation of its mean [-].
_OF_ENDS: Final = np.sqrt(12)


def find_close_modes(grid: Grid, prediction: Prediction) -> Spectrum | None:
    """Return a spectrum in which two close modes replace one line; None if the mean energy shows no such modes.

    The mean of the spectrum is the sum of the heights of its lines, because no energy is static.
    """
    spectrum = prediction.spectrum
    # Without noise, the fit of the lines resolves close modes, so they need not be searched for.
    is_noisy = spectrum.error > PERFECT * prediction.swing
    if not (is_noisy and _is_static_like_beat(grid, spectrum)):
        return None
    fits = [_fit_lines(grid, lines) for lines in _divide_lines(grid, spectrum)]
    close_modes = min(fits, key=lambda fit: fit.error)
    increase = close_modes.error / spectrum.error
    lost = 2 * grid.time.size * np.log(increase)
    return close_modes if lost <= _AS_WELL else None


def _is_static_like_beat(grid: Grid, spectrum: Spectrum) -> bool:
    """Return True if the static energy rises as the lines fall, or the reverse, and the sum of both does not rise."""
    lines = spectrum.lines
    heights, static = _compute_ends(grid, spectrum)
    scatter = spectrum.error * np.sqrt(2 * lines.poles.size / grid.time.size)
    least = ABOVE_SCATTER * _OF_ENDS * scatter
    of_heights = float(heights[1] - heights[0])
    of_static = float(static[1] - static[0])
    is_seen = min(abs(of_heights), abs(of_static)) > least
    is_changing = abs(of_static) > _LEAST_CHANGE * static.max()
    is_static = static > -least
    is_small = static < _MOST_STATIC * heights
    total = heights + static
    is_bounded = total[1] < (1 + MOST_GROWTH) * total[0]
    is_like_beat = is_seen and is_changing and of_heights * of_static < 0
    return bool(is_like_beat and is_bounded and np.all(is_static & is_small))


def _compute_ends(grid: Grid, spectrum: Spectrum) -> tuple[Samples, Samples]:
    """Return the sum of the line heights and the static energy, each (2,), at the first and last time [energy]."""
    ends = grid.time[[0, -1]]
    heights = _sum_heights(spectrum.lines).at(ends)
    return heights, spectrum.mean.at(ends) - heights


def _sum_heights(lines: Exponentials) -> Exponentials:
    """Return the heights of the lines as decays, whose sum is the mean energy if no energy is static."""
    return lines._replace(
        poles=lines.poles.real.astype(np.complex128),
        weights=np.abs(lines.weights).astype(np.complex128),
    )


def _divide_lines(grid: Grid, spectrum: Spectrum) -> Iterator[Exponentials]:
    """Yield the lines with one of the strongest lines divided into two equally high lines whose beat explains the mean.

    Two lines of height h whose phases differ by 2 p form a line of height 2 h cos(p), whereas their mean energy is 2 h.
    """
    lines = spectrum.lines
    since_origin = grid.time[[0, -1]] - lines.origin
    static = np.maximum(_compute_ends(grid, spectrum)[1], 0.0)
    sides = np.array([1.0, -1.0])
    for line in np.argsort(-np.abs(lines.weights))[:_STRONGEST]:
        pole, weight = lines.poles[line], lines.weights[line]
        height = abs(weight) * np.exp(pole.real * since_origin)
        together = height + static
        half_phases = np.arccos(height / together)
        growth = np.log(together[1] / together[0]) / grid.span
        half = weight * together[0] / (2 * height[0])
        is_other = np.arange(lines.poles.size) != line
        other_poles, other_weights = lines.poles[is_other], lines.weights[is_other]
        for first_phase in (half_phases[0], -half_phases[0]):
            apart = (half_phases[1] - first_phase) / grid.span
            poles = growth + 1j * (pole.imag + sides * apart)
            weights = half * np.exp(1j * sides * first_phase)
            yield Exponentials(
                np.concatenate([other_poles, poles]),
                np.concatenate([other_weights, weights]),
                lines.origin,
            )


def _fit_lines(grid: Grid, lines: Exponentials) -> Spectrum:
    """Use the Levenberg-Marquardt algorithm to fit lines whose heights add up to the mean energy."""
    spectrum = _fill_mean(grid, lines)
    damping = _DAMPING
    for _ in range(_MOST_STEPS):
        scale, normal, gradient = _build_normal_equations(grid, spectrum)
        moved = spectrum
        while moved.error >= spectrum.error and damping < _MOST_DAMPING:
            damped = normal + damping * np.eye(scale.size)
            step = np.linalg.solve(damped, gradient) / scale
            moved = _move_lines(grid, spectrum.lines, step)
            damping *= 10
        if moved.error >= (1 - _CONVERGED) * spectrum.error:
            break
        spectrum, damping = moved, max(damping / 100, _LEAST_DAMPING)
    return spectrum


def _build_normal_equations(
    grid: Grid, spectrum: Spectrum
) -> tuple[Samples, Samples, Samples]:
    """Return the scale of each parameter, shape (4 k,), and with it the normal matrix and the gradient of the fit."""
    lines = spectrum.lines
    averaged = spectrum.average_blocks(grid).lines
    of_lines = averaged.differentiate(grid.time)
    of_mean = _differentiate_heights(lines, grid.time)
    design = of_lines + of_mean
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    design /= scale
    return scale, design.T @ design, design.T @ spectrum.rest


def _differentiate_heights(lines: Exponentials, times: Samples) -> Samples:
    """Return the derivatives of the sum of the heights, as `Exponentials.differentiate` does, shape (n, 4 k)."""
    heights = np.maximum(np.abs(lines.weights), 1e-300)
    since_origin = (times - lines.origin)[:, np.newaxis]
    decayed = np.exp(since_origin * lines.poles.real)
    return np.hstack(
        [
            decayed * lines.weights.real / heights,
            decayed * lines.weights.imag / heights,
            decayed * heights * since_origin,
            np.zeros_like(decayed),
        ]
    )


def _move_lines(grid: Grid, lines: Exponentials, step: Samples) -> Spectrum:
    """Return the spectrum of the lines after their parameters are changed by ``step`` (4 k,).

    The growth and the decay of the lines are limited to those of modes, because a longer step could overflow.
    """
    of_weights, of_poles = step.reshape(2, 2, -1)
    lowest, highest = -MOST_DECAY / grid.span, MOST_GROWTH / grid.span
    growth = np.clip(lines.poles.real + of_poles[0], lowest, highest)
    rate = lines.poles.imag + of_poles[1]
    weights = lines.weights + of_weights[0] + 1j * of_weights[1]
    moved = lines._replace(weights=weights, poles=growth + 1j * rate)
    return _fill_mean(grid, moved)


def _fill_mean(grid: Grid, lines: Exponentials) -> Spectrum:
    """Return the spectrum of lines whose heights add up to the mean energy."""
    spectrum = Spectrum(lines, _sum_heights(lines), np.zeros(grid.time.size))
    rest = grid.energy - spectrum.average_blocks(grid).at(grid.time)
    return spectrum._replace(rest=rest)
