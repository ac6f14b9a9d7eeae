"""The margin that is kept before the contact that ends a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import window

if TYPE_CHECKING:
    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Samples

# Share of the flight that is always kept clear [-].  Landings of 36 computed runs (a car-like structure, a box with a
# block inside, OpenRadioss) moved by up to 1.1 % and 2.5 % of the flight before them.
SHARE: Final = 0.03


class Margin(NamedTuple):
    """Time kept clear before a contact [time], and what it comes from.

    ``source``: "given", "flight" (3 % of it), "landing" (how far a switch may move it) or "no-contact".  ``spread`` is
    how far a switch may move the landing [time], None where the files do not tell.
    """

    time: float
    source: str
    spread: float | None = None


def margin_before_contact(history: History, flight: Flight, given: float | None = None) -> Margin:
    """Give the margin before the contact that ends a flight: the one given, else 3 % of the flight or `landing_spread`.

    The larger of the two counts; where no contact is seen nothing has to be kept clear.
    """
    if given is not None:
        return Margin(given, "given")
    if flight.end is None or flight.start is None:
        return Margin(0.0, "no-contact")
    share, spread = SHARE * (flight.end - flight.start), landing_spread(history, flight)
    if spread is not None and spread > share:
        return Margin(spread, "landing", spread)
    return Margin(share, "flight", spread)


def landing_spread(history: History, flight: Flight) -> float | None:
    r"""Tell how far the velocity error of a switch may move the next landing.

    A switch takes the velocity of the vibration from all parts, and freezes them away from where they rest: by the
    amplitude :math:`a = \sqrt{2 T / m} / \omega` in root mean square.  The centre of mass goes on as before, so a
    surface that is off by that amplitude touches the ground earlier or later by

    .. math:: \delta t = \frac{a}{v_n} = \frac{1}{\omega} \sqrt{\frac{T}{K_n}}, \quad
        K_n = \frac{m v_n^2}{2} = K\, \frac{(p \cdot n)^2}{p^2}

    The mass cancels, so that energies and momenta, as they are written, are enough.

    Parameters
    ----------
    history : History
        With the energies of the whole model as evidence.
    flight : Flight
        With start and end [time].

    Returns
    -------
    float or None
        :math:`\delta t` [time]; None where kinetic energy or momentum are not written, or other parts move beside
        those that fly.

    Notes
    -----
    ``T``: mean kinetic energy of the vibration, by equipartition the mean internal energy in the flight above its
    lowest value [energy].  ``omega``: a vibration with that frequency lets E cross its mean four times per period
    [1/time]; the crossings in the flight tell it.  ``K``: kinetic energy before the contact [energy]; it holds that of
    the rotation, which brings the surface to the ground as well.  ``n``: direction in which gravity has changed the
    momentum ``p`` of what flies; without gravity that of ``p``.  Source: docs/plan.md, "The margin before a contact";
    computed landings moved by at most this, or 3 % of the flight, see tests/choice/test_windows.py.  An impact on an
    edge that lets 1 um of height move the landing after it by 70 ms is beyond any such margin.
    """
    balance, momentum = history.balance, _momentum(history, flight)
    if balance is None or balance.internal is None or balance.kinetic is None or momentum is None:
        return None
    start, end = flight.within(history.time)
    inside = window(balance.time, start, end)
    energy = balance.internal[inside]
    if energy.size < 2:
        return None
    vibration = float(energy.mean()) - max(0.0, float(energy.min()))
    crossings = int(np.count_nonzero(np.diff(energy > energy.mean())))
    omega = np.pi * crossings / (2 * (end - start))
    approach = float(balance.kinetic[inside][-1]) * _towards_ground(momentum)
    if vibration <= 0 or crossings == 0:
        return 0.0
    return float(np.sqrt(vibration / approach) / omega) if approach > 0 else float("inf")


def energy_of_approach(history: History, flight: Flight) -> float | None:
    """Give the kinetic energy of the motion along gravity at the end of a flight [energy].

    None if kinetic energy or momentum are not written, or other parts move beside those that fly.
    """
    balance, momentum = history.balance, _momentum(history, flight)
    if balance is None or balance.kinetic is None or momentum is None:
        return None
    kinetic = balance.kinetic[window(balance.time, *flight.within(history.time))]
    return float(kinetic[-1]) * _towards_ground(momentum) if kinetic.size else None


def _momentum(history: History, flight: Flight) -> Samples | None:
    """Momentum of what flies during the flight, shape (k, 3 or 1); None where others move too, or none is written."""
    for momenta in history.momenta:
        if (momenta.parts is None) != (flight.parts is None):
            continue
        moving = np.ptp(momenta.values, axis=0).any(axis=1)
        members = range(moving.size)
        if momenta.parts is not None and flight.parts is not None:
            flying = {part.id for part in flight.parts}
            members = [i for i, part in enumerate(momenta.parts) if part.id in flying]  # type: ignore[assignment]
        if set(np.flatnonzero(moving).tolist()) - set(members):
            return None
        values = momenta.of(members)[window(momenta.time, *flight.within(momenta.time))]
        return values if len(values) > 1 else None
    return None


def _towards_ground(momentum: Samples) -> float:
    """Share of the kinetic energy at the end that belongs to the motion along gravity [-]."""
    last, change = momentum[-1], momentum[-1] - momentum[0]
    if not change.any():
        return 1.0
    along = float(last @ change) ** 2
    return along / float((change @ change) * (last @ last)) if last.any() else 0.0
