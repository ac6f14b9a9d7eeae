"""Fit the energy of two or three vibration modes to samples by least squares, without being given a first guess.

Everything here is scaled as in `fitting`; a parameter vector is that of `Modes.of`: alpha and, for each mode, omega,
cosine and sine.
"""

from __future__ import annotations

from functools import partial
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.vibration.fit_one import STARTS, best_of_starts
from d2rpick.vibration.modes import sum_and_jacobian

if TYPE_CHECKING:
    from d2rpick.histories.history import Samples
    from d2rpick.vibration.fit_one import Pencil

# Least difference of two rates over the record to start from [rad]: below a quarter of a beat two modes act as one.
_APART: Final = np.pi / 4
# Of the variance: rates that leave more of it unexplained are none of the record's, and refining them is no use.
_HOPELESS: Final = 0.5


def fit_several(pencil: Pencil, s: Samples, e: Samples, count: int, worst: float = np.inf) -> Samples | None:
    """Return the least-squares parameters of ``count`` modes; None where E, of this ``pencil``, shows fewer rates.

    Each mode makes exp(-alpha s) times a constant and a vibration at twice its rate, so the constants add up and
    3 count exponentials leave room for what is none.  For known rates E is linear in the rest, which ranks the
    rates and gives the parameters.  None also where a few of the samples refuse the fit, as for one mode.
    """
    return best_of_starts(partial(_starts, pencil, count), sum_and_jacobian, s, e, worst)


def _starts(pencil: Pencil, count: int, s: Samples, e: Samples) -> list[Samples]:
    """Return the best parameter vectors to start from, for a few of the samples."""
    poles = pencil.rates((3 * count,))
    hopeless = _HOPELESS * float(np.sum((e - np.mean(e)) ** 2))
    omega, alpha = poles.imag / 2, np.maximum(-poles.real, -1.0)  # growth is refused anyway
    found = []
    for chosen in combinations(range(poles.size), count):
        members = list(chosen)
        if np.diff(np.sort(omega[members])).min() >= _APART:
            found.append(linear_fit(omega[members], float(np.median(alpha[members])), s, e))
    return [start for misfit, start in sorted(found, key=lambda one: one[0])[:STARTS] if misfit < hopeless]


def linear_fit(omega: Samples, alpha: float, s: Samples, e: Samples) -> tuple[float, Samples]:
    """Fit the amplitudes for known rates; return the sum of squares and the parameters."""
    angle = 2 * omega[:, np.newaxis] * s
    basis = np.exp(-alpha * s) * np.concatenate([np.ones((1, s.size)), np.cos(angle), np.sin(angle)])
    linear = np.linalg.lstsq(basis.T, e, rcond=None)[0]
    misfit = float(np.sum((e - linear @ basis) ** 2))
    cosine, sine = np.split(linear[1:], 2)
    phasor = np.sqrt(2 * (cosine + 1j * sine))  # (cosine + i sine)**2 / 2 of each mode
    table = np.stack([omega, phasor.real, phasor.imag], axis=1)
    return misfit, np.array([alpha, *table.ravel()])
