"""Find lines that are locked to others in frequency and phase, due to a static deformation or nonlinear springs."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.lines import Exponentials, Spectrum

# NOTABLE: smallest height of a relevant line, relative to the strongest line [-].
# _NOTABLE_PARTNER: smallest height of a line whose frequency another may follow, relative to the strongest line [-].
# ABOVE_SCATTER: smallest height of a relevant line, in standard deviations [-].
NOTABLE, _NOTABLE_PARTNER, ABOVE_SCATTER = 3e-3, 3e-4, 4.0
# _SAME_RATE: frequencies that differ by at most this are treated as equal [cycles over the record].
# _EXACT_RATE: frequencies whose phases drift apart by at most this over the record are treated as identical [rad].
_SAME_RATE, _EXACT_RATE = 0.1, 0.1
# _SAME_PHASE: largest phase error of a line that is locked because of a static deformation [rad].
# _SAME_PHASE_OF_HARMONICS: largest phase error of a harmonic [rad].
_SAME_PHASE, _SAME_PHASE_OF_HARMONICS = 0.15, 0.25
# h1, h2 and h3 are the heights of the harmonics of the energy of a stiffening spring with q'' + q + e q^3 = 0.
# _THIRD_OF_SPRING: expected ratio h3 h1 / h2^2 [-], which is 0.42 for a large e and 0.53 for a small e.
# _THIRD_ROOM: relative tolerance for the third harmonic [-].
# _HIGHEST_SECOND: largest ratio h2 / h1 [-]; it is at most 0.35 in theory (elliptic cosine).
_THIRD_OF_SPRING, _THIRD_ROOM, _HIGHEST_SECOND = 0.48, 0.3, 0.36
# Multiples of the frequency of a slowly oscillating deformation at which its energy has spectral lines [-].
_OWN_MULTIPLES: Final = (1, 2, 3, 4)
# Line heights are treated as equal if the logarithm of their ratio is at most this [-].
_SAME_HEIGHT: Final = 0.1
# _STRONGEST: number of the strongest lines to which the search for harmonics is limited.
# _HARMONICS: orders of the harmonics that the search identifies.
_STRONGEST, _HARMONICS = 3, (2, 3, 4, 5)


class StretchLine(NamedTuple):
    """The ``line`` that arises because the mode of the line ``of_mode`` vibrates about a static deformation.

    ``energy`` is the mean energy of the static deformation [energy]. ``swings`` is True if this deformation oscillates
    slowly about its mean; it then causes two lines, which share its mean energy. ``is_exact`` is False if the frequency
    of the line differs from half the frequency of the mode's own line by more than scatter explains.
    """

    line: int
    of_mode: int
    energy: float
    swings: bool = False
    is_exact: bool = True


def find_stretches(
    lines: Exponentials, span: float, scatter: float
) -> tuple[StretchLine, ...]:
    """Find the lines of modes that vibrate about a static deformation, as in a rotating body.

    A mode q about q0 has the energy q0^2 + 2 q0 q + q^2, i.e. a further line with half the frequency and half the phase
    of the mode's own line. In free flight of a body that does not spin, the elastic energy is stationary at equilibrium
    despite residual stresses, so there is no such line. A static deformation that oscillates slowly, like that of a
    part on a hinge, causes two such lines, one on each side.
    """
    size = np.abs(lines.weights)
    rate = lines.poles.imag
    phase = _find_phases_in_middle(lines, span)
    strongest = float(size.max(initial=0.0))
    least = max(NOTABLE * strongest, ABOVE_SCATTER * scatter)
    least_partner = max(_NOTABLE_PARTNER * strongest, ABOVE_SCATTER * scatter)
    order = np.argsort(-size).tolist()
    stretches: list[StretchLine] = []
    for line in order:
        if size[line] < least:
            continue
        for own_line in order:
            if own_line == line or size[own_line] < least_partner:
                continue
            phase_error = scatter / size[own_line] + 2 * scatter / size[line]
            unsure = 3 * min(phase_error, 0.1)
            apart = abs(rate[own_line] - 2 * rate[line]) * span
            if apart > 2 * np.pi * _SAME_RATE:
                continue
            turned = phase[own_line] - 2 * phase[line]
            if abs(_wrap(turned, 2 * np.pi)) < _SAME_PHASE + unsure:
                # In a fit, the error of an angular frequency times the record length is sqrt(12) times that of a phase.
                is_exact = bool(apart < _EXACT_RATE + np.sqrt(12) * unsure)
                energy = float(size[line] ** 2 / (8 * size[own_line]))
                stretches.append(StretchLine(line, own_line, energy, is_exact=is_exact))
                break
    side_lines = _find_side_lines(lines, span, scatter)
    no_modes = {stretch.line for stretch in side_lines}
    return (
        *(stretch for stretch in stretches if stretch.of_mode not in no_modes),
        *side_lines,
    )


def _find_side_lines(
    lines: Exponentials, span: float, scatter: float
) -> list[StretchLine]:
    """Find the sidebands of modes that vibrate about a slowly oscillating deformation.

    A deformation q0 cos(s t + f) gives a mode two further lines, at the mode's frequency plus and minus s. Both are
    equally high, and their frequencies and phases add up to those of the mode's own line. The energy of the deformation
    itself has lines at multiples of s, which are not modes either.
    """
    size = np.abs(lines.weights)
    rate = lines.poles.imag
    phase = _find_phases_in_middle(lines, span)
    least_size = max(NOTABLE * float(size.max(initial=0.0)), ABOVE_SCATTER * scatter)
    middle_size = size * np.exp(lines.poles.real * span / 2)
    stretches = []
    for first, second in combinations(np.flatnonzero(size > least_size).tolist(), 2):
        height_ratio = middle_size[first] / middle_size[second]
        if abs(np.log(height_ratio)) > _SAME_HEIGHT:
            continue
        apart = np.abs(rate - rate[first] - rate[second]) * span
        own_line = int(np.argmin(apart))
        turned = phase[own_line] - phase[first] - phase[second]
        is_locked = abs(_wrap(float(turned), 2 * np.pi)) < _SAME_PHASE
        if apart[own_line] > 2 * np.pi * _SAME_RATE or not is_locked:
            continue
        energy = float(size[first] ** 2 / (8 * size[own_line]))
        stretches += [
            StretchLine(line, own_line, energy, swings=True) for line in (first, second)
        ]
        rate_of_swing = abs(rate[first] - rate[second]) / 2
        multiples = np.outer(rate_of_swing, _OWN_MULTIPLES)
        off_multiples = np.abs(rate[:, np.newaxis] - multiples).min(axis=1) * span
        own_energy = np.flatnonzero(off_multiples < 2 * np.pi * _SAME_RATE).tolist()
        stretches += [
            StretchLine(line, own_line, 0.0, swings=True) for line in own_energy
        ]
    return stretches


class ThirdHarmonic(NamedTuple):
    """The third harmonic of a line whose second harmonic has a locked phase; all heights refer to mid-window.

    Both a static deformation and a stiffening spring cause a line with a second harmonic, but only the spring causes a
    third one. ``second`` is the height of the second harmonic relative to the first line [-]. ``expected`` is the
    height of the third harmonic of a stiffening spring, and ``measured`` the height in the record in phase with the
    first line [energy]. ``scatter`` is the standard deviation of a height [energy].
    """

    second: float
    expected: float
    measured: float
    scatter: float

    @property
    def may_be_of_spring(self) -> bool:
        """Return True if the line, apart from noise, may be as high as the third harmonic of a stiffening spring."""
        if self.second > _HIGHEST_SECOND:
            return False
        room = _THIRD_ROOM * self.expected + ABOVE_SCATTER * self.scatter
        return abs(self.measured - self.expected) <= room

    @property
    def is_of_spring(self) -> bool:
        """Return True if the line is as high as the third harmonic of a stiffening spring, and too high to be noise."""
        is_seen = self.expected > 2 * ABOVE_SCATTER * self.scatter
        return self.may_be_of_spring and is_seen


def measure_third_harmonic(
    stretch: StretchLine, spectrum: Spectrum, time: Samples, scatter: float
) -> ThirdHarmonic:
    """Measure the third harmonic of a line whose second harmonic is either a mode or due to a nonlinear spring.

    Parameters
    ----------
    stretch : StretchLine
        The line and its second harmonic, the line ``of_mode``.
    spectrum : Spectrum
        Fitted to the grid of ``time`` (n,) [time].
    scatter : float
        Standard deviation of the height of a line [energy].
    """
    middle = (time[0] + time[-1]) / 2
    lines = spectrum.lines
    heights = lines.waves(middle) * lines.weights
    first = heights[stretch.line]
    second = float(abs(heights[stretch.of_mode]))
    pole = lines.poles[stretch.line]
    span = time[-1] - time[0]
    third_pole = 3 * pole.real + 3j * pole.imag
    is_third = (
        np.abs(lines.poles.imag - third_pole.imag) * span < 2 * np.pi * _SAME_RATE
    )
    course = np.exp(third_pole * (time - middle))
    in_rest = 2 * (course.conj() @ spectrum.rest) / np.sum(np.abs(course) ** 2)
    third = np.sum(heights[is_third]) + in_rest
    height = float(abs(first))
    # The third harmonic of a spring has three times the phase of the first one.
    turned_back = third * (first.conj() / abs(first)) ** 3
    # A decaying line is visible in only a part of the window.
    widening = float(np.exp(max(-third_pole.real, 0.0) * span / 2))
    return ThirdHarmonic(
        second / height,
        _THIRD_OF_SPRING * second**2 / height,
        float(turned_back.real),
        scatter * widening,
    )


def measure_harmonics(lines: Exponentials, span: float, scatter: float) -> float:
    """Return the relative height of phase-locked lines at the third and higher multiples of a line's frequency [-].

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
    """Return the relative height of the third and higher harmonics that are phase-locked to a line [-].

    The first harmonic that is missing or not phase-locked to the line ends the series.
    """
    total = 0.0
    for times in _HARMONICS:
        harmonic_rate = times * rate[first]
        line = int(np.argmin(np.abs(rate - harmonic_rate)))
        apart = abs(rate[line] - harmonic_rate) * span
        is_other_rate = apart > 2 * np.pi * _SAME_RATE
        if line == first or is_other_rate or size[line] < ABOVE_SCATTER * scatter:
            break
        # Stiffening and softening springs have harmonics of opposite signs.
        turned = _wrap(phase[line] - times * phase[first], np.pi)
        if abs(turned) > _SAME_PHASE_OF_HARMONICS:
            break
        if times > 2:
            # A harmonic is never stronger than its fundamental line, so these lines are modes.
            if size[line] > size[first]:
                return 0.0
            total += float(size[line] / size[first])
    return total


def _find_phases_in_middle(lines: Exponentials, span: float) -> Samples:
    """Return the phase of each line at mid-window, where the phase is most accurate [rad]."""
    return np.asarray(np.angle(lines.weights) + lines.poles.imag * span / 2)


def _wrap(angle: float, turn: float) -> float:
    """Return the angle as a value between -pi and pi [rad]."""
    return (angle + turn / 2) % turn - turn / 2
