"""Radioss and OpenRadioss time histories, T01, T02, ... (one per leg of a run), binary or text.

The head names the run, then says how many parts, materials, properties, subsets, groups and global variables there
are and describes each; every state after it is a record with the time and one for the global variables, the parts, the
subsets and each group, if there are any.  All states have the same lengths, so a column is a strided view of the file.
How a record lies in the file is said in `radioss_records`.
"""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, listing
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.content import Content, content_of
from d2rpick.histories.database import Database
from d2rpick.histories.formats.radioss_records import (
    INT,
    RUN,
    WIDTH,
    Records,
    integers,
    is_binary,
    is_text,
    records_of,
)
from d2rpick.histories.names import Part, Selection, plain_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from d2rpick.histories.content import Addresses
    from d2rpick.histories.history import Samples
    from d2rpick.histories.source import Source

_TITLES: Final = (40, 80, 100)  # bytes of the other titles, by age of the format

# Global variables by their number in the file: 12 up to 2024, 16 in 2025, 22 from 2026 on.
_GLOBALS: Final = (
    "internal_energy", "kinetic_energy", "x_momentum", "y_momentum", "z_momentum", "mass", "time_step",
    "rotation_energy", "external_work", "spring_energy", "contact_energy", "hourglass_energy",
    "elastic_contact_energy", "frictional_contact_energy", "damping_contact_energy", "plastic_work",
    "added_mass", "percentage_added_mass", "inlet_mass", "outlet_mass", "inlet_energy", "outlet_energy",
)  # fmt: skip

# Variables of parts that matter here, by their number in the file.
_PART_VARIABLES: Final = {
    1: "internal_energy", 2: "kinetic_energy", 3: "x_momentum", 4: "y_momentum", 5: "z_momentum", 6: "mass",
    7: "hourglass_energy", 9: "x_center", 10: "y_center", 11: "z_center", 21: "rotational_internal_energy",
    24: "rotational_kinetic_energy",
}  # fmt: skip


# Kinds of groups that have forces: interfaces and rigid walls, and their variables: normal and tangential impulses.
_TOUCHING: Final = {101: "interface", 102: "rigid wall"}
_IMPULSES: Final = ((1, 2, 3), (4, 5, 6))


class _Group(NamedTuple):
    """A group with a history: its kind, its members, the numbers of its variables.

    ``named`` are number and title of each member, of a group of forces alone.
    """

    kind: int
    members: int
    named: tuple[tuple[int, str], ...]
    variables: tuple[int, ...]

    @property
    def values(self) -> int:
        """Values of a state."""
        return self.members * len(self.variables)


class _Head(NamedTuple):
    """What the records before the first state say."""

    title: str
    version: str
    globals: tuple[str, ...]
    parts: tuple[Part, ...]
    columns: dict[
        tuple[int, str], int
    ]  # number of a part's variable among those of all parts
    counts: tuple[int, ...]  # of numbers in the records of one state
    groups: tuple[_Group, ...]  # whose records are the last ones


def recognises(head: bytes) -> bool:
    """Whether a file that begins like this is a time history; never raises.

    Examples
    --------
    >>> recognises(bytes([0, 0, 0, 84, 0, 0, 11, 224]) + b"a title"), recognises(b"time,internal energy")
    (True, False)
    """
    return is_binary(head) or is_text(head)


def open_legs(sources: Sequence[Source], _: Selection) -> list[TimeHistory]:
    """Open each file as a leg of the run.

    A time history of its own output interval (T01a, by /ATFILE) has no global values: beside others it is no leg.
    """
    histories = [TimeHistory(source.data, source.name) for source in sources]
    legs = [history for history in histories if history.channels] or histories
    for history in histories:
        if history not in legs:
            note = f"{history.source} was left out: without global values it is no leg of the run but an additional"
            legs[0].notes += (
                f"{note} time history (/ATFILE); name it alone to use its parts",
            )
    return legs


