"""Read time histories of Radioss and OpenRadioss (T01, T02, ..., one per engine run), binary or text.

The header contains the name of the run, the numbers of parts, materials, properties, subsets, groups and global
variables, and a description of each of them. Each state consists of a record with the time, and one record each for the
global variables, the parts, the subsets and every group. The records have the same lengths in all states, so a column
is a strided view of the file. The layout of a record is described in `radioss_records`.
"""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, list_names
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.content import Content, make_content
from d2rpick.histories.database import Database
from d2rpick.histories.formats.radioss_records import (
    INT,
    RUN,
    WIDTH,
    Records,
    is_binary,
    is_text,
    open_records,
    split_integers,
)
from d2rpick.histories.names import Part, Selection, clean_text
from d2rpick.histories.resuming import ResumePoint

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from d2rpick.histories.content import Addresses
    from d2rpick.histories.history import Samples
    from d2rpick.histories.source import Source

# Possible lengths of all titles except the run title, from older to newer formats [bytes].
_TITLES: Final = (
    40,
    80,
    100,
)

# Global variables in file order.
# A file has the first 12 variables up to version 2024, the first 16 in version 2025, and all 22 from 2026 on.
_GLOBALS: Final = (
    "internal_energy", "kinetic_energy", "x_momentum", "y_momentum", "z_momentum", "mass", "time_step",
    "rotation_energy", "external_work", "spring_energy", "contact_energy", "hourglass_energy",
    "elastic_contact_energy", "frictional_contact_energy", "damping_contact_energy", "plastic_work",
    "added_mass", "percentage_added_mass", "inlet_mass", "outlet_mass", "inlet_energy", "outlet_energy",
)  # fmt: skip

# Part variables that d2rpick uses, keyed by their code in the file.
_PART_VARIABLES: Final = {
    1: "internal_energy", 2: "kinetic_energy", 3: "x_momentum", 4: "y_momentum", 5: "z_momentum", 6: "mass",
    7: "hourglass_energy", 9: "x_center", 10: "y_center", 11: "z_center", 21: "rotational_internal_energy",
    24: "rotational_kinetic_energy",
}  # fmt: skip


# Type of a node group, followed by the codes of its displacement variables.
_NODES: Final = 0
_DISPLACEMENTS: Final = (1, 2, 3)
# Types of groups with contact forces, followed by the codes of their normal and tangential impulses.
_TOUCHING: Final = {101: "interface", 102: "rigid wall"}
_IMPULSES: Final = ((1, 2, 3), (4, 5, 6))


class _Group(NamedTuple):
    """A group that has a history: its type, its number of members, and the codes of its variables.

    ``named`` contains the id and title of each member; it is empty unless the group consists of nodes, interfaces or
    rigid walls.
    """

    kind: int
    members: int
    named: tuple[tuple[int, str], ...]
    variables: tuple[int, ...]

    @property
    def values(self) -> int:
        """Number of values of the group in a state."""
        return self.members * len(self.variables)


class _Head(NamedTuple):
    """The header of the file: the content of the records before the first state."""

    title: str
    version: str
    globals: tuple[str, ...]
    parts: tuple[Part, ...]
    # Index of each part variable among the variables of all parts.
    columns: dict[tuple[int, str], int]
    counts: tuple[int, ...]  # Number of values in each record of a state.
    groups: tuple[_Group, ...]  # Groups with histories, whose records end each state.


def recognises(head: bytes) -> bool:
    """Return True if a file with these first bytes is a time history. This function never raises.

    Examples
    --------
    >>> recognises(bytes([0, 0, 0, 84, 0, 0, 11, 224]) + b"a title"), recognises(b"time,internal energy")
    (True, False)
    """
    return is_binary(head) or is_text(head)


def open_legs(sources: Sequence[Source], _: Selection) -> list[TimeHistory]:
    """Open each file as a restart segment of the run.

    A time history with its own output interval (T01a, by /ATFILE) has no global values, and is not a restart segment if
    there are other files.
    """
    histories = [TimeHistory(source.data, source.name) for source in sources]
    legs = [history for history in histories if history.channels] or histories
    for history in histories:
        if history not in legs:
            note = f"{history.source} was left out: without global values it is no engine run but an additional"
            legs[0].notes += (
                f"{note} time history (/ATFILE); name it alone to use its parts",
            )
    return legs


