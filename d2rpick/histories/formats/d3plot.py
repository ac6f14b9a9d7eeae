"""Read d3plot and d3thdt of LS-DYNA: energies, velocities and masses of the model and its parts in each state.

A run writes a family of files. The first file, d3plot, contains the header, the geometry and possibly states; d3plot01,
d3plot02 and so on contain only complete states. A state contains its time, the values of the model and of the parts,
and then those of the nodes and elements, which are the largest part and are skipped. The files of a family are
recognised by their names, because only the first file has a header; a restart may skip numbers.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import FormatError, list_names
from d2rpick.base.tuples import NamedTuple
from d2rpick.histories.contact_forces import ContactForce
from d2rpick.histories.content import make_content
from d2rpick.histories.database import DIGITS, Database
from d2rpick.histories.formats.d3plot_head import GLOBALS, Head, read_d3plot_head
from d2rpick.histories.formats.d3plot_words import END, detect_family
from d2rpick.histories.names import number_in_family

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from numpy.typing import NDArray

    from d2rpick.histories.content import Content
    from d2rpick.histories.history import Samples
    from d2rpick.histories.names import Selection
    from d2rpick.histories.source import Source

    Rows = NDArray[np.floating[Any]]

# Values of the whole model, in the order in which they follow the time in a state.
_MODEL: Final = (
    "kinetic_energy",
    "internal_energy",
    "total_energy",
    "x_velocity",
    "y_velocity",
    "z_velocity",
)
_FIRST_OF_PARTS: Final = 1 + GLOBALS
# Number of values that precede each quantity in the data of a part.
_OF_PARTS: Final = {
    "internal_energy": 0,
    "kinetic_energy": 1,
    "mass": 5,
    "hourglass_energy": 6,
}
_VELOCITY: Final = 2
_VELOCITIES: Final = ("x_rbvelocity", "y_rbvelocity", "z_rbvelocity")
_MOMENTA: Final = ("x_momentum", "y_momentum", "z_momentum")
_WALL: Final = "rigid_wall_{}_force"
# Number of bytes at the end of a file within which the end mark is expected.
_TAIL: Final = 1 << 16


def recognises(head: bytes) -> bool:
    """Return True if these first bytes belong to a d3plot or d3part. This function never raises."""
    return detect_family(head) in ("d3plot", "d3part")


def open_legs(sources: Sequence[Source], _: Selection) -> list[D3plot]:
    """Open each file family as a restart segment of the run. Only the first file of a family has a header."""
    families: dict[str, dict[int, Source]] = {source.name: {} for source in sources}
    for source in sources:
        first = source.name.rstrip("0123456789")
        number = number_in_family(source.name, first)
        if first in families and number is not None:
            families[first][number] = source
            del families[source.name]
    return [
        D3plot(source, families[source.name])
        for source in sources
        if source.name in families
    ]


class _States(NamedTuple):
    """First words of the states of a family, ``rows`` (n, values); ``ended`` is True if every file has an end mark."""

    rows: Rows
    ended: bool = True
    notes: tuple[str, ...] = ()


class D3plot(Database):
    """One file family as a `Database`; the parts and the whole model have the same times.

    Raises FormatError if the head cannot be read, or if the states do not match it.
    """

    format = "d3plot"

    def __init__(self, first: Source, other_files: Mapping[int, Source]) -> None:
        files = [first, *(other_files[number] for number in sorted(other_files))]
        self._head = head = read_d3plot_head(make_content(first.data), first.name)
        self.source = first.name
        if len(files) > 1:
            self.source = f"{first.name} and {len(files) - 1} files after it"
        states = _read_states(files, head)
        self._rows = states.rows
        self.title, self.version, self.parts, self.no_parts = (
            head.title,
            head.version,
            head.parts,
            head.no_parts,
        )
        self.digits = DIGITS[head.form.width]
        walls = [_WALL.format(number) for number in range(1, head.walls + 1)]
        self.channels = (*_MODEL, *walls)
        missing = _note_missing_files(first.name, sorted(other_files))
        self.complete = not missing and states.ended
        self.notes = (*missing, *states.notes)

    @cached_property
    def time(self) -> Samples:
        """Times of all states, shape (n,) [time]."""
        return self._column(0)

    @cached_property
    def part_time(self) -> Samples:
        """Times of all states, shape (n,) [time]."""
        return self.time

    def channel(self, name: str) -> Samples:
        """Return a value of the whole model, or the force of a rigid wall, shape (n,)."""
        if name not in self.channels:
            raise FormatError(
                f"{self.source}: no {name}, there are {list_names(self.channels)}; ask for one of these"
            )
        index = self.channels.index(name)
        # In a state, the forces of rigid walls follow the values of the parts.
        of_parts = self._head.part_values * len(self.parts) if index >= GLOBALS else 0
        return self._column(1 + index + of_parts)

    @property
    def contact_forces(self) -> tuple[ContactForce, ...]:
        """Rigid-wall forces; a d3plot contains no contact forces."""
        walls = self.channels[GLOBALS:]
        return tuple(
            ContactForce.of_forces(
                f"rigid wall {number}",
                self.time,
                np.outer(self.channel(name), np.array([1.0, 0.0, 0.0])),
            )
            for number, name in enumerate(walls, start=1)
        )

    def part_channel(self, quantity: str, ids: Sequence[int]) -> Samples:
        """Return a quantity of the given parts, shape (n, len(ids)); a momentum is computed as mass times velocity.

        Raises
        ------
        FormatError
            If the file does not contain a part, or a part does not have this quantity.
        """
        if not self.parts:
            raise FormatError(self.no_parts)
        index_of = {part.id: index for index, part in enumerate(self.parts)}
        if missing := [id_ for id_ in ids if id_ not in index_of]:
            problem = f"{self.source}: no part {list_names(missing)}"
            raise FormatError(f"{problem}; choose from {list_names(list(index_of))}")
        indices = np.array([index_of[id_] for id_ in ids], np.intp)
        if quantity in _MOMENTA:
            velocity = self.part_channel(_VELOCITIES[_MOMENTA.index(quantity)], ids)
            return velocity * self.part_channel("mass", ids)
        values_before = _OF_PARTS.get(quantity, self._head.part_values)
        if quantity in _VELOCITIES:
            values_before = _VELOCITY
            indices = 3 * indices + _VELOCITIES.index(quantity)
        if values_before >= self._head.part_values:
            raise FormatError(
                f"{self.source}: no {quantity} of parts in its states; ask for another"
            )
        columns = _FIRST_OF_PARTS + values_before * len(self.parts) + indices
        return self._rows[:, columns].astype(np.float64)

    def _column(self, index: int) -> Samples:
        """Return one word of every state as doubles, shape (n,)."""
        return self._rows[:, index].astype(np.float64)


def _read_states(files: Sequence[Source], head: Head) -> _States:
    """Read the first words of all states of a family. In the first file, the states follow the header."""
    real = head.form.real
    values = 1 + head.globals
    contents = [make_content(file.data) for file in files]
    begins = [head.begin] + [0] * (len(files) - 1)
    counts = [
        max(0, len(content) - begin) // head.state
        for content, begin in zip(contents, begins, strict=True)
    ]
    # Cumulative number of states at the end of each file.
    ends = np.cumsum(counts).tolist()
    heads = np.empty((ends[-1], values * real.itemsize), np.uint8)
    first_words_after = [
        content.fill_rows(heads[end - count : end], begin, head.state, real.itemsize)
        for content, begin, end, count in zip(
            contents, begins, ends, counts, strict=True
        )
    ]
    for content in contents:
        content.check()
    rows = heads.view(real)
    first_is_empty = not counts[0] and _is_blank(
        contents[0], begins[0], len(contents[0]) - begins[0]
    )
    end_mark = np.array(END, real).tobytes()
    if (
        first_is_empty
        and set(first_words_after[1:]) == {end_mark}
        and _is_ascending(rows[:, 0], ends)
    ):
        # If every file is complete, as is usual, the files are not checked one by one.
        return _States(rows)
    states_of_files = []
    for file, begin, piece, word in zip(
        files, begins, np.split(rows, ends[:-1]), first_words_after, strict=True
    ):
        states_of_files.append(_check_states(file, head, begin, piece, word))
    notes = tuple(note for states in states_of_files for note in states.notes)
    return _States(
        np.concatenate([states.rows for states in states_of_files]),
        all(states.ended for states in states_of_files),
        notes,
    )


def _is_ascending(time: NDArray[np.floating[Any]], ends: Sequence[int]) -> bool:
    """Return True if times are finite and ascend in each file; ``ends`` (files,) are cumulative state counts."""
    with np.errstate(invalid="ignore"):
        ascends = np.diff(time) > 0
    # After a restart, a file may begin with a state that is also in an earlier file.
    ascends[[end - 1 for end in ends if 0 < end < time.size]] = True
    return bool(ascends.all() and np.isfinite(time).all() and (time != END).all())


def _check_states(
    file: Source, head: Head, begin: int, rows: Rows, word_after: bytes
) -> _States:
    """Return the states of one file up to its end mark; ``word_after`` is the word after the last complete state."""
    content = make_content(file.data)
    name = file.name
    ends = np.flatnonzero(rows[:, 0] == END)
    if ends.size:
        rows = rows[: ends[0]]
    end = begin + head.state * len(rows)
    while len(rows) and _is_blank(content, end - head.state, head.state):
        rows = rows[:-1]
        end = end - head.state
    ended = bool(ends.size) or word_after == np.array(END, head.form.real).tobytes()
    if begin and not len(rows) and _is_blank(content, begin, len(content) - begin):
        ended = True  # The states begin in the next file of this family.
    if not ended:
        _refuse_other_states(content, name, head, begin)
    time = rows[:, 0]
    with np.errstate(invalid="ignore"):
        is_wrong = ~(np.diff(time, prepend=-np.inf) > 0) | ~np.isfinite(time)
    if is_wrong.any():
        first = int(np.argmax(is_wrong))
        where = begin + head.state * first
        problem = f"{name}: a state was expected at byte {where}, with a time above that of the state before"
        raise FormatError(
            f"{problem}, not {time[first]:g}; the file is damaged, copy it again"
        )
    return _States(
        rows, ended, () if ended else (_note_cut_file(content, name, end, rows),)
    )


def _note_cut_file(content: Content, name: str, end: int, rows: Rows) -> str:
    """Return the note on a file without an end mark at its end."""
    if end < len(content):
        return f"{name}: the file ends within state {len(rows) + 1}, which was left out; is the run still writing?"
    return (
        f"{name}: the file ends without the mark of its end; is the run still writing?"
    )


def _is_blank(content: Content, begin: int, size: int) -> bool:
    """Return True if a range of a file contains only zeros, which solvers use to pad a file."""
    return not content[begin : begin + min(size, _TAIL)].strip(b"\0")


def _refuse_other_states(content: Content, name: str, head: Head, begin: int) -> None:
    """Raise FormatError if the end mark of a file lies inside a state, which shows that the state length is wrong."""
    first = max(begin, len(content) - _TAIL)
    tail = content[first : len(content)]
    mark = np.array(END, head.form.real).tobytes()
    at = tail.rfind(mark)
    if at >= 0 and not tail[at + len(mark) :].strip(b"\0"):
        problem = (
            f"{name}: its states are {first + at - begin} bytes together, one of "
            f"{head.state} bytes each by the head"
        )
        cure = "that layout is not known; name the glstat, matsum or binout of the run"
        raise FormatError(f"{problem}; {cure}")


def _note_missing_files(first: str, numbers: Sequence[int]) -> tuple[str, ...]:
    """Return a note on gaps in the file numbers of a family."""
    gaps = [
        (low + 1, high - 1) for low, high in pairwise([0, *numbers]) if high > low + 1
    ]
    names = [
        f"{low:02d}" if low == high else f"{low:02d} to {high:02d}"
        for low, high in gaps
    ]
    if not names:
        return ()
    return (
        f"{first}: of the files after it {list_names(names, most=5)} are not there; are they missing?",
    )
