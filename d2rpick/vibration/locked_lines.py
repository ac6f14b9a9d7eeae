"""Find lines of an energy that are locked to others: lines of a static stretch, and harmonics of nonlinear springs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Exponentials

# Smallest relevant line relative to the strongest line, the same relative to a partner line, and in units of scatter.
NOTABLE, _NOTABLE_PARTNER, ABOVE_SCATTER = 3e-3, 3e-4, 4.0
# Two rates are equal if they differ by less than this share of a turn over the record.
_SAME_RATE: Final = 0.1
# Tolerances of locked phases [rad]: of the line of a stretch, and of harmonics.
_SAME_PHASE, _SAME_PHASE_OF_HARMONICS = 0.15, 0.25
# Number of the strongest lines whose harmonics are searched, and the orders of the harmonics.
_STRONGEST, _HARMONICS = 3, (2, 3, 4, 5)


class StretchLine(NamedTuple):
    """The ``line`` of a static stretch in the mode of the line ``of_mode``, and its ``energy`` [energy]."""

    line: int
    of_mode: int
    energy: float


def find_stretches(
    lines: Exponentials, span: float, scatter: float
) -> tuple[StretchLine, ...]:
    """Find the lines of modes that vibrate about a static stretch, as in a rotating body.

    A mode q about q0 has the energy q0^2 + 2 q0 q + q^2: a further line at half the rate and half the phase of its own.
    In free flight without spin the energy is stationary at rest, whatever the residual stress, and has no such line.
    """
    size = np.abs(lines.weights)
    rate = lines.poles.imag
    phase = _find_phases_in_middle(lines, span)
    strongest = float(size.max(initial=0.0))
    order = np.argsort(-size).tolist()
    stretches: list[StretchLine] = []
    for line in order:
        if size[line] < max(NOTABLE * strongest, ABOVE_SCATTER * scatter):
            continue
        for own_line in order:
            if own_line == line or size[own_line] < max(
                _NOTABLE_PARTNER * strongest, ABOVE_SCATTER * scatter
            ):
                continue
            if abs(rate[own_line] - 2 * rate[line]) * span > 2 * np.pi * _SAME_RATE:
                continue
            unsure = 3 * min(scatter / size[own_line] + 2 * scatter / size[line], 0.1)
            if (
                abs(_wrap(phase[own_line] - 2 * phase[line], 2 * np.pi))
                < _SAME_PHASE + unsure
            ):
                stretches.append(
                    StretchLine(
                        line, own_line, float(size[line] ** 2 / (8 * size[own_line]))
                    )
                )
                break
    return tuple(stretches)


def measure_harmonics(lines: Exponentials, span: float, scatter: float) -> float:
    """Return the relative size of phase-locked lines at 3 and more times the rate of a line [-].

    A nonlinear spring has such lines; the modes of a linear structure are not locked to each other.
    """
    size = np.abs(lines.weights)
    rate = lines.poles.imag
    phase = _find_phases_in_middle(lines, span)
    if size.size < 3:
        return 0.0
    return max(
        _measure_locked_to(int(first), size, rate, phase, span, scatter)
        for first in np.argsort(-size)[:_STRONGEST]
    )


def _measure_locked_to(
    first: int,
    size: Samples,
    rate: Samples,
    phase: Samples,
    span: float,
    scatter: float,
) -> float:
    """Return the relative size of the harmonics of a line beyond the second, up to the first unlocked one [-]."""
    total = 0.0
    for times in _HARMONICS:
        line = int(np.argmin(np.abs(rate - times * rate[first])))
        apart = abs(rate[line] - times * rate[first]) * span > 2 * np.pi * _SAME_RATE
        if line == first or apart or size[line] < ABOVE_SCATTER * scatter:
            break
        # stiffening and softening springs have harmonics of opposite signs
        if (
            abs(_wrap(phase[line] - times * phase[first], np.pi))
            > _SAME_PHASE_OF_HARMONICS
        ):
            break
        if times > 2:
            if (
                size[line] > size[first]
            ):  # a harmonic is never stronger than its line, so these lines are modes
                return 0.0
            total += float(size[line] / size[first])
    return total


def _find_phases_in_middle(lines: Exponentials, span: float) -> Samples:
    """Return the phase of each line in the middle of the window, where it is known best [rad]."""
    return np.asarray(np.angle(lines.weights) + lines.poles.imag * span / 2)


def _wrap(angle: float, turn: float) -> float:
    """Return an angle between minus and plus half a turn [rad]."""
    return (angle + turn / 2) % turn - turn / 2