class TimeHistory(Database):
    """One time history file as a `Database`; the parts and the whole model have the same times.

    Parameters
    ----------
    content : bytes or Content
        Content of the file.
    source : str
        Name of the file, for messages.

    Raises
    ------
    FormatError
        If the header is incomplete, if a record does not have the length stated in the header, or if the text is
        encoded.
    """

    format = "radioss-th"

    def __init__(self, content: bytes | Content, source: str) -> None:
        self._data = make_content(content)
        self.source = source
        self._records = open_records(self._data, source)
        self._head = head = _HeadRecords(self._records, len(self._data), source).head()
        self.title, self.version, self.channels = head.title, head.version, head.globals
        # Only the parts on a /TH/PART card have variables.
        parts_with_variables = {id_ for id_, _ in head.columns}
        self.parts = tuple(
            part for part in head.parts if part.id in parts_with_variables
        )
        *self._begins, self._stride = accumulate(
            map(self._records.size, self._head.counts), initial=0
        )
        self._states, stop = self._whole_states()
        self.complete = not stop
        self.notes = (*stop, *self._silent_parts())

    @cached_property
    def digits(self) -> int:  # type: ignore[override]  # a property overrides a field
        """Number of significant decimal digits of all numbers in the file."""
        return self._records.digits(self.time)

    @cached_property
    def time(self) -> Samples:
        """Times of all states, shape (n,) [time]."""
        return self._columns(0, [0])[:, 0]

    def channel(self, name: str) -> Samples:
        """Return a global variable, shape (n,)."""
        if name not in self.channels:
            raise FormatError(
                f"{self.source}: no global {name}, there are {list_names(self.channels, most=30)}"
            )
        return self._columns(1, [self.channels.index(name)])[:, 0]

    @cached_property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Forces of the interfaces and rigid walls that have histories (cards /TH/INTER and /TH/RWALL)."""
        return tuple(
            self._force_of(record, group, member)
            for record, group in self._list_groups()
            if group.kind in _TOUCHING and {*_IMPULSES[0]} <= {*group.variables}
            for member in range(group.members)
        )

    @cached_property
    def node_ids(self) -> tuple[int, ...]:  # type: ignore[override]  # a property overrides a field
        """Numbers of the nodes whose displacements are written (card /TH/NODE)."""
        return tuple(self._displacement_columns)

    def node_displacements(self, ids: Sequence[int]) -> Samples:
        """Return the displacements of the given nodes since the start of the run, shape (n, len(ids), 3)."""
        places = [self._displacement_columns[id_] for id_ in ids]
        moved = [self._columns(record, columns) for record, columns in places]
        return np.stack(moved, axis=1)

    @cached_property
    def _displacement_columns(self) -> dict[int, tuple[int, list[int]]]:
        """Index of the record that contains the displacements of each node, and their three columns in that record."""
        places: dict[int, tuple[int, list[int]]] = {}
        for record, group in self._list_groups():
            if group.kind == _NODES and {*_DISPLACEMENTS} <= {*group.variables}:
                first = [group.variables.index(code) for code in _DISPLACEMENTS]
                for member, (number, _) in enumerate(group.named):
                    before = member * len(group.variables)
                    places[number] = record, [before + column for column in first]
        return places

    def _list_groups(self) -> Iterator[tuple[int, _Group]]:
        """Yield the groups that have values, each with the index of its record."""
        groups = [group for group in self._head.groups if group.values]
        return enumerate(groups, start=len(self._begins) - len(groups))

    def _force_of(self, record: int, group: _Group, member: int) -> ContactForce:
        """Return the force of one interface or rigid wall in a group, from its normal and tangential impulses."""
        number, title = group.named[member]
        triples = [codes for codes in _IMPULSES if {*codes} <= {*group.variables}]
        first = member * len(group.variables)
        columns = []
        for codes in triples:
            columns += [first + group.variables.index(code) for code in codes]
        values = self._columns(record, columns)
        impulses = values.reshape(self._states, len(triples), 3).sum(axis=1)
        name = f"{_TOUCHING[group.kind]} {number}{f' {title!r}' if title else ''}"
        return ContactForce.of_impulses(name, self.time, impulses)

    def find_resume_points(self) -> dict[str, ResumePoint]:
        """Return the position at which a later read can begin, which is that of the second-to-last complete state."""
        begin = self._records.at + self._stride * max(self._states - 2, 0)
        head = self._data[: self._records.at]
        return {self.source: ResumePoint(head, begin, len(self._data))}

    @cached_property
    def part_time(self) -> Samples:
        """Times of all states, shape (n,) [time]."""
        return self.time

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Return a variable of the given parts, shape (n, len(ids)).

        Raises
        ------
        FormatError
            If the file does not contain a part, or a part does not have this variable.
        """
        record = 1 + bool(self.channels)
        return self._columns(record, [self._place(id_, quantity) for id_ in ids])

    def _place(self, id_: int, quantity: str) -> int:
        """Return the index of a part variable in the record of the parts; raise FormatError if it is missing."""
        column = self._head.columns.get((id_, quantity))
        if column is None:
            quantities = [name for part, name in self._head.columns if part == id_]
            parts = list_names([part.id for part in self.parts]) or "none"
            choice = f"parts with variables: {parts}"
            if quantities:
                choice = f"only {list_names(quantities)}"
            raise FormatError(
                f"{self.source}: no {quantity} of part {id_}, {choice}; ask for it with /TH/PART"
            )
        return column

    def _columns(self, record: int, columns: Sequence[int]) -> Samples:
        """Return the selected numbers from one record of each state, shape (n, columns)."""
        offsets = [
            self._begins[record] + self._records.place(column) for column in columns
        ]
        addresses = self._addresses(self._states, offsets)
        fields = self._data.fields(addresses, self._records.width)
        self._data.check()
        return self._records.values(fields).reshape(self._states, len(columns))

    def _addresses(self, states: int, offsets: Sequence[int]) -> Addresses:
        """Return the offsets of the numbers in the first ``states`` states, shape (states * offsets,) [bytes]."""
        return np.add.outer(
            self._records.at + self._stride * np.arange(states),
            np.array(offsets, np.int64),
        ).ravel()

    def _whole_states(self) -> tuple[int, tuple[str, ...]]:
        """Count the complete states; only the last state may be truncated.

        Records have neither a name nor a number, so if a record is lost or inserted, no state of the file can be
        trusted.
        """
        states, bytes_left = divmod(len(self._data) - self._records.at, self._stride)
        marks = []
        for begin, count in zip(self._begins, self._head.counts, strict=True):
            for offset, mark in self._records.marks(count):
                marks.append((begin, begin + offset, count, mark))
        width = len(marks[0][-1])
        expected = np.frombuffer(b"".join(mark for *_, mark in marks), f"V{width}")
        addresses = self._addresses(states + 1, [offset for _, offset, *_ in marks])
        addresses = addresses[addresses + width <= len(self._data)]
        actual = self._data.fields(addresses, width).view(expected.dtype).ravel()
        self._data.check()
        bad = np.flatnonzero(actual != np.resize(expected, actual.size))
        if bad.size:
            state, index = divmod(int(bad[0]), len(marks))
            begin, _, count, _ = marks[index]
            start = self._records.at + state * self._stride
            where = f"{self.source}: state {state + 1}: a record of {count} numbers was expected"
            cure = (
                "copy the file again; to use the states before, unpack the file if it is packed, and cut it to "
                f"{start} bytes"
            )
            raise FormatError(f"{where} at byte {start + begin}; {cure}")
        stop = f"{self.source}: the file ends within state {states + 1}, which was left out"
        return states, (stop,) if bytes_left else ()

    def _silent_parts(self) -> tuple[str, ...]:
        """Return a note on parts without variables."""
        silent = [part.id for part in self._head.parts if part not in self.parts]
        if not silent:
            return ()
        which = (
            f"part {silent[0]}" if len(silent) == 1 else f"parts {list_names(silent)}"
        )
        return (f"{self.source}: no variables of {which} in the file (card /TH/PART)",)


