"""LSDA, the container of LS-DYNA's binout: directories of typed variables, found by walking the records.

The file begins with its own header length, the sizes of length, offset, command and type fields, the byte
order (1: little-endian) and the float format.  Then follow records, each of length, command and body:

* a change of directory, absolute or relative to the last one;
* a variable: its type, the length of its name, the name, the values;
* symbol tables, which repeat after every flush where the variables lie.

The symbol tables are not used.  They are a chain that a killed run leaves broken, while the records
themselves are whole up to the byte where the run stopped.  Most files repeat one pattern of records at a
constant stride; `repeat` checks that by whole blocks instead of record by record.
"""

from __future__ import annotations

import re
import struct
from array import array
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.errors import FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.content import Content, content_of
from d2rpick.histories.formats.blocks import repeats

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

DIRECTORY: Final = 2
VARIABLE: Final = 3
_COMMANDS: Final = range(1, 8)
_TABLES: Final = range(4, 8)  # symbol tables and what is in them
_LONGEST: Final = 1 << 32  # bytes that no symbol table has

_FIELDS: Final = {1: "B", 2: "H", 4: "I", 8: "Q"}
_TYPES: Final = {
    1: "i1",
    2: "i2",
    3: "i4",
    4: "i8",
    5: "u1",
    6: "u2",
    7: "u4",
    8: "u8",
    9: "f4",
    10: "f8",
}

# Head, type and name of a variable are not longer than this; more around them is read with them.
_HEAD: Final = 1 << 9
_AROUND: Final = 1 << 16

# Fewer repetitions than these are walked faster than they are compared by arrays.
_WORTH: Final = 64

# Directories of states end in d and the number of the state, with at least 6 digits; 18 fit an int64.
_STATE: Final = re.compile(rb"(?:^|/)d(\d{1,18})$")


@dataclass(frozen=True)
class Variable:
    """Where the values of a variable lie, ``offset`` bytes behind the start of its directory."""

    offset: int
    dtype: np.dtype[Any]
    count: int


class DirectoryLayout(NamedTuple):
    """The variables of a directory; ``doubled`` are the names that stand in it more than once."""

    variables: dict[str, Variable]
    doubled: frozenset[str]


class _Form(NamedTuple):
    """All bytes of a directory's records as one integer, to find the same records again at once.

    ``heads`` are the records without their values; ``fixed`` are those bytes in their places, ``mask``
    selects them from ``length`` bytes.
    """

    heads: tuple[bytes, ...]
    length: int
    mask: int
    fixed: int


