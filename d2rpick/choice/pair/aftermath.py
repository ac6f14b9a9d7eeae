r"""Predict the motion after td: how much mean energy a pair preserves, and its error relative to the next contact.

An elastic energy V that is released at rest is shared equally between internal and kinetic energy.  With the
static energy S and the vibration energy U of the reference run, the ratio of the mean internal energies after td is

.. math:: \frac{S(t_r) + V(t_r)/2}{S(t_d) + U(t_d)/2}

The static energy grows in the flight if heat or plastic work is added to it; rigid parts do not gain this energy.
If V is not known at each time, S is treated as constant. The fluctuation of the energy in the flight gives bounds of U,
and thereby of S.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.memory import remember
from d2rpick.base.tuples import NamedTuple
from d2rpick.choice.pair.warnings import (
    compute_mean_decay,
    select_energies_in_flight,
)
from d2rpick.flight.margin import compute_energy_of_approach
from d2rpick.vibration.measures import BAND_DEVIATIONS, wrong_sign

if TYPE_CHECKING:
    from d2rpick.choice.pair.candidates import Candidate, Pair
    from d2rpick.choice.pair.situation import Situation
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History

# Relative error of vibration energies that are derived from spectral lines or counted oscillations [-].
_KNOWN_WITHIN: Final = 0.1
# Assumed upper bound of the number of similar modes with random phases, as in a computed car model with 100 modes.
# The total energy of m modes with random phases has a relative standard deviation of 1/sqrt(8 m).
_MODES_OUT_OF_STEP: Final = 110
# Largest relative deviation of the mean energy after td from the mean energy that spectral lines predict [-].
_OF_SOLVER: Final = 0.005
# Smallest number of states needed to determine the fluctuation of the energy.
_FEWEST_STATES: Final = 8


class MeanEnergyBounds(NamedTuple):
    """Lowest and highest mean internal energy after td, relative to the reference run [-]."""

    low: float
    high: float


def bound_mean_energy(
    situation: Situation, candidate: Candidate
) -> MeanEnergyBounds | None:
    """Return bounds of the mean energy after td for one tr; None if the bounds are unknown."""
    if situation.at_rest:
        return MeanEnergyBounds(1.0, 1.0)
    if not situation.energy_td > 0:
        return None
    ratios = [
        _compute_mean_ratio(candidate.energy, situation.energy_td, energies)
        for energies in _bound_vibration_energies(situation, candidate.tr)
    ]
    finite = [ratio for ratio in ratios if np.isfinite(ratio)]
    if not finite:
        return None
    low = min(finite)
    high = max(finite)
    if situation.basis != "oscillator":
        low = low - _OF_SOLVER
        high = high + _OF_SOLVER
    # Parts that vibrate but were not chosen may transfer their energy to the chosen parts.
    other_energy = situation.together.not_chosen.energy
    return MeanEnergyBounds(
        max(low, 0.0),
        high + (other_energy / situation.energy_td if situation.energy_td > 0 else 0.0),
    )


class _VibrationEnergies(NamedTuple):
    """Elastic part of the vibration energy at tr (None if unknown) and at td, and all of it at td [energy]."""

    elastic_tr: float | None
    elastic_td: float
    whole: float


def _compute_mean_ratio(
    energy_tr: float, energy_td: float, vibration: _VibrationEnergies
) -> float:
    """Return the mean energy after td relative to the reference run [-]."""
    static_td = max(energy_td - vibration.elastic_td, 0.0)
    if vibration.elastic_tr is None:
        static_tr = static_td
        elastic_tr = max(energy_tr - static_td, 0.0)
    else:
        elastic_tr = min(vibration.elastic_tr, max(energy_tr, 0.0))
        static_tr = energy_tr - elastic_tr
    reference = static_td + vibration.whole / 2
    if reference > 0:
        return (static_tr + elastic_tr / 2) / reference
    return np.nan


def _bound_vibration_energies(
    situation: Situation, tr: float
) -> list[_VibrationEnergies]:
    """Return lower and upper bounds of the vibration energies at tr and td."""
    vibration = situation.vibration
    if vibration.compared is not None:
        deformation = vibration.compared.deformation
        elastic_td = float(deformation.elastic_energy(situation.td))
        whole = float(deformation.vibration_energy(situation.td))
        elastic_tr = None
        if vibration.comparable(np.array(tr)):
            elastic_tr = float(deformation.elastic_energy(tr))
        if situation.basis == "oscillator":
            scales: tuple[float, ...] = (1.0,)
        else:
            scales = (1 - _KNOWN_WITHIN, 1 + _KNOWN_WITHIN)
        return [
            _VibrationEnergies(
                None if elastic_tr is None else scale * elastic_tr,
                scale * elastic_td,
                scale * whole,
            )
            for scale in scales
        ]
    bounds = bound_vibration_energy(situation)
    if bounds is None:
        return []
    time, energy = select_energies_in_flight(situation)
    mean = float(np.mean(energy))
    damping_left = 1 / compute_mean_decay(situation, time)
    # On average, half of the vibration energy is internal energy, which adds to the static energy.
    return [
        _VibrationEnergies(
            None,
            max(situation.energy_td - (mean - whole / 2), 0.0),
            damping_left * whole,
        )
        for whole in bounds
    ]


def compute_static_change(situation: Situation, candidate: Candidate) -> float | None:
    """Return by how much the static energy changes from tr to td, relative to the mean energy after td [-].

    It is the smallest change that the bounds of the vibration energy allow; 0 if they have different signs. A rise by
    what damping takes from the vibration is no change: the dampers' work remains in the internal energy. Neither is a
    change that may be noise. The result is None if the vibration energy at tr or the mean energy is unknown, or if
    nothing vibrates.
    """
    if situation.at_rest:
        return None
    changes = []
    damped = _compute_damped_energy(situation, candidate.tr)
    modal = situation.vibration.modal
    # The energies at tr and td each have the noise of the record.
    scatter = 0.0 if modal is None else sqrt(2) * BAND_DEVIATIONS * modal.noise
    for vibration in _bound_vibration_energies(situation, candidate.tr):
        static_td = max(situation.energy_td - vibration.elastic_td, 0.0)
        mean = static_td + vibration.whole / 2
        if vibration.elastic_tr is None or not mean > 0:
            return None
        static_tr = max(candidate.energy - vibration.elastic_tr, 0.0)
        rise = static_td - static_tr
        change = max(rise - damped, min(rise, 0.0))
        changes.append(copysign(max(abs(change) - scatter, 0.0), change) / mean)
    if not changes:
        return None
    if min(changes) < 0 < max(changes):
        return 0.0
    return min(changes, key=abs)


def _compute_damped_energy(situation: Situation, tr: float) -> float:
    """Return the energy that damping takes from the vibration between tr and td [energy]; 0 if it is unknown."""
    vibration = situation.vibration
    if vibration.compared is None or not vibration.comparable(np.array(tr)):
        return 0.0
    energies = vibration.compared.deformation.vibration_energy(
        np.array([tr, situation.td])
    )
    return max(float(energies[0] - energies[1]), 0.0)


def bound_vibration_energy(situation: Situation) -> tuple[float, float] | None:
    """Return the smallest and largest vibration energy that can cause the energy fluctuations in the flight [energy].

    The fluctuation of the internal energy never exceeds the vibration energy, and many modes with random phases cause a
    much smaller fluctuation.
    """
    time, energy = select_energies_in_flight(situation)
    if time.size < _FEWEST_STATES:
        return None
    since = time - time[0]
    swing = energy - np.polyval(np.polyfit(since, energy, 2), since)
    largest = max(2 * float(energy.mean()), 0.0)
    smallest = min(float(np.ptp(swing)), largest)
    return smallest, max(
        smallest, min(np.sqrt(8 * _MODES_OUT_OF_STEP) * float(swing.std()), largest)
    )


class Worth(NamedTuple):
    """Largest ratio of the vibration-error energy to the energy of the next contact [-].

    ``contact`` is the energy that the next contact puts into the parts [energy].
    """

    share: float
    contact: float


def compare_error_with_contact(
    situation: Situation, candidate: Candidate | Pair
) -> Worth | None:
    """Compare the vibration error of a pair with the energy of the next contact; None if either is unknown.

    The energy of the error is R^2 U(td).  If the residual R is unknown, its largest value is used: that of equal levels
    with opposite signs.
    """
    contact = find_energy_of_next_contact(situation.history, situation.flight)
    if contact is None or situation.at_rest:
        return None
    compared = situation.vibration.compared
    if compared is not None and candidate.residual is not None:
        residual = max(candidate.residual, candidate.residual_high or 0.0)
        energy = residual**2 * float(
            compared.deformation.vibration_energy(situation.td)
        )
    else:
        bounds = bound_vibration_energy(situation)
        if bounds is None:
            return None
        energy = wrong_sign(0.0) ** 2 * bounds[1]
    return Worth(energy / contact, contact)


@remember
def find_energy_of_next_contact(history: History, flight: Flight) -> float | None:
    """Return the energy that the next contact puts into the parts [energy]; None if the record does not show it.

    This energy is the rise of the internal energy after the flight that the record shows, or else the kinetic energy of
    the approach at the end of the flight.
    """
    end = flight.end
    if end is None or not flight.shows_contact:
        return None
    _, energies = history.between(end, np.inf)
    rise = float(energies.max(initial=-np.inf)) - history.energy_at(end)
    return rise if rise > 0 else compute_energy_of_approach(history, flight)
