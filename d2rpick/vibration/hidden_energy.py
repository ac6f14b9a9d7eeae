"""Find the vibration energy that the spectral lines of a record do not show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration.line_scatter import MOST_SHARED
from d2rpick.vibration.locked_lines import ABOVE_SCATTER

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# Relative variations up to this are treated as zero [-], because single precision does not resolve them.
RESOLVED: Final = 2e-7
# Largest fraction of the variation of a static energy that does not follow the level [-].
_LIKE_LEVEL: Final = 0.3
# Assumed number of lines that are hidden in the misfit.
_HIDDEN_LINES: Final = 12


def measure_hidden_pairs(
    static: Samples, level: Samples, noise: float, systematic: float
) -> float:
    """Return the vibration energy that shows no lines but decays like the ``level``, relative to the level [-].

    The lines of two modes with equal frequencies and opposite phases cancel each other, so their energy looks static.
    But static energy is constant, whereas the energy of these modes decays like that of all others.

    Parameters
    ----------
    static, level : array of shape (n,)
        Mean energy beyond half of the level, and energy of the lines, at equidistant times [energy].
    noise : float
        Standard deviation of the record about its lines [energy].
    systematic : float
        Fraction of the misfit that neighbouring states have in common [-].
    """
    fallen = level - np.mean(level)
    variance = float(np.mean(fallen**2))
    if variance <= (RESOLVED * float(np.mean(level))) ** 2:
        return 0.0
    share = float(np.mean(fallen * static)) / variance
    left = static - np.mean(static) - share * fallen
    shared = min(systematic, MOST_SHARED)
    states = static.size * (1 - shared) / (1 + shared)
    scatter = noise / np.sqrt(states * variance)
    is_seen = share > ABOVE_SCATTER * scatter
    if not is_seen or float(np.mean(left**2)) > (_LIKE_LEVEL * share) ** 2 * variance:
        return 0.0
    return 2 * max(min(share, float(np.min(static / level))), 0.0)


def find_most_hidden(rest: Samples) -> float:
    """Return the largest vibration energy that lines hidden in the misfit (n,) of a fit could have [energy].

    No hidden lines are higher than the highest lines of the misfit.
    """
    heights = 2 * np.abs(np.fft.rfft(rest)) / rest.size
    return float(2 * np.sum(np.sort(heights)[-_HIDDEN_LINES:]))
