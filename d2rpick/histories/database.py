"""Database: what a file of a run offers, its columns read only when they are asked for; several legs as one.

Databases of different formats that one run wrote are companions: whether they can be of one run is seen here, too.
"""

from __future__ import annotations

import re
from collections import Counter
from contextlib import suppress
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, listing
from d2rpick.histories.contact_forces import joined
from d2rpick.histories.history import Precision, Samples
from d2rpick.histories.meaning import find_quantities
from d2rpick.histories.names import Part, resolve, with_namesakes
from d2rpick.histories.samples import newest_states, window

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.contact_forces import ContactForce

    Indices = NDArray[np.intp]

# A restart steps back once; times that do so in more than this share of their states are none.
_MOST_BACK: Final = 0.1
# Significant digits by bytes per number: 24 bits hold 7 digits; 17 digits restore every double.
DIGITS: Final = {4: 7, 8: 17}


class Database:
    """The states of one leg of a run, in the run's own units: a reader sets what its files have, the rest is refused.

    Times are those of the file: they may repeat or step back where a restart wrote a state again.  Columns that
    are not there, or not in every state, raise FormatError.

    Attributes
    ----------
    source : str
        Name of the file or files, for messages.
    format : str
        Name of the format, as in the list of readers.
    version, title : str
        Solver and release, as far as the file names them; title of the run.
    complete : bool
        Whether the file ends behind a whole state and none is missing before.
    notes : tuple of str
        What a user should know about what was read.
    channels : tuple of str
        Names of the columns of the whole model; time is none of them.
    parts : tuple of Part
        Parts that have histories of their own, in the order of the file.
    time_unit : str
        Unit of the times, empty where the file does not name it; no solver writes one.
    digits : int
        Significant decimal digits of all numbers.
    named_by_people : bool
        Whether people or other programs than solvers chose the names of the channels, so that they may mean anything.
    no_channels, no_parts : str
        What to say where somebody asks for them and there are none.
    only_forces : bool
        Whether it holds forces of contacts, and neither the whole model nor parts: it counts beside others alone.
    """

    source: str
    format: str
    version = title = time_unit = ""
    complete = True
    notes: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    digits = DIGITS[8]
    no_channels = ""
    named_by_people = False
    only_forces = False
    no_parts = "this table has no parts; give the matsum, binout or T01 instead, or one of its columns by `energy`"

    @property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of contacts and rigid walls; FormatError where they are written, but cannot be read."""
        return ()

    def branch(self, name: str) -> Database:
        """Give what holds the whole model, ``glstat``, or the parts, ``matsum``; FormatError where there is none."""
        raise FormatError(
            f"{self.source}: {self.no_channels if name == 'glstat' else self.no_parts}"
        )

    @cached_property
    def time(self) -> Samples:
        """Times of the columns of the whole model, shape (n,) [time]."""
        return self.branch("glstat").time

    @cached_property
    def part_time(self) -> Samples:
        """Times of the parts' columns, shape (m,) [time]."""
        return self.branch("matsum").time

    def channel(self, name: str) -> Samples:
        """One column of the whole model, shape (n,)."""
        return self.branch("glstat").channel(name)

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """One quantity (``internal_energy``, ``x_momentum``, ...) of some parts, shape (m, len(ids))."""
        return self.branch("matsum").part_channel(quantity, ids)

    @property
    def energy_channel(self) -> str | None:
        """Name of the internal energy of the whole model; None where there is none."""
        return next(
            (
                name
                for name in ("internal energy", "internal_energy")
                if name in self.channels
            ),
            None,
        )

    def find(self, wanted: str) -> str:
        """Name of the column that the user means, by name or, in tables, by number; FormatError with what there is."""
        return resolve(wanted, self.channels, self.source)

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:  # noqa: ARG002  all are written alike
        """How finely the times and these channels were written; of no channels: those of the parts."""
        return Precision(self.digits), Precision(self.digits)


