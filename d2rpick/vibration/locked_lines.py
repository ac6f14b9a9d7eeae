"""Lines of an energy that are locked to others: those of a stretch, and of a spring that is not linear."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Exponentials

# A line counts beside the strongest one from this share of it on, and from so many times its own scatter.
NOTABLE, _NOTABLE_PARTNER, ABOVE_SCATTER = 3e-3, 3e-4, 4.0
# Two rates are one if they differ by less than this share of a turn over the record.
_SAME_RATE: Final = 0.1
# Two phases are one if they differ by less [rad]: of the line of a stretch, and of the harmonics of a spring.
_SAME_PHASE, _SAME_PHASE_OF_HARMONICS = 0.15, 0.25
# The strongest lines that harmonics are looked for of, and how many harmonics.
_STRONGEST, _HARMONICS = 3, (2, 3, 4, 5)


class Stretch(NamedTuple):
    """A ``line`` of the stretch of a mode whose own line is ``of_mode``; ``energy`` of that stretch [energy]."""

    line: int
    of_mode: int
    energy: float


def find_stretches(
    lines: Exponentials, span: float, scatter: float
) -> tuple[Stretch, ...]:
    """Find the lines of modes that vibrate about a stretch, as in a body that spins.

    A mode q about q0 has the energy q0^2 + 2 q0 q + q^2: a further line at half the rate and phase of its own.  In free
    flight without spin the energy is stationary at rest, whatever residual stress there is, and has no such line.
    """
    size, rate = np.abs(lines.weights), lines.poles.imag
    phase = _find_phases_in_middle(lines, span)
    strongest = float(size.max(initial=0.0))
    order = np.argsort(-size).tolist()
    found: list[Stretch] = []
    for line in order:
        if size[line] < max(NOTABLE * strongest, ABOVE_SCATTER * scatter):
            continue
        for own in order:
            if own == line or size[own] < max(
                _NOTABLE_PARTNER * strongest, ABOVE_SCATTER * scatter
            ):
                continue
            if abs(rate[own] - 2 * rate[line]) * span > 2 * np.pi * _SAME_RATE:
                continue
            unsure = 3 * min(scatter / size[own] + 2 * scatter / size[line], 0.1)
            if (
                abs(_wrap(phase[own] - 2 * phase[line], 2 * np.pi))
                < _SAME_PHASE + unsure
            ):
                found.append(
                    Stretch(line, own, float(size[line] ** 2 / (8 * size[own])))
                )
                break
    return tuple(found)


def measure_harmonics(lines: Exponentials, span: float, scatter: float) -> float:
    """Measure the lines at three and more times a first one whose phases are locked to it, over it [-].

    A spring that is not linear has them; the modes of a linear structure are not locked to one another.
    """
    size, rate = np.abs(lines.weights), lines.poles.imag
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
    """Size of the harmonics of a line beyond its second, over it [-]; the row ends at the first that is not locked."""
    total = 0.0
    for times in _HARMONICS:
        line = int(np.argmin(np.abs(rate - times * rate[first])))
        apart = abs(rate[line] - times * rate[first]) * span > 2 * np.pi * _SAME_RATE
        if line == first or apart or size[line] < ABOVE_SCATTER * scatter:
            break
        # a spring that stiffens and one that softens have them with opposite signs
        if (
            abs(_wrap(phase[line] - times * phase[first], np.pi))
            > _SAME_PHASE_OF_HARMONICS
        ):
            break
        if times > 2:
            if (
                size[line] > size[first]
            ):  # no harmonic is stronger than what it belongs to: these are modes
                return 0.0
            total += float(size[line] / size[first])
    return total


def _find_phases_in_middle(lines: Exponentials, span: float) -> Samples:
    """Phase of each line in the middle of the window, where it is known best [rad]."""
    return np.asarray(np.angle(lines.weights) + lines.poles.imag * span / 2)


def _wrap(angle: float, turn: float) -> float:
    """Give an angle within half a turn of zero [rad]."""
    return (angle + turn / 2) % turn - turn / 2
