"""What a fit leaves over: white noise may be large, structure that neighbouring samples share must be small."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

MAX_STRUCTURE: Final = 0.02  # of std(E): thirty times what one real solver leaves with one mode

# Of the covariance of white noise's neighbours: what exceeds three standard deviations is taken for structure; six
# are beyond all doubt.
_DEVIATIONS: Final = 3.0
_BEYOND_DOUBT: Final = 6.0
# Samples that are farther apart may share more of a slow structure than neighbours, at most twice its variance.
_BEYOND_STRUCTURE: Final = 2.0


def structure_of(rest: Samples, deviations: float = _DEVIATIONS) -> float:
    """Root of the covariance of neighbours in ``rest`` beyond so many standard deviations of white noise's.

    The larger of lags 1 and 2: a vibration sampled four times per period shows at the second only.
    """
    excess = 0.0
    for lag in (1, 2):
        products = rest[:-lag] * rest[lag:]
        excess = max(excess, abs(float(np.sum(products))) - deviations * float(np.linalg.norm(products)))
    return float(np.sqrt(excess / rest.size))


def surely_structured(rest: Samples, spread: float) -> bool:
    """Whether what is left on some of the samples, evenly chosen, shows that all of them leave too much structure.

    ``spread`` is the standard deviation of the energy there.
    """
    return structure_of(rest, _BEYOND_DOUBT) > _BEYOND_STRUCTURE * MAX_STRUCTURE * spread
