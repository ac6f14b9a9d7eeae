"""Identification against one least_squares fit of scipy that is started at the right answer."""

from __future__ import annotations

from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from d2rpick.vibration.identify import identify
from tests.records import ENERGY, MODE, TIME, printed, vibration

if TYPE_CHECKING:
    from collections.abc import Callable

    from d2rpick.histories.history import Samples

_TRUTH = np.array([MODE.omega, MODE.alpha, MODE.cosine, MODE.sine])
_ROUNDS = 51


def ratio() -> float:
    """Time of one identification over time of one such fit: medians of interleaved runs, 6 digits."""
    energy = printed(ENERGY)

    def residuals(parameters: Samples) -> Samples:
        return vibration(parameters).energy(TIME) - energy

    def scipy_fit() -> float:
        return float(least_squares(residuals, _TRUTH).x[0])

    def ours() -> float:
        mode = identify(TIME, energy).mode
        assert mode is not None
        return mode.omega

    assert abs(ours() / scipy_fit() - 1) < 1e-7
    times = [(_seconds(ours), _seconds(scipy_fit)) for _ in range(_ROUNDS)]
    return median(one for one, _ in times) / median(other for _, other in times)


def _seconds(call: Callable[[], float]) -> float:
    start = perf_counter()
    call()
    return perf_counter() - start
