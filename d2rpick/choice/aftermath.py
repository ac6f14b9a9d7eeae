r"""What comes after td: the mean energy that a pair keeps, and what its error is worth in the next contact.

An elastic energy V that is released at rest is shared equally between internal and kinetic energy, so with a static
energy S and the vibration energy U of the reference at td the means of the internal energy after td compare as

.. math:: \frac{S + V(t_r)/2}{S + U(t_d)/2}

What fluctuates in the flight bounds U, and with it what is static.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.margin import energy_of_approach
from d2rpick.vibration.measures import wrong_sign

if TYPE_CHECKING:
    from d2rpick.choice.candidates import Candidate
    from d2rpick.choice.situation import Situation
    from d2rpick.histories.history import Samples

# Vibration energies are known within this share from lines, swings or signs of parts.
_KNOWN_WITHIN: Final = 0.1
# Of m alike modes that are out of step the energy has a standard deviation of 1/sqrt(8 m) of what they hold together:
# so much more than it may be there. In a computed car 100 such modes hold what its nodes show.
_MODES_OUT_OF_STEP: Final = 110
# Of e: about the largest double.
_LARGEST_EXPONENT: Final = 700.0
# By so much of it the means of computed runs lay beyond what follows from their lines.
_OF_SOLVER: Final = 0.005
# Fewer states do not show what fluctuates.
_FEWEST_STATES: Final = 8


class Kept(NamedTuple):
    """Lowest and highest mean internal energy after td, over that of the reference [-]."""

    low: float
    high: float


def kept_mean_energy(situation: Situation, candidate: Candidate) -> Kept | None:
    """Bound the mean energy after td for one tr; None if nothing tells it."""
    if situation.at_rest:
        return Kept(1.0, 1.0)
    ratios = [
        _ratio(candidate.energy, situation.energy_td, *one)
        for one in _vibration_energies(situation)
    ]
    known = [ratio for ratio in ratios if np.isfinite(ratio)]
    if not known:
        return None
    low = min(known)
    high = max(known)
    if situation.basis != "oscillator":
        low = low - _OF_SOLVER
        high = high + _OF_SOLVER
    # parts that were not chosen may hand over what they hold
    beside = situation.together.beside.energy
    return Kept(
        max(low, 0.0),
        high + (beside / situation.energy_td if situation.energy_td > 0 else 0.0),
    )


def _ratio(
    energy_tr: float, energy_td: float, elastic_td: float, whole: float
) -> float:
    """Mean energy after td over that of the reference, from the elastic and the whole vibration energy at td [-]."""
    static = max(energy_td - elastic_td, 0.0)
    reference = static + whole / 2
    if reference > 0:
        return (static + max(energy_tr - static, 0.0) / 2) / reference
    return np.nan


def _vibration_energies(situation: Situation) -> list[tuple[float, float]]:
    """Bounds of the elastic and the whole vibration energy at td, in pairs that go together [energy]."""
    compared = situation.vibration.compared
    if compared is not None:
        elastic = float(compared.deformation.elastic_energy(situation.td))
        whole = float(compared.deformation.vibration_energy(situation.td))
        if situation.basis == "oscillator":
            scales: tuple[float, ...] = (1.0,)
        else:
            scales = (1 - _KNOWN_WITHIN, 1 + _KNOWN_WITHIN)
        return [(scale * elastic, scale * whole) for scale in scales]
    bounds = vibration_energy_bounds(situation)
    if bounds is None:
        return []
    time, energy = _energies_in_flight(situation)
    mean = float(np.mean(energy))
    # what damping leaves at td of the mean over the flight
    left = 1 / float(
        np.mean(
            np.exp(
                np.minimum(
                    -situation.flight.damping * (time - situation.td), _LARGEST_EXPONENT
                )
            )
        )
    )
    # half of the whole is the mean above what is static
    return [
        (max(situation.energy_td - (mean - whole / 2), 0.0), left * whole)
        for whole in bounds
    ]


def vibration_energy_bounds(situation: Situation) -> tuple[float, float] | None:
    """Least and largest vibration energy that an energy with these fluctuations has in the flight [energy].

    No vibration swings by more than it holds; many modes out of step swing by much less.
    """
    time, energy = _energies_in_flight(situation)
    if time.size < _FEWEST_STATES:
        return None
    since = time - time[0]
    swing = energy - np.polyval(np.polyfit(since, energy, 2), since)
    largest = max(2 * float(energy.mean()), 0.0)
    least = min(float(np.ptp(swing)), largest)
    return least, max(
        least, min(np.sqrt(8 * _MODES_OUT_OF_STEP) * float(swing.std()), largest)
    )


def _energies_in_flight(situation: Situation) -> tuple[Samples, Samples]:
    """Times and energies of the flight, up to td if its end is not known [time], [energy]."""
    start = situation.flight.start
    end = situation.flight.end
    return situation.history.between(
        np.inf if start is None else start, situation.td if end is None else end
    )


class Worth(NamedTuple):
    """What an error of the vibration is worth: its energy over that of the next contact, at most [-].

    ``contact`` is the energy that the next contact puts into the parts [energy].
    """

    share: float
    contact: float


def worth_of_error(situation: Situation, candidate: Candidate) -> Worth | None:
    """Compare the error of the vibration of a pair with the next contact; None if that one is not known.

    The energy of the error is R^2 U(td).  With an unknown residual the worst one counts, that of equal levels with
    opposite signs.
    """
    contact = energy_of_next_contact(situation)
    if contact is None or situation.at_rest:
        return None
    compared = situation.vibration.compared
    if compared is not None and candidate.residual is not None:
        residual = max(candidate.residual, candidate.residual_high or 0.0)
        energy = residual**2 * float(
            compared.deformation.vibration_energy(situation.td)
        )
    else:
        bounds = vibration_energy_bounds(situation)
        if bounds is None:
            return None
        energy = wrong_sign(0.0) ** 2 * bounds[1]
    return Worth(energy / contact, contact)


def energy_of_next_contact(situation: Situation) -> float | None:
    """Energy that the next contact puts into the parts [energy]; None if no contact is seen.

    That is the rise of the internal energy after the flight, as far as the record shows it, or else the kinetic energy
    of the fall at the end of the flight.
    """
    history = situation.history
    end = situation.flight.end
    if end is None:
        return None
    _, after = history.between(end, np.inf)
    rise = float(after.max(initial=-np.inf)) - history.energy_at(end)
    return rise if rise > 0 else energy_of_approach(history, situation.flight)
