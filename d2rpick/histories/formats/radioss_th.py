"""Radioss and OpenRadioss time histories, T01, T02, ... (one per leg of a run): big-endian Fortran records.

A record is its length, its bytes and its length again.  The head names the run, then says how many parts,
materials, properties, subsets, groups and global variables there are and describes each; every state after
it is a record with the time and one for the global variables, the parts, the subsets and each group, if there
are any.  All states have the same lengths, so a column is a strided view of the file.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.errors import FormatError, listing
from d2rpick.histories.content import Content, content_of
from d2rpick.histories.database import DIGITS, SolverFile
from d2rpick.histories.history import Part
from d2rpick.histories.names import plain_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from d2rpick.histories.history import Samples
    from d2rpick.histories.selection import Selection
    from d2rpick.histories.source import Source

_INT: Final = struct.Struct(">i")
_WIDTH: Final = 4  # bytes of a number, and of the length before and behind a record
_RUN: Final = 84  # bytes of the first record: a code and a title of 80
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


@dataclass(frozen=True)
class _Head:
    """What the records before the first state say."""

    title: str
    version: str
    globals: tuple[str, ...]
    parts: tuple[Part, ...]
    columns: dict[tuple[int, str], int]  # number of a part's variable among those of all parts
    lengths: tuple[int, ...]  # of the records of one state
    size: int


def recognises(head: bytes) -> bool:
    """Whether a file that begins like this is a time history; never raises.

    Examples
    --------
    >>> recognises(bytes([0, 0, 0, 84, 0, 0, 11, 224]) + b"a title"), recognises(b"time,internal energy")
    (True, False)
    """
    return len(head) >= 8 and _INT.unpack_from(head)[0] == _RUN and 3000 <= _INT.unpack_from(head, 4)[0] < 6000


def open_legs(sources: Sequence[Source], _: Selection) -> list[TimeHistory]:
    """Open each file as a leg of the run."""
    return [TimeHistory(source.data, source.name) for source in sources]


class TimeHistory(SolverFile):
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
        If the head is not whole, or a record is not as long as the head says.
    """

    format = "radioss-th"
    digits = DIGITS[_WIDTH]

    def __init__(self, content: bytes | Content, source: str) -> None:
        self._data = content_of(content)
        self.source = source
        self._head = _Records(self._data, source).head()
        self._states, stop = self._whole_states()
        self.complete = not stop
        self.notes = (*stop, *self._silent_parts())

    @property
    def version(self) -> str:
        """Date of the run, program and platform."""
        return self._head.version

    @property
    def title(self) -> str:
        """Title of the run."""
        return self._head.title

    @property
    def channels(self) -> tuple[str, ...]:  # type: ignore[override]
        """Global variables."""
        return self._head.globals

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Parts with variables of their own (card /TH/PART)."""
        known = {id_ for id_, _ in self._head.columns}
        return tuple(part for part in self._head.parts if part.id in known)

    @cached_property
    def time(self) -> Samples:
        """Times of all states, shape (n,) [time]."""
        return self._columns(0, [0])[:, 0]

    def channel(self, name: str) -> Samples:
        """One global variable, shape (n,)."""
        if name not in self._head.globals:
            raise FormatError(f"{self.source}: no global {name}, there are {listing(self._head.globals, most=30)}")
        return self._columns(1, [self._head.globals.index(name)])[:, 0]

    @property
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
        record = 1 + bool(self._head.globals)
        return self._columns(record, [self._place(id_, quantity) for id_ in ids])

    def _place(self, id_: int, quantity: str) -> int:
        place = self._head.columns.get((id_, quantity))
        if place is None:
            known = [name for part, name in self._head.columns if part == id_]
            parts = listing([part.id for part in self.parts]) or "none"
            there = f"only {listing(known)}" if known else f"parts with variables: {parts}"
            raise FormatError(f"{self.source}: no {quantity} of part {id_}, {there}; ask for it with /TH/PART")
        return place

    def _columns(self, record: int, places: Sequence[int]) -> Samples:
        """Some numbers of one record of each state, shape (n, places)."""
        before = sum(length + 2 * _WIDTH for length in self._head.lengths[:record]) + _WIDTH
        found = self._numbers(">f4", [before + _WIDTH * place for place in places], self._states)
        with np.errstate(invalid="ignore"):  # a NaN of any kind is refused, or not used
            return found.astype(np.float64)

    def _numbers(self, dtype: str, offsets: Sequence[int], states: int) -> NDArray[Any]:
        """Numbers at some bytes of each of the first states, shape (states, offsets)."""
        stride = sum(length + 2 * _WIDTH for length in self._head.lengths)
        starts = self._head.size + stride * np.arange(states)
        addresses = np.add.outer(starts, np.array(offsets, np.int64))
        found = self._data.fields(addresses.ravel(), _WIDTH)
        self._data.check()
        return found.view(dtype).reshape(addresses.shape)

    def _whole_states(self) -> tuple[int, tuple[str, ...]]:
        """Count the states; the file may stop inside one, but nothing else may stand between them.

        Records carry no name or number: where one is lost or put in, no state of the file is above suspicion.
        """
        lengths = np.array(self._head.lengths)
        ends = np.cumsum(lengths + 2 * _WIDTH)
        stride = int(ends[-1])
        states, rest = divmod(len(self._data) - self._head.size, stride)
        marks = np.stack([ends - lengths - 2 * _WIDTH, ends - _WIDTH], axis=1).ravel()
        places = np.add.outer(self._head.size + stride * np.arange(states + 1), marks).ravel()
        places = places[places + _WIDTH <= len(self._data)]
        found = self._data.fields(places, _WIDTH).view(">i4").ravel()
        self._data.check()
        bad = np.flatnonzero(found != np.resize(np.repeat(lengths, 2), found.size))
        if bad.size:
            state, mark = divmod(int(bad[0]), marks.size)
            begin = self._head.size + state * stride
            where = f"{self.source}: state {state + 1}: a record of {lengths[mark // 2]} bytes was expected"
            cure = f"if the states before are good, cut the file to {begin} bytes"
            raise FormatError(f"{where} at byte {begin + marks[2 * (mark // 2)]}; {cure}")
        stop = f"{self.source}: the file ends within state {states + 1}, which was left out"
        return states, (stop,) if rest else ()

    def _silent_parts(self) -> tuple[str, ...]:
        silent = [part.id for part in self._head.parts if part not in self.parts]
        if not silent:
            return ()
        which = f"part {silent[0]}" if len(silent) == 1 else f"parts {listing(silent)}"
        return (f"{self.source}: no variables of {which} in the file (card /TH/PART)",)


class _Records:
    """The records of the head, taken one after the other."""

    def __init__(self, data: Content, source: str) -> None:
        self._data = data
        self._source = source
        self._at = 0
        self._title = 0  # bytes of a title, the same in all records; 0 until the first was seen

    def head(self) -> _Head:
        """Read everything up to the first state."""
        run = self._next(_RUN)
        version = plain_text(self._next(80))
        hierarchy = self._next()
        if len(hierarchy) == _WIDTH:  # newer codes put records between, as many as this one says
            for _ in range(self._count(_INT.unpack(hierarchy)[0])):
                self._next()
            hierarchy = self._next()
        if len(hierarchy) != 6 * _WIDTH:
            raise self._broken("a record of 6 counts")
        parts, materials, properties, subsets, groups, variables = (self._count(n) for n in _integers(hierarchy))
        if self._integers(variables) != tuple(range(1, variables + 1)):
            raise self._broken("a numbering of the global variables")
        described, columns, part_values = self._parts(parts)
        for _ in range(materials + properties):
            self._titled(1)
        subset_values = sum(self._subset() for _ in range(subsets))
        values = [1, variables, part_values, subset_values, *(self._group() for _ in range(groups))]
        return _Head(
            title=plain_text(run[_WIDTH:]),
            version=" ".join(version.split()),
            globals=(*_GLOBALS[:variables], *(f"global_{n + 1}" for n in range(len(_GLOBALS), variables))),
            parts=described,
            columns=columns,
            lengths=tuple(_WIDTH * count for count in values if count),
            size=self._at,
        )

    def _parts(self, count: int) -> tuple[tuple[Part, ...], dict[tuple[int, str], int], int]:
        """Parts: id, title, subset, material, property and number of variables; then the variables."""
        described: dict[int, Part] = {}
        columns: dict[tuple[int, str], int] = {}
        values = 0
        for _ in range(count):
            record = self._titled(5)
            id_ = _INT.unpack_from(record)[0]
            material, properties, variables = _integers(record[-3 * _WIDTH :])
            codes = self._integers(self._count(variables))
            # A group of elements with a history is listed like a part, but without material and property.
            if material or properties:
                known_codes = [code for code in codes if code]  # a solver may write 0 for every variable
                if id_ in described or len(set(known_codes)) < len(known_codes):
                    raise self._broken("a part, and a variable of it, only once")
                described[id_] = Part(id_, plain_text(record[_WIDTH : -4 * _WIDTH]))
                known = ((_PART_VARIABLES.get(code), place) for place, code in enumerate(codes, start=values))
                columns.update({(id_, name): place for name, place in known if name})
            values += variables
        return tuple(described.values()), columns, values

    def _subset(self) -> int:
        """Pass over a subset and its lists of children, parts and variables; the number of variables."""
        children, parts, variables = (self._count(n) for n in _integers(self._titled(5)[2 * _WIDTH : 5 * _WIDTH]))
        for count in (children, parts, variables):
            self._integers(count)
        return variables

    def _group(self) -> int:
        """Pass over a group, its elements and its list of variables; the number of values per state."""
        elements, variables = (self._count(n) for n in _integers(self._titled(5)[3 * _WIDTH : 5 * _WIDTH]))
        for _ in range(elements):
            self._titled(1)
        self._integers(variables)
        return elements * variables

    def _titled(self, numbers: int) -> bytes:
        """Read a record of a title and so many integers."""
        record = self._next(_WIDTH * numbers + self._title if self._title else None)
        self._title = len(record) - _WIDTH * numbers
        if self._title not in _TITLES:
            raise self._broken("a title")
        return record

    def _integers(self, count: int) -> tuple[int, ...]:
        """Read a record of so many integers; there is none for 0."""
        return _integers(self._next(_WIDTH * count)) if count else ()

    def _count(self, number: int) -> int:
        """Check a count from the file against what the file could hold."""
        if not 0 <= number <= len(self._data):
            raise self._broken("a count")
        return number

    def _next(self, length: int | None = None) -> bytes:
        """Take one record, of a known length if it is given."""
        begin = self._at + _WIDTH
        found = _INT.unpack(self._data[self._at : begin])[0] if begin <= len(self._data) else -1
        end = begin + found
        if found < 0 or end + _WIDTH > len(self._data) or _INT.unpack(self._data[end : end + _WIDTH])[0] != found:
            raise self._broken("a complete record")
        if length is not None and found != length:
            raise self._broken(f"a record of {length} bytes")
        self._at = end + _WIDTH
        return self._data[begin:end]

    def _broken(self, expected: str) -> FormatError:
        return FormatError(
            f"{self._source}: {expected} was expected in the head of the time history near byte {self._at}; "
            "the file is cut or damaged, copy it again"
        )


def _integers(record: bytes) -> tuple[int, ...]:
    return tuple(number for (number,) in _INT.iter_unpack(record[: len(record) // _WIDTH * _WIDTH]))