# An interval so many times the median one is no output interval.
_LONG = 30.0
# States of which the steps are looked at together: so many stay in the cache, and need no fresh memory.
_PIECE: Final = 1 << 15


class Legs:
    """Legs of one run as one `Database`: in the order of their start, and where they overlap the newer counts.

    Also one leg alone needs this where a restart wrote states again or times are printed alike.  Legs without any
    state count only where all are so.
    """

    def __init__(
        self,
        legs: Sequence[Database],
        cut: Sequence[str] = (),
        named: Sequence[tuple[str, str]] = (),
        notes: Sequence[str] = (),
    ) -> None:
        self._cut = cut  # files whose packed data ends early
        self._own_notes = notes  # on other files
        self._named = named  # quantities whose channels have unusual names
        several = (
            len(legs) > 1
        )  # of one leg the times are not looked at: they may not be known yet
        self._files = sorted(legs, key=_leg_order) if several else [*legs]
        self._legs = [
            leg for leg in self._files if not several or _start(leg) > -np.inf
        ] or self._files
        self._energies: tuple[tuple[int, ...], Samples] | None = (
            None  # of the parts that were asked for last
        )
        self.source = ", ".join(leg.source for leg in self._files)
        first = self._legs[0]
        self.format, self.version, self.named_by_people = (
            first.format,
            first.version,
            first.named_by_people,
        )
        self.title, self.time_unit = first.title, first.time_unit
        self.complete = all(leg.complete for leg in self._files) and not cut

    @property
    def energy_channel(self) -> str | None:
        """Internal energy of the whole model."""
        return self._legs[0].energy_channel

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Columns that all legs have."""
        others = [{*leg.channels} for leg in self._legs[1:]]
        return tuple(
            name
            for name in self._legs[0].channels
            if all(name in names for names in others)
        )

    @cached_property
    def quantities(self) -> Mapping[str, str]:
        """Channels that hold the quantities of `d2rpick.histories.names.QUANTITIES`, as far as their names tell.

        Where several have names of one quantity none of them is taken, unless one is named like the quantity itself.
        """
        found = find_quantities(self.channels)
        sure = {
            quantity: names[0] for quantity, names in found.items() if len(names) == 1
        }
        own = {
            quantity: quantity for quantity, names in found.items() if quantity in names
        }
        told = {}
        for quantity, name in self._named:
            with suppress(
                FormatError
            ):  # another database of the run has it, or `open_run` objects
                told[quantity] = self.find(name)
        return sure | own | told

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Parts that all legs have."""
        return with_namesakes(
            part for part in self._legs[0].parts if part.id not in self._passing
        )

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Notes of the legs, and what was left out between them."""
        kept = (
            self._kept[1] if self.channels else ()
        )  # first: reading the columns may add notes to the legs
        notes = [*self._own_notes]
        notes += [
            f"{name}: the packed data ends early; it was read up to there"
            for name in self._cut
        ]
        notes += [note for leg in self._files for note in leg.notes]
        if self._passing:
            notes.append(
                f"{self.source}: only some legs have part {listing(self._passing)}, which was left out"
            )
        notes += kept
        if self.parts:
            notes += self._parts_kept[1]
        return tuple(dict.fromkeys(notes))

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last time [time]; None where there are no states."""
        times = [time for time in _times(self) if time.size]
        return (float(times[0][0]), float(times[0][-1])) if times else None

    @cached_property
    def time(self) -> Samples:
        """Times of the columns of the whole model, increasing."""
        return self._joined([leg.time for leg in self._legs], self._kept[0])

    @cached_property
    def part_time(self) -> Samples:
        """Times of the parts' columns, increasing."""
        return self._joined([leg.part_time for leg in self._legs], self._parts_kept[0])

    def find(self, wanted: str) -> str:
        """Name of the column that the user means."""
        return self._legs[0].find(wanted)

    def channel(self, name: str) -> Samples:
        """One column of the whole model."""
        return self._joined([leg.channel(name) for leg in self._legs], self._kept[0])

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """One quantity of some parts; their energies are read-only, since several ask for those of the same parts."""
        if (
            quantity == "internal_energy"
            and self._energies
            and self._energies[0] == tuple(ids)
        ):
            return self._energies[1]
        values = self._joined(
            [leg.part_channel(quantity, ids) for leg in self._legs], self._parts_kept[0]
        )
        if quantity == "internal_energy":
            values = values.view()
            values.flags.writeable = False
            self._energies = tuple(ids), values
        return values

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """Those of the coarsest leg."""
        found = [leg.precisions(names) for leg in self._legs]
        return min((t for t, _ in found), key=_digits), min(
            (e for _, e in found), key=_digits
        )

    @cached_property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the contacts and rigid walls that all legs have."""
        legs = [
            {force.name: force for force in leg.contact_forces} for leg in self._legs
        ]
        common = [name for name in legs[0] if all(name in leg for leg in legs)]
        pieces = [[leg[name] for leg in legs] for name in common]
        return tuple(
            joined(of_one, self._order([leg.time for leg in of_one])[0])
            for of_one in pieces
        )

    @cached_property
    def _passing(self) -> tuple[int, ...]:
        """Parts that only some legs have."""
        legs = Counter(part.id for leg in self._legs for part in leg.parts)
        return tuple(id_ for id_, count in legs.items() if count < len(self._legs))

    @cached_property
    def _kept(self) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
        return self._order([leg.time for leg in self._legs])

    @cached_property
    def _parts_kept(self) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
        return self._order([leg.part_time for leg in self._legs])

    def _order(
        self, times: Sequence[Samples]
    ) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
        """Which states count, and what to say of the others."""
        for leg, time in zip(self._legs, times, strict=True):
            back, steps = int(np.count_nonzero(time[1:] < time[:-1])), time.size - 1
            if back > 1 and back > _MOST_BACK * steps:
                found = f"{leg.source}: time steps back at {back} of {steps} states, increasing times were expected"
                raise FormatError(
                    f"{found}; check that this is the time (`time`) and the file is not damaged"
                )
        every = _together(times)
        keep, notes = newest_states(every)
        behind = np.cumsum([time.size for time in times])
        unused = [
            f"{leg.source} was not used: a newer leg begins at or before its first time"
            for leg, here in zip(self._legs, np.split(keep, behind[:-1]), strict=True)
            if here.size and not here.any()
        ]
        return keep, (*notes, *unused, *_holes(every if keep.all() else every[keep]))

    def _joined(self, columns: Sequence[Samples], keep: NDArray[np.bool_]) -> Samples:
        whole = _together(columns)
        return whole if keep.all() else whole[keep]


def _together(columns: Sequence[Samples]) -> Samples:
    """Join columns without copying a single one."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def _times(database: Database | Legs) -> list[Samples]:
    """Times of the whole model and of the parts, as far as there are any."""
    return [
        *([database.time] if database.channels else []),
        *([database.part_time] if database.parts else []),
    ]


