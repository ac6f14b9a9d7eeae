"""A second, small mode: looked for in what one mode leaves of a record, and what may hide there unseen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.vibration.fit_one import cell_means
from d2rpick.vibration.identify import MIN_SAMPLES_BESIDE, MIN_SAMPLES_PER_PERIOD, identify_beside, samples_per_period
from d2rpick.vibration.one_mode import Mode

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.identify import Identification
    from d2rpick.vibration.modes import Modes
    from d2rpick.vibration.waves import Waves

# Of n lines of white noise the strongest exceeds the mean power by ln n on average, and by this much more with a
# probability of 0.7 %.
_BEYOND_CHANCE: Final = 5.0
# Share of the vibration energy: a smaller mode changes a residual by 0.06 at most, and real solvers leave as much.
SMALLEST: Final = 1e-3
_LEFT_OVER: Final = 0.5  # of a second mode's line, at least: of a nearby rate one mode takes up the other half
_MOST_LINES: Final = 8192  # bounds the work; enough for 800 periods of the energy
_FINER: Final = 4  # points per line of a spectrum, so that its top is met
_STARTS: Final = 3  # strongest lines that a second mode is begun from


class _Spectrum(NamedTuple):
    """Lines of a rest that decay like the vibration: ``rate`` [rad over the record].

    ``amplitude`` is that at the start, over the vibration energy there [-]; ``chance`` is the power of each over the
    mean power of white noise with the same scatter.
    """

    rate: Samples
    amplitude: Samples
    chance: Samples


def resolved(time: Samples, energy: Samples, fit: Identification) -> Identification:
    """Split one mode into two where what it leaves over is not white and a second mode explains it.

    Parameters
    ----------
    time, energy : array of shape (n,)
        The window of the fit [time], [energy].
    fit : Identification
        Accepted; returned as it is but for its ``hidden_share`` where no second mode can be told.
    """
    assert fit.mode is not None
    spectrum = _spectrum(time, energy, fit.mode)
    large = _share(spectrum) > SMALLEST * _LEFT_OVER
    if isinstance(fit.mode, Mode) and large and float(np.max(spectrum.chance)) > _certain(time.size):
        two = identify_beside(time, energy, fit.mode, _strongest(spectrum) / 2 / (fit.end - fit.start))
        if two.describes_record and _explains(two, fit, time.size):
            assert two.mode is not None
            fit, spectrum = two, _spectrum(time, energy, two.mode)
    assert fit.mode is not None
    hidden = _share(spectrum)
    if len(fit.mode.modes) > 1 and samples_per_period(time, fit.mode) < MIN_SAMPLES_PER_PERIOD:
        fastest = fit.mode.modes[-1].vibration_energy(time[0])  # its rate may be an alias
        hidden += float(fastest / fit.mode.vibration_energy(time[0]))
    return fit._replace(hidden_share=min(hidden, 1.0))


def hidden_share(time: Samples, energy: Samples, model: Mode | Modes | Waves) -> float:
    """Share of the vibration energy that a further mode may have in what a model leaves over, at most 1 [-]."""
    return min(_share(_spectrum(time, energy, model)), 1.0)


def _share(spectrum: _Spectrum) -> float:
    """Share of the vibration energy in a mode that makes the strongest line: E swings by half of it about as much."""
    return 2 * float(np.max(spectrum.amplitude))


def _certain(n: int) -> float:
    """Power of a line over the mean of ``n`` that chance does not give."""
    return float(np.log(n)) + _BEYOND_CHANCE


def _explains(two: Identification, one: Identification, n: int) -> bool:
    """Whether a second mode is large enough to matter and explains more than a line of white noise would."""
    assert two.mode is not None
    energies = [float(mode.vibration_energy(two.start)) for mode in two.mode.modes]
    gain = n * (one.rms**2 - two.rms**2)  # a line of power x takes 2 x from the sum of squares
    return min(energies) > SMALLEST * sum(energies) and gain > 2 * _certain(n) * two.rms**2


def _spectrum(time: Samples, energy: Samples, mode: Mode | Modes | Waves) -> _Spectrum:
    """Lines of what ``mode`` leaves over, from one period in the record to the fastest that the samples show."""
    span = float(time[-1] - time[0])
    count = min(time.size - 1, _MOST_LINES)
    rest = cell_means((time - time[0]) / span, energy - mode.energy(time), count)
    decay = np.exp(-mode.alpha * span * (np.arange(count) + 0.5) / count)
    power, whole = float(np.sum(decay**2)), float(mode.vibration_energy(time[0]))
    lines = np.abs(np.fft.rfft(rest * decay, _FINER * count))
    shown = slice(_FINER, max(_FINER + 1, _FINER * count // MIN_SAMPLES_BESIDE))
    mean = float(np.mean(rest**2)) * power or 1.0
    rate = 2 * np.pi / _FINER * np.arange(lines.size, dtype=np.float64)
    return _Spectrum(np.array(rate[shown]), 2 / power / whole * lines[shown], lines[shown] ** 2 / mean)


def _strongest(spectrum: _Spectrum) -> Samples:
    """Rates of the strongest lines, each the top of a hill."""
    height = np.pad(spectrum.amplitude, 1, constant_values=-1.0)
    tops = np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:]))
    return np.asarray(spectrum.rate[tops[np.argsort(-spectrum.amplitude[tops])[:_STARTS]]])


def residual_bound(residual: Samples, fit: Identification, tr: Samples, td: Samples | float) -> Samples:
    """Largest residual of each tr of shape (n,) with the energy that a hidden mode may have, at worst [-].

    It then stood at tr at one end of its swing and at td at the other, where it is smaller by the damping in between:
    R^2 grows by its share of the vibration energy times (1 + exp(alpha (td - tr)/2))^2.
    """
    assert fit.mode is not None
    swing = 1 + np.exp(fit.mode.alpha / 2 * (td - tr))
    return np.sqrt(residual**2 + fit.hidden_share * swing**2)
