"""Compute the margin between td and the contact that ends a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import find_window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Momenta, Samples

# Smallest margin, as a fraction of the flight [-].
# In 36 computed OpenRadioss runs, switching shifted the landing by up to 2.5 % of the flight.
LEAST_MARGIN: Final = 0.03
# Largest relative change of a momentum in a flight that is treated as rounding error [-].
_ROUNDING: Final = 1e-5
# Smallest number of states from which a force is determined.
_FEWEST: Final = 3
# A small position error can make a grazing contact, in which surfaces slide along each other, occur much earlier.
# _GRAZING_FORCE: largest force of a grazing contact, relative to the largest force on the body [-].
# _GRAZING_MOMENTUM: largest momentum change in a grazing contact, relative to the approach momentum [-].
# A landing takes at least 25 % of the momentum in theory; in computed runs of cars and boxes, it took at least 27 %.
# The grazing contact of a computed car took 2 % of the momentum.
_GRAZING_FORCE, _GRAZING_MOMENTUM = 0.01, 0.1


class Margin(NamedTuple):
    """Time that is kept free before a contact [time], and the source of this time.

    ``source`` is "given", "flight" (3 % of the flight), "landing" (by how much a switch may shift the landing),
    "grazing" (the same for a grazing contact) or "no-contact". ``spread`` is the time by which a switch may shift the
    landing [time]; None if the files do not show it. ``grazing`` is the quantity that shows a grazing contact, "force"
    or "momentum"; None for any other contact. ``rotation`` is "any" if the margin allows for any rotation of the body,
    because no file shows how the body rotates. It is "unseen" if such a rotation may make the contact occur earlier but
    its size is unknown, and None otherwise.
    """

    time: float
    source: str
    spread: float | None = None
    grazing: str | None = None
    rotation: str | None = None


def compute_margin(
    history: History,
    flight: Flight,
    given: float | None = None,
    place: float | None = None,
    turning: float | None = None,
) -> Margin:
    """Return the margin before the contact that ends a flight: the user's margin or, by default, an estimate.

    The margin is at least 3 % of the flight, and 0 if no contact is seen. If the user gave the end of the flight and
    the record shows no contact there, only a body that moves towards the ground may reach it earlier.

    Parameters
    ----------
    history : History
    flight : Flight
    given : float, optional
        [time]
    place : float, optional
        Position error of the body at the contact [length], see `estimate_landing_spread`.
    turning : float, optional
        Speed that the rotation of the body adds at the point of contact [length/time], see `estimate_landing_spread`.
    """
    if given is not None:
        return Margin(given, "given")
    if flight.end is None or flight.start is None:
        return Margin(0.0, "no-contact")
    share = LEAST_MARGIN * (flight.end - flight.start)
    spread = None
    if (
        flight.shows_contact
        or (_compute_front_speed(history, flight, turning) or 0) > 0
    ):
        spread = estimate_landing_spread(history, flight, place, turning)
    if spread is None or spread <= share:
        margin = Margin(share, "flight", spread)
    else:
        margin = Margin(spread, "landing", spread)
    if not flight.shows_contact:
        return margin
    if is_grazing(history, flight, margin.time):
        grazing = "force"
    elif changes_momentum_little(history, flight):
        grazing = "momentum"
    else:
        return margin
    earlier = estimate_grazing_spread(history, flight, place)
    if earlier is None or earlier <= margin.time:
        return margin
    return Margin(earlier, "grazing", earlier, grazing)


def estimate_landing_spread(
    history: History,
    flight: Flight,
    place: float | None,
    turning: float | None = None,
) -> float | None:
    """Return by how much a switch may shift the next landing [time], from its velocity error and its position error.

    A body that is misplaced by ``place`` [length] reaches the contact earlier by this distance divided by the speed at
    which the point of contact approaches the ground. This is the speed of the centre of mass plus the speed that the
    rotation adds, ``turning`` [length/time], which is None if unknown. If the sum is not positive, the surface grazes
    the ground: for example, rotation alone brings a corner down while the centre of mass still rises. The result is
    None if neither error is known.
    """
    spread = estimate_spread_of_vibration(history, flight)
    front = _compute_front_speed(history, flight, turning)
    if place is None or front is None:
        return spread
    if front <= 0:
        return estimate_grazing_spread(history, flight, place)
    return place / front + (spread or 0.0)


def _compute_front_speed(
    history: History, flight: Flight, turning: float | None
) -> float | None:
    """Return the speed at which the point of contact approaches the ground [length/time]; None if it is unknown."""
    speed = compute_closing_speed(history, flight)
    return None if speed is None else speed + (turning or 0.0)


def estimate_grazing_spread(
    history: History, flight: Flight, place: float | None
) -> float | None:
    r"""Return how much earlier a grazing contact may occur [time]; infinite without gravity, None if unknown.

    If surfaces slide along each other, their closing speed is almost 0, and only gravity g closes a gap. For a gap e,
    which is ``place`` plus the amplitude of the vibration, this takes the time :math:`\sqrt{2 e / g}`.
    """
    spread = estimate_spread_of_vibration(history, flight)
    speed = compute_closing_speed(history, flight)
    if spread is None or speed is None or np.isinf(spread):
        amplitude = None
    else:
        amplitude = spread * abs(speed)
    if place is None and amplitude is None:
        return None
    error = (place or 0.0) + (amplitude or 0.0)
    gravity = flight.gravity if np.isfinite(flight.gravity) else 0.0
    if gravity <= 0:
        return float("inf") if error > 0 else 0.0
    return float(np.sqrt(2 * error / gravity))


class _Contact(NamedTuple):
    """A body's momentum, gravity, and the other forces on the body, at the times ``time`` of all states (n,).

    ``begin`` is the last state before the contact that ends the flight.
    """

    time: Samples
    momentum: Samples
    force: Samples
    gravity: Samples
    begin: int


def _find_contact(history: History, flight: Flight) -> _Contact | None:
    """Return the forces around the contact that ends a flight; None if the momenta do not show them."""
    evidence = select_momenta_of_flight(history, flight)
    if evidence is None or flight.end is None:
        return None
    from d2rpick.flight.free_fall import FreeFall

    momenta, members = evidence
    time = momenta.time
    momentum = momenta.of(members)
    inside = find_window(time, *flight.within(time))
    begin = int(np.searchsorted(time, flight.end, side="right")) - 1
    if time[inside].size < _FEWEST or begin + _FEWEST >= time.size:
        return None
    gravity = FreeFall(time[inside], momentum[inside]).gravity()
    rates = np.gradient(momentum, time, axis=0)
    force = np.linalg.norm(rates - gravity, axis=1)
    return _Contact(time, momentum, force, gravity, begin)


def is_grazing(history: History, flight: Flight, within: float) -> bool:
    """Return True if the contact that ends a flight stays below 1 % of the largest force for the time ``within``.

    The result is False if the record ends earlier, or if the momenta do not show the force.
    """
    contact = _find_contact(history, flight)
    if contact is None or flight.end is None:
        return False
    end = flight.end + within
    after_contact = find_window(contact.time, flight.end, end)
    if contact.time[after_contact].size < _FEWEST or contact.time[-1] <= end:
        return False
    limit = _GRAZING_FORCE * contact.force.max()
    return bool(contact.force[after_contact].max() < limit)


def changes_momentum_little(history: History, flight: Flight) -> bool:
    """Return True if the contact that ends a flight takes less than 10 % of the approach momentum.

    The contact is over when its force stays below 1 % of the largest force for three states. The impulse is the change
    of momentum minus the part due to gravity. The result is False if the record ends earlier, or if the momenta do not
    show the force.
    """
    contact = _find_contact(history, flight)
    evidence = select_momenta_of_flight(history, flight)
    speed = compute_closing_speed(history, flight)
    if contact is None or evidence is None or speed is None:
        return False
    limit = _GRAZING_FORCE * contact.force.max()
    acting = np.flatnonzero(contact.force[contact.begin :] > limit)
    if not acting.size:
        return False
    first = contact.begin + int(acting[0])
    is_free = contact.force[first:] <= limit
    # The contact is over at the first of several free states.
    ends = (
        first + state
        for state in range(is_free.size - _FEWEST + 1)
        if is_free[state : state + _FEWEST].all()
    )
    end = next(ends, None)
    if end is None:
        return False
    begin = contact.begin
    duration = contact.time[end] - contact.time[begin]
    change = contact.momentum[end] - contact.momentum[begin]
    impulse = change - contact.gravity * duration
    momenta, members = evidence
    mass = 1.0 if momenta.velocity else momenta.mass(members)
    momentum_of_approach = mass * abs(speed)
    return bool(np.linalg.norm(impulse) < _GRAZING_MOMENTUM * momentum_of_approach)


def estimate_spread_of_vibration(history: History, flight: Flight) -> float | None:
    r"""Return the time by which the velocity error of a switch may shift the next landing [time].

    A switch removes the velocity of the vibration from all parts, and freezes them away from their rest positions; the
    rms distance is the amplitude :math:`a = \sqrt{2 T / m} / \omega`. The motion of the centre of mass does not change,
    so a surface displaced by this amplitude touches the ground earlier or later by

    .. math:: \delta t = \frac{a}{v_n} = \frac{1}{\omega} \sqrt{\frac{T}{K_n}}, \quad
        K_n = \frac{m v_n^2}{2} = K\, \frac{(p \cdot n)^2}{p^2}

    The mass cancels, so that the written energies and momenta are sufficient.

    Parameters
    ----------
    history : History
        Record with the energies of the whole model as evidence.
    flight : Flight
        Flight whose start and end are known [time].

    Returns
    -------
    float or None
        :math:`\delta t` [time]; None if the kinetic energy or the momentum is not written, or if other parts move as
        well.

    Notes
    -----
    ``T`` is the mean kinetic energy of the vibration [energy]; by equipartition, it equals the mean of the internal
    energy in the flight above its lowest value. ``omega`` [1/time] follows from the times at which the energy crosses
    its mean, four per period. ``K`` is the kinetic energy before the contact [energy], including that of the rotation,
    which also moves the surface towards the ground. ``n`` is the direction in which gravity has changed the momentum
    ``p`` of the flying parts or, without gravity, the direction of ``p``. Source: the margin before a contact in docs
    (plan). In computed runs, landings were shifted by at most this time or 3 % of the flight, see
    tests/choice/test_windows.py. No margin covers an impact on an edge: a height difference of 1 um shifts the landing
    after such an impact by 70 ms.
    """
    balance = history.balance
    momentum = _get_momentum_in_flight(history, flight)
    if balance is None or balance.internal is None or balance.kinetic is None:
        return None
    if momentum is None:
        return None
    start, end = flight.within(history.time)
    inside = find_window(balance.time, start, end)
    energy = balance.internal[inside]
    if energy.size < 2:
        return None
    vibration = float(energy.mean()) - max(0.0, float(energy.min()))
    crossings = int(np.count_nonzero(np.diff(energy > energy.mean())))
    omega = np.pi * crossings / (2 * (end - start))
    share = _compute_share_towards_ground(momentum)
    approach = float(balance.kinetic[inside][-1]) * share
    if vibration <= 0 or crossings == 0:
        return 0.0
    if approach > 0:
        return float(np.sqrt(vibration / approach) / omega)
    return float("inf")


def compute_energy_of_approach(history: History, flight: Flight) -> float | None:
    """Return the kinetic energy of the motion along gravity at the end of a flight [energy].

    The result is None if the kinetic energy or the momentum is not written, or if other parts move as well.
    """
    balance = history.balance
    momentum = _get_momentum_in_flight(history, flight)
    if balance is None or balance.kinetic is None or momentum is None:
        return None
    inside = find_window(balance.time, *flight.within(history.time))
    kinetic = balance.kinetic[inside]
    if not kinetic.size:
        return None
    return float(kinetic[-1]) * _compute_share_towards_ground(momentum)


def _get_momentum_in_flight(history: History, flight: Flight) -> Samples | None:
    """Return the momentum of the flying parts, shape (k, 3 or 1); None if unknown or if other parts move as well."""
    momentum_of_body = select_momenta_of_flight(history, flight)
    if momentum_of_body is None:
        return None
    momenta, members = momentum_of_body
    moving = np.ptp(momenta.values, axis=0).any(axis=1)
    if set(np.flatnonzero(moving).tolist()) - set(members):
        return None
    inside = find_window(momenta.time, *flight.within(momenta.time))
    values = momenta.of(members)[inside]
    return values if len(values) > 1 else None


def select_momenta_of_flight(
    history: History, flight: Flight
) -> tuple[Momenta, Sequence[int]] | None:
    """Return the momenta that show the flying parts, and these parts' columns; None if no momenta are written."""
    for momenta in history.momenta:
        if (momenta.parts is None) != (flight.parts is None):
            continue
        if momenta.parts is None or flight.parts is None:
            return momenta, range(momenta.values.shape[1])
        flying_ids = {part.id for part in flight.parts}
        columns = [
            column for column, part in enumerate(momenta.parts) if part.id in flying_ids
        ]
        return momenta, columns
    return None