def _start(leg: Database) -> float:
    """First time of a leg; before all others where it has no states."""
    return min((float(time[0]) for time in _times(leg) if time.size), default=-np.inf)


def _leg_order(leg: Database) -> tuple[float, list[tuple[str, int]]]:
    """Sort legs by their start, those that start together by name: the order in which files are named is no matter."""
    pieces = re.findall(r"(\D*)(\d*)", leg.source)
    return _start(leg), [(text, int(number or -1)) for text, number in pieces]


def _digits(precision: Precision) -> int:
    return precision.digits if precision.decimals is None else precision.decimals


def _holes(time: Samples) -> tuple[str, ...]:
    """Say where output stops for long, as it does where a leg is missing."""
    if time.size < 4:
        return ()
    pieces = (
        np.diff(time[first : first + _PIECE + 1])
        for first in range(0, time.size - 1, _PIECE)
    )
    shortest, longest = zip(
        *((piece.min(), piece.max()) for piece in pieces), strict=True
    )
    if max(longest) <= _LONG * min(shortest):  # as nearly always
        return ()
    steps = np.diff(time)
    holes = np.flatnonzero(steps > _LONG * np.sort(steps)[steps.size // 2])
    return tuple(
        f"no states between {time[i]:.6g} and {time[i + 1]:.6g}; is a leg missing?"
        for i in holes[:3]
    )


# Output intervals may differ, but a solver writes at its own cycles: unless less than this share of the states of the
# coarser database are at times of the other one, both may be of one run.
_FEWEST = 0.5

# A run ends in all its databases within their output intervals; so many of the longest one are left for what a run that
# is killed has not written yet.
_ENDS_APART = 2.0

# Parts have no more internal energy than the model they belong to.  In files of solvers their sum exceeds it by less
# than 0.1 % of the largest; beyond this share, and round-off beside the kinetic energy, they are of another run.
_MORE, _ROUND_OFF = 0.1, 1e-6


def check_sum(whole: Legs, holder: Legs, energies: Samples) -> None:
    """Refuse parts that have more internal energy than the whole model has at the same times.

    ``energies``: those of some parts of ``holder``, shape (n, parts) [energy].
    """
    try:
        if whole is holder or whole.energy_channel is None:
            return
    except FormatError:  # which column it is, is not asked here
        return
    here, there = _coincident(
        holder.part_time,
        whole.time,
        _room((holder, whole), (holder.part_time, whole.time)),
    )
    if not here.size:
        return
    parts, model = (
        energies[here].sum(axis=1),
        whole.channel(whole.energy_channel)[there],
    )
    kinetic = whole.quantities.get("kinetic_energy")
    moving = float(np.abs(whole.channel(kinetic)[there]).max()) if kinetic else 0.0
    room, most = (
        _MORE * float(np.abs(model).max()) + _ROUND_OFF * moving,
        int(np.argmax(parts - model)),
    )
    if parts[most] - model[most] > room > 0:
        found = (
            f"at {holder.part_time[here][most]:.6g} the parts of {holder.source} have an "
            f"energy of {parts[most]:.6g}"
        )
        what = f"{found}, the whole model of {whole.source} has {model[most]:.6g}: files of one run were expected"
        raise FormatError(f"{what}; give those of one run")


def doubts(databases: Sequence[Legs]) -> Iterator[str]:
    """Say which databases have hardly a state at the same time, within their printed digits, or end apart."""
    for one, other in combinations(databases, 2):
        if not (one.span and other.span):
            continue
        times = [_times(database)[0] for database in (one, other)]
        if abs(times[0][-1] - times[1][-1]) > _ENDS_APART * max(
            np.diff(t).max(initial=0.0) for t in times
        ):
            found = f"{one.source} ends at {times[0][-1]:.6g} and {other.source} at {times[1][-1]:.6g}"
            yield f"{found}; are they from the same run, or is one cut?"
        low, high = max(t[0] for t in times), min(t[-1] for t in times)
        coarse, fine = sorted((t[window(t, low, high)] for t in times), key=np.size)
        shared = _coincident(coarse, fine, _room((one, other), times))[0].size
        if shared < _FEWEST * coarse.size:
            found = f"{one.source} and {other.source} have only {shared} of {coarse.size} states at the same times"
            yield f"{found}; are they from the same run?"


def _coincident(
    times: Samples, others: Samples, room: float
) -> tuple[Indices, Indices]:
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
    nearest = np.where(
        np.abs(others[before] - times) < np.abs(others[after] - times), before, after
    )
    here = np.flatnonzero(np.abs(others[nearest] - times) <= room)
    return here, nearest[here]


def _room(databases: Sequence[Legs], times: Sequence[Samples]) -> float:
    """By how much a time may differ in two databases, as they print it [time]."""
    ends = zip(databases, times, strict=True)
    return (
        sum(
            database.precisions(())[0].quantum(float(time[-1]))
            for database, time in ends
            if time.size
        )
        / 2
    )
