"""Companions: databases of different formats that one run wrote, and whether they can be of one run."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from d2rpick.base.errors import FormatError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.database import Database, Legs
    from d2rpick.histories.history import Samples

    Indices = NDArray[np.intp]

# Output intervals may differ, but a solver writes at its own cycles: unless less than this share of the states of the
# coarser database are at times of the other one, both may be of one run.
_FEWEST = 0.5

# A run ends in all its databases within their output intervals; so many of the longest one are left for what a run that
# is killed has not written yet.
_ENDS_APART = 2.0

# Energies of two legs at a time that both have are the same within this share of the largest, else the runs differ.
_SAME = 0.01
# Parts that are compared.
_COMPARED = 50

# Parts have no more internal energy than the model they belong to.  In files of solvers their sum exceeds it by less
# than 0.1 % of the largest; beyond this share, and round-off beside the kinetic energy, they are of another run.
_MORE, _ROUND_OFF = 0.1, 1e-6


def check_companions(databases: Sequence[Legs]) -> None:
    """Refuse databases that have no time in common."""
    for one, other in combinations(databases, 2):
        if one.span and other.span and (one.span[0] > other.span[1] or other.span[0] > one.span[1]):
            raise FormatError(f"{one.source} and {other.source} have no time in common, files of one run were expected")


def check_legs(legs: Sequence[Database]) -> None:
    """Refuse files of one format that are not of one run.

    All legs of a run hold the same quantities.  A restart repeats the state it begins with.  Files that begin at the
    same time are copies, or of different runs: then all states that they share are compared.
    """
    for one, other in combinations(legs, 2):
        here, there = _held(one), _held(other)
        if here and there and not here & there:
            found = f"{one.source} and {other.source} have neither a column nor a part in common"
            raise FormatError(f"{found}, legs of one run were expected; give the files of one run")
        for times, columns in ((_own_times, _energies), (_part_times, _part_energies)):
            try:
                shared = _shared(times(one), times(other))
                values = [columns(leg, at) for leg, at in zip((one, other), shared, strict=True)] if shared else []
            except FormatError:  # said when it is read
                continue
            if values and not _alike(*values):
                found = f"{one.source} and {other.source} have different energies at the same times"
                raise FormatError(f"{found}, legs of one run were expected; give the files of one run")


def check_sum(whole: Legs, holder: Legs, energies: Samples) -> None:
    """Refuse parts that have more internal energy than the whole model has at the same times.

    ``energies``: those of some parts of ``holder``, shape (n, parts) [energy].
    """
    try:
        if whole is holder or whole.energy_channel is None:
            return
    except FormatError:  # which column it is, is not asked here
        return
    here, there = _coincident(holder.part_time, whole.time, _room((holder, whole), (holder.part_time, whole.time)))
    if not here.size:
        return
    parts, model = energies[here].sum(axis=1), whole.channel(whole.energy_channel)[there]
    kinetic = whole.quantities.get("kinetic_energy")
    moving = float(np.abs(whole.channel(kinetic)[there]).max()) if kinetic else 0.0
    room, most = _MORE * float(np.abs(model).max()) + _ROUND_OFF * moving, int(np.argmax(parts - model))
    if parts[most] - model[most] > room > 0:
        found = (
            f"at {holder.part_time[here][most]:.6g} the parts of {holder.source} have an energy of {parts[most]:.6g}"
        )
        what = f"{found}, the whole model of {whole.source} has {model[most]:.6g}: files of one run were expected"
        raise FormatError(f"{what}; give those of one run")


def doubts(databases: Sequence[Legs]) -> Iterator[str]:
    """Say which databases have hardly a state at the same time, within their printed digits, or end apart."""
    for one, other in combinations(databases, 2):
        if not (one.span and other.span):
            continue
        times = [_times(database) for database in (one, other)]
        if abs(times[0][-1] - times[1][-1]) > _ENDS_APART * max(np.diff(t).max(initial=0.0) for t in times):
            found = f"{one.source} ends at {times[0][-1]:.6g} and {other.source} at {times[1][-1]:.6g}"
            yield f"{found}; are they from the same run, or is one cut?"
        coarse, fine = sorted(_common(*times), key=np.size)
        shared = _coincident(coarse, fine, _room((one, other), times))[0].size
        if shared < _FEWEST * coarse.size:
            found = f"{one.source} and {other.source} have only {shared} of {coarse.size} states at the same times"
            yield f"{found}; are they from the same run?"


def _coincident(times: Samples, others: Samples, room: float) -> tuple[Indices, Indices]:
    """Indices of the times that lie within ``room`` [time] of one of the others, and of the nearest of these.

    Examples
    --------
    >>> _coincident(np.array([0.0, 0.0048730, 0.0099579]), np.array([0.0, 0.00487301, 0.00995]), 5e-7)
    (array([0, 1]), array([0, 1]))
    """
    if not others.size:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    behind = np.searchsorted(others, times)
    before, after = (np.clip(behind - step, 0, others.size - 1) for step in (1, 0))
    nearest = np.where(np.abs(others[before] - times) < np.abs(others[after] - times), before, after)
    here = np.flatnonzero(np.abs(others[nearest] - times) <= room)
    return here, nearest[here]


def _room(databases: Sequence[Legs], times: Sequence[Samples]) -> float:
    """By how much a time may differ in two databases, as they print it [time]."""
    ends = zip(databases, times, strict=True)
    return sum(database.precisions(())[0].quantum(float(time[-1])) for database, time in ends if time.size) / 2


def _held(leg: Database) -> set[str | int]:
    """Columns and parts of a leg."""
    return {*leg.channels, *(part.id for part in leg.parts)}


def _own_times(leg: Database) -> Samples:
    return leg.time if leg.channels else np.empty(0)


def _part_times(leg: Database) -> Samples:
    return leg.part_time if leg.parts else np.empty(0)


def _energies(leg: Database, states: Indices) -> Samples:
    name = leg.energy_channel
    return leg.channel(name)[states] if name else np.empty((states.size, 0))


def _part_energies(leg: Database, states: Indices) -> Samples:
    ids = [part.id for part in leg.parts][:_COMPARED]
    return leg.part_channel("internal_energy", ids)[states]


def _shared(one: Samples, other: Samples) -> tuple[Indices, Indices] | None:
    """States at the same times: all where both begin alike, else the first of the later one; None without any."""
    _, here, there = np.intersect1d(one, other, return_indices=True)
    if not here.size:
        return None
    if here[0] == there[0] == 0:
        return here, there
    begins = there == 0 if other[0] > one[0] else here == 0
    return (here[begins], there[begins]) if begins.any() else None


def _alike(one: Samples, other: Samples) -> bool:
    """Whether energies are the same up to what a restart on other processors changes; NaN is none."""
    if one.shape != other.shape:
        return True
    known = np.isfinite(one) & np.isfinite(other)
    largest = np.maximum(np.abs(one), np.abs(other)).max(initial=0.0, where=known)
    return bool(np.all(np.abs(one - other)[known] <= _SAME * largest))


def _times(database: Legs) -> Samples:
    return database.time if database.channels else database.part_time


def _common(one: Samples, other: Samples) -> tuple[Samples, Samples]:
    """What of two increasing records of times lies in the span of both."""
    low, high = max(one[0], other[0]), min(one[-1], other[-1])
    return one[(one >= low) & (one <= high)], other[(other >= low) & (other <= high)]
