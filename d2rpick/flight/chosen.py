"""Choose the flight at a td from evidence that no force acts, an oscillator, the energy, or times given by the user."""

from __future__ import annotations

from math import inf, isnan, nan
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.tuples import NamedTuple
from d2rpick.flight.flight import (
    BY_ENERGIES,
    MOST_WORK,
    Flight,
    find_all_seen,
    get_agreement_limit,
    name_source,
)
from d2rpick.flight.internal_energy import (
    find_landing_after,
    has_whole_motion,
)
from d2rpick.flight.window import (
    FreeFlight,
    explain_hole,
    limit_to_written_states,
)
from d2rpick.histories.samples import find_hole_around

if TYPE_CHECKING:
    from collections.abc import Callable

    from d2rpick.flight.flight import Seen
    from d2rpick.flight.internal_energy import QuietTime
    from d2rpick.histories.history import History, Samples

# Smallest number of extrema of an energy that vibrates about a level; an energy with fewer must be constant.
_LEAST_TURNS: Final = 4


class Described(NamedTuple):
    """A window in which an oscillator model describes the vibration, given by its first and last state [time].

    ``energy`` returns the kinetic plus elastic energy of the vibration at times (n,) [energy]. ``alpha`` is the damping
    rate [1/time]; it is None if several modes have different damping rates.
    """

    start: float
    end: float
    energy: Callable[[Samples], Samples]
    alpha: float | None = None


def choose_flight(
    history: History,
    td: float,
    seen: Seen,
    described: Described | None,
    quiet: QuietTime | None,
    after: float | None,
    landing: float | None,
) -> Flight:
    """Choose the flight around ``td`` from the evidence and the times given by the user; supported parts never fly.

    Parameters
    ----------
    history : History
    td : float
        [time]
    seen : Seen
        Evidence at td.
    described : Described or None
        Window in which an oscillator or modes describe the energy.
    quiet : QuietTime or None
        Window around td in which the energy shows no load.
    after, landing : float or None
        End of the load and time of the next contact, if the user gives them [time].
    """
    flight = find_flight(history, seen, described, quiet)
    if seen.held:
        return flight
    if after is not None:
        flight = start_flight_at(history, flight, td, after, described)
    if landing is not None:
        flight = end_flight_at(history, flight, td, landing)
    return _limit_by_supports(history, _limit_by_holes(history, flight, td), td)


def _limit_by_holes(history: History, flight: Flight, td: float) -> Flight:
    """Limit a flight to the states that no interval without states separates from td; refuse a td in such an interval.

    A flight that the user gives is not limited.
    """
    hole = find_hole_around(history.holes, td)
    if hole and not flight.refusal:
        return flight._replace(refusal=explain_hole(hole, td))
    if flight.start is None or flight.refusal or flight.source == "given":
        return flight
    first, last = flight.within(history.time)
    shown = FreeFlight(first, last, None, end_seen=flight.end is not None)
    limited = limit_to_written_states(shown, history.holes, td)
    assert limited is not None  # Above, a td in an interval without states was refused.
    return flight._replace(
        start=limited.start, end=limited.end if limited.end_seen else None
    )


def _limit_by_supports(history: History, flight: Flight, td: float) -> Flight:
    """Limit a flight to the time during which no support holds any of the parts.

    A flight that was found from the part momenta is already limited in this way.
    """
    if flight.start is None or flight.refusal or flight.by_parts:
        return flight
    free_start, free_end = history.surroundings.free(history.parts, td) or (-inf, inf)
    start = max(free_start, flight.start)
    end = free_end if flight.end is None else min(free_end, flight.end)
    return flight._replace(start=start, end=None if end == inf else end)


