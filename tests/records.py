"""The paper's energy record as one mode, and records as files give them back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from d2rpick.vibration.modes import Mode
from tests import paper

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples

# y - z = -V0 exp(-alpha t/2) sin(omega t)/omega, eq. (7), with V0 = 6 m/s and k = 660e3 N/m
MODE = Mode(paper.OMEGA_2, 50.0, 0.0, -6.0 / paper.OMEGA_2 * (660e3 / 2) ** 0.5, 0.0)
TIME: Samples = np.linspace(0.0, 0.15, 1501)
ENERGY: Samples = MODE.energy(TIME)


def vibration(parameters: Samples) -> Mode:
    """Mode without plastic work and preload, from omega, alpha, cosine and sine."""
    omega, alpha, cosine, sine = parameters.tolist()
    return Mode(omega, alpha, cosine, sine, 0.0)


def printed(values: Samples, digits: int = 6) -> Samples:
    """``values`` as they come back from a file with that many significant digits."""
    return np.array([float(f"{value:.{digits - 1}e}") for value in values])


def noisy(values: Samples, share: float, seed: int) -> Samples:
    """``values`` with white noise whose standard deviation is ``share`` of their maximum."""
    noise = np.random.default_rng(seed).standard_normal(values.size)
    return values + share * float(np.max(values)) * noise
