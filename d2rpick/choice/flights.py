"""The flights of a record as windows for td, and the margin that is kept before the contact that ends one."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.errors import RangeError
from d2rpick.choice.situation import Settings, examine, landed
from d2rpick.flight.flight import Flight, all_seen, witnesses
from d2rpick.flight.window import moments
from d2rpick.histories.digits import not_after, sum_as_read
from d2rpick.histories.samples import window
from d2rpick.vibration.span import Fits

if TYPE_CHECKING:
    from collections.abc import Iterable

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
    computed landings moved by at most this, or 3 % of the flight, see tests/choice/test_flights.py.  An impact on an
    edge that lets 1 um of height move the landing after it by 70 ms is beyond any such margin.
    """
    balance, momentum = history.balance, _momentum(history, flight)
    if balance is None or balance.internal is None or balance.kinetic is None or momentum is None:
        return None
    assert flight.start is not None
    assert flight.end is not None
    inside = window(balance.time, flight.start, flight.end)
    energy = balance.internal[inside]
    if energy.size < 2:
        return None
    vibration = float(energy.mean()) - max(0.0, float(energy.min()))
    crossings = int(np.count_nonzero(np.diff(energy > energy.mean())))
    omega = np.pi * crossings / (2 * (flight.end - flight.start))
    approach = float(balance.kinetic[inside][-1]) * _towards_ground(momentum)
    if vibration <= 0 or crossings == 0:
        return 0.0
    return float(np.sqrt(vibration / approach) / omega) if approach > 0 else float("inf")


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
        assert flight.start is not None
        assert flight.end is not None
        values = momenta.of(members)[window(momenta.time, flight.start, flight.end)]
        return values if len(values) > 1 else None
    return None


def _towards_ground(momentum: Samples) -> float:
    """Share of the kinetic energy at the end that belongs to the motion along gravity [-]."""
    last, change = momentum[-1], momentum[-1] - momentum[0]
    if not change.any():
        return 1.0
    along = float(last @ change) ** 2
    return along / float((change @ change) * (last @ last)) if last.any() else 0.0


def longest_flight(
    history: History, settings: Settings, fits: Fits | None = None, *, otherwise: tuple[float, float] | None = None
) -> tuple[float, float]:
    """Give the longest flight as a window for td within the record [time].

    The energy alone may show no end of the flight to the td in it: then the margin is kept from the one that was found.
    ``otherwise`` is given where nothing shows a flight; without it that is a RangeError.
    """
    flights = flights_of(history, settings, fits)
    if settings.landing is not None and (last := _last_before(settings.landing, flights)):
        flights = (last,)
    if not flights and otherwise:
        return otherwise
    if not flights:
        held = history.surroundings.held(history.parts, float(history.time[-1]))
        found = held or "nothing in the record shows a flight, in which td could be chosen"
        cure = "give `td`, and the end of the load as `after` where it is known"
        cure = "only what nothing holds can be switched" if held else cure
        raise RangeError(f"{', '.join(history.source)}: {found}; {cure}")
    windows = [(bounds(history, flight), flight) for flight in flights]
    (start, end), longest = max(windows, key=lambda one: one[0][1] - one[0][0])
    latest = last_td(end, margin_before_contact(history, longest, settings.margin).time)
    return start, latest if longest.source == "energy" and latest > start else end


def last_td(end: float, margin: float) -> float:
    """Give the last td, as it is read, that keeps a margin from the end of a flight [time]."""
    return not_after(sum_as_read(end, -margin)) if margin else end


def flights_of(history: History, settings: Settings, fits: Fits | None = None) -> tuple[Flight, ...]:
    """Find all flights, that of the landing that is given up to there.

    Where the energy is all there is, one oscillator for the whole record, else none is sought.
    """
    landing = settings.landing
    if landing is None:
        return _flights_of(history, settings, fits)
    history.check(landing, argument="landing")
    found = _flights_of(history, replace(settings, landing=None), fits)
    last = _last_before(landing, found)
    if last and landing <= bounds(history, last)[1]:
        return tuple(landed(one, landing) if one is last else one for one in found)
    before = examine(history, landing, settings, fits).flight
    return tuple(sorted((*found, before))) if before.end == landing and not before.refusal else found


def _last_before(landing: float, flights: Iterable[Flight]) -> Flight | None:
    """Give the last flight that begins before a landing [time]."""
    return max((one for one in flights if (one.start or 0.0) < landing), key=lambda one: one.start or 0.0, default=None)


def _flights_of(history: History, settings: Settings, fits: Fits | None) -> tuple[Flight, ...]:
    if any(True for _ in witnesses(history)) or not settings.replay:
        return find_flights(history, settings, fits)
    first = float(history.time[0]) if settings.after is None else settings.after
    middle = examine(history, (first + float(history.time[-1])) / 2, settings, fits)
    start, end = bounds(history, middle.flight)
    if middle.evidence.span and start < end and not middle.flight.refusal:
        # it ends with the oscillator, also where its start is given
        return (middle.flight,)
    return find_flights(history, replace(settings, replay=False))


def bounds(history: History, flight: Flight) -> tuple[float, float]:
    """Give a flight as a window within the record [time]."""
    first, last = float(history.time[0]), float(history.time[-1])
    return first if flight.start is None else flight.start, last if flight.end is None else flight.end


_PLAIN = Settings()


def find_flights(history: History, settings: Settings = _PLAIN, fits: Fits | None = None) -> tuple[Flight, ...]:
    """Find every flight of a record, ascending in time.

    Parameters
    ----------
    history : History
        With its evidence, as a run gives it.
    settings : Settings, optional
        How an oscillator is looked for where no better evidence shows a flight.
    fits : Fits, optional
        Those of an earlier look at the record; none of its windows is fitted twice.

    Returns
    -------
    tuple of Flight
        ``end`` is None where the record ends in flight.  A flight shorter than a twentieth of the record is not seen.

    Raises
    ------
    RangeError
        If the record has fewer than 3 states.
    """
    seen = all_seen(history)
    if seen:
        return tuple(
            Flight(one.start, one.end if one.end_seen else None, source, one.parts, one.damping, gravity=one.gravity)
            for source, one in seen
        )
    found: list[Flight] = []
    fits = Fits() if fits is None else fits
    for td in sorted(moments(history.time), reverse=True):  # the last quiet time before td tells most of the flight
        if found and found[-1].start is not None and td > found[-1].start:
            continue
        situation = examine(history, td, settings, fits)
        flight = situation.flight
        if situation.in_flight and not flight.refusal and not (found and _overlap(flight, found[-1])):
            found.append(flight)
    return tuple(reversed(found))


def _overlap(earlier: Flight, later: Flight) -> bool:
    """Say whether a flight lasts into a later one: it misses the load before that one, so its end is not known."""
    return earlier.end is None or later.start is None or earlier.end > later.start