def find_flight(
    history: History,
    seen: Seen,
    described: Described | None,
    quiet: QuietTime | None,
) -> Flight:
    """Choose the flight at a td from the evidence, or else from an oscillator, or else from the energy alone.

    The arguments are those of `choose_flight`.
    """
    if seen.held:
        return Flight(refusal=seen.refusal)
    if seen.flight:
        return _make_seen_flight(history, seen, seen.flight, described)
    if seen.refusal:
        return Flight(refusal=seen.refusal, doubts=seen.doubts)
    if described:
        return _make_described_flight(history, described)
    if quiet:
        return _make_quiet_flight(history, quiet)
    return Flight()


def _make_seen_flight(
    history: History, seen: Seen, shown: FreeFlight, described: Described | None
) -> Flight:
    """Return the flight that the evidence shows.

    If the energies do not show gravity, an oscillator is used to find the flight.
    """
    gravity = shown.gravity
    if described and seen.source in BY_ENERGIES and isnan(gravity):
        window = described._replace(start=shown.start, end=shown.end)
        gravity = _detect_load_in_window(history, window)
    return Flight(
        shown.start,
        shown.end if shown.end_seen else None,
        seen.source,
        shown.parts,
        shown.damping,
        seen.refusal,
        seen.doubts,
        gravity=gravity,
        described=described is not None,
    )


def _make_described_flight(history: History, described: Described) -> Flight:
    """Return as a flight the window in which an oscillator or modes fit, unless a load does work in this window."""
    refusal = _explain_why_fed(history, described.start, described.end)
    if refusal:
        return Flight(refusal=refusal)
    return Flight(
        described.start,
        _find_end_of_window(history, described),
        "oscillator",
        gravity=_detect_load_in_window(history, described),
        described=True,
    )


def _make_quiet_flight(history: History, quiet: QuietTime) -> Flight:
    """Return the quiet time of the energy as a flight, unless a load does work in it."""
    refusal = _explain_why_fed(history, quiet.start, quiet.td)
    if refusal:
        return Flight(refusal=refusal)
    end = quiet.end if quiet.end is not None and quiet.end < history.end else None
    has_energies = (
        history.balance is not None and history.balance.kinetic_and_internal is not None
    )
    return Flight(
        quiet.start,
        end,
        "energy",
        settled=quiet.settled,
        gravity=nan if has_energies else 0.0,
    )


def start_flight_at(
    history: History,
    flight: Flight,
    td: float,
    after: float,
    described: Described | None,
) -> Flight:
    """Start the flight around ``td`` at ``after``, the end of the load as given by the user [time].

    Evidence that contradicts ``after`` becomes a doubt. A contact that the evidence shows between ``after`` and td
    still limits the flight, because the user did not give any time for it.
    """
    if (
        flight.start is None
        or flight.source == "energy"
        or _is_elsewhere(flight, td, after)
    ):
        if described is None:
            end = find_landing_after(history, after)
        else:
            end = _find_end_of_window(history, described)
        return Flight(
            after,
            end,
            "given",
            doubts=_add_refusal_to_doubts(flight),
            described=described is not None,
        )
    if flight.end is not None and after >= flight.end:
        ended = f"the flight ends at {flight.end:.6g} according to the {name_source(flight.source)}, before `after`"
        return Flight(refusal=flight.refusal or ended, doubts=flight.doubts)
    doubts = flight.doubts
    # An oscillator was fitted from `after` on, so its start is not the end of the load.
    shows_start = flight.source != "oscillator"
    room = get_agreement_limit(history, *flight.within(history.time))
    if shows_start and after < flight.start - room:
        evidence = f"the {name_source(flight.source)} shows that the flight begins at {flight.start:.6g}"
        doubts = (
            *doubts,
            f"{evidence}, after `after` {after:.6g}, which is used nevertheless",
        )
    return flight._replace(start=after, source="given", doubts=doubts)


