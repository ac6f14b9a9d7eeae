"""Represent one or more restart segments of a run as a database whose columns are read on request.

Databases of different formats that one run wrote are companions; this module checks that they belong to one run.
"""

from __future__ import annotations

import re
from collections import Counter
from contextlib import suppress
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, list_names
from d2rpick.histories.history import Precision, Samples
from d2rpick.histories.meaning import find_quantities
from d2rpick.histories.names import (
    Part,
    find_energy_unit,
    mark_namesakes,
    resolve_name,
)
from d2rpick.histories.samples import (
    STEPS_BACK,
    find_holes,
    find_newest_states,
    find_window,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.contact_forces import ContactForce
    from d2rpick.histories.resuming import ResumePoint

    Indices = NDArray[np.intp]

# In a time column, the values decrease at most at this fraction of the states [-]; other columns exceed it.
_MOST_BACK: Final = 0.1
# Significant digits by number of bytes per value: single precision has 7, and 17 digits preserve every double.
DIGITS: Final = {4: 7, 8: 17}

# Largest number of gaps in the output that are noted.
_MOST_HOLES: Final = 3
# Smallest fraction of the times in the coarser of a run's two databases that must occur in the other database [-].
# Many times coincide even if the output intervals differ, because a solver writes only at the end of a time step.
_FEWEST = 0.5
# Largest difference between the end times of a run's databases [output intervals]; a killed run may lack states.
_ENDS_APART = 2.0
# Tolerances by which the internal energy of the parts may exceed the internal energy of the model.
# _MORE: tolerance relative to the largest internal energy of the model [-]; in solver files, 0.001 would suffice.
# _ROUND_OFF: additional tolerance relative to the largest kinetic energy of the model [-].
_MORE, _ROUND_OFF = 0.1, 1e-6


class Database:
    """The states of one restart segment of a run in the units of the run; each reader implements the methods.

    The times are those of the file: they may repeat or decrease if a restart wrote a state again. A FormatError is
    raised for a column that is missing in the file or in some of its states.

    Attributes
    ----------
    source : str
        Name of the file or files, for messages.
    format : str
        Name of the format, as in the list of readers.
    version, title : str
        Solver and release, as far as the file contains them, and title of the run.
    complete : bool
        True if the file ends after a complete state and no earlier state is missing.
    notes : tuple of str
        Notes for the user about the content that was read.
    channels : tuple of str
        Names of the columns of the whole model, without the time.
    parts : tuple of Part
        Parts with their own histories, in the order of the file.
    node_ids : tuple of int
        Ids of the nodes whose displacements are written and can be read.
    time_unit : str
        Unit of the times; empty if the file does not contain it, which is the case for solver files.
    digits : int
        Significant decimal digits of all numbers.
    named_by_people : bool
        True if users or programs other than solvers named the channels, so that a name need not denote the usual
        quantity.
    no_channels, no_parts : str
        Message if channels or parts are requested and there are none.
    only_forces : bool
        True if the database contains contact forces, but no data of the whole model or of parts; it is used only
        together with other files.
    """

    source: str
    format: str
    version = title = time_unit = ""
    complete = True
    notes: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    parts: tuple[Part, ...] = ()
    node_ids: tuple[int, ...] = ()
    digits = DIGITS[8]
    no_channels = ""
    named_by_people = False
    only_forces = False
    no_parts = "this table has no parts; give the matsum, binout or T01 instead, or one of its columns by `energy`"

    @property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of contacts and rigid walls; raises FormatError if the files contain forces that cannot be read."""
        return ()

    def find_resume_points(self) -> Mapping[str, ResumePoint]:
        """Return the place in each file where a later read can begin; empty if the format is always read completely."""
        return {}

    def branch(self, name: str) -> Database:
        """Return the branch of the model (``glstat``) or the parts (``matsum``); raise FormatError if it is missing."""
        reason = self.no_channels if name == "glstat" else self.no_parts
        raise FormatError(f"{self.source}: {reason}")

    @cached_property
    def time(self) -> Samples:
        """Times of the states of the whole model, shape (n,) [time]."""
        return self.branch("glstat").time

    @cached_property
    def part_time(self) -> Samples:
        """Times of the states of the parts, shape (m,) [time]."""
        return self.branch("matsum").time

    def channel(self, name: str) -> Samples:
        """Return a column of the whole model, shape (n,)."""
        return self.branch("glstat").channel(name)

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Return a quantity (``internal_energy``, ``x_momentum``, ...) of the given parts, shape (m, len(ids))."""
        return self.branch("matsum").part_channel(quantity, ids)

    @cached_property
    def node_time(self) -> Samples:
        """Times of the node states, shape (k,) [time]."""
        return self.time

    def node_displacements(self, ids: Sequence[int]) -> Samples:  # noqa: ARG002  some subclasses use the argument
        """Return the displacements of some of ``node_ids`` since the start of the run, shape (k, len(ids), 3)."""
        raise FormatError(f"{self.source}: displacements of nodes are not read from it")

    @property
    def energy_channel(self) -> str | None:
        """Name of the internal energy of the model; None if the file does not contain it."""
        for name in ("internal energy", "internal_energy"):
            if name in self.channels:
                return name
        return None

    def find(self, wanted: str) -> str:
        """Return the column selected by name or, in tables, by number; otherwise a FormatError lists the columns."""
        return resolve_name(wanted, self.channels, self.source)

    def find_energy_unit(self, channel: str) -> str:
        """Return the energy unit that the name of a column contains; empty if it contains none."""
        return find_energy_unit(channel)

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:  # noqa: ARG002  some subclasses use the argument
        """Return the precision of the times and of these channels or, if no channels are given, of the parts."""
        return Precision(self.digits), Precision(self.digits)


class Legs:
    """The restart segments of one run in order, as one `Database`. If two overlap, the newer segment is used.

    A single segment needs this class, too, because a restart may have written states again, and printed times may be
    equal. Segments without states are used only if no segment has states.
    """

    def __init__(
        self,
        legs: Sequence[Database],
        cut: Sequence[str] = (),
        named: Sequence[tuple[str, str]] = (),
        notes: Sequence[str] = (),
    ) -> None:
        self._cut = cut  # Names of the packed files that are truncated.
        self._own_notes = notes  # Notes on the files that were not read.
        self._named = named  # Quantities whose channels have nonstandard names.
        self._files = self._legs = [*legs]
        if len(legs) > 1:  # The times of a single restart segment may not be known yet.
            self._files = sorted(legs, key=_make_leg_key)
            with_states = [leg for leg in self._files if _find_start(leg) > -np.inf]
            self._legs = with_states or self._files
        # Part ids and energies from the most recent request.
        self._energies: tuple[tuple[int, ...], Samples] | None = None
        self.source = ", ".join(leg.source for leg in self._files)
        first = self._legs[0]
        self.format, self.version = first.format, first.version
        self.named_by_people = first.named_by_people
        self.title, self.time_unit = first.title, first.time_unit
        self.complete = all(leg.complete for leg in self._files) and not cut

    def find_resume_points(self) -> Mapping[str, ResumePoint]:
        """Return the position in each file where a later read can begin; empty if the files are read completely."""
        # Imported here to keep start-up fast.
        from d2rpick.histories.resuming import join_resume_points

        return join_resume_points(leg.find_resume_points() for leg in self._files)

    @property
    def energy_channel(self) -> str | None:
        """Name of the internal energy channel of the whole model."""
        return self._legs[0].energy_channel

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Columns of the whole model that exist in all restart segments."""
        common = set(self._legs[0].channels)
        for leg in self._legs[1:]:
            common.intersection_update(leg.channels)
        return tuple(name for name in self._legs[0].channels if name in common)

    @cached_property
    def quantities(self) -> Mapping[str, str]:
        """Channels recognised by name, keyed by quantity of `d2rpick.histories.names.QUANTITIES`.

        If the names of several channels denote the same quantity, none of them is used, unless one is exactly the name
        of the quantity.
        """
        channels: dict[str, str] = {}
        for quantity, names in find_quantities(self.channels).items():
            if quantity in names:
                channels[quantity] = quantity
            elif len(names) == 1:
                channels[quantity] = names[0]
        for quantity, name in self._named:
            # Another database of the run may have the quantity; if none does, `open_run` raises the error.
            with suppress(FormatError):
                channels[quantity] = self.find(name)
        return channels

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Parts that exist in all restart segments."""
        return mark_namesakes(
            part for part in self._legs[0].parts if part.id not in self._passing
        )

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Notes of the restart segments, and notes on states that were left out between them."""
        # The columns are read first, because reading them may add notes to the restart segments.
        notes_on_states = self._kept[1] if self.channels else ()
        notes = [*self._own_notes]
        notes += [
            f"{name}: the packed data ends early; it was read up to there"
            for name in self._cut
        ]
        notes += [note for leg in self._files for note in leg.notes]
        if self._passing:
            notes.append(
                f"{self.source}: only some restart segments have part {list_names(self._passing)}, which was left out"
            )
        notes += notes_on_states
        if self.parts:
            notes += self._parts_kept[1]
        return tuple(dict.fromkeys(notes))

    @property
    def span(self) -> tuple[float, float] | None:
        """First and last time [time]; None if the run has no states."""
        times = [time for time in _list_times(self) if time.size]
        return (float(times[0][0]), float(times[0][-1])) if times else None

    @cached_property
    def time(self) -> Samples:
        """Times of the states of the whole model, in increasing order [time]."""
        return self._joined([leg.time for leg in self._legs], self._kept[0])

    @cached_property
    def part_time(self) -> Samples:
        """Times of the states of the parts, in increasing order [time]."""
        return self._joined([leg.part_time for leg in self._legs], self._parts_kept[0])

    def find(self, wanted: str) -> str:
        """Return the name of the column that the user selects."""
        return self._legs[0].find(wanted)

    def find_energy_unit(self, channel: str) -> str:
        """Return the energy unit that the name of a column contains; empty if it contains none."""
        return self._legs[0].find_energy_unit(channel)

    def channel(self, name: str) -> Samples:
        """Return a column of the whole model."""
        return self._joined([leg.channel(name) for leg in self._legs], self._kept[0])

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Return a quantity of the given parts; energies are cached, because they are requested repeatedly."""
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

    @cached_property
    def node_ids(self) -> tuple[int, ...]:
        """Numbers of the nodes whose displacements are in all restart segments."""
        common = set(self._legs[0].node_ids)
        for leg in self._legs[1:]:
            common.intersection_update(leg.node_ids)
        return tuple(id_ for id_ in self._legs[0].node_ids if id_ in common)

    @cached_property
    def node_time(self) -> Samples:
        """Times of the node states, shape (k,) [time]."""
        return self._joined([leg.node_time for leg in self._legs], self._nodes_kept)

    def node_displacements(self, ids: Sequence[int]) -> Samples:
        """Return the displacements of some of ``node_ids`` since the start of the run, shape (k, len(ids), 3)."""
        return self._joined(
            [leg.node_displacements(ids) for leg in self._legs], self._nodes_kept
        )

    def precisions(self, names: Sequence[str]) -> tuple[Precision, Precision]:
        """Return the precisions of the restart segment whose numbers have the fewest digits."""
        precisions = [leg.precisions(names) for leg in self._legs]
        coarsest_time = min((time for time, _ in precisions), key=_count_digits)
        coarsest_energy = min((energy for _, energy in precisions), key=_count_digits)
        return coarsest_time, coarsest_energy

    @cached_property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the contacts and rigid walls that exist in all restart segments."""
        # Imported here to keep start-up fast.
        from d2rpick.histories.contact_forces import join_contact_forces

        legs = [
            {force.name: force for force in leg.contact_forces} for leg in self._legs
        ]
        common = [name for name in legs[0] if all(name in leg for leg in legs)]
        pieces = [[leg[name] for leg in legs] for name in common]
        return tuple(
            join_contact_forces(of_one, self._order([leg.time for leg in of_one])[0])
            for of_one in pieces
        )

    @cached_property
    def _passing(self) -> tuple[int, ...]:
        """Ids of the parts that are missing in some restart segments."""
        legs = Counter(part.id for leg in self._legs for part in leg.parts)
        return tuple(id_ for id_, count in legs.items() if count < len(self._legs))

    @cached_property
    def _kept(self) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
        """Valid states of the whole model, and notes on invalid states."""
        return self._order([leg.time for leg in self._legs])

    @cached_property
    def _parts_kept(self) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
        """Valid states of the parts, and notes on invalid states."""
        return self._order([leg.part_time for leg in self._legs])

    @cached_property
    def _nodes_kept(self) -> NDArray[np.bool_]:
        """Valid node states."""
        return self._order([leg.node_time for leg in self._legs])[0]

    def _order(
        self, times: Sequence[Samples]
    ) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
        """Return a mask of the valid states, and notes on the invalid states."""
        for leg, time in zip(self._legs, times, strict=True):
            back = int(np.count_nonzero(time[1:] < time[:-1]))
            steps = time.size - 1
            if back > 1 and back > _MOST_BACK * steps:
                problem = f"{leg.source}: time steps back at {back} of {steps} states"
                raise FormatError(
                    f"{problem}, but increasing times were expected; check that this is the time (`time`) and the file "
                    "is not damaged"
                )
        all_times = _join_columns(times)
        keep, notes = find_newest_states(all_times)
        ends = np.cumsum([time.size for time in times])
        unused = [
            f"{leg.source} was not used: a newer restart segment begins at or before its first time"
            for leg, states in zip(self._legs, np.split(keep, ends[:-1]), strict=True)
            if states.size and not states.any()
        ]
        valid_times = all_times if keep.all() else all_times[keep]
        place = self._name_first_step_back(times)
        placed = [
            f"{place}: {note}" if note.startswith(STEPS_BACK) else note
            for note in notes
        ]
        return keep, (*placed, *unused, *_note_holes(valid_times))

    def _name_first_step_back(self, times: Sequence[Samples]) -> str:
        """Return the file and the number of its first state whose time is before that of the state that precedes it."""
        last = -np.inf
        for leg, time in zip(self._legs, times, strict=True):
            back = np.flatnonzero(np.diff(time, prepend=last) < 0)
            if back.size:
                return f"{leg.source}, state {back[0] + 1}"
            last = time[-1] if time.size else last
        return ""

    def _joined(self, columns: Sequence[Samples], keep: NDArray[np.bool_]) -> Samples:
        """Join the columns of the restart segments, and remove the invalid states."""
        whole = _join_columns(columns)
        return whole if keep.all() else whole[keep]


def _join_columns(columns: Sequence[Samples]) -> Samples:
    """Join columns; a single column is not copied."""
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def _list_times(database: Database | Legs) -> list[Samples]:
    """Return the times that the database contains, of the whole model and of the parts."""
    return [
        *([database.time] if database.channels else []),
        *([database.part_time] if database.parts else []),
    ]


def _find_start(leg: Database) -> float:
    """Return the first time of a restart segment [time]; -inf if it has no states."""
    return min(
        (float(time[0]) for time in _list_times(leg) if time.size), default=-np.inf
    )


def _make_leg_key(leg: Database) -> tuple[float, list[tuple[str, int]]]:
    """Return a key that sorts restart segments by start time and then by name, however they were ordered."""
    pieces = re.findall(r"(\D*)(\d*)", leg.source)
    return _find_start(leg), [(text, int(number or -1)) for text, number in pieces]


def _count_digits(precision: Precision) -> int:
    """Return the number of decimals of a precision, or its number of significant digits if the decimals are unknown."""
    return precision.digits if precision.decimals is None else precision.decimals


def _note_holes(time: Samples) -> tuple[str, ...]:
    """Return notes on long intervals without output, which may mean that a restart segment is missing."""
    return tuple(
        f"no states between {start:.6g} and {end:.6g}: a restart segment may be missing; add its files, because no "
        "flight is assumed across this gap"
        for start, end in find_holes(time)[:_MOST_HOLES]
    )


def check_energy_of_parts(whole: Legs, holder: Legs, energies: Samples) -> None:
    """Raise FormatError if the internal energy of the parts exceeds the energy of the whole model at the same times.

    ``energies`` (n, parts) contains the energies of some parts in the database ``holder`` [energy].
    """
    try:
        if whole is holder or whole.energy_channel is None:
            return
    except FormatError:  # An ambiguous energy is reported later, when it is read.
        return
    in_parts, in_model = _find_coincident(
        holder.part_time,
        whole.time,
        _compute_tolerance((holder, whole), (holder.part_time, whole.time)),
    )
    if not in_parts.size:
        return
    parts = energies[in_parts].sum(axis=1)
    model = whole.channel(whole.energy_channel)[in_model]
    kinetic = whole.quantities.get("kinetic_energy")
    largest_kinetic = 0.0
    if kinetic:
        largest_kinetic = float(np.abs(whole.channel(kinetic)[in_model]).max())
    tolerance = _MORE * float(np.abs(model).max()) + _ROUND_OFF * largest_kinetic
    state = int(np.argmax(parts - model))
    if parts[state] - model[state] > tolerance > 0:
        raise FormatError(
            f"at {holder.part_time[in_parts][state]:.6g} the parts of {holder.source} have an energy of "
            f"{parts[state]:.6g}, and the whole model of {whole.source} has {model[state]:.6g}, "
            "but files of one run were expected; give the files of one run"
        )


def note_doubts(databases: Sequence[Legs]) -> Iterator[str]:
    """Yield a note on each pair of databases that share few printed times or have different end times."""
    for first, second in combinations(databases, 2):
        if not (first.span and second.span):
            continue
        times = [_list_times(database)[0] for database in (first, second)]
        longest_step = max(np.diff(time).max(initial=0.0) for time in times)
        if abs(times[0][-1] - times[1][-1]) > _ENDS_APART * longest_step:
            ends = f"{first.source} ends at {times[0][-1]:.6g} and {second.source} at {times[1][-1]:.6g}"
            yield f"{ends}; are they from the same run, or is one cut?"
        low = max(t[0] for t in times)
        high = min(t[-1] for t in times)
        coarse, fine = sorted(
            (t[find_window(t, low, high)] for t in times), key=np.size
        )
        shared = _find_coincident(
            coarse, fine, _compute_tolerance((first, second), times)
        )[0].size
        if shared < _FEWEST * coarse.size:
            yield (
                f"{first.source} and {second.source} have only {shared} of {coarse.size} states at the same times; "
                "are they from the same run?"
            )


def _find_coincident(
    times: Samples, other_times: Samples, room: float
) -> tuple[Indices, Indices]:
    """Return the indices of the times that lie within ``room`` of another time, and of the nearest other times [time].

    Examples
    --------
    >>> _find_coincident(np.array([0.0, 0.0048730, 0.0099579]), np.array([0.0, 0.00487301, 0.00995]), 5e-7)
    (array([0, 1]), array([0, 1]))
    """
    if not other_times.size:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    following = np.searchsorted(other_times, times)
    lower = np.clip(following - 1, 0, other_times.size - 1)
    upper = np.clip(following, 0, other_times.size - 1)
    is_lower_nearer = np.abs(other_times[lower] - times) < np.abs(
        other_times[upper] - times
    )
    nearest = np.where(is_lower_nearer, lower, upper)
    near = np.flatnonzero(np.abs(other_times[nearest] - times) <= room)
    return near, nearest[near]


def _compute_tolerance(databases: Sequence[Legs], times: Sequence[Samples]) -> float:
    """Return the largest difference that rounding can cause between the printed times of databases [time]."""
    ends = zip(databases, times, strict=True)
    return (
        sum(
            database.precisions(())[0].quantum(float(time[-1]))
            for database, time in ends
            if time.size
        )
        / 2
    )