class TimeHistory(Database):
    """One time history file, read as a `Database`; parts and the whole model share their times.

    Parameters
    ----------
    content : bytes or Content
        The whole file.
    source : str
        Name of the file, for messages.

    Raises
    ------
    FormatError
        If the head is not whole, a record is not as long as the head says, or it is coded text.
    """

    format = "radioss-th"

    def __init__(self, content: bytes | Content, source: str) -> None:
        self._data = content_of(content)
        self.source = source
        self._records = records_of(self._data, source)
        self._head = head = _HeadRecords(self._records, len(self._data), source).head()
        self.title, self.version, self.channels = head.title, head.version, head.globals
        known = {id_ for id_, _ in head.columns}
        self.parts = tuple(
            part for part in head.parts if part.id in known
        )  # those of a card /TH/PART
        *self._begins, self._stride = accumulate(
            map(self._records.size, self._head.counts), initial=0
        )
        self._states, stop = self._whole_states()
        self.complete = not stop
        self.notes = (*stop, *self._silent_parts())

    @cached_property
    def digits(self) -> int:  # type: ignore[override]
        """Significant decimal digits of all numbers."""
        return self._records.digits(self.time)

    @cached_property
    def time(self) -> Samples:
        """Times of all states, shape (n,) [time]."""
        return self._columns(0, [0])[:, 0]

    def channel(self, name: str) -> Samples:
        """One global variable, shape (n,)."""
        if name not in self.channels:
            raise FormatError(
                f"{self.source}: no global {name}, there are {listing(self.channels, most=30)}"
            )
        return self._columns(1, [self.channels.index(name)])[:, 0]

    @cached_property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the interfaces and rigid walls that have a history (cards /TH/INTER and /TH/RWALL)."""
        groups = [group for group in self._head.groups if group.values]
        first = len(self._begins) - len(groups)
        return tuple(
            self._force_of(record, group, place)
            for record, group in enumerate(groups, start=first)
            if group.kind in _TOUCHING and {*_IMPULSES[0]} <= {*group.variables}
            for place in range(group.members)
        )

    def _force_of(self, record: int, group: _Group, place: int) -> ContactForce:
        number, title = group.named[place]
        axes = [axes for axes in _IMPULSES if {*axes} <= {*group.variables}]
        places = [
            place * len(group.variables) + group.variables.index(axis)
            for triple in axes
            for axis in triple
        ]
        impulses = (
            self._columns(record, places)
            .reshape(self._states, len(axes), 3)
            .sum(axis=1)
        )
        name = f"{_TOUCHING[group.kind]} {number}{f' {title!r}' if title else ''}"
        return ContactForce.of_impulses(name, self.time, impulses)

    def size_until(self, time: float) -> int:
        """Bytes of the head and of the states up to a time [time]."""
        return self._records.at + self._stride * int(
            np.searchsorted(self.time, time, side="right")
        )

    @cached_property
    def part_time(self) -> Samples:
        """Return the times of all states, shape (n,) [time]."""
        return self.time

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """One variable of some parts, shape (n, len(ids)).

        Raises
        ------
        FormatError
            If a part is not in the file, or without this variable.
        """
        record = 1 + bool(self.channels)
        return self._columns(record, [self._place(id_, quantity) for id_ in ids])

    def _place(self, id_: int, quantity: str) -> int:
        place = self._head.columns.get((id_, quantity))
        if place is None:
            known = [name for part, name in self._head.columns if part == id_]
            parts = listing([part.id for part in self.parts]) or "none"
            there = (
                f"only {listing(known)}" if known else f"parts with variables: {parts}"
            )
            raise FormatError(
                f"{self.source}: no {quantity} of part {id_}, {there}; ask for it with /TH/PART"
            )
        return place

    def _columns(self, record: int, places: Sequence[int]) -> Samples:
        """Some numbers of one record of each state, shape (n, places)."""
        offsets = [
            self._begins[record] + self._records.place(place) for place in places
        ]
        addresses = self._addresses(self._states, offsets)
        found = self._data.fields(addresses, self._records.width)
        self._data.check()
        return self._records.values(found).reshape(self._states, len(places))

    def _addresses(self, states: int, offsets: Sequence[int]) -> Addresses:
        """Where some bytes of each of the first states lie, shape (states * offsets,)."""
        return np.add.outer(
            self._records.at + self._stride * np.arange(states),
            np.array(offsets, np.int64),
        ).ravel()

    def _whole_states(self) -> tuple[int, tuple[str, ...]]:
        """Count the states; the file may stop inside one, but nothing else may stand between them.

        Records carry no name or number: where one is lost or put in, no state of the file is above suspicion.
        """
        states, rest = divmod(len(self._data) - self._records.at, self._stride)
        marks = [
            (begin, begin + place, count, mark)
            for begin, count in zip(self._begins, self._head.counts, strict=True)
            for place, mark in self._records.marks(count)
        ]
        width = len(marks[0][-1])
        expected = np.frombuffer(b"".join(mark for *_, mark in marks), f"V{width}")
        places = self._addresses(states + 1, [place for _, place, *_ in marks])
        places = places[places + width <= len(self._data)]
        found = self._data.fields(places, width).view(expected.dtype).ravel()
        self._data.check()
        bad = np.flatnonzero(found != np.resize(expected, found.size))
        if bad.size:
            state, mark = divmod(int(bad[0]), len(marks))
            begin, _, count, _ = marks[mark]
            start = self._records.at + state * self._stride
            where = f"{self.source}: state {state + 1}: a record of {count} numbers was expected"
            cure = f"if the states before are good, cut the file to {start} bytes"
            raise FormatError(f"{where} at byte {start + begin}; {cure}")
        stop = f"{self.source}: the file ends within state {states + 1}, which was left out"
        return states, (stop,) if rest else ()

    def _silent_parts(self) -> tuple[str, ...]:
        silent = [part.id for part in self._head.parts if part not in self.parts]
        if not silent:
            return ()
        which = f"part {silent[0]}" if len(silent) == 1 else f"parts {listing(silent)}"
        return (f"{self.source}: no variables of {which} in the file (card /TH/PART)",)


class _HeadRecords:
    """The records of the head, taken one after the other."""

    def __init__(self, records: Records, file_size: int, source: str) -> None:
        self._records = records
        self._most = file_size
        self._source = source
        self._title = (
            0  # bytes of a title, the same in all records; 0 until the first was seen
        )

    def head(self) -> _Head:
        """Read everything up to the first state."""
        run = self._next(RUN)
        version = plain_text(self._next(80))
        hierarchy = self._next()
        if (
            len(hierarchy) == WIDTH
        ):  # newer codes put records between, as many as this one says
            for _ in range(self._count(INT.unpack(hierarchy)[0])):
                self._next()
            hierarchy = self._next()
        if len(hierarchy) != 6 * WIDTH:
            raise self._broken("a record of 6 counts")
        parts, materials, properties, subsets, groups, variables = (
            self._count(n) for n in integers(hierarchy)
        )
        if self._integers(variables) != tuple(range(1, variables + 1)):
            raise self._broken("a numbering of the global variables")
        described, columns, part_values = self._parts(parts)
        for _ in range(materials + properties):
            self._titled(1)
        subset_values = sum(self._subset() for _ in range(subsets))
        described_groups = tuple(self._group() for _ in range(groups))
        values = [
            1,
            variables,
            part_values,
            subset_values,
            *(group.values for group in described_groups),
        ]
        return _Head(
            title=plain_text(run[WIDTH:]),
            version=" ".join(version.split()),
            globals=(
                *_GLOBALS[:variables],
                *(f"global_{n + 1}" for n in range(len(_GLOBALS), variables)),
            ),
            parts=described,
            columns=columns,
            counts=tuple(count for count in values if count),
            groups=described_groups,
        )

    def _parts(
        self, count: int
    ) -> tuple[tuple[Part, ...], dict[tuple[int, str], int], int]:
        """Parts: id, title, subset, material, property and number of variables; then the variables."""
        described: dict[int, Part] = {}
        columns: dict[tuple[int, str], int] = {}
        values = 0
        for _ in range(count):
            record = self._titled(5)
            id_ = INT.unpack_from(record)[0]
            material, properties, variables = integers(record[-3 * WIDTH :])
            codes = self._integers(self._count(variables))
            # A group of elements with a history is listed like a part, but without material and property.
            if material or properties:
                known_codes = [
                    code for code in codes if code
                ]  # a solver may write 0 for every variable
                if id_ in described or len(set(known_codes)) < len(known_codes):
                    raise self._broken("a part, and a variable of it, only once")
                described[id_] = Part(id_, plain_text(record[WIDTH : -4 * WIDTH]))
                known = (
                    (_PART_VARIABLES.get(code), place)
                    for place, code in enumerate(codes, start=values)
                )
                columns.update({(id_, name): place for name, place in known if name})
            values += variables
        return tuple(described.values()), columns, values

    def _subset(self) -> int:
        """Pass over a subset and its lists of children, parts and variables; the number of variables."""
        children, parts, variables = (
            self._count(n) for n in integers(self._titled(5)[2 * WIDTH : 5 * WIDTH])
        )
        for count in (children, parts, variables):
            self._integers(count)
        return variables

    def _group(self) -> _Group:
        """Read a group, its elements and its list of variables."""
        record = self._titled(5)
        kind, elements, variables = (
            INT.unpack_from(record, WIDTH * place)[0] for place in (1, 3, 4)
        )
        for number in (elements, variables):
            self._count(number)
        members = [self._titled(1) for _ in range(elements)]
        forces = members if kind in _TOUCHING else []
        named = tuple(
            (INT.unpack_from(member)[0], plain_text(member[WIDTH:]))
            for member in forces
        )
        return _Group(kind, elements, named, self._integers(variables))

    def _titled(self, numbers: int) -> bytes:
        """Read a record of a title and so many integers."""
        record = self._next(WIDTH * numbers + self._title if self._title else None)
        self._title = len(record) - WIDTH * numbers
        if self._title not in _TITLES:
            raise self._broken("a title")
        return record

    def _integers(self, count: int) -> tuple[int, ...]:
        """Read a record of so many integers; there is none for 0."""
        return integers(self._next(WIDTH * count)) if count else ()

    def _count(self, number: int) -> int:
        """Check a count from the file against what the file could hold."""
        if not 0 <= number <= self._most:
            raise self._broken("a count")
        return number

    def _next(self, length: int | None = None) -> bytes:
        """Take one record, of a known length if it is given."""
        record = self._records.take()
        if record is None:
            raise self._broken("a complete record")
        if length is not None and len(record) != length:
            raise self._broken(f"a record of {length} bytes")
        return record

    def _broken(self, expected: str) -> FormatError:
        found = f"{self._source}: {expected} was expected in the head of the time history near byte {self._records.at}"
        return FormatError(f"{found}; the file is cut or damaged, copy it again")