class _HeadRecords:
    """Reads the header records of a time history one after another."""

    def __init__(self, records: Records, file_size: int, source: str) -> None:
        self._records = records
        self._most = file_size
        self._source = source
        # Length of the titles [bytes], which is the same in all records; 0 until the first title has been read.
        self._title = 0

    def head(self) -> _Head:
        """Read the records up to the first state."""
        run = self._next(RUN)
        version = clean_text(self._next(80))
        hierarchy = self._next()
        # Newer releases write a record with the number of additional records.
        if len(hierarchy) == WIDTH:
            for _ in range(self._count(INT.unpack(hierarchy)[0])):
                self._next()
            hierarchy = self._next()
        if len(hierarchy) != 6 * WIDTH:
            raise self._broken("a record of 6 counts")
        parts, materials, properties, subsets, groups, variables = (
            self._count(n) for n in split_integers(hierarchy)
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
            title=clean_text(run[WIDTH:]),
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
        """Read the parts (id, title, subset, material, property and number of variables) and their variables."""
        described: dict[int, Part] = {}
        columns: dict[tuple[int, str], int] = {}
        values = 0
        for _ in range(count):
            record = self._titled(5)
            id_ = INT.unpack_from(record)[0]
            material, properties, variables = split_integers(record[-3 * WIDTH :])
            codes = self._integers(self._count(variables))
            # An element group with a history is listed like a part, but without a material and a property.
            if material or properties:
                # A solver may write 0 for every variable.
                nonzero_codes = [code for code in codes if code]
                is_repeated = len(set(nonzero_codes)) < len(nonzero_codes)
                if id_ in described or is_repeated:
                    raise self._broken("a part, and a variable of it, only once")
                described[id_] = Part(id_, clean_text(record[WIDTH : -4 * WIDTH]))
                for column, code in enumerate(codes, start=values):
                    if code in _PART_VARIABLES:
                        columns[id_, _PART_VARIABLES[code]] = column
            values += variables
        return tuple(described.values()), columns, values

    def _subset(self) -> int:
        """Skip a subset and its lists of children, parts and variables, and return its number of variables."""
        children, parts, variables = (
            self._count(n)
            for n in split_integers(self._titled(5)[2 * WIDTH : 5 * WIDTH])
        )
        for count in (children, parts, variables):
            self._integers(count)
        return variables

    def _group(self) -> _Group:
        """Read a group with its elements and its list of variables."""
        record = self._titled(5)
        kind, elements, variables = (
            INT.unpack_from(record, WIDTH * word)[0] for word in (1, 3, 4)
        )
        for number in (elements, variables):
            self._count(number)
        members = [self._titled(1) for _ in range(elements)]
        named_members = members if kind == _NODES or kind in _TOUCHING else []
        names = tuple(
            (INT.unpack_from(member)[0], clean_text(member[WIDTH:]))
            for member in named_members
        )
        return _Group(kind, elements, names, self._integers(variables))

    def _titled(self, numbers: int) -> bytes:
        """Read a record that contains a title and the given number of integers."""
        record = self._next(WIDTH * numbers + self._title if self._title else None)
        self._title = len(record) - WIDTH * numbers
        if self._title not in _TITLES:
            raise self._broken("a title")
        return record

    def _integers(self, count: int) -> tuple[int, ...]:
        """Read a record of ``count`` integers. If ``count`` is 0, the file contains no such record."""
        return split_integers(self._next(WIDTH * count)) if count else ()

    def _count(self, number: int) -> int:
        """Return a count from the file; raise FormatError if the file is too short for this count."""
        if not 0 <= number <= self._most:
            raise self._broken("a count")
        return number

    def _next(self, length: int | None = None) -> bytes:
        """Read the next record; raise FormatError if the record is incomplete or has an unexpected length."""
        record = self._records.take()
        if record is None:
            raise self._broken("a complete record")
        if length is not None and len(record) != length:
            raise self._broken(f"a record of {length} bytes")
        return record

    def _broken(self, expected: str) -> FormatError:
        """Return the error for a header whose content is not as expected."""
        at = self._records.at
        problem = f"{self._source}: {expected} was expected in the head of the time history near byte {at}"
        return FormatError(f"{problem}; the file is cut or damaged, copy it again")
