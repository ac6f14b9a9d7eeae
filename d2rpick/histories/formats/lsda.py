"""Read LSDA, the container format of LS-DYNA's binout: directories of typed variables, found by reading all records.

The file begins with the length of its header, the sizes of length, offset, command and type fields, the byte order (1:
little-endian) and the float format. Records follow, each of which consists of a length, a command and a body. A record
is a change of directory (absolute, or relative to the current one), a variable (type, length of the name, name,
values), or a symbol table, which lists the positions of the variables after every flush.

The symbol tables are not used, because they form a chain that is incomplete after a killed run, whereas the records are
complete up to the byte at which the run stopped. Most files repeat a pattern of records at a constant stride, so whole
blocks are compared instead of single records.
"""

from __future__ import annotations

import re
import struct
from array import array
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from d2rpick.base.data_classes import dataclass
from d2rpick.base.errors import CHOOSE_FORMAT, FormatError
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.content import Content, make_content
from d2rpick.histories.formats.blocks import count_repetitions
from d2rpick.histories.resuming import ResumePoint

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

DIRECTORY: Final = 2
VARIABLE: Final = 3
_COMMANDS: Final = range(1, 8)
_TABLES: Final = range(4, 8)  # Record types of symbol tables and of their entries.
_LONGEST: Final = 1 << 32  # Largest length of a symbol table [bytes].

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

# Number of bytes that contain the header, type and name of a variable.
_HEAD: Final = 1 << 9
_AROUND: Final = 1 << 16

# With at least this number of repetitions, comparing arrays is faster than reading the records.
_WORTH: Final = 64

# Pattern of the names of state directories: d and the state number (18 digits fit into an int64).
_STATE: Final = re.compile(rb"(?:^|/)d(\d{1,18})$")


@dataclass(frozen=True)
class Variable:
    """A variable of a directory; its values begin ``offset`` bytes after the start of the directory."""

    offset: int
    dtype: np.dtype[Any]
    count: int


class DirectoryLayout(NamedTuple):
    """The variables of a directory; ``doubled`` contains the names that occur more than once."""

    variables: dict[str, Variable]
    doubled: frozenset[str]


class _Form(NamedTuple):
    """The records of a directory as one integer, which can be compared quickly with those of another directory.

    ``heads`` contains the records without their values. ``fixed`` contains the same bytes at their positions, and
    ``mask`` selects them from ``length`` bytes.
    """

    heads: tuple[bytes, ...]
    length: int
    mask: int
    fixed: int


class _Directory(NamedTuple):
    """A directory that is being read; its records begin at the byte ``start``.

    ``number`` is the number of the state; -1 if the directory is not a state.
    """

    path: tuple[str, ...]
    number: int
    start: int

    @property
    def is_state(self) -> bool:
        """True if the directory contains the values of a state."""
        return self.number >= 0

    @property
    def branch(self) -> str:
        """Path of the parent directory."""
        return "/".join(self.path[:-1])


