"""The margin that is kept before the contact that ends a flight."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.samples import window

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.flight.flight import Flight
    from d2rpick.histories.history import History, Momenta, Samples

# Share of the flight that is always kept clear [-].  Landings of 36 computed runs (a car-like structure, a box with a
# block inside, OpenRadioss) moved by up to 1.1 % and 2.5 % of the flight before them.
SHARE: Final = 0.03
# Fewest states that a force is looked for in.
_FEWEST: Final = 3


# A contact whose force stays below this share of the largest on the body is a grazing one: the surfaces move along each
# other, so that the body reaches it much earlier if it is a little out of place.
_GRAZING: Final = 0.01


class Margin(NamedTuple):
    """Time kept clear before a contact [time], and what it comes from.

    ``source``: "given", "flight" (3 % of it), "landing" (how far a switch may move it), "grazing" (the same if the body
    only grazes it) or "no-contact".  ``spread`` is how far a switch may move the landing [time], None where the files
    do not tell.
    """

    time: float
    source: str
    spread: float | None = None


def margin_before_contact(
    history: History,
    flight: Flight,
    given: float | None = None,
    place: float | None = None,
) -> Margin:
    """Give the margin before the contact that ends a flight: the one given, else the time by which it may come earlier.

    At least 3 % of the flight is kept; where no contact is seen nothing has to be kept clear.

    Parameters
    ----------
    history : History
    flight : Flight
    given : float, optional
        [time]
    place : float, optional
        How far the body may be out of place at the contact [length], see `landing_moves`.
    """
    if given is not None:
        return Margin(given, "given")
    if flight.end is None or flight.start is None:
        return Margin(0.0, "no-contact")
    share, spread = (
        SHARE * (flight.end - flight.start),
        landing_moves(history, flight, place),
    )
    kept = (
        Margin(share, "flight", spread)
        if spread is None or spread <= share
        else Margin(spread, "landing", spread)
    )
    if not grazes(history, flight, kept.time):
        return kept
    earlier = grazing_moves(history, flight, place)
    return (
        kept
        if earlier is None or earlier <= kept.time
        else Margin(earlier, "grazing", earlier)
    )


def landing_moves(
    history: History, flight: Flight, place: float | None
) -> float | None:
    """Tell how far a switch may move the next landing: by its velocity error and by the place error of the body.

    A body that is out of place by ``place`` [length] reaches the contact earlier by that over the speed at which it
    moves towards the ground then.  None where neither is known [time].
    """
    spread, speed = landing_spread(history, flight), _closing_speed(history, flight)
    if place is None or speed is None:
        return spread
    out_of_place = place / speed if speed > 0 else float("inf")
    return out_of_place if spread is None else spread + out_of_place


def grazing_moves(
    history: History, flight: Flight, place: float | None
) -> float | None:
    r"""Tell how much earlier a grazing contact may come [time]; infinite without gravity, None if no error is known.

    Where surfaces move along each other their closing speed is next to nothing, and gravity g alone opens a gap of
    ``place`` and of the amplitude of the vibration: in :math:`\sqrt{2 e / g}`.
    """
    spread, speed = landing_spread(history, flight), _closing_speed(history, flight)
    amplitude = (
        None if spread is None or speed is None or np.isinf(spread) else spread * speed
    )
    if place is None and amplitude is None:
        return None
    error = (place or 0.0) + (amplitude or 0.0)
    gravity = flight.gravity if np.isfinite(flight.gravity) else 0.0
    if gravity <= 0:
        return float("inf") if error > 0 else 0.0
    return float(np.sqrt(2 * error / gravity))


def grazes(history: History, flight: Flight, within: float) -> bool:
    """Whether the contact that ends a flight stays below a hundredth of the largest force for a time ``within`` it.

    False where the record ends before that, or momenta do not show the force [time].
    """
    seen = _of_flight(history, flight)
    if seen is None or flight.end is None:
        return False
    from d2rpick.flight.free_fall import FreeFall

    momenta, members = seen
    time, momentum = momenta.time, momenta.of(members)
    inside = window(time, *flight.within(time))
    after = window(time, flight.end, flight.end + within)
    if (
        time[inside].size < _FEWEST
        or time[after].size < _FEWEST
        or time[-1] <= flight.end + within
    ):
        return False
    gravity = FreeFall(time[inside], momentum[inside]).gravity()
    force = np.linalg.norm(np.gradient(momentum, time, axis=0) - gravity, axis=1)
    return bool(force[after].max() < _GRAZING * force.max())


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
    momentum ``p`` of what flies; without gravity that of ``p``.
    Source: docs/explanation/planning.md, "The margin before a contact";
    computed landings moved by at most this, or 3 % of the flight, see tests/choice/test_windows.py.  An impact on an
    edge that lets 1 um of height move the landing after it by 70 ms is beyond any such margin.
    """
    balance, momentum = history.balance, _momentum(history, flight)
    if (
        balance is None
        or balance.internal is None
        or balance.kinetic is None
        or momentum is None
    ):
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
    return (
        float(np.sqrt(vibration / approach) / omega) if approach > 0 else float("inf")
    )


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
    seen = _of_flight(history, flight)
    if seen is None:
        return None
    momenta, members = seen
    moving = np.ptp(momenta.values, axis=0).any(axis=1)
    if set(np.flatnonzero(moving).tolist()) - set(members):
        return None
    values = momenta.of(members)[window(momenta.time, *flight.within(momenta.time))]
    return values if len(values) > 1 else None


def _of_flight(
    history: History, flight: Flight
) -> tuple[Momenta, Sequence[int]] | None:
    """Momenta that show what flies, and the places of it in them; None where none is written."""
    for momenta in history.momenta:
        if (momenta.parts is None) != (flight.parts is None):
            continue
        if momenta.parts is None or flight.parts is None:
            return momenta, range(momenta.values.shape[1])
        flying = {part.id for part in flight.parts}
        return momenta, [i for i, part in enumerate(momenta.parts) if part.id in flying]
    return None


def _closing_speed(history: History, flight: Flight) -> float | None:
    """Speed along gravity, without it of the whole motion, at the end of a flight [length/time]; None if unknown."""
    seen = _of_flight(history, flight)
    if seen is None:
        return None
    momenta, members = seen
    momentum = momenta.of(members)[window(momenta.time, *flight.within(momenta.time))]
    mass = 1.0 if momenta.velocity else momenta.mass(members)
    if len(momentum) < 2 or not mass > 0:
        return None
    size = float(np.linalg.norm(momentum[-1])) / mass
    return size * float(np.sqrt(_towards_ground(momentum)))


def _towards_ground(momentum: Samples) -> float:
    """Share of the kinetic energy at the end that belongs to the motion along gravity [-]."""
    last, change = momentum[-1], momentum[-1] - momentum[0]
    if not change.any():
        return 1.0
    along = float(last @ change) ** 2
    return along / float((change @ change) * (last @ last)) if last.any() else 0.0