class Lsda:
    """The directories of one file, as a walk over its records finds them.

    Parameters
    ----------
    content : bytes or Content
        The whole file.
    source : str
        Name of the file, for messages.
    branches : collection of str
        Directories of states whose variables are wanted, by their paths; of the others only the names are kept.

    Attributes
    ----------
    visits : dict of str to array of int
        Every time the file enters a numbered directory of each wanted branch, in the order of the file: the number of
        the state, the byte where its records start, and which of ``layouts`` it has; packed, there may be a million.
    metadata : dict of str to list of (int, int)
        Start and layout of each visit to the directory ``metadata`` of a wanted branch.
    odd : dict of str to list of str
        Other directories of each wanted branch that hold variables.
    layouts : list of DirectoryLayout
    names : set of str
        All top-level directories.
    stop : str
        Why the walk ended before the end of the file; empty when it did not.
    unfinished : str
        The branch in whose last state the records end, so that more variables may have been meant to follow.

    Raises
    ------
    FormatError
        If the file does not begin with an LSDA header.
    """

    def __init__(
        self, content: bytes | Content, source: str, branches: Collection[str]
    ) -> None:
        self.data = content_of(content)
        self.source = source
        self.visits = {branch: array("q") for branch in branches}
        self.metadata: dict[str, list[tuple[int, int]]] = {
            branch: [] for branch in branches
        }
        self.odd: dict[str, list[str]] = {branch: [] for branch in branches}
        self.layouts: list[DirectoryLayout] = []
        self.names: set[str] = set()
        self.stop = self.unfinished = ""
        self._known: dict[tuple[bytes, ...], int] = {}
        self._forms: dict[str, tuple[int, _Form]] = {}
        begin, self._order, self._head, self._type = _header(self.data, source)
        self._walk(begin)

    def read(self, positions: NDArray[np.int64], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Values at any bytes of the file, in the shape of ``positions``."""
        found = self.data.fields(positions.ravel(), dtype.itemsize)
        self.data.check()
        return np.asarray(found.view(dtype).reshape(positions.shape))

    def states(self, branch: str) -> NDArray[np.int64]:
        """Number, start and layout of each visit to a state of a branch, shape (n, 3)."""
        return np.array(self.visits[branch], np.int64).reshape(-1, 3)

    def raw(self, start: int, variable: Variable) -> bytes:
        """Bytes of one variable in the directory that starts at byte ``start``."""
        begin = start + variable.offset
        return self.data[begin : begin + variable.count * variable.dtype.itemsize]

    def _walk(self, position: int) -> None:
        data, unpack, head = self.data, self._head.unpack_from, self._head.size
        size, name_length = len(data), head + self._type.size
        near, base = b"", 0  # the bytes around the position
        path: tuple[str, ...] = ()
        number, start, records, command = -1, position, list[bytes](), 0
        anchors: dict[
            tuple[str, ...], int
        ] = {}  # where the last state of each branch began
        heads: set[bytes] = set()
        while position + head <= size:
            at = position - base
            if at + _HEAD > len(near):
                near, base, at = data[position : position + _AROUND], position, 0
            length, command = unpack(near, at)
            end = position + length
            if length < head or end > size or command not in _COMMANDS:
                break
            heads.add(near[at : at + head])
            if command == DIRECTORY:
                self._leave(path, number, start, records)
                records = []
                text = data[position + head : end]
                if not text.isascii() or not text.decode().isprintable():
                    break
                entered = _resolved(path, text.decode())
                state = _STATE.search(text)
                if state:
                    branch = entered[:-1]
                    ahead = self._skip(anchors.get(branch), position)
                    if ahead:
                        anchors.clear()
                        position += ahead
                        continue
                    anchors[branch] = position
                path, number, start = entered, int(state[1]) if state else -1, end
                self.names.update(path[:1])
                form = self._same_again(path, start) if state else None
                if form:
                    records, command = list(form.heads), VARIABLE
                    end = start + form.length
            elif command == VARIABLE and length > name_length:
                records.append(
                    near[
                        at : min(
                            at + length, at + name_length + 1 + near[at + name_length]
                        )
                    ]
                )
            else:
                records.append(near[at : at + head])
            position = end
        if position < size and not self._goes_on(
            data[position : position + head], heads
        ):
            records = records[:-1]
        self._leave(path, number, start, records)
        if position < size:
            self.stop = f"no complete record at byte {position} of {size}"
        if number >= 0 and (self.stop or command == VARIABLE):
            self.unfinished = "/".join(path[:-1])

    def _goes_on(self, rest: bytes, heads: set[bytes]) -> bool:
        """Whether the file was cut in the record that begins so; else bytes are lost or too many in the one before.

        Records of a state are as long as those of the last one, but no symbol table is like another.
        """
        if any(known.startswith(rest) for known in heads):
            return True
        length, command = self._head.unpack(rest.ljust(self._head.size, b"\0"))
        return command in _TABLES and length < _LONGEST

    def _leave(
        self, path: tuple[str, ...], number: int, start: int, records: list[bytes]
    ) -> None:
        """Keep what the directory that is now left held, if it is wanted."""
        while records and self._head.unpack_from(records[-1])[1] != VARIABLE:
            records.pop()  # a symbol table behind the variables is no part of their layout
        branch = "/".join(path[:-1])
        if not records or branch not in self.visits:
            return
        key = tuple(records)
        layout = self._known.get(key)
        if layout is None:
            layout = self._known[key] = len(self.layouts)
            self.layouts.append(self._layout(records))
        if number >= 0:
            self.visits[branch].extend((number, start, layout))
            if self._forms.get(branch, (-1,))[0] != layout:
                self._forms[branch] = layout, self._form(key)
        elif path[-1] == "metadata":
            self.metadata[branch].append((start, layout))
        else:
            self.odd[branch].append(path[-1])

    def _layout(self, records: list[bytes]) -> DirectoryLayout:
        """Sort out the heads of a directory's records; one that makes no sense holds no variable."""
        variables: dict[str, Variable] = {}
        doubled = set()
        offset = 0
        for record in records:
            length, command = self._head.unpack_from(record)
            begin = self._head.size + self._type.size + 1
            if command == VARIABLE and len(record) > begin:
                (code,) = self._type.unpack_from(record, self._head.size)
                name, values = record[begin:].decode("latin-1"), length - len(record)
                dtype = np.dtype(self._order + _TYPES.get(code, "V1"))
                whole = name.isprintable() and len(name) == record[begin - 1]
                if code in _TYPES and whole and values % dtype.itemsize == 0:
                    doubled.update({name} & variables.keys())
                    variables[name] = Variable(
                        offset + len(record), dtype, values // dtype.itemsize
                    )
            offset += length
        return DirectoryLayout(variables, frozenset(doubled))

    def _form(self, heads: tuple[bytes, ...]) -> _Form:
        mask, fixed = bytearray(), bytearray()
        for head in heads:
            values = bytes(self._head.unpack_from(head)[0] - len(head))
            mask += b"\xff" * len(head) + values
            fixed += head + values
        return _Form(heads, len(mask), int.from_bytes(mask), int.from_bytes(fixed))

    def _same_again(self, path: tuple[str, ...], start: int) -> _Form | None:
        """Look whether a state has the records of the last one of its branch."""
        branch = "/".join(path[:-1])
        if branch not in self._forms:
            return None
        form = self._forms[branch][1]
        block = int.from_bytes(self.data[start : start + form.length])
        return (
            form
            if start + form.length <= len(self.data) and block & form.mask == form.fixed
            else None
        )

    def _skip(self, previous: int | None, position: int) -> int:
        """Bytes to go on when the records from ``previous`` to ``position`` repeat; their states are kept.

        The last repetition is left to the walk, which then goes on as if it had come there by itself.
        """
        if previous is None or not self._alike(previous, position):
            return 0
        if any(known and known[-1][0] > previous for known in self.metadata.values()):
            return 0
        stride = position - previous
        fixed, numbers = self._pattern(previous, position)
        times, steps = repeats(self.data, previous, fixed, numbers)
        if times < 2:
            return 0
        # A number ends its record: the next byte is where the state's records start.
        growth = {
            previous + at + width: step
            for (at, width), step in zip(numbers, steps, strict=True)
        }
        ahead = np.arange(1, times)[:, None, None]
        for visits in filter(
            None, self.visits.values()
        ):  # a branch that is not there has none
            known = np.array(visits[-3 * len(growth) :]).reshape(-1, 3)
            repeated = known[np.isin(known[:, 1], [*growth])]
            more = [[growth[start], stride, 0] for start in repeated[:, 1].tolist()]
            visits.frombytes(
                (repeated + ahead * np.array(more, np.int64).reshape(-1, 3)).tobytes()
            )
        return (times - 1) * stride

    def _alike(self, previous: int, position: int) -> bool:
        """Whether it is worth to look for repetitions: a cheap look at heads one stride apart."""
        head, stride = self._head.size, position - previous
        first = self.data[previous : previous + head]
        ahead = range(position, position + _WORTH * stride, stride)
        return all(self.data[place : place + head] == first for place in ahead)

    def _pattern(
        self, begin: int, end: int
    ) -> tuple[NDArray[np.uint8], list[tuple[int, int]]]:
        """Which bytes from one record to another are structure, and where states are numbered."""
        fixed = np.zeros(end - begin, dtype=np.uint8)
        numbers = []
        block = self.data[begin:end]
        head, position = self._head.size, begin
        while position < end:
            at = position - begin
            length, command = self._head.unpack_from(block, at)
            kept = head
            if command == DIRECTORY:
                kept = length
            elif command == VARIABLE and length > head + self._type.size:
                kept = head + self._type.size + 1 + block[at + head + self._type.size]
            fixed[at : at + min(kept, length)] = 0xFF
            if command == DIRECTORY:
                state = _STATE.search(block[at + head : at + length])
                if state:
                    numbers.append((at + head + state.start(1), len(state[1])))
                    fixed[at + head + state.start(1) : at + length] = 0
            position += length
        return fixed, numbers


def _header(
    data: Content, source: str
) -> tuple[int, str, struct.Struct, struct.Struct]:
    """Where the records begin, the byte order, how a record begins and how a type is written."""
    header = data[:8]
    if not recognises(header):
        found = f"{source}: begins with {header.hex(' ')}, the header of a binout was expected"
        raise FormatError(f"{found}; name another file")
    begin, length, _, command, type_id, little = header[:6]
    order = "<" if little else ">"
    head = struct.Struct(order + _FIELDS[length] + _FIELDS[command])
    return begin, order, head, struct.Struct(order + _FIELDS[type_id])


def recognises(head: bytes) -> bool:
    """Whether a file that begins like this is an LSDA container; never raises.

    Examples
    --------
    >>> recognises(bytes([8, 8, 8, 1, 1, 1, 0, 0])), recognises(b" LS-DYNA keyword deck")
    (True, False)
    """
    return (
        len(head) >= 8
        and 8 <= head[0] <= 64
        and all(n in _FIELDS for n in head[1:5])
        and head[5] <= 1
        and not head[6]
    )


def _resolved(path: tuple[str, ...], change: str) -> tuple[str, ...]:
    """Directory that a change of directory leads to.

    Examples
    --------
    >>> _resolved(("glstat", "metadata"), "../d000001"), _resolved(("glstat",), "/matsum/metadata")
    (('glstat', 'd000001'), ('matsum', 'metadata'))
    """
    names = [] if change.startswith("/") else list(path)
    for name in change.split("/"):
        if name == "..":
            del names[-1:]
        elif name not in ("", "."):
            names.append(name)
    return tuple(names)