class Lsda:
    """The directories in one file, found by reading the records of the file.

    Parameters
    ----------
    content : bytes or Content
        Content of the file.
    source : str
        Name of the file, for messages.
    branches : collection of str
        Paths of the directories whose states and variables are wanted; only the names of the others are kept.

    Attributes
    ----------
    visits : dict of str to array of int
        For each wanted branch, every visit to a state directory, in the order of the file: number of the state, byte at
        which its records start, and index in ``layouts``; packed, since there may be a million.
    metadata : dict of str to list of (int, int)
        Start and layout of each visit to the directory ``metadata`` of a wanted branch.
    odd : dict of str to list of str
        Directories of each wanted branch that are neither states nor metadata but contain variables.
    layouts : list of DirectoryLayout
    names : set of str
        All top-level directories.
    stop : str
        Reason why reading stopped before the end of the file; empty if the file was read to its end.
    unfinished : str
        Branch to whose last state the last record belongs, so that further variables of this state may be missing.

    Raises
    ------
    FormatError
        If the file does not begin with an LSDA header.
    """

    def __init__(
        self, content: bytes | Content, source: str, branches: Collection[str]
    ) -> None:
        self.data = make_content(content)
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
        self._begin, self._order, self._head, self._type = _read_lsda_header(
            self.data, source
        )
        self._walk(self._begin)

    def read(self, positions: NDArray[np.int64], dtype: np.dtype[Any]) -> NDArray[Any]:
        """Return the values at any byte positions of the file, in the shape of ``positions``."""
        fields = self.data.fields(positions.ravel(), dtype.itemsize)
        self.data.check()
        return np.asarray(fields.view(dtype).reshape(positions.shape))

    def states(self, branch: str) -> NDArray[np.int64]:
        """Return the number, start and layout of each state of a branch, in file order, shape (n, 3)."""
        return np.array(self.visits[branch], np.int64).reshape(-1, 3)

    def find_resume_point(self, branches: Collection[str]) -> ResumePoint:
        """Return the position at which a later read can begin: the earliest second-to-last state of all branches.

        Its header repeats the metadata of all wanted branches, each after a change to its directory.
        """
        head = self.data[: self._begin]
        for branch, visits in self.metadata.items():
            for start, layout in visits:
                values = self.layouts[layout].variables.values()
                size = max(
                    variable.offset + variable.count * variable.dtype.itemsize
                    for variable in values
                )
                head += self._make_change(f"/{branch}/metadata")
                head += self.data[start : start + size]
        earliest = None
        for branch in branches:
            last_states = self.states(branch)[-2:]
            if len(last_states):
                number, start, _ = last_states[0].tolist()
                if earliest is None or start < earliest[0]:
                    earliest = start, f"/{branch}/d{number:06d}"
        if earliest is None:
            return ResumePoint(self.data[: self._begin], self._begin, len(self.data))
        begin, directory = earliest
        return ResumePoint(head + self._make_change(directory), begin, len(self.data))

    def _make_change(self, path: str) -> bytes:
        """Return the record that changes to the directory with an absolute path."""
        text = path.encode()
        return self._head.pack(self._head.size + len(text), DIRECTORY) + text

    def raw(self, start: int, variable: Variable) -> bytes:
        """Return the bytes of a variable in the directory that starts at byte ``start``."""
        begin = start + variable.offset
        return self.data[begin : begin + variable.count * variable.dtype.itemsize]

    def _walk(self, position: int) -> None:
        """Read the records after a byte offset, and collect the requested directories."""
        data = self.data
        unpack = self._head.unpack_from
        head = self._head.size
        size, name_length = len(data), head + self._type.size
        # Bytes around the current position, and the position of the first of these bytes.
        near, base = b"", 0
        directory = _Directory((), -1, position)
        records = list[bytes]()
        command = 0
        # Start of the last state of each branch, keyed by branch path.
        anchors: dict[tuple[str, ...], int] = {}
        heads: set[bytes] = set()
        while position + head <= size:
            at = position - base
            if at + _HEAD > len(near):
                near = data[position : position + _AROUND]
                base = position
                at = 0
            length, command = unpack(near, at)
            end = position + length
            if length < head or end > size or command not in _COMMANDS:
                break
            heads.add(near[at : at + head])
            if command == DIRECTORY:
                self._leave(directory, records)
                records = []
                entered = self._enter(directory.path, position + head, end)
                if entered is None:
                    break
                if entered.is_state:
                    branch = entered.path[:-1]
                    ahead = self._skip(anchors.get(branch), position)
                    if ahead:
                        anchors.clear()
                        position += ahead
                        continue
                    anchors[branch] = position
                directory = entered
                self.names.update(directory.path[:1])
                form = self._same_again(directory)
                if form:
                    records = list(form.heads)
                    command = VARIABLE
                    end = directory.start + form.length
            elif command == VARIABLE and length > name_length:
                name_end = at + name_length + 1 + near[at + name_length]
                records.append(near[at : min(at + length, name_end)])
            else:
                records.append(near[at : at + head])
            position = end
        if position < size:
            self.stop = f"no complete record at byte {position} of {size}"
            if not self._goes_on(data[position : position + head], heads):
                records = records[:-1]
        self._leave(directory, records)
        if directory.is_state and (self.stop or command == VARIABLE):
            self.unfinished = directory.branch

    def _enter(self, path: tuple[str, ...], begin: int, end: int) -> _Directory | None:
        """Return the directory that a record enters from ``path``; None if the record contains no valid name."""
        text = self.data[begin:end]
        if not text.isascii() or not text.decode().isprintable():
            return None
        state = _STATE.search(text)
        number = int(state[1]) if state else -1
        return _Directory(_resolve_path(path, text.decode()), number, end)

    def _goes_on(self, last_bytes: bytes, heads: set[bytes]) -> bool:
        """Return True if the file was truncated within the record ``last_bytes``; False if this record is damaged.

        The truncated record must have the head of the corresponding record of the last state; symbol tables are not
        compared, because they differ from each other.
        """
        if any(head.startswith(last_bytes) for head in heads):
            return True
        length, command = self._head.unpack(last_bytes.ljust(self._head.size, b"\0"))
        return command in _TABLES and length < _LONGEST

    def _leave(self, directory: _Directory, records: list[bytes]) -> None:
        """Store the variables of the directory that ends here, if the directory was requested."""
        while records and self._head.unpack_from(records[-1])[1] != VARIABLE:
            records.pop()  # A symbol table after the variables is not part of the layout.
        branch = directory.branch
        if not records or branch not in self.visits:
            return
        key = tuple(records)
        layout = self._known.get(key)
        if layout is None:
            layout = self._known[key] = len(self.layouts)
            self.layouts.append(self._layout(records))
        if directory.is_state:
            self.visits[branch].extend((directory.number, directory.start, layout))
            if self._forms.get(branch, (-1,))[0] != layout:
                self._forms[branch] = layout, self._form(key)
        elif directory.path[-1] == "metadata":
            self.metadata[branch].append((directory.start, layout))
        else:
            self.odd[branch].append(directory.path[-1])

    def _layout(self, records: list[bytes]) -> DirectoryLayout:
        """Return the variables that the record headers of a directory define; an invalid header defines none."""
        variables: dict[str, Variable] = {}
        doubled = set()
        offset = 0
        for record in records:
            length, command = self._head.unpack_from(record)
            begin = self._head.size + self._type.size + 1
            if command == VARIABLE and len(record) > begin:
                (code,) = self._type.unpack_from(record, self._head.size)
                name = record[begin:].decode("latin-1")
                values = length - len(record)
                dtype = np.dtype(self._order + _TYPES.get(code, "V1"))
                is_whole = name.isprintable() and len(name) == record[begin - 1]
                if code in _TYPES and is_whole and values % dtype.itemsize == 0:
                    doubled.update({name} & variables.keys())
                    variables[name] = Variable(
                        offset + len(record), dtype, values // dtype.itemsize
                    )
            offset += length
        return DirectoryLayout(variables, frozenset(doubled))

    def _form(self, heads: tuple[bytes, ...]) -> _Form:
        """Return the layout of a directory whose records have these headers."""
        mask, fixed = bytearray(), bytearray()
        for head in heads:
            values = bytes(self._head.unpack_from(head)[0] - len(head))
            mask += b"\xff" * len(head) + values
            fixed += head + values
        return _Form(heads, len(mask), int.from_bytes(mask), int.from_bytes(fixed))

    def _same_again(self, directory: _Directory) -> _Form | None:
        """Return the layout of the branch's last state if the current state has the same records; otherwise None."""
        if not directory.is_state or directory.branch not in self._forms:
            return None
        form = self._forms[directory.branch][1]
        end = directory.start + form.length
        block = int.from_bytes(self.data[directory.start : end])
        if end <= len(self.data) and block & form.mask == form.fixed:
            return form
        return None

    def _skip(self, previous: int | None, position: int) -> int:
        """Return how many bytes can be skipped because they repeat the records before ``position``; store their states.

        The last repetition is not skipped, because the records after it must be read one by one.
        """
        if previous is None or not self._alike(previous, position):
            return 0
        for metadata in self.metadata.values():
            if metadata and metadata[-1][0] > previous:
                return 0
        stride = position - previous
        fixed, numbers = self._pattern(previous, position)
        times, steps = count_repetitions(self.data, previous, fixed, numbers)
        if times < 2:
            return 0
        # A state number ends its record, so the records of the state start at the next byte.
        growth = {
            previous + at + width: step
            for (at, width), step in zip(numbers, steps, strict=True)
        }
        ahead = np.arange(1, times)[:, None, None]
        for visits in self.visits.values():
            if not visits:  # The file does not contain this branch.
                continue
            last_visits = np.array(visits[-3 * len(growth) :]).reshape(-1, 3)
            repeated = last_visits[np.isin(last_visits[:, 1], [*growth])]
            steps_of_visits = np.array(
                [[growth[start], stride, 0] for start in repeated[:, 1].tolist()],
                np.int64,
            ).reshape(-1, 3)
            visits.frombytes((repeated + ahead * steps_of_visits).tobytes())
        return (times - 1) * stride

    def _alike(self, previous: int, position: int) -> bool:
        """Compare records that are one stride apart; return True if a search for repetitions is worthwhile."""
        head = self._head.size
        stride = position - previous
        first = self.data[previous : previous + head]
        ahead = range(position, position + _WORTH * stride, stride)
        return all(self.data[start : start + head] == first for start in ahead)

    def _pattern(
        self, begin: int, end: int
    ) -> tuple[NDArray[np.uint8], list[tuple[int, int]]]:
        """Return an array that is 255 for the bytes of record headers, and the positions of the state numbers."""
        fixed = np.zeros(end - begin, dtype=np.uint8)
        numbers = []
        block = self.data[begin:end]
        head = self._head.size
        position = begin
        while position < end:
            at = position - begin
            length, command = self._head.unpack_from(block, at)
            structure = head
            if command == DIRECTORY:
                structure = length
            elif command == VARIABLE and length > head + self._type.size:
                name_length = block[at + head + self._type.size]
                structure = head + self._type.size + 1 + name_length
            fixed[at : at + min(structure, length)] = 0xFF
            if command == DIRECTORY:
                state = _STATE.search(block[at + head : at + length])
                if state:
                    numbers.append((at + head + state.start(1), len(state[1])))
                    fixed[at + head + state.start(1) : at + length] = 0
            position += length
        return fixed, numbers


