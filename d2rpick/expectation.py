"""What the energy alone lets expect after td, where no deformation and so no residual is known."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from d2rpick.situation import Situation


@dataclass(frozen=True)
class Expectation:
    """Estimates for a vibration of many modes without damping; fields are the keys of the JSON output.

    Such a vibration shares its energy V equally between internal and kinetic energy, so V is twice the mean of E in
    the flight.  What is locked in comes back as vibration and is shared in the same way.

    Parameters
    ----------
    mean_energy : float
        Mean of E in the flight, <E> [energy].
    kinetic_share : float
        1 - E(td)/(2 <E>): of V at td [-].
    ratio : float or None
        Mean of E after td over that of the reference when E(tr) is locked in, E(tr)/(2 <E>); None without a tr [-].
    ratio_at_level : float
        The same when E(td) is locked in [-].
    """

    mean_energy: float
    kinetic_share: float
    ratio: float | None
    ratio_at_level: float


def expectation(situation: Situation, energy_tr: float | None) -> Expectation | None:
    """Estimate from the mean energy of the flight; None on another basis than "energy", without a flight or energy.

    ``energy_tr`` is what the recommended tr locks in [energy], None where nothing is recommended.
    """
    mean = mean_in_flight(situation)
    if situation.basis != "energy" or mean is None or not situation.energy_td > 0:
        return None
    level = situation.energy_td / (2 * mean)
    ratio = None if energy_tr is None else energy_tr / (2 * mean)
    return Expectation(mean, max(0.0, 1 - level), ratio, level)


def mean_in_flight(situation: Situation) -> float | None:
    """Mean energy of the flight, up to td where its end is not known [energy]; None unless it is positive."""
    start, end = situation.flight.start, situation.flight.end
    if start is None:
        return None
    mean = situation.history.mean_energy(start, situation.td if end is None else end)
    return mean if mean is not None and mean > 0 else None


def shortfall(energy: float, mean: float) -> float:
    """How far a locked-in amplitude stays below that of all vibration energy, 1 - sqrt(E/(2 <E>)) [-].

    Infinite above it: more than there is must not be locked in.

    Examples
    --------
    >>> shortfall(0.5, 1.0), shortfall(2.0, 1.0), shortfall(3.0, 1.0)
    (0.5, 0.0, inf)
    """
    return 1 - sqrt(max(energy, 0.0) / (2 * mean)) if energy <= 2 * mean else float("inf")