def find_direction_of_approach(history: History, flight: Flight) -> Samples | None:
    """Return the unit vector (3,) of gravity in a flight or, without gravity, of the motion.

    The result is None if the momentum is not written, or if nothing moves.
    """
    momentum_of_body = select_momenta_of_flight(history, flight)
    if momentum_of_body is None:
        return None
    momenta, members = momentum_of_body
    inside = find_window(momenta.time, *flight.within(momenta.time))
    momentum = momenta.of(members)[inside]
    return _find_direction_of_change(momentum) if len(momentum) > 1 else None


def compute_closing_speed(history: History, flight: Flight) -> float | None:
    """Return the speed along gravity at the end of a flight [length/time]; it is negative for a rising body.

    If there is no gravity, the result is the total speed. It is None if the momentum or the mass is unknown.
    """
    momentum_of_body = select_momenta_of_flight(history, flight)
    if momentum_of_body is None:
        return None
    momenta, members = momentum_of_body
    inside = find_window(momenta.time, *flight.within(momenta.time))
    momentum = momenta.of(members)[inside]
    mass = 1.0 if momenta.velocity else momenta.mass(members)
    if len(momentum) < 2 or not mass > 0:
        return None
    direction = find_direction_of_approach(history, flight)
    if direction is None:
        return 0.0
    return float(momentum[-1] @ direction) / mass


def _compute_share_towards_ground(momentum: Samples) -> float:
    """Return the fraction of the final kinetic energy that belongs to motion along gravity [-]."""
    direction = _find_direction_of_change(momentum)
    last = momentum[-1]
    if direction is None or not last.any():
        return 0.0 if momentum.any() else 1.0
    return float(last @ direction) ** 2 / float(last @ last)


def _find_direction_of_change(momentum: Samples) -> Samples | None:
    """Return the direction in which a momentum (n, 3 or 1) changes, or its own direction if it is constant.

    The result is None if the momentum is 0.
    """
    change = momentum[-1] - momentum[0]
    largest = float(np.linalg.norm(momentum, axis=1).max())
    size = float(np.linalg.norm(change))
    along = change if size > _ROUNDING * largest else momentum[-1]
    length = float(np.linalg.norm(along))
    if not length > 0:
        return None
    return np.asarray(along / length)