def _read_lsda_header(
    data: Content, source: str
) -> tuple[int, str, struct.Struct, struct.Struct]:
    """Return the offset of the first record, the byte order, and the formats of record headers and type codes."""
    header = data[:8]
    if not recognises(header):
        raise FormatError(
            f"{source}: this is not a binout, because its header is missing; {CHOOSE_FORMAT}"
        )
    begin, length, _, command, type_id, little = header[:6]
    order = "<" if little else ">"
    head = struct.Struct(order + _FIELDS[length] + _FIELDS[command])
    return begin, order, head, struct.Struct(order + _FIELDS[type_id])


def recognises(head: bytes) -> bool:
    """Return True if a file with these first bytes is an LSDA container. This function never raises.

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


def _resolve_path(path: tuple[str, ...], change: str) -> tuple[str, ...]:
    """Return the path that results from a change of directory.

    Examples
    --------
    >>> _resolve_path(("glstat", "metadata"), "../d000001"), _resolve_path(("glstat",), "/matsum/metadata")
    (('glstat', 'd000001'), ('matsum', 'metadata'))
    """
    names = [] if change.startswith("/") else list(path)
    for name in change.split("/"):
        if name == "..":
            del names[-1:]
        elif name not in ("", "."):
            names.append(name)
    return tuple(names)
