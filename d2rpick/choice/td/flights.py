"""Find the flights of a record, each of which may contain td."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from d2rpick.base.errors import COPY_AGAIN, RangeError
from d2rpick.choice.parts.margins import find_margin
from d2rpick.flight.chosen import shows_contact_at
from d2rpick.flight.flight import (
    NEVER_FLIES,
    Flight,
    denies_every_flight,
    describe_hiding_digits,
    find_all_seen,
    list_witnesses,
)
from d2rpick.flight.window import list_moments
from d2rpick.histories.digits import (
    format_distinctly,
    round_down_as_read,
    sum_times_as_read,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from d2rpick.choice.question import Settings
    from d2rpick.histories.history import History, Momenta, Samples
    from d2rpick.histories.names import Part

# Times at which the search for a vibration without contact starts, as fractions of the record [-].
_WHERE_IT_VIBRATES: Final = (0.5, 0.75, 0.875)
# Shortest useful rigid window, as a fraction of the record [-]; a shorter window saves less than a restart costs.
MIN_RIGID: Final = 0.05
_NO_FLIGHT: Final = "no flight is found in the record, so no td can be chosen"


def find_longest_flight(
    history: History,
    settings: Settings,
    *,
    around: float | None = None,
    otherwise: tuple[float, float] | None = None,
) -> tuple[float, float]:
    """Return the longest flight of the record, or the flight that contains ``around``, as a range for td [time].

    If only the energy shows the flight, its end may depend on td; the range then excludes the margin. If there is no
    flight, ``otherwise`` is returned.

    Raises
    ------
    RangeError
        If ``otherwise`` is not given, and there is no flight or the given landing lies before all flights.
    """
    flights = find_flights(history, settings)
    if not otherwise:
        refuse_landing_before_flights(history, flights, settings)
    if settings.landing is not None:
        last = _find_last_before(settings.landing, flights)
        if last:
            flights = (last,)
    if not flights and otherwise:
        return otherwise
    if not flights:
        held = history.surroundings.held(history.parts, history.end)
        never_falls = bool((history.energy[1:] >= history.energy[:-1]).all())
        reason = _NO_FLIGHT + (": the energy never falls" if never_falls else "")
        if held:
            reason = held
            cure = "name parts that nothing holds"
        elif not history.energy.any():
            reason = f"{_NO_FLIGHT}: the energy is 0 in all states"
            cure = "choose the internal energy with `energy`"
        elif settings.after is not None:
            cure = "give `td`"
        elif not history.complete:
            reason = (
                f"{reason}: the record ends early, at {history.end:.6g}, within a state"
            )
            cure = COPY_AGAIN
        elif denies_every_flight(history):
            reason = f"{reason}: {NEVER_FLIES}"
            hint = describe_hiding_digits(history)
            cure = "run it without switching, or write the momenta of the parts and choose those that fly"
            cure = f"{hint}; otherwise, {cure}" if hint else cure
        else:
            cure = "if you know the end of the load, give it as `after`"
        raise RangeError(f"{', '.join(history.source)}: {reason}; {cure}")
    windows = [(flight.within(history.time), flight) for flight in flights]
    containing = [
        (window, flight)
        for window, flight in windows
        if around is not None and window[0] < around <= window[1]
    ]
    (start, end), longest = max(
        containing or windows,
        key=lambda window_and_flight: window_and_flight[0][1] - window_and_flight[0][0],
    )
    latest = compute_last_td(end, find_margin(history, longest, settings).time)
    return start, latest if longest.source == "energy" and latest > start else end


def check_chosen_flight(
    history: History, window: tuple[float, float], around: float | None = None
) -> None:
    """Raise RangeError if the ``window`` that `find_longest_flight` returned lies outside the record of the energy."""
    if around is not None and window[0] < around <= window[1]:
        subject = "the flight that contains `td`,"
    else:
        subject = "the longest flight,"
    history.check(*window, subject=subject)


def has_other_flights(history: History, settings: Settings, td: float) -> bool:
    """Return True if a flight that does not contain ``td`` [time] is long enough for a useful rigid window."""
    for flight in find_flights(history, settings):
        start, end = flight.within(history.time)
        if start <= td <= end:
            continue
        latest = compute_last_td(end, find_margin(history, flight, settings).time)
        if latest - start >= MIN_RIGID * history.duration:
            return True
    return False


def compute_last_td(end: float, margin: float) -> float:
    """Return the last td that, when rounded for print, is at least ``margin`` before the end of a flight [time]."""
    return round_down_as_read(sum_times_as_read(end, -margin)) if margin else end


def find_flights(history: History, settings: Settings) -> tuple[Flight, ...]:
    """Find all flights of a record in time order; a flight ends at the given landing if there is one.

    Parameters
    ----------
    history : History
        History with the evidence of its run.
    settings : Settings
        Options for the search for an oscillator if no better evidence shows a flight.

    Returns
    -------
    tuple of Flight
        ``end`` is None if the record ends in flight.  Flights shorter than 1/20 of the record are not found.

    Raises
    ------
    RangeError
        If the record has fewer than 3 states, or the margin is longer than the record.
    """
    if settings.margin is not None:
        history.check_length(settings.margin, argument="margin")
    landing = settings.landing
    if landing is None:
        return _add_given_start(
            history,
            settings,
            _find_flights_without_landing(history, settings),
        )
    history.check(landing, argument="landing")
    flights = _find_flights_without_landing(history, replace(settings, landing=None))
    last = _find_last_before(landing, flights)
    if last and landing <= last.within(history.time)[1]:
        shows_contact = shows_contact_at(history, last, landing)
        ended = last._replace(end=landing, shows_contact=shows_contact)
        flights = tuple(ended if flight is last else flight for flight in flights)
        return _add_given_start(history, settings, flights)
    from d2rpick.choice.pair.situation import examine_td

    landing_flight = examine_td(history, landing, settings).flight
    if landing_flight.end == landing and not landing_flight.refusal:
        return _insert_flight(history, flights, landing_flight)
    return flights


def _add_given_start(
    history: History, settings: Settings, flights: tuple[Flight, ...]
) -> tuple[Flight, ...]:
    """Add a flight that starts at the end of the load given by the user, unless a flight already contains that time."""
    load_end = settings.after
    last = history.end
    windows = [flight.within(history.time) for flight in flights]
    if load_end is None or any(start <= load_end < end for start, end in windows):
        return flights
    from d2rpick.choice.pair.situation import examine_td

    end = min((start for start, _ in windows if start > load_end), default=last)
    end = end if settings.landing is None else min(end, settings.landing)
    given_flight = examine_td(history, (load_end + end) / 2, settings).flight
    if (
        given_flight.source != "given"
        or given_flight.refusal
        or given_flight.start != load_end
    ):
        return flights
    if given_flight.end is None and end != last:
        given_flight = given_flight._replace(end=end)
    return _insert_flight(history, flights, given_flight)


def _insert_flight(
    history: History, flights: tuple[Flight, ...], given_flight: Flight
) -> tuple[Flight, ...]:
    """Return flights in ascending order; the given flight replaces the flights that it overlaps."""
    first, last = given_flight.within(history.time)
    windows = ((flight, *flight.within(history.time)) for flight in flights)
    kept_flights = [
        flight for flight, start, end in windows if end <= first or start >= last
    ]
    return tuple(
        sorted(
            (*kept_flights, given_flight),
            key=lambda flight: flight.within(history.time),
        )
    )


def refuse_landing_before_flights(
    history: History, flights: Sequence[Flight], settings: Settings
) -> None:
    """Raise RangeError if the given landing lies before all ``flights``, so that it ends none of them."""
    landing = settings.landing
    if landing is None or not flights or _find_last_before(landing, flights):
        return
    start, end = flights[0].within(history.time)
    value, first, last = format_distinctly((landing, start, end))
    raise RangeError(
        f"{', '.join(history.source)}: `landing` {value} lies in no flight, the first of which lasts from {first} to "
        f"{last}; give the time of the contact that ends a flight"
    )


def _find_last_before(landing: float, flights: Iterable[Flight]) -> Flight | None:
    """Return the last flight that starts before a landing [time]; None if there is no such flight."""
    return max(
        (flight for flight in flights if (flight.start or 0.0) < landing),
        key=lambda flight: flight.start or 0.0,
        default=None,
    )


def _find_flights_without_landing(
    history: History, settings: Settings
) -> tuple[Flight, ...]:
    """Find the flights from forces, momenta and energies or, failing that, from an oscillator, modes or quiet times."""
    witnessed = find_all_seen(history)
    if witnessed:
        return tuple(
            Flight(
                window.start,
                window.end if window.end_seen else None,
                source,
                window.parts,
                window.damping,
                gravity=window.gravity,
            )
            for source, window in witnessed
        )
    # Imported here to keep start-up fast.
    from d2rpick.choice.pair.situation import (
        make_look,
    )

    look = make_look(history, settings)
    if settings.replay and not list_witnesses(history):
        first = history.start if settings.after is None else settings.after
        for share in _WHERE_IT_VIBRATES:
            flight = look(first + share * (history.end - first)).flight
            start, end = flight.within(history.time)
            if flight.described and start < end and not flight.refusal:
                # The flight ends with the vibration of the oscillator, even if the user gives the start of the flight.
                return (flight,)
        look = make_look(history, replace(settings, replay=False))
    flights: list[Flight] = []
    # The quiet time around the latest td is used, because it covers most of the flight.
    for td in sorted(list_moments(history.time), reverse=True):
        if flights and flights[-1].start is not None and td > flights[-1].start:
            continue
        situation = look(td)
        flight = situation.flight
        # If a flight reaches the next flight, the load between them was missed, so the end of the flight is unknown.
        lasts = (
            flights
            and flight.within(history.time)[1] > flights[-1].within(history.time)[0]
        )
        if situation.in_flight and not flight.refusal and not lasts:
            flights.append(flight)
    return tuple(reversed(flights))


def list_momentum_columns(history: History) -> dict[str, Samples]:
    """Return the momentum columns that show the flight and the mass column, keyed by name.

    The columns belong to the parts that fly longest, or to the chosen parts. If only the velocity of the model is
    known, they are columns of the velocity. The result is empty if neither is written at the times of the energy.
    """
    import numpy as np

    # Imported here to keep start-up fast.
    from d2rpick.flight.momentum import find_all_flights, find_flight_around

    momenta = _find_momenta_of_flights(history)
    if momenta is None:
        return {}
    flights = find_all_flights(momenta, history.balance)
    members = momenta.chosen
    if flights and momenta.parts:
        longest = max(flights, key=lambda flight: flight.end - flight.start)
        # Just after a contact, a loose part may hardly disturb the sum of the others, and seem not to belong to it.
        middle = (longest.start + longest.end) / 2
        flight = find_flight_around(momenta, middle, history.balance) or longest
        members = tuple(
            momenta.parts.index(part) for part in flight.parts or momenta.parts
        )
    mass = momenta.mass(members)
    name = "velocity" if momenta.velocity else "momentum"
    columns = {
        f"{axis}_{name}": column
        for axis, column in zip("xyz", momenta.of(members).T.copy(), strict=True)
    }
    return columns | ({"mass": np.full(history.time.shape, mass)} if mass > 0 else {})


def list_flying_parts_not_chosen(history: History) -> tuple[Part, ...]:
    """Return the parts that fly with the chosen parts in a flight, but were not chosen; empty if none are known."""
    # Imported here to keep start-up fast.
    from d2rpick.flight.momentum import find_all_flights

    momenta = _find_momenta_of_flights(history)
    if momenta is None or not (momenta.parts and history.parts):
        return ()
    flights = find_all_flights(momenta, history.balance)
    flying = {part.id for flight in flights for part in flight.parts or momenta.parts}
    flying -= {part.id for part in history.parts}
    return tuple(part for part in momenta.parts if part.id in flying)


def _find_momenta_of_flights(history: History) -> Momenta | None:
    """Return the momenta that show flights, or else the first momenta; None if none have the times of the energy."""
    import numpy as np

    # Imported here to keep start-up fast.
    from d2rpick.flight.momentum import (
        find_all_flights,
        select_momenta_for_flight,
    )

    momenta_at_states = [
        momenta
        for momenta in select_momenta_for_flight(history.momenta)
        if np.array_equal(momenta.time, history.time)
    ]
    if not momenta_at_states:
        return None
    return next(
        (
            momenta
            for momenta in momenta_at_states
            if find_all_flights(momenta, history.balance)
        ),
        momenta_at_states[0],
    )