def end_flight_at(
    history: History, flight: Flight, td: float, landing: float
) -> Flight:
    """End the flight around ``td`` at ``landing``, the next contact as given by the user [time].

    Evidence that contradicts ``landing`` becomes a doubt.
    """
    if flight.start is None or landing <= flight.start:
        return flight
    if flight.refusal and flight.end is not None and flight.end <= td <= landing:
        return flight._replace(
            end=landing,
            refusal=None,
            source="given",
            doubts=_add_refusal_to_doubts(flight),
            shows_contact=shows_contact_at(history, flight, landing),
        )
    doubts = flight.doubts
    shows_contact = shows_contact_at(history, flight, landing)
    room = get_agreement_limit(history, *flight.within(history.time))
    if (
        flight.end is not None
        and flight.end < landing - room
        and flight.source not in ("energy", "given")
    ):
        evidence = f"the {name_source(flight.source)} shows that the flight ends at {flight.end:.6g}"
        doubts = (
            *doubts,
            f"{evidence}, before `landing` {landing:.6g}, which is used nevertheless",
        )
        flight = flight._replace(source="given")
    return flight._replace(end=landing, doubts=doubts, shows_contact=shows_contact)


def shows_contact_at(history: History, flight: Flight, landing: float) -> bool:
    """Return False if the record shows that the parts fly on after a ``landing`` given by the user [time].

    The flights that the evidence shows decide or, if it shows none, the ``flight`` itself before it is ended. Its end
    may differ from the landing as much as the ends of a flight in two sources.
    """
    seen = [
        (window.start, window.end if window.end_seen else inf)
        for _, window in find_all_seen(history)
    ]
    if not seen and flight.start is not None and not flight.refusal:
        seen = [(flight.start, inf if flight.end is None else flight.end)]
    room = get_agreement_limit(history, *flight.within(history.time))
    return not any(start < landing < end - room for start, end in seen)


def _is_elsewhere(flight: Flight, td: float, after: float) -> bool:
    """Return True if td is not in a flight, and the nearest flight ends before ``after`` or begins after td."""
    if not flight.refusal or flight.start is None:
        return False
    return flight.start > td or (flight.end is not None and flight.end <= after)


def _add_refusal_to_doubts(flight: Flight) -> tuple[str, ...]:
    """Return the doubts about a flight given by the user, with the reason why the evidence shows no flight."""
    if not flight.refusal:
        return flight.doubts
    return (
        *flight.doubts,
        f"the flight is used as given, although {flight.refusal}",
    )


def _find_end_of_window(history: History, described: Described) -> float | None:
    """Return the end of the window that an oscillator describes [time]; None if it lasts to the end of the record."""
    return described.end if described.end < history.end else None


def _detect_load_in_window(history: History, described: Described) -> float:
    """Return NaN if damping of the vibration cannot explain the energy change in a window; otherwise return 0."""
    from d2rpick.flight.work import is_taken_by_damping

    if history.balance is None:
        taken = None
    else:
        taken = is_taken_by_damping(history.balance, *described)
    return nan if taken is False else 0.0


def _explain_why_fed(history: History, start: float, end: float) -> str | None:
    """Return the reason why, according to the energies, a window cannot be a flight; None if it can be one.

    Either kinetic plus internal energy changes, or there is no motion besides the vibration.
    """
    balance = history.balance
    energy = history.mean_energy(start, end)
    if balance is None or energy is None or balance.kinetic_and_internal is None:
        return None
    is_inside = (history.turns > start) & (history.turns < end)
    turns = int(np.count_nonzero(is_inside))
    _, internal = history.between(start, end)
    if turns < _LEAST_TURNS and float(np.ptp(internal)) > MOST_WORK * energy:
        return f"from {start:.6g} to {end:.6g} the internal energy has {turns} extrema: too few to recognise a flight"
    from d2rpick.flight.work import compute_change_of_balance

    change = compute_change_of_balance(balance, start, end)
    if change is not None and change > MOST_WORK * max(energy, 0.0):
        change_text = f"kinetic and internal energy together change by {change:.3g} from {start:.6g} to {end:.6g}"
        return f"{change_text}, at a mean internal energy of {energy:.3g}: a load does work there"
    if not has_whole_motion(balance, start, end):
        return (
            f"from {start:.6g} to {end:.6g} there is no more kinetic energy than that of "
            "the vibration: it does not fly"
        )
    return None
