"""What a pair (tr, td) costs: one function for each measure of the output.

A switched run keeps of the vibration only the deformation it had at tr, and starts at td with that deformation
and no vibration velocity.  With q the deformation in units of the square root of energy (q^2 is the elastic
energy, signed q the deformation) the difference to the reference run after td is the free vibration that starts
from q(tr) - q(td) and -q'(td).  All measures compare that difference with the vibration of the reference run.
"""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from d2rpick.history import Samples
    from d2rpick.mode import Mode

# The growth of the lock-in error that ``timing_tolerance`` allows.
TOLERATED_GROWTH = 0.05


def level_error(energy_tr: float, energy_td: float) -> float | None:
    """|sqrt(E(tr)/E(td)) - 1| [-]: how far the locked-in amplitude is off; None where an energy is not positive.

    Examples
    --------
    >>> level_error(1.21, 1.0)
    0.1000...
    >>> level_error(1.0, -805.0)
    """
    if not (energy_tr >= 0 and energy_td > 0):
        return None
    return abs(sqrt(energy_tr / energy_td) - 1)


def kinetic_share(mode: Mode, td: float) -> float:
    """K = T(td)/V(td) [-]: the share of the vibration energy that is kinetic at td, which no tr can save.

    V = T + (q - q0)^2 is the energy of the vibration about the preload q0; without preload V = T + E.
    """
    return float(mode.kinetic_energy(td) / mode.vibration_energy(td))


def lock_in_error(mode: Mode, tr: Samples | float, td: float) -> Samples:
    """L = |q(tr) - q(td)|/sqrt(V(td)) [-]: the error of the deformation that is locked in, of the shape of ``tr``.

    The same as |sqrt(E(tr)) - s sqrt(E(td))|/sqrt(V(td)) with s = 1 for equal signs of the deformation, else -1.
    """
    return np.asarray(np.abs(mode.deformation(tr) - mode.deformation(td)) / np.sqrt(mode.vibration_energy(td)))


def residual(lock_in: float, kinetic: float) -> float:
    """R = sqrt(L^2 + K) [-]: the vibration error after td relative to the reference vibration.

    Examples
    --------
    >>> residual(0.3, 0.16)
    0.5
    """
    return sqrt(lock_in**2 + kinetic)


def timing_tolerance(mode: Mode, tr: Samples, td: float) -> Samples:
    """How far each tr of shape (n,) may be off, to either side, before L grows by 0.05 [time].

    That is the nearest time where q leaves the band about q(td) that is wider than the deviation at tr by the
    tolerated growth; a period where q stays inside, since all it does it has done then.
    """
    wanted, scale = mode.deformation(td), np.sqrt(mode.vibration_energy(td))
    room = (lock_in_error(mode, tr, td) + TOLERATED_GROWTH) * scale
    half = np.pi / mode.omega
    ahead = mode.standstill_after(tr) + half * np.arange(3)[:, np.newaxis]
    behind = mode.standstill_after(tr) - half * np.arange(1, 4)[:, np.newaxis]
    distances = [_leaving(mode, tr, turns, wanted, room) for turns in (ahead, behind)]
    return np.minimum(np.minimum(*distances), 2 * half)


def _leaving(mode: Mode, tr: Samples, turns: Samples, wanted: Samples, room: Samples) -> Samples:
    """Distance from tr to where |q - wanted| exceeds ``room``, over the standstills ``turns``; infinite if nowhere.

    Between neighbouring standstills q is monotone, so the first one outside has the place just before it.
    """
    edges = np.vstack([tr, turns])
    outside = np.abs(mode.deformation(edges) - wanted) > room
    outside[0] = False  # tr itself, whatever rounding says
    first = np.argmax(outside, axis=0)
    column = np.arange(tr.size)
    inner, outer = edges[np.maximum(first - 1, 0), column], edges[first, column]
    for _ in range(50):  # halvings, to rounding
        middle = (inner + outer) / 2
        left = np.abs(mode.deformation(middle) - wanted) > room
        inner, outer = np.where(left, inner, middle), np.where(left, middle, outer)
    return np.where(first > 0, np.abs(inner - tr), np.inf)
