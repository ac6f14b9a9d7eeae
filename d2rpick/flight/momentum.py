"""Find which parts fly together, and when, from their momenta.

A single part does not move freely while an attached part vibrates against it, so the search also determines which set
of parts flies.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.memory import remember
from d2rpick.flight.free_fall import Laws
from d2rpick.flight.window import (
    FEWEST,
    LAST_DIGIT,
    TOLERANCE,
    VISIBLE,
    FreeFlight,
    find_all_windows,
    find_lasting_window,
    limit_to_unheld,
    list_moments,
)
from d2rpick.histories.history import Precision, find_digits
from d2rpick.histories.samples import find_stretches, find_window, remove_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Balance, Momenta, Samples
    from d2rpick.histories.names import Part, Selection
    from d2rpick.histories.run import OpenedRun


# A larger set of parts is preferred if its window has at least this length, relative to that of a smaller set [-].
# A part with a large momentum, such as a sled, increases the tolerance and the window lengths of all parts.
_LONGER = 1.1
# _LOOK_BACK: attached parts are determined from this fraction of the record, just before td [-].
# _LOOK_STATES: attached parts are determined from at most this number of states.
# _CANCELS: the summed momenta of a body deviate from a straight line by at most this fraction [-].
_LOOK_BACK, _LOOK_STATES, _CANCELS = 0.1, 200, 1e-3
# Largest relative decrease of the summed deviation that is treated as rounding error [-].
# This limit prevents the search from endlessly adding and removing a part of almost no mass.
_ROUNDED: Final = 1e-9
# Parts at rest or held by a support end with at most this fraction of their largest momentum [-].
_HELD = 0.01
# No part is missing if the part momenta add up to the momentum of the model within this relative error [-].
_ALL_OF_IT: Final = 1e-2
# _BY_ITSELF: shortest separate flight of a body that is considered, as a fraction of the record [-].
# _OF_ITS_OWN: a body flies separately if its velocity differs from that of the other parts by this fraction [-].
_BY_ITSELF, _OF_ITS_OWN = 0.25, 0.05

FLYING: Final = "flying"
ALL: Final = "all"


def select_momenta_for_flight(momenta: Sequence[Momenta]) -> Sequence[Momenta]:
    """Return the momenta that may show a flight, best first; if the user names the flying parts, only their momenta."""
    return [candidate for candidate in momenta if candidate.flying] or momenta


def find_flight_around(
    momenta: Momenta, td: float, balance: Balance | None = None
) -> FreeFlight | None:
    """Find the set of parts whose free flight around ``td`` is by far the longest, and the window of that flight.

    Unless the set is given, three sets are tried: the chosen parts, the chosen parts with the parts attached to them,
    and all parts.

    Parameters
    ----------
    momenta : Momenta
    td : float
        [time]
    balance : Balance, optional
        Energies of the model, which show whether gravity acts on the model if its mass is unknown.

    Returns
    -------
    FreeFlight or None
        None if no set flies around td.
    """
    best: FreeFlight | None = None
    if momenta.at_rest:
        return None
    sets: Iterable[Sequence[int]]
    if momenta.flying:
        sets = [momenta.flying]
    else:
        sets = _list_sets_to_try(momenta, td)
    for members in sets:
        flight = find_flight_of(momenta, members, td, balance)
        if flight is None:
            continue
        if best is None or flight.duration > _LONGER * best.duration:
            best = _limit_to_flights_of_bodies(momenta, members, td, flight) or best
    return best


def _limit_to_flights_of_bodies(
    momenta: Momenta, members: Sequence[int], td: float, flight: FreeFlight
) -> FreeFlight | None:
    """Return the part of a flight in which each body flies. Bodies that collide keep only their total momentum."""
    for part in find_bodies_apart(momenta, members):
        alone = find_flight_of(momenta, (part,), td)
        if alone is None:
            return None
        start = max(flight.start, alone.start)
        end_seen = flight.end_seen or alone.end < flight.end
        flight = flight._replace(
            start=start, end=min(flight.end, alone.end), end_seen=end_seen
        )
    return flight if flight.start < flight.end else None


def find_bodies_apart(momenta: Momenta, members: Sequence[int]) -> tuple[int, ...]:
    """Return the parts among ``members`` that fly separately at some time, with a different velocity from the set."""
    return _collect_bodies_apart(momenta, *members)


@remember
def _collect_bodies_apart(momenta: Momenta, *members: int) -> tuple[int, ...]:
    """Return the parts among ``members`` that fly separately, as one list."""
    return tuple(_search_bodies_apart(momenta, members))


def _search_bodies_apart(momenta: Momenta, members: Sequence[int]) -> Iterator[int]:
    """Find the parts among ``members`` that fly separately as defined in `find_bodies_apart`."""
    time = momenta.time
    mass = momenta.mass(members)
    masses = momenta.masses
    if not momenta.parts or len(members) < 2 or time.size < FEWEST:
        return
    if masses is None or not mass > 0:
        return
    velocity = momenta.of(members) / mass
    room = _OF_ITS_OWN * float(np.abs(velocity).max())
    least_time = _BY_ITSELF * float(time[-1] - time[0])
    durations = np.gradient(time)
    for part in members:
        if not masses[part] > 0:
            continue
        velocity_of_part = momenta.values[:, part] / masses[part]
        relative_speed = np.linalg.norm(velocity_of_part - velocity, axis=1)
        if float(durations[relative_speed > room].sum()) <= least_time:
            continue  # A separate flight of this part would be too short to matter.
        time_apart = 0.0
        for flight in _find_flights_of_part(momenta, part):
            inside = find_window(time, flight.start, flight.end)
            if float(relative_speed[inside].min()) > room:
                time_apart += flight.duration
        if time_apart > least_time:
            yield part


@remember
def _find_flights_of_part(momenta: Momenta, part: int) -> tuple[FreeFlight, ...]:
    """Return the flights of a single part."""
    return find_all_windows(momenta.time, partial(find_flight_of, momenta, (part,)))


def find_flight_of(
    momenta: Momenta, members: Sequence[int], td: float, balance: Balance | None = None
) -> FreeFlight | None:
    """Find the window around ``td`` in which the given parts fly freely together; None if there is none."""
    time = momenta.time
    momentum = momenta.of(members)
    if time.size < FEWEST or not time[0] <= td <= time[-1]:
        return None
    extent = float(np.ptp(momentum, axis=0).max())
    largest = float(np.abs(momentum).max())
    noise = momenta.noise(members)
    parts = None if momenta.parts is None else tuple(momenta.parts[i] for i in members)
    gravities = momenta.surroundings.gravity_on(parts)
    if extent <= max(2 * noise, LAST_DIGIT * largest):
        # The momentum is constant, so no force acts on the parts at any time, or they are at rest.
        may_be_weightless = gravities is None or 0.0 in gravities
        if largest <= noise or not may_be_weightless:
            return None
        if not _has_clear_motion(momenta, members, noise):
            return None
        whole = FreeFlight.of(time, (0, time.size - 1), parts)
        return limit_to_unheld(momenta.surroundings, whole, parts, td)
    if noise > TOLERANCE * extent:
        return None
    laws = get_laws_of(momenta, tuple(members), balance)
    states, gravity = laws.window(td)
    if states is None:
        return None
    if not gravity and gravities is None and _has_falling_part(momenta):
        return None  # A part that does not fall while others do is supported.
    first, last = states
    inside = momentum[first : last + 1]
    second_half = inside[inside.shape[0] // 2 :]
    if float(np.abs(second_half).max()) <= _HELD * largest + noise:
        steady = VISIBLE * max(noise, float(np.ptp(inside, axis=0).max()))
        if gravity or float(np.abs(inside.mean(axis=0)).max()) <= steady:
            return None  # The parts are either held by supports or at rest.
    damping = laws.fit.damping(first, last) if gravity is not None else 0.0
    flight = FreeFlight.of(time, states, parts, damping=damping, gravity=gravity or 0.0)
    return limit_to_unheld(momenta.surroundings, flight, parts, td)


def get_laws_of(
    momenta: Momenta, members: tuple[int, ...], balance: Balance | None = None
) -> Laws:
    """Return the laws of free flight for a set of parts; the result is cached for all td."""
    if momenta.parts is None or np.isnan(momenta.mass(members)):
        whole = balance
    else:
        whole = None
    return _make_laws(momenta, members, whole is None, whole=whole)


@remember
def _make_laws(
    momenta: Momenta, members: tuple[int, ...], _: bool, *, whole: Balance | None
) -> Laws:
    """Return the laws of free flight for a set of parts; the energies of the ``whole`` model are used if given."""
    return Laws(momenta, members, whole)


@remember
def _has_falling_part(momenta: Momenta) -> bool:
    """Return True if the momentum of a single part shows that the part falls under gravity."""
    if momenta.parts is None:
        return False
    return any(get_laws_of(momenta, (i,)).fall for i in momenta.moving)


def find_all_flights(
    momenta: Momenta, balance: Balance | None = None
) -> tuple[FreeFlight, ...]:
    """Find all free flights of the chosen parts and of the parts that fly with them, in ascending order."""
    return find_all_windows(
        momenta.time, partial(find_flight_around, momenta, balance=balance)
    )


def can_deny_flight(momenta: Momenta) -> bool:
    """Return True if the chosen parts or the model move enough for their momentum to rule out a flight."""
    change = momenta.change(momenta.chosen)
    noise = momenta.noise(momenta.chosen)
    return momenta.time.size >= FEWEST and change > VISIBLE * noise


def find_hiding_digits(
    momenta: Momenta, td: float | None, balance: Balance | None = None
) -> int | None:
    """Return the number of significant digits of the momenta if they may hide the flight around ``td``; otherwise None.

    The digits may hide a flight if they are too coarse to show any, or if a flight is found as soon as their rounding
    error is allowed for. A column may have fewer digits than the rest of its file. Without td, any flight counts.
    """
    digits = find_digits(momenta.values, momenta.precision.digits)
    rounded = replace(momenta, precision=Precision(digits))
    members = momenta.chosen
    extent = float(np.ptp(momenta.of(members), axis=0).max())
    if rounded.noise(members) > TOLERANCE * extent:
        return digits
    if digits == momenta.precision.digits:
        return None
    if td is None:
        is_hidden = bool(find_all_flights(rounded, balance))
    else:
        is_hidden = find_flight_around(rounded, td, balance) is not None
    return digits if is_hidden else None


def _has_clear_motion(momenta: Momenta, members: Sequence[int], noise: float) -> bool:
    """Return True if a constant momentum with error ``noise`` shows that the chosen parts move rather than rest.

    The momenta of heavy parts are large numbers with coarse last digits, which may hide a load on the chosen parts. If
    the chosen parts have no mass, as springs do, the members of the set are tested instead.
    """
    parts = momenta.chosen if momenta.values[:, list(momenta.chosen)].any() else members
    change = momenta.change(parts)
    if change > 2 * momenta.noise(parts):
        size = change
    else:
        size = float(np.abs(momenta.values[:, list(parts)]).max())
    return size > VISIBLE * noise


def _list_sets_to_try(momenta: Momenta, td: float) -> Iterator[tuple[int, ...]]:
    """Yield the sets of parts to try: the chosen parts, the chosen and attached parts, and all moving parts.

    If all parts are chosen, i.e. the user chose none, supported parts are left out.
    """
    chosen = tuple(momenta.chosen)
    yield chosen
    if len(chosen) == momenta.values.shape[1]:
        apart = find_bodies_apart(momenta, chosen)
        if apart:
            yield apart
    attached = tuple(sorted({*chosen, *_find_attached_parts(momenta, chosen, td)}))
    if attached != chosen:
        yield attached
    if set(momenta.moving) - set(attached):
        yield tuple(sorted({*momenta.moving, *attached}))


def _find_attached_parts(
    momenta: Momenta, chosen: Sequence[int], td: float
) -> tuple[int, ...]:
    """Return the attached parts, whose deviations of momentum from straight lines cancel out before td.

    Internal forces of a flying body cancel out, so the sum of its part momenta is a straight line over time. Such sums
    form the null space of the deviations of the part momenta from straight lines, and its projector groups the parts of
    a body.
    """
    time = momenta.time
    start = td - _LOOK_BACK * (time[-1] - time[0])
    states = np.flatnonzero((time >= start) & (time <= td))
    states = states[:: max(1, states.size // _LOOK_STATES)]
    if states.size < FEWEST:
        return ()
    part_count = momenta.values.shape[1]
    columns = momenta.values[states].reshape(states.size, -1)
    deviations = remove_line(time[states], columns).reshape(states.size, part_count, 3)
    # One row for each part, with the values of all states and directions.
    rests = deviations.transpose(1, 0, 2).reshape(part_count, -1)
    sizes = np.linalg.norm(rests, axis=1)
    moving = [i for i in momenta.moving if sizes[i] > 0]
    if not set(chosen) & set(moving):
        return ()
    moving_sizes = sizes[moving]
    # The full set of left singular vectors is only needed if there are more parts than columns.
    is_wider = len(moving) > rests.shape[1]
    left_vectors, values, _ = np.linalg.svd(
        rests[moving] / moving_sizes[:, np.newaxis], full_matrices=is_wider
    )
    values = np.append(values, np.zeros(len(moving) - values.size))
    null_space = left_vectors[:, values <= _CANCELS * values[0]]
    projector = (null_space @ null_space.T) / np.outer(moving_sizes, moving_sizes)
    chosen_rows = [moving.index(i) for i in chosen if i in moving]
    # Entries of the projection matrix are equal for parts of one body, and zero for parts of different bodies.
    own_entries = np.diag(projector)[chosen_rows, np.newaxis]
    is_joined = (projector[chosen_rows] > own_entries / 2).any(axis=0)
    joined = np.array(moving)[is_joined].tolist()
    return _refine_attached_parts(rests, {*chosen, *joined}, chosen, moving)


def _refine_attached_parts(
    rests: Samples, members: set[int], chosen: Sequence[int], moving: Sequence[int]
) -> tuple[int, ...]:
    """Add or remove single parts as long as this reduces the summed deviation (parts, k)."""
    total = rests[sorted(members)].sum(axis=0)
    free = [i for i in moving if i not in chosen]
    while free:
        # A part of the set is removed from the sum; any other part is added to it.
        signs = np.array([-1.0 if i in members else 1.0 for i in free])
        changes = signs[:, np.newaxis] * rests[free]
        sizes = np.linalg.norm(total + changes, axis=1)
        best = int(np.argmin(sizes))
        if sizes[best] >= (1 - _ROUNDED) * np.linalg.norm(total):
            break
        total = total + changes[best]
        members = members ^ {free[best]}
    return tuple(sorted(members - set(chosen)))


def replace_words_by_part_ids(run: OpenedRun, selection: Selection) -> Selection:
    """Replace the words ``flying`` and ``all`` in a selection of parts by part ids.

    A part with such a title takes precedence over the word.

    Raises
    ------
    FormatError
        If the run has no parts with energies, or does not show which parts fly together.

    Examples
    --------
    >>> from d2rpick.histories.opening import Selection, open_run
    >>> run = open_run(["sample_data/rolloverT01.gz"], Selection())
    >>> replace_words_by_part_ids(run, Selection(parts=("flying",))).parts
    ('1', '2')
    """
    titles = {part.title.strip().casefold() for part in run.parts}
    meanings = {FLYING: find_flying_parts, ALL: list_deformable_parts}
    numbers: list[str] = []
    for text in selection.parts:
        word = text.strip().casefold()
        meant = meanings.get(word) if word not in titles else None
        numbers += [str(part.id) for part in meant(run)] if meant else [text]
    return selection._replace(parts=tuple(dict.fromkeys(numbers)))


def list_deformable_parts(run: OpenedRun) -> tuple[Part, ...]:
    """Return the parts that have internal energy at any time; raise FormatError if there are none."""
    parts = run.parts
    # This call raises an error if no energies are written.
    energies = run.part_energies(parts)
    with_energy = tuple(
        part for part, energy in zip(parts, energies.T, strict=True) if energy.any()
    )
    if not with_energy:
        raise FormatError(
            f"{run.name}: no part ever has internal energy; name the switched parts with `parts`"
        )
    return with_energy


def find_flying_parts(run: OpenedRun) -> tuple[Part, ...]:
    """Return the deformable parts that fly as one body; raise FormatError if the momenta do not show them.

    Of all sets that fly, the set with the largest product of mass and flight time is used, because a loose tyre may fly
    longer than the car that is to be switched. The sets of parts that the deck connects are tried first. If there is no
    deck, or if none of these sets flies, the sets are those of `find_parts_flying_together`.
    """
    deformable, momenta = _get_parts_and_momenta(run)
    flights: list[FreeFlight] = []
    if momenta:
        bodies = run.surroundings.bodies()
        flights = list(_list_flights_of_bodies(momenta, bodies))
    if not flights:
        return find_parts_flying_together(run)
    return _select_heaviest_parts(run, deformable, momenta, flights)


def find_parts_flying_together(run: OpenedRun) -> tuple[Part, ...]:
    """Return the deformable parts that fly together in one or more bodies; raise FormatError if there are none.

    First each part that is not yet in a set is tried with the parts attached to it. Then all parts are tried together,
    and finally the sets of `_list_cores`.
    """
    deformable, momenta = _get_parts_and_momenta(run)
    flights: list[FreeFlight] = []
    if momenta:
        for part, position in zip(deformable, momenta.chosen, strict=True):
            if not any(part in (flight.parts or ()) for flight in flights):
                flights += find_all_flights(momenta.choosing((position,)))
        flights += find_all_flights(momenta)
        for core in _list_cores(momenta):
            flights += find_all_flights(momenta.choosing(core, core))
    return _select_heaviest_parts(run, deformable, momenta, flights)


def _list_cores(momenta: Momenta) -> Iterator[tuple[int, ...]]:
    """For each of several times, yield the parts attached to the heaviest part, except those that slide at this time.

    A part that moves at constant velocity, such as a loose sliding wheel, does not disturb any sum, so it would
    otherwise be treated as a part of the body.
    """
    masses = momenta.masses
    heavy_members = [i for i in momenta.chosen if masses is not None and masses[i] > 0]
    if masses is None or not heavy_members:
        return
    heaviest = max(heavy_members, key=lambda i: float(masses[i]))
    sets: set[tuple[int, ...]] = set()
    for td in list_moments(momenta.time):
        attached = _find_attached_parts(momenta, (heaviest,), td)
        staying = [i for i in attached if not _is_sliding(momenta, i, td)]
        # The set without sliding parts differs from the attached parts only if at least one of them slides.
        if len(staying) == len(attached):
            continue
        core = tuple(sorted((heaviest, *staying)))
        # Each set of parts is tried only once.
        if core not in sets:
            sets.add(core)
            yield core


def _is_sliding(momenta: Momenta, part: int, td: float) -> bool:
    """Return True if a part moves under a constant force other than gravity around ``td`` [time]."""
    laws = get_laws_of(momenta, (part,))
    window = find_lasting_window(laws.fit, td, laws.extent, laws.noise, fades=True)
    if window is None:
        return False
    return find_flight_of(momenta, (part,), td) is None


def _get_parts_and_momenta(run: OpenedRun) -> tuple[tuple[Part, ...], Momenta | None]:
    """Return the deformable parts and their momenta; None if the run contains no part momenta."""
    deformable = list_deformable_parts(run)
    for momenta in run.momenta(deformable, None):
        if momenta.parts:
            return deformable, momenta
    return deformable, None


def _list_flights_of_bodies(
    momenta: Momenta, bodies: Iterable[Iterable[int]]
) -> Iterator[FreeFlight]:
    """Yield the flights of bodies that consist of connected parts, given by part ids."""
    position_by_id = {
        part.id: position for position, part in enumerate(momenta.parts or ())
    }
    for body in bodies:
        members = tuple(position_by_id[part] for part in body if part in position_by_id)
        if members:
            yield from find_all_flights(momenta.choosing(members, members))


def _select_heaviest_parts(
    run: OpenedRun,
    deformable: Sequence[Part],
    momenta: Momenta | None,
    flights: Sequence[FreeFlight],
) -> tuple[Part, ...]:
    """Return the deformable parts of the flight with the largest product of mass and duration."""
    if momenta is None:
        raise FormatError(
            f"{run.name}: no momenta show which parts fly together; name the switched parts with `parts`"
        )
    if not flights:
        first, last = momenta.time[0], momenta.time[-1]
        raise FormatError(
            f"{run.name}: the momenta show no parts that fly together from {first:g} to {last:g}; continue the run "
            "until they fly, or name the switched parts by their ids with `parts`"
        )
    if momenta.masses is None:
        masses = np.ones(len(run.parts))
    else:
        masses = np.nan_to_num(momenta.masses)
    mass_by_part = dict(zip(run.parts, masses.tolist(), strict=True))

    def weigh(flight: FreeFlight) -> float:
        """Return the product of mass and duration of a flight."""
        mass = sum(mass_by_part[part] for part in flight.parts or ())
        return flight.duration * mass

    best = max(flights, key=weigh)
    return tuple(part for part in deformable if part in (best.parts or ()))


def find_complete_stretches(
    momenta: Momenta, whole: Momenta | None
) -> tuple[slice, ...]:
    """Return the ranges of states in which the part momenta add up to the momentum of the ``whole`` model.

    In all other states, a rigid body has absorbed some parts, so the quantities of the parts are not used.
    """
    return find_stretches(is_complete(momenta, whole), FEWEST)


def is_complete(
    momenta: Momenta, whole: Momenta | None, before: float = 0.0
) -> NDArray[np.bool_]:
    """Return an array that is True for each state in which the part momenta add up to the momentum of the whole model.

    ``before`` is the largest momentum of the whole model in earlier states.
    """
    if whole is None or whole.velocity or whole.time.size != momenta.time.size:
        return np.ones(momenta.time.size, np.bool_)
    all_parts = range(momenta.values.shape[1])
    of_parts = momenta.of(all_parts)
    of_model = whole.values[:, 0]
    sizes = np.abs(of_model).max(axis=1)
    largest_so_far = np.maximum(np.maximum.accumulate(sizes), before)
    difference = np.abs(of_parts - of_model).max(axis=1)
    limit = _ALL_OF_IT * largest_so_far + 2 * momenta.noise(all_parts)
    return np.asarray(difference <= limit)
